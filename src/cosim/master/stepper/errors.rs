//! By how much the inputs of a step were wrong.

use super::Stepper;
use crate::cosim::master::Ending;
use crate::cosim::master::exchange::Exchange;
use crate::cosim::master::history::Outcome;

/// Error of a step, relative to the outputs' magnitudes, that is nonsense.
const NONSENSE: f64 = 0.5;

impl Stepper {
    /// Finds by how much each input was wrong in the mean over the last step: by what it differs from the
    /// polynomial of degree 2 (or the cubic with the slopes) through the communication points; and by how much
    /// that may be wrong.
    pub(super) fn examine(&mut self, h: f64) {
        let Exchange {
            wired,
            history,
            values,
            fed,
            ..
        } = &mut self.exchange;
        for wired in wired {
            for (k, &p) in wired.input_positions.iter().enumerate() {
                let end = Outcome {
                    value: values.row[fed[p]],
                    slope: values.slopes[p],
                };
                let course = history.interpolated(p, 2, h, end);
                let doubt = history.interpolation_error(p, h, end);
                wired.defects[k] = ((wired.used[k] - course.mean).abs(), doubt);
            }
        }
    }

    /// Adds the errors of the last step.
    pub(super) fn measure(&mut self, h: f64) {
        for slave in 0..self.exchange.wired.len() {
            for k in 0..self.exchange.wired[slave].inputs.len() {
                let wired = &self.exchange.wired[slave];
                let ((defect, doubt), p) = (wired.defects[k], wired.input_positions[k]);
                let end = self.exchange.outcome(p);
                let doubt = self.exchange.history.mean_error(p, h, end, doubt);
                // What was used is of a lower order than the polynomial, or it is the polynomial.
                let size = defect.max(doubt);
                let error = &mut self.exchange.wired[slave].errors[k];
                error.mean += h * size;
                error.max = error.max.max(size);
            }
        }
    }

    /// An input, as slave and position, that got nonsense in the last step.
    pub(super) fn nonsense(&self) -> Option<(usize, usize)> {
        let exchange = &self.exchange;
        let mut inputs = (exchange.wired.iter().enumerate())
            .flat_map(|(slave, wired)| (0..wired.inputs.len()).map(move |k| (slave, k)));
        inputs.find(|&(slave, k)| {
            let wired = &exchange.wired[slave];
            let ((defect, doubt), p) = (wired.defects[k], wired.input_positions[k]);
            let size = exchange.outcome(p).value.abs();
            defect.max(doubt) > NONSENSE * exchange.history.magnitudes[p].max(size)
        })
    }

    /// Largest error of the last step, relative to the outputs' magnitudes: of what the slaves got, and
    /// of what they gave since their inputs were held within the step.
    pub(super) fn error(&mut self, h: f64) -> Result<f64, Ending> {
        let mut largest = 0.0_f64;
        for slave in 0..self.exchange.wired.len() {
            let exchange = &self.exchange;
            for (k, &p) in exchange.wired[slave].input_positions.iter().enumerate() {
                let size = exchange.outcome(p).value.abs();
                let (defect, doubt) = exchange.wired[slave].defects[k];
                largest = largest.max((defect + doubt) / exchange.history.magnitudes[p].max(size));
            }
        }
        match self.strong.is_some() && self.can_reject {
            true => Ok(largest.max(self.error_of_stairs(h)?)),
            false => Ok(largest),
        }
    }

    fn error_of_stairs(&mut self, h: f64) -> Result<f64, Ending> {
        let mut largest = 0.0_f64;
        let span = (self.exchange.history.time(), h);
        for slave in 0..self.exchange.wired.len() {
            let Exchange {
                wired,
                values,
                courses,
                history,
                fed,
                others_given,
                ..
            } = &mut self.exchange;
            let wired = &mut wired[slave];
            if !wired.has_stairs() {
                continue;
            }
            wired.effect_of_stairs(values, courses, others_given, span, &mut self.room)?;
            for &p in &wired.fed_positions {
                let effect = self.room[fed[p] - wired.output_slots.start].abs() / 3.0;
                largest = largest.max(effect / history.magnitudes[p]);
            }
        }
        Ok(largest)
    }
}
