//! Tables of paragraphs with which tests compare what they find.

use std::fmt::Write;

/// Compares paragraphs with those of a file and shows all that differ. With `INSTA_UPDATE=always` the file is written
/// instead, as snapshots are.
pub fn assert_same(path: &str, found: &[String]) {
    if std::env::var("INSTA_UPDATE").is_ok_and(|how| how == "always") {
        std::fs::write(path, found.join("\n\n") + "\n").unwrap();
        return;
    }
    let text = std::fs::read_to_string(path).unwrap();
    let expected: Vec<&str> = text.trim_end().split("\n\n").collect();
    assert_eq!(found.len(), expected.len(), "paragraphs of {path}");
    let mut different = String::new();
    for (found, expected) in found.iter().zip(expected) {
        if found.trim_end() != expected {
            let found = found.trim_end();
            writeln!(different, "\n--- expected\n{expected}\n+++ found\n{found}").unwrap();
        }
    }
    assert!(
        different.is_empty(),
        "{path}; INSTA_UPDATE=always writes it again\n{different}"
    );
}
