//! The parser of expressions.

use crate::error::Fault;
use crate::functions::{self, FUNCTIONS, Name};
use crate::token::{Placed, Token, tokens};
use pilotage_text::suggestion::suggestion;
use std::ops::Range;

/// Maximum nesting of brackets, signs and powers.
const DEEPEST: usize = 100;

/// A part of an expression: an index into its list of parts.
pub(crate) type Part = usize;

/// The keyword before the name of a recorded column.
const COLUMN: &str = "column";

/// The name of a recorded column in expressions.
pub fn column(name: &str) -> String {
    format!("{COLUMN}({name:?})")
}

/// Content of a part.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Term {
    Number(f64),
    Name(String),
    /// The file of a table.
    Text(String),
    Negate(Part),
    Add(Part, Part),
    Subtract(Part, Part),
    Multiply(Part, Part),
    Divide(Part, Part),
    Power(Part, Part),
    Compare(Comparison, Part, Part),
    Call(Name, Vec<Part>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Comparison {
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
}

/// An expression: its parts, each after its operands; the last one is the whole expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    /// The expression as written.
    pub text: String,
    pub(crate) terms: Vec<Term>,
    /// Byte range of each part in the text.
    pub(crate) places: Vec<Range<usize>>,
}

/// A fault and its byte offset.
pub(crate) type Misplaced = (Fault, usize);

impl Expression {
    /// Parses a text.
    pub(crate) fn parse(text: &str) -> Result<Self, Misplaced> {
        let tokens = tokens(text).map_err(|(fault, place)| (fault, place.start))?;
        if tokens.is_empty() {
            return Err((Fault::Empty, 0));
        }
        let mut parser = Parser {
            tokens,
            next: 0,
            depth: 0,
            end: text.len(),
            terms: Vec::new(),
            places: Vec::new(),
        };
        let whole = parser.comparison()?;
        if parser.next < parser.tokens.len() {
            return Err(parser.expected("an operator or the end"));
        }
        parser.operand(whole)?;
        Ok(Self {
            text: text.to_owned(),
            terms: parser.terms,
            places: parser.places,
        })
    }

    /// A number.
    pub(crate) fn number(value: f64) -> Self {
        let text = format!("{value:?}");
        Self {
            places: std::iter::once(0..text.len()).collect(),
            text,
            terms: vec![Term::Number(value)],
        }
    }

    /// The part that is the whole expression.
    pub(crate) fn whole(&self) -> Part {
        self.terms.len() - 1
    }

    /// A part as written.
    pub(crate) fn shown(&self, part: Part) -> &str {
        &self.text[self.places[part].clone()]
    }

    /// True if a part is a literal: a number or a text.
    pub(crate) fn is_number(&self, part: Part) -> bool {
        matches!(self.terms[part], Term::Number(_) | Term::Text(_))
    }

    /// The names used in the expression, each with its part.
    pub(crate) fn names(&self) -> impl Iterator<Item = (&str, Part)> {
        let terms = self.terms.iter().enumerate();
        terms.filter_map(|(part, term)| match term {
            Term::Name(name) => Some((name.as_str(), part)),
            _ => None,
        })
    }
}

impl Term {
    /// The operands of the term.
    pub(crate) fn parts(&self) -> Vec<Part> {
        match self {
            Self::Number(_) | Self::Name(_) | Self::Text(_) => Vec::new(),
            Self::Negate(a) => vec![*a],
            Self::Add(a, b)
            | Self::Subtract(a, b)
            | Self::Multiply(a, b)
            | Self::Divide(a, b)
            | Self::Power(a, b)
            | Self::Compare(_, a, b) => vec![*a, *b],
            Self::Call(_, arguments) => arguments.clone(),
        }
    }
}

struct Parser {
    tokens: Vec<Placed<Token>>,
    next: usize,
    depth: usize,
    /// Length of the text.
    end: usize,
    terms: Vec<Term>,
    places: Vec<Range<usize>>,
}

/// A binary operator: its precedence, and the constructor of its term.
type Infix = (u8, fn(Part, Part) -> Term);

/// Precedence of a sign: above products, below powers.
const SIGN: u8 = 3;
/// Precedence of a power.
const POWER: u8 = 4;

impl Parser {
    /// An expression, or a comparison of two.
    fn comparison(&mut self) -> Result<Part, Misplaced> {
        let left = self.expression(0)?;
        let Some(compares) = self.sign().and_then(comparison) else {
            return Ok(left);
        };
        self.next += 1;
        let right = self.expression(0)?;
        if self.sign().and_then(comparison).is_some() {
            return Err((Fault::StrayComparison, self.place()));
        }
        self.operand(left)?;
        self.operand(right)?;
        Ok(self.join(Term::Compare(compares, left, right), left, right))
    }

