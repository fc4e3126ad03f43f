//! The linear pilot as a formula.

use super::html::{Html, html};
use super::number;

/// The linear pilot's transfer function from the error [m] to the stick, as a fraction.
pub fn transfer_function(theta: &[f64]) -> Html {
    let (denominator, numerator) = theta.split_at(theta.len() / 2);
    let mut denominator = denominator.to_vec();
    denominator.push(1.0);
    html! {
        span { i { "y" } sub { "p" } " / " i { "u" } sub { "p" } " =" }
        span class="fraction" { span { (polynomial(numerator)) } span { (polynomial(&denominator)) } }
    }
}

/// A polynomial in s, highest power first; `c[i]` is the coefficient of s^i.
fn polynomial(c: &[f64]) -> Html {
    let term = |(i, &value): (usize, &f64)| {
        let sign = match (value < 0.0, i + 1 == c.len()) {
            (true, true) => "\u{2212}",
            (true, false) => " \u{2212} ",
            (false, true) => "",
            (false, false) => " + ",
        };
        html! {
            (sign)
            @if value != 1.0 || i == 0 { (number::html(value.abs(), 4)) }
            @if i > 0 { " " (power(i)) }
        }
    };
    html! { @for own in c.iter().enumerate().rev() { (term(own)) } }
}

/// A power of s.
fn power(exponent: usize) -> Html {
    match exponent {
        0 => html! { "1" },
        1 => html! { i { "s" } },
        _ => html! { i { "s" } sup { (exponent) } },
    }
}
