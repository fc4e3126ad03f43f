//! Error estimates for the inputs of a step.

use super::Stepper;
use crate::master::Ending;
use crate::master::exchange::Exchange;
use crate::master::wires::Defect;

/// Error of a step, relative to the outputs' magnitudes, above which the result is meaningless.
const NONSENSE: f64 = 0.5;

/// Maximum observed error over a whole fixed step; larger errors justify shorter steps.
const COARSE: f64 = 0.01;

impl Stepper {
    /// Estimates the error of each input's mean over the last step: the difference to the [observed](Exchange::watch)
    /// mean of the output or, if it cannot be observed, to the polynomial of degree 2 (or the cubic with the slopes)
    /// through the communication points, and the error of that polynomial.
    pub(super) fn examine(&mut self, h: f64) {
        let Exchange {
            wired,
            history,
            values,
            fed,
            seen,
            ..
        } = &mut self.exchange;
        for wired in wired {
            for (k, &p) in wired.inputs.positions.iter().enumerate() {
                let (end, used) = (values.outcome(fed, p), wired.within.used[k]);
                let defect = (used - history.interpolated(p, 2, h, end).mean).abs();
                let uncertain = history.interpolation_error(p, h, end);
                let seen = seen[p].map(|mean| used - mean);
                // The input used is of a lower order than the polynomial or equal to it.
                let size =
                    seen.unwrap_or_else(|| defect.max(history.mean_error(p, h, end, uncertain)));
                wired.within.defects[k] = Defect {
                    size,
                    careful: size.abs().max(defect + uncertain),
                    seen: seen.map_or(0.0, f64::abs),
                    unseen: seen.map_or(defect.max(uncertain), |_| 0.0),
                };
            }
        }
    }

    /// Adds the errors of the last step.
    pub(super) fn measure(&mut self, h: f64) {
        for wired in &mut self.exchange.wired {
            for (sum, defect) in wired.within.gathered.iter_mut().zip(&wired.within.defects) {
                *sum += h * defect.size;
            }
        }
    }

    /// Converts the accumulated errors over a clock step of `h` [s] into one error, however many steps it took.
    pub(super) fn gather(&mut self, h: f64) {
        for wired in &mut self.exchange.wired {
            for (error, sum) in wired
                .within
                .errors
                .iter_mut()
                .zip(&mut wired.within.gathered)
            {
                let sum = std::mem::take(sum).abs();
                error.mean += sum;
                error.max = error.max.max(sum / h);
            }
        }
    }

    /// The largest error and its input, as instance and position. `error` computes it from a defect, the output's
    /// magnitude at the points of the clock, and that magnitude including its current value.
    fn largest(&self, error: impl Fn(&Defect, f64, f64) -> f64) -> (f64, (usize, usize)) {
        let exchange = &self.exchange;
        let mut largest = (0.0_f64, (0, 0));
        for (instance, wired) in exchange.wired.iter().enumerate() {
            for (k, &p) in wired.inputs.positions.iter().enumerate() {
                let magnitude = exchange.history.magnitudes[p];
                let now = magnitude.max(exchange.outcome(p).value.abs());
                let error = error(&wired.within.defects[k], magnitude, now);
                if error > largest.0 {
                    largest = (error, (instance, k));
                }
            }
        }
        largest
    }

    /// An input, as instance and position, for which the last step, this part of a fixed step, is too long. A pulse
    /// counts by its duration, whatever its height.
    pub(super) fn misled(&self, part: f64) -> Option<(usize, usize)> {
        let (excess, input) = self.largest(|defect, magnitude, now| {
            (defect.unseen / (NONSENSE * now)).max(part * defect.seen / (COARSE * magnitude))
        });
        (excess > 1.0).then_some(input)
    }

    /// Whether an input was meaningless in the last step.
    pub(super) fn is_nonsense(&self) -> bool {
        self.largest(|d, _, now| d.unseen.max(d.seen) / now).0 > NONSENSE
    }

    /// Largest error of the last step, relative to the outputs' magnitudes: of the inputs, and of the outputs because
    /// inputs were held within the step.
    pub(super) fn error(&mut self, h: f64) -> Result<f64, Ending> {
        let (largest, _) = self.largest(|defect, _, now| defect.careful / now);
        match self.strong.is_some() && self.can_reject {
            true => Ok(largest.max(self.hold_error(h)?)),
            false => Ok(largest),
        }
    }

    fn hold_error(&mut self, h: f64) -> Result<f64, Ending> {
        let mut largest = 0.0_f64;
        let span = (self.exchange.history.time(), h);
        for instance in 0..self.exchange.wired.len() {
            let Exchange {
                wired,
                values,
                profiles,
                history,
                fed,
                others_given,
                ..
            } = &mut self.exchange;
            let wired = &mut wired[instance];
            if !wired.has_hold_error() {
                continue;
            }
            wired.effect_of_hold_error(values, profiles, others_given, span, &mut self.room)?;
            for &p in &wired.outputs.fed_positions {
                let effect = self.room[fed[p] - wired.outputs.slots.start].abs() / 3.0;
                largest = largest.max(effect / history.magnitudes[p]);
            }
        }
        Ok(largest)
    }
}
