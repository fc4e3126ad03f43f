//! Derivatives of expressions, as expressions of the same graph.

use super::graph::{Graph, Node};
use super::operation::{Function, Operation, Operator};

impl Graph {
    /// Derivatives of expressions with respect to a variable, in forward mode.
    pub fn derivatives(&mut self, of: &[Node], variable: usize) -> Vec<Node> {
        let zero = self.constant(0.0);
        let needed = self.ancestors(of);
        let depends = self.dependants(|index| index == variable);
        let mut by: Vec<Node> = vec![zero; needed.len()];
        for k in 0..needed.len() {
            if needed[k] && depends[k] {
                by[k] = match self.operations()[k] {
                    Operation::Variable(_) => self.constant(1.0),
                    _ => self.chain(self.node(k), &by),
                };
            }
        }
        of.iter().map(|node| by[node.index()]).collect()
    }

    /// The gradient of an expression with respect to these variables, in reverse mode.
    pub fn gradient(&mut self, of: Node, variables: &[Node]) -> Vec<Node> {
        let zero = self.constant(0.0);
        let one = self.constant(1.0);
        let mut adjoint: Vec<Node> = vec![zero; self.operations().len()];
        adjoint[of.index()] = one;
        for k in (0..=of.index()).rev() {
            if adjoint[k] == zero {
                continue;
            }
            let node = self.node(k);
            for (argument, partial) in self.partials(node) {
                let part = self.multiply(adjoint[k], partial);
                let sum = adjoint[argument.index()];
                adjoint[argument.index()] = self.add(sum, part);
            }
        }
        let own = |node: &Node| adjoint.get(node.index()).copied().unwrap_or(zero);
        variables.iter().map(own).collect()
    }

    /// The chain rule for one node, given the derivatives of its arguments.
    fn chain(&mut self, node: Node, by: &[Node]) -> Node {
        if let Operation::Select(condition, yes, no) = self.operation(node) {
            return self.select(condition, by[yes.index()], by[no.index()]);
        }
        let mut sum = self.constant(0.0);
        for (argument, partial) in self.partials(node) {
            let part = self.multiply(partial, by[argument.index()]);
            sum = self.add(sum, part);
        }
        sum
    }

    /// The partial derivatives of a node with respect to its arguments, one entry per argument position.
    fn partials(&mut self, node: Node) -> Vec<(Node, Node)> {
        match self.operation(node) {
            Operation::Constant(_) | Operation::Variable(_) => Vec::new(),
            Operation::Unary(function, a) => vec![(a, self.slope(function, a, node))],
            Operation::Binary(operator, a, b) => self.slopes(operator, a, b, node),
            Operation::Select(condition, a, b) => {
                let (zero, one) = (self.constant(0.0), self.constant(1.0));
                let yes = self.select(condition, one, zero);
                let no = self.select(condition, zero, one);
                vec![(a, yes), (b, no)]
            }
            Operation::Lookup(curve, a) => {
                let slope = self.curves()[curve as usize].slope();
                vec![(a, self.lookup(&slope.into(), a))]
            }
            Operation::Call(call, partial) => {
                let call = self.calls()[call as usize].clone();
                let mut slopes = Vec::new();
                for (place, argument) in call.taken(partial) {
                    if let Some(higher) = partial.by(place) {
                        let slope = self.call(&call.function, &call.arguments, higher);
                        slopes.push((argument, slope));
                    }
                }
                slopes
            }
        }
    }

    /// The derivative of a function whose value is the node `own`.
    fn slope(&mut self, function: Function, a: Node, own: Node) -> Node {
        let one = self.constant(1.0);
        match function {
            Function::Negate => self.constant(-1.0),
            Function::Reciprocal => {
                let square = self.multiply(own, own);
                self.negate(square)
            }
            Function::Sqrt => {
                let half = self.constant(0.5);
                self.divide(half, own)
            }
            Function::Cbrt => {
                let square = self.multiply(own, own);
                let three = self.scale(3.0, square);
                self.unary(Function::Reciprocal, three)
            }
            Function::Exp => own,
            Function::ExpM1 => self.add(own, one),
            Function::Ln => self.unary(Function::Reciprocal, a),
            Function::Ln1p => {
                let by = self.add(a, one);
                self.unary(Function::Reciprocal, by)
            }
            Function::Sin => self.unary(Function::Cos, a),
            Function::Cos => {
                let sine = self.unary(Function::Sin, a);
                self.negate(sine)
            }
            Function::Tan => {
                let square = self.multiply(own, own);
                self.add(square, one)
            }
            Function::Tanh => {
                let square = self.multiply(own, own);
                self.subtract(one, square)
            }
            Function::Sinh => self.unary(Function::Cosh, a),
            Function::Cosh => self.unary(Function::Sinh, a),
            Function::Asin | Function::Acosh | Function::Asinh | Function::Acos => {
                self.slope_of_inverse(function, a)
            }
            Function::Atan | Function::Atanh => {
                let square = self.multiply(a, a);
                let by = match function {
                    Function::Atan => self.add(one, square),
                    _ => self.subtract(one, square),
                };
                self.unary(Function::Reciprocal, by)
            }
            Function::Abs => self.unary(Function::Sign, a),
            Function::Sign => self.constant(0.0),
        }
    }

    /// `±1/√(±1 ± a²)`.
    fn slope_of_inverse(&mut self, function: Function, a: Node) -> Node {
        let one = self.constant(1.0);
        let square = self.multiply(a, a);
        let radicand = match function {
            Function::Asinh => self.add(square, one),
            Function::Acosh => self.subtract(square, one),
            _ => self.subtract(one, square),
        };
        let root = self.unary(Function::Sqrt, radicand);
        let slope = self.unary(Function::Reciprocal, root);
        match function {
            Function::Acos => self.negate(slope),
            _ => slope,
        }
    }

    /// The derivatives of an operator, whose value is the node `own`, with respect to both arguments.
    fn slopes(&mut self, operator: Operator, a: Node, b: Node, own: Node) -> Vec<(Node, Node)> {
        let one = self.constant(1.0);
        match operator {
            Operator::Add => vec![(a, one), (b, one)],
            Operator::Subtract => {
                let minus = self.constant(-1.0);
                vec![(a, one), (b, minus)]
            }
            Operator::Multiply => vec![(a, b), (b, a)],
            Operator::Divide => {
                let by_a = self.unary(Function::Reciprocal, b);
                let quotient = self.divide(own, b);
                let by_b = self.negate(quotient);
                vec![(a, by_a), (b, by_b)]
            }
            Operator::Power => {
                let less = self.subtract(b, one);
                let lower = self.binary(Operator::Power, a, less);
                let by_a = self.multiply(b, lower);
                let mut slopes = vec![(a, by_a)];
                if self.value(b).is_none() {
                    let logarithm = self.unary(Function::Ln, a);
                    let by_b = self.multiply(own, logarithm);
                    slopes.push((b, by_b));
                }
                slopes
            }
            Operator::Atan2 => {
                let (squares, other) = (self.multiply(a, a), self.multiply(b, b));
                let length = self.add(squares, other);
                let by_a = self.divide(b, length);
                let quotient = self.divide(a, length);
                let by_b = self.negate(quotient);
                vec![(a, by_a), (b, by_b)]
            }
            Operator::Less | Operator::Equal => Vec::new(),
            Operator::Remainder => {
                // b trunc(a/b) is a - own.
                let whole = self.subtract(a, own);
                let count = self.divide(whole, b);
                let by_b = self.negate(count);
                vec![(a, one), (b, by_b)]
            }
        }
    }
}
