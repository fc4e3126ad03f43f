//! Initial values are passed on until they are consistent.

use super::slaves::{Linear, simulate};
use pilotage::cosim::{Algorithm, Clock, SeriesRecorder, System, run};

fn first_row(system: System) -> Vec<f64> {
    let (_, recorder) = simulate(system, 1.0, 1.0, Algorithm::Jacobi);
    recorder
        .series
        .columns
        .iter()
        .map(|c| c.values[0])
        .collect()
}

#[test]
fn a_chain_of_feedthrough_is_passed_in_its_order() {
    // c takes b's output, which is a's: wired and added the wrong way round.
    let mut system = System::new();
    let double = || Box::new(Linear::new(0.0, 0.0, 0.0, 2.0));
    system.add("c", double()).unwrap();
    system.add("b", double()).unwrap();
    system
        .add("a", Box::new(Linear::new(0.0, 0.0, 1.0, 0.0).from(3.0)))
        .unwrap();
    system.connect("b.y", "c.u").unwrap();
    system.connect("a.y", "b.u").unwrap();
    assert_eq!(first_row(system), [12.0, 6.0, 3.0]);
}

/// `y_a = x_a + g y_b`, `y_b = x_b + g y_a`.
fn algebraic_loop(g: f64) -> System {
    let mut system = System::new();
    system
        .add("a", Box::new(Linear::new(0.0, 0.0, 1.0, g).from(1.0)))
        .unwrap();
    system
        .add("b", Box::new(Linear::new(0.0, 0.0, 1.0, g).from(2.0)))
        .unwrap();
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    system
}

#[test]
fn an_algebraic_loop_that_contracts_is_solved() {
    let row = first_row(algebraic_loop(0.5));
    // y_a = (1 + 0.5·2)/(1 - 0.25), y_b = (2 + 0.5)/(1 - 0.25)
    assert!(
        (row[0] - 8.0 / 3.0).abs() < 1e-11 && (row[1] - 10.0 / 3.0).abs() < 1e-11,
        "{row:?}"
    );
}

#[test]
fn an_algebraic_loop_that_does_not_settle_is_named() {
    let clock = Clock::new(0.0, 1.0, 1.0).unwrap();
    let mut recorder = SeriesRecorder::default();
    let result = run(
        algebraic_loop(2.0),
        &clock,
        None,
        Algorithm::Jacobi,
        &mut recorder,
    );
    assert_eq!(
        result.unwrap_err().to_string(),
        "the initial values of a.y, b.y depend on each other and do not settle in 100 sweeps"
    );
}
