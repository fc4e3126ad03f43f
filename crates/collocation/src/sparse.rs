//! The collocation problem with sparse derivatives, for the general QP solver ([`SparseQp`](pilotage_sqp::SparseQp)).
//! It follows directly from the definition of points and defects, with the tangent of each point over the unknowns on
//! which it depends as a dense matrix. It is independent of the sweeps of [`Condensed`](super::Condensed), so that each
//! checks the other.

use super::Collocation;
use super::grid::{Grid, PointState};
use super::mesh::Recording;
use super::simd::LANES;
use nalgebra::{DMatrix, DVector};
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{Hessian, SparseProblem};
use std::collections::BTreeMap;

/// Derivatives of the model at a point, or their patterns as zeros and ones.
struct PointDerivatives {
    /// `∂f̄/∂[x̄; θ̄]`, n × (n + p).
    f: DMatrix<f64>,
    /// Gradients of the outputs over `[x̄; θ̄]`.
    gradients: Vec<DVector<f64>>,
    /// The outputs.
    outputs: Vec<f64>,
}

/// A matrix with blocks of `n` columns for some unknowns of a run, and `p` columns for θ. Its rows are derivatives with
/// respect to `[V; θ]`.
#[derive(Clone)]
struct Tangent {
    nodes: BTreeMap<usize, DMatrix<f64>>,
    theta: DMatrix<f64>,
}

impl Tangent {
    fn zeros(rows: usize, p: usize) -> Self {
        Self {
            nodes: BTreeMap::new(),
            theta: DMatrix::zeros(rows, p),
        }
    }

    fn add(&mut self, factor: f64, other: &Self) {
        for (node, block) in &other.nodes {
            let own = self.nodes.entry(*node);
            *own.or_insert_with(|| DMatrix::zeros(block.nrows(), block.ncols())) += block * factor;
        }
        self.theta += &other.theta * factor;
    }

    /// Adds `factor · I` at an unknown.
    fn add_identity(&mut self, node: usize, factor: f64) {
        let n = self.theta.nrows();
        let own = self.nodes.entry(node);
        *own.or_insert_with(|| DMatrix::zeros(n, n)) += DMatrix::identity(n, n) * factor;
    }

    /// `rows [T; 0 I]`: derivatives with respect to `[V; θ]` from those with respect to `[x̄; θ̄]` at a point.
    fn chain(&self, rows: &DMatrix<f64>) -> Self {
        let n = self.theta.nrows();
        let (x, theta) = (rows.columns(0, n), rows.columns(n, rows.ncols() - n));
        Self {
            nodes: self
                .nodes
                .iter()
                .map(|(k, block)| (*k, x * block))
                .collect(),
            theta: x * &self.theta + theta,
        }
    }

    /// All entries `(row, column in z, value)`, including zeros, node by node.
    fn entries<'a>(
        &'a self,
        z: usize,
        theta: usize,
    ) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
        let block = |first: usize, block: &'a DMatrix<f64>| {
            let (rows, columns) = block.shape();
            let places = (0..rows).flat_map(move |i| (0..columns).map(move |j| (i, j)));
            places.map(move |(i, j)| (i, first + j, block[(i, j)]))
        };
        let nodes = self.nodes.iter();
        let nodes = nodes.flat_map(move |(k, own)| block(z + k * own.ncols(), own));
        nodes.chain(block(theta, &self.theta))
    }
}

/// Derivatives of a run: the tangent of each point, and its model derivatives.
struct RunDerivatives {
    tangents: Vec<Tangent>,
    points: Vec<PointDerivatives>,
    /// True if these are patterns.
    pattern: bool,
}

