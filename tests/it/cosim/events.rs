//! Co-simulation of FMI 3.0: event mode, early return, intermediate updates.

use super::components::simulate;
use crate::foreign;
use pilotage::cosim::{
    Algorithm, Coupling, Ending, Run, SeriesRecorder, Source, System, fmu_component,
};
use pilotage::series::{Column, Series};

/// The foreign FMU (`ẏ = u - y`) with that behaviour; its input `u` takes intermediate updates if so.
fn component(system: &mut System, behaviour: &str, is_updated: bool) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    let mut description = include_str!("../foreign/fmi3.xml").replace(
        "instantiationToken=\"good\"",
        &format!("instantiationToken=\"{behaviour}\""),
    );
    // The integral does not follow its input at once.
    let output = "<Output valueReference=\"2\"";
    description = description.replace(output, &format!("{output} dependencies=\"\""));
    if is_updated {
        let u = "name=\"u\" valueReference=\"1\"";
        description = description.replace(u, &format!("{u} intermediateUpdate=\"true\""));
        // All continuous inputs take them, and there are no others.
        let others = [
            "<Float32",
            "<Output valueReference=\"30\"",
            "\"array\"",
            "\"sums\"",
            "<Output valueReference=\"72\"",
        ];
        let is_single = |line: &&str| others.iter().any(|other| line.contains(other));
        let kept: Vec<&str> = description
            .lines()
            .filter(|line| !is_single(line))
            .collect();
        description = kept.join("\n");
    }
    std::fs::write(&path, foreign::fmu_of(&description, foreign::binary3())).unwrap();
    let component = fmu_component::open(&path, "fmu", None).unwrap();
    system.add("fmu", component).unwrap();
}

fn table(column: &str, times: &[f64], values: &[f64]) -> Source {
    let series = Series {
        texts: Vec::new(),
        note: None,
        comments: Vec::new(),
        time_unit: "s".into(),
        time: times.to_vec(),
        columns: vec![Column {
            name: column.to_owned(),
            unit: String::new(),
            values: values.to_vec(),
        }],
    };
    Source::new(series).unwrap()
}

fn column<'a>(recorder: &'a SeriesRecorder, name: &str) -> &'a [f64] {
    &recorder.series.column(name).unwrap().values
}

/// The FMU ends its step at 0.25 s, where there is an event; the event is handled, and the step goes on.
#[test]
fn an_event_within_a_step_is_handled_and_the_step_goes_on() {
    let mut system = System::new();
    component(&mut system, "event@0.25", false);
    system.set("fmu.u", "1").unwrap();
    let (run, recorder) = simulate(system, 0.5, 0.1, Algorithm::Jacobi);
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    for (t, y) in recorder.series.time.iter().zip(column(&recorder, "fmu.y")) {
        assert!((y - (1.0 - (-t).exp())).abs() < 1e-14, "{t}: {y}");
    }
    // Once after initialization, once at the event.
    assert_eq!(
        column(&recorder, "fmu.count"),
        [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    );
}

/// A discrete input is set in event mode, when it changes and not else.
#[test]
fn discrete_inputs_are_set_in_events() {
    let mut system = System::new();
    component(&mut system, "good", false);
    let mut source = table("n", &[0.0, 0.2, 0.4], &[3.0, 7.0, 4.0]);
    source
        .hold_as(0, pilotage::cosim::ValueKind::Integer)
        .unwrap();
    system.add("table", Box::new(source)).unwrap();
    system.connect("table.n", "fmu.i32_in").unwrap();
    let (_, recorder) = simulate(system, 0.6, 0.1, Algorithm::GaussSeidel);
    assert_eq!(
        column(&recorder, "fmu.i32"),
        [4.0, 4.0, 8.0, 8.0, 5.0, 5.0, 5.0]
    );
    assert_eq!(
        column(&recorder, "fmu.count"),
        [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0]
    );
}

/// `u = t`, extrapolated. The FMU asks in the middle and at the end of each step, gets the values at these times (FMI 3.0,
/// section 4.2.2) and holds them until it asks again. An FMU that takes none gets the mean of a
/// step, which is said.
#[test]
fn intermediate_updates_get_the_inputs_at_their_own_times() {
    let run_with = |behaviour, is_updated| -> (Run, f64) {
        let mut system = System::new();
        component(&mut system, behaviour, is_updated);
        let source = table("u", &[0.0, 1.0], &[0.0, 1.0]);
        system.add("table", Box::new(source)).unwrap();
        system.connect("table.u", "fmu.u").unwrap();
        let coupling = Coupling {
            extrapolation: Some(1),
            ..Algorithm::GaussSeidel.into()
        };
        let (run, recorder) = simulate(system, 1.0, 0.1, coupling);
        (run, column(&recorder, "fmu.y")[10])
    };
    // The solution of y' = u - y over half a step with a constant u.
    let half = |y: f64, u: f64| u + (y - u) * (-0.05_f64).exp();
    let (held, y) = run_with("good", false);
    assert_eq!(held.report.holding, ["fmu"]);
    let means = (0..10).flat_map(|k| [0.1 * f64::from(k) + 0.05; 2]);
    assert!((y - means.fold(0.0, half)).abs() < 1e-13, "{y}");
    let (updated, y) = run_with("good", true);
    assert!(updated.report.holding.is_empty());
    let at_updates = (0..20).map(|k| 0.05 * f64::from(k));
    assert!((y - at_updates.fold(0.0, half)).abs() < 1e-13, "{y}");
    // It never asks, which is known after the first step.
    let (_, y) = run_with("quiet", true);
    let means = (1..10).flat_map(|k| [0.1 * f64::from(k) + 0.05; 2]);
    assert!(
        (y - [0.0; 2].into_iter().chain(means).fold(0.0, half)).abs() < 1e-13,
        "{y}"
    );
}

/// The same in a strong coupling, with states that are saved and restored.
#[test]
fn steps_with_events_can_be_repeated() {
    let mut system = System::new();
    component(&mut system, "event@0.25", true);
    let source = table("u", &[0.0, 0.35, 0.35, 1.0], &[1.0, 1.0, 2.0, 2.0]);
    system.add("table", Box::new(source)).unwrap();
    system.connect("table.u", "fmu.u").unwrap();
    let (run, recorder) = simulate(system, 0.5, 0.1, Algorithm::Strong);
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    assert_eq!(run.report.steps.jumps, 1);
    let at_jump = 1.0 - (-0.35_f64).exp();
    let y = 2.0 + (at_jump - 2.0) * (-0.15_f64).exp();
    assert!((column(&recorder, "fmu.y")[5] - y).abs() < 1e-6);
}
