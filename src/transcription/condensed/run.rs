//! One run: the derivatives at its points, and what they make of the reduced variables.

use super::Stencils;
use super::dense::{axpy, dot};
use super::lanes::{self, Kernel, LANES, Lanes, width};
use super::sparse_lu::Symbolic;
use super::sweep::Span;
use crate::sqp::{Hessian, Iterate};
use crate::transcription::Collocation;
use crate::transcription::collocation::PointValues;
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::grid::{Combination, Grid, Point, PointState};
use crate::transcription::node::{MAX_SIZE, Output, Weights};
use pilotage_models::Dynamics;
use std::collections::BTreeMap;

/// A gradient over `[x̄; θ̄]`.
pub(super) type Gradient = [f64; 2 * MAX_SIZE];

/// Workspace of one run; everything is allocated once.
///
/// The reduced variables of a run are `ρ = [δθ; its free initial states]`, `r` of them. The sweeps
/// ([`super::sweep`]) write the step of every unknown and point as `S ρ + e`.
#[derive(Debug, Clone)]
pub struct RunSweep {
    pub(super) n: usize,
    pub(super) p: usize,
    /// Width of the rows `S`: `r + 1`, padded. Column `r` holds the offsets at the iterate.
    pub(super) w: usize,
    /// Indices of the free initial states.
    pub free: Vec<usize>,
    /// Jacobian entries at all points.
    pub(super) jacobian: Vec<f64>,
    /// Gradients of the measured output and of the bounded signal at all samples, at their columns.
    pub(super) gradients: [Vec<f64>; 2],
    /// Recorded minus modelled output at the samples, and `2 w`; both zero where none is recorded.
    pub(super) residual: Vec<f64>,
    pub(super) weight: Vec<f64>,
    /// Second derivatives at all points.
    pub(super) second: Vec<f64>,
    /// Rows `S`, offsets `e` and steps of the unknowns, and of the points that are combinations.
    pub(super) nodes: Rows,
    pub(super) combined: Rows,
    /// The bounded signal at the samples: rows over the reduced variables, and offsets.
    pub(super) bounded: Rows,
    /// Groups of elements, their factors and `K_0`, and the elements factored in an order of their own.
    pub(super) spans: Vec<Span>,
    pub(super) lu: Vec<Lanes>,
    pub(super) k0: Vec<Lanes>,
    pub(super) special: BTreeMap<usize, (Symbolic, Vec<Lanes>)>,
    pub(super) work: Work,
    /// Largest sensitivity of an unknown to a reduced variable.
    pub(super) growth: f64,
    /// Gradient of this run's objective with respect to θ.
    pub theta_gradient: Vec<f64>,
    /// Its part of the Lagrangian's gradient with respect to θ.
    pub theta_lagrangian: Vec<f64>,
    /// Scratch: weights of the points' derivatives, and derivatives by the unknowns.
    pub(super) omega: Vec<f64>,
    pub(super) right: Vec<f64>,
}

/// Sensitivities, offsets and steps of a list of quantities.
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
    pub pivots: Vec<f64>,
    pub lanes: Vec<Lanes>,
    pub parameters: Vec<Lanes>,
    pub points: Vec<[usize; LANES]>,
}

