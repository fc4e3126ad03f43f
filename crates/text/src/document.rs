//! TOML files whose values know where they stand, so that a message about one names file and line.

use crate::nearest::{did_you_mean, nearest};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What can be wrong with a TOML file before its content is looked at. `file` is the file as the user
/// named it; lines count from 1.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The file cannot be opened or read as text.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{file}:{line}: not TOML: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// Line where the parser stopped.
        line: usize,
        /// The parser's reason, on one line.
        reason: String,
    },
    /// A field that nobody knows.
    #[error("{file}:{line}: unknown field `{field}`{}; known are {}", did_you_mean(nearest.as_deref()), known.join(", "))]
    Unknown {
        /// The file.
        file: String,
        /// Line of the field.
        line: usize,
        /// The field.
        field: String,
        /// The known field that was probably meant.
        nearest: Option<String>,
        /// All known fields.
        known: Vec<String>,
    },
    /// A field that must be there.
    #[error("{file}:{line}: the field `{field}` is missing")]
    Missing {
        /// The file.
        file: String,
        /// Line of the table that should hold it.
        line: usize,
        /// The field.
        field: String,
    },
    /// A value of another kind.
    #[error("{file}:{line}: `{field}` is {found}; expected {expected}")]
    Kind {
        /// The file.
        file: String,
        /// Line of the value.
        line: usize,
        /// The field.
        field: String,
        /// What is expected: `a number`, `a string`.
        expected: &'static str,
        /// The kind of what stands there.
        found: &'static str,
    },
}

/// Reads a file as text.
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read(path: &Path) -> Result<String, DocumentError> {
    std::fs::read_to_string(path).map_err(|source| DocumentError::Read {
        file: path.to_owned(),
        source,
    })
}

/// A number as TOML spells it; it reads back to the same bits, but that all NaN are one.
pub fn number(value: f64) -> String {
    match value.is_nan() {
        true => "nan".into(),
        false => format!("{value:?}"),
    }
}

/// A number that was written with a decimal comma, with a point: `0.05` of `0,05`.
pub fn with_point(text: &str) -> Option<String> {
    let (whole, part) = text.trim().split_once(',')?;
    let is_digits = |digits: &str| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let good = is_digits(whole.strip_prefix(['-', '+']).unwrap_or(whole))
        && is_digits(part.split(['e', 'E']).next().unwrap_or_default());
    let number = format!("{whole}.{part}");
    (good && number.parse::<f64>().is_ok()).then_some(number)
}

/// What to say of a line of TOML that gives a number with a decimal comma.
fn comma(text: &str, at: usize) -> Option<String> {
    let before = text.get(..at)?;
    let line = &text[before.rfind('\n').map_or(0, |end| end + 1)..];
    let (field, value) = line.lines().next()?.split_once('=')?;
    let number = with_point(value.split('#').next()?)?;
    let field = field.trim();
    Some(format!("a decimal comma; write `{field} = {number}`"))
}

/// File and text, to turn a span into a line.
#[derive(Debug, Clone, Copy)]
struct Source<'t> {
    file: &'t str,
    text: &'t str,
}

impl Source<'_> {
    fn line(&self, at: usize) -> usize {
        1 + self.text[..at.min(self.text.len())].matches('\n').count()
    }
}

/// A parsed file.
#[derive(Debug)]
pub struct Document<'t> {
    source: Source<'t>,
    root: DeTable<'t>,
}

impl<'t> Document<'t> {
    /// Parses a TOML text; `file` is its name in messages.
    ///
    /// # Errors
    /// When the text is not TOML.
    pub fn parse(text: &'t str, file: &'t str) -> Result<Self, DocumentError> {
        let source = Source { file, text };
        match DeTable::parse(text) {
            Ok(root) => Ok(Self {
                source,
                root: root.into_inner(),
            }),
            Err(error) => Err(DocumentError::Syntax {
                file: file.into(),
                line: source.line(error.span().map_or(0, |span| span.start)),
                reason: comma(text, error.span().map_or(0, |span| span.start))
                    .unwrap_or_else(|| error.message().replace('\n', ", ")),
            }),
        }
    }

    /// The top-level table.
    pub fn root(&self) -> Table<'_> {
        Table {
            source: self.source,
            table: &self.root,
            line: 1,
        }
    }
}

/// A table of a [`Document`].
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    source: Source<'a>,
    table: &'a DeTable<'a>,
    line: usize,
}

