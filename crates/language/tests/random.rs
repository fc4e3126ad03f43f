//! Random files and random expressions: nothing panics, nothing hangs, derivatives are those of differences.

use pilotage_expression::Tape;
use pilotage_language::{Compiled, parse};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const GOOD: &str = r#"[model]
name = "random"
[inputs]
u = { unit = "m", min = -1, max = 1 }
[parameters]
gain = { start = 0.1, unit = "1/m", tunable = true }
tau = { start = 0.3, unit = "s" }
[states]
x = { unit = "1", start = "2 * gain * 1.0", der = "(wish - x) / tau" }
[locals]
wish = { unit = "1", value = "sat(gain * delay(u, tau, 2), 0.5) + if(x > 0, sqrt(x), -x^2)" }
[outputs]
y = { unit = "1", value = "x", limit = [-1, "1"] }
"#;

fn none(_: &str) -> std::io::Result<String> {
    Err(std::io::ErrorKind::NotFound.into())
}

fn runner(cases: u32) -> TestRunner {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]))
}

/// One byte or several exchanged, left out, doubled, or a piece of the language put in.
#[test]
fn mutations_of_a_file_never_panic() {
    const PIECES: [&str; 24] = [
        "(",
        ")",
        "+",
        "-",
        "*",
        "/",
        "^",
        "<",
        "==",
        ",",
        "\"",
        "'",
        "sin(",
        "if(",
        "delay(",
        "table('x',",
        "1e999",
        "0",
        "time",
        "pi",
        "[",
        "]",
        "= {",
        "\n[states]\n",
    ];
    let change = (0..GOOD.len(), 0..4_usize, 0..PIECES.len(), any::<u8>());
    let changes = proptest::collection::vec(change, 1..4);
    let run = runner(10_000).run(&changes, |changes| {
        let mut bytes = GOOD.as_bytes().to_vec();
        for (at, how, piece, byte) in changes {
            let at = at.min(bytes.len() - 1);
            match how {
                0 => bytes[at] = byte,
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, byte),
                _ => drop(bytes.splice(at..at, PIECES[piece].bytes())),
            }
        }
        if let Ok(compiled) = parse(&String::from_utf8_lossy(&bytes), "model.toml", &none) {
            let point = vec![0.1; compiled.model.states.len()];
            let inputs = vec![0.2; compiled.model.inputs.len()];
            let _ = compiled.trouble(0.0, &point, &inputs, &compiled.parameters());
            let _ = compiled.is_linear();
            let _ = compiled.file.equations();
        }
        Ok(())
    });
    run.expect("no panic");
}

/// A random expression of `a`, `b` and numbers, in which everything is defined for values around 1.
fn expressions() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("a".to_owned()),
        Just("b".to_owned()),
        (1..40_u32).prop_map(|k| format!("{}", f64::from(k) / 8.0)),
    ];
    leaf.prop_recursive(6, 60, 3, |inner| {
        let two = (inner.clone(), inner.clone());
        let three = (inner.clone(), inner.clone(), inner.clone());
        prop_oneof![
            (two.clone(), 0..5_usize).prop_map(|((x, y), k)| {
                let sign = ["+", "-", "*", "/", "^"][k];
                match sign {
                    "/" => format!("({x})/(1.5+tanh({y}))"),
                    "^" => format!("(1.5+tanh({x}))^(tanh({y})*3)"),
                    sign => format!("({x}){sign}({y})"),
                }
            }),
            (inner.clone(), 0..16_usize).prop_map(|(x, k)| match k {
                0 => format!("sin({x})"),
                1 => format!("cos({x})"),
                2 => format!("tan(0.5*tanh({x}))"),
                3 => format!("asin(0.9*tanh({x}))"),
                4 => format!("acos(0.9*tanh({x}))"),
                5 => format!("atan({x})"),
                6 => format!("sinh(tanh({x}))"),
                7 => format!("cosh(tanh({x}))"),
                8 => format!("tanh({x})"),
                9 => format!("exp(tanh({x}))"),
                10 => format!("log(1.5+tanh({x}))"),
                11 => format!("sqrt(1.5+tanh({x}))"),
                12 => format!("abs({x})"),
                13 => format!("-({x})"),
                14 => format!("({x})^2"),
                _ => format!("table('curve.csv', {x})"),
            }),
            (two.clone(), 0..6_usize).prop_map(|((x, y), k)| match k {
                0 => format!("min({x}, {y})"),
                1 => format!("max({x}, {y})"),
                2 => format!("sat({x}, 0.1+abs({y}))"),
                3 => format!("deadzone({x}, 0.1+abs({y}))"),
                4 => format!("sign({x})*({y})"),
                _ => format!("atan2({x}, 0.1+({y})^2)"),
            }),
            (three.clone(), 0..3_usize).prop_map(|((x, y, z), k)| {
                let compare = ["<", ">=", "!="][k];
                format!("if({x} {compare} {y}, {y}, {z})")
            }),
        ]
    })
}

