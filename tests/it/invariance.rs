//! What must not change a fit: the units of its columns and parameters, and the origin of its clock.

use crate::command::Folder;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

/// Step of the samples \[s\], which no origin below rounds.
const STEP: f64 = 1.0 / 16.0;

/// A fit of m v' = u - c v, of which `v` is `unit` times as large, with a clock that begins at `origin`. One `c` for each run,
/// free initial states, a range of `m`, and, if there is one, a limit of `v`.
fn fit(unit: f64, origin: f64, limit: Option<f64>) -> Value {
    let folder = Folder::new();
    let limit = limit.map_or(String::new(), |limit| {
        format!(", limit = [{:e}, {:e}]", -limit * unit, limit * unit)
    });
    folder.write(
        "m.toml",
        format!(
            "[model]\nname = \"m\"\n[inputs]\nu = {{}}\n[parameters]\nm = {{ start = {:e}, min = 0, max = {:e} }}\n\
             c = {{ start = {:e} }}\n[states]\nv = {{ der = \"(u - c*v)/m\" }}\n[outputs]\ny = {{ value = \"v\"{limit} }}\n",
            2.0 / unit,
            100.0 / unit,
            1.0 / unit
        ),
    );
    folder.write(
        "problem.toml",
        format!(
            "[system.o]\nmodel = \"m.toml\"\n[inputs]\n\"o.u\" = {{ column = \"u\", hold = \"zero-order\" }}\n[[measured]]\n\
             signal = \"o.y\"\ncolumn = \"y\"\nsd = {:e}\n[parameters]\n\"o.m\" = {{}}\n\"o.c\" = {{ per = \"run\" }}\n[initial]\n\
             \"o.v\" = \"free\"\n[[run]]\nfile = \"0.csv\"\n[[run]]\nfile = \"1.csv\"\n",
            0.02 * unit
        ),
    );
    for run in 0..2 {
        let mut random = ChaCha8Rng::seed_from_u64(run);
        let (mass, drag, mut v) = (1.5, 0.8 + 0.3 * run as f64, 0.2);
        let mut text = "time,u,y\n".to_owned();
        for k in 0..320 {
            let phase = 0.05 * f64::from(k) + run as f64;
            let u: f64 = (10.0 * (phase.sin() + (2.3 * phase).cos())).round() / 10.0;
            let noise: f64 = StandardNormal.sample(&mut random);
            let (t, y) = (origin + STEP * f64::from(k), unit * (v + 0.02 * noise));
            text += &format!("{t:?},{u},{y:e}\n");
            let rest = u / drag;
            v = rest + (v - rest) * (-drag / mass * STEP).exp();
        }
        folder.write(&format!("{run}.csv"), text);
    }
    let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
    assert_eq!(ended.code, 0, "{unit:e}, {origin}: {}", ended.stderr);
    ended.json()
}

/// What a fit tells, in units of 1: numbers and words.
fn told(found: &Value, unit: f64) -> (Vec<f64>, Vec<String>) {
    let of = |parameter: &str, what: &str| match &found["parameters"][parameter][what] {
        Value::Object(runs) => runs.values().cloned().collect(),
        one => vec![one.clone()],
    };
    let number = |own: &Value| own.as_f64().unwrap_or(f64::NAN);
    let mut numbers = vec![number(&found["objective"])];
    numbers.push(number(&found["cross_correlations"][0]["p"]));
    let mut words = Vec::new();
    for parameter in ["o.m", "o.c"] {
        for what in ["value", "sd"] {
            numbers.extend(of(parameter, what).iter().map(|own| number(own) * unit));
        }
        words.extend(of(parameter, "class").iter().map(Value::to_string));
    }
    let codes = found["doubts"].as_array().into_iter().flatten();
    words.extend(codes.map(|own| own["code"].to_string()));
    words.push(found["status"].to_string());
    (numbers, words)
}

#[test]
fn units_change_no_fit() {
    for limit in [None, Some(1.2)] {
        let (expected, words) = told(&fit(1.0, 0.0, limit), 1.0);
        assert!(
            expected.iter().all(|number| number.is_finite()),
            "{expected:?}"
        );
        for unit in [1e-12, 1e-7, 1e-4, 1e4, 1e8] {
            let (found, own) = told(&fit(unit, 0.0, limit), unit);
            assert_eq!(own, words, "{unit:e}");
            for (a, b) in found.iter().zip(&expected) {
                assert!(
                    (a - b).abs() < 1e-5 * b.abs(),
                    "{unit:e}: {found:?}, {expected:?}"
                );
            }
        }
    }
}

#[test]
fn the_origin_of_the_clock_changes_no_fit() {
    let mut expected = fit(1.0, 0.0, Some(1.2));
    for origin in [1e6, 1.7e9] {
        let mut found = fit(1.0, origin, Some(1.2));
        for own in [&mut expected, &mut found] {
            own.as_object_mut().unwrap().remove("seconds");
        }
        assert_eq!(found, expected, "{origin}");
    }
}

/// A limit of an output whose slope is 15 at the start and 1e-6 at the limit: x may reach ln(5e5)/15 = 0.8748, and the optimum
/// has a steady state there, but for what it still lacks at the end.
#[test]
fn a_limit_holds_where_its_slope_has_decayed() {
    let folder = Folder::new();
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let row = |k: i32| {
        let (t, noise): (f64, f64) = (0.1 * f64::from(k), StandardNormal.sample(&mut random));
        format!("{t:.1},{:.9}\n", 1.0 - (-t).exp() + 0.02 * noise)
    };
    let rows: String = (0..51).map(row).collect();
    folder.write("r.csv", format!("time,y\n{rows}"));
    folder.write(
        "problem.toml",
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = 0.02\n[parameters]\n\"m.k\" = {}\n\
         \"m.T\" = { min = 0.01 }\n[[run]]\nfile = \"r.csv\"\n[fit]\nlimits = \"constrain\"\n",
    );
    let fit = |limit: &str| {
        folder.write(
            "m.toml",
            format!(
                "[model]\nname = \"m\"\n[parameters]\nk = {{ start = 0.5 }}\nT = 0.7\n[states]\nx = {{ der = \"(k - x)/T\" }}\n\
                 [outputs]\ny = {{ value = \"exp(-15*x)\"{limit} }}\n"
            ),
        );
        let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
        assert_eq!(ended.code, 0, "{ended:?}");
        ended.json()
    };
    let of = |found: &Value, what: &str| found["parameters"]["m.k"][what].as_f64().unwrap();
    let held = fit(", limit = [2e-6, 2]");
    let last = of(&held, "value")
        * (1.0 - (-5.0 / held["parameters"]["m.T"]["value"].as_f64().unwrap()).exp());
    assert!((last - 5e5_f64.ln() / 15.0).abs() < 1e-5, "{last}");
    assert!(held["doubts"].to_string().contains("on-limit"));
    // A limit that is never reached holds nothing.
    let (far, free) = (fit(", limit = [-1, 2]"), fit(""));
    for what in ["value", "sd"] {
        let [far, free] = [&far, &free].map(|found| of(found, what));
        assert!((far - free).abs() < 1e-6 * free, "{what}: {far}, {free}");
    }
}
