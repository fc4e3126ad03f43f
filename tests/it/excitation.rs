//! What is said of flights and problems before they are fitted, each beside data of which it is not said.

use crate::command::{Folder, example};
use serde_json::{Value, json};

fn synth(folder: &Folder, words: &str) {
    let words: Vec<&str> = words.split(' ').collect();
    let ended = folder.pilotage(&[&["trials", "synth"], &words[..]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
}

fn checked(folder: &Folder, files: &[&str]) -> Value {
    let ended = folder.pilotage(&[&["trials", "check", "--json"], files].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.json()["excitation"].clone()
}

fn codes(fit: &Value) -> Vec<&str> {
    let doubts = fit["doubts"].as_array().unwrap().iter();
    doubts.map(|own| own["code"].as_str().unwrap()).collect()
}

#[test]
fn flights_are_told_apart_by_what_they_excite() {
    let folder = Folder::new();
    synth(
        &folder,
        "--target sines --runs 2 --duration 60 --bandwidth 0.8 -o sines",
    );
    let sines = checked(&folder, &["sines/run1.csv", "sines/run2.csv"]);
    assert_eq!(sines["kind"], "lines");
    assert_eq!(sines["most_parameters"], 16);
    // Primes of turns in a minute, from 2 to 31; amplitudes fall above the bandwidth.
    let first = sines["frequency_rad_per_s"][0].as_f64().unwrap();
    assert!((first - 2.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9);
    let top = sines["coherent_up_to_rad_per_s"].as_f64().unwrap();
    assert!((top - 31.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9);
    let amplitude = sines["forcing"][7].as_f64().unwrap();
    assert!((amplitude - 2.0 * (0.8 / top).powi(2)).abs() < 1e-3);
    assert_eq!(sines["words"].as_array().unwrap().len(), 1);

    // The hand is lost in its own noise.
    synth(
        &folder,
        "--target sines --runs 2 --duration 60 --bandwidth 0.8 --remnant 1 -o noisy",
    );
    let noisy = checked(&folder, &["noisy/run1.csv", "noisy/run2.csv"]);
    assert!(noisy["most_parameters"].as_u64() < Some(16), "{noisy}");

    synth(&folder, "--target ramps --runs 3 --duration 60 -o ramps");
    let ramps = checked(&folder, &["ramps/trials.toml"]);
    assert_eq!(ramps["kind"], "bands");
    assert_eq!(ramps["words"].as_array().unwrap().len(), 1);
    let still = example("trials/trials.toml");
    let still = checked(&folder, &[still.to_str().unwrap()]);
    let words = still["words"].as_array().unwrap();
    assert!(
        words[1].as_str().unwrap().contains("--target sines"),
        "{words:?}"
    );
}

/// Short runs, missing and repeated values, a stick that does nothing, other rates: no number is made up.
#[test]
fn what_tells_nothing_is_left_open() {
    let folder = Folder::new();
    let rows = |step: f64, count: u32, position: &str| {
        let row = |k: u32| format!("{},1,{position},0\n", f64::from(k) * step);
        "time [s],target,position,stick\n".to_owned() + &(0..count).map(row).collect::<String>()
    };
    folder.write("short.csv", rows(1.0, 10, "0"));
    folder.write("fast.csv", rows(0.01, 300, "0.5"));
    let gaps = rows(0.05, 100, "0")
        .replace("\n2,1,0,0", "\n2.01,1,,")
        .replace("\n4,1,0,0", "\n4,1,,");
    folder.write("gaps.csv", gaps);
    let files = ["short.csv", "fast.csv", "gaps.csv"];
    for count in 1..=3 {
        let own = checked(&folder, &files[..count]);
        assert_eq!(own["kind"], "bands");
        assert_eq!(own["coherent_up_to_rad_per_s"], Value::Null);
        assert_eq!(own["least_delay_s"], Value::Null);
        let coherence = own["coherence"].as_array().unwrap();
        assert!(coherence.iter().all(Value::is_null), "{own}");
        let table = folder.pilotage(&[&["trials", "check"], &files[..count]].concat());
        assert!(table.stdout.contains("octaves of the target"), "{table:?}");
    }
}

#[test]
fn more_parameters_than_lines_tell_are_told() {
    let folder = Folder::new();
    for (count, is_reported) in [(2, true), (4, false)] {
        let name = format!("{count}");
        synth(
            &folder,
            &format!(
                "--target sines --count {count} --runs 2 --duration 40 --bandwidth 0.8 -o {name}"
            ),
        );
        let runs = [1, 2].map(|run| format!("{name}/run{run}.csv"));
        let flags = ["--max-iterations=2", "--json", "--force"];
        let words = [&["fit", &runs[0], &runs[1]], &flags[..]].concat();
        let ended = folder.pilotage(&words);
        assert!(
            ended.json()["excitation"]["forcing"]["words"][0]
                .as_str()
                .unwrap()
                .starts_with(&format!("excitation: {count} lines")),
            "{ended:?}"
        );
        let fit = ended.json();
        assert_eq!(codes(&fit).contains(&"few-lines"), is_reported, "{count}");
        assert_eq!(fit["excitation"]["forcing"]["most_parameters"], 2 * count);
    }
}

/// `x' = -a b x` from 2.
fn decay(parameters: &str, options: &str) -> Folder {
    let folder = Folder::new();
    let model = r#"
        [model]
        name = "decay"
        [parameters]
        a = { start = 0.5, unit = "1/s" }
        b = { start = 1, unit = "1" }
        c = { start = 1, unit = "1" }
        [states]
        x = { start = 2, der = "-a * b * x + 1e-9 * c * x" }"#;
    folder.write("decay.toml", model);
    let row = |k: u32| {
        let time = 0.2 * f64::from(k);
        let noise = 0.01 * (5.0 * time).sin();
        format!("{time},{}\n", 2.0 * (-0.5 * time).exp() + noise)
    };
    folder.write(
        "run.csv",
        "time [s],x\n".to_owned() + &(0..20).map(row).collect::<String>(),
    );
    let problem = format!(
        r#"
        [system.m]
        model = "decay.toml"
        [[measured]]
        signal = "m.x"
        column = "x"
        sd = 0.1
        [parameters]
        {parameters}
        [[run]]
        file = "run.csv"
        [fit]
        {options}"#
    );
    folder.write("problem.toml", problem);
    folder
}

/// Only the product counts; before the solve that is a note, and a doubt of a fit that did not come to an end.
#[test]
fn what_cannot_be_told_apart_is_told_before_the_solve() {
    let words = "`m.a` and `m.b` cannot be told apart";
    let both = "\"m.a\" = {}\n\"m.b\" = {}";
    for (options, is_reported) in [("max_iterations = 1", true), ("", false)] {
        let ended = decay(both, options).pilotage(&["fit", "problem.toml", "--json"]);
        assert!(ended.stderr.contains(words), "{ended:?}");
        let fit = ended.json();
        assert_eq!(
            codes(&fit).contains(&"unidentifiable"),
            is_reported,
            "{:?}",
            codes(&fit)
        );
        assert_eq!(codes(&fit).contains(&"undetermined"), !is_reported);
        let identifiability = &fit["excitation"]["identifiability"];
        assert_eq!(identifiability["starts"], 3);
        assert!(
            identifiability["flat"][0]
                .as_str()
                .unwrap()
                .starts_with(words),
            "{identifiability}"
        );
        let least = identifiability["singular_values"][1].as_f64().unwrap();
        assert!(least < 1e-5, "{identifiability}");
    }
    let one =
        decay("\"m.a\" = {}", "max_iterations = 1").pilotage(&["fit", "problem.toml", "--json"]);
    assert_eq!(one.stderr, "");
    assert_eq!(codes(&one.json()), ["not-converged"]);
}

/// At the start `∂x/∂a = -2 t e^(-a t)` with a = 0.5, each sample with a deviation of 0.1, and up to the
/// noise the recording is the path along which the start is linear.
#[test]
fn predicted_deviations_are_those_of_the_derivative() {
    let folder = decay("\"m.a\" = {}", "starts = 1");
    let fit = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let slope = |k: u32| {
        let time = 0.2 * f64::from(k);
        -2.0 * time * (-0.5 * time).exp()
    };
    let expected = 0.1 / (0..20).map(|k| slope(k).powi(2)).sum::<f64>().sqrt();
    let identifiability = &fit["excitation"]["identifiability"];
    let found = identifiability["sd"]["m.a"].as_f64().unwrap();
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    assert_eq!(identifiability["weak"], json!([]));
    // What changes next to nothing is hardly told, or has no effect.
    let folder = decay("\"m.a\" = {}\n\"m.c\" = {}", "starts = 1");
    let ended = folder.pilotage(&["fit", "problem.toml", "--json"]);
    let identifiability = &ended.json()["excitation"]["identifiability"];
    let words = identifiability["flat"]
        .as_array()
        .unwrap()
        .iter()
        .chain(identifiability["weak"].as_array().unwrap());
    assert!(
        words.count() == 1 && ended.stderr.contains("m.c"),
        "{identifiability}"
    );
}

/// Noise that drives the system moves nothing that is simulated, and is told by what is predicted all the same.
#[test]
fn noise_in_the_loop_is_not_called_without_effect() {
    let folder = Folder::new();
    let problem = example("problems/remnant/problem.toml");
    let text = std::fs::read_to_string(&problem).unwrap();
    let here = problem.parent().unwrap();
    for entry in std::fs::read_dir(here).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        folder.write(&name, std::fs::read_to_string(here.join(&name)).unwrap());
    }
    folder.write("problem.toml", text.replace("starts = 2", "starts = 1"));
    let ended = folder.pilotage(&["fit", "problem.toml", "--json"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    assert!(ended.json()["excitation"]["identifiability"].is_null());
}
