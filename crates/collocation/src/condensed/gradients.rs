//! Sweeps over the points of a run: derivatives, and gradients of the Lagrangian and of its quadratic model.

use super::points::{Points, add_at, along, zeros};
use super::run::{Place, RunSweep};
use crate::Collocation;
use crate::collocation::PointValues;
use crate::node::{NodeModel, pull_back};
use crate::simd::{self, LANES, Lanes, Task, plus, select, side_by_side, times};
use pilotage_sqp::Hessian;

impl RunSweep {
    /// Derivatives and residuals at the points, in a reverse sweep that adds their contribution to `∇L` to `lagrangian`
    /// and `theta_lagrangian`.
    pub(super) fn differentiate(
        &mut self,
        at: Place<'_>,
        z: &[f64],
        eta: &[f64],
        exact: bool,
        lagrangian: &mut [f64],
    ) {
        let values = at.problem.point_states(z, at.j);
        simd::vectorised(Differentiate {
            own: self,
            at,
            z,
            values: &values,
            eta,
            exact,
            lagrangian,
        });
    }

    /// Computes the residuals of a group of points from these outputs. Replaces the outputs by the derivatives of the
    /// Lagrangian with respect to them: from the residuals for measured outputs, from the multipliers `eta` for bounded
    /// ones.
    #[inline(always)]
    fn weigh(&mut self, at: Place<'_>, points: &Points<'_>, eta: &[f64], outputs: &mut [Lanes]) {
        let count = at.problem.layout.runs[at.j].samples;
        let samples = points.samples_of();
        let (measured, bounded) = outputs.split_at_mut(at.problem.measured);
        for (k, output) in measured.iter_mut().enumerate() {
            let own = &at.problem.runs[at.j].measured[k];
            let recorded = own.at(samples);
            let is_missing = recorded.map(f64::is_nan);
            let differences = plus(recorded, [-1.0; LANES], *output);
            let residual = select(is_missing, [0.0; LANES], differences);
            self.residual.group_mut(points.number)[k] = residual;
            let twice = select(is_missing, [0.0; LANES], [2.0 * own.weight; LANES]);
            let weight = &mut self.weight.group_mut(points.number)[k];
            *weight = twice;
            if let Some(beyond) = &mut self.beyond {
                let halves = residual.map(|r| own.loss.halved(r));
                *weight = times(twice, halves.map(|half| half.weight));
                let beyond = &mut beyond.group_mut(points.number)[2 * k..];
                beyond[0] = times(twice, halves.map(|half| half.slope));
                beyond[1] = times(twice, halves.map(|half| half.curvature));
            }
            *output = self.pull(points.number, k);
        }
        for (output, eta) in bounded.iter_mut().zip(eta.chunks_exact(count)) {
            *output = points.of_samples(eta);
        }
    }

    /// Difference of slope and curvature between the losses of a measured output and squares, for a group.
    #[inline(always)]
    pub(super) fn beyond(&self, group: usize, k: usize) -> Option<(Lanes, Lanes)> {
        let own = &self.beyond.as_ref()?.group(group)[2 * k..];
        Some((own[0], own[1]))
    }

    /// Derivatives of the objective with respect to a measured output at a group of points.
    #[inline(always)]
    pub(super) fn pull(&self, group: usize, k: usize) -> Lanes {
        let (weight, residual) = (self.weight.group(group)[k], self.residual.group(group)[k]);
        let pull = times(weight, residual).map(|v| -v);
        match self.beyond(group, k) {
            Some((slope, _)) => plus(pull, [1.0; LANES], slope),
            None => pull,
        }
    }

    /// Adds the derivatives of `ωᵀ f̄` at a group of points, for these entries of the Jacobian.
    #[inline(always)]
    fn pull_back(&self, points: &Points<'_>, entries: &[(usize, usize)], out: &mut [Lanes]) {
        let n = self.n;
        let weights = points.members.map(|i| &self.omega[i * n..(i + 1) * n]);
        let jacobian = self.jacobian.group(points.number);
        pull_back(entries, jacobian, |l| weights.map(|w| w[l]), out);
    }

    /// Writes `g + W [δx; δθ]` of a group of points into `out` (the first n + p).
    #[inline(always)]
    pub(super) fn model_gradient(
        &self,
        model: &NodeModel,
        group: usize,
        kind: Hessian,
        step: &[Lanes],
        out: &mut [Lanes],
    ) {
        out.fill([0.0; LANES]);
        let weights = self
            .weight
            .group(group)
            .iter()
            .zip(self.residual.group(group));
        for (k, (weight, residual)) in weights.enumerate() {
            let (columns, own) = (model.columns(k), self.gradients[k].group(group));
            let change = along(columns, own, step);
            let mut factor = times(*weight, plus(change, [-1.0; LANES], *residual));
            if let Some((slope, curvature)) = self.beyond(group, k) {
                factor = plus(factor, [1.0; LANES], slope);
                if kind == Hessian::Exact {
                    factor = plus(factor, curvature, change);
                }
            }
            add_at(columns, factor, own, out);
        }
        if kind == Hessian::Exact {
            for (w, &(a, b)) in self.second.group(group).iter().zip(&model.pairs) {
                out[a] = plus(out[a], *w, step[b]);
                if a != b {
                    out[b] = plus(out[b], *w, step[a]);
                }
            }
        }
    }

