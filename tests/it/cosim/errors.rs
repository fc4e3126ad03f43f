//! The estimated coupling errors against exact ones.

use super::blocks::RandomLoop;
use super::components::simulate;
use nalgebra::DVector;
use pilotage::cosim::{Abilities, Algorithm, Coupling, CouplingError};

const H: f64 = 0.02;
const STEPS: u32 = 50;

/// What a connection brings in a step: by the number of the step, and by the outputs some steps after its begin.
type Brought = fn(u32, &dyn Fn(f64) -> DVector<f64>) -> DVector<f64>;

/// By how much the mean over a step is off, if the outputs go as they do in the exact solution.
fn exact(random: &RandomLoop, brought: Brought) -> (DVector<f64>, DVector<f64>) {
    let outputs = random.exact(0.0).len();
    let (mut mean, mut max) = (DVector::zeros(outputs), DVector::<f64>::zeros(outputs));
    for k in 0..STEPS {
        let at = |part: f64| random.exact(H * (f64::from(k) + part));
        // Simpson's rule in two parts: far more exact than what is measured.
        let [a, b, c, d, e] = [0.0, 0.25, 0.5, 0.75, 1.0].map(at);
        let right = (a + 4.0 * b + 2.0 * c + 4.0 * d + e) / 12.0;
        let error = (brought(k, &at) - right).abs();
        max = max.sup(&error);
        mean += error / f64::from(STEPS);
    }
    (mean, max)
}

/// Right to a factor, for every algorithm: of random loops, each connection in mean and maximum.
#[test]
fn estimates_are_right_to_a_factor() {
    let holding = Abilities {
        rollback: true,
        variable_steps: true,
        ..Abilities::default()
    };
    let with = |algorithm, degree| Coupling {
        extrapolation: Some(degree),
        ..Coupling::from(algorithm)
    };
    let held: Brought = |_, y| y(0.0);
    let line: Brought = |k, y| match k {
        0 => y(0.0),
        _ => y(0.0) + (y(0.0) - y(-1.0)) / 2.0,
    };
    let trapezoid: Brought = |_, y| (y(0.0) + y(1.0)) / 2.0;
    let cases: [(Coupling, Brought); 4] = [
        (with(Algorithm::Jacobi, 0), held),
        (with(Algorithm::Jacobi, 1), line),
        (with(Algorithm::GaussSeidel, 0), held),
        (Algorithm::Strong.into(), trapezoid),
    ];
    for (n, seed) in [(2, 1), (3, 2), (8, 4)] {
        let random = RandomLoop::new(seed, n, holding, false);
        for (coupling, brought) in cases {
            let (run, _) = simulate(random.system(), H * f64::from(STEPS), H, coupling);
            let (mean, max) = exact(&random, brought);
            let names: Vec<String> = run.signals.iter().map(|s| s.name.clone()).collect();
            for connection in &run.report.connections {
                let k = names
                    .iter()
                    .position(|name| *name == connection.from)
                    .unwrap();
                let CouplingError {
                    mean: found,
                    max: largest,
                } = connection.error.unwrap();
                let right = |found: f64, exact: f64| found < 2.0 * exact && exact < 2.0 * found;
                assert!(
                    right(found, mean[k]),
                    "{coupling:?} {}: {found} for {}",
                    connection.from,
                    mean[k]
                );
                assert!(
                    right(largest, max[k]),
                    "{coupling:?} {}: {largest} for {}",
                    connection.from,
                    max[k]
                );
            }
        }
    }
}

/// Calls are counted all; they are timed all if so asked, else so few that it costs little.
#[test]
fn calls_are_counted_all_and_timed_as_asked() {
    let steps = 20_000_u32;
    let report = |measure| {
        let abilities = Abilities::default();
        let random = RandomLoop::new(1, 2, abilities, false);
        let coupling = Coupling {
            measure,
            ..Algorithm::Jacobi.into()
        };
        let h = 1e-4;
        let (run, _) = simulate(random.system(), h * f64::from(steps), h, coupling);
        for component in &run.report.instances {
            assert_eq!(component.calls.steps, u64::from(steps));
            assert!(component.seconds > 0.0);
        }
        run.report
    };
    assert_eq!(report(true).timed_steps, u64::from(steps));
    // At least every 1024th.
    let timed = report(false).timed_steps;
    assert!(timed >= u64::from(steps) / 1024, "{timed}");
}
