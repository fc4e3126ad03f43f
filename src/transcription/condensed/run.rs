//! One run: derivatives at its nodes, forward elimination of its states, adjoint sweep.

use super::dense::{axpy, dot, lu_factor, lu_solve, lu_solve_transposed};
use crate::sqp::{Hessian, Iterate};
use crate::transcription::Collocation;
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::layout::RunLayout;
use crate::transcription::node::{FirstOrder, Weights};
use pilotage_models::Dynamics;

/// Workspace of one run; everything is allocated once.
///
/// The reduced variables of a run are `ρ = [δθ; its free initial states]`, `r` of them. The sweep
/// writes every node's step as `δX_k = S_k ρ + e_k`.
#[derive(Debug, Clone)]
pub struct RunSweep {
    n: usize,
    p: usize,
    /// Indices of the free initial states.
    pub free: Vec<usize>,
    first: Vec<FirstOrder>,
    residual: Vec<f64>,
    second: Vec<f64>,
    s: Vec<f64>,
    e: Vec<f64>,
    lu: Vec<f64>,
    pivots: Vec<usize>,
    /// Steps of all nodes after [`expand`](Self::expand).
    pub dx: Vec<f64>,
    /// Gradient of this run's objective with respect to θ.
    pub theta_gradient: Vec<f64>,
    /// Its part of the Lagrangian's gradient with respect to θ.
    pub theta_lagrangian: Vec<f64>,
}

impl RunSweep {
    /// Workspace for run `j`.
    pub fn new<D: Dynamics, C: ParameterConstraints>(
        problem: &Collocation<D, C>,
        j: usize,
    ) -> Self {
        let (n, p, s) = (
            problem.n_states(),
            problem.n_parameters(),
            problem.scheme.unknown_nodes(),
        );
        let (run, nodes) = (&problem.runs[j], problem.layout.runs[j].nodes);
        let free: Vec<usize> = (0..n).filter(|&i| run.initial[i].is_none()).collect();
        let implicit = if problem.scheme.is_explicit() {
            0
        } else {
            run.intervals()
        };
        Self {
            n,
            p,
            first: vec![FirstOrder::default(); nodes],
            residual: vec![0.0; nodes],
            second: vec![0.0; nodes * problem.model.pairs.len()],
            s: vec![0.0; nodes * n * (p + free.len())],
            e: vec![0.0; nodes * n],
            lu: vec![0.0; implicit * (s * n) * (s * n)],
            pivots: vec![0; implicit * s * n],
            dx: vec![0.0; nodes * n],
            theta_gradient: vec![0.0; p],
            theta_lagrangian: vec![0.0; p],
            free,
        }
    }

    /// Number of reduced variables.
    pub fn r(&self) -> usize {
        self.p + self.free.len()
    }

