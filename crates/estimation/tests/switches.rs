//! Conditions on time: pulses between samples, and switching times that are sought, compared with the closed solution of
//! `ẋ = -k x + u` from `start` on, and with `least_squares` of SciPy on it (`x_scale='jac'`, `jac='3-point'`, tolerances of 1e-15;
//! standard deviations from its Jacobian at the solution).

use pilotage_estimation::evaluate::evaluate;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// From 1 at 0, with the input from `start` on, for `width`.
fn solution([k, u, start, width]: [f64; 4], t: f64) -> f64 {
    let step = |since: f64| {
        if since > 0.0 {
            u / k * (1.0 - (-k * since).exp())
        } else {
            0.0
        }
    };
    (-k * t).exp() + step(t - start) - step(t - start - width)
}

/// Samples over 10 s, with noise that is the same on every machine.
fn recorded(own: [f64; 4], samples: usize, phase: f64) -> String {
    let mut text = "time [s],x\n".to_owned();
    for n in 0..samples {
        let t = 10.0 * n as f64 / (samples - 1) as f64;
        let noise = 0.01 * (1.7 * (n * n) as f64 + phase).sin();
        writeln!(text, "{t},{}", solution(own, t) + noise).expect("written");
    }
    text
}

/// A problem with this input and these parameters, lines on what is sought, and recorded runs.
fn posed<T>(
    (input, parameters): (&str, &str),
    rest: &str,
    runs: &[String],
    of: impl FnOnce(&Posed<'_>) -> T,
) -> T {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(Path::new(name)), text).expect("written");
    };
    write(
        "m.toml",
        &format!(
            "[model]\nname = \"m\"\n[parameters]\nk = 0.25\nu = 1.5\n{parameters}\n[states]\n\
             x = {{ start = 1, der = \"-k * x + {input}\" }}\n"
        ),
    );
    let mut text = "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = 0.01\n".to_owned();
    text += rest;
    for (j, run) in runs.iter().enumerate() {
        write(&format!("run{j}.csv"), run);
        writeln!(text, "[[run]]\nfile = \"run{j}.csv\"").expect("written");
    }
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("a problem");
    of(&Posed::new(&file, &part::open).expect("a problem"))
}

fn fitted(model: (&str, &str), rest: &str, runs: &[String]) -> Fit {
    let rest = format!("{rest}[fit]\nstarts = 1\ncovariance = \"plain\"\n");
    let found = posed(model, &rest, runs, |posed| {
        fit(posed, &mut |_| ControlFlow::Continue(()))
    });
    assert!(found.is_answer(), "{:?}", found.status);
    found
}

/// Compares values and standard deviations, in the order of the parameters. Those of SciPy are of noise as large as stated.
#[track_caller]
fn assert_is(found: &Fit, objective: f64, expected: &[(f64, f64)]) {
    assert!(
        (found.objective / objective - 1.0).abs() < 1e-5,
        "{} for {objective}",
        found.objective
    );
    let values = found.parameters.iter().flat_map(|own| &own.values);
    let values: Vec<f64> = values.map(|own| own.1).collect();
    let sure = found.uncertainty.as_ref().expect("an uncertainty");
    let intervals = sure.intervals.iter().flatten();
    assert_eq!(values.len(), expected.len());
    let noise = (objective / (found.samples - expected.len()) as f64).sqrt();
    for ((value, interval), (own, sd)) in values.iter().zip(intervals).zip(expected) {
        assert!(
            (value - own).abs() < 1e-3 * sd,
            "{values:?} for {expected:?}"
        );
        assert!(
            (interval.sd / (noise * sd) - 1.0).abs() < 1e-3,
            "{} for {sd}",
            interval.sd
        );
    }
}

const SOUGHT: &str = "[parameters]\n\"m.k\" = {}\n\"m.u\" = {}\n";

/// What SciPy finds of one switch.
const SWITCH: [(f64, f64); 3] = [
    (0.2994673826807934, 0.002303124431311306),
    (2.000116439273038, 0.008146266334218517),
    (5.325748840289026, 0.003848586818324334),
];

