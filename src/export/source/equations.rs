//! Expressions as straight-line C: a line for each operation, and for its derivatives along a direction.

use pilotage_expression::{Function, Graph, Node, Operation, Operator};
use std::fmt::Write;

/// Names of values, and of their first and second derivatives, along a direction, of time, states, inputs and parameters;
/// empty where there is none.
pub(super) type Names = [[&'static str; 4]; 3];

/// Where results are written: the place in C, the expression, and which derivative of it.
pub(super) type Target = (String, Node, usize);

/// A list of expressions of variables as C.
pub(super) struct Writer<'g> {
    pub(super) graph: &'g Graph,
    /// Numbers of states, inputs and parameters.
    pub(super) sizes: [usize; 3],
    /// Place of each state in the list of states, if that has others.
    pub(super) places: Option<&'g [usize]>,
    /// Number of the first curve of the graph among those of the file.
    pub(super) first_curve: usize,
    pub(super) names: Names,
}

/// An operation that C cannot express.
#[derive(Debug)]
pub(super) struct NoC;

impl Writer<'_> {
    /// The body of a function that writes these results.
    pub(super) fn body(&self, targets: &[Target]) -> Result<String, NoC> {
        let nodes: Vec<Node> = targets.iter().map(|(_, node, _)| *node).collect();
        let order = targets.iter().map(|(.., order)| *order).max().unwrap_or(0);
        let (needed, moving) = (self.graph.ancestors(&nodes), self.moving(targets));
        let mut text = String::new();
        // Writing to a String cannot fail.
        for name in self
            .names
            .iter()
            .flatten()
            .filter(|own| !own.is_empty() && is_name(own))
        {
            let _ = writeln!(text, "    (void){name};");
        }
        for (k, operation) in self
            .graph
            .operations()
            .iter()
            .enumerate()
            .filter(|(k, _)| needed[*k])
        {
            if is_leaf(operation) {
                continue;
            }
            let _ = writeln!(text, "    const double v{k} = {};", self.value(*operation)?);
            for part in (1..=order).filter(|_| moving[k]) {
                let rate = self.rate(k, part, &moving)?;
                let _ = writeln!(text, "    const double {} = {rate};", derived(k, part));
            }
        }
        for (place, node, part) in targets {
            let value = match part {
                0 => self.read(*node),
                part => self.part(*node, *part, &moving).unwrap_or("0.0".to_owned()),
            };
            let _ = writeln!(text, "    {place} = {value};");
        }
        Ok(text)
    }

    /// Nodes whose derivatives are needed and may differ from 0.
    fn moving(&self, targets: &[Target]) -> Vec<bool> {
        let operations = self.graph.operations();
        let mut varies = vec![false; operations.len()];
        for (k, operation) in operations.iter().enumerate() {
            varies[k] = match operation {
                Operation::Variable(variable) => !self.variable(*variable as usize, 1).is_empty(),
                other => passing(*other)
                    .into_iter()
                    .flatten()
                    .any(|own| varies[own.index()]),
            };
        }
        let mut is_asked = vec![false; operations.len()];
        for (_, node, part) in targets {
            is_asked[node.index()] |= *part > 0;
        }
        for k in (0..operations.len()).rev().filter(|k| varies[*k]) {
            if is_asked[k] {
                for own in passing(operations[k]).into_iter().flatten() {
                    is_asked[own.index()] = true;
                }
            }
        }
        varies
            .iter()
            .zip(is_asked)
            .map(|(varies, is_asked)| *varies && is_asked)
            .collect()
    }

    fn variable(&self, variable: usize, part: usize) -> String {
        let names = self.names[part];
        let [states, inputs, _] = self.sizes;
        let indexed = |name: &str, k: usize| match name {
            "" => String::new(),
            name => format!("{name}[{k}]"),
        };
        match variable.checked_sub(1) {
            None => names[0].to_owned(),
            Some(k) if k < states => indexed(names[1], self.places.map_or(k, |places| places[k])),
            Some(k) if k < states + inputs => indexed(names[2], k - states),
            Some(k) => indexed(names[3], k - states - inputs),
        }
    }

    fn read(&self, node: Node) -> String {
        match self.graph.operation(node) {
            Operation::Constant(bits) => number(f64::from_bits(bits)),
            Operation::Variable(variable) => self.variable(variable as usize, 0),
            _ => format!("v{}", node.index()),
        }
    }

    /// A derivative of a node, unless it is 0.
    fn part(&self, node: Node, part: usize, moving: &[bool]) -> Option<String> {
        match self.graph.operation(node) {
            Operation::Variable(variable) => {
                Some(self.variable(variable as usize, part)).filter(|own| !own.is_empty())
            }
            _ => moving[node.index()].then(|| derived(node.index(), part)),
        }
    }

    fn value(&self, operation: Operation) -> Result<String, NoC> {
        let read = |node| self.read(node);
        Ok(match operation {
            Operation::Unary(function, a) => function_of(function, &read(a)),
            Operation::Binary(operator, a, b) => binary(operator, &read(a), &read(b)),
            Operation::Select(a, b, c) => format!("{} != 0.0 ? {} : {}", read(a), read(b), read(c)),
            Operation::Lookup(curve, a) => self.lookup("curve", curve, &read(a)),
            Operation::Constant(_) | Operation::Variable(_) => String::new(),
            Operation::Call(..) => return Err(NoC),
        })
    }

    fn lookup(&self, function: &str, curve: u32, at: &str) -> String {
        let k = self.first_curve + curve as usize;
        format!("{function}(curve{k}_x, curve{k}_y, CURVE{k}, {at})")
    }

    /// A derivative of an operation, by the chain rule.
    fn rate(&self, k: usize, part: usize, moving: &[bool]) -> Result<String, NoC> {
        let read = |node: Node| self.read(node);
        let of =
            |node: Node, part: usize| self.part(node, part, moving).unwrap_or("0.0".to_owned());
        let value = format!("v{k}");
        Ok(match self.graph.operations()[k] {
            Operation::Unary(function, a) => {
                let [first, second] = slopes(function, &read(a), &value);
                match part {
                    1 => format!("({first}) * {}", of(a, 1)),
                    _ => format!(
                        "({second}) * {0} * {0} + ({first}) * {1}",
                        of(a, 1),
                        of(a, 2)
                    ),
                }
            }
            Operation::Binary(operator, a, b) => {
                let parts = [1, 2].map(|part| [of(a, part), of(b, part)]);
                binary_rate(
                    operator,
                    [&read(a), &read(b)],
                    &parts,
                    [&value, &derived(k, 1)],
                    part,
                )
            }
            Operation::Select(a, b, c) => {
                format!("{} != 0.0 ? {} : {}", read(a), of(b, part), of(c, part))
            }
            Operation::Lookup(curve, a) => format!(
                "{} * {}",
                self.lookup("curve_slope", curve, &read(a)),
                of(a, part)
            ),
            Operation::Constant(_) | Operation::Variable(_) => String::new(),
            Operation::Call(..) => return Err(NoC),
        })
    }
}

