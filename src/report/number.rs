//! Numbers as HTML.

use super::html::{Html, html};
use pilotage_text::number::significant;

/// [`significant`] as HTML: with a true minus sign, and the exponent as a superscript.
pub fn html(value: f64, digits: usize) -> Html {
    marked_up(&significant(value, digits))
}

/// Formats the text of a number as HTML; a word in the place of one stays as it is.
pub fn marked_up(text: &str) -> Html {
    let is_number = text.parse::<f64>().is_ok();
    let text = text.replace('-', "\u{2212}");
    match text.split_once('e').filter(|_| is_number) {
        Some((mantissa, exponent)) => html! { (mantissa) "\u{b7}10" sup { (exponent) } },
        None => html! { (text) },
    }
}

#[cfg(test)]
mod tests {
    use super::html;

    #[test]
    fn pages_show_powers_of_ten_and_a_true_minus() {
        assert_eq!(
            html(-3.21e-9, 3).0,
            "\u{2212}3.21\u{b7}10<sup>\u{2212}9</sup>"
        );
        assert_eq!(html(-0.5, 2).0, "\u{2212}0.50");
    }
}
