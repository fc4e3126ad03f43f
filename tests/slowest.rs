//! Printed at the end of a run of all tests: the slowest tests of `tests/it` and `tests/realtime`, and the missing
//! tools. Cargo runs it last because of its name.

use std::fs;

fn main() {
    if std::env::args().any(|argument| argument == "--list") {
        return;
    }
    // There is no file if no test of `tests/it` has run.
    let path = concat!(env!("CARGO_TARGET_TMPDIR"), "/notes.txt");
    let notes = fs::read_to_string(path).unwrap_or_default();
    let mut times: Vec<(f64, &str)> = (notes.lines())
        .filter_map(|line| line.split_once(' '))
        .filter_map(|(seconds, name)| Some((seconds.parse().ok()?, name)))
        .collect();
    times.sort_by(|a, b| b.0.total_cmp(&a.0));
    let sum: f64 = times.iter().map(|(seconds, _)| seconds).sum();
    println!(
        "\n{} tests, {sum:.0} s on all threads together; the slowest:",
        times.len()
    );
    for (seconds, name) in times.iter().take(10) {
        println!("{seconds:8.2} s  {name}");
    }
    for missing in notes.lines().filter(|line| line.starts_with("missing ")) {
        println!("{missing}");
    }
    println!();
}
