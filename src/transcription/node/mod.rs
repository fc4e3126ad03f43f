//! Values and derivatives of the model at one point, in scaled variables.
//!
//! First derivatives come from dual numbers with several parts, second derivatives from hyper-dual
//! numbers for the variables that enter nonlinearly. Which derivatives are ever other than zero, and
//! which never change from point to point, is found once by evaluating the model at random points
//! (`patterns`).

mod derivatives;
mod patterns;

pub use derivatives::Derivatives;

use num_dual::{Derivative, DualSVec64, HyperDualSVec64};
use pilotage_models::{Dynamics, Scalar};

/// Largest number of states or parameters; a point's numbers stay on the stack.
pub const MAX_SIZE: usize = 16;
/// Derivative parts of a dual number.
const PARTS: usize = 4;
/// Derivative parts of a hyper-dual number, each way.
const BLOCK: usize = 3;

type Dual = DualSVec64<PARTS>;
type HyperDual = HyperDualSVec64<BLOCK, BLOCK>;

/// Typical magnitudes, by which variables are divided.
#[derive(Debug, Clone, PartialEq)]
pub struct Scales {
    /// Of the states, in their units.
    pub states: Vec<f64>,
    /// Of the parameters, in their units.
    pub parameters: Vec<f64>,
}

/// The model seen through scaled variables `x̄ = x / s_x`, `θ̄ = θ / s_θ`.
#[derive(Debug, Clone)]
pub struct NodeModel<D> {
    /// The model.
    pub dynamics: D,
    /// Scales of its variables.
    pub scales: Scales,
    /// Pairs `i ≤ j` of variables `[x̄; θ̄]` with a second derivative.
    pub pairs: Vec<(usize, usize)>,
    /// Entries `(row, column)` of `∂f̄/∂[x̄; θ̄]` that may be other than zero, column by column.
    pub entries: Vec<(usize, usize)>,
    /// Number of those entries that belong to states: the first ones.
    pub state_entries: usize,
    /// For each entry, whether it depends on θ alone: it has one value at all points.
    pub shared: Vec<bool>,
    /// Columns of `[x̄; θ̄]` where the gradients of the measured output and of the bounded signal may be
    /// other than zero.
    pub outputs: [Vec<usize>; 2],
    /// `1 / s_x`.
    inverse: Vec<f64>,
    /// First entry of each column of `entries`, and their number.
    column_starts: Vec<usize>,
    /// First derivatives that are affine in the variables.
    affine: Affine,
    /// Second derivatives that never change: pair, and rows of `[f̄; measured; bounded]` with values.
    constant: Vec<(usize, Vec<(usize, f64)>)>,
    /// Variables of the other pairs, in blocks.
    curved: Vec<usize>,
    /// What each pair of blocks of `curved` gives.
    curved_blocks: Vec<CurvedBlock>,
}

/// An output of the model: a place in [`NodeModel::outputs`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// The one that is compared with the recording.
    Measured,
    /// The one held within limits.
    Bounded,
}

/// First derivatives as constants plus terms `factor · variable`: exact for variables whose second
/// derivatives are all constant, as those of a linear pilot are.
#[derive(Debug, Clone, Default)]
struct Affine {
    /// Of the Jacobian's entries, and of the two outputs' gradients.
    values: [AffineValues; 3],
    /// Variables whose columns are not of this kind: they take dual numbers.
    others: Vec<usize>,
}

#[derive(Debug, Clone, Default)]
struct AffineValues {
    constants: Vec<f64>,
    /// Place, parameter, factor.
    parameters: Vec<(usize, usize, f64)>,
    /// Place, state, factor.
    states: Vec<(usize, usize, f64)>,
}

/// Second derivatives by the variables of one block and those of another.
#[derive(Debug, Clone)]
struct CurvedBlock {
    rows: usize,
    columns: usize,
    pairs: Vec<CurvedPair>,
}

#[derive(Debug, Clone)]
struct CurvedPair {
    /// Place in the block.
    i: usize,
    j: usize,
    /// Place in [`NodeModel::pairs`].
    pair: usize,
    /// Rows of `[f̄; measured; bounded]` whose derivatives are not always zero.
    rows: Vec<usize>,
}

/// Weights of a point's contribution `Σ_i f_i f̄_i + m·measured + b·bounded` to the Lagrangian.
#[derive(Debug, Clone, Copy)]
pub struct Weights<'a> {
    /// Of `f̄`.
    pub f: &'a [f64],
    /// Of the measured output.
    pub measured: f64,
    /// Of the bounded signal.
    pub bounded: f64,
}

/// A model's states, parameters and derivatives in some number type.
#[derive(Debug, Clone)]
struct Numbers<T> {
    x: [T; MAX_SIZE],
    theta: [T; MAX_SIZE],
    dx: [T; MAX_SIZE],
}

/// The model's values at one θ.
#[derive(Debug)]
pub struct Values<'m, D> {
    model: &'m NodeModel<D>,
    at: Numbers<f64>,
}

