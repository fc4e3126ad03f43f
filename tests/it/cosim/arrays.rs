//! Arrays of FMI 3.0 in the master.

use super::components::simulate;
use crate::foreign;
use pilotage::cosim::{Algorithm, Clock, Ending, SeriesRecorder, System, fmu_component, run};
use pilotage_text::error_chain::error_chain;

/// Adds the foreign FMU, whose output `sums` is the running sums of its input `array` of three elements.
fn add(system: &mut System, name: &str, change: impl Fn(String) -> String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    let description = change(include_str!("../foreign/fmi3.xml").to_owned());
    std::fs::write(&path, foreign::fmu_of(&description, foreign::binary3())).unwrap();
    let component = fmu_component::open(&path, name, None).unwrap();
    system.add(name, component).unwrap();
}

#[test]
fn arrays_are_wired_element_by_element_and_recorded() {
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong] {
        let mut system = System::new();
        for name in ["a", "b", "c"] {
            add(&mut system, name, |text| text);
        }
        system.connect("a.sums", "b.array").unwrap();
        // One element, into a scalar and into an element.
        system.connect("b.sums[3]", "c.u").unwrap();
        system.connect("a.sums[2]", "c.array[1]").unwrap();
        for (k, value) in ["1", "2", "3"].iter().enumerate() {
            system.set(&format!("a.array[{}]", k + 1), value).unwrap();
        }
        system.set("c.array[3]", "0.5").unwrap();
        let (run, recorder) = simulate(system, 0.5, 0.1, algorithm);
        assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
        let last = |name: &str| *recorder.series.column(name).unwrap().values.last().unwrap();
        let of = |name: &str| [1, 2, 3].map(|k| last(&format!("{name}.sums[{k}]")));
        assert_eq!(of("a"), [1.0, 3.0, 6.0]);
        assert_eq!(of("b"), [1.0, 4.0, 10.0]);
        assert_eq!(of("c"), [3.0, 3.0, 3.5]);
        assert!(
            (last("c.y") - 10.0 * (1.0 - (-0.5_f64).exp())).abs() < 1e-12,
            "{algorithm}"
        );
    }
}

/// Arrays of 32-bit reals and of integers beside scalars of these types.
#[test]
fn arrays_of_other_types_are_wired_too() {
    let with_lists = |text: String| {
        let variable = |kind: &str, reference: u32, rest: &str| {
            format!(
                "<{kind} name=\"l{reference}\" valueReference=\"{reference}\" {rest}><Dimension start=\"3\"/></{kind}>\n"
            )
        };
        let (input, output) = (
            "causality=\"input\" start=\"0 0 0\"",
            "causality=\"output\"",
        );
        let mut lists = String::new();
        let mut outputs = String::new();
        for (kind, reference) in [("Float32", 110), ("Int16", 113), ("UInt8", 112)] {
            lists += &variable(kind, reference, input);
            lists += &variable(kind, reference + 20, output);
            outputs += &format!("<Output valueReference=\"{}\"/>\n", reference + 20);
        }
        let text = text.replace(
            "<Clock name=\"clock\"",
            &format!("{lists}<Clock name=\"clock\""),
        );
        let first = "<Output valueReference=\"81\"/>";
        text.replace(first, &format!("{outputs}{first}"))
    };
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong] {
        let mut system = System::new();
        for name in ["a", "b"] {
            add(&mut system, name, with_lists);
        }
        system.connect("a.l130", "b.l110").unwrap();
        system.connect("a.l133", "b.l113").unwrap();
        // A single element, into another type.
        system.connect("a.l133[3]", "b.l112[1]").unwrap();
        system.set("a.l110[2]", "2.5").unwrap();
        system.set("a.l113[1]", "-7").unwrap();
        system.set("a.l113[3]", "40").unwrap();
        let (run, recorder) = simulate(system, 0.5, 0.1, algorithm);
        assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
        let last = |name: &str| *recorder.series.column(name).unwrap().values.last().unwrap();
        let of = |name: &str| [1, 2, 3].map(|k| last(&format!("{name}[{k}]")));
        assert_eq!(of("a.l130"), [1.0, 3.5, 1.0]);
        assert_eq!(of("b.l130"), [2.0, 4.5, 2.0]);
        assert_eq!(of("a.l133"), [-6.0, 1.0, 41.0]);
        assert_eq!(of("b.l133"), [-5.0, 2.0, 42.0]);
        assert_eq!(of("b.l132"), [42.0, 1.0, 1.0]);
    }
    let mut system = System::new();
    add(&mut system, "a", with_lists);
    let beyond = system.set("a.l112[2]", "256").unwrap_err().to_string();
    assert!(beyond.contains("255"), "{beyond}");
}

/// The sizes of arrays are those of the description.
#[test]
fn sizes_are_not_changed() {
    let mut system = System::new();
    add(&mut system, "a", |text| text);
    system.set("a.n", "4").unwrap();
    let clock = Clock::new(0.0, 0.5, 0.1).unwrap();
    let mut recorder = SeriesRecorder::default();
    let refused = run(system, &clock, None, Algorithm::Jacobi, &mut recorder).unwrap_err();
    let message = error_chain(&refused);
    assert!(message.contains("it is 3"), "{message}");
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let mut system = System::new();
    add(&mut system, "a", |text| text);
    let two = "name=\"n\" valueReference=\"71\" causality=\"structuralParameter\" variability=\"fixed\" start=";
    add(&mut system, "b", |text| {
        let smaller = text.replace(&format!("{two}\"3\""), &format!("{two}\"2\""));
        smaller.replace("start=\"0 0 0\"", "start=\"0 0\"")
    });
    let refused = |system: &mut System, from, to| system.connect(from, to).unwrap_err().to_string();
    assert_eq!(
        refused(&mut system, "a.sums", "b.array"),
        "`a.sums` -> `b.array`: the arrays have 3 and 2 elements, or different dimensions; connect single \
         elements, such as `a.sums[1]`"
    );
    for (from, to) in [("a.sums", "b.u"), ("a.y", "b.array"), ("a.sums[4]", "b.u")] {
        let message = refused(&mut system, from, to);
        assert!(message.contains("has no variable"), "{message}");
    }
}
