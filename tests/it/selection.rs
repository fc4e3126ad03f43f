//! What a fit tells of runs that it has not seen: `--leave-one-out`, `--per-run`, `--orders`, and what inputs leave in residuals.

use crate::command::{Folder, example};
use crate::compare::{RUNS, flights, problem};
use pilotage::estimation::orders::ordered;
use pilotage::flights::{FlightOptions, TrialSet, open};
use pilotage::inference::choice::choose;
use pilotage::sqp::Status;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

fn fitted(folder: &Folder, words: &[&str]) -> Value {
    let words = [&["fit"], words, &["--json", "--force"]].concat();
    let ended = folder.pilotage(&words);
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.json()
}

fn codes(fit: &Value) -> Vec<&str> {
    let doubts = fit["doubts"].as_array().unwrap().iter();
    doubts.map(|own| own["code"].as_str().unwrap()).collect()
}

/// Each run is told as `compare` tells it, and as `fit` tells a validation run.
#[test]
fn a_run_that_is_left_out_is_one_for_validation() {
    let folder = flights(1, 5);
    let fit = fitted(&folder, &["first.toml", "--leave-one-out"]);
    let names = ["compare", "first.toml", "second.toml", "--json"];
    let compared = &folder.pilotage(&names).json()["problems"][0]["held_out"];
    let left_out = fit["leave_one_out"].as_array().unwrap();
    assert_eq!(left_out.len(), RUNS);
    for own in left_out {
        let [a, b] = [&own["surprise"], &compared[own["name"].as_str().unwrap()]];
        let [a, b] = [a, b].map(|own| own.as_f64().unwrap());
        assert!((a - b).abs() < 1e-6 * b.abs(), "{own}: {b}");
    }
    let (old, new) = ("run2.csv\"\n", "run2.csv\"\nuse = \"validation\"\n");
    folder.write("without.toml", problem("one", RUNS).replace(old, new));
    let without = fitted(&folder, &["without.toml"]);
    let validated = &without["runs"][RUNS - 1]["measured"]["y"];
    let own = &left_out[1]["measured"]["y"];
    for key in ["vaf", "fit"] {
        let [a, b] = [&own[key], &validated[key]].map(|own| own.as_f64().unwrap());
        assert!((a - b).abs() < 1e-5, "{key}: {a} {b}");
    }
}

/// Six runs of one lag; the last is as fast as is said, and its noise is white.
fn last_at(rate: f64) -> Folder {
    let folder = flights(1, 6);
    let mut generator = ChaCha8Rng::seed_from_u64(12);
    for k in 1..=RUNS {
        let own = if k == RUNS { rate } else { 1.5 };
        let rows = (0..=200).map(|i| {
            let t = 0.05 * f64::from(i);
            let draw: f64 = StandardNormal.sample(&mut generator);
            format!("{t},1,{}\n", 1.0 - (-own * t).exp() + 0.05 * draw)
        });
        let text = format!("time,u,y\n{}", rows.collect::<String>());
        folder.write(&format!("run{k}.csv"), text);
    }
    folder
}

#[test]
fn one_human_is_told_from_two() {
    let one = fitted(&last_at(1.5), &["first.toml", "--per-run"]);
    let per_run = &one["per_run"];
    assert_eq!(per_run["one_human"], true, "{per_run}");
    assert!(per_run["homogeneity"]["p"].as_f64().unwrap() > 0.05);
    assert_eq!(per_run["homogeneity"]["degrees_of_freedom"], 5.0);

    let folder = last_at(2.2);
    let two = fitted(&folder, &["first.toml", "--per-run"]);
    let per_run = &two["per_run"];
    assert_eq!(per_run["one_human"], false, "{per_run}");
    assert!(per_run["parameters"]["m.fast"]["p"].as_f64().unwrap() < 1e-3);
    let verdict = per_run["verdict"].as_str().unwrap();
    assert!(verdict.contains("most in `m.fast`"), "{verdict}");
    let last = &per_run["groups"][RUNS - 1];
    let own = &last["parameters"]["m.fast"];
    let [value, low, high] = ["value", "low", "high"].map(|key| own[key].as_f64().unwrap());
    assert!(low < 2.2 && 2.2 < high, "{own}");

    let alone = problem("one", RUNS);
    let runs: Vec<&str> = alone.split("[[run]]\n").collect();
    let alone = format!("{}[[run]]\n{}", runs[0], runs[RUNS]);
    folder.write("alone.toml", alone);
    let fit = fitted(&folder, &["alone.toml", "--covariance", "ar"]);
    let own = &fit["parameters"]["m.fast"];
    for (key, found) in [("value", value), ("low", low), ("high", high)] {
        let expected = own[key].as_f64().unwrap();
        assert!(
            (expected / found - 1.0).abs() < 1e-5,
            "{key}: {expected} {found}"
        );
    }
}

