//! Expressions as a graph of operations: equal expressions are stored once, and constants are folded during
//! construction.

use super::curve::Curve;
use super::opaque::{Call, Opaque, Partial};
use super::operation::{Function, Operation, Operator};
use std::collections::HashMap;
use std::sync::Arc;

/// Largest integer exponent for which a power is expanded into products.
const LONGEST_CHAIN: f64 = 32.0;

/// An expression: an index into a [`Graph`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(u32);

impl Node {
    /// The index in the graph; arguments precede the nodes that use them.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Expressions over variables, which are numbered from 0.
///
/// A product with the constant 0 is 0, whatever the other factor, which keeps derivatives sparse.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    operations: Vec<Operation>,
    known: HashMap<Operation, Node>,
    curves: Vec<Arc<Curve>>,
    calls: Vec<Call>,
}

impl Graph {
    /// The operations in an order of evaluation.
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// The operation of a node.
    pub fn operation(&self, node: Node) -> Operation {
        self.operations[node.index()]
    }

    /// The curves used by lookups.
    pub fn curves(&self) -> &[Arc<Curve>] {
        &self.curves
    }

    /// The calls of opaque functions.
    pub fn calls(&self) -> &[Call] {
        &self.calls
    }

    /// The arguments of an operation.
    pub fn arguments(&self, operation: Operation) -> impl Iterator<Item = Node> {
        let (few, called) = match operation {
            Operation::Constant(_) | Operation::Variable(_) => ([None; 3], None),
            Operation::Unary(_, a) | Operation::Lookup(_, a) => ([Some(a), None, None], None),
            Operation::Binary(_, a, b) => ([Some(a), Some(b), None], None),
            Operation::Select(a, b, c) => ([Some(a), Some(b), Some(c)], None),
            Operation::Call(call, partial) => ([None; 3], Some((call, partial))),
        };
        let taken = called.map(|(call, partial)| self.calls[call as usize].taken(partial));
        let taken = taken.into_iter().flatten();
        few.into_iter().flatten().chain(taken.map(|(_, node)| node))
    }

    /// A constant.
    pub fn constant(&mut self, value: f64) -> Node {
        self.insert(Operation::Constant(value.to_bits()))
    }

    /// A variable.
    pub fn variable(&mut self, index: usize) -> Node {
        self.insert(Operation::Variable(index as u32))
    }

    /// A variable, if it is in the graph.
    pub fn known_variable(&self, index: usize) -> Option<Node> {
        self.known.get(&Operation::Variable(index as u32)).copied()
    }

