//! The reduced Hessian: an arrowhead matrix of shared parameters and the free initial states of each run.
//!
//! ```text
//! | Θ    C_1  C_2 ... |   θ: p
//! | C_1ᵀ D_1          |   free initial states of run 1
//! | C_2ᵀ      D_2     |   ...
//! ```

use super::dense::{axpy, cholesky, cholesky_solve, dot};

/// Symmetric arrowhead matrix, row-major blocks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Arrow {
    /// Number of shared parameters.
    pub p: usize,
    /// `Θ`, p × p.
    pub theta: Vec<f64>,
    /// The blocks of each run.
    pub runs: Vec<ArrowRun>,
}

/// The blocks of one run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ArrowRun {
    /// Number of free initial states.
    pub n: usize,
    /// `C_jᵀ`, n × p.
    pub cross: Vec<f64>,
    /// `D_j`, n × n.
    pub diagonal: Vec<f64>,
}

impl Arrow {
    /// A zero matrix for `p` parameters and these numbers of free initial states.
    pub fn zeros(p: usize, free: &[usize]) -> Self {
        let run = |&n: &usize| ArrowRun {
            n,
            cross: vec![0.0; n * p],
            diagonal: vec![0.0; n * n],
        };
        Self {
            p,
            theta: vec![0.0; p * p],
            runs: free.iter().map(run).collect(),
        }
    }

    /// Sets the blocks of run `j`, and adds to `Θ`, from the run's local matrix over `[θ; free states]`.
    pub fn set_run(&mut self, j: usize, local: &[f64]) {
        let (p, run) = (self.p, &mut self.runs[j]);
        let r = p + run.n;
        for i in 0..p {
            axpy(
                1.0,
                &local[i * r..i * r + p],
                &mut self.theta[i * p..(i + 1) * p],
            );
        }
        for i in 0..run.n {
            let row = &local[(p + i) * r..(p + i + 1) * r];
            run.cross[i * p..(i + 1) * p].copy_from_slice(&row[..p]);
            run.diagonal[i * run.n..(i + 1) * run.n].copy_from_slice(&row[p..]);
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.p + self.runs.iter().map(|r| r.n).sum::<usize>()
    }

    /// Adds `value` to the whole diagonal.
    pub fn add_diagonal(&mut self, value: f64) {
        (0..self.p).for_each(|i| self.theta[i * self.p + i] += value);
        for run in &mut self.runs {
            (0..run.n).for_each(|i| run.diagonal[i * run.n + i] += value);
        }
    }

    /// Adds `factor aaᵀ`, where `a` has entries for θ and the free initial states of at most one run.
    pub fn add_square(&mut self, run: Option<usize>, entries: &[(usize, f64)], factor: f64) {
        let p = self.p;
        let mut theta = vec![0.0; p];
        let shared = entries.iter().filter(|(column, _)| *column < p);
        shared.for_each(|&(column, v)| theta[column] += v);
        add_product(&mut self.theta, (&theta, &theta), factor);
        let Some(j) = run else { return };
        let first = p + self.runs[..j].iter().map(|run| run.n).sum::<usize>();
        let run = &mut self.runs[j];
        let mut free = vec![0.0; run.n];
        let own = entries.iter().filter(|(column, _)| *column >= p);
        own.for_each(|&(column, v)| free[column - first] += v);
        add_product(&mut run.cross, (&free, &theta), factor);
        add_product(&mut run.diagonal, (&free, &free), factor);
    }

    /// The diagonal.
    pub fn diagonal(&self) -> Vec<f64> {
        let of = |matrix: &[f64], n: usize| (0..n).map(|i| matrix[i * n + i]).collect::<Vec<_>>();
        let runs = self.runs.iter().flat_map(|run| of(&run.diagonal, run.n));
        of(&self.theta, self.p).into_iter().chain(runs).collect()
    }

    /// Cholesky factorisation by the Schur complement on θ; None if not positive definite.
    pub fn factor(&self) -> Option<ArrowFactor> {
        let p = self.p;
        let mut schur = self.theta.clone();
        let mut runs = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            let n = run.n;
            let mut l = run.diagonal.clone();
            if !cholesky(&mut l, n) {
                return None;
            }
            // Row i is column i of D⁻¹ Cᵀ.
            let mut solved = vec![0.0; p * n];
            for i in 0..p {
                let row = &mut solved[i * n..(i + 1) * n];
                (0..n).for_each(|k| row[k] = run.cross[k * p + i]);
                cholesky_solve(&l, n, row);
                for m in 0..p {
                    let coupling: f64 = (0..n).map(|k| run.cross[k * p + m] * row[k]).sum();
                    schur[m * p + i] -= coupling;
                }
            }
            runs.push((n, l, solved));
        }
        cholesky(&mut schur, p).then_some(ArrowFactor { p, schur, runs })
    }

    /// Upper triangle as triplets.
    pub fn triplets(&self) -> Vec<(usize, usize, f64)> {
        let p = self.p;
        let mut out: Vec<_> = (0..p)
            .flat_map(|i| (i..p).map(move |j| (i, j)))
            .map(|(i, j)| (i, j, self.theta[i * p + j]))
            .collect();
        let mut first = p;
        for run in &self.runs {
            for k in 0..run.n {
                out.extend((0..p).map(|i| (i, first + k, run.cross[k * p + i])));
                out.extend((0..=k).map(|i| (first + i, first + k, run.diagonal[i * run.n + k])));
            }
            first += run.n;
        }
        out
    }
}

/// Adds `factor rows columnsᵀ` to a row-major matrix.
fn add_product(matrix: &mut [f64], (rows, columns): (&[f64], &[f64]), factor: f64) {
    for (row, r) in matrix.chunks_exact_mut(columns.len().max(1)).zip(rows) {
        axpy(factor * r, columns, row);
    }
}

/// Factors of an [`Arrow`].
#[derive(Debug, Clone)]
pub struct ArrowFactor {
    p: usize,
    schur: Vec<f64>,
    /// Size, Cholesky factor of `D_j`, rows of `(D_j⁻¹ C_jᵀ)ᵀ`.
    runs: Vec<(usize, Vec<f64>, Vec<f64>)>,
}

impl ArrowFactor {
    /// The solution for a right-hand side given by its entries `(row, value)`, of length `n`.
    pub fn solved(&self, entries: &[(usize, f64)], n: usize) -> Vec<f64> {
        let mut b = vec![0.0; n];
        entries.iter().for_each(|&(row, value)| b[row] += value);
        self.solve(&mut b);
        b
    }

    /// Solves in place.
    pub fn solve(&self, b: &mut [f64]) {
        let (theta, rest) = b.split_at_mut(self.p);
        // Runs without free initial states contribute nothing; there may be hundreds of them.
        let with_states = || self.runs.iter().filter(|(n, ..)| *n > 0);
        if rest.is_empty() {
            cholesky_solve(&self.schur, self.p, theta);
            return;
        }
        let mut first = 0;
        for (n, _, solved) in with_states() {
            for i in 0..self.p {
                theta[i] -= dot(&solved[i * n..(i + 1) * n], &rest[first..first + n]);
            }
            first += n;
        }
        cholesky_solve(&self.schur, self.p, theta);
        first = 0;
        for (n, l, solved) in with_states() {
            let local = &mut rest[first..first + n];
            cholesky_solve(l, *n, local);
            for i in 0..self.p {
                axpy(-theta[i], &solved[i * n..(i + 1) * n], local);
            }
            first += n;
        }
    }
}
