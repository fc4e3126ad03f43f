//! Pilot and vehicle as one system: in closed loop ([`Joint`], paper eq. 3), and the pilot alone,
//! driven by the recorded error ([`OpenLoopPilot`], the stick fit that the paper argues against).

use crate::quadcopter::{self, Quadcopter};
use crate::{Dynamics, Pilot, Scalar};

/// The closed loop `x = [x_v; x_p]`, `ẋ = [f_v(x_v, h_p(x_p)); f_p(x_p, ŷ - h_v(x_v))]` (paper, eq. 3).
///
/// Exogenous input: `w = [ŷ]`, the target [m]. Measured output: the vehicle's position [m]. Bounded
/// signal: the stick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// The vehicle.
    pub vehicle: Quadcopter,
    /// The pilot's structure.
    pub pilot: Pilot,
}

impl Dynamics for Joint {
    fn n_states(&self) -> usize {
        quadcopter::N_STATES + self.pilot.order
    }

    fn n_parameters(&self) -> usize {
        self.pilot.n_parameters()
    }

    fn n_inputs(&self) -> usize {
        1
    }

    #[inline(always)]
    fn derivative<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T], dx: &mut [T]) {
        let (x_v, x_p) = x.split_at(quadcopter::N_STATES);
        let (dx_v, dx_p) = dx.split_at_mut(quadcopter::N_STATES);
        let error = -self.vehicle.output(x_v) + w[0];
        self.vehicle
            .derivative(x_v, self.pilot.output(x_p, theta), dx_v);
        self.pilot.derivative(x_p, error, theta, dx_p);
    }

    #[inline(always)]
    fn measured<T: Scalar>(&self, x: &[T], _w: &[T], _theta: &[T]) -> T {
        self.vehicle.output(&x[..quadcopter::N_STATES])
    }

    #[inline(always)]
    fn bounded<T: Scalar>(&self, x: &[T], _w: &[T], theta: &[T]) -> T {
        self.pilot.output(&x[quadcopter::N_STATES..], theta)
    }
}

/// The pilot alone, driven by the error as it was recorded: `w = [ŷ - y_v(t)]` [m]. Measured output
/// and bounded signal are the stick.
///
/// This is the model of earlier work that the paper contrasts with (its Fig. 2): it may follow the
/// stick well and still never bring the vehicle to the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenLoopPilot {
    /// The pilot's structure.
    pub pilot: Pilot,
}

impl Dynamics for OpenLoopPilot {
    fn n_states(&self) -> usize {
        self.pilot.order
    }

    fn n_parameters(&self) -> usize {
        self.pilot.n_parameters()
    }

    fn n_inputs(&self) -> usize {
        1
    }

    #[inline(always)]
    fn derivative<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T], dx: &mut [T]) {
        self.pilot.derivative(x, w[0], theta, dx);
    }

    #[inline(always)]
    fn measured<T: Scalar>(&self, x: &[T], _w: &[T], theta: &[T]) -> T {
        self.pilot.output(x, theta)
    }

    #[inline(always)]
    fn bounded<T: Scalar>(&self, x: &[T], _w: &[T], theta: &[T]) -> T {
        self.pilot.output(x, theta)
    }
}
