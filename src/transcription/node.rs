//! Values and derivatives of the model at one node, in scaled variables.
//!
//! First derivatives come from one dual number per variable, second derivatives from one hyper-dual
//! number per pair of variables that the model couples nonlinearly. Which pairs those are is found
//! once by evaluating the model at random points: few for a vehicle and a linear pilot.

use num_dual::{Dual64, HyperDual64};
use pilotage_models::{Dynamics, Scalar};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Largest number of states or parameters; a node's numbers stay on the stack.
pub const MAX_SIZE: usize = 16;

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
}

/// First derivatives at a node. `v` counts the variables `[x̄; θ̄]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FirstOrder {
    /// `f̄`, n.
    pub f: Vec<f64>,
    /// Values of `∂f̄/∂[x̄; θ̄]` at [`NodeModel::entries`].
    pub jacobian: Vec<f64>,
    /// Measured output.
    pub measured: f64,
    /// Its gradient, v.
    pub measured_gradient: Vec<f64>,
    /// Bounded signal.
    pub bounded: f64,
    /// Its gradient, v.
    pub bounded_gradient: Vec<f64>,
}

/// Weights of a node's contribution `Σ_i f_i f̄_i + m·measured + b·bounded` to the Lagrangian.
#[derive(Debug, Clone, Copy)]
pub struct Weights<'a> {
    /// Of `f̄`.
    pub f: &'a [f64],
    /// Of the measured output.
    pub measured: f64,
    /// Of the bounded signal.
    pub bounded: f64,
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
        let all_pairs = (0..n + p)
            .flat_map(|i| (i..n + p).map(move |j| (i, j)))
            .collect();
        let all_entries = (0..n + p)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .collect();
        let mut model = Self {
            dynamics,
            scales,
            pairs: all_pairs,
            entries: all_entries,
        };
        model.find_patterns();
        model
    }

    /// Keeps the pairs and entries that are not zero at one of several random points.
    fn find_patterns(&mut self) {
        let (n, p, w) = (
            self.dynamics.n_states(),
            self.dynamics.n_parameters(),
            self.dynamics.n_inputs(),
        );
        let mut random = ChaCha8Rng::seed_from_u64(0x70696c6f74);
        let mut draw = |count: usize| -> Vec<f64> {
            (0..count)
                .map(|_| random.next_u32() as f64 / u32::MAX as f64 * 2.0 - 1.0)
                .collect()
        };
        let mut pair_used = vec![false; self.pairs.len()];
        let mut entry_used = vec![false; self.entries.len()];
        let mut second = vec![0.0; self.pairs.len()];
        let mut first = FirstOrder::default();
        for _ in 0..8 {
            let (x, input, theta, weight) = (draw(n), draw(w), draw(p), draw(n));
            let weights = Weights {
                f: &weight,
                measured: 0.7,
                bounded: -0.3,
            };
            self.second_order(&x, &input, &theta, weights, &mut second);
            self.first_order(&x, &input, &theta, &mut first);
            pair_used
                .iter_mut()
                .zip(&second)
                .for_each(|(used, v)| *used |= *v != 0.0);
            entry_used
                .iter_mut()
                .zip(&first.jacobian)
                .for_each(|(used, v)| *used |= *v != 0.0);
        }
        let mut used = pair_used.iter();
        self.pairs.retain(|_| *used.next().unwrap_or(&true));
        let mut used = entry_used.iter();
        self.entries.retain(|_| *used.next().unwrap_or(&true));
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.scales.states.len()
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.scales.parameters.len()
    }

    /// Writes `f̄` into `f` and returns the measured output and the bounded signal.
    pub fn values(&self, x: &[f64], input: &[f64], theta: &[f64], f: &mut [f64]) -> (f64, f64) {
        let (mut xs, mut ts) = ([0.0; MAX_SIZE], [0.0; MAX_SIZE]);
        self.unscale(x, theta, &mut xs, &mut ts, |v| v);
        let (xs, ts) = (&xs[..x.len()], &ts[..theta.len()]);
        self.dynamics.derivative(xs, input, ts, f);
        f.iter_mut()
            .zip(&self.scales.states)
            .for_each(|(f, s)| *f /= s);
        (
            self.dynamics.measured(xs, input, ts),
            self.dynamics.bounded(xs, input, ts),
        )
    }

    /// Values and first derivatives.
    pub fn first_order(&self, x: &[f64], input: &[f64], theta: &[f64], out: &mut FirstOrder) {
        let (n, v) = (x.len(), x.len() + theta.len());
        out.f.resize(n, 0.0);
        out.measured_gradient.resize(v, 0.0);
        out.bounded_gradient.resize(v, 0.0);
        out.jacobian.resize(self.entries.len(), 0.0);
        let zero = Dual64::from(0.0);
        let (mut xs, mut ts, mut dx) = ([zero; MAX_SIZE], [zero; MAX_SIZE], [zero; MAX_SIZE]);
        self.unscale(x, theta, &mut xs, &mut ts, Dual64::from);
        let mut entries = out.jacobian.iter_mut().zip(&self.entries).peekable();
        for j in 0..v {
            self.seed(j, n, &mut xs, &mut ts, |value, scale| value.eps = scale);
            let (xs_n, ts_p) = (&xs[..n], &ts[..v - n]);
            self.dynamics.derivative(xs_n, input, ts_p, &mut dx[..n]);
            let measured = self.dynamics.measured(xs_n, input, ts_p);
            let bounded = self.dynamics.bounded(xs_n, input, ts_p);
            while let Some((value, &(i, _))) = entries.next_if(|(_, (_, column))| *column == j) {
                *value = dx[i].eps / self.scales.states[i];
            }
            (out.measured, out.measured_gradient[j]) = (measured.re, measured.eps);
            (out.bounded, out.bounded_gradient[j]) = (bounded.re, bounded.eps);
            self.seed(j, n, &mut xs, &mut ts, |value, _| value.eps = 0.0);
        }
        for (f, (dx, scale)) in out.f.iter_mut().zip(dx.iter().zip(&self.scales.states)) {
            *f = dx.re / scale;
        }
    }

    /// Writes the second derivatives of the weighted sum at [`pairs`](Self::pairs) into `out`.
    pub fn second_order(
        &self,
        x: &[f64],
        input: &[f64],
        theta: &[f64],
        weights: Weights<'_>,
        out: &mut [f64],
    ) {
        let n = x.len();
        let zero = HyperDual64::from(0.0);
        let (mut xs, mut ts, mut dx) = ([zero; MAX_SIZE], [zero; MAX_SIZE], [zero; MAX_SIZE]);
        self.unscale(x, theta, &mut xs, &mut ts, HyperDual64::from);
        for (value, &(i, j)) in out.iter_mut().zip(&self.pairs) {
            self.seed(i, n, &mut xs, &mut ts, |value, scale| value.eps1 = scale);
            self.seed(j, n, &mut xs, &mut ts, |value, scale| value.eps2 = scale);
            let (xs_n, ts_p) = (&xs[..n], &ts[..theta.len()]);
            self.dynamics.derivative(xs_n, input, ts_p, &mut dx[..n]);
            let outputs = self.dynamics.measured(xs_n, input, ts_p).eps1eps2 * weights.measured
                + self.dynamics.bounded(xs_n, input, ts_p).eps1eps2 * weights.bounded;
            let terms = dx[..n].iter().zip(weights.f).zip(&self.scales.states);
            *value = terms.fold(outputs, |sum, ((f, w), s)| sum + f.eps1eps2 * w / s);
            self.seed(i, n, &mut xs, &mut ts, |value, _| value.eps1 = 0.0);
            self.seed(j, n, &mut xs, &mut ts, |value, _| value.eps2 = 0.0);
        }
    }

    fn unscale<T: Scalar>(
        &self,
        x: &[f64],
        theta: &[f64],
        xs: &mut [T],
        ts: &mut [T],
        lift: impl Fn(f64) -> T,
    ) {
        for ((out, value), scale) in xs.iter_mut().zip(x).zip(&self.scales.states) {
            *out = lift(value * scale);
        }
        for ((out, value), scale) in ts.iter_mut().zip(theta).zip(&self.scales.parameters) {
            *out = lift(value * scale);
        }
    }

    /// Applies `set` with its scale to variable `j` of `[x; θ]`.
    fn seed<T>(&self, j: usize, n: usize, xs: &mut [T], ts: &mut [T], set: impl Fn(&mut T, f64)) {
        match j < n {
            true => set(&mut xs[j], self.scales.states[j]),
            false => set(&mut ts[j - n], self.scales.parameters[j - n]),
        }
    }
}
