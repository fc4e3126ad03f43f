//! Automatic choice of the method: Dormand–Prince, and Radau IIA for stiff problems.

use super::System;
use super::dormand_prince::DormandPrince;
use super::radau::Radau;
use super::scheme::{Scale, Scheme, Step};
use super::solver::{Solver, Work};

/// The integration method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Dormand–Prince, and Radau IIA as soon as the problem looks stiff.
    #[default]
    Automatic,
    /// Dormand–Prince of order 5(4): explicit.
    DormandPrince,
    /// Radau IIA of order 5: implicit.
    Radau,
}

/// Tolerances and method of a solution.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverOptions {
    /// Permitted error of a step relative to each state.
    pub relative: f64,
    /// Permitted error of a step in addition to that, for each state in its unit.
    pub absolute: Vec<f64>,
    /// The integration method.
    pub method: Method,
    /// Longest step \[s\].
    pub longest_step: f64,
}

/// One of the two methods, selected by the user or automatically.
#[derive(Debug)]
pub struct Automatic {
    explicit: DormandPrince,
    implicit: Option<Radau>,
    /// Whether the method may change.
    is_free: bool,
    is_stiff: bool,
}

impl Solver {
    /// A solver for `indicators` event indicators and as many states as there are absolute tolerances.
    /// [`Self::restart`] starts it.
    ///
    /// # Panics
    /// If the relative tolerance or the longest step is not a number above 0, or an absolute tolerance is negative or not a
    /// number.
    pub fn new(indicators: usize, options: SolverOptions) -> Self {
        let n = options.absolute.len();
        assert!(
            options.longest_step > 0.0,
            "a longest step of {} s",
            options.longest_step
        );
        let scheme = Automatic {
            explicit: DormandPrince::new(n),
            implicit: (options.method == Method::Radau).then(|| Radau::new(n)),
            is_free: options.method == Method::Automatic,
            is_stiff: false,
        };
        let mut solver = Self::with(scheme, indicators, options.relative, &options.absolute);
        solver.longest_step = options.longest_step;
        solver
    }

    /// Whether the implicit method is in use.
    pub fn is_implicit(&self) -> bool {
        self.scheme.implicit.is_some()
    }

    /// To be called after [`Self::restart`]: forgets all that is known of the stiffness, and begins with the implicit method or
    /// the explicit one, which stays until this many steps have looked stiff. Equal calls from here on give equal bits.
    pub fn begin_with(&mut self, is_implicit: bool, patience: u32) {
        let n = self.state().len();
        self.scheme.implicit = is_implicit.then(|| Radau::new(n));
        self.scheme.explicit.forget(patience);
        self.scheme.is_stiff = false;
    }

    /// An upper bound of the fastest rate in the system \[1/s\], from its last Jacobian, if the implicit method is in use.
    pub fn fastest_rate(&self) -> Option<f64> {
        self.scheme.implicit.as_ref().map(Radau::fastest_rate)
    }
}

impl Scheme for Automatic {
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error> {
        if std::mem::take(&mut self.is_stiff) {
            self.implicit = Some(Radau::new(step.x.len()));
        }
        match &mut self.implicit {
            Some(radau) => radau.attempt(system, step, scale),
            None => self.explicit.attempt(system, step, scale),
        }
    }

    fn accept<M: System>(&mut self, system: &mut M, step: &mut Step) -> Result<bool, M::Error> {
        if let Some(radau) = &mut self.implicit {
            return radau.accept(system, step);
        }
        self.is_stiff = self.is_free && self.explicit.looks_stiff(step);
        self.explicit.accept(system, step)
    }

    fn interpolate(&self, step: &Step, theta: f64, x: &mut [f64]) {
        match &self.implicit {
            Some(radau) => radau.interpolate(step, theta, x),
            None => self.explicit.interpolate(step, theta, x),
        }
    }

    fn factor(&self, error: f64, last: Option<f64>) -> f64 {
        match &self.implicit {
            Some(radau) => radau.factor(error, last),
            None => self.explicit.factor(error, last),
        }
    }

    fn restart(&mut self) {
        if let Some(radau) = &mut self.implicit {
            radau.restart();
        }
    }

    fn count(&self, work: &mut Work) {
        if let Some(radau) = &self.implicit {
            radau.count(work);
        }
    }
}
