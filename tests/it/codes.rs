//! The tables of diagnostics in the docs are those of the code: `INSTA_UPDATE=always` writes them.

use pilotage::estimation::CODES;
use pilotage::flights::checks::CODES as OF_FLIGHTS;
use std::collections::BTreeSet;
use std::path::Path;

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
        "diagnostics.md",
        "| code | what it means |\n| --- | --- |\n",
        &rows,
    );
}

/// What a check of flights finds that no fit looks for has a line of its own.
#[test]
fn the_table_of_checks_is_that_of_the_code() {
    let text = include_str!("../../docs/diagnostics.md");
    let (_, table) = text
        .split_once("| of flights alone | what it means |\n")
        .unwrap();
    let rows = table
        .lines()
        .skip(1)
        .take_while(|line| line.starts_with('|'));
    let codes: BTreeSet<&str> = rows.filter_map(|line| line.split('`').nth(1)).collect();
    assert_eq!(BTreeSet::from(OF_FLIGHTS), codes);
}
