//! What a run's derivatives make of the reduced variables: its parts of the reduced Hessians and of the
//! linear term.

use super::dense::axpy;
use super::points::{Points, ZERO};
use super::run::{Place, RunSweep};
use crate::sqp::Hessian;
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::lanes::{self, Kernel, LANES};
use crate::transcription::node::Output;
use pilotage_models::Dynamics;

impl RunSweep {
    /// `Σ Zᵀ W Z` (r × r, row-major) where `δ[Y; θ] = Z ρ + e`: of Gauss–Newton, and, if wanted, of the
    /// exact Hessian. Forms the rows of the bounded signal, too.
    pub fn reduce_matrices<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        exact: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let w = self.w;
        lanes::run(
            w,
            Reduce {
                own: self,
                at,
                exact,
            },
        )
    }

    #[inline(always)]
    fn reduced<D: Dynamics, C: ParameterConstraints, const W: usize>(
        &mut self,
        at: Place<'_, D, C>,
        exact: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let (p, r, model) = (self.p, self.r(), &at.problem.model);
        let [measured, bounded] = [Output::Measured, Output::Bounded].map(|o| model.columns(o));
        // Halves of the symmetric sums; their transposes are added at the end.
        let (mut squares, mut curved) = (vec![[0.0; W]; r], vec![[0.0; W]; r]);
        let mut rows = std::mem::take(&mut self.bounded);
        for (i, point) in at.problem.grids[at.j].points.iter().enumerate() {
            let (s, _) = self.s_of(&point.state).as_chunks::<W>();
            if let Some(sample) = point.sample {
                let k = sample as usize;
                let own = self.gradients[Output::Bounded as usize].of(i);
                let row = project(own, bounded, s, p);
                rows.e[k] = row[r];
                rows.s[k * W..(k + 1) * W].copy_from_slice(&row);
            }
            let weight = self.weight.of(i).sum::<f64>();
            if weight != 0.0 {
                let own = self.gradients[Output::Measured as usize].of(i);
                let row = project(own, measured, s, p);
                for (value, out) in row.iter().zip(&mut squares) {
                    add(0.5 * weight * value, &row, out);
                }
            }
            if exact {
                add_pairs(self.second.of(i), &model.pairs, s, &mut curved);
            }
        }
        self.bounded = rows;
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

    /// Adds `Σ Zᵀ (g + W [e; 0])` to `vector`.
    pub fn reduce_vector<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        kind: Hessian,
        vector: &mut [f64],
    ) {
        let kernel = ReduceVector {
            own: self,
            at,
            kind,
            vector,
        };
        lanes::run(self.w, kernel);
    }

    #[inline(always)]
    fn reduced_vector<D: Dynamics, C: ParameterConstraints, const W: usize>(
        &self,
        at: Place<'_, D, C>,
        kind: Hessian,
        vector: &mut [f64],
    ) {
        let (n, p, model) = (self.n, self.p, &at.problem.model);
        let grid = &at.problem.grids[at.j];
        let (mut step, mut full, mut sum) = (ZERO, ZERO, [0.0; W]);
        for points in Points::all(grid) {
            points.states(&self.nodes.e, &self.combined.e, n, &mut step);
            self.model_gradient(model, points.number, kind, &step, &mut full);
            for lane in 0..points.count {
                let point = &grid.points[points.number * LANES + lane];
                let (s, _) = self.s_of(&point.state).as_chunks::<W>();
                for (g, s) in full[..n].iter().zip(s).filter(|(g, _)| g[lane] != 0.0) {
                    add(g[lane], s, &mut sum);
                }
                let parameters = sum[..p].iter_mut().zip(&full[n..n + p]);
                parameters.for_each(|(sum, g)| *sum += g[lane]);
            }
        }
        axpy(1.0, &sum, vector);
    }
}

struct Reduce<'a, D, C> {
    own: &'a mut RunSweep,
    at: Place<'a, D, C>,
    exact: bool,
}

impl<D: Dynamics, C: ParameterConstraints> Kernel for Reduce<'_, D, C> {
    type Output = (Vec<f64>, Vec<f64>);

    #[inline(always)]
    fn run<const W: usize>(self) -> Self::Output {
        self.own.reduced::<D, C, W>(self.at, self.exact)
    }
}

struct ReduceVector<'a, D, C> {
    own: &'a RunSweep,
    at: Place<'a, D, C>,
    kind: Hessian,
    vector: &'a mut [f64],
}

impl<D: Dynamics, C: ParameterConstraints> Kernel for ReduceVector<'_, D, C> {
    type Output = ();

    #[inline(always)]
    fn run<const W: usize>(self) {
        (self.own).reduced_vector::<D, C, W>(self.at, self.kind, self.vector);
    }
}

/// `y += a x`, of known length.
#[inline(always)]
fn add<const W: usize>(a: f64, x: &[f64; W], y: &mut [f64; W]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// `gradientᵀ Z` over the reduced variables, with `Z = [S; I 0]`, for a gradient at these columns.
#[inline(always)]
fn project<const W: usize>(
    gradient: impl Iterator<Item = f64>,
    columns: &[usize],
    s: &[[f64; W]],
    p: usize,
) -> [f64; W] {
    let mut out = [0.0; W];
    for (g, &c) in gradient.zip(columns) {
        match c.checked_sub(s.len()) {
            None => add(g, &s[c], &mut out),
            Some(parameter) => out[..p][parameter] += g,
        }
    }
    out
}

/// Adds `Σ w z_a z_bᵀ` over the pairs `(a, b)`, with `z_a` row `a` of `Z = [S; I]`: half of it for a square,
/// and of a pair of state and parameter only the order whose row is the parameter's.
#[inline(always)]
fn add_pairs<const W: usize>(
    values: impl Iterator<Item = f64>,
    pairs: &[(usize, usize)],
    s: &[[f64; W]],
    matrix: &mut [[f64; W]],
) {
    let n = s.len();
    let mut rest = values.zip(pairs).peekable();
    // The pairs come in the order of their first variable.
    while let Some(&(_, &(a, _))) = rest.peek() {
        let mut along = [0.0; W];
        let mut has_states = false;
        while let Some((w, &(_, b))) = rest.next_if(|(_, pair)| pair.0 == a) {
            let w = if a == b { 0.5 * w } else { w };
            match (a.checked_sub(n), b.checked_sub(n)) {
                (None, None) => {
                    add(w, &s[b], &mut along);
                    has_states = true;
                }
                (None, Some(b)) => add(w, &s[a], &mut matrix[b]),
                (Some(a), Some(b)) => matrix[a][b] += w,
                (Some(_), None) => unreachable!("pairs are ordered"),
            }
        }
        if has_states {
            for (row, v) in matrix.iter_mut().zip(&s[a]) {
                add(*v, &along, row);
            }
        }
    }
}
