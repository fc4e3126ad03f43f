//! What users write and what they are told: TOML with places, names that were probably meant, errors
//! with their causes.

pub mod document;
pub mod error_chain;
pub mod suggestion;

/// A number of things: `1 run`, `3 runs`. The noun takes an s.
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    match count {
        1 => format!("1 {noun}"),
        _ => format!("{count} {noun}s"),
    }
}

/// Whether a text is an identifier of C: a letter or `_`, then letters, digits and `_`.
pub fn is_identifier(text: &str) -> bool {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.chars().all(is_word) && text.starts_with(|c: char| !c.is_ascii_digit())
}
