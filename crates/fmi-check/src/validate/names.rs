//! Names: C identifiers and the grammar of structured names (FMI 2.0, section 2.2.9; FMI 3.0,
//! section 2.4.7.5.1).

/// Whether `text` is a C identifier.
pub(super) fn is_c_identifier(text: &str) -> bool {
    let mut bytes = text.bytes();
    bytes.next().is_some_and(is_nondigit) && bytes.all(|b| is_nondigit(b) || b.is_ascii_digit())
}

/// Whether `name` follows `variableNamingConvention="structured"`:
/// `identifier` or `der(identifier[, order])`.
pub(super) fn is_structured(name: &str) -> bool {
    let inner = match name.strip_prefix("der(").and_then(|n| n.strip_suffix(')')) {
        Some(inner) => inner,
        None => return identifier(name) == Some(""),
    };
    match identifier(inner) {
        Some("") => true,
        Some(rest) => rest
            .strip_prefix(',')
            .is_some_and(|order| is_digits(order.trim_start())),
        None => false,
    }
}

/// A control character in a name that neither convention allows.
pub(super) fn forbidden_control(name: &str) -> Option<&'static str> {
    name.chars().find_map(|c| match c {
        '\t' => Some("tab"),
        '\n' => Some("line feed"),
        '\r' => Some("carriage return"),
        _ => None,
    })
}

fn is_nondigit(byte: u8) -> bool {
    byte == b'_' || byte.is_ascii_alphabetic()
}

fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// Parses `B-name [indices] {"." B-name [indices]}`; returns the rest.
fn identifier(text: &str) -> Option<&str> {
    let mut rest = indices(part(text)?)?;
    while let Some(next) = rest.strip_prefix('.') {
        rest = indices(part(next)?)?;
    }
    Some(rest)
}

/// Parses a plain or quoted name; returns the rest.
fn part(text: &str) -> Option<&str> {
    match text.strip_prefix('\'') {
        Some(quoted) => quoted_end(quoted),
        None => {
            let is_end = |b: u8| !is_nondigit(b) && !b.is_ascii_digit();
            let end = text.bytes().position(is_end).unwrap_or(text.len());
            is_c_identifier(&text[..end]).then(|| &text[end..])
        }
    }
}

/// The rest after the closing quote of a non-empty quoted name.
fn quoted_end(quoted: &str) -> Option<&str> {
    const ESCAPES: &[u8] = b"'\"?\\abfnrtv";
    const SYMBOLS: &[u8] = b"!#$%&()*+,-./:;<>=?@[]^{}|~ ";
    let bytes = quoted.as_bytes();
    let mut at = 0;
    loop {
        match *bytes.get(at)? {
            b'\'' => return (at > 0).then(|| &quoted[at + 1..]),
            b'\\' if ESCAPES.contains(bytes.get(at + 1)?) => at += 2,
            b if is_nondigit(b) || b.is_ascii_digit() || SYMBOLS.contains(&b) => at += 1,
            _ => return None,
        }
    }
}

/// Parses indices such as `[1,2]`, if any; returns the rest.
fn indices(text: &str) -> Option<&str> {
    let Some(inside) = text.strip_prefix('[') else {
        return Some(text);
    };
    let (list, rest) = inside.split_once(']')?;
    list.split(',')
        .all(|index| is_digits(index.trim_start()))
        .then_some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names() {
        for good in [
            "x",
            "_x1",
            "body.q[1]",
            "a[1,2].b",
            "a[1, 2]",
            "der(x)",
            "der(a.b[3],2)",
            "'any thing!'",
            "'it\\'s'.x",
            "der('a b')",
        ] {
            assert!(is_structured(good), "{good}");
        }
        for bad in [
            "", "1x", "a b", "a.", ".a", "a[", "a[]", "a[x]", "''", "'a", "der(x", "der()",
            "der(x,)", "a-b", "der(x).y", "ä", "'ä'", "'\\q'",
        ] {
            assert!(!is_structured(bad), "{bad}");
        }
    }

    #[test]
    fn identifiers_of_c() {
        assert!(is_c_identifier("_a1"));
        for bad in ["", "1a", "a-b", "a b", "ä"] {
            assert!(!is_c_identifier(bad), "{bad}");
        }
    }
}
