//! `--start`: start values of the parameters, in their order or by name.

use crate::cli::Failure;
use crate::cli::number::number;
use crate::estimation::{Posed, ProblemFile};
use crate::suggestion::{did_you_mean, suggestion};
use pilotage_text::counted;

/// A start value, and the parameter if it is named.
#[derive(Debug, Clone)]
pub struct Begin {
    name: Option<String>,
    value: f64,
}

/// Parses `VALUE` or `NAME=VALUE`.
pub fn begin(text: &str) -> Result<Begin, String> {
    let (name, value) = match text.rsplit_once('=') {
        // Tables write θ.
        Some((name, value)) => (Some(name.trim().replace('θ', "theta")), value.trim()),
        None => (None, text),
    };
    let value = number(value)?;
    Ok(Begin { name, value })
}

/// Whether these are values in the order of the parameters.
pub fn is_unnamed(given: &[Begin]) -> bool {
    given.iter().all(|own| own.name.is_none())
}

/// The values.
pub fn values(given: &[Begin]) -> Vec<f64> {
    given.iter().map(|own| own.value).collect()
}

/// Starts the search of a problem at these values.
pub fn set(given: &[Begin], posed: &Posed<'_>, file: &mut ProblemFile) -> Result<(), Failure> {
    let names: Vec<String> = (posed.unknowns.iter())
        .map(|(unknown, _)| unknown.name.clone())
        .collect();
    for (k, value) in placed(given, &names)? {
        if !file.begin_at(&names[k], value) {
            let message = format!(
                "--start: `{}` is of a sensor and begins as its gain is 1 and its offset 0",
                names[k]
            );
            return Err(Failure::new(message).hint(
                "declare a parameter of the problem, and name it in [[measured]], as in gain = \"g\"",
            ));
        }
    }
    Ok(())
}

/// The place of a name, whole or without its instance if one parameter alone is called so.
fn placed_name(name: &str, names: &[String]) -> Option<usize> {
    let is_short = |known: &String| known.rsplit_once('.').is_some_and(|own| own.1 == name);
    let mut short = (0..names.len()).filter(|k| is_short(&names[*k]));
    let whole = names.iter().position(|known| known == name);
    whole.or_else(|| short.next().filter(|_| short.next().is_none()))
}

/// The place of each value among these names.
fn placed(given: &[Begin], names: &[String]) -> Result<Vec<(usize, f64)>, Failure> {
    let all = || names.join(", ");
    let named = given.iter().filter(|own| own.name.is_some()).count();
    if named == 0 && given.len() != names.len() {
        let message = format!(
            "--start has {}, and {} sought: {}",
            counted(given.len(), "value"),
            match names.len() {
                1 => "1 parameter is".to_owned(),
                count => format!("{count} parameters are"),
            },
            all()
        );
        return Err(Failure::new(message).hint("give one for each, in this order, or NAME=VALUE"));
    }
    if named > 0 && named < given.len() {
        return Err(
            Failure::new("--start has values with a name and values without one")
                .hint("give each its name, or none"),
        );
    }
    let mut found: Vec<(usize, f64)> = Vec::new();
    for (place, own) in given.iter().enumerate() {
        let Some(name) = &own.name else {
            found.push((place, own.value));
            continue;
        };
        let Some(k) = placed_name(name, names) else {
            let near = did_you_mean(suggestion(name, names.iter().map(String::as_str)));
            let message = format!(
                "--start: nothing that is sought is called `{name}`{near}; there are {}",
                all()
            );
            return Err(Failure::new(message));
        };
        if found.iter().any(|known| known.0 == k) {
            return Err(Failure::new(format!("--start has `{name}` twice")).hint("leave one out"));
        }
        found.push((k, own.value));
    }
    Ok(found)
}
