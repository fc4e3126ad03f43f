//! The filter line search, with second-order corrections, and steps that meet the constraints alone.

use super::{Direction, GAMMA_PHI, GAMMA_THETA, KAPPA_SIGMA, Point, Solver};

const DELTA: f64 = 1.0;
const S_THETA: f64 = 1.1;
const S_PHI: f64 = 2.3;
const ETA_PHI: f64 = 1e-4;
/// Shortest step before the constraints are met alone.
const SHORTEST: f64 = 1e-7;
/// Number of second-order corrections of a step.
const CORRECTIONS: usize = 4;

/// What a trial is compared with.
#[derive(Clone, Copy)]
struct Bar {
    slope: f64,
    violation: f64,
    barrier: f64,
    rounding: f64,
    /// The step, and whether it should be one of descent.
    alpha: f64,
    is_descent: bool,
}

impl Solver<'_> {
    /// Sets the trial point along a direction.
    fn try_at(&mut self, direction: &Direction, alpha: f64) {
        let mut trial = std::mem::take(&mut self.trial);
        let along = |from: &[f64], d: &[f64], to: &mut Vec<f64>| {
            to.clear();
            to.extend(from.iter().zip(d).map(|(from, d)| from + alpha * d));
        };
        along(&self.here.z, &direction.step.z, &mut trial.z);
        along(&self.here.s, &direction.slacks, &mut trial.s);
        self.evaluate(&mut trial);
        self.trial = trial;
    }

    fn is_acceptable(&self, violation: f64, barrier: f64) -> bool {
        let beyond = |(other, lowest): &(f64, f64)| violation < *other || barrier < *lowest;
        violation <= self.most_violation && self.filter.iter().all(beyond)
    }

    fn is_good(&self, at: &Point, bar: &Bar) -> bool {
        let (violation, barrier) = (at.violation(), self.barrier(at) - bar.rounding);
        if !barrier.is_finite() || !self.is_acceptable(violation, barrier) {
            return false;
        }
        match bar.is_descent {
            true => barrier - bar.barrier <= ETA_PHI * bar.alpha * bar.slope,
            false => {
                violation <= (1.0 - GAMMA_THETA) * bar.violation
                    || barrier <= bar.barrier - GAMMA_PHI * bar.violation
            }
        }
    }

    /// Steps along a direction; false if no step is acceptable.
    pub(super) fn search(&mut self, direction: &Direction) -> bool {
        let (mut alpha, dual) = self.longest(direction);
        let barrier = self.barrier(&self.here);
        let mut bar = Bar {
            slope: self.slope(direction),
            violation: self.here.violation(),
            barrier,
            rounding: 10.0 * f64::EPSILON * barrier.abs(),
            alpha,
            is_descent: false,
        };
        let mut is_first = true;
        while alpha > SHORTEST {
            bar.alpha = alpha;
            bar.is_descent = bar.slope < 0.0
                && alpha * (-bar.slope).powf(S_PHI) > DELTA * bar.violation.powf(S_THETA)
                && bar.violation <= self.least_violation;
            self.try_at(direction, alpha);
            if self.is_good(&self.trial, &bar) {
                self.note(&bar);
                self.accept(direction, (alpha, dual));
                return true;
            }
            let is_further = self.trial.is_finite() && self.trial.violation() >= bar.violation;
            if is_first && is_further && self.is_corrected(direction, &bar) {
                return true;
            }
            is_first = false;
            alpha *= 0.5;
        }
        false
    }

    /// Steps along a direction that takes the curvature of the constraints into account, if that is acceptable.
    fn is_corrected(&mut self, direction: &Direction, bar: &Bar) -> bool {
        let mut own = std::mem::take(&mut self.corrected);
        own.c.clone_from(&direction.c);
        own.e.clone_from(&direction.e);
        own.residual.clone_from(&direction.residual);
        let (mut before, mut alpha, mut is_accepted) = (bar.violation, bar.alpha, false);
        for _ in 0..CORRECTIONS {
            let size = self.trial.violation();
            if !size.is_finite() || (size > 0.99 * before && before != bar.violation) {
                break;
            }
            before = size;
            let trial = &self.trial;
            let pairs = own
                .c
                .as_flattened_mut()
                .iter_mut()
                .zip(trial.values.c.as_flattened());
            pairs.for_each(|(own, more)| *own = alpha * *own + more);
            let pairs = own.e.iter_mut().zip(&trial.e);
            pairs.for_each(|(own, more)| *own = alpha * *own + more);
            let pairs = own.residual.iter_mut().zip(trial.g.iter().zip(&trial.s));
            pairs.for_each(|(own, (g, s))| *own = alpha * *own + g - s);
            if !self.solved(&mut own) {
                break;
            }
            let longest = self.longest(&own);
            self.try_at(&own, longest.0);
            if self.is_good(&self.trial, bar) {
                self.note(bar);
                self.accept(&own, longest);
                is_accepted = true;
                break;
            }
            alpha = longest.0;
        }
        self.corrected = own;
        is_accepted
    }

    /// Augments the filter after a step that is none of descent.
    fn note(&mut self, bar: &Bar) {
        if !bar.is_descent {
            self.add_to_filter(bar.violation, bar.barrier);
        }
    }

    pub(super) fn add_to_filter(&mut self, violation: f64, barrier: f64) {
        self.filter.push((
            (1.0 - GAMMA_THETA) * violation,
            barrier - GAMMA_PHI * violation,
        ));
    }

    /// A step that meets the constraints better.
    pub(super) fn search_apart(&mut self, direction: &Direction) -> bool {
        let violation = self.here.violation();
        let (mut alpha, dual) = self.longest(direction);
        while alpha > SHORTEST {
            self.try_at(direction, alpha);
            let reached = self.trial.violation();
            if self.trial.is_finite() && reached <= (1.0 - 1e-4 * alpha) * violation {
                let barrier = self.barrier(&self.trial);
                self.accept(direction, (alpha, dual));
                let before = self.apart.as_ref().map_or(0.0, |(_, before)| *before);
                if reached <= 0.9 * before && self.is_acceptable(reached, barrier) {
                    self.apart = None;
                    // Those of the constraints alone say nothing of the objective.
                    self.multipliers.c.as_flattened_mut().fill(0.0);
                    self.multipliers.e.fill(0.0);
                }
                return true;
            }
            alpha *= 0.5;
        }
        false
    }

    /// Takes the trial point, and new multipliers.
    fn accept(&mut self, direction: &Direction, (alpha, dual): (f64, f64)) {
        std::mem::swap(&mut self.here, &mut self.trial);
        let mu = self.mu;
        let own = &mut self.multipliers;
        for (r, (row, s)) in self.rows.0.iter().zip(&self.here.s).enumerate() {
            let held = |value: f64, room: f64| match room.is_finite() {
                true => value.clamp(mu / (KAPPA_SIGMA * room), KAPPA_SIGMA * mu / room),
                false => 0.0,
            };
            own.low[r] = held(own.low[r] + dual * direction.low[r], s - row.lower);
            own.high[r] = held(own.high[r] + dual * direction.high[r], row.upper - s);
        }
        let blend = |own: &mut [f64], new: &[f64]| {
            let pairs = own.iter_mut().zip(new);
            pairs.for_each(|(own, new)| *own += alpha * (new - *own));
        };
        blend(own.c.as_flattened_mut(), direction.step.c.as_flattened());
        blend(&mut own.e, &direction.step.e);
    }
}