    /// An expression with operators of at least this precedence.
    fn expression(&mut self, least: u8) -> Result<Part, Misplaced> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err((Fault::TooDeep { limit: DEEPEST }, self.place()));
        }
        let mut left = self.prefix()?;
        while let Some((strength, make)) = self.sign().and_then(infix) {
            if strength < least {
                break;
            }
            self.next += 1;
            // A power is right-associative, and its exponent may have a sign.
            let right = self.expression(match strength == POWER {
                true => SIGN,
                false => strength + 1,
            })?;
            self.operand(left)?;
            self.operand(right)?;
            left = self.join(make(left, right), left, right);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn prefix(&mut self) -> Result<Part, Misplaced> {
        let begin = self.place();
        match self.tokens.get(self.next).map(|(token, _)| token.clone()) {
            Some(Token::Sign(sign @ ("-" | "+"))) => {
                self.next += 1;
                let of = self.expression(SIGN)?;
                self.operand(of)?;
                let place = begin..self.places[of].end;
                Ok(match sign {
                    "-" => self.push(Term::Negate(of), place),
                    _ => of,
                })
            }
            Some(Token::Sign("(")) => {
                self.next += 1;
                let within = self.comparison()?;
                self.close()?;
                self.places[within] = begin..self.tokens[self.next - 1].1.end;
                Ok(within)
            }
            Some(Token::Number(number)) => Ok(self.take(Term::Number(number))),
            Some(Token::Text(text)) => Ok(self.take(Term::Text(text))),
            Some(Token::Name(name)) => self.name(name),
            _ => Err(self.expected("a number, a name or `(`")),
        }
    }

    /// A variable, or a call.
    fn name(&mut self, name: String) -> Result<Part, Misplaced> {
        let begin = self.place();
        let called = self.tokens.get(self.next + 1).map(|(token, _)| token);
        if called != Some(&Token::Sign("(")) {
            return Ok(self.take(Term::Name(name)));
        }
        if name == COLUMN {
            return self.column(begin);
        }
        let function = functions::find(&name).ok_or_else(|| (unknown_function(&name), begin))?;
        self.next += 2;
        let mut arguments = Vec::new();
        while self.sign() != Some(")") || !arguments.is_empty() {
            arguments.push(self.argument(function.name, arguments.len())?);
            match self.sign() {
                Some(",") => self.next += 1,
                _ => break,
            }
        }
        self.close()?;
        if !function.arity.contains(&arguments.len()) {
            let fault = Fault::Arity {
                name: function.word,
                takes: function.takes(),
                found: arguments.len(),
                form: function.form,
            };
            return Err((fault, begin));
        }
        let place = begin..self.tokens[self.next - 1].1.end;
        Ok(self.push(Term::Call(function.name, arguments), place))
    }

    /// A recorded column, `column("name")`, which is also a name.
    fn column(&mut self, begin: usize) -> Result<Part, Misplaced> {
        self.next += 2;
        let name = match self.tokens.get(self.next) {
            Some((Token::Text(name), _)) => column(name),
            _ => return Err(self.expected("the name of a column in quotes")),
        };
        self.next += 1;
        self.close()?;
        let place = begin..self.tokens[self.next - 1].1.end;
        Ok(self.push(Term::Name(name), place))
    }

    /// The argument of a call at an index. Conditions and file names are permitted only in their places.
    fn argument(&mut self, of: Name, at: usize) -> Result<Part, Misplaced> {
        let part = self.comparison()?;
        let place = self.places[part].start;
        match (of, at, &self.terms[part]) {
            (Name::If, 0, Term::Compare(..)) | (Name::Table, 0, Term::Text(_)) => {}
            (Name::If, 0, _) => return Err((Fault::NoCondition, place)),
            (Name::Table, 0, _) => return Err((Fault::NoTableFile, place)),
            _ => self.operand(part)?,
        }
        Ok(part)
    }

    /// Rejects comparisons and texts.
    fn operand(&self, part: Part) -> Result<(), Misplaced> {
        let place = self.places[part].start;
        match self.terms[part] {
            Term::Compare(..) => Err((Fault::StrayComparison, place)),
            Term::Text(_) => Err((Fault::StrayText, place)),
            _ => Ok(()),
        }
    }

    fn close(&mut self) -> Result<(), Misplaced> {
        match self.sign() {
            Some(")") => {
                self.next += 1;
                Ok(())
            }
            _ => Err(self.expected("an operator, a comma or `)`")),
        }
    }

    /// The next token, if it is a sign.
    fn sign(&self) -> Option<&'static str> {
        match self.tokens.get(self.next) {
            Some((Token::Sign(sign), _)) => Some(sign),
            _ => None,
        }
    }

    /// Byte offset of the next token.
    fn place(&self) -> usize {
        let next = self.tokens.get(self.next);
        next.map_or(self.end, |(_, place)| place.start)
    }

    fn expected(&self, expected: &str) -> Misplaced {
        let next = self.tokens.get(self.next);
        let found = next.map_or("the end".to_owned(), |(token, _)| token.shown());
        let expected = expected.to_owned();
        (Fault::Expected { expected, found }, self.place())
    }

    /// A part that consists of one token.
    fn take(&mut self, term: Term) -> Part {
        let place = self.tokens[self.next].1.clone();
        self.next += 1;
        self.push(term, place)
    }

    fn join(&mut self, term: Term, left: Part, right: Part) -> Part {
        let place = self.places[left].start..self.places[right].end;
        self.push(term, place)
    }

    fn push(&mut self, term: Term, place: Range<usize>) -> Part {
        self.terms.push(term);
        self.places.push(place);
        self.terms.len() - 1
    }
}

