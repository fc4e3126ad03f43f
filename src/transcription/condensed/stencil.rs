//! The linearised defects of an element as sparse operations, once for all elements with one tableau.
//!
//! With `δY_i = Σ_j P_ij δV_j` the defects of an element of length `h` are
//!
//! ```text
//! K_0 δV_0 + M [δV_1; ..; δV_s] + B δθ = -c
//! K_0 = E_0 ⊗ I - h Σ_i A_i P_i0 J_i,   M likewise,   B = -h Σ_i A_i ∂f/∂θ(Y_i)
//! ```
//!
//! Where a point also takes derivatives of earlier ones (compressed schemes), `K_0`, `M` and `B` are
//! formed as dense blocks.

use super::dense::axpy;
use super::sparse_lu::Symbolic;
use crate::transcription::grid::{Element, Grid};
use crate::transcription::tableau::{Tableau, Value};
use std::sync::Arc;

/// The operations of a tableau's elements.
#[derive(Debug, Clone)]
pub struct Stencil {
    /// The tableau.
    pub tableau: Arc<Tableau>,
    n: usize,
    p: usize,
    /// Entries `(row, column)` of a point's `J`, then of its `∂f/∂θ` with columns from `n`.
    jacobian: Vec<(usize, usize)>,
    state_entries: usize,
    /// True when some point takes derivatives of others.
    pub nested: bool,
    /// Part of `M` or `K_0` that a point adds: the factors of `-h J`.
    unknown: Vec<Stamp>,
    start: Vec<Stamp>,
    parameters: Vec<Stamp>,
    /// Entries of `M`, each place once.
    pattern: Vec<(usize, usize)>,
    /// For each of `unknown`, the places in `pattern` of its entries.
    targets: Vec<u32>,
    /// The pattern's part that is constant.
    constant: Vec<f64>,
}

/// `-h · factor · J(point)` at block row `defect` and block column `unknown`.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    point: usize,
    defect: usize,
    factor: f64,
}

/// The order in which a [`Stencil`]'s matrix is factored.
#[derive(Debug, Clone, Default)]
pub struct Factorable {
    /// Order and pattern of the factors.
    pub symbolic: Symbolic,
    /// Places of the stencil's pattern in the factors.
    places: Vec<u32>,
    /// Constant part of the factors' input.
    template: Vec<f64>,
    /// Places of the stamps' entries.
    targets: Vec<u32>,
}

impl Stencil {
    /// The operations for a model with `n` states, `p` parameters and these Jacobian entries.
    pub fn new(
        tableau: Arc<Tableau>,
        (n, p): (usize, usize),
        jacobian: &[(usize, usize)],
        state_entries: usize,
    ) -> Self {
        let nested = tableau
            .points
            .iter()
            .any(|point| matches!(&point.value, Value::Combination { q, .. } if !q.is_empty()));
        let mut stencil = Self {
            n,
            p,
            jacobian: jacobian.to_vec(),
            state_entries,
            nested,
            unknown: Vec::new(),
            start: Vec::new(),
            parameters: Vec::new(),
            pattern: Vec::new(),
            targets: Vec::new(),
            constant: Vec::new(),
            tableau: tableau.clone(),
        };
        match nested {
            true => {
                let size = n * tableau.unknowns();
                stencil.pattern = (0..size * size).map(|k| (k / size, k % size)).collect();
                stencil.constant = vec![0.0; size * size];
            }
            false => stencil.collect(&tableau),
        }
        stencil
    }

    /// Stamps and pattern of a tableau without nested points.
    fn collect(&mut self, tableau: &Tableau) {
        let n = self.n;
        let mut entries: Vec<((usize, usize), f64)> = Vec::new();
        for (defect, row) in tableau.defects.iter().enumerate() {
            for &(j, e) in row.e.iter().filter(|(j, _)| *j > 0) {
                entries.extend((0..n).map(|l| ((defect * n + l, (j - 1) * n + l), e)));
            }
            for &(point, a) in &row.a {
                let stamp = |factor| Stamp {
                    point,
                    defect,
                    factor,
                };
                self.parameters.push(stamp(a));
                for (j, weight) in weights(&tableau.points[point].value) {
                    match j {
                        0 => self.start.push(stamp(a * weight)),
                        j => {
                            self.unknown.push(stamp(a * weight));
                            let own = self.jacobian[..self.state_entries].iter();
                            let place =
                                |&(l, c): &(usize, usize)| (defect * n + l, (j - 1) * n + c);
                            entries.extend(own.map(|at| (place(at), 0.0)));
                            let own = self.jacobian[..self.state_entries].iter();
                            self.pattern.extend(own.map(place));
                        }
                    }
                }
            }
        }
        let stamped = std::mem::take(&mut self.pattern);
        entries.sort_by_key(|e| e.0);
        for (at, value) in entries {
            if self.pattern.last() != Some(&at) {
                self.pattern.push(at);
                self.constant.push(0.0);
            }
            *self.constant.last_mut().expect("pushed above") += value;
        }
        let place = |at: &(usize, usize)| self.pattern.partition_point(|p| p < at) as u32;
        self.targets = stamped.iter().map(place).collect();
    }

