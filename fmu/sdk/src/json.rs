//! Writes JSON; what `pilotage pack` reads of a library, and what a GUID is made of.

use std::fmt::Write;

/// `{"a": 1, "b": 2}` of names and values that are JSON.
pub fn object<const N: usize>(members: [(&str, String); N]) -> String {
    let members = members.map(|(name, value)| format!("{}: {value}", string(name)));
    format!("{{{}}}", members.join(", "))
}

/// `[1, 2]` of values that are JSON.
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

/// A finite number with the digits that bring it back; `null` for none and for what JSON cannot say.
pub fn number(value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        Some(value) => format!("{value:?}"),
        None => "null".to_owned(),
    }
}