    /// Derivatives at every node; writes the run's parts of `∇f` and `∇L` into `gradient` and
    /// `lagrangian` (over all variables).
    pub fn linearise<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        j: usize,
        at: &Iterate,
        exact: bool,
        gradient: &mut [f64],
        lagrangian: &mut [f64],
    ) {
        let (n, s) = (self.n, problem.scheme.unknown_nodes());
        let (run, place) = (&problem.runs[j], problem.layout.runs[j]);
        let pairs = problem.model.pairs.len();
        let mut input = vec![0.0; problem.model.dynamics.n_inputs()];
        let mut omega = vec![0.0; n];
        self.theta_gradient.fill(0.0);
        self.theta_lagrangian.fill(0.0);
        self.defect_transposed(place, at, s, run.intervals(), lagrangian);
        for k in 0..place.nodes {
            let (interval, fraction) = problem.place(j, k);
            run.inputs_at(interval, fraction, &mut input);
            let (x, theta) = (problem.node(&at.z, j, k), problem.theta(&at.z));
            let first = &mut self.first[k];
            problem.model.first_order(x, &input, theta, first);
            let sample = problem.sample(j, k);
            self.residual[k] = sample.map_or(0.0, |value| value - first.measured);
            let pull = sample.map_or(0.0, |_| -2.0 * run.weight * self.residual[k]);
            let eta = if k % s == 0 {
                at.eta[place.g + k / s]
            } else {
                0.0
            };
            node_weights(problem, j, k, &at.lambda, &mut omega);
            let columns = place.z + k * n;
            let mut add = |c: usize, objective: f64, all: f64| match c < n {
                true => {
                    gradient[columns + c] += objective;
                    lagrangian[columns + c] += all;
                }
                false => {
                    self.theta_gradient[c - n] += objective;
                    self.theta_lagrangian[c - n] += all;
                }
            };
            for c in 0..n + self.p {
                let objective = pull * first.measured_gradient[c];
                add(c, objective, objective + eta * first.bounded_gradient[c]);
            }
            for (value, &(i, c)) in first.jacobian.iter().zip(&problem.model.entries) {
                add(c, 0.0, omega[i] * value);
            }
            if exact {
                let weights = Weights {
                    f: &omega,
                    measured: pull,
                    bounded: eta,
                };
                let out = &mut self.second[k * pairs..(k + 1) * pairs];
                problem.model.second_order(x, &input, theta, weights, out);
            }
        }
    }

    /// Adds `λ` through the parts of the defects that are linear: `X_i - X_0`, and the known states.
    fn defect_transposed(
        &self,
        place: RunLayout,
        at: &Iterate,
        s: usize,
        intervals: usize,
        out: &mut [f64],
    ) {
        let n = self.n;
        let known = (0..n).filter(|i| !self.free.contains(i));
        known
            .zip(&at.lambda[place.c..])
            .for_each(|(i, lambda)| out[place.z + i] += lambda);
        for interval in 0..intervals {
            for i in 0..s {
                let row = place.c + place.known + (interval * s + i) * n;
                let (start, node) = (
                    place.z + interval * s * n,
                    place.z + (interval * s + i + 1) * n,
                );
                for l in 0..n {
                    out[node + l] += at.lambda[row + l];
                    out[start + l] -= at.lambda[row + l];
                }
            }
        }
    }

    /// Forward sweep for the sensitivities `S`. False when an interval's matrix is singular.
    pub fn sweep_sensitivities<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        j: usize,
    ) -> bool {
        let (n, r, s) = (self.n, self.r(), problem.scheme.unknown_nodes());
        let run = &problem.runs[j];
        self.s[..n * r].fill(0.0);
        for (l, &i) in self.free.iter().enumerate() {
            self.s[i * r + self.p + l] = 1.0;
        }
        for interval in 0..run.intervals() {
            let start = interval * s;
            let (done, rest) = self.s.split_at_mut((start + 1) * n * r);
            let from = &done[start * n * r..];
            let to = &mut rest[..s * n * r];
            let nodes = &self.first[start..=start + s];
            right_hand_side(problem, run.step(interval), nodes, from, to, r);
            if !problem.scheme.is_explicit() {
                let size = s * n;
                let lu = &mut self.lu[interval * size * size..(interval + 1) * size * size];
                let pivots = &mut self.pivots[interval * size..(interval + 1) * size];
                interval_matrix(problem, run.step(interval), nodes, lu);
                if !lu_factor(lu, size, pivots) {
                    return false;
                }
                lu_solve(lu, size, pivots, to, r);
            }
        }
        self.s.iter().all(|v| v.is_finite())
    }

    /// Forward sweep for the offsets `e` that remove the constraint values `c` (over all equalities).
    pub fn sweep_offsets<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        j: usize,
        c: &[f64],
    ) {
        let (n, s) = (self.n, problem.scheme.unknown_nodes());
        let (run, place) = (&problem.runs[j], problem.layout.runs[j]);
        let e = &mut self.e;
        e[..n].fill(0.0);
        let known = (0..n).filter(|i| !self.free.contains(i));
        known
            .zip(&c[place.c..])
            .for_each(|(i, value)| e[i] = -value);
        for interval in 0..run.intervals() {
            let start = interval * s;
            let (done, rest) = e.split_at_mut((start + 1) * n);
            let to = &mut rest[..s * n];
            let nodes = &self.first[start..=start + s];
            start_transition(
                problem,
                run.step(interval),
                &nodes[0],
                &done[start * n..],
                to,
                1,
            );
            let rows = place.c + place.known + start * n;
            axpy(-1.0, &c[rows..rows + s * n], to);
            if !problem.scheme.is_explicit() {
                let size = s * n;
                let lu = &self.lu[interval * size * size..(interval + 1) * size * size];
                lu_solve(
                    lu,
                    size,
                    &self.pivots[interval * size..(interval + 1) * size],
                    to,
                    1,
                );
            }
        }
    }

    /// Adds `Σ Zᵀ W Z` to `matrix` (r × r, row-major) where `δ[X; θ] = Z ρ + e`.
    pub fn reduce_matrix<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        j: usize,
        kind: Hessian,
        matrix: &mut [f64],
    ) {
        let (n, r, pairs) = (self.n, self.r(), problem.model.pairs.len());
        let mut row = vec![0.0; r];
        for (k, first) in self.first.iter().enumerate() {
            let s = &self.s[k * n * r..(k + 1) * n * r];
            if problem.sample(j, k).is_some() {
                self.project(&first.measured_gradient, s, &mut row);
                for i in 0..r {
                    axpy(
                        2.0 * problem.runs[j].weight * row[i],
                        &row,
                        &mut matrix[i * r..(i + 1) * r],
                    );
                }
            }
            if kind == Hessian::Exact {
                let values = &self.second[k * pairs..(k + 1) * pairs];
                for (&w, &(a, b)) in values.iter().zip(&problem.model.pairs) {
                    if w != 0.0 {
                        self.add_pair(w, a, b, s, matrix);
                    }
                }
            }
        }
    }

    /// Adds `w (z_a z_bᵀ + z_b z_aᵀ)`, or `w z_a z_aᵀ` for `a == b`, with `z_a` row `a` of `Z`.
    fn add_pair(&self, w: f64, a: usize, b: usize, s: &[f64], matrix: &mut [f64]) {
        let (n, r) = (self.n, self.r());
        let mut add = |a: usize, b: usize| match (a < n, b < n) {
            (true, true) => {
                for i in 0..r {
                    axpy(
                        w * s[a * r + i],
                        &s[b * r..(b + 1) * r],
                        &mut matrix[i * r..(i + 1) * r],
                    );
                }
            }
            (true, false) => (0..r).for_each(|i| matrix[i * r + b - n] += w * s[a * r + i]),
            (false, true) => axpy(
                w,
                &s[b * r..(b + 1) * r],
                &mut matrix[(a - n) * r..(a - n + 1) * r],
            ),
            (false, false) => matrix[(a - n) * r + b - n] += w,
        };
        add(a, b);
        if a != b {
            add(b, a);
        }
    }

    /// `out = gradientᵀ Z`, over the reduced variables.
    fn project(&self, gradient: &[f64], s: &[f64], out: &mut [f64]) {
        let r = self.r();
        out[..self.p].copy_from_slice(&gradient[self.n..]);
        out[self.p..].fill(0.0);
        for (i, g) in gradient[..self.n].iter().enumerate() {
            if *g != 0.0 {
                axpy(*g, &s[i * r..(i + 1) * r], out);
            }
        }
    }

    /// Adds `Σ Zᵀ (g + W [e; 0])` to `vector`.
    pub fn reduce_vector<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        j: usize,
        kind: Hessian,
        vector: &mut [f64],
    ) {
        let (n, r) = (self.n, self.r());
        let zero = vec![0.0; self.p];
        let mut full = vec![0.0; n + self.p];
        let mut row = vec![0.0; r];
        for k in 0..self.first.len() {
            self.model_gradient(
                problem,
                j,
                k,
                kind,
                (&self.e[k * n..(k + 1) * n], &zero),
                &mut full,
            );
            self.project(&full, &self.s[k * n * r..(k + 1) * n * r], &mut row);
            axpy(1.0, &row, vector);
        }
    }

    /// Writes node `k`'s `g + W [δx; δθ]` into `out` (n + p).
    fn model_gradient<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        j: usize,
        k: usize,
        kind: Hessian,
        (dx, dtheta): (&[f64], &[f64]),
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let first = &self.first[k];
        let (n, pairs) = (self.n, problem.model.pairs.len());
        if problem.sample(j, k).is_some() {
            let h = &first.measured_gradient;
            let change = dot(&h[..n], dx) + dot(&h[n..], dtheta);
            axpy(
                2.0 * problem.runs[j].weight * (change - self.residual[k]),
                h,
                out,
            );
        }
        if kind == Hessian::Exact {
            let step = |c: usize| if c < n { dx[c] } else { dtheta[c - n] };
            for (w, &(a, b)) in self.second[k * pairs..(k + 1) * pairs]
                .iter()
                .zip(&problem.model.pairs)
            {
                out[a] += w * step(b);
                if a != b {
                    out[b] += w * step(a);
                }
            }
        }
    }

    /// Row of the bounded signal at boundary `b`: its coefficients over the reduced variables, and its
    /// change by the offsets alone.
    pub fn bounded_row(&self, node: usize, out: &mut [f64]) -> f64 {
        let (n, r) = (self.n, self.r());
        let gradient = &self.first[node].bounded_gradient;
        self.project(gradient, &self.s[node * n * r..(node + 1) * n * r], out);
        dot(&gradient[..n], &self.e[node * n..(node + 1) * n])
    }

    /// Linear change of the bounded signal at a node for a step of the node and of θ.
    pub fn bounded_change(&self, node: usize, dx: &[f64], dtheta: &[f64]) -> f64 {
        let gradient = &self.first[node].bounded_gradient;
        dot(&gradient[..self.n], dx) + dot(&gradient[self.n..], dtheta)
    }

    /// All nodes' steps from the reduced variables, into `dx`.
    pub fn expand(&mut self, rho: &[f64]) {
        let r = self.r();
        for ((dx, s), e) in self.dx.iter_mut().zip(self.s.chunks_exact(r)).zip(&self.e) {
            *dx = e + dot(s, rho);
        }
    }

    /// Backward sweep for the multipliers of the run's equalities, given the step in `dx` and `dtheta`
    /// and the multipliers `eta` of the bounded signal at the boundaries. Returns the part of `dᵀHd`.
    pub fn adjoint<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        j: usize,
        kind: Hessian,
        dtheta: &[f64],
        eta: &[f64],
        lambda: &mut [f64],
    ) -> f64 {
        let (n, s) = (self.n, problem.scheme.unknown_nodes());
        let (run, place) = (&problem.runs[j], problem.layout.runs[j]);
        let mut full = vec![0.0; n + self.p];
        let mut right = vec![0.0; place.nodes * n];
        let mut curvature = 0.0;
        for (k, right) in right.chunks_exact_mut(n).enumerate() {
            let dx = &self.dx[k * n..(k + 1) * n];
            self.model_gradient(problem, j, k, kind, (dx, dtheta), &mut full);
            curvature += dot(&full[..n], dx) + dot(&full[n..], dtheta);
            right.copy_from_slice(&full[..n]);
            if problem.sample(j, k).is_some() {
                // g is not part of the curvature
                let h = &self.first[k].measured_gradient;
                let pull = 2.0 * run.weight * self.residual[k];
                curvature += pull * (dot(&h[..n], dx) + dot(&h[n..], dtheta));
            }
            if k % s == 0 && eta[k / s] != 0.0 {
                axpy(eta[k / s], &self.first[k].bounded_gradient[..n], right);
            }
        }
        for interval in (0..run.intervals()).rev() {
            let start = interval * s;
            let rows = place.known + start * n;
            let out = &mut lambda[rows..rows + s * n];
            let (head, tail) = right.split_at_mut((start + 1) * n);
            out.iter_mut().zip(tail.iter()).for_each(|(o, v)| *o = -v);
            if !problem.scheme.is_explicit() {
                let size = s * n;
                let lu = &self.lu[interval * size * size..(interval + 1) * size * size];
                lu_solve_transposed(
                    lu,
                    size,
                    &self.pivots[interval * size..(interval + 1) * size],
                    out,
                );
            }
            let carry = &mut head[start * n..];
            for (i, row) in problem.scheme.weights.iter().enumerate() {
                let part = &out[i * n..(i + 1) * n];
                axpy(-1.0, part, carry);
                let factor = -run.step(interval) * row[0];
                for (value, &(l, c)) in self.first[start]
                    .jacobian
                    .iter()
                    .zip(&problem.model.entries)
                {
                    if c < n {
                        carry[c] += factor * value * part[l];
                    }
                }
            }
        }
        let known = (0..n).filter(|i| !self.free.contains(i));
        known
            .zip(lambda.iter_mut())
            .for_each(|(i, out)| *out = -right[i]);
        curvature
    }
}

