//! Values and derivatives of the model at one point, in scaled variables.
//!
//! First derivatives come from dual numbers with several parts, second derivatives from hyper-dual
//! numbers for the variables that enter nonlinearly. Which derivatives are ever other than zero, and
//! which second derivatives are constant, is found once by evaluating the model at random points.

use nalgebra::{RowSVector, SMatrix, SVector};
use num_dual::{Derivative, DualSVec64, HyperDualSVec64};
use pilotage_models::{Dynamics, Scalar};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Largest number of states or parameters; a point's numbers stay on the stack.
pub const MAX_SIZE: usize = 16;
/// Derivative parts of a dual number.
const LANES: usize = 4;
/// Derivative parts of a hyper-dual number, each way.
const BLOCK: usize = 3;
/// Random points at which the patterns are found.
const PROBES: usize = 8;

type Dual = DualSVec64<LANES>;
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
    /// First entry of each column of `entries`, and their number.
    column_starts: Vec<usize>,
    /// First derivatives that are affine in the variables.
    affine: Affine,
    /// Second derivatives that never change: pair, row of `[f̄; measured; bounded]`, value.
    constant: Vec<(usize, usize, f64)>,
    /// Variables of the other pairs, in blocks.
    curved: Vec<usize>,
    /// For each pair of blocks of `curved`: `(row, column, pair)` of what it gives.
    curved_blocks: Vec<CurvedBlock>,
}

/// First derivatives as constants plus terms `factor · variable`: exact for variables whose second
/// derivatives are all constant, as those of a linear pilot are.
#[derive(Debug, Clone, Default)]
struct Affine {
    /// The constants of the Jacobian's entries.
    jacobian: Vec<f64>,
    /// Entry, variable, factor.
    jacobian_terms: Vec<(usize, usize, f64)>,
    /// Of the gradients of the measured output and of the bounded signal.
    gradients: [Vec<f64>; 2],
    gradient_terms: [Vec<(usize, usize, f64)>; 2],
    /// Variables whose columns are not of this kind: they take dual numbers.
    others: Vec<usize>,
}

#[derive(Debug, Clone)]
struct CurvedBlock {
    rows: usize,
    columns: usize,
    pairs: Vec<(usize, usize, usize)>,
}

/// Where [`NodeModel::first_order`] writes.
#[derive(Debug)]
pub struct FirstOrder<'a> {
    /// Values of `∂f̄/∂[x̄; θ̄]` at [`NodeModel::entries`]; empty when they are not wanted.
    pub jacobian: &'a mut [f64],
    /// Gradients of the measured output and of the bounded signal over `[x̄; θ̄]`, when wanted.
    pub outputs: Option<(&'a mut [f64], &'a mut [f64])>,
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
struct Numbers<T> {
    x: [T; MAX_SIZE],
    theta: [T; MAX_SIZE],
    dx: [T; MAX_SIZE],
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
        let v = n + p;
        let mut model = Self {
            dynamics,
            scales,
            pairs: (0..v).flat_map(|i| (i..v).map(move |j| (i, j))).collect(),
            entries: (0..v).flat_map(|j| (0..n).map(move |i| (i, j))).collect(),
            state_entries: n * n,
            column_starts: (0..=v).map(|j| j * n).collect(),
            affine: Affine {
                jacobian: vec![0.0; n * v],
                gradients: [vec![0.0; v], vec![0.0; v]],
                others: (0..v).collect(),
                ..Affine::default()
            },
            constant: Vec::new(),
            curved: (0..v).collect(),
            curved_blocks: Vec::new(),
        };
        model.curved_blocks = model.blocks(&vec![true; model.pairs.len()]);
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

    /// Writes `f̄` into `f` and returns the measured output and the bounded signal.
    pub fn values(&self, x: &[f64], input: &[f64], theta: &[f64], f: &mut [f64]) -> (f64, f64) {
        let mut at = self.unscaled(x, theta, |v| v);
        self.evaluate(&mut at, input);
        for ((f, dx), s) in f.iter_mut().zip(&at.dx).zip(&self.scales.states) {
            *f = dx / s;
        }
        self.outputs(&at, input)
    }

