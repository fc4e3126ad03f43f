//! Steps of the right length, each up to the first event in it.

use super::dormand_prince::DormandPrince;
use super::radau::Radau;
use super::root::{Found, Path, Watch};
use super::{Attempt, Dynamics, IntegrationError, Scale};
use nalgebra::DMatrix;

/// Which method solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Dormand–Prince, and Radau IIA from where the problem comes to look stiff.
    #[default]
    Automatic,
    /// Dormand–Prince of order 5(4): explicit.
    DormandPrince,
    /// Radau IIA of order 5: implicit.
    Radau,
}

/// How exact the solution shall be.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Error that a step may have, relative to each state.
    pub relative: f64,
    /// Error that a step may have beside that, of each state in its unit.
    pub absolute: Vec<f64>,
    /// Which method solves.
    pub method: Method,
    /// Longest step [s].
    pub longest_step: f64,
}

/// What a solution has cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Steps done.
    pub steps: u64,
    /// Steps refused.
    pub rejections: u64,
    /// Evaluations of the derivatives.
    pub evaluations: u64,
    /// Evaluations of the indicators.
    pub indicators: u64,
    /// Jacobians; one by differences is as many evaluations as there are states beside.
    pub jacobians: u64,
    /// Factorisations of the implicit method's two matrices.
    pub factorisations: u64,
}

/// How far a step came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// To its end.
    Step,
    /// To an event: an indicator has just changed.
    Event,
}

/// A solution on its way.
#[derive(Debug)]
pub struct Solver {
    t: f64,
    x: Vec<f64>,
    /// The derivative at `(t, x)`, if known.
    f: Vec<f64>,
    is_known: bool,
    /// Length to try next [s], if there is a proposal.
    h: Option<f64>,
    /// Error of the last step.
    last: Option<f64>,
    x_end: Vec<f64>,
    f_end: Vec<f64>,
    scale: Scale,
    explicit: DormandPrince,
    implicit: Option<Radau>,
    is_automatic: bool,
    longest_step: f64,
    watch: Watch,
    work: Work,
}

impl Solver {
    /// For `indicators` event indicators and as many states as there are absolute tolerances. It is started
    /// by [`Self::restart`].
    pub fn new(indicators: usize, options: Options) -> Self {
        let n = options.absolute.len();
        Self {
            t: 0.0,
            x: vec![0.0; n],
            f: vec![0.0; n],
            is_known: false,
            h: None,
            last: None,
            x_end: vec![0.0; n],
            f_end: vec![0.0; n],
            scale: Scale {
                relative: options.relative,
                absolute: options.absolute,
            },
            explicit: DormandPrince::new(n),
            implicit: (options.method == Method::Radau).then(|| Radau::new(n)),
            is_automatic: options.method == Method::Automatic,
            longest_step: options.longest_step,
            watch: Watch::new(n, indicators),
            work: Work::default(),
        }
    }

    /// Goes on from here: the state or the equations have jumped. `is_new`: nothing that was is to be
    /// expected of what comes, so that the length of steps is found anew.
    pub fn restart(&mut self, t: f64, x: &[f64], is_new: bool) {
        self.t = t;
        self.x.copy_from_slice(x);
        self.is_known = false;
        self.last = None;
        if is_new {
            self.h = None;
        }
        if let Some(radau) = &mut self.implicit {
            radau.restart();
        }
    }

    /// Changes the absolute tolerances.
    pub fn set_absolute(&mut self, absolute: &[f64]) {
        self.scale.absolute.copy_from_slice(absolute);
    }

    /// Where it stands [s].
    pub fn time(&self) -> f64 {
        self.t
    }

    /// The state there.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Whether the implicit method is in use.
    pub fn is_implicit(&self) -> bool {
        self.implicit.is_some()
    }

    /// What it has cost.
    pub fn work(&self) -> Work {
        let radau = self.implicit.as_ref();
        Work {
            jacobians: radau.map_or(0, |r| r.jacobians),
            factorisations: radau.map_or(0, |r| r.factorisations),
            ..self.work
        }
    }