impl<D: Dynamics> Values<'_, D> {
    /// Appends `f̄` at a point to `f` and returns the measured output and the bounded signal.
    #[inline]
    pub fn evaluate(&mut self, x: &[f64], input: &[f64], f: &mut Vec<f64>) -> (f64, f64) {
        self.set(x);
        self.model.evaluate(&mut self.at, input);
        let scaled = self.at.dx.iter().zip(&self.model.inverse);
        f.extend(scaled.map(|(dx, inverse)| dx * inverse));
        self.model.outputs_of(&self.at, input)
    }

    fn set(&mut self, x: &[f64]) {
        let scaled = x.iter().zip(&self.model.scales.states);
        for (out, (x, scale)) in self.at.x.iter_mut().zip(scaled) {
            *out = x * scale;
        }
    }
}

impl<D: Dynamics> NodeModel<D> {
    /// The model with its scales; finds the derivatives' patterns.
    ///
    /// # Panics
    /// If the model has more than [`MAX_SIZE`] states or parameters.
    pub fn new(dynamics: D, scales: Scales) -> Self {
        let (n, p) = (dynamics.n_states(), dynamics.n_parameters());
        assert!(
            n <= MAX_SIZE && p <= MAX_SIZE,
            "{n} states and {p} parameters: at most {MAX_SIZE} of each"
        );
        let mut model = Self {
            dynamics,
            inverse: scales.states.iter().map(|s| 1.0 / s).collect(),
            scales,
            pairs: Vec::new(),
            entries: Vec::new(),
            state_entries: 0,
            shared: Vec::new(),
            outputs: [Vec::new(), Vec::new()],
            column_starts: Vec::new(),
            affine: Affine::default(),
            constant: Vec::new(),
            curved: Vec::new(),
            curved_blocks: Vec::new(),
        };
        model.find_patterns();
        model
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.scales.states.len()
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.scales.parameters.len()
    }

    /// The model's values at a scaled θ.
    pub fn values(&self, theta: &[f64]) -> Values<'_, D> {
        Values {
            model: self,
            at: self.numbers(theta, |v| v),
        }
    }

    /// Columns of an output's gradient.
    pub fn columns(&self, output: Output) -> &[usize] {
        &self.outputs[output as usize]
    }

    fn scale(&self, variable: usize) -> f64 {
        match variable.checked_sub(self.n_states()) {
            None => self.scales.states[variable],
            Some(parameter) => self.scales.parameters[parameter],
        }
    }

    /// Numbers with this θ, at the states' origin.
    fn numbers<T: Scalar>(&self, theta: &[f64], lift: impl Fn(f64) -> T) -> Numbers<T> {
        let zero = lift(0.0);
        let mut out = Numbers {
            x: [zero; MAX_SIZE],
            theta: [zero; MAX_SIZE],
            dx: [zero; MAX_SIZE],
        };
        for ((out, value), scale) in out.theta.iter_mut().zip(theta).zip(&self.scales.parameters) {
            *out = lift(value * scale);
        }
        out
    }

    /// Dual numbers whose parts belong to these variables.
    fn duals(&self, theta: &[f64], columns: &[usize]) -> Numbers<Dual> {
        let mut at = self.numbers(theta, |re| Dual::new(re, Derivative::none()));
        for (part, &j) in columns.iter().enumerate() {
            let mut eps = nalgebra::SVector::<f64, PARTS>::zeros();
            eps[part] = self.scale(j);
            at.variable(j, self.n_states()).eps = Derivative::some(eps);
        }
        at
    }

    /// Hyper-dual numbers whose parts belong to the variables of two blocks of `curved`.
    fn hyper_duals(&self, theta: &[f64], (rows, columns): (usize, usize)) -> Numbers<HyperDual> {
        let none = |re| {
            let (one, two) = (Derivative::none(), Derivative::none());
            HyperDual::new(re, one, two, Derivative::none())
        };
        let mut at = self.numbers(theta, none);
        for (part, &j) in self.block(rows).iter().enumerate() {
            let mut eps = nalgebra::SVector::<f64, BLOCK>::zeros();
            eps[part] = self.scale(j);
            at.variable(j, self.n_states()).eps1 = Derivative::some(eps);
        }
        for (part, &j) in self.block(columns).iter().enumerate() {
            let mut eps = nalgebra::RowSVector::<f64, BLOCK>::zeros();
            eps[part] = self.scale(j);
            at.variable(j, self.n_states()).eps2 = Derivative::some(eps);
        }
        at
    }

    /// The variables of a block of `curved`.
    fn block(&self, block: usize) -> &[usize] {
        let first = block * BLOCK;
        &self.curved[first..self.curved.len().min(first + BLOCK)]
    }

    #[inline]
    fn evaluate<T: Scalar>(&self, at: &mut Numbers<T>, input: &[f64]) {
        let (n, p) = (self.n_states(), self.n_parameters());
        self.dynamics
            .derivative(&at.x[..n], input, &at.theta[..p], &mut at.dx[..n]);
    }

    /// Measured output and bounded signal.
    #[inline]
    fn outputs_of<T: Scalar>(&self, at: &Numbers<T>, input: &[f64]) -> (T, T) {
        let (x, theta) = (&at.x[..self.n_states()], &at.theta[..self.n_parameters()]);
        (
            self.dynamics.measured(x, input, theta),
            self.dynamics.bounded(x, input, theta),
        )
    }
}

impl<T> Numbers<T> {
    /// Variable `j` of `[x; θ]`.
    fn variable(&mut self, j: usize, n: usize) -> &mut T {
        match j.checked_sub(n) {
            None => &mut self.x[j],
            Some(parameter) => &mut self.theta[parameter],
        }
    }
}
