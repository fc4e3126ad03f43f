//! Vehicles of the synthetic human.

use super::Hands;
use pilotage_models::{Quadcopter, quadcopter::N_STATES};

/// A vehicle with one or two axes, each with a stick and a position.
pub trait Vehicle {
    /// The states at the start.
    fn start(&self) -> Vec<f64>;

    /// Number of axes.
    fn axes(&self) -> usize {
        1
    }

    /// Unit of the position of an axis.
    fn unit(&self, axis: usize) -> &str;

    /// The stops of the stick of an axis.
    fn stops(&self, axis: usize) -> (f64, f64);

    /// 1 if a positive stick moves that axis forward, else -1.
    fn sign(&self, axis: usize) -> f64;

    /// Writes the derivatives of the states.
    fn derivative(&self, time: f64, x: &[f64], stick: &[f64], dx: &mut [f64]);

    /// Position of each axis and its rate, from the states and their derivatives, and the sticks and their rates.
    fn observe(&self, time: f64, x: [&[f64]; 2], stick: [&[f64]; 2]) -> Vec<(f64, f64)>;

    /// Names and units of the other recorded quantities.
    fn others(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Values of the other recorded quantities.
    fn record(&self, _time: f64, _x: &[f64], _stick: &[f64]) -> Vec<f64> {
        Vec::new()
    }

    /// Magnitude of the fastest pole [1/s]; 0 if steps of a millisecond are known to suffice.
    fn fastest(&self) -> f64 {
        0.0
    }

    /// Whether a human stabilises it: small deviations from the start decay. `true` if not checked.
    fn is_held_by(&self, _hands: &Hands) -> bool {
        true
    }

    /// The command that checks the vehicle.
    fn check_command(&self) -> &'static str;
}

impl Vehicle for Quadcopter {
    fn start(&self) -> Vec<f64> {
        vec![0.0; N_STATES]
    }

    fn unit(&self, _axis: usize) -> &str {
        "m"
    }

    fn stops(&self, _axis: usize) -> (f64, f64) {
        (-1.0, 1.0)
    }

    fn sign(&self, _axis: usize) -> f64 {
        -1.0
    }

    fn derivative(&self, _time: f64, x: &[f64], stick: &[f64], dx: &mut [f64]) {
        self.derivative(x, stick[0], dx);
    }

    fn observe(&self, _time: f64, [x, _]: [&[f64]; 2], _stick: [&[f64]; 2]) -> Vec<(f64, f64)> {
        vec![(x[0], x[2])]
    }

    fn check_command(&self) -> &'static str {
        "pilotage vehicle check"
    }
}
