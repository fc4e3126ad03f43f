//! Step size control and events: each step ends at the first event in it.

use super::root::{Found, Path, Watch};
use super::scheme::{Scale, Scheme, Step};
use super::{Automatic, IntegrationError, System};
use nalgebra::DMatrix;

/// Work of a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejections: u64,
    /// Evaluations of the derivatives.
    pub evaluations: u64,
    /// Evaluations of the indicators.
    pub indicators: u64,
    /// Jacobians; one by finite differences also takes as many evaluations as there are states.
    pub jacobians: u64,
    /// Factorisations of the implicit method's two matrices.
    pub factorisations: u64,
}

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// At its end.
    Step,
    /// At an event: an indicator has just changed.
    Event,
}

/// A solution in progress. The method is chosen automatically unless one is given.
#[derive(Debug)]
pub struct Solver<S = Automatic> {
    pub(super) scheme: S,
    t: f64,
    x: Vec<f64>,
    /// The derivative at `(t, x)`, if known.
    f: Vec<f64>,
    is_known: bool,
    /// Proposed length of the next step \[s\], if any.
    h: Option<f64>,
    /// The last accepted step, if the next length has not yet been derived from it.
    done: Option<Done>,
    /// Error of the previous step.
    last: Option<f64>,
    x_end: Vec<f64>,
    f_end: Vec<f64>,
    scale: Scale,
    pub(super) longest_step: f64,
    watch: Watch,
    work: Work,
}

/// An accepted step.
#[derive(Debug, Clone, Copy)]
struct Done {
    h: f64,
    error: f64,
    /// Whether it was shortened to end at a limit.
    is_last: bool,
}

impl<S: Scheme> Solver<S> {
    /// A solver with this method and `indicators` event indicators. The permitted error of a step is `relative` times
    /// each state plus `absolute`, for each state in its unit. [`Self::restart`] starts it.
    ///
    /// # Panics
    /// If the relative tolerance is not a number above 0, or an absolute one is negative or not a number.
    pub fn with(scheme: S, indicators: usize, relative: f64, absolute: &[f64]) -> Self {
        let n = absolute.len();
        assert!(
            relative > 0.0 && relative.is_finite(),
            "a relative tolerance of {relative}"
        );
        assert!(
            absolute.iter().all(|own| *own >= 0.0 && own.is_finite()),
            "absolute tolerances: {absolute:?}"
        );
        Self {
            scheme,
            t: 0.0,
            x: vec![0.0; n],
            f: vec![0.0; n],
            is_known: false,
            h: None,
            done: None,
            last: None,
            x_end: vec![0.0; n],
            f_end: vec![0.0; n],
            scale: Scale {
                relative,
                absolute: absolute
                    .iter()
                    .map(|own| own.max(f64::MIN_POSITIVE))
                    .collect(),
            },
            longest_step: f64::INFINITY,
            watch: Watch::new(n, indicators),
            work: Work::default(),
        }
    }

    /// Continues from here after a discontinuity of the state or the equations. With `is_new`, the past says nothing
    /// about the future, so the step size is determined anew.
    ///
    /// # Panics
    /// If the number of states is another one.
    pub fn restart(&mut self, t: f64, x: &[f64], is_new: bool) {
        match is_new {
            true => (self.h, self.done) = (None, None),
            false => self.settle(),
        }
        self.t = t;
        self.x.copy_from_slice(x);
        self.is_known = false;
        self.last = None;
        self.watch.forget();
        self.scheme.restart();
    }

    /// To be called after [`Self::restart`]: length of the first step to try \[s\], instead of an estimate.
    pub fn try_first(&mut self, h: f64) {
        self.h = Some(h);
    }

    /// To be called after [`Self::restart`]: which indicators count as positive before the first step, instead of their
    /// signs at its start.
    ///
    /// # Panics
    /// If the number of indicators is another one.
    pub fn remember(&mut self, positive: &[bool]) {
        self.watch.remember(positive);
    }

    /// Changes the tolerances.
    pub fn set_tolerances(&mut self, relative: f64, absolute: impl IntoIterator<Item = f64>) {
        self.scale.relative = relative;
        for (tolerance, new) in self.scale.absolute.iter_mut().zip(absolute) {
            *tolerance = f64::max(new, f64::MIN_POSITIVE);
        }
    }

