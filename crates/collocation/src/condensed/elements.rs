//! The kinds of elements of a problem, and batches of runs with the same kinds.

use super::batch::Batch;
use super::element::{ElementJacobian, Order, Shape};
use super::run::RunSweep;
use crate::Collocation;
use std::sync::Arc;

/// The element Jacobians and elimination orders, one for each distinct tableau.
#[derive(Debug, Clone, Default)]
pub(crate) struct ElementJacobians {
    pub kinds: Vec<(ElementJacobian, Order)>,
    /// Kind of each element of each run.
    pub kind: Vec<Vec<u32>>,
}

impl ElementJacobians {
    /// Finds the kinds of elements.
    pub fn new(problem: &Collocation) -> Self {
        let shape = Shape {
            n: problem.n_states(),
            entries: &problem.model.entries,
            shared: &problem.model.shared,
        };
        let mut out = Self::default();
        for grid in &problem.grids {
            let mut kinds: Vec<u32> = Vec::with_capacity(grid.elements.len());
            for element in &grid.elements {
                let same = |(pattern, _): &(ElementJacobian, Order)| {
                    Arc::ptr_eq(&pattern.tableau, &element.tableau)
                        || pattern.tableau == element.tableau
                };
                let known = out.kinds.iter().position(same);
                let kind = known.unwrap_or_else(|| {
                    let tableau = element.tableau.clone();
                    out.kinds
                        .push((ElementJacobian::new(tableau, shape), Order::default()));
                    out.kinds.len() - 1
                });
                kinds.push(kind as u32);
            }
            out.kind.push(kinds);
        }
        out
    }

    /// The runs in batches of at most this size: adjacent runs with the same elements and the same number of free
    /// initial states.
    pub fn batches<'a>(
        &'a self,
        problem: &'a Collocation,
        mut rest: &'a mut [RunSweep],
        size: usize,
    ) -> Vec<Batch<'a>> {
        let mut batches = Vec::new();
        let mut first = 0;
        while !rest.is_empty() {
            let (kind, free) = (&self.kind[first], rest[0].free.len());
            let same = self.kind[first..].iter().zip(&*rest).take(size);
            let same = same.take_while(|(own, run)| *own == kind && run.free.len() == free);
            let count = same.count();
            let (runs, tail) = rest.split_at_mut(count);
            batches.push(Batch {
                problem,
                jacobians: self,
                first,
                runs,
            });
            (rest, first) = (tail, first + count);
        }
        batches
    }

    /// Chooses the missing elimination order of each kind, based on its first element, and updates the shared entries.
    /// False if that element is singular.
    pub fn order(&mut self, problem: &Collocation, runs: &[RunSweep]) -> bool {
        let mut done = vec![false; self.kinds.len()];
        let mut points = Vec::new();
        for (j, run) in runs.iter().enumerate() {
            let grid = &problem.grids[j];
            for element in 0..grid.elements.len() {
                let kind = self.kind[j][element] as usize;
                if std::mem::replace(&mut done[kind], true) {
                    continue;
                }
                if self.kinds[kind].1.symbolic.size() == 0 {
                    let group = Self::alone(grid, element, &run.jacobian, &mut points);
                    match self.kinds[kind].0.order(&group, 0, &problem.model.shared) {
                        Some(found) => self.kinds[kind].1 = found,
                        None => return false,
                    }
                }
                let point = grid.points_of(&grid.elements[element])[0] as usize;
                let jacobian: Vec<f64> = run.jacobian.of(point).collect();
                let (pattern, order) = &mut self.kinds[kind];
                pattern.refresh(order, &jacobian);
            }
        }
        true
    }
}
