//! The vehicle's attitude loop, linearised about hover.

use pilotage_linear::Mode;
use pilotage_models::Quadcopter;
use pilotage_models::pilot::roots;

/// The pitch loop `s³ + a s² + β k_q s + β k_φ` at hover ([`Quadcopter::pitch_polynomial`]).
#[derive(Debug, Clone, PartialEq)]
pub struct PitchLoop {
    /// Its modes, slowest first.
    pub modes: Vec<Mode>,
    /// `a k_q` and `k_φ` [µs/rad]: Routh–Hurwitz requires `a k_q > k_φ > 0`, for any β.
    pub routh: (f64, f64),
}

impl PitchLoop {
    /// The pitch loop of a vehicle.
    pub fn of(vehicle: &Quadcopter) -> Self {
        Self {
            modes: Mode::of_poles(&roots(&vehicle.pitch_polynomial())),
            routh: (
                vehicle.propeller_lag * vehicle.rate_gain,
                vehicle.attitude_gain,
            ),
        }
    }

    /// Whether every pole lies in the left half-plane.
    pub fn is_stable(&self) -> bool {
        let (damping, stiffness) = self.routh;
        damping > stiffness && stiffness > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_loop_has_the_poles_it_was_designed_for() {
        let pitch = PitchLoop::of(&Quadcopter::default());
        assert!(pitch.is_stable());
        let [pair, real] = pitch.modes[..] else {
            panic!("{:?}", pitch.modes)
        };
        // docs/method.md: poles at -6 rad/s, and 5.3 rad/s with damping 0.8.
        assert!((real.pole.re + 6.0).abs() < 0.02 && real.pole.im == 0.0);
        assert!((pair.frequency - 5.3).abs() < 0.02 && (pair.damping - 0.8).abs() < 0.005);
    }

    #[test]
    fn the_gains_that_the_paper_prints_are_unstable_whatever_the_effectiveness_is() {
        for mass in [0.1, 1.2, 100.0] {
            let vehicle = Quadcopter {
                mass,
                attitude_gain: 76.37,
                rate_gain: 1.02,
                ..Quadcopter::default()
            };
            let pitch = PitchLoop::of(&vehicle);
            assert!(!pitch.is_stable());
            assert!(pitch.modes.iter().any(|mode| mode.pole.re > 0.0));
        }
    }
}
