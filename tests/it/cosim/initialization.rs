//! Initial values are passed on until they are consistent.

use super::components::{Linear, Log, Static, simulate};
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
fn algebraic_loop(g: f64, change: impl Fn(Linear) -> Linear) -> System {
    let mut system = System::new();
    system
        .add(
            "a",
            Box::new(change(Linear::new(0.0, 0.0, 1.0, g).from(1.0))),
        )
        .unwrap();
    system
        .add(
            "b",
            Box::new(change(Linear::new(0.0, 0.0, 1.0, g).from(2.0))),
        )
        .unwrap();
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    system
}

/// Newton's method needs no contraction: a gain of 2 is solved as one of a half.
#[test]
fn algebraic_loops_are_solved() {
    for g in [0.5, 2.0, -3.0] {
        let row = first_row(algebraic_loop(g, |component| component));
        // y_a = (1 + g·2)/(1 - g²), y_b = (2 + g)/(1 - g²)
        let expected = [1.0 + 2.0 * g, 2.0 + g].map(|v| v / (1.0 - g * g));
        for (found, expected) in row.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-11, "{g}: {row:?}");
        }
    }
}

/// Where components give derivatives, these are asked for, and one step of Newton's method is all.
#[test]
fn derivatives_are_used_where_they_are_offered() {
    let log = Log::default();
    let system = algebraic_loop(2.0, |component| {
        component.differentiable().logged("s", &log)
    });
    let row = first_row(system);
    assert!((row[0] + 5.0 / 3.0).abs() < 1e-12, "{row:?}");
    let calls = log.take();
    let begin = calls.iter().position(|call| call == "s.enter").unwrap();
    let end = calls.iter().position(|call| call == "s.exit").unwrap();
    let calls = calls[begin + 2..end].join(" ");
    insta::assert_snapshot!(
        calls,
        @"s.get y s.get y s.set u s.set u s.get y s.get y s.derivative s.derivative s.set u s.set u s.get y s.get y"
    );
}

/// `y = u² + 1` in a ring with `u = y` has no real solution; `y = tanh(3 u) - 2` has one.
#[test]
fn nonlinear_loops_are_solved_or_named() {
    let ring = |f: fn(f64) -> f64| {
        let mut system = System::new();
        system.add("f", Box::new(Static::new(f))).unwrap();
        system.connect("f.y", "f.u").unwrap();
        let clock = Clock::new(0.0, 1.0, 1.0).unwrap();
        let mut recorder = SeriesRecorder::default();
        run(system, &clock, None, Algorithm::Jacobi, &mut recorder)
            .map(|_| recorder.series.columns[0].values[0])
    };
    let y = ring(|u| (3.0 * u).tanh() - 2.0).unwrap();
    assert!((y - ((3.0 * y).tanh() - 2.0)).abs() < 1e-11, "{y}");
    let message = ring(|u| u * u + 1.0).unwrap_err().to_string();
    let begin =
        "the initial values of f.y depend on each other, and Newton's method finds no solution";
    assert!(message.starts_with(begin), "{message}");
}

#[test]
fn a_loop_without_solution_is_named() {
    let clock = Clock::new(0.0, 1.0, 1.0).unwrap();
    let mut recorder = SeriesRecorder::default();
    let system = algebraic_loop(1.0, |component| component);
    let result = run(system, &clock, None, Algorithm::Jacobi, &mut recorder);
    let message = result.unwrap_err().to_string();
    let begin = "the initial values of a.y, b.y depend on each other, and Newton's method finds no \
                 solution: after";
    assert!(message.starts_with(begin), "{message}");
}
