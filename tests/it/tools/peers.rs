//! The planted faults of descriptions in other checkers: they find nothing wrong with the good ones, and
//! fewer of the faults than `validate` does.

use super::python;
use crate::fmi::peer_rules::found_by_rules;
use crate::fmi::{faults2, faults3};
use crate::foreign::archive;
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

/// What a script says of a folder: how many FMUs it finds wrong, and the names of those that it does not.
fn count(line: &str, faults: usize) -> (usize, Vec<&str>) {
    let mut words = line.split(' ').skip(1);
    let mut number = || words.next().unwrap().parse::<usize>().unwrap();
    let (all, wrong) = (number(), number());
    assert_eq!(all, faults + 1);
    (wrong, words.collect())
}

/// `cargo test --test it peers -- --nocapture` prints the numbers. `validate` finds every fault: see
/// `findings.rs`. VDMCheck cannot be had here; what it would find is said by its published rules.
#[test]
fn other_checkers_find_the_good_descriptions_good_and_miss_some_faults() {
    let folder = tempfile::tempdir().unwrap();
    let folders = [folder.path().join("FMI2"), folder.path().join("FMI3")];
    write(&folders[0], faults2::GOOD, faults2::FAULTS);
    write(&folders[1], faults3::GOOD, faults3::FAULTS);
    let corpora = [
        ("FMI 2", faults2::FAULTS.len()),
        ("FMI 3", faults3::FAULTS.len()),
    ];
    let by_fmpy = python::run("count.py", &folders);
    let by_library = fmi_library(&folders[0]);
    for ((corpus, faults), line) in corpora.into_iter().zip(by_fmpy.lines()) {
        let (fmpy, clean) = count(line, faults);
        assert!(clean.contains(&"000"), "fmpy finds the good one wrong");
        let by_rules = |tool| found_by_rules(tool, corpus);
        let mut counts = vec![
            ("fmpy", fmpy),
            (
                "VDMCheck by its published rules",
                by_rules("VDMCheck").len(),
            ),
        ];
        let of_library = by_rules("FMI Library");
        match by_library.as_ref().filter(|_| corpus == "FMI 2") {
            Some(printed) => {
                let (library, clean) = count(printed.lines().next().unwrap(), faults);
                counts.push(("FMI Library", library));
                // The table knows all that it looks at.
                let is_clean = |number: &usize| clean.contains(&&*format!("{number:03}"));
                let unknown: Vec<usize> = (1..=faults)
                    .filter(|number| !is_clean(number) && !of_library.contains(number))
                    .collect();
                assert_eq!(
                    unknown,
                    Vec::<usize>::new(),
                    "faults that FMI Library finds"
                );
            }
            None => counts.push(("FMI Library by its sources", of_library.len())),
        }
        println!("{corpus}: of {faults} planted faults");
        for (tool, found) in counts {
            println!("  {tool} finds {found}");
            assert!(found > 0 && found < faults);
        }
    }
}

/// What FMI Library says of the FMUs in a folder. The one in libcosim takes the independent variable for one
/// that needs a start value; of the good description it says nothing else.
fn fmi_library(folder: &Path) -> Option<String> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return None;
    }
    let printed = python::run("fmilib.py", [folder]);
    let complaints: Vec<&str> = printed.lines().skip(1).collect();
    assert_eq!(complaints.len(), 1, "{printed}");
    assert!(complaints[0].starts_with("Start attribute is required"));
    Some(printed)
}
