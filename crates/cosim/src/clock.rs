//! Communication points, computed by counting steps, not by summing step sizes.

use pilotage_text::number::rounded;
use thiserror::Error;

/// The communication points `t_k = t_0 + k·h`, `k = 0..=steps`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    start: f64,
    stop: f64,
    step: f64,
    steps: u64,
}

/// Why a clock is invalid.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ClockError {
    /// The step is not a positive number.
    #[error("the communication step is {step} s, expected a positive number")]
    Step {
        /// The given step \[s\].
        step: f64,
    },
    /// The times are not in order.
    #[error("the simulation would run from {start} s to {stop} s, expected a stop after the start")]
    Order {
        /// Start time \[s\].
        start: f64,
        /// Stop time \[s\].
        stop: f64,
    },
    /// The step does not divide the duration.
    #[error(
        "{duration} s are {} steps of {step} s, expected a whole number: stop at {}{} s, or change the step", readable(*ratio),
        if *ratio < 1.0 { String::new() } else { format!("{} s or ", readable(*below)) }, readable(*above)
    )]
    NotWhole {
        /// Stop minus start \[s\].
        duration: f64,
        /// The step \[s\].
        step: f64,
        /// Their ratio.
        ratio: f64,
        /// Last communication point before the stop \[s\].
        below: f64,
        /// First communication point after the stop \[s\].
        above: f64,
    },
    /// Too many steps to be distinguished in floating-point time.
    #[error("{ratio:e} steps are too short: times would no longer differ")]
    TooMany {
        /// Number of steps.
        ratio: f64,
    },
}

/// The number without binary rounding noise.
fn readable(value: f64) -> f64 {
    rounded(value, 9)
}

/// Relative tolerance for a whole number of steps: with decimal input, 15/0.05 need not be exactly 300.
const TOLERANCE: f64 = 1e-9;

impl Clock {
    /// From `start` to `stop` in steps of `step` \[s\].
    ///
    /// # Errors
    /// If the times are not in order, the step does not divide the duration (to 1e-9), or is lost in the rounding of the
    /// times.
    pub fn new(start: f64, stop: f64, step: f64) -> Result<Self, ClockError> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(ClockError::Step { step });
        }
        if !(start < stop && start.is_finite() && stop.is_finite()) {
            return Err(ClockError::Order { start, stop });
        }
        let ratio = (stop - start) / step;
        let whole = ratio.round();
        // Neighbouring times differ by more than their rounding.
        let is_lost = step < 8.0 * f64::EPSILON * start.abs().max(stop.abs());
        if ratio >= 1e15 || is_lost {
            return Err(ClockError::TooMany { ratio });
        }
        if whole == 0.0 || (ratio - whole).abs() > TOLERANCE * ratio.max(1.0) {
            return Err(ClockError::NotWhole {
                duration: stop - start,
                step,
                ratio,
                below: start + ratio.floor() * step,
                above: start + ratio.ceil() * step,
            });
        }
        Ok(Self {
            start,
            stop,
            step,
            steps: whole as u64,
        })
    }

    /// No step: the components are only initialized at `start` \[s\], for a simulation with step `step` \[s\].
    ///
    /// # Errors
    /// As [`Clock::new`].
    pub fn standing(start: f64, step: f64) -> Result<Self, ClockError> {
        let one = Self::new(start, start + step, step)?;
        Ok(Self { steps: 0, ..one })
    }

    /// Start time \[s\].
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Stop time \[s\].
    pub fn stop(&self) -> f64 {
        self.stop
    }

    /// Communication step `h` \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Number of steps.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The communication point `t_0 + k·h` \[s\].
    pub fn time(&self, k: u64) -> f64 {
        self.start + k as f64 * self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_steps_are_counted() {
        for (stop, step, steps) in [
            (15.0, 0.05, 300),
            (1.0, 0.1, 10),
            (0.3, 0.1, 3),
            (1e4, 1e-3, 10_000_000),
        ] {
            assert_eq!(Clock::new(0.0, stop, step).unwrap().steps(), steps);
        }
        // Summing 0.1 ten times gives 0.9999999999999999.
        assert_eq!(Clock::new(0.0, 1.0, 0.1).unwrap().time(10), 1.0);
    }

    #[test]
    fn bad_clocks_say_why() {
        for (start, stop, step, message) in [
            (
                0.0,
                1.0,
                0.0,
                "the communication step is 0 s, expected a positive number",
            ),
            (
                0.0,
                1.0,
                f64::NAN,
                "the communication step is NaN s, expected a positive number",
            ),
            (
                1.0,
                1.0,
                0.1,
                "the simulation would run from 1 s to 1 s, expected a stop after the start",
            ),
            (
                0.0,
                f64::INFINITY,
                0.1,
                "the simulation would run from 0 s to inf s, expected a stop after the start",
            ),
            (
                0.0,
                1.0,
                0.375,
                "1 s are 2.66666667 steps of 0.375 s, expected a whole number: stop at 0.75 s or 1.125 s, or change the step",
            ),
            (
                0.0,
                1.0,
                2.0,
                "1 s are 0.5 steps of 2 s, expected a whole number: stop at 2 s, or change the step",
            ),
            (
                0.0,
                1.0,
                1e-16,
                "1e16 steps are too short: times would no longer differ",
            ),
            (
                1e16,
                1e16 + 2.0,
                0.25,
                "8e0 steps are too short: times would no longer differ",
            ),
        ] {
            assert_eq!(
                Clock::new(start, stop, step).unwrap_err().to_string(),
                message
            );
        }
    }
}
