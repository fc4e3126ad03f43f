//! Fits of equations with kinks, whose optima have no derivative on a mesh.

use crate::command::{Folder, example};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

const MODEL: &str = "[model]\nname = \"servo\"\n[inputs]\nu = {}\n[parameters]\nzone = { start = 0.1, min = 0, max = 5 }\n\
                     tau = { start = 1, min = 0.01, max = 10 }\n[states]\nx = { der = \"deadzone(u - x, zone) / tau\" }\n";

const TRUTH: [f64; 2] = [0.3, 0.4];
const NOISE: f64 = 0.05;

fn input(run: u64, t: f64) -> f64 {
    let phase = run as f64;
    1.2 * (0.5 * t + phase).sin() + 0.7 * (1.3 * t + 2.0 * phase).sin() + 0.3 * (3.1 * t).sin()
}

/// `x' = deadzone(u - x, zone)/tau`, by Euler's method with steps of 0.5 ms along a table of `u` that is linear between rows.
fn recording(run: u64) -> String {
    let [zone, tau] = TRUTH;
    let mut random = ChaCha8Rng::seed_from_u64(run);
    let (mut x, mut text) = (0.0, "time,u,x\n".to_owned());
    for row in 0..600 {
        let (t, u) = (0.05 * f64::from(row), input(run, 0.05 * f64::from(row)));
        let noise: f64 = StandardNormal.sample(&mut random);
        text += &format!("{t:.2},{u:.12},{:.9}\n", x + NOISE * noise);
        let next = input(run, t + 0.05);
        for k in 0..100 {
            let e: f64 = u + (next - u) * f64::from(k) / 100.0 - x;
            let beyond = e.signum() * (e.abs() - zone).max(0.0);
            x += 0.0005 * beyond / tau;
        }
    }
    text
}

fn problem(zone: f64, tau: f64) -> String {
    format!(
        "[system.m]\nmodel = \"m.toml\"\n[inputs]\n\"m.u\" = {{ column = \"u\", hold = \"linear\" }}\n[[measured]]\n\
         signal = \"m.x\"\ncolumn = \"x\"\nsd = {NOISE}\n[parameters]\n\"m.zone\" = {{ start = {zone} }}\n\"m.tau\" = {{ start = {tau} }}\n\
         [[run]]\nfile = \"0.csv\"\n[[run]]\nfile = \"1.csv\"\n[fit]\nmesh_tolerance = 1e-6\n"
    )
}

/// From afar the fit finds the truth, and no parameters nearby have a smaller sum of squares in a simulation, in which no mesh
/// and no derivative takes part.
#[test]
fn a_dead_zone_is_found_where_its_sum_of_squares_is_least() {
    let folder = Folder::new();
    folder.write("m.toml", MODEL);
    for run in 0..2 {
        folder.write(&format!("{run}.csv"), recording(run));
    }
    let run = |zone: f64, tau: f64, flags: &[&str]| -> Value {
        folder.write("problem.toml", problem(zone, tau));
        let words = [&["fit", "problem.toml", "--json", "--force"], flags].concat();
        let ended = folder.pilotage(&words);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        ended.json()
    };
    let found = run(0.05, 2.0, &[]);
    assert_eq!(found["status"], "converged");
    let values: Vec<[f64; 2]> = (["m.zone", "m.tau"].iter())
        .map(|name| ["value", "sd"].map(|key| found["parameters"][name][key].as_f64().unwrap()))
        .collect();
    for ([value, sd], truth) in values.iter().zip(TRUTH) {
        assert!((value - truth).abs() < 4.0 * sd, "{value} {sd} {truth}");
    }
    let [[zone, by_zone], [tau, by_tau]] = values[..] else {
        unreachable!("two parameters")
    };
    let objective = |zone: f64, tau: f64| {
        run(zone, tau, &["--evaluate"])["objective"]
            .as_f64()
            .unwrap()
    };
    let least = objective(zone, tau);
    assert!((found["objective"].as_f64().unwrap() - least).abs() < 1e-3 * least);
    for [a, b] in [
        [1.0, 0.0],
        [-1.0, 0.0],
        [0.0, 1.0],
        [0.0, -1.0],
        [0.7, 0.7],
        [-0.7, 0.7],
    ] {
        let beside = objective(zone + 0.5 * a * by_zone, tau + 0.5 * b * by_tau);
        assert!(beside > least, "{a} {b}: {beside} {least}");
    }
}

/// A limit that nothing reaches has no effect, and no search leaves such a plateau. The fit looks beyond it.
#[test]
fn a_limit_is_found_from_where_it_has_no_effect() {
    let text = std::fs::read_to_string(example("problems/rate_limited/problem.toml")).unwrap();
    let folder = Folder::new();
    for run in ["run1.csv", "run2.csv", "run3.csv"] {
        let rows =
            std::fs::read_to_string(example(&format!("problems/rate_limited/{run}"))).unwrap();
        folder.write(run, rows);
    }
    let fitted = |start: &str| -> Value {
        let begin = text.replace("start = 0.6, min = 0.1, max = 20", start);
        assert!(begin != text || start.starts_with("start = 0.6"));
        folder.write("problem.toml", begin);
        let words = [
            "fit",
            "problem.toml",
            "--json",
            "--force",
            "--random-starts",
            "0",
        ];
        folder.pilotage(&words).json()
    };
    let [near, far] = [
        "start = 0.6, min = 0.1, max = 20",
        "start = 15, min = 0.1, max = 20",
    ]
    .map(fitted);
    let rate = |own: &Value| own["parameters"]["pilot.rate"]["value"].as_f64().unwrap();
    assert!(
        (rate(&near) / rate(&far) - 1.0).abs() < 1e-3,
        "{} {}",
        rate(&near),
        rate(&far)
    );
    let objective = |own: &Value| own["objective"].as_f64().unwrap();
    assert!((objective(&near) / objective(&far) - 1.0).abs() < 1e-5);
}
