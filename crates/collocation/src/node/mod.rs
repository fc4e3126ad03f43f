//! Values and derivatives of the model at one point, in scaled variables.
//!
//! Derivatives come from `Jet`s: first ones by several variables at a time, second ones by those that
//! enter nonlinearly, at a group of points at once. Which derivatives are ever other than zero, and which
//! never change from point to point, is found once by evaluating the model at random points (`patterns`).

mod derivatives;
mod jet;
mod patterns;

pub use derivatives::Derivatives;

use super::lanes::{LANES, Lanes, scaled, side_by_side};
use jet::Jet;
use pilotage_models::{Dynamics, Scalar};

/// Largest number of states or parameters; a point's numbers stay on the stack.
pub const MAX_SIZE: usize = 16;
/// Variables by which first derivatives are taken at a time.
const PARTS: usize = 4;
/// Variables by which second derivatives are taken at a time.
const CURVED: usize = 3;

type Plain = Jet<0, 0>;
type Linear = Jet<PARTS, 0>;
type Quadratic = Jet<CURVED, 6>;

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
    /// The other pairs, by groups of variables that contain them.
    curved: Vec<Curved>,
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

/// Second derivatives by a few variables.
#[derive(Debug, Clone, Default)]
struct Curved {
    /// [`CURVED`] of them at most.
    variables: Vec<usize>,
    pairs: Vec<CurvedPair>,
}

#[derive(Debug, Clone)]
struct CurvedPair {
    /// Place among the second derivatives of [`Quadratic`].
    place: usize,
    /// Place in [`NodeModel::pairs`].
    pair: usize,
    /// Rows of `[f̄; measured; bounded]` whose derivatives are not always zero.
    rows: Vec<usize>,
}

/// Weights of each point's contribution `Σ_i f_i f̄_i + m·measured + b·bounded` to the Lagrangian.
#[derive(Debug, Clone, Copy)]
pub struct Weights<'a> {
    /// Of `f̄`.
    pub f: &'a [Lanes],
    /// Of the measured output.
    pub measured: Lanes,
    /// Of the bounded signal.
    pub bounded: Lanes,
}

/// A model's states, inputs, parameters and derivatives in some number type.
#[derive(Debug, Clone)]
struct Numbers<T> {
    x: [T; MAX_SIZE],
    w: Vec<T>,
    theta: [T; MAX_SIZE],
    dx: [T; MAX_SIZE],
}

/// The model's values at one θ.
#[derive(Debug)]
pub struct Values<'m, D> {
    model: &'m NodeModel<D>,
    at: Numbers<Plain>,
}

impl<D: Dynamics> Values<'_, D> {
    /// Writes `f̄` at a group of points with these scaled states and these inputs to `f`, and returns the
    /// measured outputs and the bounded signals.
    #[inline(always)]
    pub fn evaluate(
        &mut self,
        x: [&[f64]; LANES],
        input: [&[f64]; LANES],
        f: &mut [Lanes],
    ) -> (Lanes, Lanes) {
        let model = self.model;
        let mut states = [[0.0; LANES]; MAX_SIZE];
        side_by_side(x, &mut states[..model.n_states()]);
        self.set(&states, input);
        model.evaluate(&mut self.at);
        for ((f, dx), inverse) in f.iter_mut().zip(&self.at.dx).zip(&model.inverse) {
            *f = scaled(*inverse, dx.value);
        }
        self.outputs()
    }

    /// The points at which the model is evaluated: scaled states, and inputs.
    #[inline(always)]
    fn set(&mut self, x: &[Lanes; MAX_SIZE], input: [&[f64]; LANES]) {
        let states = x.iter().zip(&self.model.scales.states);
        for (out, (x, scale)) in self.at.x.iter_mut().zip(states) {
            out.value = scaled(*scale, *x);
        }
        for (i, w) in self.at.w.iter_mut().enumerate() {
            w.value = input.map(|own| own[i]);
        }
    }

    #[inline(always)]
    fn outputs(&self) -> (Lanes, Lanes) {
        let (measured, bounded) = self.model.outputs_of(&self.at);
        (measured.value, bounded.value)
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
            at: self.numbers(theta),
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
    fn numbers<T: Scalar>(&self, theta: &[f64]) -> Numbers<T> {
        let zero = T::from(0.0);
        let mut out = Numbers {
            x: [zero; MAX_SIZE],
            w: vec![zero; self.dynamics.n_inputs()],
            theta: [zero; MAX_SIZE],
            dx: [zero; MAX_SIZE],
        };
        for ((out, value), scale) in out.theta.iter_mut().zip(theta).zip(&self.scales.parameters) {
            *out = T::from(value * scale);
        }
        out
    }

    /// Numbers with derivatives by these variables.
    fn jets<const N: usize, const M: usize>(
        &self,
        theta: &[f64],
        variables: &[usize],
    ) -> Numbers<Jet<N, M>> {
        let mut at: Numbers<Jet<N, M>> = self.numbers(theta);
        for (part, &j) in variables.iter().enumerate() {
            at.variable(j, self.n_states()).first[part] = [self.scale(j); LANES];
        }
        at
    }

    #[inline(always)]
    fn evaluate<T: Scalar>(&self, at: &mut Numbers<T>) {
        let (n, p) = (self.n_states(), self.n_parameters());
        self.dynamics
            .derivative(&at.x[..n], &at.w, &at.theta[..p], &mut at.dx[..n]);
    }

    /// Measured output and bounded signal.
    #[inline(always)]
    fn outputs_of<T: Scalar>(&self, at: &Numbers<T>) -> (T, T) {
        let (x, theta) = (&at.x[..self.n_states()], &at.theta[..self.n_parameters()]);
        (
            self.dynamics.measured(x, &at.w, theta),
            self.dynamics.bounded(x, &at.w, theta),
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