    /// One step, at most to `limit` [s], which is hit exactly, and no further than to an event.
    ///
    /// # Errors
    /// If an evaluation fails, or no step is short enough.
    ///
    /// # Panics
    /// If `limit` is not after the present time.
    pub fn advance<D: Dynamics>(
        &mut self,
        system: &mut D,
        limit: f64,
    ) -> Result<Advance, IntegrationError<D::Error>>
    where
        D::Error: std::error::Error + 'static,
    {
        assert!(limit > self.t, "a step from {} s to {limit} s", self.t);
        let system = &mut Counting {
            inner: system,
            evaluations: 0,
            indicators: 0,
        };
        let result = self.step(system, limit);
        self.work.evaluations += system.evaluations;
        self.work.indicators += system.indicators;
        result
    }

    fn step<D: Dynamics>(
        &mut self,
        system: &mut D,
        limit: f64,
    ) -> Result<Advance, IntegrationError<D::Error>>
    where
        D::Error: std::error::Error + 'static,
    {
        self.prepare(system, limit)?;
        let mut is_again = false;
        loop {
            let (h, is_last) = self.length(limit);
            // Shorter steps would not move time; a limit may be as near as it likes.
            if h < 16.0 * f64::EPSILON * self.t.abs() && !is_last || h < f64::MIN_POSITIVE {
                return Err(IntegrationError::StepTooShort {
                    time: self.t,
                    step: h,
                });
            }
            let attempt = self.attempt(system, h, is_again)?;
            let found = match attempt {
                Attempt::Error(error) if error <= 1.0 => self.accept(system, h, is_last, error)?,
                _ => Found::Undefined,
            };
            let end = if is_last { limit } else { self.t + h };
            match found {
                Found::Nothing => {
                    self.work.steps += 1;
                    self.t = end;
                    std::mem::swap(&mut self.x, &mut self.x_end);
                    std::mem::swap(&mut self.f, &mut self.f_end);
                    return Ok(Advance::Step);
                }
                Found::Event(theta) => {
                    self.work.steps += 1;
                    self.t = if theta >= 1.0 {
                        end
                    } else {
                        self.t + theta * h
                    };
                    match &self.implicit {
                        Some(radau) => radau.interpolate(theta, &mut self.x),
                        None => self.explicit.interpolate(theta, &mut self.x),
                    }
                    self.is_known = false;
                    return Ok(Advance::Event);
                }
                Found::Undefined => {
                    self.work.rejections += 1;
                    is_again = true;
                    self.h = Some(h * self.factor(attempt, false));
                }
            }
        }
    }

