//! The NLP that collocation makes of several runs with shared parameters (paper, eq. 5).

use super::constraints::ParameterConstraints;
use super::layout::Layout;
use super::mesh::Run;
use super::node::{NodeModel, Scales};
use super::scheme::Scheme;
use crate::sqp::Problem;
use num_dual::HyperDual64;
use pilotage_models::Dynamics;

/// Collocation of runs of one model with shared parameters θ.
///
/// Variables and defects are scaled by [`Scales`]; the objective is `Σ_j w_j Σ_k (y_k - h(x_k))²` in
/// the output's unit squared.
#[derive(Debug, Clone)]
pub struct Collocation<D, C> {
    /// The model at a node.
    pub model: NodeModel<D>,
    /// Constraints on θ.
    pub constraints: C,
    /// The scheme.
    pub scheme: &'static Scheme,
    /// The runs.
    pub runs: Vec<Run>,
    /// Where everything stands.
    pub layout: Layout,
    constraint_scales: Vec<f64>,
    limits: (Vec<f64>, Vec<f64>),
    damping_weights: Vec<f64>,
}

impl<D: Dynamics, C: ParameterConstraints> Collocation<D, C> {
    /// The NLP of these runs, with the model's bounded signal within `± limit` at every boundary.
    pub fn new(
        dynamics: D,
        constraints: C,
        scheme: &'static Scheme,
        runs: Vec<Run>,
        scales: Scales,
        limit: f64,
    ) -> Self {
        let model = NodeModel::new(dynamics, scales);
        let (n, p) = (model.n_states(), model.n_parameters());
        let layout = Layout::new(&runs, n, scheme.unknown_nodes());
        let path = layout.parameter_constraints;
        let mut lower = vec![-limit; path];
        let mut upper = vec![limit; path];
        lower.extend(vec![0.0; constraints.count()]);
        upper.extend(vec![f64::INFINITY; constraints.count()]);
        let mut damping_weights = vec![0.0; layout.theta];
        for (run, at) in runs.iter().zip(&layout.runs) {
            for (i, known) in run.initial.iter().enumerate() {
                damping_weights[at.z + i] = f64::from(known.is_none());
            }
        }
        damping_weights.extend(vec![1.0; p]);
        let mut reference = vec![0.0; constraints.count()];
        constraints.values(&model.scales.parameters, &mut reference);
        Self {
            constraint_scales: reference.iter().map(|v| v.abs().max(1e-3)).collect(),
            limits: (lower, upper),
            damping_weights,
            model,
            constraints,
            scheme,
            runs,
            layout,
        }
    }

    /// Number of states of the model.
    pub fn n_states(&self) -> usize {
        self.model.n_states()
    }

    /// Number of parameters of the model.
    pub fn n_parameters(&self) -> usize {
        self.model.n_parameters()
    }

