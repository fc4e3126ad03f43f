//! Prediction errors: a loop with a human's noise in it, whose truth is known.

use pilotage_estimation::refits::study;
use pilotage_estimation::validation::validated;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_inference::quantile;
use pilotage_inference::residuals::LjungBox;
use pilotage_refits::{End, Kind, Watch, spread};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::ops::ControlFlow;
use tempfile::TempDir;

const MODEL: &str = r#"
[model]
name = "loop"
[inputs]
target = {}
noise = {}
[parameters]
gain = { start = 1, min = 0 }
lag = { start = 0.4, min = 0.01 }
[states]
arm = { der = "(gain * (target - x) + noise - arm) / lag" }
x = { der = "arm" }
"#;

const PROBLEM: &str = r#"
[system.m]
model = "loop.toml"
[inputs]
"m.target" = "target"
[process_noise]
"m.noise" = { density = "q" }
[[measured]]
signal = "m.x"
column = "x"
sd = "s"
[parameters]
"m.*" = {}
q = { start = 0.5, min = 0 }
s = { start = 0.2, min = 1e-3 }
[fit]
objective = "prediction-error"
starts = 2
"#;

/// Gain, lag, density, noise level.
const TRUTH: [(&str, f64); 4] = [("m.gain", 1.5), ("m.lag", 0.3), ("q", 0.05), ("s", 0.03)];
const STEP: f64 = 0.1;
const PARTS: usize = 200;

/// A run by Heun's method in small steps, with noise that is constant in each: every fifth sample is missing.
fn run(seed: u64, samples: usize) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let [gain, lag, q, s] = TRUTH.map(|(_, value)| value);
    let h = STEP / PARTS as f64;
    let knot = |k: usize| {
        let t = STEP * k as f64;
        (0.5 * t + seed as f64).sin() + (1.3 * t).sin() - (seed as f64).sin()
    };
    let mut text = "time,target,x\n".to_owned();
    let mut x = [0.0; 2];
    for k in 0..samples {
        let shown = match k % 5 == 4 {
            true => String::new(),
            false => (x[1] + s * gauss()).to_string(),
        };
        writeln!(text, "{},{},{shown}", STEP * k as f64, knot(k)).unwrap();
        for part in 0..PARTS {
            let noise = (q / h).sqrt() * gauss();
            let at = |part: f64| knot(k) + part / PARTS as f64 * (knot(k + 1) - knot(k));
            let rates =
                |x: [f64; 2], goal: f64| [(gain * (goal - x[1]) + noise - x[0]) / lag, x[0]];
            let a = rates(x, at(part as f64));
            let b = rates([x[0] + h * a[0], x[1] + h * a[1]], at(part as f64 + 1.0));
            x = std::array::from_fn(|i| x[i] + 0.5 * h * (a[i] + b[i]));
        }
    }
    text
}

fn folder(runs: u64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("loop.toml"), MODEL).unwrap();
    for k in 0..runs {
        std::fs::write(folder.path().join(format!("{k}.csv")), run(k, 300)).unwrap();
    }
    folder
}

fn parsed(folder: &TempDir, text: &str) -> ProblemFile {
    let path = folder.path().join("problem.toml");
    ProblemFile::parse(text, &path).unwrap_or_else(|error| panic!("{error}"))
}

