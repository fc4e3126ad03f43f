//! A pilot that is known is found again. The trajectories are integrated here, by code of its own.

use crate::fitted::{self, theta};
use crate::joint_ode::Joint;
use pilotage::collocation::Scheme;
use pilotage::estimation::Fit;
use pilotage::flights::{FlightOptions, Trial};
use pilotage::models::Pilot;

/// A pilot like the synthetic humans: lead, and lags at some rad/s; its closed loop is stable.
const THETA: [f64; 6] = [12.0, 17.0, 8.0, -0.1, -0.6, -0.1];

/// Weights `a_ij` of the unknown nodes of an interval, one row each.
type Weights = &'static [&'static [f64]];

/// Schemes whose nodes are their stages (Hairer & Wanner II, table 5.7: Lobatto IIIA).
const TABLES: [(Scheme, Weights); 3] = [
    (Scheme::Euler, &[&[1.0, 0.0]]),
    (Scheme::Trapezoid, &[&[0.5, 0.5]]),
    (
        Scheme::HermiteSimpson,
        &[
            &[5.0 / 24.0, 1.0 / 3.0, -1.0 / 24.0],
            &[1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        ],
    ),
];

fn joint(options: &FlightOptions) -> Joint {
    Joint {
        vehicle: options.vehicle,
        pilot: Pilot {
            order: options.order,
        },
    }
}

fn derivative(joint: &Joint, x: &[f64], target: f64) -> Vec<f64> {
    let mut dx = vec![0.0; x.len()];
    joint.derivative(x, &[target], &THETA, &mut dx);
    dx
}

/// `x + Σ a k`.
fn along(x: &[f64], terms: &[(f64, &Vec<f64>)]) -> Vec<f64> {
    let sum = |i: usize| terms.iter().map(|(a, k)| a * k[i]).sum::<f64>();
    (0..x.len()).map(|i| x[i] + sum(i)).collect()
}

/// One step of a scheme: its equations `X_i = X_0 + h Σ a_ij f(X_j)` by fixed-point iteration.
fn scheme_step(joint: &Joint, table: Weights, x: &[f64], target: f64, h: f64) -> Vec<f64> {
    let mut nodes = vec![x.to_vec(); table.len() + 1];
    for _ in 0..1000 {
        let rates: Vec<_> = nodes.iter().map(|x| derivative(joint, x, target)).collect();
        let mut next = vec![x.to_vec()];
        for row in table {
            let terms: Vec<_> = row.iter().map(|a| h * a).zip(&rates).collect();
            next.push(along(x, &terms));
        }
        let changes = next
            .iter()
            .flatten()
            .zip(nodes.iter().flatten())
            .map(|(a, b)| (a - b).abs());
        let change = changes.fold(0.0, f64::max);
        nodes = next;
        if change < 1e-15 {
            break;
        }
    }
    nodes.pop().expect("a node")
}

/// One step of the continuous model: classical Runge–Kutta in steps of at most a millisecond.
fn exact_step(joint: &Joint, x: &[f64], target: f64, h: f64) -> Vec<f64> {
    let n = (h / 1e-3).ceil();
    let h = h / n;
    let mut x = x.to_vec();
    for _ in 0..n as usize {
        let k1 = derivative(joint, &x, target);
        let k2 = derivative(joint, &along(&x, &[(h / 2.0, &k1)]), target);
        let k3 = derivative(joint, &along(&x, &[(h / 2.0, &k2)]), target);
        let k4 = derivative(joint, &along(&x, &[(h, &k3)]), target);
        x = along(
            &x,
            &[
                (h / 6.0, &k1),
                (h / 3.0, &k2),
                (h / 3.0, &k3),
                (h / 6.0, &k4),
            ],
        );
    }
    x
}

/// A run from rest to a target [m]: duration and interval [s].
fn trial(
    options: &FlightOptions,
    target: f64,
    (duration, h): (f64, f64),
    step: impl Fn(&Joint, &[f64], f64, f64) -> Vec<f64>,
) -> Trial {
    let joint = joint(options);
    let n = (duration / h).round() as usize;
    let mut states = vec![vec![0.0; joint.n_states()]];
    for k in 0..n {
        states.push(step(&joint, &states[k], target, h));
    }
    let stick: Vec<f64> = states.iter().map(|x| joint.bounded(x, &THETA)).collect();
    assert!(
        stick.iter().all(|u| u.abs() < 0.99),
        "the stick stays off its limits"
    );
    Trial {
        name: format!("{target} m"),
        origin: format!("{target}.csv"),
        sha256: String::new(),
        time_unit: "s".into(),
        note: None,
        time: (0..=n).map(|k| k as f64 * h).collect(),
        target: vec![target; n + 1],
        position: states.iter().map(|x| x[0]).collect(),
        stick: Some(stick),
        weight: 1.0,
    }
}

fn fitted(trials: &[Trial], options: &FlightOptions) -> Fit {
    let fit = fitted::fitted(trials, options);
    let scheme = options.fit.scheme.unwrap().name();
    assert!(
        fit.is_answer(),
        "{scheme}: {} {:?}",
        fit.verdict(),
        theta(&fit)
    );
    fit
}

/// Largest relative error of θ.
fn error(fit: &Fit) -> f64 {
    let pairs = theta(fit).into_iter().zip(THETA);
    pairs.fold(0.0, |m, (t, e)| m.max(((t - e) / e).abs()))
}

#[test]
fn data_of_the_discretised_model_give_its_parameters_back() {
    for (scheme, table) in TABLES {
        let options = fitted::with(|own| {
            own.fit.scheme = Some(scheme);
            own.fit.tolerance = 1e-10;
        });
        let step =
            |joint: &Joint, x: &[f64], target: f64, h: f64| scheme_step(joint, table, x, target, h);
        let trials = [6.0, -8.0].map(|target| trial(&options, target, (10.0, 0.05), step));
        let fit = fitted(&trials, &options);
        assert!(error(&fit) < 1e-6, "{}: {:?}", scheme.name(), theta(&fit));
    }
}

#[test]
fn data_of_the_continuous_model_give_its_parameters_to_the_schemes_order() {
    for (scheme, h) in [
        (Scheme::Euler, 0.003_125),
        (Scheme::Trapezoid, 0.025),
        (Scheme::HermiteSimpson, 0.04),
    ] {
        let options = fitted::with(|own| {
            own.fit.scheme = Some(scheme);
            own.fit.starts = Some(1);
            own.theta = Some(THETA.map(|own| 1.02 * own).to_vec());
            own.fit.tolerance = 1e-12;
        });
        let error_at = |h: f64| {
            error(&fitted(
                &[trial(&options, 10.0, (8.0, h), exact_step)],
                &options,
            ))
        };
        let order = (error_at(h) / error_at(h / 2.0)).log2();
        let expected = scheme.order() as f64;
        assert!(
            (order - expected).abs() < 0.2,
            "{}: order {order}",
            scheme.name()
        );
    }
}