    /// Writes first derivatives; returns the measured output and the bounded signal, zero when they are
    /// not wanted.
    pub fn first_order(
        &self,
        x: &[f64],
        input: &[f64],
        theta: &[f64],
        mut out: FirstOrder<'_>,
    ) -> (f64, f64) {
        let n = x.len();
        let variable = |j: usize| if j < n { x[j] } else { theta[j - n] };
        let affine = &self.affine;
        if !out.jacobian.is_empty() {
            out.jacobian.copy_from_slice(&affine.jacobian);
            for &(entry, j, factor) in &affine.jacobian_terms {
                out.jacobian[entry] += factor * variable(j);
            }
        }
        let mut values = (0.0, 0.0);
        if let Some((measured, bounded)) = &mut out.outputs {
            values = self.outputs(&self.unscaled(x, theta, |v| v), input);
            for (which, gradient) in [measured, bounded].into_iter().enumerate() {
                gradient.copy_from_slice(&affine.gradients[which]);
                for &(i, j, factor) in &affine.gradient_terms[which] {
                    gradient[i] += factor * variable(j);
                }
            }
        }
        let wanted = (!out.jacobian.is_empty(), out.outputs.is_some());
        self.dual_columns(
            x,
            input,
            theta,
            (&affine.others, wanted),
            |j, lane, values| {
                if wanted.0 {
                    let own = self.column_starts[j]..self.column_starts[j + 1];
                    for (value, &(i, _)) in
                        out.jacobian[own.clone()].iter_mut().zip(&self.entries[own])
                    {
                        *value = first(&values.dx[i], lane) / self.scales.states[i];
                    }
                }
                if let Some((measured, bounded)) = &mut out.outputs {
                    measured[j] = first(&values.measured, lane);
                    bounded[j] = first(&values.bounded, lane);
                }
            },
        );
        values
    }

