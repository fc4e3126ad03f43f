//! Sweeps over a run's points: derivatives, and gradients of the Lagrangian and of its model.

use super::points::{Gradients, Points, ZERO, add_at, along};
use super::run::{Place, RunSweep};
use crate::Collocation;
use crate::collocation::PointValues;
use crate::constraints::ParameterConstraints;
use crate::lanes::{self, LANES, Lanes, Task, plus, side_by_side, times};
use crate::node::{MAX_SIZE, NodeModel, Output, Weights};
use pilotage_models::Dynamics;
use pilotage_sqp::Hessian;

impl RunSweep {
    /// Derivatives and residuals at the points, in a reverse sweep that adds their part of `∇L` to
    /// `lagrangian` and `theta_lagrangian`.
    pub(super) fn differentiate<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        z: &[f64],
        eta: &[f64],
        exact: bool,
        lagrangian: &mut [f64],
    ) {
        let values = at.problem.point_states(z, at.j);
        lanes::vectorised(Differentiate {
            own: self,
            at,
            z,
            values: &values,
            eta,
            exact,
            lagrangian,
        });
    }

    /// Takes the residuals of a group of points with these measured outputs; returns the derivatives of
    /// the objective by these.
    #[inline(always)]
    fn take_residuals<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        points: &Points<'_>,
        measured: Lanes,
    ) -> Lanes {
        let (residual, weight) = (
            &mut self.residual.group_mut(points.number)[0],
            &mut self.weight.group_mut(points.number)[0],
        );
        let twice = 2.0 * at.problem.runs[at.j].weight;
        for (lane, sample) in points.samples() {
            let recorded = at.problem.recorded(at.j, sample as u32);
            residual[lane] = recorded.map_or(0.0, |value| value - measured[lane]);
            weight[lane] = recorded.map_or(0.0, |_| twice);
        }
        times(*weight, *residual).map(|v| -v)
    }

    /// Writes the objective's gradient with respect to the unknowns into `out`, and that of θ into
    /// `theta_gradient`.
    pub(super) fn objective_gradient<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        self.theta_gradient.fill(0.0);
        lanes::vectorised(ObjectiveGradient { own: self, at, out });
    }

    /// Adds the derivatives of `ωᵀ f̄` at a group of points, for these entries of the Jacobian.
    #[inline(always)]
    fn pull_back(&self, points: &Points<'_>, entries: &[(usize, usize)], out: &mut Gradients) {
        let n = self.n;
        let mut weights = [[0.0; LANES]; MAX_SIZE];
        side_by_side(
            points.members.map(|i| &self.omega[i * n..]),
            &mut weights[..n],
        );
        let own = self.jacobian.group(points.number).iter().zip(entries);
        own.for_each(|(value, &(l, c))| out[c] = plus(out[c], weights[l], *value));
    }

    /// Writes a group of points' `g + W [δx; δθ]` into `out` (the first n + p).
    #[inline(always)]
    pub(super) fn model_gradient<D>(
        &self,
        model: &NodeModel<D>,
        group: usize,
        kind: Hessian,
        step: &Gradients,
        out: &mut Gradients,
    ) {
        let columns = &model.outputs[Output::Measured as usize];
        let own = self.gradients[Output::Measured as usize].group(group);
        let (weight, residual) = (self.weight.group(group)[0], self.residual.group(group)[0]);
        let change = along(columns, own, step);
        let factor = times(weight, plus(change, [-1.0; LANES], residual));
        out[..self.n + self.p].fill([0.0; LANES]);
        add_at(columns, factor, own, out);
        if kind == Hessian::Exact {
            for (w, &(a, b)) in self.second.group(group).iter().zip(&model.pairs) {
                out[a] = plus(out[a], *w, step[b]);
                if a != b {
                    out[b] = plus(out[b], *w, step[a]);
                }
            }
        }
    }

    /// Writes the derivatives of the Lagrangian's model at the last expanded step, but for the defects'
    /// part, into `right`; returns the part of `dᵀHd`.
    pub fn step_gradient<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        kind: Hessian,
        (dtheta, eta): (&[f64], &[f64]),
    ) -> f64 {
        let (mut right, mut omega) = (
            std::mem::take(&mut self.right),
            std::mem::take(&mut self.omega),
        );
        right.fill(0.0);
        if at.problem.grids[at.j].has_nested() {
            omega.fill(0.0);
        }
        self.omega = omega;
        let curvature = lanes::vectorised(StepGradient {
            own: self,
            at,
            kind,
            dtheta,
            eta,
            right: &mut right,
        });
        self.right = right;
        curvature
    }
}

/// [`RunSweep::differentiate`], given the states of combinations.
struct Differentiate<'a, D, C> {
    own: &'a mut RunSweep,
    at: Place<'a, D, C>,
    z: &'a [f64],
    values: &'a PointValues,
    eta: &'a [f64],
    exact: bool,
    lagrangian: &'a mut [f64],
}