fn fitted(file: &ProblemFile) -> Fit {
    let posed = Posed::new(file, &part::open).unwrap_or_else(|error| panic!("{error}"));
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

fn lines(runs: std::ops::Range<u64>) -> String {
    let lines = runs.map(|k| format!("[[run]]\nfile = \"{k}.csv\"\n"));
    lines.collect()
}

/// Value and standard deviation of a shared parameter.
fn estimate(fit: &Fit, name: &str) -> (f64, f64) {
    let place = fit
        .parameters
        .iter()
        .position(|own| own.name == name)
        .unwrap();
    let sure = fit
        .uncertainty
        .as_ref()
        .unwrap_or_else(|error| panic!("{error}"));
    (
        fit.parameters[place].values[0].1,
        sure.intervals[place][0].sd,
    )
}

#[test]
fn the_truth_and_the_noise_are_found_and_innovations_are_white() {
    let folder = folder(5);
    let text =
        PROBLEM.to_owned() + &lines(0..4) + "[[run]]\nfile = \"4.csv\"\nuse = \"validation\"\n";
    let file = parsed(&folder, &text);
    let found = fitted(&file);
    assert!(found.is_answer(), "{:?}", found.diagnostics);
    for (name, truth) in TRUTH {
        let (value, sd) = estimate(&found, name);
        assert!((value - truth).abs() < 4.0 * sd, "{name}: {value} ± {sd}");
        assert!(sd < 0.15 * truth, "{name}: {value} ± {sd}");
    }
    let per_value = found.chi2 / found.samples as f64;
    assert!((per_value - 1.0).abs() < 0.1, "{per_value}");
    let judged = validated(&file, &found, &part::open, &|| ControlFlow::Continue(())).unwrap();
    for run in (found.runs.iter()).chain(judged.iter().map(|own| &own.run)) {
        let ahead = run.ahead.as_ref().unwrap();
        let known: Vec<f64> = ahead.innovations[0]
            .iter()
            .copied()
            .filter(|z| z.is_finite())
            .collect();
        assert_eq!(known.len(), 240);
        let white = LjungBox::of(&known).unwrap();
        assert!(white.p > 1e-3, "{}: {}", run.name, white.p);
        // One step ahead is much nearer than the response, which the noise has left.
        let squares: f64 = run.recorded[0]
            .iter()
            .zip(&run.predicted[0])
            .filter(|(y, _)| y.is_finite())
            .map(|(y, h)| (y - h).powi(2))
            .sum();
        let free = (squares / 240.0).sqrt();
        assert!(run.rms_ahead(0).unwrap() < 0.5 * free, "{}", run.name);
    }
    // −2 ln L of the runs is that of their sum.
    let surprise: f64 = found
        .runs
        .iter()
        .map(|run| run.ahead.as_ref().unwrap().surprise())
        .sum();
    assert!((surprise - 2.0 * found.nllh).abs() < 1e-8 * surprise.abs());
}

/// What a model lacks is not taken for the human's noise without a word: `ẋ = -x + b u + w`, and the same without u.
#[test]
fn a_wrong_model_is_told_by_its_innovations() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(40);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let (mut text, mut x) = ("time,u,y\n".to_owned(), 0.0);
    let decay = f64::exp(-0.1);
    for k in 0..600 {
        let u = if (k / 25) % 2 == 0 { 1.0 } else { -1.0 };
        writeln!(text, "{},{u},{}", 0.1 * f64::from(k), x + 0.02 * gauss()).unwrap();
        x = decay * x + (1.0 - decay) * u + 0.02 * gauss();
    }
    std::fs::write(folder.path().join("run.csv"), text).unwrap();
    let model = "[model]\nname = \"m\"\n[inputs]\nu = {}\nnoise = {}\n[parameters]\na = 1\nb = 1\n[states]\n\
                 x = { der = \"-a * x + b * u + noise\" }\n";
    std::fs::write(folder.path().join("m.toml"), model).unwrap();
    let codes = |b: &str| -> Vec<&'static str> {
        let text = format!(
            "[system.m]\nmodel = \"m.toml\"\n[inputs]\n\"m.u\" = {{ column = \"u\", hold = \"zero-order\" }}\n\
             [process_noise]\n\"m.noise\" = {{ density = \"q\" }}\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n\
             sd = 0.02\n[parameters]\n\"m.a\" = {{}}\n\"m.b\" = {{ {b} }}\nq = {{ start = 0.01, min = 0 }}\n\
             [[run]]\nfile = \"run.csv\"\n[fit]\nobjective = \"prediction-error\"\nstarts = 1\n"
        );
        let found = fitted(&parsed(&folder, &text));
        assert!(found.is_answer(), "{:?}", found.diagnostics);
        found.diagnostics.iter().map(|own| own.code()).collect()
    };
    assert_eq!(codes(""), [""; 0]);
    let blind = codes("start = 0, fixed = true");
    assert!(
        blind.contains(&"coloured") && blind.contains(&"input-left"),
        "{blind:?}"
    );
}

#[test]
fn the_numbers_are_the_same_for_any_number_of_threads() {
    let folder = folder(2);
    let file = parsed(&folder, &(PROBLEM.to_owned() + &lines(0..2)));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let found = pool.install(|| fitted(&file));
        let values = found.parameters.iter().map(|own| own.values[0].1.to_bits());
        (found.objective.to_bits(), values.collect::<Vec<_>>())
    };
    assert_eq!(with(1), with(3));
}

