//! Conditions on time, and the times at which they change.
//!
//! A condition such as `time > start + 2 * period` depends on time and on steady variables alone, which are constant while time
//! passes. Where its two sides are linear in time, the time at which it changes is an expression of the steady variables.

use super::graph::{Graph, Node};
use super::operation::{Function, Operation, Operator};
use std::collections::HashMap;

/// Maximum number of lines of which one expression may consist.
const MOST_LINES: usize = 16;

/// Conditions on time in some expressions.
#[derive(Debug, Clone, Default)]
pub struct Switches {
    /// The comparisons and signs that depend on time and steady variables alone.
    pub conditions: Vec<Node>,
    /// For each time at which one of them may change, or a magnitude or a table of time has a kink: the time, an expression of
    /// steady variables.
    pub times: Vec<Node>,
    /// For each time the indices of the conditions that may change there.
    pub changed: Vec<Vec<usize>>,
}

/// `offset + slope · time`.
type Line = [Node; 2];

/// What has been found about the nodes of a graph.
struct Search<'g> {
    graph: &'g mut Graph,
    /// Whether nodes depend on time.
    varies: Vec<bool>,
    /// The lines of which nodes consist, where they are pieces of lines.
    lines: HashMap<Node, Option<Vec<Line>>>,
}

impl Graph {
    /// The conditions on time in these expressions, over a graph whose variable 0 is time. The times are added to the graph.
    pub fn switches(&mut self, of: &[Node], is_steady: impl Fn(usize) -> bool) -> Switches {
        let is_needed = self.ancestors(of);
        let varies = self.dependants(|variable| variable == 0);
        let is_moved = self.dependants(|variable| variable != 0 && !is_steady(variable));
        let own = (0..is_needed.len()).filter(|k| is_needed[*k] && varies[*k] && !is_moved[*k]);
        let own: Vec<Node> = own.map(|k| self.node(k)).collect();
        let mut search = Search {
            graph: self,
            varies,
            lines: HashMap::new(),
        };
        let mut found = Switches::default();
        for node in own {
            search.see(node, &mut found);
        }
        self.add_nested(&mut found);
        found
    }

    /// Adds conditions on conditions to what changes with them.
    fn add_nested(&self, found: &mut Switches) {
        for (k, condition) in found.conditions.iter().enumerate() {
            let needed = self.ancestors(&[*condition]);
            let has = |own: &usize| needed[found.conditions[*own].index()];
            for changed in &mut found.changed {
                if !changed.contains(&k) && changed.iter().any(has) {
                    changed.push(k);
                }
            }
        }
    }
}