fn derived(k: usize, part: usize) -> String {
    format!("{}{k}", ["v", "d", "e"][part])
}

fn is_leaf(operation: &Operation) -> bool {
    matches!(operation, Operation::Constant(_) | Operation::Variable(_))
}

fn is_name(text: &str) -> bool {
    text.starts_with(|own: char| own.is_ascii_alphabetic())
}

/// The arguments whose derivatives an operation passes on.
fn passing(operation: Operation) -> [Option<Node>; 2] {
    match operation {
        Operation::Unary(Function::Sign, _) => [None, None],
        Operation::Unary(_, a) | Operation::Lookup(_, a) => [Some(a), None],
        Operation::Binary(Operator::Less | Operator::Equal, ..) => [None, None],
        Operation::Binary(_, a, b) | Operation::Select(_, a, b) => [Some(a), Some(b)],
        Operation::Constant(_) | Operation::Variable(_) | Operation::Call(..) => [None, None],
    }
}

/// A number in C.
pub(super) fn number(value: f64) -> String {
    match value {
        value if value.is_nan() => "NAN".to_owned(),
        f64::INFINITY => "HUGE_VAL".to_owned(),
        f64::NEG_INFINITY => "(-HUGE_VAL)".to_owned(),
        value if value.is_sign_negative() => format!("({value:?})"),
        value => format!("{value:?}"),
    }
}

fn function_of(function: Function, a: &str) -> String {
    match function {
        Function::Negate => format!("-{a}"),
        Function::Reciprocal => format!("1.0 / {a}"),
        Function::Abs => format!("{a} < 0.0 ? -{a} : {a}"),
        // 1 at 0, and no number where there is none.
        Function::Sign => format!("isnan({a}) ? {a} : copysign(1.0, {a})"),
        Function::Ln => format!("log({a})"),
        Function::Ln1p => format!("log1p({a})"),
        other => format!("{}({a})", format!("{other:?}").to_lowercase()),
    }
}

fn binary(operator: Operator, a: &str, b: &str) -> String {
    match operator {
        Operator::Add => format!("{a} + {b}"),
        Operator::Subtract => format!("{a} - {b}"),
        Operator::Multiply => format!("{a} * {b}"),
        Operator::Divide => format!("{a} / {b}"),
        Operator::Power => format!("pow({a}, {b})"),
        Operator::Atan2 => format!("atan2({a}, {b})"),
        Operator::Remainder => format!("{a} - {b} * trunc({a} / {b})"),
        Operator::Less => format!("{a} < {b} ? 1.0 : 0.0"),
        Operator::Equal => format!("{a} == {b} ? 1.0 : 0.0"),
    }
}