/// Parameters and free states for each run, a state at rest, noise at a state, a constraint, and a density that is not to
/// be had.
#[test]
fn what_runs_have_for_themselves_is_found_too() {
    let folder = folder(3);
    let text = PROBLEM
        .replace("\"m.*\" = {}", "\"m.gain\" = { per = \"run\" }\n\"m.lag\" = { scale = \"log\" }")
        .replace("\"m.noise\" = { density = \"q\" }", "\"m.arm\" = { density = \"q\" }")
        .replace("q = { start = 0.5, min = 0 }", "q = { start = 0.7, min = 0.6 }")
        .replace("[fit]", "[initial]\n\"m.x\" = \"free\"\n\"m.arm\" = \"steady\"\n[[constraint]]\nexpression = \"m.lag\"\nmax = 2\nat = \"parameters\"\n[fit]");
    let found = fitted(&parsed(&folder, &(text + &lines(0..3))));
    assert!(found.is_answer(), "{:?}", found.diagnostics);
    let gain = found
        .parameters
        .iter()
        .find(|own| own.name == "m.gain")
        .unwrap();
    assert_eq!(gain.values.len(), 3);
    assert!(
        gain.values
            .iter()
            .all(|(_, value)| (value - 1.5).abs() < 0.4),
        "{gain:?}"
    );
    // 0.05/0.3² is 0.56: the range ends above it.
    let codes: Vec<&str> = found.diagnostics.iter().map(|own| own.code()).collect();
    assert_eq!(codes, ["at-bound"], "{:?}", found.diagnostics);
    // At rest under the first target.
    for run in &found.runs {
        let (arm, x) = (run.states[0][0], run.states[1][0]);
        let value = gain
            .values
            .iter()
            .find(|(label, _)| label.as_ref() == Some(&run.name))
            .unwrap()
            .1;
        let goal: f64 = folder_target(&folder, &run.name);
        assert!((value * (goal - x) - arm).abs() < 1e-6, "{arm} {x}");
    }
}

fn folder_target(folder: &TempDir, name: &str) -> f64 {
    let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
    text.lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(1)
        .unwrap()
        .parse()
        .unwrap()
}

#[test]
fn the_response_is_what_is_fitted_unless_something_else_is_said() {
    let folder = folder(1);
    let plain = PROBLEM
        .replace("[process_noise]\n\"m.noise\" = { density = \"q\" }\n", "")
        .replace("q = { start = 0.5, min = 0 }\n", "")
        .replace("objective = \"prediction-error\"\n", "")
        + &lines(0..1);
    let explicit = plain.replace("[fit]\n", "[fit]\nobjective = \"response\"\n");
    let [plain, explicit] = [plain, explicit].map(|text| fitted(&parsed(&folder, &text)));
    assert_eq!(plain.objective.to_bits(), explicit.objective.to_bits());
    assert!(plain.runs[0].ahead.is_none());
    // As one Gaussian noise on what was recorded, the noise in the loop is much larger than the sensor's.
    assert!(estimate(&plain, "s").0 > 3.0 * 0.03);
}

/// Each point of a profile is a fit in which the file fixes the parameter; where the interval ends, −2 log likelihood is
/// above the least one by χ². A prior and a range hold in both.
#[test]
fn profiles_of_predictions_are_fits_with_the_parameter_fixed() {
    let folder = folder(2);
    let (gain, lag) = ("\"m.gain\"", "\"m.lag\"");
    let wide = PROBLEM.replace("\"m.*\" = {}", &format!("{gain} = {{}}\n{lag} = {{}}"));
    let (lag_range, prior) = (
        "start = 0.3, min = 0.29, max = 0.31",
        "prior = { normal = [0.4, 0.1] }",
    );
    for (more, name) in [("", "q"), (lag_range, "m.gain"), (prior, "m.lag")] {
        let text = wide.replace(&format!("{lag} = {{}}"), &format!("{lag} = {{ {more} }}"));
        let file = parsed(&folder, &(text.clone() + &lines(0..2)));
        let posed = Posed::new(&file, &part::open).unwrap();
        let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
        let study = study(&posed, &found).unwrap();
        let place = study.unknowns.iter().position(|own| own.name == name);
        let own = study
            .profiles(&[place.unwrap()], &Watch::default())
            .remove(0);
        let objective = |value: f64| {
            let line = |own: &str| {
                let key = format!(
                    "{} = {{",
                    if own == "q" {
                        own.into()
                    } else {
                        format!("\"{own}\"")
                    }
                );
                let begin = text.find(&key).unwrap();
                let end = begin + text[begin..].find('\n').unwrap();
                let fixed = format!("{key} start = {value}, fixed = true }}");
                format!("{}{fixed}{}", &text[..begin], &text[end..])
            };
            let own = fitted(&parsed(&folder, &(line(name) + &lines(0..2))));
            // A prior of what is fixed is no term of that fit.
            let is_prior = name == "m.lag" && more == prior;
            own.objective
                + if is_prior {
                    ((value - 0.4) / 0.1).powi(2)
                } else {
                    0.0
                }
        };
        for point in own.points.iter().step_by(3) {
            let (found, expected) = (point.objective / study.factor, objective(point.value));
            assert!(
                (found - expected).abs() < 2e-3,
                "{name}: {found} {expected}"
            );
        }
        let is_bounded = own.points.iter().any(|point| !point.constraints.is_empty());
        assert_eq!(is_bounded, more == lag_range, "{:?}", own.points);
        for end in own.ends {
            let End::Crossed(at) = end else {
                panic!("{name}: {end:?}")
            };
            let excess = objective(at) - found.objective;
            let expected = quantile(0.95, f64::INFINITY).powi(2);
            assert!((excess - expected).abs() < 0.02, "{name}: {excess}");
        }
    }
}

