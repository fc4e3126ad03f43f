//! Numbers with a few significant digits, for messages and tables.

/// A number with `digits` significant digits, in decimal notation between 1e-4 and 1e6, otherwise with an exponent.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    let text = match value.abs() {
        size if value == 0.0 || !value.is_finite() => format!("{size}"),
        size if !(1e-4..1e6).contains(&size) => format!("{size:.*e}", digits.saturating_sub(1)),
        size => {
            // Rounding may carry into another digit.
            let before = rounded(size, digits).log10().floor() as i32 + 1;
            format!("{size:.*}", (digits as i32 - before).max(0) as usize)
        }
    };
    match value < 0.0 {
        true => format!("-{text}"),
        false => text,
    }
}

/// [`significant`] without trailing zeros of decimals, for values chosen by the user, such as a target.
#[must_use]
pub fn short(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The number itself, rounded to `digits` significant digits.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    // Without the sign of a zero.
    text.parse().unwrap_or(value) + 0.0
}

#[cfg(test)]
mod tests {
    use super::{rounded, short, significant};

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
    fn rounded_numbers_are_the_nearest_with_these_digits() {
        let cases = [
            (0.1 + 0.2, 9, 0.3),
            (-2.0 / 3.0, 3, -0.667),
            (999.96, 4, 1000.0),
            (1.0 / 0.0, 3, f64::INFINITY),
        ];
        for (value, digits, nearest) in cases {
            assert_eq!(rounded(value, digits), nearest);
        }
        assert!(rounded(-0.0, 3).is_sign_positive());
    }
}