impl<'a> Table<'a> {
    /// The name of the file.
    pub fn file(&self) -> &'a str {
        self.source.file
    }

    /// Line of a field, or of the table where the field is missing.
    pub fn line(&self, field: &str) -> usize {
        self.get(field)
            .map_or(self.line, |value| self.source.line(value.span().start))
    }

    /// Refuses fields other than the known ones.
    ///
    /// # Errors
    /// On the first unknown field.
    pub fn only(&self, known: &[&str]) -> Result<(), DocumentError> {
        let mut unknown: Vec<_> = (self.table.keys())
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .collect();
        unknown.sort_by_key(|key| key.span().start);
        let Some(key) = unknown.first() else {
            return Ok(());
        };
        Err(DocumentError::Unknown {
            file: self.source.file.into(),
            line: self.source.line(key.span().start),
            field: key.get_ref().to_string(),
            nearest: nearest(key.get_ref(), known.iter().copied()).map(str::to_owned),
            known: known.iter().map(|&name| name.to_owned()).collect(),
        })
    }

    /// A number, written as integer or float.
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn number(&self, field: &str) -> Result<Option<f64>, DocumentError> {
        self.value(field, "a number", |value| match value {
            DeValue::Float(number) => number.as_str().parse().ok(),
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
                .ok()
                .map(|number| number as f64),
            _ => None,
        })
    }

    /// A string.
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn string(&self, field: &str) -> Result<Option<&'a str>, DocumentError> {
        self.value(field, "a string", DeValue::as_str)
    }

    /// A boolean.
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn boolean(&self, field: &str) -> Result<Option<bool>, DocumentError> {
        self.value(field, "true or false", DeValue::as_bool)
    }

    /// A table within this one (`[field]`).
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn table(&self, field: &str) -> Result<Option<Table<'a>>, DocumentError> {
        let line = self.line(field);
        self.value(field, "a table", |value| {
            Some(Table {
                source: self.source,
                table: value.as_table()?,
                line,
            })
        })
    }

    /// Names of all fields, in the order of the file.
    pub fn names(&self) -> Vec<&'a str> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.iter().map(|key| key.get_ref().as_ref()).collect()
    }

    /// A number, boolean or string as text, the way the file spells it.
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn text(&self, field: &str) -> Result<Option<String>, DocumentError> {
        self.value(field, "a number, true, false or a string", |value| {
            Some(match value {
                DeValue::Float(number) => number.as_str().to_owned(),
                DeValue::Integer(number) => {
                    let whole = i64::from_str_radix(number.as_str(), number.radix());
                    whole.ok()?.to_string()
                }
                DeValue::Boolean(value) => value.to_string(),
                DeValue::String(text) => text.to_string(),
                _ => return None,
            })
        })
    }

    /// Whether a field is a table of its own.
    pub fn is_table(&self, field: &str) -> bool {
        self.get(field)
            .is_some_and(|value| value.get_ref().is_table())
    }

    /// Number of fields.
    pub fn count(&self) -> usize {
        self.table.len()
    }

    /// The tables of an array of tables (`[[field]]`); none where the field is missing.
    ///
    /// # Errors
    /// When the value is of another kind.
    pub fn tables(&self, field: &str) -> Result<Vec<Table<'a>>, DocumentError> {
        let tables = self.value(field, "an array of tables", |value| {
            (value.as_array()?.iter())
                .map(|item| {
                    Some(Table {
                        source: self.source,
                        table: item.get_ref().as_table()?,
                        line: self.source.line(item.span().start),
                    })
                })
                .collect::<Option<Vec<_>>>()
        })?;
        Ok(tables.unwrap_or_default())
    }

    /// The value that must be there: turns a missing one into an error.
    ///
    /// # Errors
    /// When there is none.
    pub fn required<T>(&self, field: &str, value: Option<T>) -> Result<T, DocumentError> {
        value.ok_or_else(|| DocumentError::Missing {
            file: self.source.file.into(),
            line: self.line,
            field: field.into(),
        })
    }

    fn get(&self, field: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        (self.table.iter())
            .find(|(key, _)| key.get_ref().as_ref() == field)
            .map(|(_, value)| value)
    }

    fn value<T>(
        &self,
        field: &str,
        expected: &'static str,
        convert: impl FnOnce(&'a DeValue<'a>) -> Option<T>,
    ) -> Result<Option<T>, DocumentError> {
        let Some(value) = self.get(field) else {
            return Ok(None);
        };
        let converted = convert(value.get_ref());
        converted.map(Some).ok_or_else(|| DocumentError::Kind {
            file: self.source.file.into(),
            line: self.source.line(value.span().start),
            field: field.into(),
            expected,
            found: kind(value.get_ref()),
        })
    }
}

/// A value's kind in words.
fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}
