//! Where the search begins, and typical magnitudes.

use super::Variable;
use super::assembly::Assembly;
use pilotage_estimation::problem::control::PartOf;
use pilotage_expression::Node;
use std::collections::HashMap;

impl Assembly<'_> {
    /// Completes guesses and scales.
    pub(super) fn fill_guesses(&mut self, derivatives: &[Node], objective: Node) {
        for own in &mut self.states {
            let [first, last] = own.guess;
            let known = if first.is_nan() { last } else { first };
            let known = if known.is_nan() { 0.0 } else { known };
            own.guess = [first, last].map(|value| if value.is_nan() { known } else { value });
        }
        for own in &mut self.controls {
            let largest = [own.limits.0, own.limits.1, own.guess[0]];
            let finite = largest.iter().filter(|value| value.is_finite());
            own.scale = finite.fold(0.0, |m, value| value.abs().max(m));
            own.scale = if own.scale > 0.0 { own.scale } else { 1.0 };
        }
        // Integrals, from the mean of what is integrated at start and end.
        let parts = self.joint.model.states.len();
        for k in parts..self.states.len() {
            let points = self.sampled();
            let rates = points.iter().map(|values| values[derivatives[k].index()]);
            let mean = rates.filter(|rate| rate.is_finite()).sum::<f64>() / points.len() as f64;
            self.states[k].guess = [0.0, mean];
        }
        for own in &mut self.states {
            let largest = own
                .guess
                .iter()
                .fold(0.0_f64, |m, value| m.max(value.abs()));
            if !own.scale.is_finite() {
                own.scale = if largest > 0.0 { largest } else { 1.0 };
            }
        }
        // Initial values that the objective names, and the bound of all that is under a maximum.
        let points = self.sampled();
        let starts = self.limited[1].iter();
        let initial: HashMap<String, f64> = starts
            .map(|(node, own)| (own.name.clone(), points[0][node.index()]))
            .collect();
        let formulas = self.optimal.objective.parts.iter();
        for (name, _, formula) in formulas.filter(|part| part.1 == PartOf::Initial) {
            let value = initial.get(&format!("initial({})", formula.expression.text));
            if let Some(own) = self.sought.iter_mut().find(|own| own.name == *name) {
                own.guess = [value.copied().unwrap_or(0.0); 2];
            }
        }
        let last = &points[points.len() - 1];
        let pieces = self.limited[2]
            .iter()
            .filter(|(_, own)| own.name == "the objective");
        let highest = pieces
            .map(|(node, _)| last[node.index()])
            .fold(f64::NEG_INFINITY, f64::max);
        let _ = objective;
        for own in &mut self.sought {
            if own.guess[0].is_nan() {
                own.guess = [if highest.is_finite() { highest } else { 0.0 }; 2];
            }
            if !own.scale.is_finite() {
                own.scale = if own.guess[0] != 0.0 {
                    own.guess[0].abs()
                } else {
                    1.0
                };
            }
        }
    }

    /// All nodes at start, middle and end of the guess.
    pub(super) fn sampled(&self) -> Vec<Vec<f64>> {
        let at = |tau: f64| {
            let mix = |own: &Variable| own.guess[0] + tau * (own.guess[1] - own.guess[0]);
            let of = |value: f64| if value.is_nan() { 0.0 } else { value };
            let mut values = vec![tau];
            values.extend(self.states.iter().chain(&self.controls).map(mix).map(of));
            values.extend(self.controls.iter().map(|_| 0.0));
            values.extend(self.sought.iter().map(|own| of(own.guess[0])));
            // The parts of the objective, which nothing depends on any more.
            values.extend(self.optimal.objective.parts.iter().map(|_| 0.0));
            self.graph.values(&values)
        };
        [0.0, 0.5, 1.0].map(at).into()
    }
}
