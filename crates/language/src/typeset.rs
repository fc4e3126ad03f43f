//! Expressions in mathematical notation: Greek letters, superscript exponents, only necessary brackets.

use crate::file::ModelFile;
use crate::functions::Name;
use crate::syntax::{Comparison, Expression, Part, Term};

/// Precedence of typeset expressions: sums, products, signs, powers, and those that need no brackets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Strength {
    Sum,
    Product,
    Sign,
    Power,
    Whole,
}

use Strength::{Power, Product, Sign, Sum, Whole};

const GREEK: [(&str, &str); 24] = [
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("delta", "δ"),
    ("epsilon", "ε"),
    ("zeta", "ζ"),
    ("eta", "η"),
    ("theta", "θ"),
    ("kappa", "κ"),
    ("lambda", "λ"),
    ("mu", "μ"),
    ("nu", "ν"),
    ("xi", "ξ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
    ("phi", "φ"),
    ("chi", "χ"),
    ("psi", "ψ"),
    ("omega", "ω"),
    ("Delta", "Δ"),
    ("Omega", "Ω"),
    ("Phi", "Φ"),
];

/// A name with Greek letters in place of their spelling: `omega_f` as `ω_f`, `theta1` as `θ1`.
pub fn name(name: &str) -> String {
    let mut words = name.split('_').map(|word| {
        let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
        let found = GREEK.iter().find(|(spelt, _)| *spelt == letters);
        match found {
            Some((_, letter)) => format!("{letter}{}", &word[letters.len()..]),
            None => word.to_owned(),
        }
    });
    let first = words.next().unwrap_or_default();
    words.fold(first, |set, word| format!("{set}_{word}"))
}

impl ModelFile {
    /// The equations in mathematical notation, one per line: derivatives, locals, outputs.
    pub fn equations(&self) -> String {
        let mut lines: Vec<(String, String)> = Vec::new();
        for (variable, role) in self.variables() {
            let Some(value) = &variable.value else {
                continue;
            };
            let left = match role {
                "a state" => format!("d{}/dt", name(&variable.name)),
                _ => name(&variable.name),
            };
            let mut right = value.expression.typeset();
            if let Some([low, high]) = &variable.limit {
                let (low, high) = (low.expression.typeset(), high.expression.typeset());
                right = format!("{right}, held within {low} and {high}");
            }
            lines.push((left, right));
        }
        let widths = lines.iter().map(|(left, _)| left.chars().count());
        let width = widths.max().unwrap_or_default();
        let set = lines.iter();
        set.map(|(left, right)| format!("{left:width$} = {right}\n"))
            .collect()
    }
}

impl Expression {
    /// The expression in mathematical notation.
    pub fn typeset(&self) -> String {
        let mut set: Vec<(String, Strength)> = Vec::with_capacity(self.terms.len());
        for term in &self.terms {
            let own = typeset(term, &set, |part| match self.terms[part] {
                Term::Number(number) => Some(number),
                _ => None,
            });
            set.push(own);
        }
        set.pop().map(|(text, _)| text).unwrap_or_default()
    }
}

fn typeset(
    term: &Term,
    set: &[(String, Strength)],
    number: impl Fn(Part) -> Option<f64>,
) -> (String, Strength) {
    // With brackets if its precedence is below `least`.
    let within = |part: &Part, least: Strength| {
        let (text, strength) = &set[*part];
        match *strength >= least {
            true => text.clone(),
            false => format!("({text})"),
        }
    };
    let infix = |a, sign: &str, b, left, right, own| {
        (
            format!("{}{sign}{}", within(a, left), within(b, right)),
            own,
        )
    };
    match term {
        Term::Number(number) => (number.to_string(), Whole),
        Term::Name(own) => (name(own), Whole),
        Term::Text(file) => (format!("\"{file}\""), Whole),
        Term::Negate(a) => (format!("−{}", within(a, Power)), Sign),
        Term::Add(a, b) => infix(a, " + ", b, Sum, Sum, Sum),
        Term::Subtract(a, b) => infix(a, " − ", b, Sum, Product, Sum),
        Term::Multiply(a, b) => infix(a, " · ", b, Product, Product, Product),
        Term::Divide(a, b) => infix(a, " / ", b, Product, Sign, Product),
        Term::Power(a, b) => match number(*b).and_then(raised) {
            Some(exponent) => (format!("{}{exponent}", within(a, Whole)), Power),
            None => infix(a, "^", b, Whole, Power, Power),
        },
        Term::Compare(comparison, a, b) => infix(a, sign(*comparison), b, Sum, Sum, Sum),
        Term::Call(own, arguments) => (call(*own, arguments, set), Whole),
    }
}

fn call(own: Name, arguments: &[Part], set: &[(String, Strength)]) -> String {
    let texts: Vec<&str> = arguments.iter().map(|part| set[*part].0.as_str()).collect();
    match (own, &texts[..]) {
        (Name::Abs, [a]) => format!("|{a}|"),
        (Name::Sqrt, [a]) if set[arguments[0]].1 == Whole => format!("√{a}"),
        (Name::Sqrt, [a]) => format!("√({a})"),
        (Name::Log, [a]) => format!("ln({a})"),
        (Name::If, [condition, a, b]) => format!("({a} where {condition}, else {b})"),
        _ => format!("{}({})", own.function().word, texts.join(", ")),
    }
}

fn sign(comparison: Comparison) -> &'static str {
    match comparison {
        Comparison::Less => " < ",
        Comparison::LessEqual => " ≤ ",
        Comparison::Greater => " > ",
        Comparison::GreaterEqual => " ≥ ",
        Comparison::Equal => " = ",
        Comparison::NotEqual => " ≠ ",
    }
}

/// A nonnegative integer exponent as superscript.
fn raised(exponent: f64) -> Option<String> {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if exponent.fract() != 0.0 || !(0.0..1000.0).contains(&exponent) {
        return None;
    }
    let digits = exponent.to_string();
    let digit = |c: char| c.to_digit(10).map(|digit| DIGITS[digit as usize]);
    digits.chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_reads_as_it_was_meant() {
        for (text, expected) in [
            ("(wish - arm)/lag", "(wish − arm) / lag"),
            ("a - (b - c)", "a − (b − c)"),
            ("(a - b) - c", "a − b − c"),
            ("a / (b * c)", "a / (b · c)"),
            ("a / b * c", "a / b · c"),
            ("-(a + b)", "−(a + b)"),
            ("(-a)^2", "(−a)²"),
            ("-a^2", "−a²"),
            ("(a*b)^12", "(a · b)¹²"),
            ("a^(b + 1)", "a^(b + 1)"),
            ("omega_f + theta1", "ω_f + θ1"),
            ("sqrt(x) + sqrt(x + 1)", "√x + √(x + 1)"),
            ("abs(log(x))", "|ln(x)|"),
            ("if(x >= 0, 1, -1)", "(1 where x ≥ 0, else −1)"),
            ("a * -b", "a · −b"),
        ] {
            let expression = Expression::parse(text).expect("well formed");
            assert_eq!(expression.typeset(), expected, "{text}");
        }
    }
}
