//! Step-size control.

use crate::algorithms::Control;
use serde::{Deserialize, Serialize};

/// A proportional-integral controller (K. Gustafsson, "Control-theoretic techniques for stepsize
/// selection in explicit Runge-Kutta methods", ACM Trans. Math. Softw. 17(4), 1991; Hairer & Wanner,
/// *Solving Ordinary Differential Equations II*, section IV.2).
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Controller {
    shortest: f64,
    longest: f64,
    order: f64,
    next: f64,
    /// Error of the last accepted step, relative to the tolerance.
    last: f64,
    was_rejected: bool,
}

const SAFETY: f64 = 0.9;
const PROPORTIONAL: f64 = 0.7;
const INTEGRAL: f64 = 0.4;
/// Bounds of the ratio of successive steps, for stability of the formulas on unequal steps.
const SMALLEST_FACTOR: f64 = 0.2;
const LARGEST_FACTOR: f64 = 2.0;

impl Controller {
    /// A controller for an error of that order in the step.
    pub(super) fn new(control: &Control, order: i32) -> Self {
        let order = f64::from(order);
        // The first step would meet the tolerance if the signal changed by its magnitude within the longest step.
        let first = control.tolerance.min(1.0).powf(1.0 / order);
        Self {
            shortest: control.min_step,
            longest: control.max_step,
            order,
            next: (first * control.max_step).max(control.min_step),
            last: 1.0,
            was_rejected: false,
        }
    }

    /// The next step and whether it is the last: the `rest` [s] until the next mandatory point is divided into equal
    /// parts.
    pub(super) fn step_within(&self, rest: f64) -> (f64, bool) {
        let wanted = self.next.clamp(self.shortest, self.longest);
        let parts = (rest / wanted * (1.0 - 1e-9)).ceil().max(1.0);
        (rest / parts, parts == 1.0)
    }

    /// After an accepted step by `h` [s] with this error relative to the tolerance.
    pub(super) fn accept(&mut self, h: f64, error: f64) {
        let error = error.max(1e-10);
        let factor =
            SAFETY * error.powf(-PROPORTIONAL / self.order) * self.last.powf(INTEGRAL / self.order);
        let largest = if self.was_rejected {
            1.0
        } else {
            LARGEST_FACTOR
        };
        self.next = h * factor.clamp(SMALLEST_FACTOR, largest);
        self.last = error;
        self.was_rejected = false;
    }

    /// After a rejected step.
    pub(super) fn reject(&mut self, h: f64, error: f64) {
        self.was_rejected = true;
        if error.is_finite() {
            let factor = SAFETY * error.powf(-1.0 / self.order);
            self.next = h * factor.clamp(SMALLEST_FACTOR, 1.0);
        }
    }

    /// After a step that a component discarded at `reached` [s] after its beginning.
    pub(super) fn shorten(&mut self, h: f64, reached: f64) {
        self.next = (SAFETY * reached).clamp(SMALLEST_FACTOR * h, 0.5 * h);
    }
}
