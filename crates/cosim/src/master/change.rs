//! Detects divergence of outputs from their changes between communication points.

use crate::report::Divergence;

/// Number of steps in a window.
const WINDOW: u64 = 16;
/// Growth of the largest change per window that indicates divergence, if it continues for this many windows or reaches
/// this total factor.
const GROWTH: f64 = 3.0;
const WINDOWS: u32 = 6;
const FAR: f64 = 1e7;
/// Number of successive largest changes that alternate in sign and grow by at least this factor.
const TURNS: u32 = 6;
const LARGER: f64 = 1.02;
/// Changes below this part of the value are no growth.
const SMALL: f64 = 1e-10;

/// The changes of an output. The largest change is rarely exceeded unless the output diverges, so the check costs
/// almost nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Change {
    /// Value at the last communication point.
    pub(super) last: f64,
    /// Sum of the magnitudes of the changes, and the largest magnitude.
    pub(super) sum: f64,
    pub(super) largest: f64,
    growth: Growth,
}

/// Growth of the largest change.
#[derive(Debug, Clone, Copy, Default)]
struct Growth {
    /// Step of the largest change, and whether it was upwards.
    step: u64,
    is_up: bool,
    turns: u32,
    /// Window of that step, largest change before it, number of growing windows, and change at their beginning.
    window: u64,
    before: f64,
    windows: u32,
    begin: f64,
    found: Option<Divergence>,
}

impl Change {
    /// Starts at a value.
    pub(super) fn from(value: f64) -> Self {
        Self {
            last: value,
            ..Self::default()
        }
    }

    /// Records the value after a step; returns whether it is finite.
    #[inline]
    pub(super) fn to(&mut self, value: f64, step: u64) -> bool {
        let change = value - self.last;
        self.last = value;
        self.sum += change.abs();
        // NaN fails every comparison.
        match change.abs() <= self.largest {
            true => true,
            false => self.exceeded(change, step),
        }
    }

    #[cold]
    fn exceeded(&mut self, change: f64, step: u64) -> bool {
        if self.last.is_finite() {
            // Changes that are small beside the value are those of rounding, or of a tolerance.
            let is_small = change.abs() <= SMALL * self.last.abs();
            let before = if is_small { 0.0 } else { self.largest };
            self.growth.largest_was(before, change, step);
            self.largest = change.abs();
        }
        self.last.is_finite()
    }

    /// Kind of divergence, if any.
    pub(super) fn divergence(&self) -> Option<Divergence> {
        self.growth.found
    }
}

impl Growth {
    fn largest_was(&mut self, before: f64, change: f64, step: u64) {
        let follows = step == self.step + 1 && before > 0.0;
        let has_turned = follows && (change > 0.0) != self.is_up && change.abs() > LARGER * before;
        self.turns = if has_turned { self.turns + 1 } else { 0 };
        (self.step, self.is_up) = (step, change > 0.0);
        let window = step / WINDOW;
        if window != self.window {
            let grew =
                window == self.window + 1 && self.before > 0.0 && before > GROWTH * self.before;
            match grew {
                true => self.windows += 1,
                false => (self.windows, self.begin) = (0, before),
            }
            (self.window, self.before) = (window, before);
        }
        let is_far = self.windows > 0 && before > FAR * self.begin;
        if self.turns >= TURNS {
            self.found = Some(Divergence::Alternating);
        } else if self.windows >= WINDOWS || is_far {
            self.found.get_or_insert(Divergence::Growing);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divergence(steps: u64, at: impl Fn(f64) -> f64) -> Option<Divergence> {
        let mut change = Change::from(at(0.0));
        for step in 1..=steps {
            assert!(change.to(at(step as f64), step));
        }
        change.divergence()
    }

    #[test]
    fn signals_that_run_away_and_such_that_do_not() {
        use Divergence::{Alternating, Growing};
        let sign = |k: f64| if k % 2.0 == 0.0 { 1.0 } else { -1.0 };
        assert_eq!(
            divergence(20, |k| sign(k) * 1.15_f64.powf(k)),
            Some(Alternating)
        );
        assert_eq!(divergence(100, |k| 1.3_f64.powf(k)), Some(Growing));
        // A growing oscillation with a period of seven steps.
        assert_eq!(
            divergence(200, |k| 1.2_f64.powf(k) * (0.9 * k).sin()),
            Some(Growing)
        );
        // Smooth growth from zero, decay, bounded oscillation, slow instability: none counts as divergence.
        assert_eq!(divergence(1000, |k| k.powi(5)), None);
        assert_eq!(divergence(1000, |k| k.powi(8)), None);
        assert_eq!(divergence(1000, |k| sign(k) * 0.9_f64.powf(k)), None);
        assert_eq!(divergence(1000, sign), None);
        assert_eq!(divergence(1000, |k| (0.05 * k).exp()), None);
        assert_eq!(divergence(1000, |k| (0.2 * k).sin()), None);
    }

    #[test]
    fn what_is_not_finite_is_seen() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut change = Change::from(1.0);
            assert!(change.to(3.0, 1));
            assert!(!change.to(value, 2));
        }
    }
}
