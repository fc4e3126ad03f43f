//! The equations of a step, as the integrator sees them.

use super::Space;
use super::history::{History, Jet};
use super::time_events::Window;
use crate::{At, Equations};
use nalgebra::DMatrix;
use num_dual::{Dual2_64, Dual64};
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
    /// Times of the delays that are exact \[s\].
    pub(super) delays: Vec<f64>,
    /// Where the current step of the integrator begins \[s\].
    pub(super) begin: f64,
    pub(super) history: &'s mut History,
}

impl<E: Equations> Flow<'_, E> {
    /// Evaluates the inputs at a time of the integration; returns the arguments of the equations.
    fn at<'a>(&'a mut self, time: f64, x: &'a [f64]) -> At<'a, f64> {
        let along = self.held.iter().zip(self.slopes);
        for (input, (held, slope)) in self.space.inputs.iter_mut().zip(along) {
            *input = held + slope * time;
        }
        let first = self.held.len();
        for (k, tau) in self.delays.iter().enumerate() {
            let [value, ..] = delayed(self.history, k, (self.start + time, *tau), self.begin);
            self.space.inputs[first + k] = value;
        }
        At {
            time: self.window.kept(self.start + time),
            x,
            u: &self.space.inputs,
            p: self.p,
        }
    }

    /// Where the next step of the integrator ends at the latest: what it takes of the past must be known, and jumps end steps.
    pub(super) fn limit(&self, time: f64, h: f64) -> f64 {
        let now = self.start + time;
        let jumps = self.delays.iter();
        let jumps = jumps.filter_map(|tau| self.history.next_break(now, *tau));
        let next = jumps.map(|jump| jump - self.start).fold(h, f64::min);
        let shortest = self.delays.iter().copied().fold(f64::INFINITY, f64::min);
        match next - time > shortest {
            true => (time + shortest).min(next),
            false => next,
        }
    }

    /// The delayed signals at a time, with two derivatives, after a jump at that time or before it.
    pub(super) fn signals(&mut self, time: f64, x: &[f64], is_after: bool) -> Vec<Jet> {
        let (now, first, n) = (self.start + time, self.held.len(), self.n_states);
        self.begin = if is_after { now } else { self.begin.min(now) };
        let mut rates = vec![0.0; x.len()];
        let equations = self.equations;
        equations.derivative(self.at(time, x), &mut rates[..n]);
        // Along the solution.
        let mut jets: Vec<Jet> = (self.space.inputs[..first].iter().zip(self.slopes))
            .map(|(value, slope)| [*value, *slope, 0.0])
            .collect();
        let own = self.delays.iter().enumerate();
        jets.extend(own.map(|(k, tau)| delayed(self.history, k, (now, *tau), self.begin)));
        let lift = |list: &[f64]| -> Vec<Dual64> {
            list.iter().map(|own| Dual64::from_re(*own)).collect()
        };
        let once: Vec<Dual64> = x
            .iter()
            .zip(&rates)
            .map(|(x, rate)| Dual64::new(*x, *rate))
            .collect();
        let u: Vec<Dual64> = jets.iter().map(|own| Dual64::new(own[0], own[1])).collect();
        let at = At {
            time: Dual64::new(self.window.kept(now), 1.0),
            x: &once,
            u: &u,
            p: &lift(self.p),
        };
        let mut second = vec![Dual64::from_re(0.0); x.len()];
        equations.derivative(at, &mut second[..n]);
        let twice = |own: Jet| Dual2_64::new(own[0], own[1], own[2]);
        let states: Vec<Dual2_64> = (x.iter().zip(&rates).zip(&second))
            .map(|((x, rate), second)| twice([*x, *rate, second.eps]))
            .collect();
        let u: Vec<Dual2_64> = jets.into_iter().map(twice).collect();
        let p: Vec<Dual2_64> = self.p.iter().map(|own| Dual2_64::from_re(*own)).collect();
        let at = At {
            time: twice([self.window.kept(now), 1.0, 0.0]),
            x: &states,
            u: &u,
            p: &p,
        };
        let mut signals = vec![Dual2_64::from_re(0.0); self.delays.len()];
        equations.signals(at, &mut signals);
        signals.iter().map(|own| [own.re, own.v1, own.v2]).collect()
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

/// A delayed signal in a step of the integrator that begins at `begin`, where it is what it was after a jump.
fn delayed(history: &History, k: usize, (time, tau): (f64, f64), begin: f64) -> Jet {
    match time > begin {
        true => history.before(k, time, tau),
        false => history.after(k, time, tau),
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