#[test]
fn the_time_of_a_switch_is_found_across_samples() {
    let runs = [recorded([0.3, 2.0, 5.3217, f64::INFINITY], 21, 0.0)];
    let model = (
        "if(time > begin, u, 0)",
        "begin = { start = 3, unit = \"s\" }",
    );
    let found = fitted(model, &format!("{SOUGHT}\"m.begin\" = {{}}\n"), &runs);
    assert_is(&found, 11.848605231507422, &SWITCH);
}

/// No element of any scheme contains the jump, although those of finite differences span the run.
#[test]
fn schemes_agree_on_the_time_of_a_switch() {
    let runs = [recorded([0.3, 2.0, 5.3217, f64::INFINITY], 21, 0.0)];
    let model = (
        "if(time > begin, u, 0)",
        "begin = { start = 4, unit = \"s\" }",
    );
    for scheme in [
        "gauss-3",
        "radau-3",
        "lgl-4",
        "bernstein-4",
        "finite-difference-6",
    ] {
        let rest = format!(
            "{SOUGHT}\"m.begin\" = {{}}\n[fit]\nstarts = 1\ncovariance = \"plain\"\nscheme = \"{scheme}\"\n\
             mesh_tolerance = 1e-8\n"
        );
        let found = posed(model, &rest, &runs, |posed| {
            fit(posed, &mut |_| ControlFlow::Continue(()))
        });
        assert!(found.is_answer(), "{scheme}: {:?}", found.status);
        assert_is(&found, 11.848605231507422, &SWITCH);
    }
}

#[test]
fn both_ends_of_a_pulse_are_found() {
    let runs = [recorded([0.3, 2.0, 5.3217, 0.6], 101, 0.0)];
    let model = (
        "if(time > begin, if(time < begin + width, u, 0), 0)",
        "begin = { start = 5, unit = \"s\" }\nwidth = { start = 0.5, unit = \"s\" }",
    );
    let rest = format!("{SOUGHT}\"m.begin\" = {{}}\n\"m.width\" = {{}}\n");
    let expected = [
        (0.3008516009455857, 0.0010996052626149901),
        (1.9983072450128507, 0.02396005362735864),
        (5.320384177144938, 0.004603617714454667),
        (0.6010802455583393, 0.007519051236706187),
    ];
    assert_is(&fitted(model, &rest, &runs), 50.274345686209074, &expected);
}

/// The beginning of one input and the end of another are sought from the same time, where one boundary stands for both.
#[test]
fn times_that_begin_together_are_told_apart() {
    let own = [0.3, 2.0, 4.3217, 2.5];
    let rows = (0..101).map(|n| {
        let t = 0.1 * f64::from(n);
        format!("{t},{}\n", solution(own, t))
    });
    let run = ["time [s],x\n".to_owned() + &rows.collect::<String>()];
    let model = (
        // With k = 0.25 and -0.05 x the rate is that of the recording.
        "2 * (if(time > begin, 1, 0) - if(time > end, 1, 0)) - 0.05 * x",
        "begin = { start = 5.5, unit = \"s\" }\nend = { start = 5.5, unit = \"s\" }",
    );
    let rest = "[parameters]\n\"m.begin\" = {}\n\"m.end\" = {}\n";
    let found = fitted(model, rest, &run);
    let [begin, end] = ["m.begin", "m.end"].map(|name| found.value(name).expect("a parameter"));
    assert!((begin - 4.3217).abs() < 1e-5, "{begin}");
    assert!((end - 6.8217).abs() < 1e-5, "{end}");
}

#[test]
fn each_run_has_a_time_of_its_own() {
    let run = |begin, phase| recorded([0.3, 2.0, begin, f64::INFINITY], 41, phase);
    let runs = [run(5.3217, 0.0), run(2.143, 1.0)];
    let model = (
        "if(time > begin, u, 0)",
        "begin = { start = 4, unit = \"s\" }",
    );
    let rest = format!("{SOUGHT}\"m.begin\" = {{ per = \"run\" }}\n");
    let expected = [
        (0.30053138175206623, 0.0008665129035418706),
        (2.0013913239772383, 0.0038022130287457077),
        (5.321837194150507, 0.002591580703701711),
        (2.1404578105253167, 0.0024298360899500087),
    ];
    assert_is(&fitted(model, &rest, &runs), 39.840400133727975, &expected);
}