impl<D: Dynamics, C: ParameterConstraints> Task for Differentiate<'_, D, C> {
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
        let mut derivatives = model.derivatives(at.problem.theta(z), exact);
        own.theta_lagrangian.fill(0.0);
        let mut weights = [[0.0; LANES]; MAX_SIZE];
        let (mut outputs, mut full) = (ZERO, ZERO);
        for points in Points::all(grid).rev() {
            let x = points.members.map(|i| values.states(grid, v, i, n));
            let input = points.members.map(|i| at.problem.inputs_at(at.j, i));
            let (measured, _) = derivatives.evaluate(x, input);
            let pull = own.take_residuals(at, &points, measured);
            let push = points.of_samples(eta);
            outputs[..n + p].fill([0.0; LANES]);
            for (output, factor) in [(Output::Measured, pull), (Output::Bounded, push)] {
                let gradient = own.gradients[output as usize].group_mut(points.number);
                derivatives.gradient(output, gradient);
                add_at(model.columns(output), factor, gradient, &mut outputs);
            }
            let jacobian = own.jacobian.group_mut(points.number);
            derivatives.jacobian(jacobian);
            for lanes in points.turns(nested) {
                side_by_side(
                    points.members.map(|i| &own.omega[i * n..]),
                    &mut weights[..n],
                );
                full[..n + p].copy_from_slice(&outputs[..n + p]);
                derivatives.pull_back(jacobian, &weights[..n], &mut full);
                points.add_parameters(lanes.clone(), &full[n..n + p], &mut own.theta_lagrangian);
                points.distribute(lanes, &full[..n], lagrangian, &mut own.omega);
            }
            if exact {
                let weights = Weights {
                    f: &weights[..n],
                    measured: pull,
                    bounded: push,
                };
                derivatives.second_order(weights, own.second.group_mut(points.number));
            }
        }
    }
}

/// [`RunSweep::objective_gradient`], added to zeros.
struct ObjectiveGradient<'a, D, C> {
    own: &'a mut RunSweep,
    at: Place<'a, D, C>,
    out: &'a mut [f64],
}

impl<D: Dynamics, C: ParameterConstraints> Task for ObjectiveGradient<'_, D, C> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { own, at, out } = self;
        let Collocation { model, grids, .. } = at.problem;
        let (n, p, grid) = (own.n, own.p, &grids[at.j]);
        let columns = model.columns(Output::Measured);
        let nested = grid.has_nested();
        if nested {
            own.omega.fill(0.0);
        }
        let (mut outputs, mut full) = (ZERO, ZERO);
        for points in Points::all(grid).rev() {
            let pull = times(
                own.weight.group(points.number)[0],
                own.residual.group(points.number)[0],
            );
            let gradient = own.gradients[Output::Measured as usize].group(points.number);
            outputs[..n + p].fill([0.0; LANES]);
            add_at(columns, pull.map(|v| -v), gradient, &mut outputs);
            for lanes in points.turns(nested) {
                full[..n + p].copy_from_slice(&outputs[..n + p]);
                if nested {
                    own.pull_back(&points, &model.entries, &mut full);
                }
                points.add_parameters(lanes.clone(), &full[n..n + p], &mut own.theta_gradient);
                points.distribute(lanes, &full[..n], out, &mut own.omega);
            }
        }
    }
}

/// [`RunSweep::step_gradient`], added to zeros.
struct StepGradient<'a, D, C> {
    own: &'a mut RunSweep,
    at: Place<'a, D, C>,
    kind: Hessian,
    dtheta: &'a [f64],
    eta: &'a [f64],
    right: &'a mut [f64],
}

impl<D: Dynamics, C: ParameterConstraints> Task for StepGradient<'_, D, C> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
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
        let [measured, bounded] = [Output::Measured, Output::Bounded];
        let nested = grid.has_nested();
        let mut step = ZERO;
        let parameters = step[n..n + p].iter_mut().zip(dtheta);
        parameters.for_each(|(out, v)| *out = [*v; LANES]);
        let (mut outputs, mut full) = (ZERO, ZERO);
        let mut curvature = [0.0; LANES];
        for points in Points::all(grid).rev() {
            points.states(&own.nodes.dx, &own.combined.dx, n, &mut step);
            own.model_gradient(model, points.number, kind, &step, &mut outputs);
            // The objective's gradient is among them, and no part of the Hessian.
            let gradient = own.gradients[measured as usize].group(points.number);
            let change = along(model.columns(measured), gradient, &step);
            let pull = times(
                own.weight.group(points.number)[0],
                own.residual.group(points.number)[0],
            );
            let mut sum = times(pull, change);
            for (gradient, step) in outputs[..n + p].iter().zip(&step) {
                sum = plus(sum, *gradient, *step);
            }
            let counting = curvature[..points.count].iter_mut().zip(sum);
            counting.for_each(|(curvature, sum)| *curvature += sum);
            let push = points.of_samples(eta);
            if push != [0.0; LANES] {
                let gradient = own.gradients[bounded as usize].group(points.number);
                add_at(model.columns(bounded), push, gradient, &mut outputs);
            }
            for lanes in points.turns(nested) {
                full[..n].copy_from_slice(&outputs[..n]);
                if nested {
                    own.pull_back(&points, &model.entries[..model.state_entries], &mut full);
                }
                points.distribute(lanes, &full[..n], right, &mut own.omega);
            }
        }
        curvature.iter().sum()
    }
}
