//! The equations of a step, as the integrator sees them.

use super::Space;
use super::time_events::Window;
use crate::{At, Equations};
use nalgebra::DMatrix;
use num_dual::Dual64;
use pilotage_ode::System;
use std::convert::Infallible;

/// The equations within a step, with time counted from its start.
pub(super) struct Flow<'s, E> {
    pub(super) equations: &'s E,
    /// Number of continuous states.
    pub(super) n_states: usize,
    /// Typical magnitudes of the states and modes.
    pub(super) nominals: &'s [f64],
    /// Time at the start of the step \[s\].
    pub(super) start: f64,
    pub(super) held: &'s [f64],
    pub(super) slopes: &'s [f64],
    pub(super) p: &'s [f64],
    pub(super) positive: &'s [bool],
    pub(super) space: &'s mut Space,
    /// Times between which conditions on time hold as they are.
    pub(super) window: Window,
}

impl<E: Equations> Flow<'_, E> {
    /// Evaluates the inputs at a time of the integration; returns the arguments of the equations.
    fn at<'a>(&'a mut self, time: f64, x: &'a [f64]) -> At<'a, f64> {
        let along = self.held.iter().zip(self.slopes);
        for (input, (held, slope)) in self.space.inputs.iter_mut().zip(along) {
            *input = held + slope * time;
        }
        At {
            time: self.window.kept(self.start + time),
            x,
            u: &self.space.inputs,
            p: self.p,
        }
    }

    /// Whether the sign of an indicator at the start differs from the stored one; 0 has no sign.
    pub(super) fn has_jumped(&mut self, x: &[f64]) -> bool {
        let mut indicators = std::mem::take(&mut self.space.indicators);
        let equations = self.equations;
        equations.indicators(self.at(0.0, x), &mut indicators);
        let mut pairs = indicators.iter().zip(self.positive);
        let has_jumped = pairs.any(|(z, positive)| *z != 0.0 && (*z > 0.0) != *positive);
        self.space.indicators = indicators;
        has_jumped
    }
}

impl<E: Equations> System for Flow<'_, E> {
    type Error = Infallible;

    fn derivatives(&mut self, time: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        // Modes are constant between events.
        let (dx, modes) = dx.split_at_mut(self.n_states);
        modes.fill(0.0);
        let equations = self.equations;
        equations.derivative(self.at(time, x), dx);
        if dx.iter().any(|rate| !rate.is_finite()) {
            let cause = equations.trouble(self.at(time, x));
            self.space.trouble = cause.map(|cause| (self.start + time, cause));
        }
        Ok(true)
    }

    fn indicators(&mut self, time: f64, x: &[f64], z: &mut [f64]) -> Result<bool, Infallible> {
        let equations = self.equations;
        equations.indicators(self.at(time, x), z);
        Ok(true)
    }

    /// Exact, by dual numbers, unless one is not finite.
    fn jacobian(
        &mut self,
        time: f64,
        x: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, Infallible> {
        let (equations, n) = (self.equations, self.n_states);
        let lift = |values: &[f64]| values.iter().map(|&own| Dual64::from_re(own)).collect();
        let at = self.at(time, x);
        let [mut states, u, p]: [Vec<Dual64>; 3] = [at.x, at.u, at.p].map(lift);
        let time = Dual64::from_re(at.time);
        let mut rates = vec![Dual64::from_re(0.0); n];
        // Modes are constant between events.
        jacobian.fill(0.0);
        for j in 0..n {
            states[j].eps = 1.0;
            let at = At {
                time,
                x: &states,
                u: &u,
                p: &p,
            };
            equations.derivative(at, &mut rates);
            states[j].eps = 0.0;
            for (i, rate) in rates.iter().enumerate() {
                jacobian[(i, j)] = rate.eps;
            }
        }
        Ok(jacobian.iter().all(|own| own.is_finite()))
    }
}