/// Weights of `f̄` of node `k` in `λᵀ c`: `-h Σ_i a_ij λ_i` over the intervals that the node is in.
pub fn node_weights<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    j: usize,
    k: usize,
    lambda: &[f64],
    out: &mut [f64],
) {
    let (n, s) = (problem.n_states(), problem.scheme.unknown_nodes());
    let (run, place) = (&problem.runs[j], problem.layout.runs[j]);
    out.fill(0.0);
    let mut add = |interval: usize, column: usize| {
        for (i, row) in problem.scheme.weights.iter().enumerate() {
            let rows = place.c + place.known + (interval * s + i) * n;
            axpy(
                -run.step(interval) * row[column],
                &lambda[rows..rows + n],
                out,
            );
        }
    };
    if k.is_multiple_of(s) && k > 0 {
        add(k / s - 1, s);
    }
    if k / s < run.intervals() {
        add(k / s, k % s);
    }
}

/// Contribution of the interval's first node: row block `i` is `(I + h a_i0 A_0) from`.
fn start_transition<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    h: f64,
    first: &FirstOrder,
    from: &[f64],
    to: &mut [f64],
    columns: usize,
) {
    let n = problem.n_states();
    for (row, to) in problem
        .scheme
        .weights
        .iter()
        .zip(to.chunks_exact_mut(n * columns))
    {
        to.copy_from_slice(&from[..n * columns]);
        if row[0] == 0.0 {
            continue;
        }
        for (value, &(i, c)) in first.jacobian.iter().zip(&problem.model.entries) {
            if c < n {
                let source = &from[c * columns..(c + 1) * columns];
                axpy(
                    h * row[0] * value,
                    source,
                    &mut to[i * columns..(i + 1) * columns],
                );
            }
        }
    }
}

