//! Expressions as a graph of operations: equal ones stand in it once, and what is constant is computed as it
//! is built.

use super::curve::Curve;
use super::opaque::{Call, Opaque, Partial};
use super::operation::{Function, Operation, Operator};
use std::collections::HashMap;
use std::sync::Arc;

/// Largest whole exponent whose power becomes products.
const LONGEST_CHAIN: f64 = 32.0;

/// An expression: a place in a [`Graph`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(u32);

impl Node {
    /// Its place in the graph; arguments stand before what uses them.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Expressions over variables, which are counted from 0.
///
/// A product with the constant 0 is 0, whatever the other factor: derivatives become as sparse as they are.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    operations: Vec<Operation>,
    known: HashMap<Operation, Node>,
    curves: Vec<Arc<Curve>>,
    calls: Vec<Call>,
}

impl Graph {
    /// The operations, in an order in which they can be computed.
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// What a node computes.
    pub fn operation(&self, node: Node) -> Operation {
        self.operations[node.index()]
    }

    /// The curves that are looked up.
    pub fn curves(&self) -> &[Arc<Curve>] {
        &self.curves
    }

    /// The calls of functions that are no expressions.
    pub fn calls(&self) -> &[Call] {
        &self.calls
    }

    /// The nodes that an operation takes.
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

    /// A number.
    pub fn constant(&mut self, value: f64) -> Node {
        self.insert(Operation::Constant(value.to_bits()))
    }

    /// A variable.
    pub fn variable(&mut self, index: usize) -> Node {
        self.insert(Operation::Variable(index as u32))
    }

    /// A variable that stands in the graph.
    pub fn known_variable(&self, index: usize) -> Option<Node> {
        self.known.get(&Operation::Variable(index as u32)).copied()
    }

    /// The number that a node is, if it is one.
    pub fn value(&self, node: Node) -> Option<f64> {
        match self.operation(node) {
            Operation::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// True where a node is the number 0.
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

    /// Two expressions joined by an operator.
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

    /// The second expression where the first is not 0, else the third.
    pub fn select(&mut self, condition: Node, yes: Node, no: Node) -> Node {
        match self.value(condition) {
            Some(0.0) => no,
            Some(_) => yes,
            None if yes == no => yes,
            None => self.insert(Operation::Select(condition, yes, no)),
        }
    }

    /// The smaller of two.
    pub fn smaller(&mut self, a: Node, b: Node) -> Node {
        let is_less = self.binary(Operator::Less, b, a);
        self.select(is_less, b, a)
    }

    /// The larger of two.
    pub fn larger(&mut self, a: Node, b: Node) -> Node {
        let is_less = self.binary(Operator::Less, a, b);
        self.select(is_less, b, a)
    }

    /// A curve at an expression.
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

    /// A value of a function that is no expression, or a derivative of one. An argument without a node is one that it
    /// does not depend on.
    ///
    /// # Panics
    /// When there are not as many arguments as the function has, or one is missing.
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
    /// Where there are fewer variables than the graph has.
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

    /// What of a call can be told, once these nodes have their values.
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

    /// Takes expressions over from another graph, whose variable `k` is `variables[k]` here.
    ///
    /// # Panics
    /// Where an expression has a variable that is not in the list.
    pub fn import(&mut self, from: &Self, expressions: &[Node], variables: &[Node]) -> Vec<Node> {
        let needed = from.ancestors(expressions);
        let mut here: Vec<Option<Node>> = vec![None; from.operations.len()];
        for (k, operation) in from.operations.iter().enumerate() {
            if needed[k] {
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

    /// Which nodes are needed for these, themselves among them.
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

    /// Which nodes depend on a variable that `is_meant`.
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

    /// The expression whose opposite a node is.
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

    /// A power whose exponent is a number: products where it is whole and small.
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

    /// The node at a place.
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