impl Collocation {
    /// Derivatives at all points of a run; for `None` their patterns, with absolute values of the weights so that
    /// nothing cancels.
    fn run_derivatives(&self, z: Option<&[f64]>, j: usize) -> RunDerivatives {
        let (n, p, grid) = (self.n_states(), self.n_parameters(), &self.grids[j]);
        let values = z.map(|z| self.evaluate_points(z, j, |_, _| {}));
        let weight = |v: f64| if z.is_some() { v } else { v.abs() };
        let mut tangents: Vec<Tangent> = Vec::new();
        let mut points: Vec<PointDerivatives> = Vec::new();
        for (i, point) in grid.points.iter().enumerate() {
            let mut tangent = Tangent::zeros(n, p);
            match &point.state {
                PointState::Node(k) => tangent.add_identity(*k, 1.0),
                PointState::Combination(c) => {
                    c.p.iter()
                        .for_each(|&(k, p)| tangent.add_identity(k, weight(p)));
                    for &(l, q) in &c.q {
                        tangent.add(weight(q), &tangents[l].chain(&points[l].f));
                    }
                }
            }
            points.push(match (z, &values) {
                (Some(z), Some(values)) => {
                    let v = self.coefficients(z, j);
                    self.point_derivatives(values.states(grid, v, i, n), j, i, self.theta(z))
                }
                _ => self.pattern_of_point(),
            });
            tangents.push(tangent);
        }
        RunDerivatives {
            tangents,
            points,
            pattern: z.is_none(),
        }
    }

    fn point_derivatives(&self, x: &[f64], j: usize, i: usize, theta: &[f64]) -> PointDerivatives {
        let v = self.n_states() + self.n_parameters();
        let mut jacobian = vec![[0.0; LANES]; self.model.entries.len()];
        let mut derivatives = self.model.derivatives(theta);
        let mut outputs = vec![[0.0; LANES]; self.model.n_outputs()];
        // A group that repeats this point.
        derivatives.evaluate([x; LANES], [self.inputs_at(j, i); LANES], &mut outputs);
        derivatives.jacobian(&mut jacobian);
        let gradient = |output: usize| {
            let columns = self.model.columns(output);
            let mut values = vec![[0.0; LANES]; columns.len()];
            derivatives.gradient(output, &mut values);
            let mut out = DVector::zeros(v);
            let own = columns.iter().zip(values);
            own.for_each(|(c, value)| out[*c] = value[0]);
            out
        };
        let mut f = DMatrix::zeros(self.n_states(), v);
        let entries = self.model.entries.iter().zip(&jacobian);
        entries.for_each(|(at, value)| f[*at] = value[0]);
        PointDerivatives {
            f,
            gradients: (0..outputs.len()).map(gradient).collect(),
            outputs: outputs.iter().map(|output| output[0]).collect(),
        }
    }

    fn pattern_of_point(&self) -> PointDerivatives {
        let v = self.n_states() + self.n_parameters();
        let mut f = DMatrix::zeros(self.n_states(), v);
        self.model.entries.iter().for_each(|at| f[*at] = 1.0);
        PointDerivatives {
            f,
            gradients: vec![DVector::from_element(v, 1.0); self.model.n_outputs()],
            outputs: vec![0.0; self.model.n_outputs()],
        }
    }

    /// Derivatives of the defects of run `j`: `(first row, derivatives)` of each block of `n`.
    fn defect_tangents(&self, j: usize, at: &RunDerivatives) -> Vec<(usize, Tangent)> {
        let (n, p, grid) = (self.n_states(), self.n_parameters(), &self.grids[j]);
        let place = self.layout.runs[j];
        let weight = |v: f64| if at.pattern { v.abs() } else { v };
        let mut out = Vec::new();
        for element in &grid.elements {
            let points = grid.points_of(element);
            for (r, defect) in element.tableau.defects.iter().enumerate() {
                let mut rows = Tangent::zeros(n, p);
                let unknowns = defect.e.iter();
                unknowns.for_each(|&(k, e)| rows.add_identity(element.first + k, weight(e)));
                for &(i, a) in &defect.a {
                    let i = points[i] as usize;
                    rows.add(
                        weight(-element.h * a),
                        &at.tangents[i].chain(&at.points[i].f),
                    );
                }
                out.push((place.c + place.known + (element.first + r) * n, rows));
            }
        }
        out
    }

    /// Calls `visit(run, point, sample)` for every sample.
    fn each_sample(&self, mut visit: impl FnMut(usize, usize, u32)) {
        for (j, grid) in self.grids.iter().enumerate() {
            for (sample, point) in grid.observed.iter().enumerate() {
                visit(j, *point, sample as u32);
            }
        }
    }

