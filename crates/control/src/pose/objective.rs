//! The objective: integrals become states, what is under a maximum a limit.

use super::Variable;
use super::assembly::Assembly;
use super::limits::limited;
use pilotage_estimation::problem::control::PartOf;
use pilotage_expression::Function;
use pilotage_expression::Graph;
use pilotage_expression::Node;
use pilotage_expression::Operation;
use pilotage_expression::Operator;
use std::collections::HashMap;

impl Assembly<'_> {
    /// The objective at the end; what is integrated becomes a state, what is under a maximum a limit.
    pub(super) fn aim(
        &mut self,
        objective: Node,
        parts: &[Node],
        derivatives: &mut Vec<Node>,
    ) -> Node {
        let seconds = self.seconds();
        let mut replaced = HashMap::new();
        let mut integrals = self.joint.model.states.len();
        for ((name, of, formula), node) in self.optimal.objective.parts.iter().zip(parts) {
            let own = match of {
                PartOf::Final => *node,
                PartOf::Integral => {
                    derivatives.push(self.graph.multiply(seconds, *node));
                    integrals += 1;
                    self.graph.variable(integrals)
                }
                PartOf::Initial => {
                    let sought = self.sought(name).expect("it is sought");
                    let difference = self.graph.subtract(*node, sought);
                    let name = format!("initial({})", formula.expression.text);
                    self.limited[1].push((difference, limited(name, None, (0.0, 0.0))));
                    sought
                }
            };
            replaced.insert(name.clone(), own);
        }
        // The expression once more, with its parts.
        self.values.extend(replaced);
        let objective = self.with_parts(objective);
        let objective = match self.optimal.objective.is_maximised {
            true => self.graph.negate(objective),
            false => objective,
        };
        let pieces = pieces(&mut self.graph, objective, false);
        if pieces.len() == 1 {
            return objective;
        }
        let index = 1 + self.states.len() + 2 * self.controls.len() + self.sought.len();
        let bound = self.graph.variable(index);
        self.sought.push(Variable {
            name: "bound of the objective".into(),
            unit: None,
            scale: f64::NAN,
            guess: [f64::NAN; 2],
            limits: (f64::NEG_INFINITY, f64::INFINITY),
        });
        for piece in pieces {
            let difference = self.graph.subtract(piece, bound);
            let own = limited("the objective".into(), None, (f64::NEG_INFINITY, 0.0));
            self.limited[2].push((difference, own));
        }
        bound
    }

    /// A part of the objective until it is known: a variable after those of the program.
    pub(super) fn part_variable(&self, k: usize) -> usize {
        1 + self.states.len() + 2 * self.controls.len() + self.sought.len() + k
    }

    /// An expression with the parts of the objective in their places.
    pub(super) fn with_parts(&mut self, objective: Node) -> Node {
        let mut variables: Vec<Node> = (0..self.part_variable(0))
            .map(|k| self.graph.variable(k))
            .collect();
        let parts = self.optimal.objective.parts.iter();
        variables.extend(parts.map(|(name, _, _)| self.values[name]));
        let copy = self.graph.clone();
        self.graph.import(&copy, &[objective], &variables)[0]
    }
}

/// Smooth expressions whose maximum (minimum, if `least`) is the given one, as far as its sums, factors, magnitudes, maxima
/// and minima show.
fn pieces(graph: &mut Graph, node: Node, least: bool) -> Vec<Node> {
    match graph.operation(node) {
        Operation::Unary(Function::Abs, inner) if !least => {
            let negative = graph.negate(inner);
            vec![inner, negative]
        }
        Operation::Unary(Function::Negate, inner) => {
            let own = pieces(graph, inner, !least);
            own.into_iter().map(|piece| graph.negate(piece)).collect()
        }
        // max(a, b) is written `if a < b then b else a`, min(a, b) `if b < a then b else a`.
        Operation::Select(condition, yes, no) => {
            let compared = match graph.operation(condition) {
                Operation::Binary(Operator::Less, a, b) => Some((a, b)),
                _ => None,
            };
            let is_extreme = match least {
                false => compared == Some((no, yes)),
                true => compared == Some((yes, no)),
            };
            match is_extreme {
                true => [pieces(graph, no, least), pieces(graph, yes, least)].concat(),
                false => vec![node],
            }
        }
        Operation::Binary(operator @ (Operator::Multiply | Operator::Divide), a, b) => {
            let (inner, factor) = match (graph.value(a), graph.value(b)) {
                (_, Some(factor)) => (a, factor),
                (Some(factor), None) if operator == Operator::Multiply => (b, factor),
                _ => return vec![node],
            };
            let factor = if operator == Operator::Divide {
                1.0 / factor
            } else {
                factor
            };
            let own = pieces(graph, inner, least != (factor < 0.0));
            own.into_iter()
                .map(|piece| graph.scale(factor, piece))
                .collect()
        }
        Operation::Binary(operator @ (Operator::Add | Operator::Subtract), a, b) => {
            let first = pieces(graph, a, least);
            let second = pieces(graph, b, least != (operator == Operator::Subtract));
            if first.len() * second.len() == 1 {
                return vec![node];
            }
            let pairs = first
                .iter()
                .flat_map(|a| second.iter().map(move |b| (*a, *b)));
            let pairs: Vec<(Node, Node)> = pairs.collect();
            pairs
                .into_iter()
                .map(|(a, b)| graph.binary(operator, a, b))
                .collect()
        }
        _ => vec![node],
    }
}