impl Rows {
    fn new(count: usize, w: usize) -> Self {
        Self {
            s: vec![0.0; count * w],
            e: vec![0.0; count],
            dx: vec![0.0; count],
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
        let (n, p, model) = (problem.n_states(), problem.n_parameters(), &problem.model);
        let (run, grid) = (&problem.runs[j], &problem.grids[j]);
        let (samples, points) = (run.time.len(), grid.points.len());
        let free: Vec<usize> = (0..n).filter(|&i| run.initial[i].is_none()).collect();
        let w = width(p + free.len() + 1);
        let largest = grid.elements.iter().map(|e| e.tableau.unknowns()).max();
        let size = n * largest.unwrap_or(0).max(1);
        Self {
            n,
            p,
            w,
            jacobian: vec![0.0; points * model.entries.len()],
            gradients: (model.outputs.each_ref()).map(|own| vec![0.0; samples * own.len()]),
            residual: vec![0.0; samples],
            weight: vec![0.0; samples],
            second: vec![0.0; points * model.pairs.len()],
            nodes: Rows::new(grid.nodes() * n, w),
            combined: Rows::new(grid.combinations * n, w),
            bounded: Rows::new(samples, w),
            spans: Vec::new(),
            lu: Vec::new(),
            k0: Vec::new(),
            special: BTreeMap::new(),
            work: Work {
                pivots: vec![0.0; size],
                lanes: vec![[0.0; LANES]; size],
                ..Work::default()
            },
            growth: 0.0,
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
        let place = &at.problem.layout.runs[at.j];
        let lambda = &iterate.lambda[place.equalities()];
        let eta = &iterate.eta[place.inequalities()];
        self.defects_transposed(at, lambda, lagrangian);
        self.differentiate(at, &iterate.z, eta, exact, lagrangian);
        self.objective_gradient(at, gradient);
    }

    /// Derivatives and residuals at the points, in a reverse sweep that adds their part of `∇L` to
    /// `lagrangian` and `theta_lagrangian`.
    fn differentiate<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        z: &[f64],
        eta: &[f64],
        exact: bool,
        lagrangian: &mut [f64],
    ) {
        let (problem, j, n, p) = (at.problem, at.j, self.n, self.p);
        let (grid, v, model) = (
            &problem.grids[j],
            problem.coefficients(z, j),
            &problem.model,
        );
        let values: PointValues = problem.point_states(z, j);
        let (inputs, entries) = (model.dynamics.n_inputs(), model.entries.len());
        let pairs = model.pairs.len();
        let mut derivatives = model.derivatives(problem.theta(z), exact);
        self.theta_lagrangian.fill(0.0);
        let mut full: Gradient;
        for (i, point) in grid.points.iter().enumerate().rev() {
            let x = values.states(grid, v, i, n);
            let input = &grid.inputs[i * inputs..(i + 1) * inputs];
            let (measured, _) = derivatives.evaluate(x, input);
            full = [0.0; 2 * MAX_SIZE];
            let (mut pull, mut push) = (0.0, 0.0);
            if let Some(sample) = point.sample {
                let k = sample as usize;
                let recorded = problem.recorded(j, sample);
                self.residual[k] = recorded.map_or(0.0, |value| value - measured);
                self.weight[k] = recorded.map_or(0.0, |_| 2.0 * problem.runs[j].weight);
                (pull, push) = (-self.weight[k] * self.residual[k], eta[k]);
                for (output, factor) in [(Output::Measured, pull), (Output::Bounded, push)] {
                    let columns = model.columns(output);
                    let own = &mut self.gradients[output as usize][k * columns.len()..];
                    let own = &mut own[..columns.len()];
                    derivatives.gradient(output, own);
                    let own = own.iter().zip(columns);
                    own.for_each(|(value, c)| full[*c] += factor * value);
                }
            }
            let omega = &self.omega[i * n..(i + 1) * n];
            if point.collocated {
                let jacobian = &mut self.jacobian[i * entries..(i + 1) * entries];
                derivatives.jacobian(jacobian);
                derivatives.pull_back(jacobian, omega, &mut full);
            }
            if exact {
                let weights = Weights {
                    f: omega,
                    measured: pull,
                    bounded: push,
                };
                let own = &mut self.second[i * pairs..(i + 1) * pairs];
                derivatives.second_order(weights, own);
            }
            axpy(1.0, &full[n..n + p], &mut self.theta_lagrangian);
            match &point.state {
                PointState::Node(k) => axpy(1.0, &full[..n], &mut lagrangian[k * n..(k + 1) * n]),
                PointState::Combination(c) => {
                    distribute(c, &full[..n], lagrangian, &mut self.omega)
                }
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

    /// Writes the objective's gradient with respect to the unknowns into `out`, and that of θ into
    /// `theta_gradient`.
    fn objective_gradient<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        out: &mut [f64],
    ) {
        let (n, grid, model) = (self.n, &at.problem.grids[at.j], &at.problem.model);
        let (columns, entries) = (model.columns(Output::Measured), model.entries.len());
        out.fill(0.0);
        self.theta_gradient.fill(0.0);
        let nested = grid.has_nested();
        if nested {
            self.omega.fill(0.0);
        }
        let mut full: Gradient;
        for (i, point) in grid.points.iter().enumerate().rev() {
            let sample = self.recorded(point);
            if sample.is_none() && !nested {
                continue;
            }
            full = [0.0; 2 * MAX_SIZE];
            if let Some(k) = sample {
                let pull = -self.weight[k] * self.residual[k];
                let own = self.of_sample(Output::Measured, k, columns.len());
                let own = own.iter().zip(columns);
                own.for_each(|(value, c)| full[*c] += pull * value);
            }
            if nested && point.collocated {
                let omega = &self.omega[i * n..(i + 1) * n];
                let jacobian = &self.jacobian[i * entries..(i + 1) * entries];
                for (value, &(l, c)) in jacobian.iter().zip(&model.entries) {
                    full[c] += omega[l] * value;
                }
            }
            axpy(1.0, &full[n..n + self.p], &mut self.theta_gradient);
            match &point.state {
                PointState::Node(k) => axpy(1.0, &full[..n], &mut out[k * n..(k + 1) * n]),
                PointState::Combination(c) => distribute(c, &full[..n], out, &mut self.omega),
            }
        }
    }

    /// Rows `S` of a point.
    pub(super) fn s_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.s, &self.combined.s, self.n * self.w)
    }

    pub(super) fn e_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.e, &self.combined.e, self.n)
    }

    fn dx_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.dx, &self.combined.dx, self.n)
    }

    /// The sample at a point, where its output is recorded.
    #[inline(always)]
    pub(super) fn recorded(&self, point: &Point) -> Option<usize> {
        let sample = point.sample.map(|k| k as usize);
        sample.filter(|k| self.weight[*k] != 0.0)
    }

    /// A sample's gradient of an output with `count` columns.
    #[inline(always)]
    pub(super) fn of_sample(&self, output: Output, sample: usize, count: usize) -> &[f64] {
        &self.gradients[output as usize][sample * count..(sample + 1) * count]
    }

    /// Writes point `i`'s `g + W [δx; δθ]` into `out` (the first n + p); false when that is zero.
    #[inline(always)]
    pub(super) fn model_gradient<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        i: usize,
        kind: Hessian,
        step: &Gradient,
        out: &mut Gradient,
    ) -> bool {
        let model = &at.problem.model;
        let sample = self.recorded(&at.problem.grids[at.j].points[i]);
        let curved = kind == Hessian::Exact && !model.pairs.is_empty();
        if sample.is_none() && !curved {
            return false;
        }
        *out = [0.0; 2 * MAX_SIZE];
        if let Some(k) = sample {
            let columns = model.columns(Output::Measured);
            let own = self.of_sample(Output::Measured, k, columns.len());
            let along = self.along(own, columns, step);
            let factor = self.weight[k] * (along - self.residual[k]);
            let own = own.iter().zip(columns);
            own.for_each(|(value, c)| out[*c] += factor * value);
        }
        if curved {
            let pairs = model.pairs.len();
            let values = &self.second[i * pairs..(i + 1) * pairs];
            for (w, &(a, b)) in values.iter().zip(&model.pairs) {
                out[a] += w * step[b];
                if a != b {
                    out[b] += w * step[a];
                }
            }
        }
        true
    }

    /// A gradient's product with a step.
    #[inline(always)]
    fn along(&self, gradient: &[f64], columns: &[usize], step: &Gradient) -> f64 {
        let own = gradient.iter().zip(columns);
        own.map(|(value, c)| value * step[*c]).sum()
    }

    /// Row of the bounded signal at a sample: its coefficients over the reduced variables, and its
    /// change by the offsets alone.
    pub fn bounded_row(&self, sample: usize) -> (&[f64], f64) {
        let row = &self.bounded.s[sample * self.w..][..self.r()];
        (row, self.bounded.e[sample])
    }

    /// Linear change of the bounded signal at a sample by the last expanded step.
    pub fn bounded_change<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        sample: usize,
        dtheta: &[f64],
    ) -> f64 {
        let (n, grid) = (self.n, &at.problem.grids[at.j]);
        let columns = at.problem.model.columns(Output::Bounded);
        let dx = self.dx_of(&grid.points[grid.observed[sample]].state);
        let own = self.of_sample(Output::Bounded, sample, columns.len());
        let step = |c: usize| if c < n { dx[c] } else { dtheta[c - n] };
        own.iter()
            .zip(columns)
            .map(|(value, c)| value * step(*c))
            .sum()
    }

    /// Writes the linear changes of the bounded signal at all samples for these reduced variables into
    /// `bounded.dx`, and returns them.
    pub fn bounded_changes(&mut self, rho: &[f64]) -> &[f64] {
        let mut padded = rho.to_vec();
        padded.resize(self.w, 0.0);
        lanes::run(self.w, Expand(&mut self.bounded, &padded));
        &self.bounded.dx
    }

    /// All steps from the reduced variables, into the rows' `dx`.
    pub fn expand(&mut self, rho: &[f64]) {
        let mut padded = rho.to_vec();
        padded.resize(self.w, 0.0);
        lanes::run(self.w, Expand(&mut self.nodes, &padded));
        lanes::run(self.w, Expand(&mut self.combined, &padded));
    }

    /// The bounded signal's offsets from those of the unknowns and points.
    pub(super) fn offset_bounded<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
    ) {
        let (n, columns) = (self.n, at.problem.model.columns(Output::Bounded));
        let grid: &Grid = &at.problem.grids[at.j];
        for (k, point) in grid.observed.iter().enumerate() {
            let own = self.of_sample(Output::Bounded, k, columns.len());
            let e = self.e_of(&grid.points[*point].state);
            let own = own.iter().zip(columns).filter(|(_, c)| **c < n);
            self.bounded.e[k] = own.map(|(value, c)| value * e[*c]).sum();
        }
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
        let curvature = self.step_gradient(at, kind, (dtheta, eta));
        self.eliminate_backward(at, stencils, lambda);
        curvature
    }

    /// Writes the derivatives of the Lagrangian's model at the last expanded step, but for the defects'
    /// part, into `right`; returns the part of `dᵀHd`.
    #[inline(always)]
    fn step_gradient<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        kind: Hessian,
        (dtheta, eta): (&[f64], &[f64]),
    ) -> f64 {
        let (n, model) = (self.n, &at.problem.model);
        let (grid, entries) = (&at.problem.grids[at.j], model.entries.len());
        let [measured, bounded] = [Output::Measured, Output::Bounded].map(|o| model.columns(o));
        let (mut right, mut omega) = (
            std::mem::take(&mut self.right),
            std::mem::take(&mut self.omega),
        );
        right.fill(0.0);
        let nested = grid.has_nested();
        if nested {
            omega.fill(0.0);
        }
        let mut step: Gradient = [0.0; 2 * MAX_SIZE];
        step[n..n + self.p].copy_from_slice(dtheta);
        let mut full: Gradient = [0.0; 2 * MAX_SIZE];
        let mut curvature = 0.0;
        for (i, point) in grid.points.iter().enumerate().rev() {
            step[..n].copy_from_slice(self.dx_of(&point.state));
            if self.model_gradient(at, i, kind, &step, &mut full) {
                curvature += dot(&full[..n + self.p], &step[..n + self.p]);
                if let Some(k) = self.recorded(point) {
                    // The objective's gradient is in `full`, and no part of the Hessian.
                    let own = self.of_sample(Output::Measured, k, measured.len());
                    let along = self.along(own, measured, &step);
                    curvature += self.weight[k] * self.residual[k] * along;
                }
            } else {
                full[..n].fill(0.0);
            }
            let sample = point.sample.map(|k| k as usize);
            if let Some(k) = sample.filter(|k| eta[*k] != 0.0) {
                let own = self.of_sample(Output::Bounded, k, bounded.len());
                let own = own.iter().zip(bounded);
                own.for_each(|(value, c)| full[*c] += eta[k] * value);
            }
            if nested && point.collocated {
                let jacobian = &self.jacobian[i * entries..(i + 1) * entries];
                let own = jacobian.iter().zip(&model.entries[..model.state_entries]);
                for (value, &(l, c)) in own {
                    full[c] += omega[i * n + l] * value;
                }
            }
            match &point.state {
                PointState::Node(k) => axpy(1.0, &full[..n], &mut right[k * n..(k + 1) * n]),
                PointState::Combination(c) => distribute(c, &full[..n], &mut right, &mut omega),
            }
        }
        (self.right, self.omega) = (right, omega);
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

/// `dx = S ρ + e` of these rows, for padded reduced variables.
struct Expand<'a>(&'a mut Rows, &'a [f64]);

impl Kernel for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const W: usize>(self) {
        let Self(rows, rho) = self;
        let rho = rho.first_chunk::<W>().expect("padded");
        let (s, _) = rows.s.as_chunks::<W>();
        for ((dx, s), e) in rows.dx.iter_mut().zip(s).zip(&rows.e) {
            // Four sums at once: a product of rows is otherwise one chain of additions.
            let mut sums = [0.0; LANES];
            for (s, rho) in s.chunks_exact(LANES).zip(rho.chunks_exact(LANES)) {
                for ((sum, s), rho) in sums.iter_mut().zip(s).zip(rho) {
                    *sum += s * rho;
                }
            }
            *dx = e + ((sums[0] + sums[1]) + (sums[2] + sums[3]));
        }
    }
}
