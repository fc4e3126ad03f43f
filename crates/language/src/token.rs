//! The tokens of an expression.

use crate::error::Fault;
use std::ops::Range;
use winnow::ascii::{digit1, multispace0};
use winnow::combinator::{alt, delimited, opt, preceded, repeat};
use winnow::error::ContextError;
use winnow::stream::LocatingSlice;
use winnow::token::{one_of, take_while};
use winnow::{ModalResult, Parser};

/// A word, number or sign.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    /// A nonnegative number.
    Number(f64),
    /// A name of a variable or function.
    Name(String),
    /// A text in quotes.
    Text(String),
    /// An operator, bracket or comma.
    Sign(&'static str),
}

impl Token {
    /// Representation in messages.
    pub(crate) fn shown(&self) -> String {
        match self {
            Self::Number(number) => format!("`{number}`"),
            Self::Name(name) => format!("`{name}`"),
            Self::Text(text) => format!("`\"{text}\"`"),
            Self::Sign(sign) => format!("`{sign}`"),
        }
    }
}

/// The signs; longer ones precede their prefixes.
const SIGNS: [&str; 14] = [
    "<=", ">=", "==", "!=", "<", ">", "+", "-", "*", "/", "^", "(", ")", ",",
];

/// A value and its byte range in the text.
pub(crate) type Placed<T> = (T, Range<usize>);

type Input<'t> = LocatingSlice<&'t str>;

/// The tokens with their byte ranges, or a fault and its position.
pub(crate) fn tokens(text: &str) -> Result<Vec<Placed<Token>>, Placed<Fault>> {
    let mut input = LocatingSlice::new(text);
    let mut found = Vec::new();
    loop {
        space(&mut input);
        if input.is_empty() {
            return Ok(found);
        }
        let begin = text.len() - input.len();
        let token = token.with_span().parse_next(&mut input);
        let (token, place) = token.map_err(|_| unknown(&text[begin..], begin))?;
        if matches!(token, Token::Number(_)) && runs_on(&input) {
            let rest = text[begin..].find(|c: char| !c.is_alphanumeric() && c != '.' && c != '_');
            let end = rest.map_or(text.len(), |rest| begin + rest);
            return Err((Fault::Number(text[begin..end].to_owned()), begin..end));
        }
        if token == Token::Sign("*") && input.starts_with('*') {
            return Err((Fault::Character("**".to_owned()), begin..begin + 2));
        }
        found.push((token, place));
    }
}

/// True if a number is followed by characters that do not belong to it.
fn runs_on(rest: &str) -> bool {
    rest.starts_with(|c: char| c == '.' || c == '_' || c.is_alphanumeric())
}

fn space(input: &mut Input<'_>) {
    let _: Result<&str, ContextError> = multispace0.parse_next(input);
}

fn token(input: &mut Input<'_>) -> ModalResult<Token> {
    alt((number, name, quoted, sign)).parse_next(input)
}

fn number(input: &mut Input<'_>) -> ModalResult<Token> {
    let exponent = (one_of(['e', 'E']), opt(one_of(['+', '-'])), digit1);
    let with_whole = (digit1, opt(('.', opt(digit1)))).void();
    let mantissa = alt((with_whole, ('.', digit1).void()));
    (mantissa, opt(exponent))
        .take()
        .verify_map(|text: &str| text.parse().ok().filter(|number: &f64| number.is_finite()))
        .map(Token::Number)
        .parse_next(input)
}

fn name(input: &mut Input<'_>) -> ModalResult<Token> {
    let begins = |c: char| c == '_' || c.is_ascii_alphabetic();
    let goes_on = |c: char| c == '_' || c.is_ascii_alphanumeric();
    let word = move || (one_of(begins), take_while(0.., goes_on));
    // A name of an instance: `pilot.gain`.
    let of_instance = repeat::<_, _, (), _, _>(0.., ('.', word()).void());
    (word(), of_instance)
        .take()
        .map(|name: &str| Token::Name(name.to_owned()))
        .parse_next(input)
}

fn quoted(input: &mut Input<'_>) -> ModalResult<Token> {
    let within = |quote: char| delimited(quote, take_while(0.., move |c| c != quote), quote);
    alt((within('"'), within('\'')))
        .map(|text: &str| Token::Text(text.to_owned()))
        .parse_next(input)
}

fn sign(input: &mut Input<'_>) -> ModalResult<Token> {
    let found = SIGNS.into_iter().find(|sign| input.starts_with(sign));
    let sign = found.unwrap_or("\u{0}");
    preceded(sign, winnow::combinator::empty)
        .value(Token::Sign(sign))
        .parse_next(input)
}

/// An unsupported character, with those that belong to it.
fn unknown(rest: &str, begin: usize) -> Placed<Fault> {
    if rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        let is_end = |c: char| !c.is_alphanumeric() && !"._".contains(c);
        let length = rest.find(is_end).unwrap_or(rest.len());
        return (
            Fault::Number(rest[..length].to_owned()),
            begin..begin + length,
        );
    }
    let double = ["&&", "||"].into_iter().find(|sign| rest.starts_with(sign));
    let length = double.map_or(rest.chars().next().map_or(0, char::len_utf8), str::len);
    let shown = rest[..length].to_owned();
    (Fault::Character(shown), begin..begin + length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_numbers_and_signs() {
        let found = tokens("gain*1.5e-3 <= .5^(x_2)").expect("well formed");
        let found: Vec<_> = found.into_iter().map(|(token, _)| token).collect();
        let expected = [
            Token::Name("gain".into()),
            Token::Sign("*"),
            Token::Number(1.5e-3),
            Token::Sign("<="),
            Token::Number(0.5),
            Token::Sign("^"),
            Token::Sign("("),
            Token::Name("x_2".into()),
            Token::Sign(")"),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn what_has_no_meaning_is_shown_with_its_place() {
        let fault = |text| {
            let (fault, place) = tokens(text).expect_err("malformed");
            (fault.to_string(), place.start)
        };
        assert_eq!(
            fault("a ** 2"),
            (
                "`**` means nothing in an expression; a power is written x^2".into(),
                2
            )
        );
        assert_eq!(
            fault("1.2.3"),
            ("`1.2.3` is no number; write 12, 0.5 or 1e-3".into(), 0)
        );
        assert_eq!(
            fault("2 + 3x"),
            ("`3x` is no number; write 12, 0.5 or 1e-3".into(), 4)
        );
        assert_eq!(
            fault("a µ"),
            ("`µ` means nothing in an expression".into(), 2)
        );
    }
}
