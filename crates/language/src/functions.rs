//! The functions of the language, their arguments and notation.

use std::ops::RangeInclusive;

/// A function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "they are called as the language calls them")]
pub enum Name {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Sqrt,
    Abs,
    Sign,
    Min,
    Max,
    Sat,
    Deadzone,
    If,
    Delay,
    Table,
}

/// Description of a function.
#[derive(Debug)]
pub(crate) struct Function {
    pub(crate) name: Name,
    pub(crate) word: &'static str,
    /// Permitted numbers of arguments.
    pub(crate) arity: RangeInclusive<usize>,
    /// Usage example.
    pub(crate) form: &'static str,
}

const fn of(name: Name, word: &'static str, form: &'static str) -> Function {
    taking(name, word, 1..=1, form)
}

const fn taking(
    name: Name,
    word: &'static str,
    arity: RangeInclusive<usize>,
    form: &'static str,
) -> Function {
    Function {
        name,
        word,
        arity,
        form,
    }
}

/// All functions.
pub(crate) const FUNCTIONS: [Function; 22] = [
    of(Name::Sin, "sin", "sin(x)"),
    of(Name::Cos, "cos", "cos(x)"),
    of(Name::Tan, "tan", "tan(x)"),
    of(Name::Asin, "asin", "asin(x)"),
    of(Name::Acos, "acos", "acos(x)"),
    of(Name::Atan, "atan", "atan(x)"),
    taking(Name::Atan2, "atan2", 2..=2, "atan2(y, x)"),
    of(Name::Sinh, "sinh", "sinh(x)"),
    of(Name::Cosh, "cosh", "cosh(x)"),
    of(Name::Tanh, "tanh", "tanh(x)"),
    of(Name::Exp, "exp", "exp(x)"),
    of(Name::Log, "log", "log(x)"),
    of(Name::Sqrt, "sqrt", "sqrt(x)"),
    of(Name::Abs, "abs", "abs(x)"),
    of(Name::Sign, "sign", "sign(x)"),
    taking(Name::Min, "min", 2..=usize::MAX, "min(a, b)"),
    taking(Name::Max, "max", 2..=usize::MAX, "max(a, b)"),
    taking(Name::Sat, "sat", 2..=3, "sat(x, limit)"),
    taking(Name::Deadzone, "deadzone", 2..=3, "deadzone(x, width)"),
    taking(Name::If, "if", 3..=3, "if(a > b, x, y)"),
    taking(Name::Delay, "delay", 2..=3, "delay(signal, tau, order)"),
    taking(Name::Table, "table", 2..=2, "table('file.csv', x)"),
];

/// The function with this name.
pub(crate) fn find(word: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.word == word)
}

impl Name {
    /// The description of the function.
    pub(crate) fn function(self) -> &'static Function {
        let mut all = FUNCTIONS.iter();
        all.find(|function| function.name == self)
            .expect("every name stands in the list")
    }
}

