//! One run: the derivatives at its points.

use super::Stencils;
use super::dense::{axpy, dot};
use super::stencil::{Factorable, Local, Stencil};
use super::sweep::with_width;
use crate::sqp::{Hessian, Iterate};
use crate::transcription::Collocation;
use crate::transcription::collocation::Values;
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::grid::{Combination, Grid, Point, PointState};
use crate::transcription::node::{FirstOrder, MAX_SIZE, Weights};
use pilotage_models::Dynamics;
use std::collections::BTreeMap;

/// Workspace of one run; everything is allocated once.
///
/// The reduced variables of a run are `ρ = [δθ; its free initial states]`, `r` of them. The sweeps
/// ([`super::sweep`]) write the step of every unknown and point as `S ρ + e`.
#[derive(Debug, Clone)]
pub struct RunSweep {
    pub(super) n: usize,
    pub(super) p: usize,
    /// Width of the rows `S`: `r`, padded.
    pub(super) w: usize,
    /// Indices of the free initial states.
    pub free: Vec<usize>,
    /// Jacobian entries at all points.
    pub(super) jacobian: Vec<f64>,
    /// Gradients of the measured output and of the bounded signal at all samples, over `[x̄; θ̄]`.
    measured: Vec<f64>,
    bounded: Vec<f64>,
    /// Recorded minus modelled output at the samples, and `2 w`; both zero where none is recorded.
    residual: Vec<f64>,
    weight: Vec<f64>,
    /// Second derivatives at all points.
    second: Vec<f64>,
    /// Rows `S`, offsets `e` and steps of the unknowns, and of the points that are combinations.
    pub(super) nodes: Rows,
    pub(super) combined: Rows,
    /// Factors of each element's matrix, one after the other, and those with an order of their own.
    pub(super) lu: Vec<f64>,
    pub(super) special: BTreeMap<usize, (Factorable, Vec<f64>)>,
    pub(super) work: Work,
    /// Gradient of this run's objective with respect to θ.
    pub theta_gradient: Vec<f64>,
    /// Its part of the Lagrangian's gradient with respect to θ.
    pub theta_lagrangian: Vec<f64>,
    /// Scratch: weights of the points' derivatives, and derivatives by the unknowns.
    pub(super) omega: Vec<f64>,
    pub(super) right: Vec<f64>,
}

/// Sensitivities, offsets and steps of a list of state vectors.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// `S`, `w` columns of which the first `r` count.
    pub s: Vec<f64>,
    /// `e`.
    pub e: Vec<f64>,
    /// `S ρ + e`.
    pub dx: Vec<f64>,
}

/// Scratch of the sweeps, as large as the largest element needs.
#[derive(Debug, Clone, Default)]
pub struct Work {
    pub right: Vec<f64>,
    pub pivots: Vec<f64>,
}

impl Rows {
    fn new(count: usize, n: usize, w: usize) -> Self {
        Self {
            s: vec![0.0; count * n * w],
            e: vec![0.0; count * n],
            dx: vec![0.0; count * n],
        }
    }
}

/// What a run's linearisation reads besides the problem and the iterate.
#[derive(Debug)]
pub struct Place<'a, D, C> {
    /// The problem.
    pub problem: &'a Collocation<D, C>,
    /// Number of the run.
    pub j: usize,
}

impl<D, C> Clone for Place<'_, D, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<D, C> Copy for Place<'_, D, C> {}

impl RunSweep {
    /// Workspace for run `j`.
    pub fn new<D: Dynamics, C: ParameterConstraints>(
        problem: &Collocation<D, C>,
        j: usize,
    ) -> Self {
        let (n, p) = (problem.n_states(), problem.n_parameters());
        let (run, grid) = (&problem.runs[j], &problem.grids[j]);
        let (samples, points) = (run.time.len(), grid.points.len());
        let free: Vec<usize> = (0..n).filter(|&i| run.initial[i].is_none()).collect();
        let w = (p + free.len()).max(1).next_multiple_of(4);
        let largest = grid.elements.iter().map(|e| e.tableau.unknowns()).max();
        let size = n * largest.unwrap_or(0).max(1);
        Self {
            n,
            p,
            w,
            jacobian: vec![0.0; points * problem.model.entries.len()],
            measured: vec![0.0; samples * (n + p)],
            bounded: vec![0.0; samples * (n + p)],
            residual: vec![0.0; samples],
            weight: vec![0.0; samples],
            second: vec![0.0; points * problem.model.pairs.len()],
            nodes: Rows::new(grid.nodes(), n, w),
            combined: Rows::new(grid.combinations, n, w),
            lu: Vec::new(),
            special: BTreeMap::new(),
            work: Work {
                right: vec![0.0; size * w],
                pivots: vec![0.0; size],
            },
            theta_gradient: vec![0.0; p],
            theta_lagrangian: vec![0.0; p],
            omega: vec![0.0; points * n],
            right: vec![0.0; grid.nodes() * n],
            free,
        }
    }

