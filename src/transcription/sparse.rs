//! The collocation problem with sparse derivatives, for the general QP path
//! ([`SparseQp`](crate::sqp::SparseQp)). It is written from the defects' definition, apart from the
//! sweeps of [`Condensed`](super::Condensed), so that each checks the other.

use super::Collocation;
use super::constraints::ParameterConstraints;
use super::node::{FirstOrder, Weights};
use crate::sqp::problem::Pattern;
use crate::sqp::{Hessian, SparseProblem};
use pilotage_models::Dynamics;

/// Pairs `i ≤ j` of `0..v`: the upper triangle, row by row.
fn upper_triangle(v: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..v).flat_map(move |i| (i..v).map(move |j| (i, j)))
}

impl<D: Dynamics, C: ParameterConstraints> Collocation<D, C> {
    /// All nodes `(run, node)`, in the order of their variables.
    fn nodes(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (self.layout.runs.iter().enumerate())
            .flat_map(|(j, run)| (0..run.nodes).map(move |k| (j, k)))
    }

    /// Column in `z` of variable `v` of a node's `[x̄; θ̄]`.
    fn column(&self, j: usize, k: usize, v: usize) -> usize {
        let n = self.n_states();
        match v < n {
            true => self.layout.runs[j].z + k * n + v,
            false => self.layout.theta + v - n,
        }
    }

    /// Exogenous inputs at a node.
    fn node_input(&self, j: usize, k: usize) -> Vec<f64> {
        let mut input = vec![0.0; self.model.dynamics.n_inputs()];
        let (interval, fraction) = self.place(j, k);
        self.runs[j].inputs_at(interval, fraction, &mut input);
        input
    }

    fn node_first_order(&self, z: &[f64], j: usize, k: usize) -> FirstOrder {
        let mut first = FirstOrder::default();
        let input = self.node_input(j, k);
        let (x, theta) = (self.node(z, j, k), self.theta(z));
        self.model.first_order(x, &input, theta, &mut first);
        first
    }

    /// Derivative of the objective by the measured output at a node: `-2 w (y - h)`, zero without a
    /// sample.
    fn pull(&self, j: usize, k: usize, measured: f64) -> f64 {
        let residual = self.sample(j, k).map_or(0.0, |sample| sample - measured);
        -2.0 * self.runs[j].weight * residual
    }

    /// Calls `visit(first row of the defects, interval, unknown node i, node l)` for each weight
    /// `a_il` that is not zero, `i` and `l` counted from the interval's start.
    fn each_weight(&self, j: usize, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let (n, s, at) = (
            self.n_states(),
            self.scheme.unknown_nodes(),
            self.layout.runs[j],
        );
        for interval in 0..self.runs[j].intervals() {
            for (i, row) in self.scheme.weights.iter().enumerate() {
                let first = at.c + at.known + (interval * s + i) * n;
                for l in (0..=s).filter(|&l| row[l] != 0.0) {
                    visit(first, interval, i + 1, l);
                }
            }
        }
    }

    /// Weights of every node's `f̄` in `λᵀc`, run `j`.
    fn derivative_weights(&self, j: usize, lambda: &[f64]) -> Vec<f64> {
        let (n, s) = (self.n_states(), self.scheme.unknown_nodes());
        let mut omega = vec![0.0; n * self.layout.runs[j].nodes];
        self.each_weight(j, |row, interval, i, l| {
            let factor = -self.runs[j].step(interval) * self.scheme.weights[i - 1][l];
            let node = (interval * s + l) * n;
            for state in 0..n {
                omega[node + state] += factor * lambda[row + state];
            }
        });
        omega
    }
}

impl<D: Dynamics, C: ParameterConstraints> SparseProblem for Collocation<D, C> {
    fn gradient(&self, z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        for (j, k) in self.nodes() {
            let first = self.node_first_order(z, j, k);
            let pull = self.pull(j, k, first.measured);
            for (v, h) in first.measured_gradient.iter().enumerate() {
                gradient[self.column(j, k, v)] += pull * h;
            }
        }
    }

    fn equality_pattern(&self) -> Pattern {
        let (n, s) = (self.n_states(), self.scheme.unknown_nodes());
        let mut pattern = Pattern::new();
        for (j, at) in self.layout.runs.iter().enumerate() {
            let known = (0..n).filter(|&i| self.runs[j].initial[i].is_some());
            pattern.extend(known.enumerate().map(|(row, i)| (at.c + row, at.z + i)));
            for k in 1..at.nodes {
                let (row, start) = (at.c + at.known + (k - 1) * n, (k - 1) / s * s);
                pattern.extend((0..n).map(|l| (row + l, self.column(j, k, l))));
                pattern.extend((0..n).map(|l| (row + l, self.column(j, start, l))));
            }
            self.each_weight(j, |row, interval, _, l| {
                let entry = |&(state, v)| (row + state, self.column(j, interval * s + l, v));
                pattern.extend(self.model.entries.iter().map(entry));
            });
        }
        pattern
    }

