//! Coupling algorithms: the order in which components are set, stepped and read, the extrapolation of values that are
//! not known yet, and the length of communication steps.

mod order;

pub(super) use order::Propagation;
pub use order::gauss_seidel_order;

/// How components exchange values (Kübler & Schiehlen, "Two methods of simulator coupling", Math. Comput. Model. Dyn.
/// Syst. 6(2), 2000).
///
/// With held inputs, the first two are of first order in the communication step `h`. With Jacobi every input lags by
/// `h/2` on average. With Gauss-Seidel and two components in a loop, the inputs of the first are `h/2` late and those
/// of the second `h/2` early, which cancels around the loop. The third solves for values that are consistent at the end
/// of the step, and has no lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// All components receive the others' outputs at `t_k`, then all step to `t_{k+1}`.
    #[default]
    Jacobi,
    /// One component after another receives the newest available outputs, steps and provides its outputs.
    GaussSeidel,
    /// Strong coupling, at least of second order: steps are repeated from saved states until the outputs at `t_{k+1}`
    /// agree with those from which the inputs were computed.
    ///
    /// Within the step an input follows the line from the feeding output's value at `t_k` to that at `t_{k+1}` or, if
    /// the component provides output derivatives, the cubic with these derivatives at both ends. If the derivative at
    /// `t_k` belongs to a transient that decays within the step, an exponential plus a line is used instead, so that
    /// fast poles (and jumps through them) do not distort the input. A component that accepts input derivatives
    /// receives the best linear approximation, any other the mean. If a component with direct feedthrough would thereby
    /// see a wrong value at the end, its outputs are taken from a step that ends with the correct input, and its state
    /// from another step; with directional derivatives, the derivatives of these outputs are those for the input's
    /// derivative at the end. The outputs at `t_{k+1}` are found by Newton's method, whose matrix comes from finite
    /// differences of repeated steps and is kept while it converges; this also solves algebraic loops between
    /// components. Components without rollback step first, with extrapolated inputs. Non-real values are held through a
    /// step at their values at its end if these settle; discrete reals are held at their values at its beginning.
    ///
    /// If the coupling error of a fixed step is as large as the signal, the step is halved until it is smaller; the run
    /// ends with an error if components cannot do that.
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

/// Coupling settings of a run. An [`Algorithm`] converts to settings with the defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coupling {
    /// The order in which components are set, stepped and read.
    pub algorithm: Algorithm,
    /// Degree, 0 to [`MAX_EXTRAPOLATION`], of the polynomial through the last communication points that replaces
    /// unknown outputs; with 0 the last value is held. The first step is held for any degree, which makes 1 and 2 both of
    /// second order. Default: 0, except for the first pass of strong coupling, where
    /// it affects only speed.
    pub extrapolation: Option<usize>,
    /// Chooses the communication steps by their error; `None` uses the clock's step.
    pub control: Option<Control>,
    /// Iteration of strong coupling.
    pub iteration: Iteration,
    /// Jacobi with held inputs and fixed steps: the components step concurrently, on as many threads as rayon would use
    /// (`RAYON_NUM_THREADS`); the threads busy-wait. The results are the same. `cargo bench --bench coupling` measures
    /// the cost of a step above which this pays off: 0.5 µs on two idle processors, 10 µs and more if other programs
    /// use them too.
    pub parallel: bool,
    /// Whether to time every call for the [report](super::Report), instead of only a sample of steps.
    pub measure: bool,
}

/// Maximum degree of extrapolation.
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

/// Stopping criteria of the iteration of strong coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Largest difference between an output and the value from which inputs were computed, relative to the largest
    /// magnitude so far (or the variable's nominal value, if larger). Where no nominal value is given and corrections do
    /// not make the difference smaller, it is relative to 1: rounding in values that are nearly 0.
    pub tolerance: f64,
    /// Maximum number of corrections in a step, at least 1.
    pub max: u32,
}

impl Iteration {
    /// Whether both are above 0.
    pub(super) fn is_possible(&self) -> bool {
        self.tolerance > 0.0 && self.tolerance.is_finite() && self.max > 0
    }
}

impl Default for Iteration {
    fn default() -> Self {
        Self {
            tolerance: 1e-9,
            max: 20,
        }
    }
}

/// Communication steps chosen by the coupling error.
///
/// The error of a step is the error of an input's mean over the step, relative to the largest magnitude of the feeding
/// output so far (or its nominal value, if larger): the system is solved exactly for inputs perturbed by at most this
/// much. Where an error does not get smaller in shorter steps, a very short one crosses the jump; what comes back in one
/// step of the clock counts as noise for some of these, if no nominal value is given, though not beyond what it is
/// relative to 1.
///
/// The reference for an input is an interpolating polynomial through communication points, of one degree more than the
/// one used (an embedded pair, as in Adams methods; Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations
/// I*, section III.1). Held inputs are piecewise constant; the effect is estimated by comparing one step with
/// two half steps. No communication point of the clock is skipped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Maximum error of a step.
    pub tolerance: f64,
    /// Shortest communication step \[s\]; it is accepted regardless of its error.
    pub min_step: f64,
    /// Longest communication step \[s\]; the clock's step if that is shorter.
    pub max_step: f64,
}

impl Control {
    /// Steps between 1e-9 times the clock's step and the clock's step.
    pub fn new(tolerance: f64, clock: &super::Clock) -> Self {
        Self {
            tolerance,
            min_step: 1e-9 * clock.step(),
            max_step: clock.step(),
        }
    }
    /// Whether the tolerance and the step bounds are valid.
    pub(super) fn is_possible(&self) -> bool {
        self.tolerance > 0.0
            && self.tolerance.is_finite()
            && self.min_step > 0.0
            && self.min_step <= self.max_step
    }
}
