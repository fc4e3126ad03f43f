//! `pilotage compare`: which of several models of the same runs.

use crate::command::Folder;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;

/// What is recorded follows the input through one lag, or through two.
const ONE: &str = r#"[model]
name = "one"
[inputs]
u = {}
[parameters]
fast = { start = 1, min = 0.01, max = 100 }
[states]
x = { der = "fast * (u - x)" }
[outputs]
y = "x"
"#;

const TWO: &str = r#"[model]
name = "two"
[inputs]
u = {}
[parameters]
fast = { start = 1, min = 0.01, max = 100 }
slow = { start = 5, min = 0.01, max = 1000 }
[states]
x = { der = "fast * (u - x)" }
z = { der = "slow * (x - z)" }
[outputs]
y = "z"
"#;

pub const RUNS: usize = 6;

pub fn problem(model: &str, runs: usize) -> String {
    let lines = (1..=runs).map(|k| format!("[[run]]\nfile = \"run{k}.csv\"\n"));
    format!(
        "[system.m]\nmodel = \"{model}.toml\"\n[inputs]\n\"m.u\" = \"u\"\n[[measured]]\nsignal = \"m.y\"\n\
         column = \"y\"\nsd = 0.05\n[parameters]\n\"m.*\" = {{}}\n[initial]\n\"m.*\" = 0\n{}[fit]\nstarts = 1\n",
        lines.collect::<String>()
    )
}

/// Runs of one lag, or of two, with noise as coloured as that of flights: AR(1) 0.9.
pub fn flights(lags: usize, seed: u64) -> Folder {
    let folder = Folder::new();
    folder.write("one.toml", ONE);
    folder.write("two.toml", TWO);
    folder.write("first.toml", problem("one", RUNS));
    folder.write("second.toml", problem("two", RUNS));
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    for k in 1..=RUNS {
        let (mut x, mut z, mut noise) = (0.0, 0.0, 0.0);
        let mut text = String::from("time,u,y\n");
        for i in 0..=200 {
            let t = 0.05 * f64::from(i);
            let draw: f64 = StandardNormal.sample(&mut generator);
            noise = 0.9 * noise + 0.05 * (1.0_f64 - 0.81).sqrt() * draw;
            let y: f64 = [x, z][lags - 1];
            text += &format!("{t},1,{}\n", y + noise);
            // The input is 1 throughout: the step of each lag is exact enough in parts of a thousandth.
            for _ in 0..50 {
                x += 0.001 * 1.5 * (1.0 - x);
                z += 0.001 * 3.0 * (x - z);
            }
        }
        folder.write(&format!("run{k}.csv"), text);
    }
    folder
}