/// Replicates that are drawn from the filter spread as Fisher's information says, and whole runs that are drawn as the
/// jackknife does. A prior is drawn too.
#[test]
fn bootstraps_of_predictions_spread_as_covariances_say() {
    let folder = folder(8);
    let prior = PROBLEM.replace(
        "\"m.*\" = {}",
        "\"m.*\" = {}\n\"m.lag\" = { prior = { normal = [0.3, 0.002] } }",
    );
    for (text, kind, runs, most) in [
        (PROBLEM, Kind::Parametric, 2, 0.2),
        (&prior, Kind::Parametric, 2, 0.2),
        (PROBLEM, Kind::Runs, 8, 0.35),
    ] {
        let method = if kind == Kind::Runs { "cr3" } else { "plain" };
        let text = text.replace("[fit]", &format!("[fit]\ncovariance = \"{method}\""));
        let file = parsed(&folder, &(text + &lines(0..runs)));
        let posed = Posed::new(&file, &part::open).unwrap();
        let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
        let study = study(&posed, &found).unwrap();
        let numbers: Vec<u64> = (0..200).collect();
        let all = study.bootstrap((kind, 3), &numbers, &|_| (), &Watch::default());
        let values: Vec<&Vec<f64>> = all.iter().filter_map(|own| own.values.as_ref()).collect();
        assert!(values.len() >= 198, "{}", values.len());
        for (k, own) in study.unknowns.iter().enumerate() {
            let spread = spread(values.iter().map(|own| own[k]), 0.95).unwrap();
            let (_, sd) = estimate(&found, &own.name);
            let ratio = spread.sd / sd;
            assert!((ratio - 1.0).abs() < most, "{kind} {}: {ratio}", own.name);
        }
    }
}

/// With a free initial state the first sample can be met exactly, and the likelihood has no maximum: that is told.
#[test]
fn a_likelihood_without_a_maximum_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(41);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let (mut text, mut x) = ("time,y\n".to_owned(), 0.5);
    for k in 0..60 {
        writeln!(text, "{},{}", 0.1 * f64::from(k), x + 0.02 * gauss()).unwrap();
        x = 0.9 * x + 0.1 * gauss();
    }
    std::fs::write(folder.path().join("run.csv"), text).unwrap();
    let model = "[model]\nname = \"m\"\n[inputs]\nnoise = {}\n[parameters]\na = 1\n[states]\nx = { der = \"-a * x + noise\" }\n";
    std::fs::write(folder.path().join("m.toml"), model).unwrap();
    let is_unbounded = |begin: &str| {
        let text = format!(
            "[system.m]\nmodel = \"m.toml\"\n[process_noise]\n\"m.noise\" = {{ density = \"q\" }}\n[[measured]]\n\
             signal = \"m.x\"\ncolumn = \"y\"\nsd = \"s\"\n[parameters]\n\"m.a\" = {{}}\nq = {{ start = 0.1, min = 0 }}\n\
             s = {{ start = {begin} }}\n[initial]\n\"m.x\" = \"free\"\n[[run]]\nfile = \"run.csv\"\n[fit]\n\
             objective = \"prediction-error\"\nstarts = 1\n"
        );
        let found = fitted(&parsed(&folder, &text));
        found
            .diagnostics
            .iter()
            .any(|own| own.code() == "unbounded")
    };
    assert!(is_unbounded("1e-6, min = 0"));
    assert!(!is_unbounded("0.02, min = 0.01"));
}
