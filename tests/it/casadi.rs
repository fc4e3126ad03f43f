//! The fit against CasADi and IPOPT, which solved the same problems once: tests/casadi/compare.py
//! wrote the numbers that are compared here.

use pilotage::collocation::Scheme;
use pilotage::identification::{FitOptions, InitialState, TrialSet, fit};
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

fn theta(solution: &Value) -> Vec<f64> {
    solution["theta"]
        .as_array()
        .unwrap()
        .iter()
        .map(number)
        .collect()
}

/// A number with three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap()
}

#[test]
fn the_fit_of_the_shipped_trials_is_ipopts() {
    let text = std::fs::read_to_string(root().join("tests/casadi/result.json")).unwrap();
    let stored: Value = serde_json::from_str(&text).unwrap();
    let set = TrialSet::read(&[root().join("examples/trials/trials.toml")]).unwrap();
    for scheme in [Scheme::Euler, Scheme::Trapezoid, Scheme::HermiteSimpson] {
        // From our solution itself, with Euler, IPOPT ends on the bound with too small a step: "acceptable".
        let ipopt = &stored["schemes"][scheme.name()]["from 2 % off"];
        assert_eq!(ipopt["status"], "Solve_Succeeded", "{}", scheme.name());
        let expected = theta(ipopt);
        let start = Some(expected.iter().copied().map(rounded).collect());
        let options = FitOptions {
            scheme,
            start,
            initial_state: InitialState::AtRest,
            tolerance: 1e-9,
            ..FitOptions::default()
        };
        let fit = fit(&set.fit, &options, &mut |_| ControlFlow::Continue(())).unwrap();
        let name = scheme.name();
        assert!(fit.converged, "{name}: {}", fit.status);
        let objective = number(&ipopt["objective"]);
        assert!(
            (fit.objective / objective - 1.0).abs() < 1e-8,
            "{name}: {} {objective}",
            fit.objective
        );
        // IPOPT stays off an active limit by its barrier: a parameter near zero is compared with what
        // is small beside the others.
        let largest = expected.iter().fold(0.0_f64, |m, t| m.max(t.abs()));
        for (i, (found, expected)) in fit.theta.iter().zip(&expected).enumerate() {
            let bound = 1e-6 * expected.abs().max(1e-3 * largest);
            let near = (found - expected).abs() < bound;
            assert!(near, "{name}, theta{}: {found}, IPOPT {expected}", i + 1);
        }
    }
}