    fn inequality_pattern(&self) -> Pattern {
        let (s, p) = (self.scheme.unknown_nodes(), self.n_parameters());
        let mut pattern = Pattern::new();
        for (j, k) in self.nodes().filter(|(_, k)| k % s == 0) {
            let row = self.layout.runs[j].g + k / s;
            pattern.extend((0..self.n_states() + p).map(|v| (row, self.column(j, k, v))));
        }
        for i in 0..self.constraints.count() {
            let row = self.layout.parameter_constraints + i;
            pattern.extend((0..p).map(|v| (row, self.layout.theta + v)));
        }
        pattern
    }

    fn jacobians(&self, z: &[f64], equality: &mut [f64], inequality: &mut [f64]) {
        let (n, s, p) = (
            self.n_states(),
            self.scheme.unknown_nodes(),
            self.n_parameters(),
        );
        let (mut c, mut g) = (equality.iter_mut(), inequality.iter_mut());
        let mut put = |value: f64| *c.next().expect("the pattern's length") = value;
        for (j, at) in self.layout.runs.iter().enumerate() {
            let nodes: Vec<FirstOrder> = (0..at.nodes)
                .map(|k| self.node_first_order(z, j, k))
                .collect();
            (0..at.known).for_each(|_| put(1.0));
            for _ in 1..at.nodes {
                (0..n).for_each(|_| put(1.0));
                (0..n).for_each(|_| put(-1.0));
            }
            self.each_weight(j, |_, interval, i, l| {
                let factor = -self.runs[j].step(interval) * self.scheme.weights[i - 1][l];
                let jacobian = &nodes[interval * s + l].jacobian;
                jacobian.iter().for_each(|value| put(factor * value));
            });
            let bounded = nodes
                .iter()
                .step_by(s)
                .flat_map(|node| &node.bounded_gradient);
            bounded.for_each(|value| *g.next().expect("the pattern's length") = *value);
        }
        let columns: Vec<_> = (0..p)
            .map(|v| self.constraint_derivatives(self.theta(z), v, v))
            .collect();
        for i in 0..self.constraints.count() {
            for column in &columns {
                *g.next().expect("the pattern's length") = column[i].eps1;
            }
        }
    }

    fn hessian_pattern(&self) -> Pattern {
        let v = self.n_states() + self.n_parameters();
        let mut pattern = Pattern::new();
        for (j, k) in self.nodes() {
            let entry = |(a, b)| (self.column(j, k, a), self.column(j, k, b));
            if self.sample(j, k).is_some() {
                pattern.extend(upper_triangle(v).map(entry));
            }
            pattern.extend(self.model.pairs.iter().copied().map(entry));
        }
        let theta = self.layout.theta;
        pattern.extend(upper_triangle(self.n_parameters()).map(|(a, b)| (theta + a, theta + b)));
        pattern
    }

    fn hessian(&self, z: &[f64], lambda: &[f64], eta: &[f64], kind: Hessian, values: &mut [f64]) {
        let (n, s) = (self.n_states(), self.scheme.unknown_nodes());
        let (v, theta, exact) = (
            n + self.n_parameters(),
            self.theta(z),
            kind == Hessian::Exact,
        );
        let mut second = vec![0.0; self.model.pairs.len()];
        let mut values = values.iter_mut();
        let mut put = |value: f64| *values.next().expect("the pattern's length") = value;
        for (j, at) in self.layout.runs.iter().enumerate() {
            let omega = self.derivative_weights(j, lambda);
            for k in 0..at.nodes {
                let first = self.node_first_order(z, j, k);
                let h = &first.measured_gradient;
                if self.sample(j, k).is_some() {
                    let weight = 2.0 * self.runs[j].weight;
                    upper_triangle(v).for_each(|(a, b)| put(weight * h[a] * h[b]));
                }
                if exact {
                    let weights = Weights {
                        f: &omega[k * n..(k + 1) * n],
                        measured: self.pull(j, k, first.measured),
                        bounded: if k % s == 0 { eta[at.g + k / s] } else { 0.0 },
                    };
                    let (x, input) = (self.node(z, j, k), self.node_input(j, k));
                    self.model
                        .second_order(x, &input, theta, weights, &mut second);
                }
                second.iter().for_each(|value| put(*value));
            }
        }
        let eta = &eta[self.layout.parameter_constraints..];
        for (a, b) in upper_triangle(self.n_parameters()) {
            let terms = self.constraint_derivatives(theta, a, b);
            let sum: f64 = terms.iter().zip(eta).map(|(t, eta)| t.eps1eps2 * eta).sum();
            put(if exact { sum } else { 0.0 });
        }
    }
}