/// Right-hand side of an interval's sensitivities: the first node's transition, and every node's
/// direct dependence on θ.
fn right_hand_side<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    h: f64,
    nodes: &[FirstOrder],
    from: &[f64],
    to: &mut [f64],
    r: usize,
) {
    let n = problem.n_states();
    start_transition(problem, h, &nodes[0], from, to, r);
    for (i, row) in problem.scheme.weights.iter().enumerate() {
        for (node, a) in nodes.iter().zip(*row).filter(|(_, a)| **a != 0.0) {
            for (value, &(l, c)) in node.jacobian.iter().zip(&problem.model.entries) {
                if c >= n {
                    to[(i * n + l) * r + c - n] += h * a * value;
                }
            }
        }
    }
}

/// `M = I - h [a_ij A_j]` over the unknown nodes of an interval.
fn interval_matrix<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    h: f64,
    nodes: &[FirstOrder],
    matrix: &mut [f64],
) {
    let (n, s) = (problem.n_states(), problem.scheme.unknown_nodes());
    let size = n * s;
    matrix.fill(0.0);
    (0..size).for_each(|i| matrix[i * size + i] = 1.0);
    for (i, row) in problem.scheme.weights.iter().enumerate() {
        for (j, a) in row[1..].iter().enumerate().filter(|(_, a)| **a != 0.0) {
            for (value, &(l, c)) in nodes[j + 1].jacobian.iter().zip(&problem.model.entries) {
                if c < n {
                    matrix[(i * n + l) * size + j * n + c] -= h * a * value;
                }
            }
        }
    }
}