    /// First and second derivatives of the objective with respect to the measured outputs at a sample, zero if none is
    /// recorded. The second ones are exact or those of Gauss–Newton.
    fn loss_derivatives(
        &self,
        (j, sample): (usize, u32),
        outputs: &[f64],
        kind: Hessian,
    ) -> Vec<(f64, f64)> {
        let of = |(k, own): (usize, &Recording)| {
            let Some(recorded) = self.recorded(j, k, sample) else {
                return (0.0, 0.0);
            };
            let (r, twice) = (recorded - outputs[k], 2.0 * own.weight);
            let half = own.loss.halved(r);
            let beyond = match kind {
                Hessian::Exact => half.curvature,
                Hessian::GaussNewton => 0.0,
            };
            let slope = half.slope - half.weight * r;
            (twice * slope, twice * (half.weight + beyond))
        };
        self.runs[j].measured.iter().enumerate().map(of).collect()
    }

    /// Only the first derivatives.
    fn pull(&self, j: usize, sample: u32, outputs: &[f64]) -> Vec<f64> {
        let both = self.loss_derivatives((j, sample), outputs, Hessian::GaussNewton);
        both.into_iter().map(|(first, _)| first).collect()
    }

    /// Weights of `f̄` at every point in the Lagrangian, as matrices of one column, given the weights of the outputs at
    /// the samples.
    fn derivative_weights(
        &self,
        j: usize,
        at: &RunDerivatives,
        lambda: &[f64],
        outputs: &dyn Fn(&Grid, usize) -> Vec<f64>,
    ) -> Vec<DVector<f64>> {
        let (n, grid) = (self.n_states(), &self.grids[j]);
        let place = self.layout.runs[j];
        let mut omega = vec![DVector::zeros(n); grid.points.len()];
        for element in &grid.elements {
            let points = grid.points_of(element);
            for (r, defect) in element.tableau.defects.iter().enumerate() {
                let row = place.c + place.known + (element.first + r) * n;
                let lambda = DVector::from_column_slice(&lambda[row..row + n]);
                for &(i, a) in &defect.a {
                    omega[points[i] as usize] -= &lambda * (element.h * a);
                }
            }
        }
        for (i, point) in grid.points.iter().enumerate().rev() {
            if let PointState::Combination(c) = &point.state {
                let own = &at.points[i];
                let mut by_state = own.f.columns(0, n).transpose() * &omega[i];
                for (gradient, weight) in own.gradients.iter().zip(outputs(grid, i)) {
                    by_state += gradient.rows(0, n) * weight;
                }
                c.q.iter().for_each(|&(l, q)| omega[l] += &by_state * q);
            }
        }
        omega
    }

    /// The local variables `[V; θ]` of a point, as columns of `z`, and the tangent of the point over them, with rows
    /// `[x̄; θ̄]`.
    fn local(&self, j: usize, tangent: &Tangent) -> (Vec<usize>, DMatrix<f64>) {
        let (n, p) = (self.n_states(), self.n_parameters());
        let z = self.layout.runs[j].z;
        let nodes = tangent.nodes.keys();
        let mut columns: Vec<usize> = nodes.flat_map(|k| z + k * n..z + (k + 1) * n).collect();
        let states = columns.len();
        columns.extend(self.layout.theta..self.layout.theta + p);
        let mut matrix = DMatrix::zeros(n + p, columns.len());
        for (block, own) in tangent.nodes.values().enumerate() {
            matrix.view_mut((0, block * n), (n, n)).copy_from(own);
        }
        matrix
            .view_mut((0, states), (n, p))
            .copy_from(&tangent.theta);
        matrix.view_mut((n, states), (p, p)).fill_with_identity();
        (columns, matrix)
    }

    /// Upper triangle of a point's contribution to the Hessian, `Tᵀ W T`: calls `visit(row, column, value)`.
    fn point_hessian(
        &self,
        j: usize,
        tangent: &Tangent,
        w: &DMatrix<f64>,
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let (columns, t) = self.local(j, tangent);
        let matrix = t.transpose() * w * &t;
        for (a, row) in columns.iter().enumerate() {
            for (b, column) in columns.iter().enumerate().skip(a) {
                visit(*row, *column, matrix[(a, b)]);
            }
        }
    }
}

/// Pairs `i ≤ j` of `0..v`: the upper triangle, row by row.
fn upper_triangle(v: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..v).flat_map(move |i| (i..v).map(move |j| (i, j)))
}