impl Function {
    /// The permitted numbers of arguments, in words.
    pub(crate) fn takes(&self) -> String {
        let (least, most) = (*self.arity.start(), *self.arity.end());
        match (least, most) {
            (1, 1) => "one argument".to_owned(),
            (least, usize::MAX) => format!("{least} arguments or more"),
            (least, most) if least == most => format!("{least} arguments"),
            (least, most) => format!("{least} or {most} arguments"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_expression::Tape;

    /// Values of an expression of the states `a` and `b`.
    fn value(expression: &str, [a, b]: [f64; 2]) -> f64 {
        let text = format!(
            "[model]\nname = \"m\"\n[states]\na = {{ der = \"{expression}\" }}\nb = {{ der = \"0\" }}\n"
        );
        let table = |_: &str| Ok("x,y\n-2,1\n-0.5,0.3\n0.75,2\n3,-1\n".to_owned());
        let own = crate::parse(&text, "model.toml", &table).expect(expression);
        let system = &own.model.system;
        let nodes = [system.derivatives[0]];
        let tape = Tape::new(&system.graph, system.variables(), |_| false, &[&nodes]);
        tape.evaluate(&[0.0, a, b])[0]
    }

    type Of = fn(f64, f64) -> f64;

    /// What each function is, in Rust.
    const MEANINGS: &[(Name, &str, Of)] = &[
        (Name::Sin, "sin(a)", |a, _| a.sin()),
        (Name::Cos, "cos(a)", |a, _| a.cos()),
        (Name::Tan, "tan(a)", |a, _| a.tan()),
        (Name::Asin, "asin(a/9)", |a, _| (a / 9.0).asin()),
        (Name::Acos, "acos(a/9)", |a, _| (a / 9.0).acos()),
        (Name::Atan, "atan(a)", |a, _| a.atan()),
        (Name::Atan2, "atan2(a, b)", |a, b| a.atan2(b)),
        (Name::Sinh, "sinh(a)", |a, _| a.sinh()),
        (Name::Cosh, "cosh(a)", |a, _| a.cosh()),
        (Name::Tanh, "tanh(a)", |a, _| a.tanh()),
        (Name::Exp, "exp(a)", |a, _| a.exp()),
        (Name::Log, "log(a^2)", |a, _| (a * a).ln()),
        (Name::Sqrt, "sqrt(a^2 + b)", |a, b| (a * a + b).sqrt()),
        (Name::Abs, "abs(a)", |a, _| a.abs()),
        (Name::Sign, "sign(a)", |a, _| a.signum()),
        (Name::Min, "min(a, b)", |a, b| a.min(b)),
        (Name::Min, "min(b, a, 1)", |a, b| a.min(b).min(1.0)),
        (Name::Max, "max(a, b)", |a, b| a.max(b)),
        (Name::Sat, "sat(a, 2)", |a, _| a.clamp(-2.0, 2.0)),
        (Name::Sat, "sat(a, -1, 3)", |a, _| a.clamp(-1.0, 3.0)),
        (Name::Deadzone, "deadzone(a, 0.5)", |a, _| {
            a.signum() * (a.abs() - 0.5).max(0.0)
        }),
        (Name::Deadzone, "deadzone(a, -1, 2)", |a, _| {
            (a - 2.0).max(0.0) + (a + 1.0).min(0.0)
        }),
        (Name::If, "if(a > b, a, 3*b)", |a, b| {
            if a > b { a } else { 3.0 * b }
        }),
        (Name::If, "if(a <= 2, exp(a), b)", |a, b| {
            if a <= 2.0 { a.exp() } else { b }
        }),
        (Name::Table, "table('x.csv', a)", |a, _| match a {
            ..-2.0 => 1.0,
            -2.0..-0.5 => 1.0 + (a + 2.0) * -0.7 / 1.5,
            -0.5..0.75 => 0.3 + (a + 0.5) * 1.7 / 1.25,
            0.75..3.0 => 2.0 + (a - 0.75) * -3.0 / 2.25,
            _ => -1.0,
        }),
    ];

    #[test]
    fn functions_have_the_values_of_their_names() {
        for [a, b] in [
            [0.3, 0.7],
            [-0.4, 1.6],
            [2.0, 2.0],
            [2.5, -1.5],
            [-3.1, -0.2],
            [6.5, 8.0],
        ] {
            for (_, expression, of) in MEANINGS {
                let (found, expected) = (value(expression, [a, b]), of(a, b));
                let is_same = (found - expected).abs() <= 1e-13 * (1.0 + expected.abs());
                let both_nan = found.is_nan() && expected.is_nan();
                assert!(
                    is_same || both_nan,
                    "{expression} at {a}, {b}: {found}, not {expected}"
                );
            }
        }
        // A delay is a state of its own (docs/models.md): the tests of simulations look at it.
        let all = FUNCTIONS.iter().filter(|own| own.name != Name::Delay);
        for function in all {
            let has_value = MEANINGS.iter().any(|(name, ..)| *name == function.name);
            assert!(has_value, "`{}` has no row here", function.word);
        }
    }

    #[test]
    fn nothing_compares_with_what_is_not_a_number() {
        for (sign, expected) in [
            ("<", 3.0),
            ("<=", 3.0),
            (">", 3.0),
            (">=", 3.0),
            ("==", 3.0),
            ("!=", 2.0),
        ] {
            for sides in [format!("a {sign} b"), format!("b {sign} a")] {
                let expression = format!("if({sides}, 2, 3)");
                assert_eq!(
                    value(&expression, [f64::NAN, 1.0]),
                    expected,
                    "{expression}"
                );
            }
        }
    }

    #[test]
    fn the_documentation_names_each_function() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/models.md");
        // The packaged crate has no documents.
        let Ok(text) = std::fs::read_to_string(path) else {
            return;
        };
        let quoted = text.split('`').skip(1).step_by(2);
        let words: Vec<&str> = quoted.flat_map(|code| code.split([' ', '('])).collect();
        for function in &FUNCTIONS {
            let word = function.word;
            assert!(words.contains(&word), "docs/models.md lacks `{word}`");
        }
    }
}
