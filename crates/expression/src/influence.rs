//! On what expressions depend, and how.

use super::graph::{Graph, Node};
use super::operation::{Function, Operation, Operator};

/// A set of variables, a bit for each.
type Set = Vec<u64>;

/// The variables on which a node depends, and those of them that do not enter with a constant factor.
#[derive(Clone, Default)]
struct Influence {
    all: Set,
    bent: Set,
}

fn unite(own: &mut Set, other: &[u64]) {
    own.resize(own.len().max(other.len()), 0);
    own.iter_mut()
        .zip(other)
        .for_each(|(own, other)| *own |= other);
}

impl Graph {
    /// For each expression, the variables on which it depends, in ascending order, each with whether it enters linearly
    /// with a constant factor, by the operations between. The effort is that of a pass over the graph for each 64
    /// variables.
    pub fn influences(&self, of: &[Node]) -> Vec<Vec<(usize, bool)>> {
        let mut known: Vec<Influence> = Vec::with_capacity(self.operations().len());
        for operation in self.operations() {
            let mut own = Influence::default();
            if let Operation::Variable(index) = operation {
                let index = *index as usize;
                own.all.resize(index / 64 + 1, 0);
                own.all[index / 64] = 1 << (index % 64);
            }
            for argument in self.arguments(*operation) {
                let argument_of = &known[argument.index()];
                unite(&mut own.all, &argument_of.all);
                let is_straight = self.is_straight(*operation, argument);
                let bent = if is_straight {
                    &argument_of.bent
                } else {
                    &argument_of.all
                };
                unite(&mut own.bent, bent);
            }
            known.push(own);
        }
        let row = |node: &Node| {
            let Influence { all, bent } = &known[node.index()];
            let has = |set: &Set, k: usize| {
                set.get(k / 64)
                    .is_some_and(|bits| bits >> (k % 64) & 1 == 1)
            };
            let depends = (0..64 * all.len()).filter(|k| has(all, *k));
            depends.map(|k| (k, !has(bent, k))).collect()
        };
        of.iter().map(row).collect()
    }

    /// Whether an operation is linear in an argument, with a constant factor.
    fn is_straight(&self, operation: Operation, argument: Node) -> bool {
        let is_number = |node: Node| self.value(node).is_some();
        match operation {
            Operation::Unary(Function::Negate, _) => true,
            Operation::Binary(Operator::Add | Operator::Subtract, ..) => true,
            Operation::Binary(Operator::Multiply, a, b) => {
                is_number(if argument == a { b } else { a })
            }
            Operation::Binary(Operator::Divide, above, below) => {
                argument == above && is_number(below)
            }
            _ => false,
        }
    }
}
