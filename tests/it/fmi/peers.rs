//! The planted faults of descriptions in fmpy: it finds nothing wrong with the good ones, and fewer of the
//! faults than `validate` does.

use super::{faults2, faults3};
use crate::foreign::archive;
use crate::python;
use std::path::Path;

/// Writes the good description and each faulty one as FMUs without binaries.
fn write(folder: &Path, good: &str, faults: &[(&str, &str)]) {
    std::fs::create_dir(folder).unwrap();
    let faulty = faults.iter().map(|(from, to)| good.replace(from, to));
    // fmpy does not read <ClockType>, and takes an output clock for an initial unknown.
    let known = |xml: String| {
        xml.replace(r#" declaredType="Sampling""#, r#" intervalDecimal="0.1""#)
            .replace(
                r#"valueReference="13" causality="output""#,
                r#"valueReference="13""#,
            )
            .replace(r#"<Output valueReference="13" dependencies="12"/>"#, "")
    };
    for (k, xml) in std::iter::once(good.to_owned())
        .chain(faulty)
        .map(known)
        .enumerate()
    {
        let bytes = archive(&[("modelDescription.xml", xml.as_bytes())]);
        std::fs::write(folder.join(format!("{k:03}.fmu")), bytes).unwrap();
    }
}

/// `cargo test --test it peers -- --nocapture` prints the numbers.
#[test]
fn fmpy_finds_the_good_descriptions_good_and_misses_some_faults() {
    let folder = tempfile::tempdir().unwrap();
    let folders = [folder.path().join("FMI2"), folder.path().join("FMI3")];
    write(&folders[0], faults2::GOOD, faults2::FAULTS);
    write(&folders[1], faults3::GOOD, faults3::FAULTS);
    let printed = python::run("count.py", &folders);
    let faults = [faults2::FAULTS.len(), faults3::FAULTS.len()];
    for (line, count) in printed.lines().zip(faults) {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |k: usize| words[k].parse::<usize>().unwrap();
        // `validate` finds every one of them: see `findings.rs`.
        println!(
            "{}: of {count} planted faults fmpy finds {}",
            words[0],
            number(2)
        );
        assert_eq!(number(1), count + 1);
        assert!(words[3..].contains(&"000"), "fmpy finds the good one wrong");
        assert!(number(2) > 0 && number(2) < count);
    }
}