impl Search<'_> {
    /// Adds what a node tells.
    fn see(&mut self, node: Node, found: &mut Switches) {
        let zero = self.graph.constant(0.0);
        match self.graph.operation(node) {
            Operation::Binary(Operator::Less | Operator::Equal, a, b) => {
                let own = found.conditions.len();
                found.conditions.push(node);
                let difference = self.graph.subtract(b, a);
                self.cross((difference, zero), Some(own), found);
            }
            Operation::Unary(Function::Sign, a) => {
                let own = found.conditions.len();
                found.conditions.push(node);
                self.cross((a, zero), Some(own), found);
            }
            Operation::Unary(Function::Abs, a) => self.cross((a, zero), None, found),
            Operation::Lookup(curve, a) => {
                let curve = self.graph.curves()[curve as usize].clone();
                for kink in curve.kinks() {
                    let level = self.graph.constant(kink);
                    self.cross((a, level), None, found);
                }
            }
            _ => {}
        }
    }

    /// Adds the times at which an expression crosses a level, and a condition may change.
    fn cross(
        &mut self,
        (expression, level): (Node, Node),
        condition: Option<usize>,
        found: &mut Switches,
    ) {
        for [offset, slope] in self.lines(expression).unwrap_or_default() {
            if self.graph.is_zero(slope) {
                continue;
            }
            let rest = self.graph.subtract(level, offset);
            let time = self.graph.divide(rest, slope);
            let known = found.times.iter().position(|own| *own == time);
            let place = known.unwrap_or(found.times.len());
            if known.is_none() {
                found.times.push(time);
                found.changed.push(Vec::new());
            }
            found.changed[place].extend(condition);
        }
    }

    /// The lines of which an expression consists, in any order and perhaps with others; None if it has other pieces.
    fn lines(&mut self, node: Node) -> Option<Vec<Line>> {
        if let Some(known) = self.lines.get(&node) {
            return known.clone();
        }
        let mut found = self.made(node);
        if let Some(lines) = &mut found {
            lines.sort_unstable();
            lines.dedup();
        }
        let found = found.filter(|lines| lines.len() <= MOST_LINES);
        self.lines.insert(node, found.clone());
        found
    }

    fn made(&mut self, node: Node) -> Option<Vec<Line>> {
        let (zero, one) = (self.graph.constant(0.0), self.graph.constant(1.0));
        // Nodes that were added here without time are differences of what does not vary.
        if !self.varies_with_time(node) {
            return Some(vec![[node, zero]]);
        }
        match self.graph.operation(node) {
            Operation::Variable(_) => Some(vec![[zero, one]]),
            Operation::Unary(Function::Negate, a) => Some(self.negated(a)?),
            Operation::Unary(Function::Abs, a) => {
                let mut both = self.lines(a)?;
                both.extend(self.negated(a)?);
                Some(both)
            }
            Operation::Unary(Function::Sign, _) => {
                let minus = self.graph.constant(-1.0);
                Some(vec![[one, zero], [minus, zero]])
            }
            Operation::Binary(Operator::Less | Operator::Equal, ..) => {
                Some(vec![[zero, zero], [one, zero]])
            }
            Operation::Binary(operator, a, b) => self.joined(operator, a, b),
            Operation::Select(_, a, b) => {
                let mut both = self.lines(a)?;
                both.extend(self.lines(b)?);
                Some(both)
            }
            _ => None,
        }
    }

    fn negated(&mut self, a: Node) -> Option<Vec<Line>> {
        let lines = self.lines(a)?.into_iter();
        Some(
            lines
                .map(|own| own.map(|part| self.graph.negate(part)))
                .collect(),
        )
    }

    fn joined(&mut self, operator: Operator, a: Node, b: Node) -> Option<Vec<Line>> {
        let (left, right) = (self.lines(a)?, self.lines(b)?);
        let graph = &mut *self.graph;
        let mut found = Vec::new();
        for a in &left {
            for b in &right {
                let (steady, other) = match graph.is_zero(b[1]) {
                    true => (b[0], a),
                    false => (a[0], b),
                };
                let is_scaled = graph.is_zero(a[1]) || graph.is_zero(b[1]);
                found.push(match operator {
                    Operator::Add | Operator::Subtract => {
                        [0, 1].map(|k| graph.binary(operator, a[k], b[k]))
                    }
                    Operator::Multiply if is_scaled => other.map(|k| graph.multiply(k, steady)),
                    Operator::Divide if graph.is_zero(b[1]) => a.map(|k| graph.divide(k, b[0])),
                    _ => return None,
                });
            }
        }
        Some(found)
    }

    fn varies_with_time(&mut self, node: Node) -> bool {
        if let Some(varies) = self.varies.get(node.index()) {
            return *varies;
        }
        let operations = self.graph.operations().iter();
        for operation in operations.skip(self.varies.len()) {
            let mut arguments = self.graph.arguments(*operation);
            let varies = arguments.any(|own| self.varies[own.index()]);
            self.varies.push(varies);
        }
        self.varies[node.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Curve;
    use std::sync::Arc;

    /// Times for `p = 3`, with a state that is not steady.
    fn times(of: impl Fn(&mut Graph, [Node; 3]) -> Node) -> (usize, Vec<f64>) {
        let mut graph = Graph::default();
        let [time, x, p] = [0, 1, 2].map(|k| graph.variable(k));
        let node = of(&mut graph, [time, x, p]);
        let found = graph.switches(&[node], |variable| variable == 2);
        // What is asked last depends on all that is asked before.
        let last = found.conditions.len().checked_sub(1);
        let mut changed = found.changed.iter().filter(|own| !own.is_empty());
        assert!(changed.all(|own| last.is_some_and(|last| own.contains(&last))));
        let values = graph.values(&[0.0, 0.0, 3.0]);
        let mut times: Vec<f64> = found.times.iter().map(|own| values[own.index()]).collect();
        times.sort_by(f64::total_cmp);
        (found.conditions.len(), times)
    }

    #[test]
    fn linear_conditions_tell_their_times() {
        // (4 t - p) / p < 5 is t < 4.5.
        let linear = times(|graph, [time, _, p]| {
            let four = graph.scale(4.0, time);
            let rest = graph.subtract(four, p);
            let part = graph.divide(rest, p);
            let five = graph.constant(5.0);
            graph.binary(Operator::Less, part, five)
        });
        assert_eq!(linear, (1, vec![4.5]));
        // |t - 2| < p / 2: a pulse, whose magnitude has a kink too.
        let pulse = times(|graph, [time, _, p]| {
            let two = graph.constant(2.0);
            let off = graph.subtract(time, two);
            let off = graph.unary(Function::Abs, off);
            let half = graph.scale(0.5, p);
            graph.binary(Operator::Less, off, half)
        });
        assert_eq!(pulse, (1, vec![0.5, 2.0, 3.5]));
    }

    #[test]
    fn tables_have_kinks_and_states_no_times() {
        let curve = Curve::through(vec![0.0, 1.0, 2.0, 4.0], vec![0.0, 1.0, 2.0, 2.0]);
        let curve = Arc::new(curve.expect("a curve"));
        let table = times(|graph, [time, ..]| {
            let twice = graph.scale(2.0, time);
            graph.lookup(&curve, twice)
        });
        // The line goes on at 1, and the end value follows 2.
        assert_eq!(table, (0, vec![0.0, 1.0]));
        let state = times(|graph, [time, x, _]| graph.binary(Operator::Less, time, x));
        assert_eq!(state, (0, vec![]));
        let curved = times(|graph, [time, ..]| {
            let square = graph.multiply(time, time);
            let one = graph.constant(1.0);
            graph.binary(Operator::Less, square, one)
        });
        assert_eq!(curved, (1, vec![]));
    }

    #[test]
    fn a_condition_on_a_condition_tells_its_times() {
        // The choice between thresholds changes with time itself.
        let found = times(|graph, [time, _, p]| {
            let [one, five] = [1.0, 5.0].map(|own| graph.constant(own));
            let early = graph.binary(Operator::Less, time, one);
            let level = graph.select(early, p, five);
            graph.binary(Operator::Less, level, time)
        });
        assert_eq!(found, (2, vec![1.0, 3.0, 5.0]));
    }
}
