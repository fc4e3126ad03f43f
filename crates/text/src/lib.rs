//! Text input and messages: TOML with positions, suggestions for misspelt names, errors with their causes, text of
//! others made printable.
//!
//! | module | content |
//! | --- | --- |
//! | [`document`](mod@document) | TOML with the places of its values |
//! | [`file`](mod@file) | files that are read to a limit, and opened without waiting |
//! | [`error_chain`](mod@error_chain) | an error and its causes as one line |
//! | [`number`](mod@number) | numbers with a few significant digits |
//! | [`printable`](mod@printable) | text of others on lines of ours, on a terminal and in files |
//! | [`suggestion`](mod@suggestion) | the name that was probably meant |

pub mod document;
pub mod error_chain;
pub mod file;
pub mod number;
pub mod printable;
pub mod suggestion;

/// A count with its noun: `1 run`, `3 runs`. The plural appends an s.
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    match count {
        1 => format!("1 {noun}"),
        _ => format!("{count} {noun}s"),
    }
}

/// Whether a text is a C identifier: a letter or `_`, then letters, digits and `_`.
pub fn is_identifier(text: &str) -> bool {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.chars().all(is_word) && text.starts_with(|c: char| !c.is_ascii_digit())
}