    /// Calls `visit(variable, lane, values)` for each of these variables, with the dual values in which its
    /// derivatives stand at `lane`; derivatives of `f` and of the outputs as `wanted`.
    fn dual_columns(
        &self,
        x: &[f64],
        input: &[f64],
        theta: &[f64],
        (columns, wanted): (&[usize], (bool, bool)),
        mut visit: impl FnMut(usize, usize, &Duals),
    ) {
        let n = x.len();
        let none = |re| Dual::new(re, Derivative::none());
        for lanes in columns.chunks(LANES) {
            let mut at = self.unscaled(x, theta, none);
            for (lane, &j) in lanes.iter().enumerate() {
                let mut part = SVector::<f64, LANES>::zeros();
                part[lane] = self.scale(j);
                at.variable(j, n).eps = Derivative::some(part);
            }
            if wanted.0 {
                self.evaluate(&mut at, input);
            }
            let (measured, bounded) = match wanted.1 {
                true => self.outputs(&at, input),
                false => (none(0.0), none(0.0)),
            };
            let values = Duals {
                dx: at.dx,
                measured,
                bounded,
            };
            for (lane, &j) in lanes.iter().enumerate() {
                visit(j, lane, &values);
            }
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
        out.fill(0.0);
        for &(pair, row, value) in &self.constant {
            out[pair] += value
                * match row.checked_sub(n) {
                    None => weights.f[row],
                    Some(0) => weights.measured,
                    Some(_) => weights.bounded,
                };
        }
        for block in &self.curved_blocks {
            self.curved_block(x, input, theta, block, |i, j, pair, row| {
                let terms = row.dx[..n].iter().zip(weights.f).zip(&self.scales.states);
                out[pair] = terms.fold(
                    second(&row.measured, i, j) * weights.measured
                        + second(&row.bounded, i, j) * weights.bounded,
                    |sum, ((f, w), s)| sum + second(f, i, j) * w / s,
                );
            });
        }
    }

    /// Calls `visit(i, j, pair, values)` for each pair of a block, with the hyper-dual values in which
    /// its second derivatives stand at `(i, j)`.
    fn curved_block(
        &self,
        x: &[f64],
        input: &[f64],
        theta: &[f64],
        block: &CurvedBlock,
        mut visit: impl FnMut(usize, usize, usize, &Hyper),
    ) {
        let n = x.len();
        let zero = |re| {
            HyperDual::new(
                re,
                Derivative::none(),
                Derivative::none(),
                Derivative::none(),
            )
        };
        let mut at = self.unscaled(x, theta, zero);
        let members = |b: usize| {
            let variables = self.curved[b * BLOCK..].iter().take(BLOCK);
            variables.copied().enumerate()
        };
        for (k, j) in members(block.rows) {
            let mut part = SVector::<f64, BLOCK>::zeros();
            part[k] = self.scale(j);
            at.variable(j, n).eps1 = Derivative::some(part);
        }
        for (k, j) in members(block.columns) {
            let mut part = RowSVector::<f64, BLOCK>::zeros();
            part[k] = self.scale(j);
            at.variable(j, n).eps2 = Derivative::some(part);
        }
        self.evaluate(&mut at, input);
        let (measured, bounded) = self.outputs(&at, input);
        let values = Hyper {
            dx: at.dx,
            measured,
            bounded,
        };
        for &(i, j, pair) in &block.pairs {
            visit(i, j, pair, &values);
        }
    }

    /// Keeps the entries and pairs that are not zero at one of several random points, and sets those
    /// second derivatives apart that are the same at all of them.
    fn find_patterns(&mut self) {
        let (n, p) = (self.n_states(), self.n_parameters());
        let mut random = ChaCha8Rng::seed_from_u64(0x70696c6f74);
        let mut draw = |count: usize| -> Vec<f64> {
            let uniform = |v: u32| f64::from(v) / f64::from(u32::MAX) * 2.0 - 1.0;
            (0..count).map(|_| uniform(random.next_u32())).collect()
        };
        let rows = n + 2;
        let mut entry_used = vec![false; self.entries.len()];
        let mut seen: Vec<Vec<f64>> = Vec::new();
        let mut probes: Vec<Probe> = Vec::new();
        for _ in 0..PROBES {
            let (x, input, theta) = (draw(n), draw(self.dynamics.n_inputs()), draw(p));
            let mut jacobian = vec![0.0; self.entries.len()];
            let out = FirstOrder {
                jacobian: &mut jacobian,
                outputs: None,
            };
            self.first_order(&x, &input, &theta, out);
            let used = entry_used.iter_mut().zip(&jacobian);
            used.for_each(|(used, v)| *used |= *v != 0.0);
            let mut tensor = vec![0.0; rows * self.pairs.len()];
            for block in &self.curved_blocks {
                self.curved_block(&x, &input, &theta, block, |i, j, pair, values| {
                    let out = &mut tensor[pair * rows..(pair + 1) * rows];
                    for (l, f) in values.dx[..n].iter().enumerate() {
                        out[l] = second(f, i, j) / self.scales.states[l];
                    }
                    out[n] = second(&values.measured, i, j);
                    out[n + 1] = second(&values.bounded, i, j);
                });
            }
            seen.push(tensor);
            probes.push(self.probe(x, &input, theta));
        }
        let mut used = entry_used.into_iter();
        self.entries.retain(|_| used.next() == Some(true));
        self.state_entries = self.entries.iter().filter(|(_, j)| *j < n).count();
        let start = |j: usize| self.entries.partition_point(|e| e.1 < j);
        self.column_starts = (0..=n + p).map(start).collect();
        self.keep_pairs(&seen, rows);
        let origin = self.probe(vec![0.0; n], &draw(self.dynamics.n_inputs()), vec![0.0; p]);
        self.find_affine(&origin, &probes);
    }

    /// All first derivatives at a point: rows of `[f̄; measured; bounded]`.
    fn probe(&self, x: Vec<f64>, input: &[f64], theta: Vec<f64>) -> Probe {
        let (n, v) = (x.len(), x.len() + theta.len());
        let mut rows = vec![vec![0.0; v]; n + 2];
        let all: Vec<usize> = (0..v).collect();
        self.dual_columns(
            &x,
            input,
            &theta,
            (&all, (true, true)),
            |j, lane, values| {
                for (i, row) in rows[..n].iter_mut().enumerate() {
                    row[j] = first(&values.dx[i], lane) / self.scales.states[i];
                }
                rows[n][j] = first(&values.measured, lane);
                rows[n + 1][j] = first(&values.bounded, lane);
            },
        );
        Probe {
            variables: [x, theta].concat(),
            rows,
        }
    }

    /// Sets the columns apart that are affine: their values at the origin and the constant second
    /// derivatives give them at every probe, whatever its input.
    fn find_affine(&mut self, origin: &Probe, probes: &[Probe]) {
        let (n, v) = (self.n_states(), origin.variables.len());
        // Row, column, variable, factor.
        let mut terms: Vec<(usize, usize, usize, f64)> = Vec::new();
        for &(pair, row, value) in &self.constant {
            let (a, b) = self.pairs[pair];
            terms.push((row, a, b, value));
            if a != b {
                terms.push((row, b, a, value));
            }
        }
        let predicted = |probe: &Probe, row: usize, column: usize| {
            let own = terms.iter().filter(|t| (t.0, t.1) == (row, column));
            own.fold(origin.rows[row][column], |sum, t| {
                sum + t.3 * probe.variables[t.2]
            })
        };
        let is_affine = |column: &usize| {
            let near = |probe: &Probe, row: usize| {
                let (exact, found) = (probe.rows[row][*column], predicted(probe, row, *column));
                (exact - found).abs() <= 1e-12 * (exact.abs() + origin.rows[row][*column].abs())
            };
            !self.curved.contains(column) && probes.iter().all(|p| (0..n + 2).all(|i| near(p, i)))
        };
        let (columns, others): (Vec<usize>, Vec<usize>) = (0..v).partition(is_affine);
        let kept = |column: &usize| columns.contains(column);
        let mut affine = Affine {
            jacobian: self
                .entries
                .iter()
                .map(|&(i, j)| origin.rows[i][j])
                .collect(),
            gradients: [origin.rows[n].clone(), origin.rows[n + 1].clone()],
            others,
            ..Affine::default()
        };
        for &(row, column, variable, factor) in terms.iter().filter(|t| kept(&t.1)) {
            match row.checked_sub(n) {
                None => {
                    let entry = self.entries.iter().position(|e| *e == (row, column));
                    affine
                        .jacobian_terms
                        .extend(entry.map(|entry| (entry, variable, factor)));
                }
                Some(which) => affine.gradient_terms[which].push((column, variable, factor)),
            }
        }
        self.affine = affine;
    }

    /// Keeps the pairs whose tensors `seen` at the probes (pairs × rows each) are not all zero.
    fn keep_pairs(&mut self, seen: &[Vec<f64>], rows: usize) {
        let slice = |probe: &'_ [f64], pair: usize| probe[pair * rows..(pair + 1) * rows].to_vec();
        let (mut pairs, mut varying) = (Vec::new(), Vec::new());
        for (k, pair) in self.pairs.iter().enumerate() {
            let first = slice(&seen[0], k);
            let same = |probe: &Vec<f64>| {
                let values = slice(probe, k);
                let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-13 * a.abs().max(b.abs());
                values.iter().zip(&first).all(near)
            };
            let zero = |probe: &Vec<f64>| slice(probe, k).iter().all(|v| *v == 0.0);
            if seen.iter().all(zero) {
                continue;
            }
            let constant = seen.iter().all(same);
            if constant {
                let values = first.iter().enumerate().filter(|(_, v)| **v != 0.0);
                let at = pairs.len();
                self.constant.extend(values.map(|(row, v)| (at, row, *v)));
            }
            varying.push(!constant);
            pairs.push(*pair);
        }
        self.pairs = pairs;
        let of_varying = self.pairs.iter().zip(&varying).filter(|(_, v)| **v);
        self.curved = of_varying.flat_map(|(&(i, j), _)| [i, j]).collect();
        self.curved.sort_unstable();
        self.curved.dedup();
        self.curved_blocks = self.blocks(&varying);
    }

    /// The pairs of blocks of `curved` that contain wanted pairs.
    fn blocks(&self, wanted: &[bool]) -> Vec<CurvedBlock> {
        let place = |j: usize| self.curved.iter().position(|c| *c == j);
        let mut blocks: Vec<CurvedBlock> = Vec::new();
        for (pair, &(a, b)) in self.pairs.iter().enumerate().filter(|(k, _)| wanted[*k]) {
            let (Some(a), Some(b)) = (place(a), place(b)) else {
                continue;
            };
            let (rows, columns) = (a / BLOCK, b / BLOCK);
            let entry = (a % BLOCK, b % BLOCK, pair);
            match blocks
                .iter_mut()
                .find(|k| (k.rows, k.columns) == (rows, columns))
            {
                Some(block) => block.pairs.push(entry),
                None => blocks.push(CurvedBlock {
                    rows,
                    columns,
                    pairs: vec![entry],
                }),
            }
        }
        blocks
    }

    fn scale(&self, variable: usize) -> f64 {
        match variable.checked_sub(self.n_states()) {
            None => self.scales.states[variable],
            Some(parameter) => self.scales.parameters[parameter],
        }
    }

    fn unscaled<T: Scalar>(&self, x: &[f64], theta: &[f64], lift: impl Fn(f64) -> T) -> Numbers<T> {
        let zero = lift(0.0);
        let mut out = Numbers {
            x: [zero; MAX_SIZE],
            theta: [zero; MAX_SIZE],
            dx: [zero; MAX_SIZE],
        };
        for ((out, value), scale) in out.x.iter_mut().zip(x).zip(&self.scales.states) {
            *out = lift(value * scale);
        }
        for ((out, value), scale) in out.theta.iter_mut().zip(theta).zip(&self.scales.parameters) {
            *out = lift(value * scale);
        }
        out
    }

    fn evaluate<T: Scalar>(&self, at: &mut Numbers<T>, input: &[f64]) {
        let (n, p) = (self.n_states(), self.n_parameters());
        self.dynamics
            .derivative(&at.x[..n], input, &at.theta[..p], &mut at.dx[..n]);
    }

    /// Measured output and bounded signal.
    fn outputs<T: Scalar>(&self, at: &Numbers<T>, input: &[f64]) -> (T, T) {
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

/// First derivatives at a point, for the patterns.
struct Probe {
    /// `[x̄; θ̄]`.
    variables: Vec<f64>,
    /// Rows of `[f̄; measured; bounded]`.
    rows: Vec<Vec<f64>>,
}

/// Dual values of a model.
struct Duals {
    dx: [Dual; MAX_SIZE],
    measured: Dual,
    bounded: Dual,
}

fn first(value: &Dual, lane: usize) -> f64 {
    value.eps.0.map_or(0.0, |part| part[lane])
}

/// Hyper-dual values of a model.
struct Hyper {
    dx: [HyperDual; MAX_SIZE],
    measured: HyperDual,
    bounded: HyperDual,
}

fn second(value: &HyperDual, i: usize, j: usize) -> f64 {
    let part: Option<SMatrix<f64, BLOCK, BLOCK>> = value.eps1eps2.0;
    part.map_or(0.0, |part| part[(i, j)])
}