fn infix(sign: &str) -> Option<Infix> {
    Some(match sign {
        "+" => (1, Term::Add),
        "-" => (1, Term::Subtract),
        "*" => (2, Term::Multiply),
        "/" => (2, Term::Divide),
        "^" => (POWER, Term::Power),
        _ => return None,
    })
}

fn comparison(sign: &str) -> Option<Comparison> {
    Some(match sign {
        "<" => Comparison::Less,
        "<=" => Comparison::LessEqual,
        ">" => Comparison::Greater,
        ">=" => Comparison::GreaterEqual,
        "==" => Comparison::Equal,
        "!=" => Comparison::NotEqual,
        _ => return None,
    })
}

fn unknown_function(name: &str) -> Fault {
    let words = FUNCTIONS.iter().map(|function| function.word);
    Fault::UnknownFunction {
        name: name.to_owned(),
        suggestion: synonym(name)
            .or(suggestion(name, words.clone()))
            .map(str::to_owned),
        known: words.collect::<Vec<_>>().join(", "),
    }
}

/// Names of functions in other languages.
fn synonym(name: &str) -> Option<&'static str> {
    Some(match name {
        "ln" => "log",
        "arcsin" => "asin",
        "arccos" => "acos",
        "arctan" => "atan",
        "arctan2" => "atan2",
        "fabs" => "abs",
        "signum" | "sgn" => "sign",
        "clip" | "clamp" | "saturate" | "saturation" => "sat",
        "dead_zone" => "deadzone",
        "where" | "ifelse" | "select" | "piecewise" => "if",
        "interp" | "lookup" | "interp1" => "table",
        "pade" => "delay",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expression with explicit brackets.
    fn bracketed(text: &str) -> String {
        let expression = Expression::parse(text).expect("well formed");
        let mut shown: Vec<String> = Vec::new();
        for term in &expression.terms {
            let of = |part: &Part| shown[*part].clone();
            let infix = |sign: &str, a, b| format!("({}{sign}{})", of(a), of(b));
            shown.push(match term {
                Term::Number(number) => number.to_string(),
                Term::Name(name) => name.clone(),
                Term::Text(text) => format!("'{text}'"),
                Term::Negate(a) => format!("(-{})", of(a)),
                Term::Add(a, b) => infix("+", a, b),
                Term::Subtract(a, b) => infix("-", a, b),
                Term::Multiply(a, b) => infix("*", a, b),
                Term::Divide(a, b) => infix("/", a, b),
                Term::Power(a, b) => infix("^", a, b),
                Term::Compare(_, a, b) => infix("?", a, b),
                Term::Call(name, arguments) => {
                    let arguments: Vec<String> = arguments.iter().map(of).collect();
                    format!("{}({})", name.function().word, arguments.join(","))
                }
            });
        }
        shown.pop().expect("a whole")
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, expected) in [
            ("a - b - c", "((a-b)-c)"),
            ("a / b * c", "((a/b)*c)"),
            ("a + b * c ^ d", "(a+(b*(c^d)))"),
            ("a ^ b ^ c", "(a^(b^c))"),
            ("-a ^ 2", "(-(a^2))"),
            ("-a * b", "((-a)*b)"),
            ("2 ^ -1", "(2^(-1))"),
            ("2 ^ -a ^ 2", "(2^(-(a^2)))"),
            ("a * -b", "(a*(-b))"),
            ("--a", "(-(-a))"),
            ("+a - +b", "(a-b)"),
            ("(a + b) * c", "((a+b)*c)"),
            ("if(a >= b, sin(c), 2)", "if((a?b),sin(c),2)"),
            ("table('f.csv', x + 1)", "table('f.csv',(x+1))"),
        ] {
            assert_eq!(bracketed(text), expected, "{text}");
        }
    }

    #[test]
    fn long_sums_are_no_nesting_and_deep_brackets_end() {
        let sum = vec!["a"; 20_000].join("+");
        assert!(Expression::parse(&sum).is_ok());
        for (open, close) in [("(", ")"), ("-", ""), ("sin(", ")"), ("2^", "")] {
            let deep = format!("{}a{}", open.repeat(50_000), close.repeat(50_000));
            let (fault, _) = Expression::parse(&deep).expect_err("too deep");
            assert!(matches!(fault, Fault::TooDeep { .. }), "{open}: {fault}");
        }
    }
}