/// Drops the entries of `values` whose entry in `pattern` is zero.
fn kept<'a>(
    values: impl Iterator<Item = (usize, usize, f64)> + 'a,
    pattern: impl Iterator<Item = (usize, usize, f64)> + 'a,
) -> impl Iterator<Item = f64> + 'a {
    let pairs = values.zip(pattern).filter(|(_, (_, _, used))| *used != 0.0);
    pairs.map(|((_, _, value), _)| value)
}

impl SparseProblem for Collocation {
    fn gradient(&self, z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let runs: Vec<_> = (0..self.runs.len())
            .map(|j| self.run_derivatives(Some(z), j))
            .collect();
        self.each_sample(|j, i, sample| {
            let own = &runs[j].points[i];
            for (pull, output) in self
                .pull(j, sample, &own.outputs)
                .iter()
                .zip(&own.gradients)
            {
                let row = DMatrix::from_row_slice(1, output.len(), output.as_slice());
                let by = runs[j].tangents[i].chain(&row);
                for (_, column, value) in by.entries(self.layout.runs[j].z, self.layout.theta) {
                    gradient[column] += pull * value;
                }
            }
        });
    }

    fn equality_pattern(&self) -> Pattern {
        let mut pattern = Pattern::new();
        for (j, at) in self.layout.runs.iter().enumerate() {
            let known = (0..self.n_states()).filter(|&i| self.runs[j].initial[i].is_some());
            pattern.extend(known.enumerate().map(|(row, i)| (at.c + row, at.z + i)));
            for (row, tangent) in self.defect_tangents(j, &self.run_derivatives(None, j)) {
                let entries = tangent.entries(at.z, self.layout.theta);
                let used = entries.filter(|(_, _, value)| *value != 0.0);
                pattern.extend(used.map(|(i, column, _)| (row + i, column)));
            }
        }
        pattern
    }

    fn inequality_pattern(&self) -> Pattern {
        let p = self.n_parameters();
        let mut pattern = Pattern::new();
        let runs: Vec<_> = (0..self.runs.len())
            .map(|j| self.run_derivatives(None, j))
            .collect();
        for (j, at) in self.layout.runs.iter().enumerate() {
            let points = || self.grids[j].observed.iter();
            let rows = (0..at.bounded).flat_map(|_| points());
            for (row, i) in rows.enumerate() {
                let (columns, _) = self.local(j, &runs[j].tangents[*i]);
                pattern.extend(columns.into_iter().map(|column| (at.g + row, column)));
            }
        }
        for i in 0..self.constraints.count() {
            let row = self.layout.parameter_constraints + i;
            pattern.extend((0..p).map(|v| (row, self.layout.theta + v)));
        }
        pattern
    }

    fn jacobians(&self, z: &[f64], equality: &mut [f64], inequality: &mut [f64]) {
        let (mut c, mut g) = (equality.iter_mut(), inequality.iter_mut());
        let mut put = |value: f64| *c.next().expect("the pattern's length") = value;
        let mut put_g = |value: f64| *g.next().expect("the pattern's length") = value;
        for (j, at) in self.layout.runs.iter().enumerate() {
            let run = self.run_derivatives(Some(z), j);
            let patterns = self.defect_tangents(j, &self.run_derivatives(None, j));
            (0..at.known).for_each(|_| put(1.0));
            for ((_, tangent), (_, pattern)) in self.defect_tangents(j, &run).iter().zip(&patterns)
            {
                let values = tangent.entries(at.z, self.layout.theta);
                kept(values, pattern.entries(at.z, self.layout.theta)).for_each(&mut put);
            }
            for bounded in self.measured..self.model.n_outputs() {
                for i in &self.grids[j].observed {
                    let (_, t) = self.local(j, &run.tangents[*i]);
                    let row = run.points[*i].gradients[bounded].transpose() * t;
                    row.iter().for_each(|value| put_g(*value));
                }
            }
        }
        let theta = self.theta(z);
        let columns = (0..self.n_parameters()).map(|v| self.constraint_derivatives(theta, v, v));
        let columns: Vec<_> = columns.collect();
        for i in 0..self.constraints.count() {
            columns.iter().for_each(|column| put_g(column[i].eps1));
        }
    }

