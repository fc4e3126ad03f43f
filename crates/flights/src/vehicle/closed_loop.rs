//! The poles of the closed loop of pilot and vehicle, linearised about hover.

use nalgebra::{Complex, DMatrix};
use num_dual::Dual64;
use pilotage_linear::eigenvalues;
use pilotage_models::{Pilot, Quadcopter, quadcopter::N_STATES};

/// The closed loop of a pilot and a vehicle at hover.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoop {
    /// Its poles [1/s], sorted by magnitude: one per state of pilot and vehicle.
    pub poles: Vec<Complex<f64>>,
}

impl ClosedLoop {
    /// Computes the eigenvalues of the Jacobian of the joint equations for the pilot `theta` with this vehicle;
    /// infinite if they cannot be found.
    pub fn of(vehicle: Quadcopter, pilot: Pilot, theta: &[f64]) -> Self {
        Self {
            poles: eigenvalues(&jacobian(vehicle, pilot, theta)),
        }
    }

    /// Whether every pole lies in the left half-plane.
    pub fn is_stable(&self) -> bool {
        self.rightmost().is_some_and(|pole| pole.re < 0.0)
    }

    /// The pole with the greatest real part.
    pub fn rightmost(&self) -> Option<Complex<f64>> {
        let poles = self.poles.iter().copied();
        poles.max_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)))
    }
}

/// Jacobian of `[f_v(x_v, h_p(x_p)); f_p(x_p, -z)]` (paper, eq. 3) at hover, by dual numbers.
fn jacobian(vehicle: Quadcopter, pilot: Pilot, theta: &[f64]) -> DMatrix<f64> {
    let theta: Vec<Dual64> = theta.iter().map(|&own| own.into()).collect();
    let n = N_STATES + pilot.order;
    let mut jacobian = DMatrix::zeros(n, n);
    let (mut x, mut dx) = (vec![Dual64::from(0.0); n], vec![Dual64::from(0.0); n]);
    for (k, mut column) in jacobian.column_iter_mut().enumerate() {
        x[k].eps = 1.0;
        let (of_vehicle, of_pilot) = x.split_at(N_STATES);
        let (slope, pilot_slope) = dx.split_at_mut(N_STATES);
        vehicle.derivative(of_vehicle, pilot.output(of_pilot, &theta), slope);
        let error = -vehicle.output(of_vehicle);
        pilot.derivative(of_pilot, error, &theta, pilot_slope);
        column
            .iter_mut()
            .zip(&dx)
            .for_each(|(own, dx)| *own = dx.eps);
        x[k].eps = 0.0;
    }
    jacobian
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Position feedback alone on a double integrator: a pair in the right half-plane. With lead it is stable.
    #[test]
    fn a_pilot_without_lead_is_unstable() {
        let of = |theta: &[f64]| ClosedLoop::of(Quadcopter::default(), Pilot { order: 1 }, theta);
        assert!(!of(&[1.0, -0.03]).is_stable());
        assert!(of(&[1.0, -0.03]).rightmost().unwrap().im > 0.0);
        let lead = [216.0, 108.0, 18.0, -6.48, -16.2, -0.5];
        assert!(ClosedLoop::of(Quadcopter::default(), Pilot { order: 3 }, &lead).is_stable());
        assert!(
            !of(&[f64::NAN, -0.03]).is_stable(),
            "not known is not stable"
        );
    }
}
