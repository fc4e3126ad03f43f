//! Every derivative of the equations and of the program against central differences.

use crate::differences::{SCHEMES, assert_near, check_problem, difference, largest};
use crate::{Draw, posed, program, short};
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd::{LANES, Lanes};
use pilotage_collocation::{Differentiated, Scales};
use pilotage_flights::FlightOptions;
use pilotage_flights::options::{InitialState, Objective};
use pilotage_sqp::Iterate;
use proptest::prelude::*;
use std::sync::Arc;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 48,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// The equations of a pilot of this order: with the vehicle, or alone.
fn equations(order: usize, objective: Objective) -> Arc<Differentiated> {
    let options = FlightOptions {
        order,
        objective,
        ..FlightOptions::default()
    };
    posed(&short(), &options, |posed| {
        assert_eq!(posed.model.n_parameters(), 2 * order);
        posed.model.clone()
    })
}

/// The numbers of a group of points that are all the same.
fn alike(group: &[Lanes]) -> Vec<f64> {
    assert!(group.iter().all(|own| own.iter().all(|v| *v == own[0])));
    group.iter().map(|own| own[0]).collect()
}

/// What first derivatives are written to.
struct First {
    jacobian: Vec<f64>,
    gradients: [Vec<f64>; 2],
    outputs: Vec<f64>,
}

/// Scaled derivatives of a model at one point: its Jacobian and gradients, and the Hessian of a
/// weighted sum, against differences of values and of first derivatives.
fn check_node(tapes: Arc<Differentiated>, seed: u64) {
    let mut draw = Draw::new(seed);
    let (n, p) = (tapes.n_states(), tapes.n_parameters());
    let inputs = 1 + tapes.n_inputs();
    let scales = Scales {
        states: draw.vector(n).iter().map(|v| 1.2 + v).collect(),
        parameters: draw.vector(p).iter().map(|v| 1.2 + v).collect(),
    };
    let model = NodeModel::new(tapes, scales);
    let (point, input, weight) = (draw.vector(n + p), draw.vector(inputs), draw.vector(n + 2));
    let values = |v: &[f64]| {
        let (mut f, mut outputs) = (vec![[0.0; LANES]; n], vec![[0.0; LANES]; 2]);
        let at = ([&v[..n]; LANES], [&input[..]; LANES]);
        let mut values = model.values(&v[n..]);
        values.evaluate(at.0, at.1, &mut f, &mut outputs);
        f.extend(outputs);
        alike(&f)
    };
    let first = |v: &[f64]| {
        let mut first = First {
            jacobian: Vec::new(),
            gradients: [vec![0.0; n + p], vec![0.0; n + p]],
            outputs: Vec::new(),
        };
        let mut derivatives = model.derivatives(&v[n..]);
        let mut outputs = vec![[0.0; LANES]; 2];
        derivatives.evaluate([&v[..n]; LANES], [&input[..]; LANES], &mut outputs);
        first.outputs = alike(&outputs);
        let mut jacobian = vec![[0.0; LANES]; model.entries.len()];
        derivatives.jacobian(&mut jacobian);
        first.jacobian = alike(&jacobian);
        for (output, gradient) in first.gradients.iter_mut().enumerate() {
            let columns = model.columns(output);
            let mut values = vec![[0.0; LANES]; columns.len()];
            derivatives.gradient(output, &mut values);
            let own = columns.iter().zip(alike(&values));
            own.for_each(|(c, value)| gradient[*c] = value);
        }
        first
    };
    let at = first(&point);
    assert_eq!(at.outputs, values(&point)[n..]);
    let mut rows = vec![vec![0.0; n + p]; n];
    for (value, &(i, j)) in at.jacobian.iter().zip(&model.entries) {
        rows[i][j] = *value;
    }
    rows.extend(at.gradients.clone());
    let scale = largest(&values(&point)) + rows.iter().map(|row| largest(row)).fold(0.0, f64::max);
    for j in 0..n + p {
        for (i, (row, expected)) in rows.iter().zip(difference(&values, &point, j)).enumerate() {
            assert_near(row[j], expected, scale, &format!("row {i}, variable {j}"));
        }
    }

    // Gradient of the weighted sum, whose differences are the second derivatives.
    let gradient = |v: &[f64]| {
        let first = first(v);
        let mut out = vec![0.0; n + p];
        for (value, &(i, j)) in first.jacobian.iter().zip(&model.entries) {
            out[j] += weight[i] * value;
        }
        for (j, out) in out.iter_mut().enumerate() {
            *out += weight[n] * first.gradients[0][j] + weight[n + 1] * first.gradients[1][j];
        }
        out
    };
    let f: Vec<_> = weight[..n].iter().map(|v| [*v; LANES]).collect();
    let weights = [[weight[n]; LANES], [weight[n + 1]; LANES]];
    let mut second = vec![[0.0; LANES]; model.pairs.len()];
    let mut derivatives = model.derivatives(&point[n..]);
    let outputs = &mut [[0.0; LANES]; 2];
    derivatives.evaluate([&point[..n]; LANES], [&input[..]; LANES], outputs);
    derivatives.second_order(&f, &weights, &mut second);
    let second = alike(&second);
    let scale = largest(&gradient(&point)) + largest(&second);
    for j in 0..n + p {
        for (i, expected) in difference(&gradient, &point, j)
            .iter()
            .enumerate()
            .filter(|(i, _)| *i <= j)
        {
            let pair = model.pairs.iter().position(|pair| *pair == (i, j));
            let found = pair.map_or(0.0, |k| second[k]);
            assert_near(
                found,
                *expected,
                scale,
                &format!("second derivative {i}, {j}"),
            );
        }
    }
}