    /// The value of a node, if it is a constant.
    pub fn value(&self, node: Node) -> Option<f64> {
        match self.operation(node) {
            Operation::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// True if a node is the constant 0.
    pub fn is_zero(&self, node: Node) -> bool {
        self.value(node) == Some(0.0)
    }

    /// A function of an expression.
    pub fn unary(&mut self, function: Function, a: Node) -> Node {
        if let Some(value) = self.value(a) {
            return self.constant(function.of(value));
        }
        match (function, self.negated(a)) {
            (Function::Negate, Some(inner)) => inner,
            _ => self.insert(Operation::Unary(function, a)),
        }
    }

    /// A binary operator applied to two expressions.
    pub fn binary(&mut self, operator: Operator, a: Node, b: Node) -> Node {
        let (left, right) = (self.value(a), self.value(b));
        if let (Some(left), Some(right)) = (left, right) {
            return self.constant(operator.of(left, right));
        }
        match (operator, left, right) {
            (Operator::Add, Some(0.0), _) | (Operator::Multiply, Some(1.0), _) => b,
            (Operator::Add | Operator::Subtract, _, Some(0.0)) => a,
            (Operator::Multiply | Operator::Divide, _, Some(1.0)) => a,
            (Operator::Multiply | Operator::Divide, Some(0.0), _) => self.constant(0.0),
            (Operator::Multiply, _, Some(0.0)) => self.constant(0.0),
            (Operator::Subtract, Some(0.0), _) | (Operator::Multiply, Some(-1.0), _) => {
                self.negate(b)
            }
            (Operator::Multiply | Operator::Divide, _, Some(-1.0)) => self.negate(a),
            (Operator::Power, _, Some(exponent)) => self.constant_power(a, exponent),
            _ => self.signed(operator, a, b),
        }
    }

    /// The second expression if the first is not 0, else the third.
    pub fn select(&mut self, condition: Node, yes: Node, no: Node) -> Node {
        match self.value(condition) {
            Some(0.0) => no,
            Some(_) => yes,
            None if yes == no => yes,
            None => self.insert(Operation::Select(condition, yes, no)),
        }
    }

    /// The smaller of two expressions.
    pub fn smaller(&mut self, a: Node, b: Node) -> Node {
        let is_less = self.binary(Operator::Less, b, a);
        self.select(is_less, b, a)
    }

    /// The larger of two expressions.
    pub fn larger(&mut self, a: Node, b: Node) -> Node {
        let is_less = self.binary(Operator::Less, a, b);
        self.select(is_less, b, a)
    }

    /// The value of a curve at an expression.
    pub fn lookup(&mut self, curve: &Arc<Curve>, at: Node) -> Node {
        if let Some(constant) = curve.constant() {
            return self.constant(constant);
        }
        if let Some(at) = self.value(at) {
            return self.constant(curve.at(at));
        }
        let known = self.curves.iter().position(|own| own == curve);
        let index = known.unwrap_or_else(|| {
            self.curves.push(curve.clone());
            self.curves.len() - 1
        });
        self.insert(Operation::Lookup(index as u32, at))
    }

    /// A value of an opaque function, or a derivative of it. Arguments without a node are those on which it does not
    /// depend.
    ///
    /// # Panics
    /// If the number of arguments differs from that of the function, or a required one is missing.
    pub fn call(
        &mut self,
        function: &Arc<dyn Opaque>,
        arguments: &[Option<Node>],
        partial: Partial,
    ) -> Node {
        assert_eq!(
            arguments.len(),
            function.neutral().len(),
            "the function's arguments"
        );
        if !function.depends(partial) {
            return self.constant(0.0);
        }
        let call = Call::new(function, arguments);
        let values: Option<Vec<(usize, f64)>> = (call.taken(partial))
            .map(|(place, node)| Some((place, self.value(node)?)))
            .collect();
        if let Some(values) = values {
            return self.constant(call.at(&values, partial));
        }
        let known = self.calls.iter().position(|own| *own == call);
        let index = known.unwrap_or_else(|| {
            self.calls.push(call);
            self.calls.len() - 1
        });
        self.insert(Operation::Call(index as u32, partial))
    }

    /// The values of all nodes at one point.
    ///
    /// # Panics
    /// If there are fewer variables than in the graph.
    pub fn values(&self, variables: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.operations.len());
        let mut called: HashMap<Operation, f64> = HashMap::new();
        for operation in &self.operations {
            let of = |node: Node| values[node.index()];
            let value = match *operation {
                Operation::Constant(bits) => f64::from_bits(bits),
                Operation::Variable(index) => variables[index as usize],
                Operation::Unary(function, a) => function.of(of(a)),
                Operation::Binary(operator, a, b) => operator.of(of(a), of(b)),
                Operation::Select(condition, a, b) => match of(condition) != 0.0 {
                    true => of(a),
                    false => of(b),
                },
                Operation::Lookup(curve, a) => self.curves[curve as usize].at(of(a)),
                Operation::Call(call, _) => {
                    if !called.contains_key(operation) {
                        called.extend(self.called(call, &values));
                    }
                    called[operation]
                }
            };
            values.push(value);
        }
        values
    }

    /// The values of a call that can be computed once these nodes have their values.
    fn called(&self, number: u32, values: &[f64]) -> Vec<(Operation, f64)> {
        let call = &self.calls[number as usize];
        let is_ready = |operation: Operation| {
            (self.arguments(operation)).all(|node| node.index() < values.len())
        };
        let own = self
            .operations
            .iter()
            .filter_map(|operation| match *operation {
                Operation::Call(other, partial) if other == number && is_ready(*operation) => {
                    Some(partial)
                }
                _ => None,
            });
        let own: Vec<Partial> = own.collect();
        let mut found = vec![0.0; own.len()];
        call.evaluate(&own, |node| values[node.index()], &mut found);
        let operations = own.iter().map(|partial| Operation::Call(number, *partial));
        operations.zip(found).collect()
    }

    /// `-a`.
    pub fn negate(&mut self, a: Node) -> Node {
        self.unary(Function::Negate, a)
    }

    /// `a + b`.
    pub fn add(&mut self, a: Node, b: Node) -> Node {
        self.binary(Operator::Add, a, b)
    }

    /// `a - b`.
    pub fn subtract(&mut self, a: Node, b: Node) -> Node {
        self.binary(Operator::Subtract, a, b)
    }

    /// `a b`.
    pub fn multiply(&mut self, a: Node, b: Node) -> Node {
        self.binary(Operator::Multiply, a, b)
    }

    /// `a / b`.
    pub fn divide(&mut self, a: Node, b: Node) -> Node {
        self.binary(Operator::Divide, a, b)
    }

    /// `factor a`.
    pub fn scale(&mut self, factor: f64, a: Node) -> Node {
        let factor = self.constant(factor);
        self.multiply(factor, a)
    }

    /// Imports expressions from another graph, whose variable `k` is `variables[k]` here.
    ///
    /// # Panics
    /// If an expression has a variable that is not in the list.
    pub fn import(&mut self, from: &Self, expressions: &[Node], variables: &[Node]) -> Vec<Node> {
        self.import_with(from, expressions, variables, &HashMap::new())
    }

    /// The same with some expressions of the other graph replaced by those of this one.
    ///
    /// # Panics
    /// As [`Self::import`].
    pub fn import_with(
        &mut self,
        from: &Self,
        expressions: &[Node],
        variables: &[Node],
        replaced: &HashMap<Node, Node>,
    ) -> Vec<Node> {
        let needed = from.ancestors(expressions);
        let mut here: Vec<Option<Node>> = vec![None; from.operations.len()];
        for (k, operation) in from.operations.iter().enumerate() {
            if let Some(own) = replaced.get(&from.node(k)) {
                here[k] = Some(*own);
            } else if needed[k] {
                let of = |node: Node| here[node.index()].expect("arguments stand before");
                here[k] = Some(match *operation {
                    Operation::Constant(bits) => self.constant(f64::from_bits(bits)),
                    Operation::Variable(index) => variables[index as usize],
                    Operation::Unary(function, a) => self.unary(function, of(a)),
                    Operation::Binary(operator, a, b) => self.binary(operator, of(a), of(b)),
                    Operation::Select(c, a, b) => self.select(of(c), of(a), of(b)),
                    Operation::Lookup(curve, a) => self.lookup(&from.curves[curve as usize], of(a)),
                    Operation::Call(call, partial) => {
                        let call = &from.calls[call as usize];
                        let known = |node: &Option<Node>| here[node.as_ref()?.index()];
                        let arguments: Vec<Option<Node>> =
                            call.arguments.iter().map(known).collect();
                        self.call(&call.function, &arguments, partial)
                    }
                });
            }
        }
        let of = |node: &Node| here[node.index()].expect("an ancestor of itself");
        expressions.iter().map(of).collect()
    }

    /// True for the nodes needed for these, including themselves.
    pub fn ancestors(&self, of: &[Node]) -> Vec<bool> {
        let mut needed = vec![false; self.operations.len()];
        of.iter().for_each(|node| needed[node.index()] = true);
        for k in (0..self.operations.len()).rev() {
            if needed[k] {
                let arguments = self.arguments(self.operations[k]);
                arguments.for_each(|node| needed[node.index()] = true);
            }
        }
        needed
    }

    /// True for the nodes that depend on a variable for which `is_meant` holds.
    pub fn dependants(&self, is_meant: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut depends = vec![false; self.operations.len()];
        for (k, operation) in self.operations.iter().enumerate() {
            depends[k] = match operation {
                Operation::Variable(index) => is_meant(*index as usize),
                other => self.arguments(*other).any(|node| depends[node.index()]),
            };
        }
        depends
    }

    /// The argument of a negation.
    fn negated(&self, node: Node) -> Option<Node> {
        match self.operation(node) {
            Operation::Unary(Function::Negate, inner) => Some(inner),
            _ => None,
        }
    }

    /// Moves signs out of sums, products and quotients.
    fn signed(&mut self, operator: Operator, a: Node, b: Node) -> Node {
        match (operator, self.negated(a), self.negated(b)) {
            (Operator::Add, _, Some(b)) => self.binary(Operator::Subtract, a, b),
            (Operator::Add, Some(a), _) => self.binary(Operator::Subtract, b, a),
            (Operator::Subtract, _, Some(b)) => self.binary(Operator::Add, a, b),
            (Operator::Subtract, ..) if a == b => self.constant(0.0),
            (Operator::Multiply | Operator::Divide, Some(a), _) => {
                let positive = self.binary(operator, a, b);
                self.negate(positive)
            }
            (Operator::Multiply | Operator::Divide, _, Some(b)) => {
                let positive = self.binary(operator, a, b);
                self.negate(positive)
            }
            (Operator::Add | Operator::Multiply, ..) if b < a => {
                self.insert(Operation::Binary(operator, b, a))
            }
            _ => self.insert(Operation::Binary(operator, a, b)),
        }
    }

    /// A power with a constant exponent: expanded into products if the exponent is a small integer.
    fn constant_power(&mut self, a: Node, exponent: f64) -> Node {
        if exponent == 0.5 {
            return self.unary(Function::Sqrt, a);
        }
        if exponent.fract() != 0.0 || exponent.abs() > LONGEST_CHAIN {
            let exponent = self.constant(exponent);
            return self.insert(Operation::Binary(Operator::Power, a, exponent));
        }
        let (mut left, mut square) = (exponent.abs() as u32, a);
        let mut product = self.constant(1.0);
        while left > 0 {
            if left % 2 == 1 {
                product = self.multiply(product, square);
            }
            left /= 2;
            if left > 0 {
                square = self.multiply(square, square);
            }
        }
        match exponent < 0.0 {
            true => self.unary(Function::Reciprocal, product),
            false => product,
        }
    }

    /// The node at an index.
    pub(super) fn node(&self, place: usize) -> Node {
        debug_assert!(place < self.operations.len());
        Node(place as u32)
    }

    fn insert(&mut self, operation: Operation) -> Node {
        let next = Node(self.operations.len() as u32);
        let node = *self.known.entry(operation).or_insert(next);
        if node == next {
            self.operations.push(operation);
        }
        node
    }
}