    /// What a step starts from: the derivative, the indicators and a first length.
    fn prepare<D: Dynamics>(
        &mut self,
        system: &mut D,
        limit: f64,
    ) -> Result<(), IntegrationError<D::Error>>
    where
        D::Error: std::error::Error + 'static,
    {
        if !self.is_known {
            let is_defined = system.derivatives(self.t, &self.x, &mut self.f)?
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

    /// A first length from the sizes of the state and its first two derivatives (Hairer, Nørsett & Wanner,
    /// section II.4).
    fn first_length<D: Dynamics>(&mut self, system: &mut D, limit: f64) -> Result<f64, D::Error> {
        let (x, f) = (&self.x, &self.f);
        let norm = |v: &[f64]| self.scale.norm(v.iter().copied(), x, x);
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
        let change = self.f_end.iter().zip(f).map(|(a, b)| a - b);
        let bend = self.scale.norm(change, x, x) / guess;
        let largest = slope.max(bend);
        let second = match largest <= 1e-15 {
            true => (guess * 1e-3).max(1e-6),
            false => (0.01 / largest).powf(0.2),
        };
        let length = second.min(100.0 * guess);
        Ok(if length.is_finite() { length } else { guess })
    }

    /// The next step's length [s], and whether it ends at the limit.
    fn length(&self, limit: f64) -> (f64, bool) {
        let rest = limit - self.t;
        let wanted = self.h.unwrap_or(rest).min(self.longest_step);
        // No short step shall be left over.
        if self.x.is_empty() || wanted * 1.01 >= rest {
            (rest.min(self.longest_step), rest <= self.longest_step)
        } else if wanted * 2.0 > rest {
            (rest * 0.5, false)
        } else {
            (wanted, false)
        }
    }

    fn attempt<D: Dynamics>(
        &mut self,
        system: &mut D,
        h: f64,
        is_again: bool,
    ) -> Result<Attempt, IntegrationError<D::Error>>
    where
        D::Error: std::error::Error + 'static,
    {
        let (t, x, f, scale) = (self.t, &self.x, &self.f, &self.scale);
        let end = &mut self.x_end;
        let attempt = match &mut self.implicit {
            Some(radau) => radau.attempt(system, t, h, x, f, end, scale, is_again)?,
            None => {
                let end = (end.as_mut_slice(), self.f_end.as_mut_slice());
                self.explicit.attempt(system, t, h, x, f, end, scale)?
            }
        };
        Ok(attempt)
    }

    /// A step whose error is small enough: proposes the next length and looks for events.
    fn accept<D: Dynamics>(
        &mut self,
        system: &mut D,
        h: f64,
        is_last: bool,
        error: f64,
    ) -> Result<Found, IntegrationError<D::Error>>
    where
        D::Error: std::error::Error + 'static,
    {
        let factor = self.factor(Attempt::Error(error), true);
        // A step that had to end at the limit says little about the next one.
        let kept = self.h.filter(|_| is_last).unwrap_or(0.0);
        let (mut next, mut is_stiff) = ((h * factor).max(kept), false);
        match &mut self.implicit {
            Some(radau) => {
                if radau.accept(h, &self.x) && (1.0..1.2).contains(&factor) {
                    next = h.max(kept);
                }
                let is_defined = system.derivatives(self.t + h, &self.x_end, &mut self.f_end)?;
                if !is_defined {
                    radau.restart();
                    return Ok(Found::Undefined);
                }
            }
            None => is_stiff = self.explicit.accept(h, &self.x, &self.x_end),
        }
        let path = Path {
            t: self.t,
            h,
            interpolate: &|theta, x| match &self.implicit {
                Some(radau) => radau.interpolate(theta, x),
                None => self.explicit.interpolate(theta, x),
            },
        };
        let found = self.watch.look(system, &path)?;
        if found == Found::Undefined {
            if let Some(radau) = &mut self.implicit {
                radau.restart();
            }
            return Ok(found);
        }
        self.h = Some(next);
        self.last = Some(error.max(1e-4));
        if is_stiff && self.is_automatic && found == Found::Nothing {
            self.implicit = Some(Radau::new(self.x.len()));
            self.last = None;
        }
        Ok(found)
    }

    /// By how much the next length differs from this one.
    fn factor(&self, attempt: Attempt, is_accepted: bool) -> f64 {
        let Attempt::Error(error) = attempt else {
            return 0.25;
        };
        let error = error.max(1e-10);
        let factor = match &self.implicit {
            // Many iterations: a shorter step would converge better.
            Some(radau) => {
                let iterations = f64::from(radau.iterations);
                let safety = 0.9 * 13.0 / (12.0 + iterations);
                safety * error.powf(-0.25)
            }
            // Proportional and integral.
            None => {
                let last = self.last.unwrap_or(1e-4);
                0.9 * error.powf(-0.17) * last.powf(0.04)
            }
        };
        match is_accepted {
            true => factor.clamp(0.2, 8.0),
            false => factor.clamp(0.1, 0.9),
        }
    }
}

/// Counts evaluations.
struct Counting<'a, D> {
    inner: &'a mut D,
    evaluations: u64,
    indicators: u64,
}

impl<D: Dynamics> Dynamics for Counting<'_, D> {
    type Error = D::Error;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, D::Error> {
        self.evaluations += 1;
        let is_defined = self.inner.derivatives(t, x, dx)?;
        Ok(is_defined && dx.iter().all(|value| value.is_finite()))
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, D::Error> {
        self.indicators += 1;
        let is_defined = self.inner.indicators(t, x, z)?;
        Ok(is_defined && !z.iter().any(|value| value.is_nan()))
    }

    fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, D::Error> {
        self.inner.jacobian(t, x, jacobian)
    }
}
