//! The models of `examples/models` against SciPy: `model_examples.txt`, printed by tests/python/models_reference.py from
//! right-hand sides written by hand.

use crate::command::example;
use crate::model_library::Running;
use pilotage_language::read;

const TABLE: &str = include_str!("model_examples.txt");

/// A row: what it is, whose, when, and the named numbers.
struct Row {
    kind: &'static str,
    model: &'static str,
    time: f64,
    values: Vec<(&'static str, f64)>,
}

fn rows() -> Vec<Row> {
    let rows = TABLE.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let value = |word: &&'static str| {
            let (name, value) = word.split_once('=').expect("name=value");
            (name, value.parse().expect("a number"))
        };
        Row {
            kind: words[0],
            model: words[1],
            time: words[2].parse().expect("a time"),
            values: words[3..].iter().map(value).collect(),
        }
    })
    .collect()
}

fn numbers(names: &[String], values: &[(&str, f64)]) -> Vec<f64> {
    let value = |name: &String| values.iter().find(|(own, _)| own == name);
    let all = names
        .iter()
        .map(|name| value(name).map(|(_, value)| *value));
    all.collect::<Option<_>>().expect("a value for each name")
}

/// Every state at ten times, to 1e-9 of its largest value there.
fn assert_as_scipy(model: &str) {
    let file = example("models").join(format!("{model}.toml"));
    let running = Running::new(read(&file).unwrap_or_else(|error| panic!("{error}")));
    let names = &running.compiled.model;
    let own: Vec<Row> = rows()
        .into_iter()
        .filter(|row| row.model == model)
        .collect();
    let (inputs, states): (Vec<&Row>, Vec<&Row>) = own.iter().partition(|row| row.kind == "input");
    assert_eq!(states.len(), 10);
    let expected: Vec<_> = (states.iter())
        .map(|row| numbers(&names.states, &row.values))
        .collect();
    let scale = |k: usize| expected.iter().map(|x| x[k].abs()).fold(0.0, f64::max);
    let (mut time, mut x) = (0.0, running.start());
    for (row, expected) in states.iter().zip(&expected) {
        while time < row.time {
            let now = inputs.iter().rfind(|input| input.time <= time);
            let jump = inputs.iter().map(|input| input.time).find(|t| *t > time);
            let u = numbers(&names.inputs, &now.expect("inputs from 0 on").values);
            let to = jump.unwrap_or(f64::INFINITY).min(row.time);
            x = running.simulate(time, &x, &u, to);
            time = to;
        }
        for (k, (found, expected)) in x.iter().zip(expected).enumerate() {
            let (error, name) = ((found - expected).abs() / scale(k), &names.states[k]);
            assert!(
                error < 1e-9,
                "{model} at {time} s: {name} {found}, off by {error:e}"
            );
        }
    }
}

#[test]
fn hover_is_as_scipy_says() {
    assert_as_scipy("hover");
}

#[test]
fn short_period_with_its_actuator_is_as_scipy_says() {
    assert_as_scipy("short_period_actuator");
}

#[test]
fn car_is_as_scipy_says() {
    assert_as_scipy("car");
}

#[test]
fn dc_motor_is_as_scipy_says() {
    assert_as_scipy("dc_motor");
}

#[test]
fn heat_exchanger_is_as_scipy_says() {
    assert_as_scipy("heat_exchanger");
}