    /// Number of rows of `M`.
    pub fn size(&self) -> usize {
        self.n * self.tableau.unknowns()
    }

    /// The order of elimination for an element with these Jacobians; None when `M` is singular.
    pub fn order(&self, local: &Local<'_>) -> Option<Factorable> {
        let mut values = self.constant.clone();
        match self.nested {
            true => values.copy_from_slice(&local.dense(self).m),
            false => self.stamp(local, &self.targets, &mut values),
        }
        let entries = self.pattern.iter().zip(&values);
        let entries: Vec<_> = entries.map(|(&(i, j), v)| (i, j, *v)).collect();
        let symbolic = Symbolic::new(self.size(), &entries)?;
        let places = symbolic.places(self.pattern.iter().copied());
        let mut template = vec![0.0; symbolic.entries()];
        let constant = places.iter().zip(&self.constant);
        constant.for_each(|(at, v)| template[*at as usize] = *v);
        Some(Factorable {
            targets: self.targets.iter().map(|k| places[*k as usize]).collect(),
            symbolic,
            places,
            template,
        })
    }

    fn stamp(&self, local: &Local<'_>, targets: &[u32], out: &mut [f64]) {
        let targets = targets.chunks_exact(self.state_entries.max(1));
        for (stamp, targets) in self.unknown.iter().zip(targets) {
            let factor = -local.h * stamp.factor;
            for (at, value) in targets.iter().zip(local.jacobian(stamp.point)) {
                out[*at as usize] += factor * value;
            }
        }
    }

    /// Factors an element's `M` into `lu`. False when a pivot is too small.
    pub fn factor(
        &self,
        local: &Local<'_>,
        order: &Factorable,
        lu: &mut [f64],
        work: &mut [f64],
    ) -> bool {
        lu.copy_from_slice(&order.template);
        match self.nested {
            true => {
                let m = local.dense(self).m;
                let values = order.places.iter().zip(m);
                values.for_each(|(at, v)| lu[*at as usize] = v);
            }
            false => self.stamp(local, &order.targets, lu),
        }
        order.symbolic.factor(lu, work)
    }

    /// `to = -K_0 from`.
    pub fn start<const W: usize>(&self, local: &Local<'_>, from: &[[f64; W]], to: &mut [[f64; W]]) {
        let n = self.n;
        to.fill([0.0; W]);
        if self.nested {
            let k0 = local.dense(self).k0;
            for (row, to) in k0.chunks_exact(n).zip(to) {
                row.iter()
                    .zip(from)
                    .for_each(|(k, from)| axpy(-k, from, to));
            }
            return;
        }
        for (defect, to) in self.tableau.defects.iter().zip(to.chunks_exact_mut(n)) {
            if let Some(&(0, e)) = defect.e.first() {
                for (to, from) in to.iter_mut().zip(from) {
                    axpy(-e, from, to);
                }
            }
        }
        for stamp in &self.start {
            let to = &mut to[stamp.defect * n..(stamp.defect + 1) * n];
            let (entries, factor) = (&self.jacobian[..self.state_entries], local.h * stamp.factor);
            for (value, &(l, c)) in local.jacobian(stamp.point).iter().zip(entries) {
                axpy(factor * value, &from[c], &mut to[l]);
            }
        }
    }

    /// `out += K_0ᵀ λ`.
    pub fn start_transposed(&self, local: &Local<'_>, lambda: &[f64], out: &mut [f64]) {
        let n = self.n;
        if self.nested {
            let k0 = local.dense(self).k0;
            let rows = k0.chunks_exact(n).zip(lambda);
            rows.for_each(|(row, lambda)| axpy(*lambda, row, out));
            return;
        }
        for (defect, lambda) in self.tableau.defects.iter().zip(lambda.chunks_exact(n)) {
            if let Some(&(0, e)) = defect.e.first() {
                axpy(e, lambda, out);
            }
        }
        for stamp in &self.start {
            let lambda = &lambda[stamp.defect * n..(stamp.defect + 1) * n];
            let entries = self.jacobian[..self.state_entries].iter();
            for (value, &(l, c)) in local.jacobian(stamp.point).iter().zip(entries) {
                out[c] -= local.h * stamp.factor * value * lambda[l];
            }
        }
    }