#[test]
fn the_smaller_model_is_taken_where_the_larger_predicts_no_better() {
    let folder = flights(1, 3);
    let json = folder
        .pilotage(&["compare", "second.toml", "first.toml", "--json"])
        .json();
    assert_eq!(json["taken"], "first.toml");
    let ended = folder.pilotage(&["compare", "second.toml", "first.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(
        ended.stdout.contains("taken: first.toml"),
        "{}",
        ended.stdout
    );
}

#[test]
fn the_larger_model_is_taken_where_it_predicts_better() {
    let folder = flights(2, 4);
    let json = folder
        .pilotage(&["compare", "first.toml", "second.toml", "--json"])
        .json();
    assert_eq!(json["taken"], "second.toml");
    assert!(json["comparisons"][0]["p"].as_f64().unwrap() < 0.05);
}

/// What a run says when it is left out is what `fit` says of it as a validation run, and the criteria are their formulas.
#[test]
fn figures_are_those_of_fits() {
    let folder = flights(1, 5);
    let json = folder
        .pilotage(&["compare", "first.toml", "second.toml", "--json"])
        .json();
    let own = &json["problems"][0];
    let without =
        problem("one", RUNS).replace("run2.csv\"\n", "run2.csv\"\nuse = \"validation\"\n");
    folder.write("without.toml", without);
    let fit = folder.pilotage(&["fit", "without.toml", "--json"]).json();
    let run = &fit["runs"][RUNS - 1];
    assert_eq!(run["name"], "run2.csv");
    let rms = run["measured"]["y"]["rms_per_sd"].as_f64().unwrap();
    let surprise = 201.0 * (rms * rms + (2.0 * PI * 0.05 * 0.05).ln());
    let held_out = own["held_out"]["run2.csv"].as_f64().unwrap();
    assert!((held_out - surprise).abs() < 1e-3, "{held_out} {surprise}");
    let (nllh, n) = (own["nllh"].as_f64().unwrap(), 201.0 * RUNS as f64);
    assert_eq!(own["unknowns"], 1);
    assert!((own["aicc"].as_f64().unwrap() - (2.0 * nllh + 2.0 * n / (n - 2.0))).abs() < 1e-9);
    assert!((own["bic"].as_f64().unwrap() - (2.0 * nllh + n.ln())).abs() < 1e-9);
    // The noise is coloured, and nothing beyond it is left.
    assert!(run["measured"]["y"]["ljung_box"]["p"].as_f64().unwrap() < 1e-3);
    assert!(run["measured"]["y"]["vaf"].as_f64().unwrap() > 90.0);
}

#[test]
fn other_data_and_too_few_runs_are_told() {
    let folder = flights(1, 6);
    folder.write("fewer.toml", problem("two", 2));
    folder.write("few.toml", problem("one", 2));
    let ended = folder.pilotage(&["compare", "first.toml", "fewer.toml"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.contains("fewer.toml: other runs are fitted"),
        "{}",
        ended.stderr
    );
    let ended = folder.pilotage(&["compare", "few.toml", "fewer.toml"]);
    assert_eq!(ended.code, 1);
    assert!(
        ended.stdout.contains("fewer than 3 runs"),
        "{}",
        ended.stdout
    );
    assert_eq!(folder.pilotage(&["compare", "first.toml"]).code, 2);
}

/// Runs of one lag that begin anywhere.
fn flights_from_anywhere(lags: usize) -> Folder {
    let folder = flights(1, 6);
    let mut generator = ChaCha8Rng::seed_from_u64(8);
    for k in 1..=RUNS {
        let begin = 2.0 * f64::from(u32::try_from(k).unwrap()) - 5.0;
        let mut text = String::from("time,u,y\n");
        for i in 0..=100 {
            let t = 0.05 * f64::from(i);
            let (fast, slow) = ((-1.5 * t).exp(), (-3.0 * t).exp());
            let x = 1.0 + (begin - 1.0) * fast;
            // The second lag begins where the first does.
            let z = 1.0 + (begin - 1.0) * (2.0 * fast - slow);
            let draw: f64 = StandardNormal.sample(&mut generator);
            text += &format!("{t},1,{}\n", [x, z][lags - 1] + 0.05 * draw);
        }
        folder.write(&format!("run{k}.csv"), text);
    }
    for name in ["first.toml", "second.toml"] {
        let text = std::fs::read_to_string(folder.path(name)).unwrap();
        // Equal lags are a local optimum: one start does not do.
        let text = text.replace("starts = 1", "starts = 8");
        folder.write(name, text.replace("\"m.*\" = 0", "\"m.*\" = \"free\""));
    }
    folder
}

/// Where a run begins is its own: it is sought in a run that is left out, and in one for validation.
#[test]
fn free_initial_states_are_those_of_the_run_itself() {
    let folder = flights_from_anywhere(2);
    let json = folder
        .pilotage(&["compare", "first.toml", "second.toml", "--json"])
        .json();
    assert_eq!(json["taken"], "second.toml", "{json}");
    let own = json["problems"][1]["held_out"]["run2.csv"]
        .as_f64()
        .unwrap();
    let text = std::fs::read_to_string(folder.path("second.toml")).unwrap();
    folder.write(
        "without.toml",
        text.replace("run2.csv\"\n", "run2.csv\"\nuse = \"validation\"\n"),
    );
    let fit = folder.pilotage(&["fit", "without.toml", "--json"]).json();
    let run = &fit["runs"][RUNS - 1];
    let rms = run["measured"]["y"]["rms_per_sd"].as_f64().unwrap();
    assert!((0.7..1.3).contains(&rms), "{rms}");
    let surprise = 101.0 * (rms * rms + (2.0 * PI * 0.05 * 0.05).ln());
    assert!((own - surprise - 4.0).abs() < 1e-3, "{own} {surprise}");
}

/// A filter's predictions are judged beside simulations: the noise of these runs goes through the lag.
#[test]
fn predictions_are_compared_with_simulations() {
    let folder = flights(1, 10);
    let mut generator = ChaCha8Rng::seed_from_u64(11);
    for k in 1..=RUNS {
        let (mut x, mut text) = (0.0, String::from("time,u,y\n"));
        for i in 0..=200 {
            let draw: f64 = StandardNormal.sample(&mut generator);
            text += &format!("{},1,{}\n", 0.05 * f64::from(i), x + 0.01 * draw);
            for _ in 0..50 {
                let draw: f64 = StandardNormal.sample(&mut generator);
                x += 0.001 * 1.5 * (1.0 - x) + 0.001_f64.sqrt() * 0.1 * draw;
            }
        }
        folder.write(&format!("run{k}.csv"), text);
    }
    let first = std::fs::read_to_string(folder.path("first.toml")).unwrap();
    let filtered = first
        .replace("sd = 0.05", "sd = 0.01")
        .replace("starts = 1", "starts = 1\nobjective = \"prediction-error\"")
        .replacen(
            "[[run]]",
            "[process_noise]\n\"m.x\" = { density = \"q\" }\n[[run]]",
            1,
        )
        .replace(
            "[parameters]",
            "[parameters]\nq = { start = 0.1, min = 0, unit = \"s-1\" }",
        );
    folder.write("filtered.toml", filtered);
    let json = folder
        .pilotage(&["compare", "first.toml", "filtered.toml", "--json"])
        .json();
    assert_eq!(json["taken"], "filtered.toml", "{json}");
    let fit = folder.pilotage(&["fit", "filtered.toml", "--json"]).json();
    let q = fit["parameters"]["q"]["value"].as_f64().unwrap();
    assert!((0.008..0.012).contains(&q), "{fit}");
}

#[test]
fn other_weights_are_refused() {
    let folder = flights(1, 7);
    let heavy = problem("two", RUNS).replace("run3.csv\"\n", "run3.csv\"\nweight = 2\n");
    folder.write("heavy.toml", heavy);
    let ended = folder.pilotage(&["compare", "first.toml", "heavy.toml"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    let message = "heavy.toml: the run run3.csv has the weight 2, and 1 in first.toml";
    assert!(ended.stderr.contains(message), "{}", ended.stderr);
}

/// A column in metres, read as it is and as centimetres; what the message says to write makes them comparable.
#[test]
fn a_column_in_other_units_is_refused() {
    let folder = flights(1, 8);
    for k in 1..=RUNS {
        let name = format!("run{k}.csv");
        let text = folder
            .read(&name)
            .replacen("time,u,y\n", "time,u,y [m]\n", 1);
        folder.write(&name, text);
    }
    let metres = ONE.replace("y = \"x\"", "y = { value = \"x\", unit = \"m\" }");
    let metres = metres.replace("x = { der", "x = { unit = \"m\", der");
    let metres = metres.replace("u = {}", "u = { unit = \"m\" }");
    let metres = metres.replace("fast = {", "fast = { unit = \"1/s\",");
    folder.write("cm.toml", metres.replace("unit = \"m\"", "unit = \"cm\""));
    folder.write("m.toml", metres);
    folder.write("in_m.toml", problem("m", RUNS));
    let scaled = problem("cm", RUNS).replace("sd = 0.05", "sd = 5");
    folder.write("in_cm.toml", &scaled);
    let ended = folder.pilotage(&["compare", "in_m.toml", "in_cm.toml"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    let message = "is read in cm, and in m in in_m.toml";
    assert!(ended.stderr.contains(message), "{}", ended.stderr);
    let advice = "expression = \"0.01 * m.y\" with unit = \"m\"";
    assert!(ended.stderr.contains(advice), "{}", ended.stderr);
    let written = scaled.replace(
        "signal = \"m.y\"",
        "expression = \"0.01 * m.y\"\nunit = \"m\"",
    );
    folder.write("in_cm.toml", written.replace("sd = 5", "sd = 0.05"));
    let ended = folder.pilotage(&["compare", "in_m.toml", "in_cm.toml"]);
    assert_ne!(ended.code, 2, "{ended:?}");
}

/// Runs that each begin elsewhere: a left-out run begins with what it tells of that itself. With θ held the least squares
/// of a decay's begin are a line through the origin, and the estimate counts 2.
#[test]
fn a_left_out_run_tells_its_own_initial_state() {
    let folder = Folder::new();
    let decay = "[model]\nname = \"d\"\n[parameters]\nrate = { start = 1, min = 0, max = 9 }\n[states]\n\
                 x = { start = 1, der = \"-rate * x\" }\n[outputs]\ny = \"x\"\n";
    folder.write("decay.toml", decay);
    let mut generator = ChaCha8Rng::seed_from_u64(12);
    let mut recorded = Vec::new();
    for k in 1..=3 {
        let mut values = Vec::new();
        for i in 0..=20 {
            let t = 0.1 * f64::from(i);
            let draw: f64 = StandardNormal.sample(&mut generator);
            values.push((t, 10.0 * f64::from(k) * (-1.5 * t).exp() + 0.1 * draw));
        }
        let rows = values.iter().map(|(t, y)| format!("{t},{y}\n"));
        folder.write(
            &format!("run{k}.csv"),
            format!("time,y\n{}", rows.collect::<String>()),
        );
        recorded.push(values);
    }
    let text = |last: &str| {
        let run = |k: i32| format!("[[run]]\nfile = \"run{k}.csv\"\n");
        format!(
            "[system.m]\nmodel = \"decay.toml\"\n[[measured]]\nsignal = \"m.y\"\ncolumn = \"y\"\nsd = 0.1\n\
             [parameters]\n\"m.rate\" = {{}}\n[initial]\n\"m.x\" = \"free\"\n{}{}{}{last}",
            run(1),
            run(2),
            run(3)
        )
    };
    folder.write("a.toml", text(""));
    folder.write("b.toml", text(""));
    folder.write("c.toml", text("use = \"validation\"\n"));
    let fit = folder.pilotage(&["fit", "c.toml", "--json"]).json();
    let rate = fit["parameters"]["m.rate"]["value"].as_f64().unwrap();
    let last = &fit["runs"][2];
    let shape = |t: f64| (-rate * t).exp();
    let products: f64 = recorded[2].iter().map(|(t, y)| shape(*t) * y).sum();
    let squares: f64 = recorded[2].iter().map(|(t, _)| shape(*t).powi(2)).sum();
    let begin = products / squares;
    let found = last["initial"]["m.x"].as_f64().unwrap();
    assert!((found - begin).abs() < 1e-5 * begin, "{found} {begin}");
    let surprise = recorded[2]
        .iter()
        .map(|(t, y)| ((y - begin * shape(*t)) / 0.1).powi(2) + (2.0 * PI * 0.01).ln());
    let surprise = surprise.sum::<f64>() + 2.0;
    let json = folder
        .pilotage(&["compare", "a.toml", "b.toml", "--json"])
        .json();
    let held_out = json["problems"][0]["held_out"]["run3.csv"]
        .as_f64()
        .unwrap();
    assert!((held_out - surprise).abs() < 1e-3, "{held_out} {surprise}");
}
