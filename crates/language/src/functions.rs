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
    taking(Name::Delay, "delay", 3..=3, "delay(signal, tau, order)"),
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