/// Runs of subjects stand together.
#[test]
fn subjects_are_fitted_alone() {
    let folder = last_at(1.5);
    let mut text = problem("one", RUNS);
    for k in 1..=RUNS {
        let subject = ["ann", "bob"][k % 2];
        let line = format!("run{k}.csv\"\n");
        text = text.replace(&line, &format!("{line}subject = \"{subject}\"\n"));
    }
    folder.write("subjects.toml", text);
    let fit = fitted(&folder, &["subjects.toml", "--per-run"]);
    let groups = fit["per_run"]["groups"].as_array().unwrap();
    let names: Vec<&Value> = groups.iter().map(|own| &own["name"]).collect();
    assert_eq!(names, ["bob", "ann"]);
    assert_eq!(fit["per_run"]["homogeneity"]["degrees_of_freedom"], 1.0);
}

/// The linear model alone, from the input to what is recorded.
pub fn linear(runs: usize) -> String {
    let text =
        problem("one", runs).replace("model = \"one.toml\"", "model = \"linear\"\norder = 1");
    let text = text.replace("m.u", "m.target").replace("m.y", "m.stick");
    let limit = "[parameters]\n\"m.stick_limit\" = { start = 5, fixed = true }\n";
    text.replace("[parameters]\n", limit)
}

#[test]
fn the_order_that_is_taken_is_that_of_the_data() {
    for (lags, seed, taken) in [(1, 3, "order 1"), (2, 4, "order 2")] {
        let folder = flights(lags, seed);
        folder.write("linear.toml", linear(RUNS));
        let fit = fitted(&folder, &["linear.toml", "--orders", "1..2"]);
        assert_eq!(fit["orders"]["taken"], taken, "{}", fit["orders"]);
        let coefficients = fit["parameters"].as_object().unwrap().keys();
        let coefficients = coefficients.filter(|name| name.starts_with("m.theta"));
        assert_eq!(coefficients.count(), 2 * lags);
        // The fit that goes on is that of the problem with this order.
        let own = linear(RUNS).replace("order = 1", &format!("order = {lags}"));
        folder.write("own.toml", own.replace("starts = 1", "starts = 8"));
        let own = fitted(&folder, &["own.toml"]);
        let [a, b] = [&fit, &own].map(|fit| fit["objective"].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn orders_of_the_shipped_flights_are_compared() {
    let folder = Folder::new();
    let trials = example("trials/trials.toml").to_str().unwrap().to_owned();
    let fit = fitted(&folder, &[&trials, "--orders", "1..3"]);
    assert_eq!(fit["orders"]["taken"], "order 2", "{}", fit["orders"]);
    let alone = fitted(&folder, &[&trials, "--order", "2"]);
    let [a, b] = [&fit, &alone].map(|fit| fit["objective"].as_f64().unwrap());
    assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
}

/// Where the observer stops the fit of an order, the lower ones stay as they are, and no higher one is fitted.
#[test]
fn orders_that_are_stopped_keep_those_before() {
    let set = TrialSet::read(&[example("trials/trials.toml")]).expect("the shipped flights");
    let file = FlightOptions::default().problem(&set).expect("a problem");
    // In the middle of the fit of order 3, after two orders with and without each run.
    let asked = AtomicUsize::new(0);
    let ask = |done: usize, _| {
        let is_last = done >= 2 * (1 + set.fit.len());
        match is_last && asked.fetch_add(1, Ordering::Relaxed) > 10 {
            true => ControlFlow::Break(Status::TimeLimit),
            false => ControlFlow::Continue(()),
        }
    };
    let all = ordered(&file, 1..=4, &open, &ask).expect("fitted");
    let orders: Vec<u32> = all.iter().map(|own| own.order).collect();
    assert_eq!(orders, [1, 2, 3]);
    assert!(all[1].is_whole && all[1].candidate.fit.is_answer());
    assert!(!all[2].is_whole && !all[2].candidate.fit.is_answer());
    let all: Vec<_> = all.into_iter().skip(1).map(|own| own.candidate).collect();
    let finite = all.iter().map(|own| {
        own.figures
            .held_out
            .iter()
            .filter(|own| own.is_finite())
            .count()
    });
    assert_eq!(finite.collect::<Vec<_>>(), [set.fit.len(), 0]);
    let (taken, _) = choose(
        &all.iter()
            .map(|own| own.figures.clone())
            .collect::<Vec<_>>(),
    )
    .expect("one");
    assert_eq!(taken, 0);
}

/// One run of a lag behind an input that moves, which arrives late; its noise is white.
fn late(seconds: f64) -> Folder {
    let folder = flights(1, 6);
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    let input = |t: f64| (0.9 * t).sin() + 0.7 * (2.3 * t + 1.0).sin() + 0.4 * (4.1 * t).cos();
    let (mut x, mut text) = (0.0, String::from("time,u,y\n"));
    for i in 0..=400 {
        let t = 0.05 * f64::from(i);
        let draw: f64 = StandardNormal.sample(&mut generator);
        text += &format!("{t},{},{}\n", input(t), x + 0.05 * draw);
        for k in 0..50 {
            let t = t + 0.001 * (f64::from(k) + 0.5) - seconds;
            x += 0.001 * 1.5 * (if t > 0.0 { input(t) } else { 0.0 } - x);
        }
    }
    folder.write("run1.csv", text);
    let problem = problem("one", 1).replace(
        "\"m.u\" = \"u\"",
        "\"m.u\" = { column = \"u\", hold = \"linear\" }",
    );
    folder.write("run.toml", problem);
    folder
}

#[test]
fn what_an_input_leaves_in_the_residuals_is_doubted() {
    let right = fitted(&late(0.0), &["run.toml"]);
    assert_eq!(codes(&right), [""; 0], "{}", right["doubts"]);
    let wrong = fitted(&late(0.3), &["run.toml"]);
    assert!(codes(&wrong).contains(&"input-left"), "{}", wrong["doubts"]);
    let doubts = wrong["doubts"].as_array().unwrap().iter();
    let words = doubts
        .map(|own| own["words"].as_str().unwrap())
        .collect::<String>();
    assert!(words.contains("of y are correlated with u"), "{words}");
}

/// White residuals are predicted no better by the one before, coloured ones are: AR(1) 0.9 leaves 19 % of their variance.
#[test]
fn one_step_ahead_is_told_beside_the_free_run() {
    let of = |folder: &Folder| {
        let fit = fitted(folder, &["first.toml"]);
        let runs = fit["runs"].as_array().unwrap().iter();
        let ratios = runs.map(|run| {
            let own = &run["measured"]["y"];
            let left = |own: &Value| 100.0 - own["vaf"].as_f64().unwrap();
            left(&own["one_step"]) / left(own)
        });
        ratios.sum::<f64>() / RUNS as f64
    };
    let (white, coloured) = (of(&last_at(1.5)), of(&flights(1, 7)));
    assert!((white - 1.0).abs() < 0.02, "{white}");
    // The fit takes some of what is slow in the noise, which the one before would have told.
    assert!((0.19..0.26).contains(&coloured), "{coloured}");
}

#[test]
fn what_cannot_be_asked_is_refused() {
    let folder = flights(1, 6);
    folder.write("few.toml", problem("one", 1));
    folder.write("linear.toml", linear(RUNS));
    let bounded = "\"m.theta1\" = { min = 0.1 }\n\"m.*\" = {}";
    folder.write(
        "bounded.toml",
        linear(RUNS).replace("\"m.*\" = {}", bounded),
    );
    let trials = example("trials/trials.toml").to_str().unwrap().to_owned();
    for (words, message) in [
        (&["linear.toml", "--orders", "3..2"][..], "the lower first"),
        (&["linear.toml", "--orders", "0..2"], "from 1 to"),
        (&["linear.toml", "--orders", "2"], "such as 1..5"),
        (&["first.toml", "--orders", "1..2"], "one must have it"),
        (&["bounded.toml", "--orders", "1..2"], "m.theta1"),
        (&["few.toml", "--leave-one-out"], "there is 1"),
        (&["few.toml", "--per-run"], "there is 1"),
        (&[&trials, "--orders", "1..2", "--start", "1,2"], "--start"),
        (&[&trials, "--orders", "1..2", "--order", "2"], "--order"),
        (
            &[&trials, "--orders", "1..2", "--objective", "both"],
            "--objective",
        ),
    ] {
        let ended = folder.pilotage(&[&["fit"], words].concat());
        assert_eq!(ended.code, 2, "{words:?}: {ended:?}");
        assert!(
            ended.stderr.contains(message),
            "{words:?}: {}",
            ended.stderr
        );
    }
    assert_eq!(
        json!(null),
        folder
            .pilotage(&["fit", "few.toml", "--json", "--force"])
            .json()["per_run"]
    );
}
