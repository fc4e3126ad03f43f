//! Means of outputs within a step. Values and slopes at its ends do not determine them: two fast poles bring a stick to
//! its new value long before the end, whereas a cubic takes the whole step. A component with rollback is stepped from
//! the beginning to points within the step, and cubics between these give the output's mean.

use super::Ending;
use super::exchange::Exchange;
use super::history::{InputProfile, Outcome};
use super::wired::{BEGIN, END, Failure, Values, Wired};
use crate::component::Value;

/// An error within this factor of the estimate from the fourth derivative counts as that of a smooth output.
const SMOOTH: f64 = 2.0;

/// Tolerance of the mean between points, as a part of the error seen first or of this small part of the output's
/// magnitude: the error is no measure if the slope at the beginning is very large.
const ENOUGH: f64 = 0.2;
const SMALL: f64 = 1e-5;

/// Errors below this part of the magnitude are component noise.
const NOISE: f64 = 1e-12;

/// Points at which an output is evaluated that is equal at both ends and in the middle, such as one that swings between
/// its limits and back.
const ELSEWHERE: [f64; 6] = [0.07, 0.19, 0.31, 0.43, 0.61, 0.83];

/// Maximum number of points in a step at which an output is evaluated, and shortest part of the step between them.
const MOST: u32 = 200;
const SHORTEST: f64 = 1e-8;

/// Minimum length of a step to a point, relative to the time: much longer than rounding errors of the time.
const CLOCK: f64 = 1e4 * f64::EPSILON;

impl Exchange {
    /// Determines the means over the last step of the fed outputs of all watchable components.
    pub(super) fn watch(&mut self, h: f64) -> Result<(), Ending> {
        for i in 0..self.wired.len() {
            if !self.wired[i].within.is_watchable {
                continue;
            }
            let begin = self.history.time();
            let failed = |failure: Failure| failure.at(begin);
            self.wired[i].save(END).map_err(failed)?;
            match self.watch_component(i, h) {
                // The component does not accept steps of any length.
                Err(Ending::Discarded { .. } | Ending::EndRequested { .. }) => self.look_away(i),
                other => other?,
            }
            self.wired[i].restore(END).map_err(failed)?;
        }
        Ok(())
    }

    fn look_away(&mut self, i: usize) {
        self.wired[i].within.is_watchable = false;
        for &p in &self.wired[i].outputs.fed_positions {
            self.seen[p] = None;
        }
    }

    fn watch_component(&mut self, i: usize, h: f64) -> Result<(), Ending> {
        let mut looks = Looks {
            wired: &mut self.wired[i],
            profiles: &self.profiles,
            others: &self.others_given,
            span: (self.history.time(), h),
        };
        looks.step_to(0.5)?;
        let n = looks.wired.outputs.fed_positions.len();
        for k in 0..n {
            looks.wired.within.middle[k] = looks.wired.within.looked[k];
        }
        let ends_of = |p| [self.history.last(p), self.values.outcome(&self.fed, p)];
        looks.seek_changes(ends_of)?;
        for k in 0..n {
            let p = looks.wired.outputs.fed_positions[k];
            let ends = ends_of(p);
            let fine = looks.wired.within.middle[k].between(ends, h);
            let error = (fine - self.profiles[p].mean).abs();
            let magnitude = self.history.magnitude(p).max(ends[1].value.abs());
            let expected = self.history.smooth_error(p, h, ends[1]).unwrap_or(0.0);
            let is_smooth = error <= SMOOTH * expected || error <= NOISE * magnitude;
            let astray = looks.wired.within.astray[k];
            let enough = ENOUGH * SMALL * magnitude;
            let mut search = Search {
                looks: &mut looks,
                output: k,
                enough: if is_smooth {
                    enough
                } else {
                    enough.min(ENOUGH * error)
                },
                left: MOST,
            };
            self.seen[p] = Some(match astray {
                Some((at, there)) => {
                    search.part([0.0, at], [ends[0], there])?
                        + search.part([at, 1.0], [there, ends[1]])?
                }
                None if is_smooth => fine,
                None => search.part([0.0, 1.0], ends)?,
            });
        }
        Ok(())
    }
}

