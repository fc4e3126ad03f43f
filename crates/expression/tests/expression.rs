//! Random expressions: compares tapes with direct evaluation, and derivatives with hyper-dual numbers.

use num_dual::{DualNum, DualStruct, HyperDual64};
use num_traits::Signed;
use pilotage_expression::{
    Function, Graph, Model, ModelError, Node, Obstacle, Opaque, Operator, Partial, System, Tape,
    Traced, trace,
};
use proptest::prelude::*;
use std::sync::Arc;

const VARIABLES: usize = 4;

/// Equations from a list of numbers: each takes two earlier values. All of them are smooth.
fn equations<T: DualNum<Primitive = f64> + Copy>(recipe: &[(u8, u8, u8)], x: &[T]) -> Vec<T> {
    let mut values = x.to_vec();
    for &(what, left, right) in recipe {
        let a = values[left as usize % values.len()];
        let b = values[right as usize % values.len()];
        let positive = b * b + 1.5;
        values.push(match what % 24 {
            0 | 1 => a + b,
            2 | 3 => a - b,
            4 | 5 => a * b * 0.5,
            6 => a / positive,
            7 => (a * 0.7).sin(),
            8 => (a * 0.7).cos(),
            9 => (-(a * a)).exp(),
            10 => positive.ln(),
            11 => positive.sqrt(),
            12 => a.tanh(),
            13 => a.atan(),
            14 => a.atan2(positive),
            15 => (a * 0.1).powi(3) + positive.powi(-2),
            16 => positive.powf(1.3),
            17 => positive.powd(a.tanh()),
            18 => (a / positive).sinh() - (b / positive).cosh(),
            19 => (a.tanh() * 0.9).asin() + (a.tanh() * 0.9).acos() * 0.5,
            20 => a.asinh() + positive.acosh(),
            21 => (a.tanh() * 0.9).atanh() + positive.cbrt(),
            22 => (a.tanh()).exp_m1() - positive.ln_1p() + a.tanh().tan(),
            _ => -a,
        });
        let last = values.len() - 1;
        // Keeps magnitudes near one.
        values[last] = values[last] / (values[last] * values[last] * 0.01 + 1.0);
    }
    values.split_off(values.len() - 3.min(values.len()))
}

fn recipe() -> impl Strategy<Value = Vec<(u8, u8, u8)>> {
    prop::collection::vec(any::<(u8, u8, u8)>(), 3..25)
}

fn taken(recipe: &[(u8, u8, u8)]) -> (Graph, Vec<Node>) {
    trace(VARIABLES, |x| equations(recipe, x)).unwrap()
}

