//! `resources/model.toml`: the model that an FMU runs, and its start values.
//!
//! A subset of TOML that needs no library: comments, `key = value`, and one table `[start]` with a
//! number for each input and parameter.
//!
//! ```toml
//! format = 1
//! model = "pilot"
//! order = 3          # pilots only
//!
//! [start]
//! target = 0.0
//! ```

use super::{Model, ModelKind};
use crate::{Quadcopter, ValueError};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The only format version so far.
const FORMAT: &str = "1";

/// Error in a model file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelFileError {
    /// Neither a comment, nor `[start]`, nor `key = value`.
    #[error("line {line}: expected `key = value` or `[start]`, found `{found}`")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// Text found.
        found: String,
    },
    /// A key is given twice.
    #[error("line {line}: {key} is given twice")]
    Twice {
        /// Line of the second one, from 1.
        line: usize,
        /// The key.
        key: String,
    },
    /// A key is missing.
    #[error("{key} is missing")]
    Missing {
        /// The key.
        key: String,
    },
    /// A key is unknown.
    #[error("line {line}: {key} is unknown to this model")]
    Unknown {
        /// Line, from 1.
        line: usize,
        /// The key.
        key: String,
    },
    /// A value is not of the expected kind.
    #[error("line {line}: {key} = {found}, expected {expected}")]
    Value {
        /// Line, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Value found.
        found: String,
        /// Value expected.
        expected: String,
    },
    /// A start value that its variable does not allow.
    #[error(transparent)]
    Start(#[from] ValueError),
}

/// Keys (those of the table with the prefix `start.`) with line and value.
type Entries<'t> = BTreeMap<String, (usize, &'t str)>;

impl Model {
    /// The text of the model file.
    pub fn to_file(&self) -> String {
        let mut text = format!(
            "# Which model this FMU runs, and the start values of its variables.\n\
             # modelDescription.xml holds the same values, and a GUID made from them: change neither.\n\
             format = {FORMAT}\nmodel = \"{}\"\n",
            self.kind.name()
        );
        // Writing to a String cannot fail.
        if let ModelKind::Pilot(pilot) = self.kind {
            let _ = writeln!(text, "order = {}", pilot.order);
        }
        text += "\n[start]\n";
        for v in self.variables() {
            if let Some(start) = v.start {
                let _ = writeln!(text, "{} = {start:?}", v.name);
            }
        }
        text
    }

    /// Reads the text of a model file.
    ///
    /// # Errors
    /// If the text is invalid: the error names the line and the key.
    pub fn from_file(text: &str) -> Result<Self, ModelFileError> {
        let mut entries = parse(text)?;
        choice(&mut entries, "format", &[FORMAT])?;
        let mut model = match choice(&mut entries, "model", &["\"pilot\"", "\"quadcopter\""])? {
            0 => Self::pilot(&vec![0.0; 2 * order(&mut entries)?], 1.0),
            _ => Self::quadcopter(&Quadcopter::default()),
        };
        for (name, start) in model.table.starts_mut() {
            *start = number(&mut entries, &format!("start.{name}"))?;
        }
        if let Some((key, (line, _))) = entries.pop_first() {
            return Err(ModelFileError::Unknown { line, key });
        }
        model.check()?;
        Ok(model)
    }
}

fn parse(text: &str) -> Result<Entries<'_>, ModelFileError> {
    let mut entries = Entries::new();
    let mut prefix = "";
    for (i, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default().trim();
        match content.split_once('=') {
            _ if content.is_empty() => {}
            None if content == "[start]" => prefix = "start.",
            Some((key, value)) => {
                let key = format!("{prefix}{}", key.trim());
                if entries.insert(key.clone(), (i + 1, value.trim())).is_some() {
                    return Err(ModelFileError::Twice { line: i + 1, key });
                }
            }
            None => {
                return Err(ModelFileError::Syntax {
                    line: i + 1,
                    found: content.to_owned(),
                });
            }
        }
    }
    Ok(entries)
}

fn take<'t, T>(
    entries: &mut Entries<'t>,
    key: &str,
    expected: &str,
    read: impl Fn(&'t str) -> Option<T>,
) -> Result<T, ModelFileError> {
    let (line, found) = entries.remove(key).ok_or_else(|| ModelFileError::Missing {
        key: key.to_owned(),
    })?;
    read(found).ok_or_else(|| ModelFileError::Value {
        line,
        key: key.to_owned(),
        found: found.to_owned(),
        expected: expected.to_owned(),
    })
}

/// Index of the value in `allowed`.
fn choice(entries: &mut Entries<'_>, key: &str, allowed: &[&str]) -> Result<usize, ModelFileError> {
    take(entries, key, &allowed.join(" or "), |found| {
        allowed.iter().position(|a| *a == found)
    })
}

fn order(entries: &mut Entries<'_>) -> Result<usize, ModelFileError> {
    let expected = format!("a number from 1 to {}", Model::MAX_ORDER);
    take(entries, "order", &expected, |found| {
        let allowed = |order: &usize| (1..=Model::MAX_ORDER).contains(order);
        found.parse().ok().filter(allowed)
    })
}

fn number(entries: &mut Entries<'_>, key: &str) -> Result<f64, ModelFileError> {
    take(entries, key, "a finite number", |found| {
        found.parse().ok().filter(|v: &f64| v.is_finite())
    })
}