impl Values {
    /// A fed output at its component's current time.
    pub(super) fn outcome(&self, fed: &[usize], p: usize) -> Outcome {
        Outcome {
            value: self.row[fed[p]],
            slope: self.slopes[p],
        }
    }
}

impl Outcome {
    /// The mean of the cubic from here to `end`, `h` [s] later.
    fn to(self, end: Self, h: f64) -> f64 {
        0.5 * (self.value + end.value) + h / 12.0 * (self.slope - end.slope)
    }

    /// The mean of two cubics that meet here, in the middle of an interval `h` [s].
    fn between(self, [begin, end]: [Self; 2], h: f64) -> f64 {
        0.5 * (begin.to(self, 0.5 * h) + self.to(end, 0.5 * h))
    }
}

/// Steps a component from the beginning of a step to points within it.
struct Looks<'a> {
    wired: &'a mut Wired,
    profiles: &'a [InputProfile],
    others: &'a [Value],
    /// Beginning and length of the step [s].
    span: (f64, f64),
}

impl Looks<'_> {
    /// Reads the fed outputs and their slopes after this fraction of the step.
    fn step_to(&mut self, part: f64) -> Result<(), Ending> {
        let (t, h) = self.span;
        let failed = |failure: Failure| failure.at(t);
        self.wired.restore(BEGIN).map_err(failed)?;
        self.wired.set_others(self.others).map_err(failed)?;
        let positions = &self.wired.inputs.positions;
        match positions.iter().all(|&p| self.profiles[p].is_held()) {
            true => self.wired.hold(self.profiles, false, 0.0),
            false => self.wired.set_ramps(self.profiles, false, 0.0, h),
        }
        .map_err(failed)?;
        self.wired.step(t, part * h, true)?;
        self.wired.look().map_err(failed)
    }

    /// Searches points at which outputs differ that are equal at the ends and in the middle.
    fn seek_changes(&mut self, ends: impl Fn(usize) -> [Outcome; 2]) -> Result<(), Ending> {
        let flat = |wired: &Wired, k: usize| {
            let [begin, end] = ends(wired.outputs.fed_positions[k]).map(|end| end.value);
            begin == end && end == wired.within.middle[k].value
        };
        let n = self.wired.within.astray.len();
        self.wired.within.astray.fill(None);
        if !(0..n).any(|k| flat(self.wired, k)) {
            return Ok(());
        }
        for part in ELSEWHERE {
            self.step_to(part)?;
            for k in 0..n {
                let there = self.wired.within.looked[k];
                if flat(self.wired, k) && there.value != self.wired.within.middle[k].value {
                    self.wired.within.astray[k] = Some((part, there));
                }
            }
        }
        Ok(())
    }
}

/// Adaptive quadrature for the mean of one output.
struct Search<'a, 'b> {
    looks: &'a mut Looks<'b>,
    output: usize,
    /// Maximum error of a part's contribution to the mean over the step.
    enough: f64,
    left: u32,
}

impl Search<'_, '_> {
    /// This part's contribution to the mean; the part is halved until that changes nothing.
    fn part(&mut self, [begin, end]: [f64; 2], ends: [Outcome; 2]) -> Result<f64, Ending> {
        let ((t, h), length) = (self.looks.span, end - begin);
        let coarse = length * ends[0].to(ends[1], length * h);
        if self.left == 0 || length < SHORTEST.max(CLOCK * t.abs() / h) {
            return Ok(coarse);
        }
        self.left -= 1;
        let at = 0.5 * (begin + end);
        self.looks.step_to(at)?;
        let middle = self.looks.wired.within.looked[self.output];
        let fine = length * middle.between(ends, length * h);
        if (fine - coarse).abs() <= self.enough {
            return Ok(fine);
        }
        Ok(self.part([begin, at], [ends[0], middle])? + self.part([at, end], [middle, ends[1]])?)
    }
}
