//! Tables that feed components, with every algorithm.

use super::components::{Linear, simulate};
use pilotage::cosim::{
    Algorithm, Clock, Control, Coupling, SeriesRecorder, Source, Steps, System, native_component,
    run,
};
use pilotage::models::{AnyModel, TextModel};
use pilotage::series::{Column, Series};

/// `ẏ = u` from 0, with `u` from a table: `y(1)` and the steps that it took.
fn integral(times: &[f64], values: &[f64], h: f64, coupling: Coupling) -> (f64, Steps) {
    let table = Series {
        texts: Vec::new(),
        note: None,
        comments: Vec::new(),
        time_unit: "s".into(),
        time: times.to_vec(),
        columns: vec![Column {
            name: "u".into(),
            unit: String::new(),
            values: values.to_vec(),
        }],
    };
    let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).revocable().following();
    let mut system = System::new();
    system.add("integrator", Box::new(integrator)).unwrap();
    system
        .add("table", Box::new(Source::new(table).unwrap()))
        .unwrap();
    system.connect("table.u", "integrator.u").unwrap();
    let clock = Clock::new(0.0, 1.0, h).unwrap();
    let mut recorder = SeriesRecorder::default();
    let run = run(system, &clock, None, coupling, &mut recorder).unwrap();
    let y = recorder.series.column("integrator.y").unwrap();
    (*y.values.last().unwrap(), run.report.steps)
}

/// `u = t`, whose integral is 1/2: held from the begin of a step it is `h/2` late, held from the end `h/2`
/// early, and what goes between both ends is exact.
#[test]
fn a_ramp_is_late_early_or_exact_as_the_algorithm_says() {
    for h in [0.5, 0.1, 0.02] {
        for (algorithm, expected) in [
            (Algorithm::Jacobi, 0.5 - 0.5 * h),
            (Algorithm::GaussSeidel, 0.5 + 0.5 * h),
            (Algorithm::Strong, 0.5),
        ] {
            let (y, _) = integral(&[0.0, 1.0], &[0.0, 1.0], h, algorithm.into());
            assert!((y - expected).abs() < 1e-12, "{algorithm}, {h}: {y}");
        }
    }
}

/// A corner that no communication point hits: step-size control comes as near to it as it is asked to, and
/// the table goes back with the others.
#[test]
fn step_size_control_finds_the_corners() {
    let (times, values) = ([0.0, 0.37, 0.37 + 1e-3, 1.0], [0.0, 0.0, 1.0, 1.0]);
    let exact = 1.0 - 0.37 - 0.5e-3;
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let coarse: Coupling = Algorithm::Strong.into();
    let fine = Coupling {
        control: Some(Control::new(1e-4, &clock)),
        ..coarse
    };
    let (coarse, _) = integral(&times, &values, 0.1, coarse);
    let (fine, steps) = integral(&times, &values, 0.1, fine);
    assert!((coarse - exact).abs() > 5e-3, "{coarse}");
    assert!((fine - exact).abs() < 1e-4, "{fine} {exact}");
    assert!(steps.rejected > 0 && steps.accepted < 200, "{steps:?}");
}

/// Pulses whose edges lie on communication points, between them, and both in one step: strong coupling and
/// extrapolation cut their steps there. What is left is the very short ramp and, with extrapolation, one
/// step after each edge.
#[test]
fn steps_are_cut_at_jumps() {
    for (begin, end) in [(0.3, 0.7), (0.37, 0.71), (0.32, 0.38), (0.3, 1.0)] {
        let (times, values) = (
            [0.0, begin, begin, end, end, 1.0],
            [0.0, 0.0, 2.0, 2.0, 0.0, 0.0],
        );
        for coupling in [
            Algorithm::Strong.into(),
            Coupling {
                extrapolation: Some(1),
                ..Algorithm::Jacobi.into()
            },
            Coupling {
                control: Some(Control::new(1e-4, &Clock::new(0.0, 1.0, 0.1).unwrap())),
                ..Algorithm::Strong.into()
            },
        ] {
            let (y, steps) = integral(&times, &values, 0.1, coupling);
            let exact = 2.0 * (end - begin);
            assert!(
                (y - exact).abs() < 1e-6,
                "{coupling:?} {begin} {end}: {y} {exact}"
            );
            assert_eq!(
                (steps.jumps, steps.ramps, steps.rejected),
                (2, 0, 0),
                "{steps:?}"
            );
        }
    }
}

/// A component whose steps are all of one length: the jump becomes a ramp, and the report says whose fault it is.
#[test]
fn components_of_fixed_steps_make_ramps_of_jumps() {
    let table = Series {
        texts: Vec::new(),
        note: None,
        comments: Vec::new(),
        time_unit: "s".into(),
        time: vec![0.0, 0.5, 0.5, 1.0],
        columns: vec![Column {
            name: "u".into(),
            unit: String::new(),
            values: vec![0.0, 0.0, 1.0, 1.0],
        }],
    };
    let mut system = System::new();
    let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).revocable().fixed();
    system.add("integrator", Box::new(integrator)).unwrap();
    let table = Box::new(Source::new(table).unwrap());
    system.add("table", table).unwrap();
    system.connect("table.u", "integrator.u").unwrap();
    let (run, recorder) = simulate(system, 1.0, 0.1, Algorithm::Strong);
    let y = recorder.series.column("integrator.y").unwrap();
    // Half a step too early in the mean.
    assert!((y.values[10] - 0.55).abs() < 1e-12, "{:?}", y.values);
    assert_eq!((run.report.steps.ramps, run.report.steps.jumps), (1, 0));
    assert_eq!(run.report.fixed, ["integrator"]);
}

/// A model that depends on time begins at the run's start.
#[test]
fn native_models_begin_at_the_start_time() {
    let text = "[model]\nname = \"ramp\"\n[parameters]\ntau = { start = 1, unit = \"s\" }\n[states]\nx = { der = \"time / tau^2\" }\n[outputs]\ny = { value = \"x\" }\n";
    let model = TextModel::parse(text, "ramp.toml").unwrap();
    let mut system = System::new();
    let component = native_component::of_model(AnyModel::Text(model));
    system.add("ramp", component).unwrap();
    let mut recorder = SeriesRecorder::default();
    let clock = Clock::new(5.0, 7.0, 0.5).unwrap();
    run(system, &clock, None, Algorithm::Jacobi, &mut recorder).unwrap();
    let values = &recorder.series.column("ramp.y").unwrap().values;
    // (7² - 5²)/2
    assert!((values[values.len() - 1] - 12.0).abs() < 1e-6, "{values:?}");
}
