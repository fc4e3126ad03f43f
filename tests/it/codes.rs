//! The tables of diagnostics in the docs are those of the code: `INSTA_UPDATE=always` writes them.

use pilotage::estimation::CODES;
use std::collections::BTreeSet;
use std::path::Path;

/// For each code of flights: the code of problem files that says it, if there is one, and how or what else does.
const FLIGHTS: [(&str, &str, &str); 39] = [
    ("unstable-loop", "unstable-loop", "the same"),
    ("constant-data", "", "a check of flights before the fit"),
    ("no-forcing", "", "a check of flights before the fit"),
    ("wrong-scale", "", "a check of flights before the fit"),
    ("origin", "", "a check of flights before the fit"),
    ("time-scale", "time-scale", "the same"),
    ("misfit", "misfit", "the same"),
    (
        "dead-stick",
        "frozen",
        "of the column `stick`, where it is measured; before the fit a check of flights",
    ),
    (
        "gap",
        "gap",
        "the same, whether or not the fit has an answer",
    ),
    ("moving-start", "", "a check of flights before the fit"),
    ("target-outlier", "", "a check of flights before the fit"),
    ("stepped-target", "stepped-input", "of any input"),
    ("jump", "jump", "the same, of any column"),
    ("frozen", "frozen", "the same, of any column"),
    ("clipped", "clipped", "the same, of any column"),
    ("slow-sensor", "slow-sensor", "the same, of any column"),
    (
        "mesh-error",
        "mesh-error",
        "the same; `simulation` tells another motion",
    ),
    (
        "leaves-target",
        "",
        "a simulation of the fitted loop beyond the runs, after the fit of flights",
    ),
    (
        "idle-pilot",
        "poor-fit",
        "a pilot that does nothing explains nothing",
    ),
    ("outlier", "outlier", "the same, of any column"),
    ("describing-function", "describing-function", "the same"),
    ("few-lines", "few-lines", "the same"),
    ("poor-fit", "poor-fit", "the same, of any column"),
    ("stick-sign", "", "a check of flights before the fit"),
    (
        "vehicle-size",
        "",
        "a check of the vehicle file: `pilotage vehicle check`",
    ),
    (
        "vehicle-unstable",
        "",
        "a check of the vehicle file: `pilotage vehicle check`",
    ),
    ("copy", "copy", "the same"),
    ("coarse-mesh", "mesh-error", "by its error, not by its step"),
    (
        "saturated-stick",
        "on-limit",
        "of any output with a limit; of a recording `clipped`",
    ),
    ("one-start", "alone", "the same"),
    ("stopped-early", "cut", "the same"),
    ("lower-start", "lower-start", "the same"),
    (
        "wild-start",
        "",
        "`rms_alone` of the runs (docs/json.md), and the note below them",
    ),
    ("loop-on-bound", "loop-on-bound", "the same"),
    (
        "slow-loop",
        "",
        "goes: nobody can act on it; `derived` has the slowest pole with its interval",
    ),
    (
        "integrating-pilot",
        "model-on-bound",
        "of any instance that is kept stable",
    ),
    (
        "pilot-on-bound",
        "model-on-bound",
        "of any instance that is kept stable",
    ),
    (
        "fast-pole",
        "undetermined",
        "its coefficients are not determined; `--orders` takes a lower order",
    ),
    (
        "cancelled-pole",
        "undetermined",
        "its coefficients are not determined; `--orders` takes a lower order",
    ),
];

/// Codes in the source of a function `code`.
fn in_source(text: &str) -> BTreeSet<&str> {
    let (_, text) = text.split_once("pub fn code(&self)").unwrap();
    let (text, _) = text.split_once("\n    }\n").unwrap();
    text.split('"').skip(1).step_by(2).collect()
}

/// Compares a table of a file with this one, or writes it.
fn check(file: &str, head: &str, rows: &[String]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("docs")
        .join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = text
        .split_once(head)
        .unwrap_or_else(|| panic!("{file}: {head}"));
    let is_row = |line: &&str| line.starts_with('|');
    let old: String = rest.split_inclusive('\n').take_while(is_row).collect();
    let new = rows.concat();
    if std::env::var("INSTA_UPDATE").is_ok_and(|own| own == "always") {
        let whole = [before, head, &new, &rest[old.len()..]].concat();
        std::fs::write(&path, whole).unwrap();
    } else {
        assert_eq!(old, new, "docs/{file} is not that of the code");
    }
}

#[test]
fn the_table_of_diagnostics_is_that_of_the_code() {
    let source = include_str!("../../crates/estimation/src/result/diagnostic/mod.rs");
    let codes: BTreeSet<&str> = CODES.iter().map(|own| own.0).collect();
    assert_eq!(
        (in_source(source), codes.len()),
        (codes.clone(), CODES.len())
    );
    let rows = CODES.map(|(code, meaning)| format!("| `{code}` | {meaning} |\n"));
    check(
        "problems.md",
        "| code | what it means |\n| --- | --- |\n",
        &rows,
    );
}

#[test]
fn each_diagnostic_of_flights_has_its_place_among_those_of_problems() {
    let of_checks = in_source(include_str!("../../crates/flights/src/checks/check.rs"));
    let of_fits = in_source(include_str!(
        "../../crates/identification/src/diagnostics/diagnostic.rs"
    ));
    let codes: BTreeSet<&str> = FLIGHTS.iter().map(|own| own.0).collect();
    assert_eq!(
        (&of_checks | &of_fits, codes.len()),
        (codes.clone(), FLIGHTS.len())
    );
    let is_known = |code: &str| code.is_empty() || CODES.iter().any(|own| own.0 == code);
    assert!(FLIGHTS.iter().all(|own| is_known(own.1)));
    let rows = FLIGHTS.map(|(code, general, how)| {
        let general = match general {
            "" => "-".to_owned(),
            general => format!("`{general}`"),
        };
        format!("| `{code}` | {general} | {how} |\n")
    });
    let head = "| of flights | of problem files | how it is said there |\n| --- | --- | --- |\n";
    check("problems.md", head, &rows);
}