    /// Current time \[s\].
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Current state.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Work so far.
    pub fn work(&self) -> Work {
        let mut work = self.work;
        self.scheme.count(&mut work);
        work
    }

    /// One step, at most to `limit` \[s\], which is reached exactly, and at most to the first event.
    ///
    /// # Errors
    /// If an evaluation fails, or the error is too large even with the shortest step.
    ///
    /// # Panics
    /// If `limit` is not after the current time, or not finite.
    pub fn advance<M: System>(
        &mut self,
        system: &mut M,
        limit: f64,
    ) -> Result<Advance, IntegrationError<M::Error>> {
        assert!(
            limit > self.t && limit.is_finite(),
            "a step from {} s to {limit} s",
            self.t
        );
        let system = &mut Counting {
            inner: system,
            evaluations: 0,
            indicators: 0,
            undefined: None,
        };
        let result = self.step(system, limit);
        self.work.evaluations += system.evaluations;
        self.work.indicators += system.indicators;
        result
    }

    fn step<M: System>(
        &mut self,
        system: &mut Counting<'_, M>,
        limit: f64,
    ) -> Result<Advance, IntegrationError<M::Error>> {
        self.settle();
        self.prepare(system, limit)?;
        let mut is_again = false;
        loop {
            let (h, is_last) = self.length(limit);
            // Shorter steps would not advance time; a limit may be arbitrarily near.
            if h < 16.0 * f64::EPSILON * self.t.abs() && !is_last || h < f64::MIN_POSITIVE {
                let time = self.t;
                return Err(match system.undefined {
                    Some(what) => IntegrationError::UndefinedBeyond { time, what },
                    None => IntegrationError::StepTooShort { time, step: h },
                });
            }
            system.undefined = None;
            let (error, found) = self.attempt(system, h, is_again)?;
            let end = if is_last { limit } else { self.t + h };
            let theta = match found {
                Found::Nothing => None,
                Found::Event(theta) => Some(theta),
                Found::Undefined => {
                    self.work.rejections += 1;
                    is_again = true;
                    self.h = Some(h * self.factor(error).clamp(0.1, 0.9));
                    continue;
                }
            };
            self.work.steps += 1;
            self.done = Some(Done { h, error, is_last });
            return Ok(self.arrive(h, end, theta));
        }
    }

    /// Moves to the end of a step of length `h`, or to an event within it.
    fn arrive(&mut self, h: f64, end: f64, event: Option<f64>) -> Advance {
        let is_event = event.is_some();
        match event {
            None => {
                self.t = end;
                std::mem::swap(&mut self.f, &mut self.f_end);
            }
            Some(theta) => {
                self.t = if theta >= 1.0 {
                    end
                } else {
                    self.t + theta * h
                };
                self.x_end.copy_from_slice(self.watch.state());
                self.is_known = false;
            }
        }
        std::mem::swap(&mut self.x, &mut self.x_end);
        match is_event {
            true => Advance::Event,
            false => Advance::Step,
        }
    }

    /// Derives the length of the next step from the last one.
    fn settle(&mut self) {
        let Some(Done { h, error, is_last }) = self.done.take() else {
            return;
        };
        let next = h * self.factor(error).clamp(0.2, 8.0);
        // A step shortened to a limit says little about the next one.
        let kept = self.h.filter(|_| is_last).unwrap_or(0.0);
        self.h = Some(next.max(kept));
        self.last = Some(error.max(1e-4));
    }

    /// Ratio of the next length to that of an attempt with this error.
    fn factor(&self, error: f64) -> f64 {
        match error.is_finite() {
            true => self.scheme.factor(error.max(1e-10), self.last),
            false => 0.25,
        }
    }

    /// Prepares a step: the derivative, the indicators and a first length.
    fn prepare<M: System>(
        &mut self,
        system: &mut M,
        limit: f64,
    ) -> Result<(), IntegrationError<M::Error>> {
        if !self.is_known {
            let is_defined = self.x.iter().all(|x| x.is_finite())
                && system.derivatives(self.t, &self.x, &mut self.f)?
                && self.watch.start(system, self.t, &self.x)?;
            if !is_defined {
                return Err(IntegrationError::Undefined { time: self.t });
            }
            self.is_known = true;
        }
        if self.h.is_none() {
            self.h = Some(self.first_length(system, limit)?);
        }
        Ok(())
    }

