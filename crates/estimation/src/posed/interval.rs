//! Ranges of expressions by interval arithmetic (Moore, *Interval Analysis*, 1966): never too narrow, but possibly too
//! wide if a variable occurs twice.

use pilotage_expression::{Function, Graph, Operation, Operator};

/// Lower and upper bound.
pub type Interval = [f64; 2];

/// All real numbers.
pub const ALL: Interval = [f64::NEG_INFINITY, f64::INFINITY];

/// The interval of each node, given those of the variables.
pub fn intervals(graph: &Graph, variables: &[Interval]) -> Vec<Interval> {
    let mut found: Vec<Interval> = Vec::with_capacity(graph.operations().len());
    for operation in graph.operations() {
        let own = match *operation {
            Operation::Constant(bits) => [f64::from_bits(bits); 2],
            Operation::Variable(k) => variables[k as usize],
            Operation::Unary(function, a) => unary(function, found[a.index()]),
            Operation::Binary(operator, a, b) => {
                binary(operator, found[a.index()], found[b.index()])
            }
            Operation::Select(_, a, b) => {
                let [a, b] = [found[a.index()], found[b.index()]];
                [a[0].min(b[0]), a[1].max(b[1])]
            }
            Operation::Lookup(..) | Operation::Call(..) => ALL,
        };
        found.push(match own.iter().any(|end| end.is_nan()) {
            true => ALL,
            false => own,
        });
    }
    found
}

/// Intersection of two intervals. None if it is empty.
pub fn shared(a: Interval, b: Interval) -> Option<Interval> {
    let both = [a[0].max(b[0]), a[1].min(b[1])];
    (both[0] <= both[1]).then_some(both)
}

fn unary(function: Function, a: Interval) -> Interval {
    match function {
        Function::Negate => [-a[1], -a[0]],
        Function::Reciprocal => reciprocal(a),
        Function::Sqrt | Function::Ln => [a[0].max(0.0), a[1]].map(|end| function.of(end)),
        Function::Exp | Function::Tanh | Function::Atan => a.map(|end| function.of(end)),
        Function::Sin | Function::Cos | Function::Sign => [-1.0, 1.0],
        Function::Abs if a[0] >= 0.0 => a,
        Function::Abs if a[1] <= 0.0 => [-a[1], -a[0]],
        Function::Abs => [0.0, a[1].max(-a[0])],
        _ => ALL,
    }
}

fn binary(operator: Operator, a: Interval, b: Interval) -> Interval {
    match operator {
        Operator::Add => [a[0] + b[0], a[1] + b[1]],
        Operator::Subtract => [a[0] - b[1], a[1] - b[0]],
        Operator::Multiply => product(a, b),
        Operator::Divide => product(a, reciprocal(b)),
        Operator::Less | Operator::Equal => [0.0, 1.0],
        _ => ALL,
    }
}

fn reciprocal(a: Interval) -> Interval {
    match a[0] > 0.0 || a[1] < 0.0 {
        true => [1.0 / a[1], 1.0 / a[0]],
        false => ALL,
    }
}

fn product(a: Interval, b: Interval) -> Interval {
    // An infinite bound is never attained: 0 times it is 0.
    let times = |x: f64, y: f64| if x == 0.0 || y == 0.0 { 0.0 } else { x * y };
    let ends = [
        times(a[0], b[0]),
        times(a[0], b[1]),
        times(a[1], b[0]),
        times(a[1], b[1]),
    ];
    [
        ends.into_iter().fold(f64::INFINITY, f64::min),
        ends.into_iter().fold(f64::NEG_INFINITY, f64::max),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, Uniform};

    /// Values at random points lie within their intervals.
    #[test]
    fn values_lie_within_their_intervals() {
        let mut graph = Graph::default();
        let [x, y] = [graph.variable(0), graph.variable(1)];
        for a in [x, y] {
            use Function::{Abs, Atan, Cos, Exp, Ln, Negate, Reciprocal, Sign, Sin, Sqrt, Tanh};
            for function in [
                Negate, Reciprocal, Sqrt, Ln, Exp, Tanh, Atan, Sin, Cos, Sign, Abs,
            ] {
                let b = graph.unary(function, a);
                use Operator::{Add, Divide, Less, Multiply, Power, Subtract};
                for operator in [Add, Subtract, Multiply, Divide, Less, Power] {
                    graph.binary(operator, b, y);
                    graph.binary(operator, y, b);
                }
            }
        }
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for ends in [
            [[0.5, 2.0], [-3.0, 1.0]],
            [[-2.0, -1.0], [0.0, 4.0]],
            [[-1.0, 1.0], [2.0, 3.0]],
        ] {
            let found = intervals(&graph, &ends);
            for _ in 0..200 {
                let within =
                    |end: Interval| Uniform::new_inclusive(end[0], end[1]).expect("a range");
                let at = ends.map(|end| within(end).sample(&mut random));
                for (value, [low, high]) in graph.values(&at).iter().zip(&found) {
                    let slack = 1e-12 * (1.0 + value.abs());
                    let is_within = (low - slack..=high + slack).contains(value);
                    assert!(is_within || value.is_nan(), "{value}: {low} to {high}");
                }
            }
        }
    }
}