/// Values of the expressions at a point.
fn values(graph: &Graph, nodes: &[Node], x: &[f64]) -> Vec<f64> {
    Tape::new(graph, VARIABLES, |_| false, &[nodes]).evaluate(x)
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-10 * (1.0 + a.abs().max(b.abs()))
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 256,
        rng_seed: proptest::test_runner::RngSeed::Fixed(16),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Divisions by early divisors become products, those by late ones stay divisions, for variables and results alike.
#[test]
fn a_tape_divides_by_what_is_known_early_and_by_what_is_not() {
    let mut graph = Graph::default();
    let [early, x, y] = [0, 1, 2].map(|k| graph.variable(k));
    let (sum, late) = (graph.add(early, early), graph.add(x, y));
    let pairs = [
        (x, early),
        (y, early),
        (x, sum),
        (early, x),
        (x, y),
        (early, late),
        (late, sum),
    ];
    let nodes = pairs.map(|(a, b)| graph.divide(a, b));
    let tape = Tape::new(&graph, 3, |variable| variable == 0, &[&nodes]);
    let mut registers = tape.registers::<4>();
    registers.set(0, [3.0; 4]);
    tape.run(0, &mut registers);
    registers.set(1, [5.0; 4]);
    registers.set(2, [7.0; 4]);
    tape.run(1, &mut registers);
    let expected = [
        5.0 / 3.0,
        7.0 / 3.0,
        5.0 / 6.0,
        3.0 / 5.0,
        5.0 / 7.0,
        0.25,
        2.0,
    ];
    for (register, expected) in tape.outputs(0).iter().zip(expected) {
        assert!(near(registers.get(*register)[2], expected), "{expected}");
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_tape_computes_what_the_equations_do(
        recipe in recipe(), points in prop::array::uniform4(prop::array::uniform4(-2.0..2.0_f64)),
    ) {
        let (graph, nodes) = taken(&recipe);
        // The first two variables are known early, and the last expression has a separate stage.
        let lists: [&[Node]; 2] = [&nodes[..2], &nodes[2..]];
        let tape = Tape::new(&graph, VARIABLES, |variable| variable < 2, &lists);
        let mut registers = tape.registers::<4>();
        let side_by_side = |k: usize| points.map(|x| x[k]);
        let early = points[0];
        (0..2).for_each(|k| registers.set(k, [early[k]; 4]));
        tape.run(0, &mut registers);
        (2..VARIABLES).for_each(|k| registers.set(k, side_by_side(k)));
        tape.run(1, &mut registers);
        tape.run(2, &mut registers);
        for (lane, point) in points.iter().enumerate() {
            let x = [early[0], early[1], point[2], point[3]];
            let expected = equations(&recipe, &x);
            let registers_of = tape.outputs(0).iter().chain(tape.outputs(1));
            for ((register, expected), alone) in registers_of.zip(&expected).zip(tape.evaluate(&x)) {
                prop_assert!(near(registers.get(*register)[lane], *expected));
                prop_assert!(near(alone, *expected));
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_hyper_dual_numbers(
        recipe in recipe(), x in prop::array::uniform4(-2.0..2.0_f64),
    ) {
        let (mut graph, nodes) = taken(&recipe);
        let variables: Vec<Node> = (0..VARIABLES).map(|k| graph.variable(k)).collect();
        let last = nodes[nodes.len() - 1];
        let gradient = graph.gradient(last, &variables);
        for i in 0..VARIABLES {
            let first = graph.derivatives(&nodes, i);
            prop_assert!(near(
                values(&graph, &gradient, &x)[i],
                *values(&graph, &first, &x).last().unwrap(),
            ));
            for j in 0..VARIABLES {
                let second = graph.derivatives(&first, j);
                let mut at: Vec<HyperDual64> = x.iter().map(|x| (*x).into()).collect();
                at[i].eps1 = 1.0;
                at[j].eps2 = 1.0;
                let exact = equations(&recipe, &at);
                let found = values(&graph, &first, &x).into_iter().zip(values(&graph, &second, &x));
                for (exact, (first, second)) in exact.iter().zip(found) {
                    prop_assert!(near(first, exact.eps1), "{first} {}", exact.eps1);
                    let scale = 1.0 + exact.eps1eps2.abs();
                    prop_assert!((second - exact.eps1eps2).abs() < 1e-8 * scale, "{second} {}", exact.eps1eps2);
                }
            }
        }
    }
}

#[test]
fn what_is_constant_or_equal_is_written_once() {
    let (mut graph, nodes) = trace(2, |x| {
        let zero = x[0] * 0.0;
        vec![
            zero + x[1],
            (x[0] + x[1]) * (x[1] + x[0]),
            x[0] - x[0],
            (x[0] * x[1]).powi(2),
        ]
    })
    .unwrap();
    assert_eq!(nodes[0], graph.variable(1));
    assert!(graph.is_zero(nodes[2]));
    // One sum and its square; one product and its square.
    let tape = Tape::new(&graph, 2, |_| false, &[&nodes]);
    assert_eq!(tape.len(), 4);
    let by = graph.derivatives(&nodes, 0);
    assert!(graph.is_zero(by[0]) && !graph.is_zero(by[1]));
}

#[test]
fn functions_with_kinks_have_their_derivatives_beside_them() {
    let kinks = |x: &[Traced]| vec![x[0].abs() + x[0].signum(), x[0] % x[1], x[0].abs_sub(&x[1])];
    let (mut graph, nodes) = trace(2, kinks).unwrap();
    let by = graph.derivatives(&nodes, 0);
    let all = |nodes: &[Node], x: [f64; 2]| Tape::new(&graph, 2, |_| false, &[nodes]).evaluate(&x);
    assert_eq!(all(&nodes, [-2.5, 2.0]), [1.5, -0.5, 0.0]);
    assert_eq!(all(&by, [-2.5, 2.0]), [-1.0, 1.0, 0.0]);
    assert_eq!(all(&by, [5.0, 2.0]), [1.0, 1.0, 1.0]);
}

#[test]
fn equations_that_look_at_numbers_are_told() {
    let clipped = trace(1, |x| vec![if x[0] > 1.0 { x[0] * 0.0 } else { x[0] }]);
    assert_eq!(clipped.unwrap_err(), Obstacle::Comparison);
    let looked = trace(1, |x| vec![Traced::from(x[0].re())]);
    assert_eq!(looked.unwrap_err(), Obstacle::Comparison);
    assert_eq!(
        trace(1, |x| vec![x[0].sph_j0()]).unwrap_err(),
        Obstacle::Bessel
    );
    // Comparing constants is permitted, and nested traces do not affect each other.
    let (graph, nodes) = trace(1, |x| {
        let half = Traced::from(0.5);
        let inner = trace(1, |x| vec![x[0] * 2.0]).unwrap();
        assert_eq!(inner.1.len(), 1);
        vec![if half < 1.0 { x[0] * half } else { x[0] }]
    })
    .unwrap();
    assert_eq!(
        Tape::new(&graph, 1, |_| false, &[&nodes]).evaluate(&[3.0]),
        [1.5]
    );
    // A loop that waits for a value ends, and so does a panic caused by a value.
    let newton = |x: &[Traced]| {
        let mut root = x[0];
        while (root * root - 2.0).re().abs().partial_cmp(&1e-12) != Some(std::cmp::Ordering::Less) {
            root = root - (root * root - 2.0) / (root * 2.0);
        }
        vec![root]
    };
    assert_eq!(trace(1, newton).unwrap_err(), Obstacle::Comparison);
    let unwrapping = trace(1, |x| {
        assert!(x[0].re() > 0.0, "of the user");
        x.to_vec()
    });
    assert_eq!(unwrapping.unwrap_err(), Obstacle::Comparison);
    let panicked = std::panic::catch_unwind(|| trace(1, |_| panic!("of the equations")));
    assert!(panicked.is_err() && trace(1, |x| x.to_vec()).is_ok());
}

/// `ẋ = u - p x`, outputs x and `2 u`.
fn lag() -> Model {
    let names: [&[&str]; 4] = [&["x"], &["u"], &["p"], &["double"]];
    Model::trace(names, |at| {
        [vec![at.u[0] - at.p[0] * at.x[0]], vec![at.u[0] * 2.0]]
    })
    .unwrap()
}

#[test]
fn joined_models_are_the_equations_put_together() {
    // The input of the second is the state of the first; the input of the third is twice that of the second.
    let wires = [("a.x", "b.u"), ("b.double", "c.u")];
    let joint = Model::join(&[("a", lag()), ("b", lag()), ("c", lag())], &wires).unwrap();
    assert_eq!(joint.states, ["a.x", "b.x", "c.x"]);
    assert_eq!(joint.inputs, ["a.u"]);
    assert_eq!(joint.parameters, ["a.p", "b.p", "c.p"]);
    let fixed = joint.with_values([("b.p", 3.0)]).unwrap();
    assert_eq!(fixed.parameters, ["a.p", "c.p"]);
    let System {
        graph,
        derivatives,
        outputs,
        ..
    } = fixed.observed(&["c.double", "a.x", "a.u"]).unwrap();
    let all = [derivatives, outputs].concat();
    // Time; states; input; parameters.
    let at = [0.0, 1.0, 2.0, 5.0, 7.0, 0.5, 0.25];
    let found = Tape::new(&graph, 7, |_| false, &[&all]).evaluate(&at);
    assert_eq!(found, [7.0 - 0.5, 1.0 - 6.0, 2.0 - 1.25, 4.0, 1.0, 7.0]);
}

#[test]
fn wires_that_are_wrong_are_named() {
    let join = |wires: &[(&str, &str)]| {
        let parts = [("a", lag()), ("b", lag())];
        Model::join(&parts, wires)
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    assert!(join(&[("a.double", "b.u"), ("b.double", "a.u")]).starts_with("algebraic loop: "));
    assert!(join(&[("a.double", "a.u")]).contains("a.u depends on itself"));
    assert!(join(&[("a.x", "b.u"), ("b.x", "b.u")]).contains("b.u is connected twice"));
    assert_eq!(
        join(&[("a.y", "b.u")]),
        "no signal is called a.y; there are double, x, u"
    );
    assert_eq!(
        join(&[("a.x", "b.v")]),
        "no input is called b.v; there are u"
    );
    assert_eq!(
        join(&[("c.x", "b.u")]),
        "no part is called c.x; there are a., b."
    );
    assert_eq!(
        join(&[("b.q", "a.u")]),
        "no signal is called b.q; there are double, x, u"
    );
    let same = [("a", lag()), ("a", lag())];
    let same = Model::join(&same, &[]).map(|_| ()).unwrap_err();
    assert_eq!(same, ModelError::Same("a.x".into()));
    let nested = [("a", lag()), ("a.b", lag())];
    assert!(Model::join(&nested, &[("a.x", "a.b.u"), ("a.b.x", "a.u")]).is_ok());
    // With a state in between, there is no algebraic loop.
    let loops = [("a.x", "b.u"), ("b.x", "a.u")];
    assert!(Model::join(&[("a", lag()), ("b", lag())], &loops).is_ok());
    let unknown = lag().with_values([("q", 1.0)]).map(|_| ()).unwrap_err();
    assert!(matches!(
        unknown,
        ModelError::Unknown {
            role: "parameter",
            ..
        }
    ));
}

/// `[a sin b, exp(a c)]` as an opaque function; the second value does not depend on b.
#[derive(Debug)]
struct Known;

impl Opaque for Known {
    fn neutral(&self) -> &[f64] {
        &[1.0, f64::NAN, 3.0]
    }

    fn depends(&self, partial: Partial) -> bool {
        let by: Vec<usize> = partial.arguments().collect();
        let none: &[&[usize]] = match partial.value {
            0 => &[&[2], &[0, 0], &[0, 2], &[1, 2], &[2, 2]],
            _ => &[&[1], &[0, 1], &[1, 1], &[1, 2]],
        };
        !none.contains(&by.as_slice())
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        let (a, b, c) = (at[0], at[1], at[2]);
        for (out, partial) in out.iter_mut().zip(wanted) {
            let by: Vec<usize> = partial.arguments().collect();
            let e = (a * c).exp();
            *out = match (partial.value, by.as_slice()) {
                (0, []) => a * b.sin(),
                (0, [0]) => b.sin(),
                (0, [1]) => a * b.cos(),
                (0, [0, 1]) => b.cos(),
                (0, [1, 1]) => -a * b.sin(),
                (1, []) => e,
                (1, [0]) => c * e,
                (1, [2]) => a * e,
                (1, [0, 0]) => c * c * e,
                (1, [0, 2]) => e + a * c * e,
                (1, [2, 2]) => a * a * e,
                other => panic!("{other:?} is not asked for"),
            };
        }
    }
}

/// The opaque function, or the same as expressions, of `x², x + y` and `y`, and the product of its values.
fn with_known(graph: &mut Graph, is_opaque: bool) -> Vec<Node> {
    let [x, y] = [0, 1].map(|k| graph.variable(k));
    let arguments = [graph.multiply(x, x), graph.add(x, y), y];
    let values = match is_opaque {
        true => {
            let function: Arc<dyn Opaque> = Arc::new(Known);
            let given = arguments.map(Some);
            [0, 1].map(|value| graph.call(&function, &given, Partial::of(value)))
        }
        false => {
            let sine = graph.unary(Function::Sin, arguments[1]);
            let exponent = graph.multiply(arguments[0], arguments[2]);
            [
                graph.multiply(arguments[0], sine),
                graph.unary(Function::Exp, exponent),
            ]
        }
    };
    let product = graph.multiply(values[0], values[1]);
    vec![values[0], values[1], product]
}

#[test]
fn opaque_functions_are_as_good_as_expressions() {
    let found = [true, false].map(|is_opaque| {
        let mut graph = Graph::default();
        let values = with_known(&mut graph, is_opaque);
        let nodes = [0, 1].map(|k| graph.variable(k));
        let mut all = values.clone();
        for k in 0..2 {
            let first = graph.derivatives(&values, k);
            all.extend(first.clone());
            (0..2).for_each(|l| all.extend(graph.derivatives(&first, l)));
        }
        let gradient = graph.gradient(values[2], &nodes);
        all.extend(gradient);
        // Another graph with other variables, and with constant arguments.
        let mut other = Graph::default();
        let [y, x] = [other.variable(0), other.variable(1)];
        let moved = other.import(&graph, &all, &[x, y]);
        let half = other.constant(0.5);
        let fixed = other.import(&graph, &all, &[half, half]);
        assert!(fixed.iter().all(|node| other.value(*node).is_some()));
        let tape = Tape::new(&graph, 2, |k| k == 0, &[&all[..5], &all]);
        let mut registers = tape.registers::<4>();
        registers.set(0, [0.3, 0.3, -0.7, 1.1]);
        registers.set(1, [0.8, 0.8, 0.2, -0.4]);
        (0..3).for_each(|stage| tape.run(stage, &mut registers));
        let lanes = tape
            .outputs(1)
            .iter()
            .map(|register| registers.get(*register));
        let mut numbers: Vec<f64> = lanes.flatten().collect();
        let plain = graph.values(&[-0.7, 0.2]);
        numbers.extend(all.iter().map(|node| plain[node.index()]));
        let plain = other.values(&[0.2, -0.7]);
        numbers.extend(moved.iter().map(|node| plain[node.index()]));
        numbers.extend(fixed.iter().map(|node| other.value(*node).unwrap()));
        let two = HyperDual64::new(-0.7, 1.0, 0.3, 0.1);
        let tape = Tape::new(&graph, 2, |_| false, &[&values]);
        let dual = tape.evaluate(&[two, HyperDual64::new(0.2, 0.0, 1.0, 0.0)]);
        numbers.extend(
            dual.iter()
                .flat_map(|own| [own.re, own.eps1, own.eps2, own.eps1eps2]),
        );
        numbers
    });
    assert_eq!(found[0].len(), found[1].len());
    for (k, (opaque, expected)) in found[0].iter().zip(&found[1]).enumerate() {
        let scale = expected.abs().max(1.0);
        assert!(
            (opaque - expected).abs() < 1e-12 * scale,
            "{k}: {opaque} for {expected}"
        );
    }
}

#[test]
fn what_an_opaque_value_does_not_depend_on_closes_no_loop() {
    let function: Arc<dyn Opaque> = Arc::new(Known);
    let part = |output: u32| {
        let mut graph = Graph::default();
        let variables: Vec<Option<Node>> = (0..4).map(|k| Some(graph.variable(k))).collect();
        // Time, a state, an input, a parameter.
        let given = [variables[1], variables[2], variables[3]];
        let rate = graph.call(&function, &given, Partial::of(0));
        let output = graph.call(&function, &given, Partial::of(output as usize));
        Model {
            system: System {
                graph,
                states: 1,
                inputs: 1,
                parameters: 1,
                derivatives: vec![rate],
                outputs: vec![output],
            },
            states: vec!["x".into()],
            inputs: vec!["u".into()],
            parameters: vec!["p".into()],
            outputs: vec!["y".into()],
        }
    };
    let looped = |output| Model::join(&[("a", part(output))], &[("a.y", "a.u")]);
    assert!(matches!(looped(0), Err(ModelError::Loop(_))));
    let joint = looped(1).unwrap();
    let values = joint.system.graph.values(&[0.0, 0.4, 2.0]);
    let y = (0.4_f64 * 2.0).exp();
    let found =
        [joint.system.outputs[0], joint.system.derivatives[0]].map(|node| values[node.index()]);
    assert_eq!(found, [y, 0.4 * y.sin()]);
}

#[test]
fn powers_have_derivatives_by_their_exponents() {
    let mut graph = Graph::default();
    let [a, b] = [0, 1].map(|k| graph.variable(k));
    let power = graph.binary(Operator::Power, a, b);
    let tape = Tape::new(&graph, 2, |_| false, &[&[power]]);
    let at = |a: f64, b: f64| {
        let found = tape.evaluate(&[
            HyperDual64::new(a, 1.0, 0.0, 0.0),
            HyperDual64::new(b, 0.0, 1.0, 0.0),
        ])[0];
        [found.re, found.eps1, found.eps2]
    };
    let expected = [
        3_f64.powf(1.7),
        1.7 * 3_f64.powf(0.7),
        3_f64.powf(1.7) * 3_f64.ln(),
    ];
    for (found, expected) in at(3.0, 1.7).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }
    assert_eq!(at(-2.0, 3.0)[..2], [-8.0, 12.0]);
    assert_eq!(at(0.0, 2.5)[..2], [0.0, 0.0]);
}

/// What an expression depends on, and what enters it with a constant factor.
#[test]
fn influences_are_told_apart_by_constant_factors() {
    let mut graph = Graph::default();
    let [a, b, c] = [0, 70, 200].map(|k| graph.variable(k));
    let two = graph.constant(2.0);
    let straight = graph.multiply(two, a);
    let product = graph.multiply(b, c);
    let sum = graph.add(straight, product);
    let below = graph.divide(two, a);
    let half = graph.divide(c, two);
    let apart = graph.subtract(half, below);
    let step = graph.binary(Operator::Less, a, b);
    let chosen = graph.select(step, c, half);
    let square = graph.multiply(a, a);
    let found = graph.influences(&[sum, apart, chosen, square, half, two]);
    let expected: [&[(usize, bool)]; 6] = [
        &[(0, true), (70, false), (200, false)],
        &[(0, false), (200, true)],
        &[(0, false), (70, false), (200, false)],
        &[(0, false)],
        &[(200, true)],
        &[],
    ];
    assert_eq!(found, expected);
}
