//! Formats numbers for text and tables.

/// A number with `digits` significant digits, in decimal notation between 1e-4 and 1e6, otherwise with an exponent.
pub fn significant(value: f64, digits: usize) -> String {
    let text = match value.abs() {
        size if value == 0.0 || !value.is_finite() => format!("{size}"),
        size if !(1e-4..1e6).contains(&size) => format!("{size:.*e}", digits.saturating_sub(1)),
        size => {
            // Rounding may carry into another digit.
            let rounded: f64 = format!("{size:.*e}", digits.saturating_sub(1))
                .parse()
                .unwrap_or(size);
            let before = rounded.log10().floor() as i32 + 1;
            format!("{size:.*}", (digits as i32 - before).max(0) as usize)
        }
    };
    match value < 0.0 {
        true => format!("-{text}"),
        false => text,
    }
}

/// [`significant`] without trailing zeros of decimals, for values chosen by the user, such as a target.
pub fn short(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// [`short`] as HTML: with a true minus sign, and the exponent as a superscript.
pub fn chosen(value: f64, digits: usize) -> String {
    marked_up(&short(value, digits))
}

/// [`significant`] as HTML: with a true minus sign, and the exponent as a superscript.
pub fn html(value: f64, digits: usize) -> String {
    marked_up(&significant(value, digits))
}

/// Formats the text of a number as HTML.
pub fn marked_up(text: &str) -> String {
    let text = text.replace('-', "\u{2212}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{mantissa}\u{b7}10<sup>{exponent}</sup>"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::{html, short, significant};

    #[test]
    fn digits_are_kept_at_every_size() {
        let cases = [
            (0.0, "0"),
            (-0.0005, "-0.0005000"),
            (12.3456, "12.35"),
            (1234567.0, "1.235e6"),
            (-3.21e-9, "-3.210e-9"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value, 4), text);
        }
    }

    #[test]
    fn chosen_numbers_are_short() {
        let cases = [
            (10.0, "10"),
            (-2.5, "-2.5"),
            (0.1 + 0.2, "0.3"),
            (30.48, "30.48"),
            (1e7, "1.000e7"),
            (1200.0, "1200"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value, 4), text);
        }
    }

    #[test]
    fn pages_show_powers_of_ten_and_a_true_minus() {
        assert_eq!(
            html(-3.21e-9, 3),
            "\u{2212}3.21\u{b7}10<sup>\u{2212}9</sup>"
        );
        assert_eq!(html(-0.5, 2), "\u{2212}0.50");
    }
}
