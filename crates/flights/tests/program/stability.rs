//! The conditions on θ hold exactly where pilot and loop are stable, by their poles.

use crate::{posed, short};
use pilotage_collocation::ParameterConstraints;
use pilotage_flights::FlightOptions;
use pilotage_flights::vehicle::ClosedLoop;
use pilotage_models::{Pilot, Quadcopter};
use proptest::prelude::*;

/// The slowest decay of a loop that counts as stable \[1/s\].
const LOOP_MARGIN: f64 = 1e-3;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 128,
        rng_seed: proptest::test_runner::RngSeed::Fixed(5),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// The conditions on a pilot of this order, and on its loop.
fn conditions(order: usize, stable_loop: bool) -> ParameterConstraints {
    let options = FlightOptions {
        order,
        stable_loop,
        ..FlightOptions::default()
    };
    posed(&short(), &options, |posed| posed.constraints.clone())
}

/// θ1, θ2, θ3 > 0 and θ3 θ2 - θ1 > 0.
#[test]
fn third_order_gives_the_papers_conditions() {
    let conditions = conditions(3, false);
    for theta in [
        [2.0, 3.0, 5.0],
        [-2.0, 3.0, 5.0],
        [2.0, -3.0, 5.0],
        [2.0, 3.0, -5.0],
        [16.0, 3.0, 5.0],
    ] {
        let [a, b, c] = theta;
        let is_stable = a > 0.0 && b > 0.0 && c > 0.0 && c * b - a > 0.0;
        let values = conditions.values(&[a, b, c, -1.0, -1.0, -1.0]);
        assert_eq!(
            values.iter().all(|value| *value >= 0.0),
            is_stable,
            "{theta:?}: {values:?}"
        );
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn conditions_agree_with_the_pilots_poles(order in 1_usize..=6, c in prop::collection::vec(-1.0..8.0_f64, 6)) {
        let theta = [&c[..order], &vec![-0.1; order]].concat();
        let poles = Pilot { order }.poles(&theta);
        let worst = poles.iter().map(|pole| pole.re).fold(f64::NEG_INFINITY, f64::max);
        prop_assume!(worst.abs() > 1e-3);
        let values = conditions(order, false).values(&theta);
        prop_assert_eq!(values.len(), order);
        prop_assert_eq!(values.iter().all(|value| *value >= 0.0), worst < 0.0, "{:?}", values);
    }

    /// Pilots whose lead stabilises the vehicle, or does not, since it is little or the arm is slow.
    #[test]
    fn conditions_agree_with_the_loops_poles(
        gain in 0.01..0.1_f64, lead in 0.0..5.0_f64, arm in prop::collection::vec(0.5..20.0_f64, 1..4)
    ) {
        let order = arm.len() + 1;
        // gain (1 + lead s) over the product of 1 + s/arm, with a further lag.
        let mut polynomial = vec![1.0];
        for pole in arm.iter().chain(&[30.0]) {
            polynomial.push(0.0);
            for k in (0..polynomial.len()).rev() {
                let below = if k == 0 { 0.0 } else { polynomial[k - 1] };
                polynomial[k] = pole * polynomial[k] + below;
            }
        }
        let dc = -gain * polynomial[0];
        let mut theta = polynomial[..order].to_vec();
        theta.extend([dc, lead * dc]);
        theta.resize(2 * order, 0.0);
        let found = ClosedLoop::of(Quadcopter::default(), Pilot { order }, &theta);
        let worst = found.rightmost().unwrap().re;
        prop_assume!((worst + LOOP_MARGIN).abs() > 1e-4);
        let values = conditions(order, true).values(&theta);
        prop_assert_eq!(values.iter().all(|value| *value >= 0.0), worst < -LOOP_MARGIN, "{} {:?}", worst, values);
    }
}