    fn hessian_pattern(&self) -> Pattern {
        let mut pattern = Pattern::new();
        for j in 0..self.runs.len() {
            let run = self.run_derivatives(None, j);
            let w = self.curvature_pattern();
            for (point, tangent) in self.grids[j].points.iter().zip(&run.tangents) {
                let w = if point.sample.is_some() {
                    DMatrix::from_element(w.nrows(), w.ncols(), 1.0)
                } else {
                    w.clone()
                };
                self.point_hessian(j, tangent, &w, |row, column, used| {
                    if used != 0.0 {
                        pattern.push((row, column));
                    }
                });
            }
        }
        let theta = self.layout.theta;
        pattern.extend(upper_triangle(self.n_parameters()).map(|(a, b)| (theta + a, theta + b)));
        pattern
    }

    fn hessian(&self, z: &[f64], lambda: &[f64], eta: &[f64], kind: Hessian, values: &mut [f64]) {
        let exact = kind == Hessian::Exact;
        let v = self.n_states() + self.n_parameters();
        let mut values = values.iter_mut();
        let mut put = |value: f64| *values.next().expect("the pattern's length") = value;
        for (j, place) in self.layout.runs.iter().enumerate() {
            let (run, pattern) = (
                self.run_derivatives(Some(z), j),
                self.run_derivatives(None, j),
            );
            let outputs = |grid: &Grid, i: usize| {
                let Some(sample) = grid.points[i].sample else {
                    return vec![0.0; self.model.n_outputs()];
                };
                let mut weights = self.pull(j, sample, &run.points[i].outputs);
                let first = place.g + sample as usize;
                let rows = (0..place.bounded).map(|k| eta[first + k * place.samples]);
                weights.extend(rows);
                weights
            };
            let omega = self.derivative_weights(j, &run, lambda, &outputs);
            let grid = &self.grids[j];
            let states = self.evaluate_points(z, j, |_, _| {});
            for (i, point) in grid.points.iter().enumerate() {
                let mut w = DMatrix::zeros(v, v);
                let mut used = self.curvature_pattern();
                if point.sample.is_some() {
                    used.fill(1.0);
                }
                if let Some(sample) = point.sample {
                    let own = &run.points[i];
                    let both = self.loss_derivatives((j, sample), &own.outputs, kind);
                    for (h, (_, second)) in own.gradients.iter().zip(both) {
                        w += h * h.transpose() * second;
                    }
                }
                if exact {
                    let f: Vec<_> = omega[i].iter().map(|v| [*v; LANES]).collect();
                    let weights = outputs(grid, i);
                    let weights: Vec<_> = weights.into_iter().map(|v| [v; LANES]).collect();
                    let x = states.states(grid, self.coefficients(z, j), i, self.n_states());
                    let mut second = vec![[0.0; LANES]; self.model.pairs.len()];
                    let mut derivatives = self.model.derivatives(self.theta(z));
                    let mut values = vec![[0.0; LANES]; self.model.n_outputs()];
                    derivatives.evaluate([x; LANES], [self.inputs_at(j, i); LANES], &mut values);
                    derivatives.second_order(&f, &weights, &mut second);
                    for ([value, ..], &(a, b)) in second.iter().zip(&self.model.pairs) {
                        w[(a, b)] += value;
                        if a != b {
                            w[(b, a)] += value;
                        }
                    }
                }
                let mut wanted = Vec::new();
                self.point_hessian(j, &pattern.tangents[i], &used, |_, _, used| {
                    wanted.push(used != 0.0);
                });
                let mut wanted = wanted.into_iter();
                self.point_hessian(j, &run.tangents[i], &w, |_, _, value| {
                    if wanted.next() == Some(true) {
                        put(value);
                    }
                });
            }
        }
        let eta = &eta[self.layout.parameter_constraints..];
        for (a, b) in upper_triangle(self.n_parameters()) {
            let terms = self.constraint_derivatives(self.theta(z), a, b);
            let sum: f64 = terms.iter().zip(eta).map(|(t, eta)| t.eps1eps2 * eta).sum();
            put(if exact { sum } else { 0.0 });
        }
    }
}

impl Collocation {
    /// Ones where a point without sample may have second derivatives.
    fn curvature_pattern(&self) -> DMatrix<f64> {
        let v = self.n_states() + self.n_parameters();
        let mut out = DMatrix::zeros(v, v);
        for &(a, b) in &self.model.pairs {
            (out[(a, b)], out[(b, a)]) = (1.0, 1.0);
        }
        out
    }
}