fn compiled(expression: &str) -> Compiled {
    let text = format!(
        "[model]\nname = \"m\"\n[states]\na = {{ der = \"{expression}\" }}\nb = {{ der = \"({expression})^2\" }}\n"
    );
    let table = |_: &str| Ok("x,y\n-2,1\n-0.5,0.3\n0.75,2\n3,-1\n".to_owned());
    parse(&text, "model.toml", &table).expect(expression)
}

/// First derivatives of values, and second ones of first, against central differences; where a kink lies within
/// the difference, both sides are looked at.
#[test]
fn derivatives_are_those_of_differences() {
    let strategy = (expressions(), 0.3..1.7_f64, 0.3..1.7_f64);
    let run = runner(2_000).run(&strategy, |(expression, a, b)| {
        let own = compiled(&expression);
        let system = &own.model.system;
        let mut graph = system.graph.clone();
        let value = system.derivatives[0];
        let variables = [system.state(0), system.state(1)];
        let mut nodes = vec![value];
        for variable in variables {
            let first = graph.derivatives(&[value], variable)[0];
            nodes.push(first);
            for other in variables {
                let second = graph.derivatives(&[first], other)[0];
                nodes.push(second);
            }
        }
        let by_reverse = {
            let known = variables.map(|k| graph.known_variable(k).expect("a state"));
            graph.gradient(value, &known)
        };
        nodes.extend(by_reverse);
        let tape = Tape::new(&graph, system.variables(), |_| false, &[&nodes]);
        let at = |a: f64, b: f64| tape.evaluate(&[0.0, a, b]);
        let here = at(a, b);
        prop_assert!(
            (here[7] - here[1]).abs() <= 1e-9 * (1.0 + here[1].abs()),
            "reverse {expression}"
        );
        prop_assert!(
            (here[8] - here[4]).abs() <= 1e-9 * (1.0 + here[4].abs()),
            "reverse {expression}"
        );
        let h = 1e-6;
        let (right, left) = (at(a + h, b), at(a - h, b));
        let (up, down) = (at(a, b + h), at(a, b - h));
        // [value, da, daa, dab, db, dba, dbb]
        for (of, by_a, by_b) in [(0, 1, 4), (1, 2, 3), (4, 5, 6)] {
            for (derivative, plus, minus) in [(by_a, &right, &left), (by_b, &up, &down)] {
                let forward = (plus[of] - here[of]) / h;
                let backward = (here[of] - minus[of]) / h;
                // A kink or a jump lies between the points: no difference tells the derivative.
                let size = 1.0 + here[of].abs() + here[derivative].abs() + forward.abs();
                if (forward - backward).abs() > 1e-2 * size || size > 1e4 {
                    continue;
                }
                let central = (forward + backward) / 2.0;
                prop_assert!(
                    (central - here[derivative]).abs() <= 2e-3 * size,
                    "{expression} at {a}, {b}: {central} and {}",
                    here[derivative]
                );
            }
        }
        Ok(())
    });
    run.expect("derivatives agree");
}
