//! Error estimates for the inputs of a step.

use super::Stepper;
use crate::master::Ending;
use crate::master::exchange::Exchange;
use crate::master::wires::Defect;

/// Error of a step, relative to the outputs' magnitudes, above which the result is meaningless.
const NONSENSE: f64 = 0.5;

/// Maximum observed error over a whole fixed step; larger errors justify shorter steps.
const COARSE: f64 = 0.01;

/// Part of the clock's step that is very short, and number of times in one of these that such steps cross a jump of an output:
/// more are noise.
const VERY_SHORT: f64 = 1e-6;
const MOST_CROSSINGS: u32 = 2;
/// Part of the tolerance from which on an error shortens steps.
const MATTERS: f64 = 0.01;
/// Part of a step that is much shorter, and part of its error that is hardly smaller.
const MUCH_SHORTER: f64 = 0.25;
const HARDLY_SMALLER: f64 = 0.5;

/// Very short steps over jumps of an output within a step of the clock.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Crossings {
    count: u32,
    /// Whether the last steps are such.
    is_open: bool,
}

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
                    careful: (size.abs())
                        .max(defect + uncertain.max(history.first_error(p, h, end))),
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

    /// The largest error and its input, as instance and position. `error` computes it from a defect and the position of the
    /// output.
    fn largest(&self, error: impl Fn(&Defect, usize) -> f64) -> (f64, (usize, usize)) {
        let exchange = &self.exchange;
        let mut largest = (0.0_f64, (0, 0));
        for (instance, wired) in exchange.wired.iter().enumerate() {
            for (k, &p) in wired.inputs.positions.iter().enumerate() {
                let error = error(&wired.within.defects[k], p);
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
        let (excess, input) = self.largest(|defect, p| {
            let (magnitude, now) = (self.exchange.history.magnitude(p), self.now(p));
            (defect.unseen / (NONSENSE * now)).max(part * defect.seen / (COARSE * magnitude))
        });
        (excess > 1.0).then_some(input)
    }

    /// Whether an input was meaningless in the last step.
    pub(super) fn is_nonsense(&self) -> bool {
        let part = |own: &Defect, p| own.unseen.max(own.seen) / self.now(p);
        self.largest(part).0 > NONSENSE
    }

    /// Magnitude of an output, including its current value.
    fn now(&self, p: usize) -> f64 {
        let value = self.exchange.outcome(p).value.abs();
        self.exchange.history.magnitude(p).max(value)
    }

    /// Largest error of the last step, relative to the outputs' scales: of the inputs, and of the outputs because inputs
    /// were held within the step.
    pub(super) fn error(&mut self, h: f64, tolerance: f64) -> Result<f64, Ending> {
        self.gather_errors(h)?;
        self.find_noise(h, tolerance);
        let exchange = &self.exchange;
        let relative = |(p, error): (usize, &f64)| {
            let value = exchange.outcome(p).value;
            error / exchange.history.scale(p, h, value).max(value.abs())
        };
        let all = self.errors.iter().enumerate().map(relative);
        Ok(all.fold(0.0, f64::max))
    }

    /// The errors of the fed outputs in the last step.
    fn gather_errors(&mut self, h: f64) -> Result<(), Ending> {
        self.errors.fill(0.0);
        for wired in &self.exchange.wired {
            for (&p, defect) in wired.inputs.positions.iter().zip(&wired.within.defects) {
                self.errors[p] = self.errors[p].max(defect.careful);
            }
        }
        match self.strong.is_some() && self.can_reject {
            true => self.gather_hold_errors(h),
            false => Ok(()),
        }
    }

    /// An error that matters and is hardly smaller than in a much longer step is that of a jump, or noise. A very short step
    /// crosses it, whatever its error; what comes back after such steps is noise.
    fn find_noise(&mut self, h: f64, tolerance: f64) {
        let longest = self.longest_errors.0;
        if h >= longest {
            self.longest_errors.0 = h;
            self.longest_errors.1.clone_from_slice(&self.errors);
        }
        let is_short = h <= VERY_SHORT * self.exchange.history.clock_step;
        if !is_short {
            self.crossings
                .iter_mut()
                .for_each(|own| own.is_open = false);
        }
        if h > MUCH_SHORTER * longest {
            return;
        }
        for (p, error) in self.errors.iter_mut().enumerate() {
            let value = self.exchange.values.outcome(&self.exchange.fed, p).value;
            let history = &mut self.exchange.history;
            let matters = *error > MATTERS * tolerance * history.scale(p, h, value);
            let crossing = &mut self.crossings[p];
            if !matters || *error <= HARDLY_SMALLER * self.longest_errors.1[p] {
                continue;
            }
            if crossing.count >= MOST_CROSSINGS {
                history.note_noise(p, *error, tolerance);
            } else if is_short {
                crossing.count += u32::from(!crossing.is_open);
                crossing.is_open = true;
                *error = 0.0;
            }
        }
    }

    fn gather_hold_errors(&mut self, h: f64) -> Result<(), Ending> {
        let span = (self.exchange.history.time(), h);
        for instance in 0..self.exchange.wired.len() {
            let Exchange {
                wired,
                values,
                profiles,
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
                self.errors[p] = self.errors[p].max(effect);
            }
        }
        Ok(())
    }
}
