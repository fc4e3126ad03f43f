//! `generationDateAndTime`.

/// Form of a text as a date with time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// `YYYY-MM-DDThh:mm:ssZ`, as required by the standard.
    Standard,
    /// Another `xs:dateTime`: with fractions of a second, another time zone or none.
    Other,
    /// No `xs:dateTime`, which the schema requires.
    Wrong,
}

/// Whether a text is `YYYY-MM-DDThh:mm:ssZ`, as required for `generationDateAndTime`.
pub fn is_date_and_time(text: &str) -> bool {
    form(text) == Form::Standard
}

/// The form of a text.
pub(super) fn form(text: &str) -> Form {
    const SHAPE: &[u8] = b"0000-00-00T00:00:00";
    let fits = |(b, shape): (&u8, &u8)| match shape {
        b'0' => b.is_ascii_digit(),
        _ => b == shape,
    };
    let bytes = text.as_bytes();
    let has_shape = bytes.len() >= SHAPE.len() && bytes.iter().zip(SHAPE).all(fits);
    if !has_shape {
        return Form::Wrong;
    }
    // The shape is ASCII, so its end is a character boundary.
    let (date_time, rest) = text.split_at(SHAPE.len());
    if !is_in_range(date_time) {
        return Form::Wrong;
    }
    match rest {
        "Z" => Form::Standard,
        _ if is_fraction_and_zone(rest) => Form::Other,
        _ => Form::Wrong,
    }
}

fn is_in_range(text: &str) -> bool {
    let field = |from: usize, to: usize| text[from..to].parse().unwrap_or(0u32);
    let (year, month, day) = (field(0, 4), field(5, 7), field(8, 10));
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days = match month {
        2 if is_leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return false,
    };
    year > 0
        && (1..=days).contains(&day)
        && field(11, 13) < 24
        && field(14, 16) < 60
        && field(17, 19) < 60
}

/// `[.digits][Z|+hh:mm|-hh:mm]`
fn is_fraction_and_zone(text: &str) -> bool {
    let zone = match text.strip_prefix('.') {
        None => text,
        Some(fraction) => {
            let zone = fraction.trim_start_matches(|c: char| c.is_ascii_digit());
            if zone.len() == fraction.len() {
                return false;
            }
            zone
        }
    };
    match zone.as_bytes() {
        [] | [b'Z'] => true,
        [b'+' | b'-', h1, h2, b':', m1, m2] => {
            let number = |tens: &u8, ones: &u8| match (tens, ones) {
                (b'0'..=b'9', b'0'..=b'9') => Some((tens - b'0') * 10 + (ones - b'0')),
                _ => None,
            };
            number(h1, h2).is_some_and(|h| h <= 14) && number(m1, m2).is_some_and(|m| m < 60)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms() {
        assert_eq!(form("2026-01-02T03:04:05Z"), Form::Standard);
        assert_eq!(form("2024-02-29T23:59:59Z"), Form::Standard);
        for other in [
            "2026-01-02T03:04:05",
            "2026-01-02T03:04:05.25+01:00",
            "2026-01-02T03:04:05.1Z",
        ] {
            assert_eq!(form(other), Form::Other, "{other}");
        }
        for wrong in [
            "",
            "2026-01-02",
            "2026-13-02T03:04:05Z",
            "2026-02-29T03:04:05Z",
            "2026-01-02 03:04:05Z",
            "2026-01-02T24:04:05Z",
            "2026-01-02T03:04:05.Z",
            "2026-01-02T03:04:05+1:00",
            "2026-01-02T03:04:05z",
            "2026-01-02T03:04:05é",
        ] {
            assert_eq!(form(wrong), Form::Wrong, "{wrong}");
        }
    }
}