/// The threshold is an expression of what is sought, and the step a product with the condition.
#[test]
fn a_time_may_be_an_expression() {
    let runs = [recorded([0.3, 2.0, 6.33, f64::INFINITY], 41, 2.0)];
    let model = (
        "u * if(if(3 * period <= time, 1, 0) > 0.5, 1, 0)",
        "period = { start = 1.5, unit = \"s\" }",
    );
    let found = fitted(model, &format!("{SOUGHT}\"m.period\" = {{}}\n"), &runs);
    let expected = [
        (0.29803207966862566, 0.0017517205995240383),
        (1.9929646336920046, 0.005657526419323758),
        (2.109405137053882, 0.0010408946998141893),
    ];
    assert_is(&found, 17.721516557556782, &expected);
}

/// A pulse of 20 ms between samples that are 10 s apart, in every spelling, with a given and with an adaptive mesh.
#[test]
fn a_pulse_between_samples_is_evaluated_and_fitted() {
    let (k, width) = (0.02, 0.02);
    let of = |t: f64| solution([k, 50.0, 61.23, width], t);
    let rows = (0..11).map(|n| format!("{},{}\n", 10 * n, of(10.0 * f64::from(n))));
    let run = ["time [s],x\n".to_owned() + &rows.collect::<String>()];
    let spellings = [
        "if(time > begin, if(time < begin + 0.02, 50, 0), 0)",
        "if(abs(time - begin - 0.01) < 0.01, 50, 0)",
        "50 * if(time >= begin, 1, 0) - 50 * if(time >= begin + 0.02, 1, 0)",
        "if(time <= begin, 0, if(begin + 0.02 <= time, 0, 50))",
        "if(min(time - begin, begin + 0.02 - time) > 0, 50, 0)",
        "25 * (sign(time - begin) - sign(time - begin - 0.02))",
    ];
    for spelling in spellings {
        for mesh in ["", "mesh = \"samples\"\n"] {
            let rest = format!("[parameters]\n\"m.k\" = {{}}\n[fit]\nstarts = 1\n{mesh}");
            let model = (spelling, "begin = 61.23");
            let own = posed(model, &rest, &run, |posed| {
                let begun = evaluate(posed);
                // With k = 0.25 the pulse has decayed at the next sample but one.
                let squares = (0..11).map(|n| {
                    let t = 10.0 * f64::from(n);
                    (of(t) - solution([0.25, 50.0, 61.23, width], t)).powi(2)
                });
                let expected: f64 = squares.sum::<f64>() / 1e-4;
                assert!(
                    (begun.objective / expected - 1.0).abs() < 1e-4,
                    "{spelling}: {} for {expected}",
                    begun.objective
                );
                fit(posed, &mut |_| ControlFlow::Continue(()))
            });
            let found = own.value("m.k").expect("a parameter");
            let least = if mesh.is_empty() { 1e-5 } else { 2e-3 };
            assert!(
                (found / k - 1.0).abs() < least,
                "{spelling} {mesh}: {found}"
            );
        }
    }
}

/// With noise in the loop that is almost none, predictions are those of the solution.
#[test]
fn a_filter_meets_a_pulse_between_samples() {
    let of = |t: f64| solution([0.25, 50.0, 61.23, 0.02], t);
    let rows = (0..11).map(|n| format!("{},{}\n", 10 * n, of(10.0 * f64::from(n))));
    let run = ["time [s],x\n".to_owned() + &rows.collect::<String>()];
    let rest = "[parameters]\nq = { start = 1e-12, min = 1e-14 }\n[process_noise]\n\"m.x\" = { density = \"q\" }\n\
                [fit]\nobjective = \"prediction-error\"\n";
    let model = (
        "if(time > begin, if(time < begin + 0.02, 50, 0), 0)",
        "begin = 61.23",
    );
    let found = posed(model, rest, &run, evaluate);
    for residual in found.runs[0].recorded[0]
        .iter()
        .zip(&found.runs[0].predicted[0])
    {
        let (recorded, predicted) = residual;
        assert!(
            recorded.is_nan() || (recorded - predicted).abs() < 1e-6,
            "{residual:?}"
        );
    }
    // Each sample has its logarithm, and no residual.
    let logarithms = 11.0 * 1e-4_f64.ln();
    assert!(
        (found.objective - logarithms).abs() < 0.1,
        "{}",
        found.objective
    );
}