    /// Writes the derivatives of the model of the Lagrangian at the last expanded step, without the contribution of the
    /// defects, into `right`. Returns the contributions to `∇fᵀd` and `dᵀHd`.
    pub fn step_gradient(
        &mut self,
        at: Place<'_>,
        kind: Hessian,
        (dtheta, eta): (&[f64], &[f64]),
    ) -> [f64; 2] {
        let (mut right, mut omega) = (
            std::mem::take(&mut self.right),
            std::mem::take(&mut self.omega),
        );
        right.fill(0.0);
        if at.problem.grids[at.j].has_nested() {
            omega.fill(0.0);
        }
        self.omega = omega;
        let sums = simd::vectorised(StepGradient {
            own: self,
            at,
            kind,
            dtheta,
            eta,
            right: &mut right,
        });
        self.right = right;
        sums
    }
}

/// The task of [`RunSweep::differentiate`], given the states of combinations.
struct Differentiate<'a> {
    own: &'a mut RunSweep,
    at: Place<'a>,
    z: &'a [f64],
    values: &'a PointValues,
    eta: &'a [f64],
    exact: bool,
    lagrangian: &'a mut [f64],
}

impl Task for Differentiate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            own,
            at,
            z,
            values,
            eta,
            exact,
            lagrangian,
        } = self;
        let Collocation { model, grids, .. } = at.problem;
        let (n, p, grid) = (own.n, own.p, &grids[at.j]);
        let v = at.problem.coefficients(z, at.j);
        let nested = grid.has_nested();
        let mut derivatives = model.derivatives(at.problem.theta(z));
        own.theta_lagrangian.fill(0.0);
        let mut weights = vec![[0.0; LANES]; n];
        let mut factors = vec![[0.0; LANES]; model.n_outputs()];
        let (mut outputs, mut full) = (zeros(own), zeros(own));
        for points in Points::all(grid).rev() {
            let x = points.members.map(|i| values.states(grid, v, i, n));
            let input = points.members.map(|i| at.problem.inputs_at(at.j, i));
            derivatives.evaluate(x, input, &mut factors);
            own.weigh(at, &points, eta, &mut factors);
            outputs.fill([0.0; LANES]);
            for (k, factor) in factors.iter().enumerate() {
                let gradient = own.gradients[k].group_mut(points.number);
                derivatives.gradient(k, gradient);
                add_at(model.columns(k), *factor, gradient, &mut outputs);
            }
            let jacobian = own.jacobian.group_mut(points.number);
            derivatives.jacobian(jacobian);
            for lanes in points.turns(nested) {
                side_by_side(points.members.map(|i| &own.omega[i * n..]), &mut weights);
                if nested {
                    full.copy_from_slice(&outputs);
                } else {
                    std::mem::swap(&mut full, &mut outputs);
                }
                pull_back(&model.entries, jacobian, |l| weights[l], &mut full);
                points.add_parameters(lanes.clone(), &full[n..n + p], &mut own.theta_lagrangian);
                points.distribute(lanes, &full[..n], lagrangian, &mut own.omega);
            }
            if exact {
                let second = own.second.group_mut(points.number);
                derivatives.second_order(&weights, &factors, second);
            }
        }
    }
}

/// The task of [`RunSweep::step_gradient`], added to zeros.
struct StepGradient<'a> {
    own: &'a mut RunSweep,
    at: Place<'a>,
    kind: Hessian,
    dtheta: &'a [f64],
    eta: &'a [f64],
    right: &'a mut [f64],
}

impl Task for StepGradient<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        let Self {
            own,
            at,
            kind,
            dtheta,
            eta,
            right,
        } = self;
        let Collocation { model, grids, .. } = at.problem;
        let (n, p, grid) = (own.n, own.p, &grids[at.j]);
        let (measured, samples) = (at.problem.measured, at.problem.layout.runs[at.j].samples);
        let nested = grid.has_nested();
        let mut step = zeros(own);
        let parameters = step[n..n + p].iter_mut().zip(dtheta);
        parameters.for_each(|(out, v)| *out = [*v; LANES]);
        let (mut outputs, mut full) = (zeros(own), zeros(own));
        let (mut slope, mut curvature) = (0.0, 0.0);
        for points in Points::all(grid).rev() {
            points.states(&own.nodes.dx, &own.combined.dx, n, &mut step);
            own.model_gradient(model, points.number, kind, &step, &mut outputs);
            let mut along_gradient = [0.0; LANES];
            for k in 0..measured {
                let gradient = own.gradients[k].group(points.number);
                let change = along(model.columns(k), gradient, &step);
                along_gradient = plus(along_gradient, own.pull(points.number, k), change);
            }
            let mut sum = [0.0; LANES];
            for (gradient, step) in outputs[..n + p].iter().zip(&step) {
                sum = plus(sum, *gradient, *step);
            }
            for lane in 0..points.count {
                slope += along_gradient[lane];
                // These include the gradient of the objective, which is not part of the Hessian.
                curvature += sum[lane] - along_gradient[lane];
            }
            for (k, eta) in eta.chunks_exact(samples).enumerate() {
                let push = points.of_samples(eta);
                if push != [0.0; LANES] {
                    let gradient = own.gradients[measured + k].group(points.number);
                    add_at(model.columns(measured + k), push, gradient, &mut outputs);
                }
            }
            for lanes in points.turns(nested) {
                let mut gradients = &outputs;
                if nested {
                    full[..n].copy_from_slice(&outputs[..n]);
                    own.pull_back(&points, &model.entries[..model.state_entries], &mut full);
                    gradients = &full;
                }
                points.distribute(lanes, &gradients[..n], right, &mut own.omega);
            }
        }
        [slope, curvature]
    }
}
