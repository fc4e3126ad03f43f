//! The origin of a page, and commands as the user can type them.

use super::call;
use crate::date;
use crate::file;
use crate::flights::trials::sha256;
use crate::report::Made;
use pilotage_process::program::file as program_file;
use pilotage_text::printable::{escaped, is_hidden};
use std::path::{Path, PathBuf};

/// Command line and date of this run.
pub fn made() -> Made {
    let words = call::arguments().into_iter().skip(1);
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    let command: Vec<String> = std::iter::once("pilotage".to_owned())
        .chain(words)
        .collect();
    Made {
        command: command.join(" "),
        date: date::now(),
    }
}

/// The command as the user can type it: `pilotage` if the search path leads to this program, otherwise as typed
/// (`target/release/pilotage`).
pub fn program() -> String {
    let name = "pilotage";
    let typed = call::arguments().into_iter().next().map(PathBuf::from);
    let own = program_file().and_then(|file| file.canonicalize().ok());
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let mut found = std::env::split_paths(&folders).map(|folder| folder.join(name));
    let first = found.find(|path| path.is_file());
    let is_found = own.is_some() && first.and_then(|path| path.canonicalize().ok()) == own;
    match typed.filter(|_| !is_found) {
        Some(typed) => quoted(&typed.to_string_lossy()),
        None => name.to_owned(),
    }
}

/// A word, quoted for the shell if necessary. [Hidden](is_hidden) characters are escaped, as bash and zsh read them.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-+.,:/=@%".contains(c);
    if word.contains(is_hidden) {
        let escaped = word.chars().map(|c| match c {
            '\\' | '\'' => format!("\\{c}"),
            c if is_hidden(c) => escaped(c),
            c => c.to_string(),
        });
        return format!("$'{}'", escaped.collect::<String>());
    }
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

/// The files with their SHA-256; folders have none, nor have pipes, which can be read only once.
pub fn with_sums(files: &[PathBuf]) -> Vec<(String, String)> {
    let sum = |path: &Path| {
        let bytes = path.is_file().then(|| file::bytes(path).ok()).flatten();
        bytes.map_or_else(|| "\u{2013}".to_owned(), |bytes| sha256(&bytes))
    };
    (files.iter())
        .map(|path| (path.display().to_string(), sum(path)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_where_a_shell_needs_it() {
        assert_eq!(
            quoted("pilot.stick=quadcopter.stick"),
            "pilot.stick=quadcopter.stick"
        );
        assert_eq!(quoted("pilot.*"), "'pilot.*'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("a\nb'\\\u{202e}"), r"$'a\u000ab\'\\\u202e'");
    }
}
