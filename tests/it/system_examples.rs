//! The systems of `examples/systems` against SciPy, which solves each as one ODE: `system_examples.txt`, printed by
//! tests/python/systems_reference.py.

use crate::command::{Folder, example};
use pilotage::series::Series;

const TABLE: &str = include_str!("system_examples.txt");

fn rows(kind: &str, system: &str) -> Vec<Vec<&'static str>> {
    let rows = TABLE.lines().map(|row| row.split_whitespace().collect());
    let rows = rows.filter(|row: &Vec<_>| row[0] == kind && row[1] == system);
    rows.map(|row| row[2..].to_vec()).collect()
}

fn file(system: &str) -> String {
    let file = example("systems").join(format!("{system}.toml"));
    file.to_str().unwrap().to_owned()
}

fn number(word: &str) -> f64 {
    word.parse().expect("a number")
}

/// Each loop is stable, with the rightmost pole of the ODE.
fn assert_stable(folder: &Folder, system: &str) {
    let ended = folder.pilotage(&["linearize", &file(system), "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let json = ended.json();
    let poles = json["poles"].as_array().expect("poles");
    let real = poles.iter().map(|pole| pole["real"].as_f64().unwrap());
    let rightmost = real.fold(f64::MIN, f64::max);
    let expected = number(rows("rightmost", system)[0][0]);
    assert!((rightmost / expected - 1.0).abs() < 1e-6, "{rightmost}");
}

/// Coupled at its communication points the system goes as the ODE, to that part of each signal's largest value.
fn assert_as_scipy(system: &str, stop: &str, step: &str, tolerance: f64) {
    let folder = Folder::new();
    assert_stable(&folder, system);
    let ended = folder.pilotage(&[
        "cosim",
        &file(system),
        "--algorithm",
        "strong",
        "--stop-time",
        stop,
        "--step",
        step,
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let found = Series::read_table(&folder.path("result.csv")).unwrap();
    let expected = rows("response", system);
    assert_eq!(expected.len(), 10);
    for place in 1..expected[0].len() {
        let split: Vec<_> = (expected.iter())
            .map(|row| row[place].split_once('=').expect("name=value"))
            .collect();
        let values: Vec<f64> = split.iter().map(|(_, value)| number(value)).collect();
        let scale = values
            .iter()
            .fold(0.0_f64, |scale, value| scale.max(value.abs()));
        let name = split[0].0;
        let column = found.columns.iter().find(|column| column.name == name);
        for (row, expected) in expected.iter().zip(values) {
            let time = number(row[0]);
            let at = found
                .time
                .iter()
                .position(|t| (t - time).abs() < 1e-9)
                .unwrap();
            let error = (column.unwrap().values[at] - expected).abs() / scale;
            assert!(
                error < tolerance,
                "{system} at {time} s: {name} is off by {error:e}"
            );
        }
    }
}

#[test]
fn a_pilot_flies_a_hover_in_two_axes() {
    assert_as_scipy("hover", "40", "0.005", 2e-5);
}

#[test]
fn a_driver_changes_lane() {
    assert_as_scipy("lane_change", "20", "0.02", 1e-5);
}

#[test]
fn a_controller_holds_the_speed_of_a_motor() {
    assert_as_scipy("motor", "1.5", "0.001", 2e-5);
}

/// The table of docs/cosim.md of the loop u = 2 (1 - y), ẏ = u, whose exact value is 1 - e⁻² after a second.
#[test]
fn the_chapters_table_of_a_loop_is_what_it_prints() {
    let chapter = include_str!("../../docs/cosim.md");
    let rows = chapter
        .lines()
        .filter(|line| line.starts_with("| `--algorithm "));
    let mut seen = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let options = cells[1].split('`').nth(1).unwrap();
        let folder = Folder::new();
        let file = file("loop");
        let fixed = ["cosim", &file, "--stop-time", "1", "--step", "0.1"];
        let given: Vec<&str> = options.split(' ').collect();
        let ended = folder.pilotage(&[&fixed[..], &given].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let found = Series::read_table(&folder.path("result.csv")).unwrap();
        let y = found
            .columns
            .iter()
            .find(|column| column.name == "plant.y")
            .unwrap();
        let digits = cells[2].split_once('.').unwrap().1.len();
        let last = y.values.last().unwrap();
        assert_eq!(format!("{last:.digits$}"), cells[2], "{options}");
        let steps = format!("{} communication steps taken", cells[3]);
        assert!(ended.stdout.contains(&steps), "{options}: {}", ended.stdout);
        seen += 1;
    }
    assert_eq!(seen, 4);
}

/// None is shipped without a run.
#[test]
fn each_example_has_a_test() {
    let tests = include_str!("system_examples.rs");
    for entry in std::fs::read_dir(example("systems")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|own| own == "toml") {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            assert!(
                tests.contains(&format!("(\"{name}\"")),
                "{name} is run by no test here"
            );
        }
    }
}
