//! Directions of the variables, slacks and multipliers.

use super::{DAMPING, MOST_DAMPING, Point, Solver};
use crate::kkt::Step;
use pilotage_collocation::simd::{LANES, Lanes};

/// A direction, with the residuals that it meets.
#[derive(Debug, Clone, Default)]
pub(super) struct Direction {
    pub step: Step,
    pub slacks: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    /// Of the defects, the equations at the ends, and the slacks.
    pub c: Vec<Lanes>,
    pub e: Vec<f64>,
    pub residual: Vec<f64>,
    gradient: Vec<f64>,
}

impl Direction {
    /// Takes the residuals of a point.
    pub fn take_residuals(&mut self, at: &Point) {
        self.c.clone_from(&at.values.c);
        self.e.clone_from(&at.e);
        self.residual.clear();
        let pairs = at.g.iter().zip(&at.s);
        self.residual.extend(pairs.map(|(g, s)| g - s));
    }
}

impl Solver<'_> {
    /// Factors the system, with as much damping as it needs.
    pub(super) fn factored(&mut self) -> bool {
        let own = &mut self.linearised;
        own.sigma.clear();
        let multipliers = self.multipliers.low.iter().zip(&self.multipliers.high);
        let rows = self.rows.0.iter().zip(&self.here.s).zip(multipliers);
        own.sigma.extend(
            rows.map(|((row, s), (low, high))| low / (s - row.lower) + high / (row.upper - s)),
        );
        own.of_outputs.clear();
        own.of_outputs
            .resize(self.weights.outputs.len(), [0.0; LANES]);
        let outputs = own.of_outputs.as_flattened_mut();
        own.limited.scatter(own.sigma.iter().copied(), outputs);
        let mut near = 0.0;
        own.is_exact = self.apart.is_none();
        own.smooth = match own.is_exact {
            true => self.factor * self.program.regularise,
            false => 0.0,
        };
        if let Some((from, _)) = &self.apart {
            near = self.mu.sqrt();
            let pairs = self.here.z.iter().zip(from);
            let aim = self.aim.iter_mut().zip(pairs);
            aim.for_each(|(aim, (z, from))| *aim = near * (z - from));
        }
        let mut damping = self.floor;
        loop {
            own.damping = damping + near;
            if self.kkt.factor(&self.evaluator, own) {
                if damping > 0.0 {
                    self.damping = damping;
                }
                return true;
            }
            damping = match (damping > 0.0, self.damping > 0.0) {
                (false, false) => DAMPING,
                (false, true) => (self.damping / 3.0).max(1e-20),
                (true, false) => 100.0 * damping,
                (true, true) => 8.0 * damping,
            };
            if damping > MOST_DAMPING {
                return false;
            }
        }
    }

    /// The direction for its residuals; false if it is not finite.
    pub(super) fn solved(&mut self, own: &mut Direction) -> bool {
        let (mu, rows) = (self.mu, &self.rows.0);
        own.gradient.clone_from(&self.aim);
        for (r, (row, s)) in rows.iter().zip(&self.here.s).enumerate() {
            let pull = mu / (row.upper - s) - mu / (s - row.lower);
            let weight = pull + self.linearised.sigma[r] * own.residual[r];
            self.linearised
                .limited
                .add_row(r, weight, &mut own.gradient);
        }
        let is_finite = self.kkt.solve(
            &self.evaluator,
            &self.linearised,
            (&own.c, &own.e),
            &mut own.gradient,
            &mut own.step,
        );
        for all in [&mut own.slacks, &mut own.low, &mut own.high] {
            all.clear();
        }
        let multipliers = self.multipliers.low.iter().zip(&self.multipliers.high);
        for (r, ((row, s), (low, high))) in
            rows.iter().zip(&self.here.s).zip(multipliers).enumerate()
        {
            let d = self.linearised.limited.times(r, &own.step.z) + own.residual[r];
            own.slacks.push(d);
            own.low.push((mu - low * d) / (s - row.lower) - low);
            own.high.push((mu + high * d) / (row.upper - s) - high);
        }
        is_finite
    }

    /// Longest steps of slacks and of multipliers within their limits.
    pub(super) fn longest(&self, own: &Direction) -> (f64, f64) {
        let tau = super::TAU_MIN.max(1.0 - self.mu);
        let (mut primal, mut dual) = (1.0_f64, 1.0_f64);
        for (r, (row, s)) in self.rows.0.iter().zip(&self.here.s).enumerate() {
            let d = own.slacks[r];
            let room = if d < 0.0 {
                s - row.lower
            } else {
                row.upper - s
            };
            if tau * room < primal * d.abs() {
                primal = tau * room / d.abs();
            }
            for (value, d) in [
                (self.multipliers.low[r], own.low[r]),
                (self.multipliers.high[r], own.high[r]),
            ] {
                if tau * value < -dual * d {
                    dual = -tau * value / d;
                }
            }
        }
        (primal, dual)
    }

    /// Derivative of the barrier objective along a direction.
    pub(super) fn slope(&self, own: &Direction) -> f64 {
        let mu = self.mu;
        let rows = self.rows.0.iter().zip(&self.here.s).zip(&own.slacks);
        let pull = rows.map(|((row, s), d)| (mu / (row.upper - s) - mu / (s - row.lower)) * d);
        let aim = self.aim.iter().zip(&own.step.z).map(|(g, d)| g * d);
        aim.sum::<f64>() + pull.sum::<f64>()
    }
}
