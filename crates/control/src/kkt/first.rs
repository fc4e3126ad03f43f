//! The first node, and the equations at the ends.

use super::DEPENDENT;
use super::Kkt;
use super::Linearised;
use super::PENALTY;
use super::is_known;
use crate::evaluation::Evaluator;
use crate::program::Place;
use pilotage_collocation::condensed::dense::cholesky;
use pilotage_collocation::condensed::dense::cholesky_solve;
use pilotage_collocation::condensed::dense::dot;
use pilotage_collocation::condensed::dense::independent_cholesky;

/// The factored system of the first node.
#[derive(Default)]
pub(super) struct First {
    /// Free entries of its `s`, and the factor of their Hessian.
    pub free: Vec<usize>,
    pub factor: Vec<f64>,
    /// Second derivatives of `s` with ν, and the responses of the free entries, equation by equation.
    pub coupling: Vec<Vec<f64>>,
    pub responses: Vec<Vec<f64>>,
    /// Equations that do not depend on others, and the factor of their Schur complement.
    pub independent: Vec<usize>,
    pub schur: Vec<f64>,
}

impl Kkt<'_> {
    /// The first node.
    pub(super) fn finish(&mut self, evaluator: &Evaluator<'_>, of: &Linearised) -> bool {
        let (n, m, all, size) = (self.n, self.m, self.all, self.size);
        let equations = self.rows.1.len();
        self.add_pairs(evaluator, of, 0);
        for (r, row) in self.rows.0.iter().enumerate() {
            if matches!(row.place, Place::Start(_) | Place::Parameter(_)) {
                self.add_square(of.sigma[r], of.limited.row(r), 0);
            }
        }
        for r in (0..equations)
            .filter(|r| !self.is_last[*r])
            .collect::<Vec<_>>()
        {
            self.add_square(PENALTY, of.equations.row(r), 0);
            for (column, value) in of.equations.row(r) {
                let i = self.entry(column, 0);
                *self.value(i, all + r) = value;
            }
        }
        for i in n + m..size {
            *self.value(i, i) += of.damping;
        }
        let mut first = std::mem::take(&mut self.first);
        let is_free = |i: &usize| *i >= n + m || !is_known(self.program, *i);
        first.free.clear();
        first.free.extend((0..size).filter(is_free));
        let free = &first.free;
        let count = free.len();
        first.factor.resize(count * count, 0.0);
        for (a, i) in free.iter().enumerate() {
            for (b, j) in free.iter().enumerate() {
                first.factor[a * count + b] = *self.value(*i, *j);
            }
        }
        let is_definite = cholesky(&mut first.factor, count);
        if is_definite {
            let column = |own: &mut Self, r: usize| -> Vec<f64> {
                free.iter().map(|i| *own.value(*i, all + r)).collect()
            };
            first.coupling = (0..equations).map(|r| column(self, r)).collect();
            first.responses = first.coupling.clone();
            for response in &mut first.responses {
                cholesky_solve(&first.factor, count, response);
            }
            let entry = |i: usize, j: usize| {
                let own = dot(&first.coupling[i], &first.responses[j]);
                own - self.stages.schur[i * equations + j]
            };
            (first.independent, first.schur) = independent_cholesky(equations, DEPENDENT, entry);
        }
        self.first = first;
        is_definite
    }
}
