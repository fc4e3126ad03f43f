//! The committed reference numbers are what their scripts print.

use super::python;
use std::fs;
use std::path::Path;

/// Words are the same; numbers, also those after `=`, up to the last digits, which differ between machines.
fn is_same(own: &str, other: &str) -> bool {
    let split = |word: &str| -> (String, Option<f64>) {
        let (name, value) = word.rsplit_once('=').unwrap_or(("", word));
        (name.to_owned(), value.trim_end_matches(',').parse().ok())
    };
    match (split(own), split(other)) {
        ((name, Some(a)), (same, Some(b))) => {
            name == same && (a - b).abs() <= 1e-9 * a.abs().max(1.0)
        }
        _ => own == other,
    }
}

fn assert_printed(script: &str, file: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    let committed = fs::read_to_string(folder.join(file)).unwrap();
    let printed = python::run(script, [] as [&str; 0]);
    assert_eq!(committed.lines().count(), printed.lines().count());
    for (own, other) in committed.lines().zip(printed.lines()) {
        let words: Vec<_> = own.split_whitespace().collect();
        let others: Vec<_> = other.split_whitespace().collect();
        let same =
            words.len() == others.len() && words.iter().zip(&others).all(|(a, b)| is_same(a, b));
        assert!(same, "{file} has\n{own}\n{script} prints\n{other}");
    }
}

#[test]
fn of_the_built_in_models() {
    assert_printed("library_reference.py", "model_library.txt");
}

#[test]
fn of_the_example_models() {
    assert_printed("models_reference.py", "model_examples.txt");
}

#[test]
fn of_the_example_systems() {
    assert_printed("systems_reference.py", "system_examples.txt");
}

#[test]
fn of_the_example_problems() {
    assert_printed("problems_reference.py", "problem_examples.json");
}