    /// First length from the magnitudes of the state and its first two derivatives (Hairer, Nørsett & Wanner, section
    /// II.4).
    fn first_length<M: System>(&mut self, system: &mut M, limit: f64) -> Result<f64, M::Error> {
        let (x, f) = (&self.x, &self.f);
        let norm = |v: &[f64]| self.scale.norm(|i| v[i], x, x);
        let (size, slope) = (norm(x), norm(f));
        let longest = limit - self.t;
        let guess = match size < 1e-5 || slope < 1e-5 {
            true => 1e-6,
            false => 0.01 * size / slope,
        };
        let guess = guess.min(longest);
        for (end, (x, f)) in self.x_end.iter_mut().zip(x.iter().zip(f)) {
            *end = x + guess * f;
        }
        if !system.derivatives(self.t + guess, &self.x_end, &mut self.f_end)? {
            return Ok(guess);
        }
        let change = |i: usize| self.f_end[i] - f[i];
        let bend = self.scale.norm(change, x, x) / guess;
        let largest = slope.max(bend);
        let second = match largest <= 1e-15 {
            true => (guess * 1e-3).max(1e-6),
            false => (0.01 / largest).powf(0.2),
        };
        let length = second.min(100.0 * guess);
        Ok(if length.is_finite() { length } else { guess })
    }

    /// Length of the next step \[s\], and whether it ends at the limit.
    fn length(&self, limit: f64) -> (f64, bool) {
        let rest = limit - self.t;
        let wanted = self.h.unwrap_or(rest).min(self.longest_step);
        // Avoids a short remaining step.
        if self.x.is_empty() || wanted * 1.01 >= rest {
            (rest.min(self.longest_step), rest <= self.longest_step)
        } else if wanted * 2.0 > rest {
            (rest * 0.5, false)
        } else {
            (wanted, false)
        }
    }

    /// Attempts a step. Returns its error and the events in it.
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        h: f64,
        is_again: bool,
    ) -> Result<(f64, Found), M::Error> {
        let mut step = Step {
            t: self.t,
            h,
            x: &self.x,
            f: &self.f,
            x_end: &mut self.x_end,
            f_end: &mut self.f_end,
            is_again,
        };
        let error = self.scheme.attempt(system, &mut step, &self.scale)?;
        if error > 1.0 {
            return Ok((error, Found::Undefined));
        }
        let mut found = Found::Undefined;
        if self.scheme.accept(system, &mut step)? {
            let path = Path {
                t: step.t,
                h,
                interpolate: &|theta, x| self.scheme.interpolate(&step, theta, x),
            };
            found = self.watch.look(system, &path)?;
        }
        if found == Found::Undefined {
            self.scheme.restart();
        }
        Ok((error, found))
    }
}

/// Counts evaluations, and treats values that are not finite as undefined.
struct Counting<'a, M> {
    inner: &'a mut M,
    evaluations: u64,
    indicators: u64,
    /// What was undefined in the last attempt.
    undefined: Option<&'static str>,
}

impl<M: System> System for Counting<'_, M> {
    type Error = M::Error;

    #[inline(always)]
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, M::Error> {
        self.evaluations += 1;
        let is_defined = self.inner.derivatives(t, x, dx)?;
        // Without a branch per value, since this runs in every stage.
        let sum = dx.iter().fold(0.0, |sum, value| sum + value.abs());
        let is_defined = is_defined && sum < f64::INFINITY;
        if !is_defined {
            self.undefined = Some("derivatives");
        }
        Ok(is_defined)
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, M::Error> {
        self.indicators += 1;
        let is_defined = self.inner.indicators(t, x, z)?;
        let is_defined = is_defined && !z.iter().any(|value| value.is_nan());
        if !is_defined {
            self.undefined = Some("event indicators");
        }
        Ok(is_defined)
    }

    fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, M::Error> {
        self.inner.jacobian(t, x, jacobian)
    }
}
