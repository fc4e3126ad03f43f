//! Conditions on time: the times at which they change, and on which side of such a time an evaluation lies.
//!
//! Between two such times the equations are smooth, up to both ends. There, rounding decides which side a condition takes, so
//! evaluations keep a few units in the last place away from them.

use super::Simulation;
use crate::Equations;

/// Distance from such a time at which conditions have surely changed, relative to it.
const APART: f64 = 64.0 * f64::EPSILON;

/// A part of a step in which no condition on time changes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// First and last time of an evaluation \[s\].
    low: f64,
    high: f64,
    /// Time of the next change within the step, infinite if there is none \[s\].
    pub(super) stop: f64,
}

impl Default for Window {
    fn default() -> Self {
        Self {
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
            stop: f64::INFINITY,
        }
    }
}

impl Window {
    /// The time of an evaluation.
    pub(super) fn kept(&self, time: f64) -> f64 {
        // Not `clamp`: in a window shorter than rounding the ends are in the wrong order.
        time.max(self.low).min(self.high)
    }
}

impl<E: Equations> Simulation<E> {
    /// The next time after the current one at which a condition on time changes, with constant inputs; after events were
    /// handled there.
    pub fn next_time_event(&self) -> Option<f64> {
        let now = self.now.time;
        let after = |time: &f64| *time > now + apart(*time, now);
        self.times(0.0).into_iter().filter(after).reduce(f64::min)
    }

    /// The current time, or a time just before or after it if conditions on time change there: before until events were
    /// handled.
    pub(super) fn sided_time(&self) -> f64 {
        let (now, handled) = (self.now.time, self.now.handled);
        let is_near = |time: &&f64| (now - **time).abs() <= apart(**time, now);
        match self.times(0.0).iter().find(is_near) {
            Some(time) if handled >= time - apart(*time, now) => time + apart(*time, now),
            Some(time) => time - apart(*time, now),
            None => now,
        }
    }

    /// The part of a step of length `h` that begins at the time `elapsed`, up to the first change of a condition.
    pub(super) fn window(&self, elapsed: f64, h: f64) -> Window {
        let (from, end) = (self.now.time + elapsed, self.now.time + h);
        let mut window = Window::default();
        for time in self.times(elapsed) {
            let apart = apart(time, end);
            if (time - from).abs() <= apart {
                window.low = window.low.max(time + apart);
            } else if time > from && time < end - apart {
                window.stop = window.stop.min(time);
            } else if (time - end).abs() <= apart {
                window.high = window.high.min(time - apart);
            }
        }
        if window.stop.is_finite() {
            window.high = window.stop - apart(window.stop, end);
        }
        window
    }

    /// All times at which a condition on time changes, with the inputs after `elapsed`, which follow their slopes.
    fn times(&self, elapsed: f64) -> Vec<f64> {
        let mut times = Vec::new();
        let now = &self.now;
        let (inputs, p) = (self.table.inputs(), &now.values[self.table.parameters()]);
        let held = &now.values[inputs];
        if now.slopes.iter().all(|slope| *slope == 0.0) {
            self.equations.time_events(held, p, &mut times);
            times.retain(|time| time.is_finite());
            return times;
        }
        let inputs_at = |time: f64| -> Vec<f64> {
            let along = held.iter().zip(&now.slopes);
            along
                .map(|(u, slope)| u + slope * (time - now.time))
                .collect()
        };
        let begin = now.time + elapsed;
        self.equations.time_events(&inputs_at(begin), p, &mut times);
        // A time that depends on an input moves with it: a step of the secant method is exact where that is linear.
        let mut moved = Vec::new();
        for (k, time) in times.iter_mut().enumerate() {
            moved.clear();
            self.equations.time_events(&inputs_at(*time), p, &mut moved);
            let Some(again) = moved.get(k) else { continue };
            let (first, second) = (*time - begin, *again - *time);
            if second != 0.0 && first != second {
                *time = begin + first * first / (first - second);
            }
        }
        times.retain(|time| time.is_finite());
        times
    }
}

/// Distance from a time at which its conditions have surely changed \[s\], near another time.
fn apart(time: f64, near: f64) -> f64 {
    APART * time.abs().max(near.abs())
}