    /// Number of reduced variables.
    pub fn r(&self) -> usize {
        self.p + self.free.len()
    }

    /// The Jacobians at an element's points.
    pub(super) fn local<'a>(
        &'a self,
        grid: &'a Grid,
        element: usize,
        stencil: &Stencil,
    ) -> Local<'a> {
        Local::new(grid, &grid.elements[element], stencil, &self.jacobian)
    }

    /// Derivatives at every point; writes the run's parts of `∇f` and `∇L` into `gradient` and
    /// `lagrangian`, over the run's own variables.
    pub fn linearise<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        iterate: &Iterate,
        exact: bool,
        gradient: &mut [f64],
        lagrangian: &mut [f64],
    ) {
        let values = at.problem.point_states(&iterate.z, at.j);
        self.first_order(at, &iterate.z, &values);
        let place = &at.problem.layout.runs[at.j];
        let lambda = &iterate.lambda[place.equalities()];
        let eta = &iterate.eta[place.inequalities()];
        self.defects_transposed(at, lambda, lagrangian);
        let second = exact.then_some((iterate.z.as_slice(), &values));
        self.pull_back(at, Some(eta), second, lagrangian);
        std::mem::swap(&mut self.theta_gradient, &mut self.theta_lagrangian);
        self.omega.fill(0.0);
        gradient.fill(0.0);
        self.pull_back(at, None, None, gradient);
        std::mem::swap(&mut self.theta_gradient, &mut self.theta_lagrangian);
    }

    /// First derivatives and residuals.
    fn first_order<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        z: &[f64],
        values: &Values,
    ) {
        let (problem, j, n) = (at.problem, at.j, self.n);
        let (grid, v) = (&problem.grids[j], problem.coefficients(z, j));
        let (theta, all) = (problem.theta(z), n + self.p);
        let (inputs, entries) = (
            problem.model.dynamics.n_inputs(),
            problem.model.entries.len(),
        );
        for (i, point) in grid.points.iter().enumerate() {
            let x = values.states(grid, v, i, n);
            let jacobian = match point.collocated {
                true => &mut self.jacobian[i * entries..(i + 1) * entries],
                false => &mut [],
            };
            let outputs = point.sample.map(|sample| {
                let at = sample as usize * all..(sample as usize + 1) * all;
                (&mut self.measured[at.clone()], &mut self.bounded[at])
            });
            let out = FirstOrder { jacobian, outputs };
            let input = &grid.inputs[i * inputs..(i + 1) * inputs];
            let (measured, _) = problem.model.first_order(x, input, theta, out);
            if let Some(sample) = point.sample {
                let recorded = problem.recorded(j, sample);
                let k = sample as usize;
                self.residual[k] = recorded.map_or(0.0, |value| value - measured);
                self.weight[k] = recorded.map_or(0.0, |_| 2.0 * problem.runs[j].weight);
            }
        }
    }

    /// Writes `Eᵀ λ` and the known states' multipliers into `out`, and the weights `-h Σ_r A_ri λ_r` of
    /// the points' derivatives into `omega`.
    fn defects_transposed<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        lambda: &[f64],
        out: &mut [f64],
    ) {
        let (n, grid) = (self.n, &at.problem.grids[at.j]);
        out.fill(0.0);
        self.omega.fill(0.0);
        let known = (0..n).filter(|i| !self.free.contains(i));
        let count = n - self.free.len();
        known
            .zip(&lambda[..count])
            .for_each(|(i, lambda)| out[i] += lambda);
        let lambda = &lambda[count..];
        for element in &grid.elements {
            let points = grid.points_of(element);
            let rows = lambda[element.first * n..].chunks_exact(n);
            for (defect, lambda) in element.tableau.defects.iter().zip(rows) {
                for &(j, e) in &defect.e {
                    let k = element.first + j;
                    axpy(e, lambda, &mut out[k * n..(k + 1) * n]);
                }
                for &(i, a) in &defect.a {
                    let i = points[i] as usize;
                    axpy(-element.h * a, lambda, &mut self.omega[i * n..(i + 1) * n]);
                }
            }
        }
    }

    /// Reverse sweep over the points: adds the gradient with respect to the unknowns to `out`, and
    /// writes that of θ into `theta_lagrangian`. With the bounded signal's multipliers `eta` it is the
    /// Lagrangian's gradient, without the objective's; `second` are the variables and the points' states
    /// at which second derivatives are taken too.
    fn pull_back<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        eta: Option<&[f64]>,
        second: Option<(&[f64], &Values)>,
        out: &mut [f64],
    ) {
        let (problem, j, n) = (at.problem, at.j, self.n);
        let (grid, entries) = (&problem.grids[j], problem.model.entries.len());
        let mut full = vec![0.0; n + self.p];
        self.theta_lagrangian.fill(0.0);
        for (i, point) in grid.points.iter().enumerate().rev() {
            full.fill(0.0);
            let omega = &self.omega[i * n..(i + 1) * n];
            let (mut pull, mut push) = (0.0, 0.0);
            if let Some(sample) = point.sample {
                let k = sample as usize;
                pull = -self.weight[k] * self.residual[k];
                push = eta.map_or(0.0, |eta| eta[k]);
                let own = k * (n + self.p)..(k + 1) * (n + self.p);
                axpy(pull, &self.measured[own.clone()], &mut full);
                if push != 0.0 {
                    axpy(push, &self.bounded[own], &mut full);
                }
            }
            if point.collocated && (eta.is_some() || grid.combinations > 0) {
                let jacobian = &self.jacobian[i * entries..(i + 1) * entries];
                for (value, &(l, c)) in jacobian.iter().zip(&problem.model.entries) {
                    full[c] += omega[l] * value;
                }
            }
            if let Some((z, values)) = second {
                let pairs = problem.model.pairs.len();
                let inputs = problem.model.dynamics.n_inputs();
                let x = values.states(grid, problem.coefficients(z, j), i, n);
                let weights = Weights {
                    f: omega,
                    measured: pull,
                    bounded: push,
                };
                problem.model.second_order(
                    x,
                    &grid.inputs[i * inputs..(i + 1) * inputs],
                    problem.theta(z),
                    weights,
                    &mut self.second[i * pairs..(i + 1) * pairs],
                );
            }
            axpy(1.0, &full[n..], &mut self.theta_lagrangian);
            match &point.state {
                PointState::Node(k) => axpy(1.0, &full[..n], &mut out[k * n..(k + 1) * n]),
                PointState::Combination(c) => distribute(c, &full[..n], out, &mut self.omega),
            }
        }
    }

    /// Rows `S` of a point.
    fn s_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.s, &self.combined.s, self.n * self.w)
    }

    fn e_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.e, &self.combined.e, self.n)
    }

    fn dx_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.dx, &self.combined.dx, self.n)
    }

    /// `Σ Zᵀ W Z` (r × r, row-major) where `δ[Y; θ] = Z ρ + e`: of Gauss–Newton, and, if wanted, of the
    /// exact Hessian.
    pub fn reduce_matrices<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        exact: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        with_width!(self.w, W => self.reduced::<D, C, W>(at, exact))
    }

    fn reduced<D: Dynamics, C: ParameterConstraints, const W: usize>(
        &self,
        at: Place<'_, D, C>,
        exact: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let (n, r, model) = (self.n, self.r(), &at.problem.model);
        let pairs = model.pairs.len();
        // Halves of the symmetric sums; their transposes are added at the end.
        let (mut squares, mut curved) = (vec![[0.0; W]; r], vec![[0.0; W]; r]);
        for (i, point) in at.problem.grids[at.j].points.iter().enumerate() {
            let (s, _) = self.s_of(&point.state).as_chunks::<W>();
            if let Some(k) = self.recorded(point) {
                let row = project(self.of_sample(&self.measured, k), s, self.p);
                for (value, out) in row.iter().zip(&mut squares) {
                    axpy(0.5 * self.weight[k] * value, &row, out);
                }
            }
            if exact {
                let values = &self.second[i * pairs..(i + 1) * pairs];
                for (&w, &(a, b)) in values.iter().zip(&model.pairs).filter(|(w, _)| **w != 0.0) {
                    let w = if a == b { 0.5 * w } else { w };
                    add_pair(w, a, b, s, n, &mut curved);
                }
            }
        }
        let symmetric = |halves: &[[f64; W]]| -> Vec<f64> {
            let entry = |i: usize, l: usize| halves[i][l] + halves[l][i];
            (0..r * r).map(|k| entry(k / r, k % r)).collect()
        };
        let gauss_newton = symmetric(&squares);
        let mut full = Vec::new();
        if exact {
            full.clone_from(&gauss_newton);
            axpy(1.0, &symmetric(&curved), &mut full);
        }
        (gauss_newton, full)
    }

    /// The sample at a point, where its output is recorded.
    fn recorded(&self, point: &Point) -> Option<usize> {
        let sample = point.sample.map(|k| k as usize);
        sample.filter(|k| self.weight[*k] != 0.0)
    }

    /// A sample's part of gradients over `[x̄; θ̄]`.
    fn of_sample<'a>(&self, gradients: &'a [f64], sample: usize) -> &'a [f64] {
        let v = self.n + self.p;
        &gradients[sample * v..(sample + 1) * v]
    }

    /// Adds `Σ Zᵀ (g + W [e; 0])` to `vector`.
    pub fn reduce_vector<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        kind: Hessian,
        vector: &mut [f64],
    ) {
        with_width!(self.w, W => self.reduced_vector::<D, C, W>(at, kind, vector));
    }

    fn reduced_vector<D: Dynamics, C: ParameterConstraints, const W: usize>(
        &self,
        at: Place<'_, D, C>,
        kind: Hessian,
        vector: &mut [f64],
    ) {
        let n = self.n;
        let zero = [0.0; MAX_SIZE];
        let mut full = vec![0.0; n + self.p];
        let mut sum = [0.0; W];
        for (i, point) in at.problem.grids[at.j].points.iter().enumerate() {
            let step = (self.e_of(&point.state), &zero[..self.p]);
            if !self.model_gradient(at, i, kind, step, &mut full) {
                continue;
            }
            let (s, _) = self.s_of(&point.state).as_chunks::<W>();
            let own = project(&full, s, self.p);
            axpy(1.0, &own, &mut sum);
        }
        axpy(1.0, &sum, vector);
    }

    /// Writes point `i`'s `g + W [δx; δθ]` into `out` (n + p); false when that is zero.
    pub(super) fn model_gradient<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        i: usize,
        kind: Hessian,
        (dx, dtheta): (&[f64], &[f64]),
        out: &mut [f64],
    ) -> bool {
        let (model, n) = (&at.problem.model, self.n);
        let sample = self.recorded(&at.problem.grids[at.j].points[i]);
        let curved = kind == Hessian::Exact && !model.pairs.is_empty();
        if sample.is_none() && !curved {
            return false;
        }
        out.fill(0.0);
        if let Some(k) = sample {
            let h = &self.measured[k * (n + self.p)..(k + 1) * (n + self.p)];
            let change = dot(&h[..n], dx) + dot(&h[n..], dtheta);
            axpy(self.weight[k] * (change - self.residual[k]), h, out);
        }
        if curved {
            let pairs = model.pairs.len();
            let step = |c: usize| if c < n { dx[c] } else { dtheta[c - n] };
            let values = &self.second[i * pairs..(i + 1) * pairs];
            for (w, &(a, b)) in values.iter().zip(&model.pairs) {
                out[a] += w * step(b);
                if a != b {
                    out[b] += w * step(a);
                }
            }
        }
        true
    }

    /// Row of the bounded signal at a sample: its coefficients over the reduced variables, and its
    /// change by the offsets alone.
    pub fn bounded_row(&self, grid: &Grid, sample: usize) -> (Vec<f64>, f64) {
        let gradient = self.of_sample(&self.bounded, sample);
        let state = &grid.points[grid.observed[sample]].state;
        let row = with_width!(self.w, W => {
            let (s, _) = self.s_of(state).as_chunks::<W>();
            project(gradient, s, self.p)[..self.r()].to_vec()
        });
        (row, dot(&gradient[..self.n], self.e_of(state)))
    }

    /// Linear change of the bounded signal at a sample by the last expanded step.
    pub fn bounded_change(&self, grid: &Grid, sample: usize, dtheta: &[f64]) -> f64 {
        let gradient = &self.bounded[sample * (self.n + self.p)..(sample + 1) * (self.n + self.p)];
        let state = &grid.points[grid.observed[sample]].state;
        dot(&gradient[..self.n], self.dx_of(state)) + dot(&gradient[self.n..], dtheta)
    }

    /// Backward sweep for the multipliers of the run's equalities, given the last expanded step,
    /// `dtheta` and the multipliers `eta` of the bounded signal at the samples. Returns the part of
    /// `dᵀHd`.
    pub fn adjoint<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        kind: Hessian,
        (dtheta, eta): (&[f64], &[f64]),
        lambda: &mut [f64],
    ) -> f64 {
        let (n, grid) = (self.n, &at.problem.grids[at.j]);
        let mut full = vec![0.0; n + self.p];
        let mut curvature = 0.0;
        let (mut right, mut omega) = (
            std::mem::take(&mut self.right),
            std::mem::take(&mut self.omega),
        );
        right.fill(0.0);
        omega.fill(0.0);
        let entries = at.problem.model.entries.len();
        for (i, point) in grid.points.iter().enumerate().rev() {
            let dx = self.dx_of(&point.state);
            let sample = point.sample.map(|k| k as usize);
            if self.model_gradient(at, i, kind, (dx, dtheta), &mut full) {
                curvature += dot(&full[..n], dx) + dot(&full[n..], dtheta);
                if let Some(k) = sample.filter(|k| self.weight[*k] != 0.0) {
                    // The objective's gradient is in `full`, and no part of the Hessian.
                    let h = &self.measured[k * (n + self.p)..(k + 1) * (n + self.p)];
                    let along = dot(&h[..n], dx) + dot(&h[n..], dtheta);
                    curvature += self.weight[k] * self.residual[k] * along;
                }
            } else {
                full.fill(0.0);
            }
            if let Some(k) = sample.filter(|k| eta[*k] != 0.0) {
                let own = k * (n + self.p)..(k + 1) * (n + self.p);
                axpy(eta[k], &self.bounded[own], &mut full);
            }
            if grid.combinations > 0 && point.collocated {
                let jacobian = &self.jacobian[i * entries..(i + 1) * entries];
                let own = jacobian.iter().zip(&at.problem.model.entries);
                for (value, &(l, c)) in own.take_while(|(_, (_, c))| *c < n) {
                    full[c] += omega[i * n + l] * value;
                }
            }
            match &point.state {
                PointState::Node(k) => axpy(1.0, &full[..n], &mut right[k * n..(k + 1) * n]),
                PointState::Combination(c) => distribute(c, &full[..n], &mut right, &mut omega),
            }
        }
        self.omega = omega;
        self.eliminate_backward(at, stencils, &mut right, lambda);
        self.right = right;
        curvature
    }
}

