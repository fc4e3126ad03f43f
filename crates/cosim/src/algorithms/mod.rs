//! How components are coupled: in which order they are set, stepped and read, what they are given for the
//! values that are not known yet, and how long a communication step is.

mod order;

pub(super) use order::Propagation;
pub use order::gauss_seidel_order;

/// How components that step side by side exchange values (Kübler & Schiehlen, "Two methods of simulator
/// coupling", Math. Comput. Model. Dyn. Syst. 6(2), 2000).
///
/// The first two are of first order in the communication step `h` where inputs are held at what is
/// known: with Jacobi every input lags by `h/2` on average; with Gauss-Seidel of two components in a loop,
/// the first one's inputs are `h/2` late and the second one's `h/2` early, which cancels around the
/// loop. The third solves for values that are consistent at the end of the step, and has no lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// All components get the others' outputs at `t_k`, then all step to `t_{k+1}`.
    #[default]
    Jacobi,
    /// One component after another gets the newest outputs there are, steps and gives its own.
    GaussSeidel,
    /// Strong coupling, of second order at least: the steps are repeated from saved states until the
    /// outputs at `t_{k+1}` are those that the inputs were made of.
    ///
    /// Within the step an input goes straight from the feeding output's value at `t_k` to that at
    /// `t_{k+1}` or, where the component gives the outputs' derivatives, along the cubic with these at both
    /// ends; a derivative at `t_k` that belongs to a transient which is over within the step makes an exponential
    /// and a line instead, so that fast poles (and jumps through them) throw nothing off. A component that
    /// takes input derivatives gets the line nearest to that, any other its mean; where a component with
    /// direct feedthrough would so be given another value at the end, its outputs come from a step that ends
    /// right, its state from another one. The outputs at `t_{k+1}` are found by Newton's method, whose matrix
    /// comes from differences of repeated steps and is kept as long as it serves; algebraic loops between
    /// components are thereby solved too. Components that cannot go back take their step first, with
    /// extrapolated inputs. Values that are no reals are held through a step, at those of its end if these
    /// settle, reals that are discrete at those of its begin.
    ///
    /// Where the coupling error of a step of fixed length is as large as the signal, the step is halved until it
    /// is not; where components cannot do that, the run ends.
    Strong,
}

impl std::fmt::Display for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Jacobi => "jacobi",
            Self::GaussSeidel => "gauss-seidel",
            Self::Strong => "strong",
        })
    }
}

/// Everything about how a run couples its components. An [`Algorithm`] alone becomes one with the defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coupling {
    /// In which order components are set, stepped and read.
    pub algorithm: Algorithm,
    /// Degree, 0 to [`MAX_EXTRAPOLATION`], of the polynomial through the last communication points
    /// that stands for outputs not known yet; with 0 the last value is held. By default 0, but for the
    /// first pass of strong coupling, for which it does not matter but in speed.
    pub extrapolation: Option<usize>,
    /// Chooses the communication steps by their error; `None` keeps the clock's.
    pub control: Option<Control>,
    /// How strong coupling iterates.
    pub iteration: Iteration,
    /// Jacobi with held inputs and fixed steps: the components step at the same time, on as many threads as
    /// rayon would use (`RAYON_NUM_THREADS`), which look for work all the time. The results are the same.
    /// From which cost of a step on it pays, `cargo bench --bench coupling` tells: 0.5 µs on two
    /// processors that are free, 10 µs and more where other programs use them too.
    pub parallel: bool,
    /// Whether to time every call for the [report](super::Report), instead of those in a few steps.
    pub measure: bool,
}

/// Highest degree of extrapolation.
pub const MAX_EXTRAPOLATION: usize = 2;

impl From<Algorithm> for Coupling {
    fn from(algorithm: Algorithm) -> Self {
        Self {
            algorithm,
            extrapolation: None,
            control: None,
            iteration: Iteration::default(),
            parallel: false,
            measure: false,
        }
    }
}

/// When the iteration of strong coupling ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Largest difference between an output and what the inputs were made of, relative to the largest
    /// magnitude so far (or the variable's nominal value, if that is larger).
    pub tolerance: f64,
    /// Largest number of corrections in a step.
    pub max: u32,
}

impl Default for Iteration {
    fn default() -> Self {
        Self {
            tolerance: 1e-9,
            max: 20,
        }
    }
}

/// Communication steps as long as the coupling error allows.
///
/// The error of a step is by how much the mean of an input over the step is wrong, relative to the
/// largest magnitude of the feeding output so far (or its nominal value, if that is larger): the
/// system is solved exactly for inputs that are off by no more than this. What an input should have
/// been is an interpolating polynomial through communication points, one degree higher than what was
/// used (an embedded pair, as in Adams methods; Hairer, Nørsett & Wanner, *Solving Ordinary
/// Differential Equations I*, section III.1). Inputs of components that hold them are staircases, whose
/// effect is seen by comparing one step with two half ones. Every communication point of the clock is
/// hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Largest error of a step.
    pub tolerance: f64,
    /// Shortest communication step \[s\]; it is accepted whatever its error.
    pub min_step: f64,
    /// Longest communication step \[s\]; the clock's step if that is shorter.
    pub max_step: f64,
}

impl Control {
    /// Steps between a billionth of the clock's step and that step itself.
    pub fn new(tolerance: f64, clock: &super::Clock) -> Self {
        Self {
            tolerance,
            min_step: 1e-9 * clock.step(),
            max_step: clock.step(),
        }
    }
    /// Whether some step and some error are within the bounds.
    pub(super) fn is_possible(&self) -> bool {
        self.tolerance > 0.0 && self.min_step > 0.0 && self.min_step <= self.max_step
    }
}