/// θ of a pilot with poles between -2 and 2 1/s, most of them stable.
fn pilot(order: usize, seed: u64) -> Vec<f64> {
    let mut draw = Draw::new(seed);
    let mut polynomial = vec![1.0];
    for pair in draw.vector(2 * order).chunks(2) {
        let size = 1.5 + 0.5 * pair[0];
        let pole = if pair[1] > 0.6 { size } else { -size };
        let times_s = [&[0.0], polynomial.as_slice()].concat();
        polynomial.push(0.0);
        let terms = times_s.iter().zip(&polynomial);
        polynomial = terms.map(|(above, own)| above - pole * own).collect();
    }
    polynomial.truncate(order);
    [polynomial, draw.vector(order)].concat()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_closed_loops_derivatives_are_exact(order in 1_usize..=4, seed: u64) {
        check_node(equations(order, Objective::Response), seed);
    }

    #[test]
    fn the_pilots_derivatives_are_exact(order in 1_usize..=5, seed: u64) {
        check_node(equations(order, Objective::Stick), seed);
    }

    #[test]
    fn stability_constraints_derivatives_are_exact(order in 1_usize..=6, seed: u64) {
        let options = FlightOptions {
            order,
            stable_loop: false,
            ..FlightOptions::default()
        };
        let constraints = posed(&short(), &options, |posed| posed.constraints.clone());
        assert_eq!(constraints.count(), order);
        let theta = pilot(order, seed);
        let values = |theta: &[f64]| constraints.values(theta);
        // Routh's array divides by its entries, near whose zeros differences are not exact.
        prop_assume!(values(&theta).iter().all(|value| value.abs() > 0.2));
        for j in 0..theta.len() {
            let mut dual: Vec<num_dual::Dual64> = theta.iter().map(|t| (*t).into()).collect();
            dual[j].eps = 1.0;
            let found = constraints.values(&dual);
            for (i, expected) in difference(&values, &theta, j).iter().enumerate() {
                assert_near(found[i].eps, *expected, largest(&values(&theta)) + 1.0, &format!("{i}, {j}"));
            }
        }
    }
}

/// The paper's problem on a short trial, every scheme and kind of initial state, response and stick.
#[test]
fn derivatives_of_the_programs_are_exact() {
    let mut draw = Draw::new(3);
    for scheme in SCHEMES {
        for initial_state in InitialState::ALL {
            for objective in Objective::ALL {
                let mut options = FlightOptions {
                    theta: Some(vec![0.3, 1.2, 1.1, -0.2, -0.1, -0.3]),
                    initial_state,
                    objective,
                    ..FlightOptions::default()
                };
                options.fit.scheme = Some(scheme);
                let (problem, z) = program(&short(), &options);
                let mut at = Iterate::new(&problem, z);
                at.lambda = draw.vector(at.lambda.len());
                at.eta = draw.vector(at.eta.len());
                check_problem(&problem, &at);
            }
        }
    }
}
