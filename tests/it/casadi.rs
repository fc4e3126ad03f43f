//! The fit against CasADi and IPOPT, which solved the same problems once: tests/casadi/compare.py
//! wrote the numbers that are compared here.

use crate::fitted::{self, fitted, with};
use pilotage::collocation::Scheme;
use pilotage::flights::TrialSet;
use serde_json::Value;
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
        let options = with(|own| {
            own.fit.scheme = Some(scheme);
            own.fit.starts = Some(1);
            own.theta = Some(expected.iter().copied().map(rounded).collect());
            own.fit.tolerance = 1e-11;
        });
        let fit = fitted(&set.fit, &options);
        let name = scheme.name();
        assert_eq!(fit.status.as_str(), "converged", "{name}");
        let objective = number(&ipopt["objective"]);
        assert!(
            (fit.objective / objective - 1.0).abs() < 1e-8,
            "{name}: {} {objective}",
            fit.objective
        );
        // IPOPT stays off an active limit by its barrier: a parameter near zero is compared with what
        // is small beside the others.
        let largest = expected.iter().fold(0.0_f64, |m, t| m.max(t.abs()));
        for (i, (found, expected)) in fitted::theta(&fit).into_iter().zip(&expected).enumerate() {
            let bound = 1e-6 * expected.abs().max(1e-3 * largest);
            let near = (found - expected).abs() < bound;
            assert!(near, "{name}, theta{}: {found}, IPOPT {expected}", i + 1);
        }
    }
}
