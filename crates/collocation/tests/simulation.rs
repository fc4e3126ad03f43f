//! Simulated starts: of calm, of stiff and of unstable models.

use num_dual::DualNum;
use pilotage_collocation::{Differentiated, Run, rk4};
use pilotage_expression::{Point, System, Traced};

/// Simulated states of a model without inputs at these times.
fn simulated<const N: usize>(
    equations: impl Fn(Point<'_>) -> [Traced; N],
    time: &[f64],
    initial: [f64; N],
) -> Vec<Vec<f64>> {
    let system = System::trace([N, 0, 0], |at| [equations(at).to_vec(), vec![]]);
    let run = Run {
        mesh: time.to_vec(),
        inputs: vec![vec![]; time.len()],
        measured: vec![],
        initial: vec![None; N],
        time: time.to_vec(),
        steps: pilotage_collocation::Steps::default(),
    };
    Differentiated::new(&system.unwrap()).simulate(&run, &[], &initial)
}

fn times(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|k| step * f64::from(k)).collect()
}

/// To the last bit: steps of 10 ms, modes at -90/s and -100/s.
#[test]
fn models_that_are_not_stiff_are_simulated_by_the_classical_method() {
    let time = times(11, 0.1);
    let found = simulated(
        |at| [at.x[1], -at.x[0] * 9000.0 - at.x[1] * 190.0],
        &time,
        [1.0, 0.0],
    );
    let mut x = [1.0, 0.0];
    for (ends, found) in time.windows(2).zip(&found[1..]) {
        let duration = ends[1] - ends[0];
        let steps = (duration / 0.01).ceil();
        for _ in 0..steps as usize {
            rk4(&mut x, duration / steps, 1, |x, _| {
                vec![x[1], -x[0] * 9000.0 - x[1] * 190.0]
            });
        }
        assert_eq!(found[..], x);
    }
}

/// `cos t` attracts at the rate 10⁵/s (Prothero & Robinson, Math. Comp. 28, 1974).
#[test]
fn a_fast_mode_does_not_grow() {
    let time = times(21, 0.5);
    let rate = |at: Point<'_>| [(at.time.cos() - at.x[0]) * 1e5 - at.time.sin()];
    for (t, x) in time.iter().zip(simulated(rate, &time, [2.0])).skip(1) {
        assert!((x[0] - t.cos()).abs() < 1e-5, "{} at {t}", x[0]);
    }
}

/// Van der Pol's equation with ε = 10⁻⁶; its end in the Test Set for IVP Solvers (Mazzia & Magherini, release 2.4,
/// problem VDPOL).
#[test]
fn a_relaxation_oscillation_keeps_its_phase() {
    let equations = |at: Point<'_>| {
        let (x, v) = (at.x[0], at.x[1]);
        [v, ((-x * x + 1.0) * v - x) * 1e6]
    };
    let found = simulated(equations, &times(21, 0.1), [2.0, 0.0]);
    let end = &found[20];
    assert!((end[0] - 1.706_167_732_170_483).abs() < 1e-3, "{end:?}");
    assert!((end[1] + 0.892_809_701_024_797_5).abs() < 1e-3, "{end:?}");
}

/// `ẋ = x²` has a pole at t = 1, and `ẋ = 900 x` grows by e⁹ in each step.
#[test]
fn what_grows_beyond_all_bounds_stays_finite() {
    let pole = simulated(|at| [at.x[0] * at.x[0]], &times(21, 0.1), [1.0]);
    assert!((pole[9][0] - 10.0).abs() < 1e-3);
    let growing = simulated(|at| [at.x[0] * 900.0], &times(21, 0.1), [1.0]);
    assert!(pole.iter().chain(&growing).all(|x| x[0].is_finite()));
}