/// First and second derivative of a function at `a`, where its value is `v`.
fn slopes(function: Function, a: &str, v: &str) -> [String; 2] {
    let own = |first: String, second: String| [first, second];
    match function {
        Function::Negate => own("-1.0".into(), "0.0".into()),
        Function::Reciprocal => own(format!("-{v} * {v}"), format!("2.0 * {v} * {v} * {v}")),
        Function::Sqrt => own(
            format!("0.5 * {v} / {a}"),
            format!("-0.25 * {v} / ({a} * {a})"),
        ),
        Function::Cbrt => own(
            format!("{v} / {a} / 3.0"),
            format!("-2.0 * {v} / ({a} * {a}) / 9.0"),
        ),
        Function::Exp => own(v.into(), v.into()),
        Function::ExpM1 => own(format!("exp({a})"), format!("exp({a})")),
        Function::Ln => own(format!("1.0 / {a}"), format!("-1.0 / ({a} * {a})")),
        Function::Ln1p => own(
            format!("1.0 / (1.0 + {a})"),
            format!("-1.0 / ((1.0 + {a}) * (1.0 + {a}))"),
        ),
        Function::Sin => own(format!("cos({a})"), format!("-{v}")),
        Function::Cos => own(format!("-sin({a})"), format!("-{v}")),
        Function::Tan => own(
            format!("1.0 + {v} * {v}"),
            format!("2.0 * {v} * (1.0 + {v} * {v})"),
        ),
        Function::Asin => own(
            format!("1.0 / sqrt(1.0 - {a} * {a})"),
            format!("{a} / pow(1.0 - {a} * {a}, 1.5)"),
        ),
        Function::Acos => own(
            format!("-1.0 / sqrt(1.0 - {a} * {a})"),
            format!("-{a} / pow(1.0 - {a} * {a}, 1.5)"),
        ),
        Function::Atan => {
            let square = format!("(1.0 + {a} * {a})");
            own(
                format!("1.0 / {square}"),
                format!("-2.0 * {a} / ({square} * {square})"),
            )
        }
        Function::Sinh => own(format!("cosh({a})"), v.into()),
        Function::Cosh => own(format!("sinh({a})"), v.into()),
        Function::Tanh => own(
            format!("1.0 - {v} * {v}"),
            format!("-2.0 * {v} * (1.0 - {v} * {v})"),
        ),
        Function::Asinh => own(
            format!("1.0 / sqrt(1.0 + {a} * {a})"),
            format!("-{a} / pow(1.0 + {a} * {a}, 1.5)"),
        ),
        Function::Acosh => own(
            format!("1.0 / sqrt({a} * {a} - 1.0)"),
            format!("-{a} / pow({a} * {a} - 1.0, 1.5)"),
        ),
        Function::Atanh => {
            let square = format!("(1.0 - {a} * {a})");
            own(
                format!("1.0 / {square}"),
                format!("2.0 * {a} / ({square} * {square})"),
            )
        }
        Function::Abs => own(format!("{a} < 0.0 ? -1.0 : 1.0"), "0.0".into()),
        Function::Sign => own("0.0".into(), "0.0".into()),
    }
}

/// A derivative of an operator with this value and, for the second, this first derivative. `parts`: first and second derivatives
/// of both arguments.
fn binary_rate(
    operator: Operator,
    [a, b]: [&str; 2],
    parts: &[[String; 2]; 2],
    [v, d]: [&str; 2],
    part: usize,
) -> String {
    let [[a1, b1], [a2, b2]] = parts;
    let [own_a, own_b] = &parts[part - 1];
    match (operator, part) {
        (Operator::Add, _) => format!("{own_a} + {own_b}"),
        (Operator::Subtract, _) => format!("{own_a} - {own_b}"),
        (Operator::Multiply, 1) => format!("{a1} * {b} + {a} * {b1}"),
        (Operator::Multiply, _) => format!("{a2} * {b} + 2.0 * {a1} * {b1} + {a} * {b2}"),
        (Operator::Divide, 1) => format!("({a1} - {v} * {b1}) / {b}"),
        (Operator::Divide, _) => format!("({a2} - 2.0 * {d} * {b1} - {v} * {b2}) / {b}"),
        (Operator::Power, 1) => format!("power1({a}, {b}, {a1}, {b1})"),
        (Operator::Power, _) => format!("power2({a}, {b}, {a1}, {b1}, {a2}, {b2})"),
        (Operator::Atan2, 1) => format!("({b} * {a1} - {a} * {b1}) / ({a} * {a} + {b} * {b})"),
        (Operator::Atan2, _) => format!(
            "({b} * {a2} - {a} * {b2} - 2.0 * {d} * ({a} * {a1} + {b} * {b1})) / ({a} * {a} + {b} * {b})"
        ),
        (Operator::Remainder, _) => format!("{own_a} - {own_b} * trunc({a} / {b})"),
        (Operator::Less | Operator::Equal, _) => "0.0".to_owned(),
    }
}
