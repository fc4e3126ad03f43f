//! Location of the events in a step: an indicator becomes positive or ceases to be positive.

use super::System;

/// Number of points in a step at which the indicators are evaluated, to detect one that changes and changes back within
/// the step.
const LOOKS: u32 = 4;

/// The indicators since the last event.
#[derive(Debug)]
pub(super) struct Watch {
    /// Whether each indicator was positive at the start of the step.
    was_positive: Vec<bool>,
    /// Whether these signs were set by the caller.
    is_remembered: bool,
    /// Values at both ends of the interval that contains the event, and between them.
    low: Vec<f64>,
    high: Vec<f64>,
    middle: Vec<f64>,
    x: Vec<f64>,
}

/// Result of the search for events in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Found {
    /// No event.
    Nothing,
    /// An event just before this fraction of the step.
    Event(f64),
    /// The indicators are not defined somewhere in the step.
    Undefined,
}

/// A step with its dense output.
pub(super) struct Path<'a> {
    pub(super) t: f64,
    pub(super) h: f64,
    pub(super) interpolate: &'a dyn Fn(f64, &mut [f64]),
}

impl Watch {
    pub(super) fn new(states: usize, indicators: usize) -> Self {
        let values = || vec![0.0; indicators];
        Self {
            was_positive: vec![false; indicators],
            is_remembered: false,
            low: values(),
            high: values(),
            middle: values(),
            x: vec![0.0; states],
        }
    }

    fn is_idle(&self) -> bool {
        self.was_positive.is_empty()
    }

    /// Discards the known signs.
    pub(super) fn forget(&mut self) {
        self.is_remembered = false;
    }

    /// Sets the signs from which changes count.
    pub(super) fn remember(&mut self, positive: &[bool]) {
        self.was_positive.copy_from_slice(positive);
        self.is_remembered = true;
    }

    /// Starts the search at `(t, x)`. `false` if the indicators are not defined there.
    pub(super) fn start<M: System>(
        &mut self,
        system: &mut M,
        t: f64,
        x: &[f64],
    ) -> Result<bool, M::Error> {
        if self.is_idle() {
            return Ok(true);
        }
        let is_defined = system.indicators(t, x, &mut self.low)?;
        if !std::mem::take(&mut self.is_remembered) {
            for (was_positive, z) in self.was_positive.iter_mut().zip(&self.low) {
                *was_positive = *z > 0.0;
            }
        }
        Ok(is_defined)
    }

    /// Searches a step that starts at the end of the previous one.
    pub(super) fn look<M: System>(
        &mut self,
        system: &mut M,
        path: &Path,
    ) -> Result<Found, M::Error> {
        if self.is_idle() {
            return Ok(Found::Nothing);
        }
        let mut from = 0.0;
        for look in 1..=LOOKS {
            let to = f64::from(look) / f64::from(LOOKS);
            if !self.evaluate(system, path, to)? {
                return Ok(Found::Undefined);
            }
            std::mem::swap(&mut self.middle, &mut self.high);
            if self.has_changed(&self.high) {
                return self.refine(system, path, from, to);
            }
            std::mem::swap(&mut self.low, &mut self.high);
            from = to;
        }
        Ok(Found::Nothing)
    }

    /// The state at the last event.
    pub(super) fn state(&self) -> &[f64] {
        &self.x
    }

    /// Writes the indicators at a fraction of the step into `middle`.
    fn evaluate<M: System>(
        &mut self,
        system: &mut M,
        path: &Path,
        theta: f64,
    ) -> Result<bool, M::Error> {
        (path.interpolate)(theta, &mut self.x);
        system.indicators(path.t + theta * path.h, &self.x, &mut self.middle)
    }

    fn has_changed(&self, z: &[f64]) -> bool {
        let pairs = self.was_positive.iter().zip(z);
        pairs.into_iter().any(|(&was, &z)| was != (z > 0.0))
    }

    /// Narrows the interval of the first change by the Illinois variant of regula falsi, with a bisection if that gains
    /// too little. Returns the upper end, where the change has occurred.
    fn refine<M: System>(
        &mut self,
        system: &mut M,
        path: &Path,
        mut low: f64,
        mut high: f64,
    ) -> Result<Found, M::Error> {
        let size = path.t.abs().max((path.t + path.h).abs());
        let tolerance = (4.0 * f64::EPSILON * size / path.h).max(4.0 * f64::EPSILON);
        // Weights of the two ends: an end that is kept twice has its weight halved.
        let (mut weights, mut stayed) = ((1.0, 1.0), 0i32);
        for round in 1.. {
            let width = high - low;
            if width <= tolerance {
                break;
            }
            let guess = match round % 4 {
                0 => 0.5 * width,
                _ => self.secant(weights) * width,
            };
            let theta = low + guess.clamp(0.5 * tolerance, width - 0.5 * tolerance);
            if theta <= low || theta >= high {
                break;
            }
            if !self.evaluate(system, path, theta)? {
                return Ok(Found::Undefined);
            }
            if self.has_changed(&self.middle) {
                high = theta;
                std::mem::swap(&mut self.middle, &mut self.high);
                stayed = stayed.max(0) + 1;
                weights = if stayed > 1 {
                    (weights.0 * 0.5, 1.0)
                } else {
                    (1.0, 1.0)
                };
            } else {
                low = theta;
                std::mem::swap(&mut self.middle, &mut self.low);
                stayed = stayed.min(0) - 1;
                weights = if stayed < -1 {
                    (1.0, weights.1 * 0.5)
                } else {
                    (1.0, 1.0)
                };
            }
        }
        (path.interpolate)(high, &mut self.x);
        Ok(Found::Event(high))
    }

    /// Estimated position of the first zero of the changed indicators, as a fraction of the interval.
    fn secant(&self, (low, high): (f64, f64)) -> f64 {
        let ends = self.low.iter().zip(&self.high);
        let changed = self.was_positive.iter().zip(ends);
        let zeros = changed.filter_map(|(&was, (a, b))| {
            let (a, b) = (low * a, high * b);
            (was != (b > 0.0) && a != b).then(|| a / (a - b))
        });
        zeros.fold(1.0, f64::min)
    }
}
