//! Random starts: pilots over a wider range than human ones, to find optima that the starts from the data may miss.

use super::FitOptions;
use super::constraints::{RouthHurwitz, Stability};
use super::start::denominator;
use nalgebra::Complex;
use pilotage_flights::vehicle::LinearVehicle;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};

/// Magnitudes of the poles [1/s].
const POLES: [f64; 2] = [0.05, 20.0];
/// Damping of a complex pair.
const DAMPING: [f64; 2] = [0.1, 1.0];
/// Acceleration due to a steady error of 1 m [1/s²].
const STIFFNESS: [f64; 2] = [0.02, 1.5];
/// Lead time: the numerator's second coefficient divided by its first [s].
const LEAD: [f64; 2] = [0.3, 10.0];
/// Each later coefficient of the numerator divided by the previous one, with either sign [s].
const LATER: [f64; 2] = [0.03, 3.0];

/// Maximum number of draws of a pilot until its closed loop is stable.
const TRIES: usize = 1000;

/// Stable pilots, drawn log-uniformly; a pair of poles is complex with probability one half. If the options keep the
/// closed loop stable, it is stable at the start: from an unstable one the solver fails in a third of the cases. With
/// the same seed, a larger number of starts begins with the same ones.
pub fn draw(options: &FitOptions, seed: u64, count: usize) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let unit = Uniform::new(0.0, 1.0).expect("0 is less than 1");
    let mut unit = || unit.sample(&mut random);
    let vehicle = options.kept_vehicle().map(LinearVehicle::of);
    let stability = Stability {
        pilot: RouthHurwitz {
            pilot: options.pilot,
        },
        vehicle,
    };
    let mut one = || {
        let mut theta = pilot(options, &mut unit);
        for _ in 0..TRIES {
            if stability.holds(&theta) {
                break;
            }
            theta = pilot(options, &mut unit);
        }
        theta
    };
    (0..count).map(|_| one()).collect()
}

/// θ from uniform numbers between 0 and 1.
fn pilot(options: &FitOptions, unit: &mut impl FnMut() -> f64) -> Vec<f64> {
    let order = options.pilot.order;
    let mut poles = Vec::with_capacity(order);
    if !order.is_multiple_of(2) {
        poles.push(Complex::new(-between(POLES, unit()), 0.0));
    }
    while poles.len() < order {
        let (a, b) = (between(POLES, unit()), between(POLES, unit()));
        let damping = between(DAMPING, unit());
        poles.extend(match unit() < 0.5 {
            true => [Complex::new(-a, 0.0), Complex::new(-b, 0.0)],
            false => [1.0, -1.0].map(|sign| {
                Complex::new(-damping * a, sign * (1.0 - damping * damping).sqrt() * a)
            }),
        });
    }
    let mut theta = denominator(poles.into_iter());
    // Forward stick is negative.
    let plant = options.vehicle.gravity * options.vehicle.max_pitch;
    let mut coefficient = -theta[0] * between(STIFFNESS, unit()) / plant;
    for k in 0..order {
        if k > 0 {
            coefficient *= match k {
                1 => between(LEAD, unit()),
                _ if unit() < 0.5 => -between(LATER, unit()),
                _ => between(LATER, unit()),
            };
        }
        theta.push(coefficient);
    }
    theta
}

/// Log-uniform value.
pub(super) fn between([low, high]: [f64; 2], unit: f64) -> f64 {
    low * (high / low).powf(unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_models::Pilot;

    #[test]
    fn every_order_gets_stable_pilots_that_push_towards_the_target() {
        for order in 1..=6 {
            let options = FitOptions {
                pilot: Pilot { order },
                ..FitOptions::default()
            };
            let starts = draw(&options, 7, 20);
            assert_eq!(draw(&options, 7, 3), starts[..3], "more starts begin alike");
            assert_ne!(draw(&options, 8, 1), starts[..1], "another seed");
            for theta in starts {
                assert_eq!(theta.len(), 2 * order);
                assert!(theta[order] < 0.0, "{theta:?}");
                for pole in options.pilot.poles(&theta) {
                    let size = pole.norm() / POLES[0];
                    assert!(pole.re < 0.0 && size > 0.99, "{theta:?}: {pole}");
                    assert!(pole.norm() < 1.01 * POLES[1], "{theta:?}: {pole}");
                }
            }
        }
    }

    /// Half of the pairs are complex, within the scatter of 200 draws.
    #[test]
    fn pairs_are_complex_half_of_the_time() {
        // Without rejection of unstable loops.
        let options = FitOptions {
            stable_loop: false,
            ..FitOptions::default()
        };
        let complex = |theta: &Vec<f64>| {
            let poles = options.pilot.poles(theta);
            poles.iter().any(|pole| pole.im.abs() > 1e-6 * pole.norm())
        };
        let starts = draw(&options, 1, 200);
        let count = starts.into_iter().filter(complex).count();
        assert!((70..=130).contains(&count), "{count}");
    }
}
