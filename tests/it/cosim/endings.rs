//! However a run ends, the rows until then are kept.

use super::components::simulate;
use crate::foreign;
use pilotage::cosim::{
    Algorithm, Clock, CsvRecorder, Ending, FmuComponent, Run, SeriesRecorder, System, run,
};
use tempfile::tempdir;

/// Runs one foreign FMU of that behaviour to 1 s in steps of 0.125 s, `u = 1`.
fn behaving(behaviour: &str) -> (Run, SeriesRecorder) {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), behaviour);
    let mut system = System::new();
    system
        .add("f", Box::new(FmuComponent::open(&path, "f").unwrap()))
        .unwrap();
    system.set("f.u", "1").unwrap();
    system.set("f.k", "2").unwrap();
    simulate(system, 1.0, 0.125, Algorithm::Jacobi)
}

#[test]
fn completed() {
    let (run, recorder) = behaving("good");
    assert!(matches!(run.ending, Ending::Completed), "{run:?}");
    assert_eq!(
        (run.steps, run.time, recorder.series.time.len()),
        (8, 1.0, 9)
    );
    let y = &recorder.series.column("f.y").unwrap().values;
    // The parameter was set after fmi2SetupExperiment, which makes this FMU forget.
    assert!((y[8] - (1.0 - (-2.0f64).exp())).abs() < 1e-12);
    // The tolerance of the description's DefaultExperiment was passed on.
    assert_eq!(
        recorder.series.column("f.tolerance").unwrap().values[0],
        1e-3
    );
    assert_eq!(recorder.series.column("f.stop").unwrap().values[0], 1.0);
    assert_eq!(run.unrecorded, ["f.text"]);
}

#[test]
fn failed_discarded_or_asked_to_end() {
    for (behaviour, rows) in [
        ("error@0.5", 5),
        ("fatal@0.25", 3),
        ("discard@0.5", 5),
        ("end@0.5", 5),
    ] {
        let (run, recorder) = behaving(behaviour);
        assert_eq!(recorder.series.time.len(), rows, "{behaviour}");
        assert_eq!(recorder.series.columns[0].values.len(), rows, "{behaviour}");
        assert_eq!(run.time, (rows - 1) as f64 * 0.125, "{behaviour}");
        assert_eq!(run.steps, rows as u64 - 1, "{behaviour}");
        let words = match run.ending {
            Ending::Completed => "completed".to_owned(),
            Ending::Stopped { time } => format!("stopped at {time}"),
            Ending::EndRequested { instance, time } => {
                format!("{instance} wants the end at {time}")
            }
            Ending::Discarded {
                instance,
                time,
                reached,
                ..
            } => {
                format!("{instance} discarded at {time}, reached {reached}")
            }
            Ending::Failed {
                instance,
                time,
                stage,
                source,
            } => {
                format!("{instance} failed to {stage} at {time}: {source}")
            }
        };
        let expected = match behaviour {
            "error@0.5" => {
                "f failed to step at 0.5: fmi2DoStep returned fmi2Error: the solver failed"
            }
            "fatal@0.25" => {
                "f failed to step at 0.25: fmi2DoStep returned fmi2Fatal without a message"
            }
            "discard@0.5" => "f discarded at 0.5, reached 0.5",
            _ => "f wants the end at 0.5",
        };
        assert_eq!(words, expected);
    }
}

#[test]
fn an_end_within_a_step_has_a_row() {
    let (run, recorder) = behaving("end@0.55");
    assert!(matches!(
        run.ending,
        Ending::EndRequested { time: 0.55, .. }
    ));
    assert_eq!((run.steps, run.time), (4, 0.55));
    assert_eq!(recorder.series.time, [0.0, 0.125, 0.25, 0.375, 0.5, 0.55]);
    let y = &recorder.series.column("f.y").unwrap().values;
    assert!((y[5] - (1.0 - (-2.0 * 0.55f64).exp())).abs() < 1e-12);
}

#[test]
fn a_step_that_is_given_up_within_has_a_row() {
    let (run, recorder) = behaving("discard@0.55");
    assert!(matches!(
        run.ending,
        Ending::Discarded { reached: 0.55, .. }
    ));
    assert_eq!((run.steps, run.time), (4, 0.55));
    assert_eq!(recorder.series.time, [0.0, 0.125, 0.25, 0.375, 0.5, 0.55]);
    let y = &recorder.series.column("f.y").unwrap().values;
    assert!((y[5] - (1.0 - (-2.0 * 0.55f64).exp())).abs() < 1e-12);
}

#[test]
fn values_of_every_type_are_exchanged_and_recorded() {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), "good");
    let mut system = System::new();
    for name in ["a", "b"] {
        system
            .add(name, Box::new(FmuComponent::open(&path, name).unwrap()))
            .unwrap();
    }
    for (output, input) in [
        ("y", "u"),
        ("n", "n_in"),
        ("flag", "flag_in"),
        ("text", "text_in"),
    ] {
        system
            .connect(&format!("a.{output}"), &format!("b.{input}"))
            .unwrap();
    }
    system.connect("b.n", "a.n_in").unwrap();
    system.set("a.u", "1").unwrap();
    system.set("a.flag_in", "true").unwrap();
    system.set("a.text_in", "50 % größer").unwrap();
    assert_eq!(system.open_inputs(), Vec::<String>::new());
    let (_, recorder) = simulate(system, 3.0, 1.0, Algorithm::GaussSeidel);
    let values = |name: &str| recorder.series.column(name).unwrap().values.clone();
    // Each adds one to what the other had.
    assert_eq!(values("a.n"), [0.0, 1.0, 3.0, 5.0]);
    assert_eq!(values("b.n"), [0.0, 2.0, 4.0, 6.0]);
    assert_eq!(values("a.flag"), [0.0, 0.0, 0.0, 0.0]);
    assert_eq!(values("b.flag"), [0.0, 1.0, 1.0, 1.0]);
    assert!(recorder.series.column("b.text").is_none());
}

#[test]
fn csv_keeps_every_bit() {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), "good");
    let run_into = |recorder: &mut dyn pilotage::cosim::Recorder| {
        let mut system = System::new();
        system
            .add("f", Box::new(FmuComponent::open(&path, "f").unwrap()))
            .unwrap();
        system.set("f.u", "1e-9").unwrap();
        let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
        run(system, &clock, Some(1e-7), Algorithm::Jacobi, recorder).unwrap();
    };
    let mut series = SeriesRecorder::default();
    run_into(&mut series);
    let mut csv = CsvRecorder::new(Vec::new());
    run_into(&mut csv);
    let text = String::from_utf8(csv.finish().unwrap()).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time,f.y [m],f.tolerance,f.start,f.stop,f.n,f.flag")
    );
    for (k, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(cells[0], series.series.time[k]);
        for (cell, column) in cells[1..].iter().zip(&series.series.columns) {
            assert_eq!(*cell, column.values[k], "{} in row {k}", column.name);
        }
        assert!(line.len() < 80, "{line}");
    }
}