/// Adds the derivative by a combination to those by its parts.
fn distribute(combination: &Combination, gradient: &[f64], nodes: &mut [f64], omega: &mut [f64]) {
    let n = gradient.len();
    for &(k, p) in &combination.p {
        axpy(p, gradient, &mut nodes[k * n..(k + 1) * n]);
    }
    for &(l, q) in &combination.q {
        axpy(q, gradient, &mut omega[l * n..(l + 1) * n]);
    }
}

/// `gradientᵀ Z` over the reduced variables, with `Z = [S; I 0]`.
#[inline(always)]
fn project<const W: usize>(gradient: &[f64], s: &[[f64; W]], p: usize) -> [f64; W] {
    let (x, theta) = gradient.split_at(s.len());
    let mut out = [0.0; W];
    out[..p].copy_from_slice(theta);
    for (g, s) in x.iter().zip(s).filter(|(g, _)| **g != 0.0) {
        axpy(*g, s, &mut out);
    }
    out
}

/// Adds `w z_a z_bᵀ`, with `z_a` row `a` of `Z = [S; I]`; of a pair of parameter and state only the
/// order whose row is the parameter's.
#[inline(always)]
fn add_pair<const W: usize>(
    w: f64,
    a: usize,
    b: usize,
    s: &[[f64; W]],
    n: usize,
    matrix: &mut [[f64; W]],
) {
    match (a < n, b < n) {
        (true, true) => {
            for (row, v) in matrix.iter_mut().zip(&s[a]) {
                axpy(w * v, &s[b], row);
            }
        }
        (true, false) => axpy(w, &s[a], &mut matrix[b - n]),
        (false, true) => axpy(w, &s[b], &mut matrix[a - n]),
        (false, false) => matrix[a - n][b - n] += w,
    }
}