    /// The scaled states of node `k` of run `j`.
    pub fn node<'z>(&self, z: &'z [f64], j: usize, k: usize) -> &'z [f64] {
        let start = self.layout.runs[j].z + k * self.n_states();
        &z[start..start + self.n_states()]
    }

    /// The scaled parameters.
    pub fn theta<'z>(&self, z: &'z [f64]) -> &'z [f64] {
        &z[self.layout.theta..]
    }

    /// Parameters in their units.
    pub fn physical_theta(&self, z: &[f64]) -> Vec<f64> {
        self.theta(z)
            .iter()
            .zip(&self.model.scales.parameters)
            .map(|(t, s)| t * s)
            .collect()
    }

    /// Interval and fraction of the interval at which node `k` lies.
    pub fn place(&self, j: usize, k: usize) -> (usize, f64) {
        let s = self.scheme.unknown_nodes();
        match k / s {
            interval if interval == self.runs[j].intervals() => (interval, 0.0),
            interval => (interval, self.scheme.abscissae[k % s]),
        }
    }

    /// The recorded value at node `k` of run `j`; None where there is none.
    pub fn sample(&self, j: usize, k: usize) -> Option<f64> {
        let s = self.scheme.unknown_nodes();
        let sample = k.is_multiple_of(s).then(|| self.runs[j].measured[k / s])?;
        sample.is_finite().then_some(sample)
    }

    /// Defects of one interval: `X_i - X_0 - h Σ a_ij f(X_j)`, from the states `x` and derivatives
    /// `f` of its nodes.
    pub(super) fn defects(&self, h: f64, x: &[f64], f: &[f64], out: &mut [f64]) {
        let n = self.n_states();
        for (i, (row, out)) in self
            .scheme
            .weights
            .iter()
            .zip(out.chunks_exact_mut(n))
            .enumerate()
        {
            for (l, value) in out.iter_mut().enumerate() {
                let sum: f64 = row.iter().enumerate().map(|(j, a)| a * f[j * n + l]).sum();
                *value = x[(i + 1) * n + l] - x[l] - h * sum;
            }
        }
    }

    /// Objective, defects and bounded signals of one run.
    fn evaluate_run(&self, z: &[f64], j: usize, c: &mut [f64], g: &mut [f64]) -> f64 {
        let (n, s) = (self.n_states(), self.scheme.unknown_nodes());
        let (run, at) = (&self.runs[j], self.layout.runs[j]);
        let mut row = at.c;
        for (i, known) in run.initial.iter().enumerate() {
            if let Some(value) = known {
                c[row] = z[at.z + i] - value / self.model.scales.states[i];
                row += 1;
            }
        }
        let mut input = vec![0.0; self.model.dynamics.n_inputs()];
        let mut f = vec![0.0; n * at.nodes];
        let mut squares = 0.0;
        for (k, f) in f.chunks_exact_mut(n).enumerate() {
            let (interval, fraction) = self.place(j, k);
            run.inputs_at(interval, fraction, &mut input);
            let (measured, bounded) =
                self.model
                    .values(self.node(z, j, k), &input, self.theta(z), f);
            if let Some(sample) = self.sample(j, k) {
                squares += (sample - measured).powi(2);
            }
            if k % s == 0 {
                g[at.g + k / s] = bounded;
            }
        }
        for i in 0..run.intervals() {
            let nodes = i * s * n..(i + 1) * s * n + n;
            let x = &z[at.z + nodes.start..at.z + nodes.end];
            let rows = row + i * s * n..row + (i + 1) * s * n;
            self.defects(run.step(i), x, &f[nodes], &mut c[rows]);
        }
        run.weight * squares
    }

    /// Scaled values of the constraints on θ.
    pub(super) fn constraint_values(&self, theta: &[f64], out: &mut [f64]) {
        let physical: Vec<f64> = theta
            .iter()
            .zip(&self.model.scales.parameters)
            .map(|(t, s)| t * s)
            .collect();
        self.constraints.values(&physical, out);
        out.iter_mut()
            .zip(&self.constraint_scales)
            .for_each(|(v, s)| *v /= s);
    }

    /// Scaled first and second derivatives of the constraints on θ with respect to θ̄_i and θ̄_j.
    pub(super) fn constraint_derivatives(
        &self,
        theta: &[f64],
        i: usize,
        j: usize,
    ) -> Vec<HyperDual64> {
        let scales = &self.model.scales.parameters;
        let mut physical: Vec<HyperDual64> = theta
            .iter()
            .zip(scales)
            .map(|(t, s)| HyperDual64::from(t * s))
            .collect();
        physical[i].eps1 = scales[i];
        physical[j].eps2 = scales[j];
        let mut out = vec![HyperDual64::from(0.0); self.constraints.count()];
        self.constraints.values(&physical, &mut out);
        out.iter()
            .zip(&self.constraint_scales)
            .map(|(v, s)| *v / *s)
            .collect()
    }
}

impl<D: Dynamics, C: ParameterConstraints> Problem for Collocation<D, C> {
    fn n_variables(&self) -> usize {
        self.layout.theta + self.n_parameters()
    }

    fn n_equalities(&self) -> usize {
        self.layout.n_equalities
    }

    fn limits(&self) -> (&[f64], &[f64]) {
        (&self.limits.0, &self.limits.1)
    }

    fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64 {
        let objective = (0..self.runs.len())
            .map(|j| self.evaluate_run(z, j, c, g))
            .sum();
        self.constraint_values(self.theta(z), &mut g[self.layout.parameter_constraints..]);
        objective
    }

    fn damping_weights(&self) -> &[f64] {
        &self.damping_weights
    }
}
