//! Constraints on the parameters and on the initial states of runs.

use super::likelihood::Likelihood;
use crate::posed::Posed;
use num_dual::{Dual64, DualNum, HyperDual64};
use pilotage_collocation::{Bound, BoundAt};
use pilotage_expression::{Node, Tape};

/// Inequalities `lower ≤ g ≤ upper` over the unknowns of a [`Likelihood`].
pub struct Limits<'p> {
    posed: &'p Posed<'p>,
    /// Index range of the unknowns of each run, and the corresponding states.
    own: Vec<(std::ops::Range<usize>, Vec<usize>)>,
    /// The bounded expressions at the start of each run.
    begin: Tape,
    /// Indices of these bounds among those of the problem.
    bounds: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'p> Limits<'p> {
    /// The limits of a problem. Limits of outputs along the path are left out: with process noise the path is not
    /// known.
    pub fn of(posed: &'p Posed<'p>, likelihood: &Likelihood<'_>) -> Self {
        let system = &posed.model.system;
        let first = system.outputs.len() - posed.bounds.len();
        let states = posed.joint.model.states.len();
        let moves = system
            .graph
            .dependants(|variable| (1..=states).contains(&variable));
        let outputs = &system.outputs[first..];
        let is_known = |node: &Node, at| at == BoundAt::Start || !moves[node.index()];
        let known = (0..outputs.len()).filter(|k| is_known(&outputs[*k], posed.bounds[*k].at));
        let places: Vec<usize> = known.collect();
        let nodes: Vec<Node> = places.iter().map(|k| outputs[*k]).collect();
        let bounds: Vec<&Bound> = places.iter().map(|k| &posed.bounds[*k]).collect();
        let count = posed.constraints.count();
        let (mut lower, mut upper) = (vec![0.0; count], vec![f64::INFINITY; count]);
        for _ in &posed.runs {
            lower.extend(bounds.iter().map(|bound| bound.lower));
            upper.extend(bounds.iter().map(|bound| bound.upper));
        }
        let own = likelihood.own().into_iter().enumerate();
        Self {
            posed,
            own: own.map(|(j, range)| (range, likelihood.free(j))).collect(),
            begin: Tape::new(&system.graph, system.variables(), |_| false, &[&nodes]),
            bounds: places,
            lower,
            upper,
        }
    }

    /// Lower and upper limits.
    pub fn ends(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    /// Indices of the problem's bounds that apply at the start of each run.
    pub fn bounds(&self) -> &[usize] {
        &self.bounds
    }

    /// The values: those of the shared parameters, then those of each run.
    pub fn values<T: DualNum<Primitive = f64> + Copy>(&self, unknowns: &[T]) -> Vec<T> {
        let posed = self.posed;
        let theta = &unknowns[..posed.shared];
        let mut all = posed.constraints.values(theta);
        for (run, (range, free)) in posed.runs.iter().zip(&self.own) {
            let mut variables = vec![T::from(run.time[0])];
            variables.extend(run.initial.iter().map(|x| T::from(x.unwrap_or(0.0))));
            for (state, value) in free.iter().zip(&unknowns[range.clone()]) {
                variables[1 + state] = *value;
            }
            variables.extend(run.inputs[0].iter().map(|u| T::from(*u)));
            variables.extend_from_slice(theta);
            all.extend(self.begin.evaluate(&variables));
        }
        all
    }

    /// Derivatives with respect to each unknown.
    pub fn slopes(&self, unknowns: &[f64]) -> Vec<Vec<f64>> {
        let by = |k: usize| {
            let mark = |(i, value): (usize, &f64)| Dual64::new(*value, f64::from(u8::from(i == k)));
            let marked: Vec<Dual64> = unknowns.iter().enumerate().map(mark).collect();
            self.values(&marked)
                .into_iter()
                .map(|own| own.eps)
                .collect()
        };
        (0..unknowns.len()).map(by).collect()
    }

    /// Second derivative, with respect to two unknowns, of the sum with these multipliers.
    pub fn curvature(&self, unknowns: &[f64], eta: &[f64], [a, b]: [usize; 2]) -> f64 {
        let mut marked: Vec<HyperDual64> = unknowns.iter().map(|v| HyperDual64::from(*v)).collect();
        marked[a].eps1 = 1.0;
        marked[b].eps2 = 1.0;
        let values = self.values(&marked);
        values
            .iter()
            .zip(eta)
            .map(|(own, eta)| eta * own.eps1eps2)
            .sum()
    }
}
