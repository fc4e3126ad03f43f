//! Writes JSON, which `pilotage pack` reads from a library and from which a GUID is computed.

use std::fmt::Write;

/// `{"a": 1, "b": 2}` from names and JSON values.
pub fn object<const N: usize>(members: [(&str, String); N]) -> String {
    let members = members.map(|(name, value)| format!("{}: {value}", string(name)));
    format!("{{{}}}", members.join(", "))
}

/// `[1, 2]` from JSON values.
pub fn array(values: impl IntoIterator<Item = String>) -> String {
    format!("[{}]", values.into_iter().collect::<Vec<_>>().join(", "))
}

/// A string with quotes.
pub fn string(text: &str) -> String {
    let mut json = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => json.extend(['\\', c]),
            // Writing to a String cannot fail.
            c if c < ' ' => drop(write!(json, "\\u{:04x}", c as u32)),
            c => json.push(c),
        }
    }
    json + "\""
}

/// A finite number with enough digits to restore it; `null` for `None` and for values that JSON cannot represent.
pub fn number(value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        Some(value) => format!("{value:?}"),
        None => "null".to_owned(),
    }
}