    /// `to -= B`, whose columns are the first `p`.
    pub fn parameters<const W: usize>(&self, local: &Local<'_>, to: &mut [[f64; W]]) {
        let n = self.n;
        if self.nested {
            let b = local.dense(self).b;
            let rows = b.chunks_exact(self.p).zip(to);
            rows.for_each(|(row, to)| axpy(-1.0, row, &mut to[..self.p]));
            return;
        }
        for stamp in &self.parameters {
            let entries = self.jacobian[self.state_entries..].iter();
            let factor = local.h * stamp.factor;
            for (value, &(l, c)) in local.parameters(stamp.point).iter().zip(entries) {
                to[stamp.defect * n + l][c - n] += factor * value;
            }
        }
    }
}

/// Weights of a point over the element's unknowns.
fn weights(value: &Value) -> Vec<(usize, f64)> {
    match value {
        Value::Unknown(j) => vec![(*j, 1.0)],
        Value::Combination { p, .. } => p.clone(),
    }
}

/// The Jacobians at one element's points.
#[derive(Debug, Clone, Copy)]
pub struct Local<'a> {
    /// Length of the element [s].
    pub h: f64,
    points: &'a [u32],
    jacobians: &'a [f64],
    entries: usize,
    state_entries: usize,
}

/// Dense blocks of an element with nested points, row-major: `s n × n`, `s n × s n`, `s n × p`.
struct Dense {
    k0: Vec<f64>,
    m: Vec<f64>,
    b: Vec<f64>,
}

impl<'a> Local<'a> {
    /// Of an element, from the Jacobians at all points of its run.
    pub fn new(grid: &'a Grid, element: &Element, stencil: &Stencil, jacobians: &'a [f64]) -> Self {
        Self {
            h: element.h,
            points: grid.points_of(element),
            jacobians,
            entries: stencil.jacobian.len(),
            state_entries: stencil.state_entries,
        }
    }

    /// Entries of `J` at a point of the element.
    fn jacobian(&self, point: usize) -> &'a [f64] {
        let at = self.points[point] as usize * self.entries;
        &self.jacobians[at..at + self.state_entries]
    }

    /// Entries of `∂f/∂θ` at a point of the element.
    fn parameters(&self, point: usize) -> &'a [f64] {
        let at = self.points[point] as usize * self.entries;
        &self.jacobians[at + self.state_entries..at + self.entries]
    }

    fn dense(&self, stencil: &Stencil) -> Dense {
        let (n, p, s) = (stencil.n, stencil.p, stencil.tableau.unknowns());
        let columns = (s + 1) * n + p;
        // Tangents of the points and of their derivatives over [V_0; ..; V_s; θ].
        let mut tangents: Vec<Vec<f64>> = Vec::new();
        let mut derivatives: Vec<Vec<f64>> = Vec::new();
        for (i, point) in stencil.tableau.points.iter().enumerate() {
            let mut tangent = vec![0.0; n * columns];
            for (j, weight) in weights(&point.value) {
                (0..n).for_each(|l| tangent[l * columns + j * n + l] += weight);
            }
            if let Value::Combination { q, .. } = &point.value {
                q.iter()
                    .for_each(|&(k, q)| axpy(self.h * q, &derivatives[k], &mut tangent));
            }
            let mut derivative = vec![0.0; n * columns];
            let states = stencil.jacobian.iter().zip(self.jacobian(i));
            for (&(l, c), v) in states {
                let source = &tangent[c * columns..(c + 1) * columns];
                axpy(*v, source, &mut derivative[l * columns..(l + 1) * columns]);
            }
            let own = stencil.jacobian[self.state_entries..]
                .iter()
                .zip(self.parameters(i));
            for (&(l, c), v) in own {
                derivative[l * columns + (s + 1) * n + c - n] += v;
            }
            tangents.push(tangent);
            derivatives.push(derivative);
        }
        let mut out = Dense {
            k0: Vec::new(),
            m: Vec::new(),
            b: Vec::new(),
        };
        for defect in &stencil.tableau.defects {
            let mut rows = vec![0.0; n * columns];
            for &(j, e) in &defect.e {
                (0..n).for_each(|l| rows[l * columns + j * n + l] += e);
            }
            defect
                .a
                .iter()
                .for_each(|&(i, a)| axpy(-self.h * a, &derivatives[i], &mut rows));
            for row in rows.chunks_exact(columns) {
                out.k0.extend(&row[..n]);
                out.m.extend(&row[n..(s + 1) * n]);
                out.b.extend(&row[(s + 1) * n..]);
            }
        }
        out
    }
}
