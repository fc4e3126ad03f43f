//! TOML files whose values keep their positions, so that a message about a value names file and line.

use crate::printable::{escaped, excerpt, is_hidden};
use crate::suggestion::{did_you_mean, suggestion};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A position in a text: line and column, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The line.
    pub line: usize,
    /// The column, in characters.
    pub column: usize,
}

impl std::fmt::Display for Position {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// What can be wrong with a TOML file before its content is interpreted. `file` is the name given by the user; lines
/// count from 1.
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
    #[error("{file}:{position}: not TOML: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// Where the parser stopped.
        position: Position,
        /// The parser's reason, on one line.
        reason: String,
    },
    /// An unknown field.
    #[error("{file}:{position}: unknown field `{}`{}; known are {}", excerpt(field), did_you_mean(suggestion.as_deref()), known.join(", "))]
    Unknown {
        /// The file.
        file: String,
        /// Position of the field.
        position: Position,
        /// The field.
        field: String,
        /// The known field that was probably meant.
        suggestion: Option<String>,
        /// All known fields.
        known: Vec<String>,
    },
    /// A required field is missing.
    #[error("{file}:{position}: the field `{}` is missing", excerpt(field))]
    Missing {
        /// The file.
        file: String,
        /// Position of the table that should hold it.
        position: Position,
        /// The field.
        field: String,
    },
    /// A value of the wrong kind.
    #[error(
        "{file}:{position}: `{}` is {found}; expected {expected}",
        excerpt(field)
    )]
    Kind {
        /// The file.
        file: String,
        /// Position of the value.
        position: Position,
        /// The field.
        field: String,
        /// The expected kind: `a number`, `a string`.
        expected: &'static str,
        /// The kind of the value in the file.
        found: &'static str,
    },
}

/// Reads a file as text.
///
/// # Errors
/// If the file cannot be read or is not UTF-8.
pub fn read(path: &Path) -> Result<String, DocumentError> {
    crate::file::text(path).map_err(|source| DocumentError::Read {
        file: path.to_owned(),
        source,
    })
}

/// A number in TOML notation. It reads back to the same bits, except that all NaN become one.
pub fn number(value: f64) -> String {
    match value.is_nan() {
        true => "nan".into(),
        false => format!("{value:?}"),
    }
}

/// Replaces the decimal comma of a number by a point: `0,05` becomes `0.05`.
pub fn with_point(text: &str) -> Option<String> {
    let (whole, part) = text.trim().split_once(',')?;
    let is_digits = |digits: &str| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let good = is_digits(whole.strip_prefix(['-', '+']).unwrap_or(whole))
        && is_digits(part.split(['e', 'E']).next().unwrap_or_default());
    let number = format!("{whole}.{part}");
    (good && number.parse::<f64>().is_ok()).then_some(number)
}

/// The message for a line of TOML with a decimal comma in a number.
fn comma(text: &str, at: usize) -> Option<String> {
    let before = text.get(..at)?;
    let line = &text[before.rfind('\n').map_or(0, |end| end + 1)..];
    let (field, value) = match within(text, at) {
        Some(found) => found,
        None => {
            let (field, value) = line.lines().next()?.split_once('=')?;
            (field, value.split('#').next()?)
        }
    };
    let number = with_point(value)?;
    let field = field.trim();
    Some(format!("a decimal comma; write `{field} = {number}`"))
}

/// A field of an inline table and its value, if parsing stopped after `field = 0,1`.
fn within(text: &str, at: usize) -> Option<(&str, &str)> {
    let is_digit = |c: char| c.is_ascii_digit();
    let value = text.get(..at)?;
    let whole = value.trim_end_matches(is_digit).strip_suffix(',')?;
    let field = whole.trim_end_matches(is_digit);
    let name = field.trim_end().strip_suffix('=')?.trim_end();
    let is_bare = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
    let begin = name.trim_end_matches(is_bare).len();
    Some((&name[begin..], &value[field.len()..]))
}

/// Any text as a TOML string that reads back as the same text: on one line, without characters that are
/// [not shown](is_hidden).
pub fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if is_hidden(c) => out += &escaped(c),
            c => out.push(c),
        }
    }
    out + "\""
}

/// Any text as a TOML key: bare if it may be, otherwise [quoted].
pub fn key(text: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_';
    match !text.is_empty() && text.chars().all(is_bare) {
        true => text.to_owned(),
        false => quoted(text),
    }
}

/// A place in a file; displayed as `file:line:column` or `file:line`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file, as the user named it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1, if known.
    pub column: Option<usize>,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.file, self.line)?;
        match self.column {
            Some(column) => write!(f, ":{column}"),
            None => Ok(()),
        }
    }
}

/// The message for a key that occurs twice.
fn duplicate(error: &toml::de::Error, text: &str) -> Option<String> {
    let key = text.get(error.span()?)?.trim_matches(['"', '\'']);
    (error.message() == "duplicate key").then(|| format!("`{key}` stands twice"))
}

/// File name and text, used to turn a span into a position.
#[derive(Debug, Clone, Copy)]
struct Source<'t> {
    file: &'t str,
    text: &'t str,
    lines: &'t Lines,
}

/// Where lines of a text begin and which of its bytes continue a character, so that a position costs the same wherever it
/// is.
#[derive(Debug)]
struct Lines {
    begins: Vec<usize>,
    continued: Vec<usize>,
}

impl Lines {
    fn of(text: &str) -> Self {
        let bytes = || text.bytes().enumerate();
        let after = bytes()
            .filter(|(_, byte)| *byte == b'\n')
            .map(|(k, _)| k + 1);
        Self {
            begins: std::iter::once(0).chain(after).collect(),
            continued: bytes()
                .filter(|(_, byte)| byte & 0xc0 == 0x80)
                .map(|(k, _)| k)
                .collect(),
        }
    }

    fn position(&self, byte: usize) -> Position {
        let line = self.begins.partition_point(|begin| *begin <= byte);
        let begin = self.begins[line - 1];
        let continued = |byte| self.continued.partition_point(|own| *own < byte);
        Position {
            line,
            column: 1 + byte - begin - (continued(byte) - continued(begin)),
        }
    }
}

impl Source<'_> {
    fn position(&self, at: usize) -> Position {
        self.lines.position(at)
    }

    fn place(&self, at: usize) -> Place {
        let Position { line, column } = self.position(at);
        Place {
            file: self.file.to_owned(),
            line,
            column: Some(column),
        }
    }
}

impl Position {
    /// The position of a byte offset in a text.
    pub fn of(text: &str, byte: usize) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        Lines::of(before).position(before.len())
    }
}

/// A parsed file.
#[derive(Debug)]
pub struct Document<'t> {
    file: &'t str,
    text: &'t str,
    lines: Lines,
    root: DeTable<'t>,
}

impl<'t> Document<'t> {
    /// Parses a TOML text; `file` is the name used in messages.
    ///
    /// # Errors
    /// If the text is not TOML.
    pub fn parse(text: &'t str, file: &'t str) -> Result<Self, DocumentError> {
        let lines = Lines::of(text);
        match DeTable::parse(text) {
            Ok(root) => Ok(Self {
                file,
                text,
                lines,
                root: root.into_inner(),
            }),
            Err(error) => Err(DocumentError::Syntax {
                file: file.into(),
                position: lines.position(error.span().map_or(0, |span| span.start)),
                reason: comma(text, error.span().map_or(0, |span| span.start))
                    .or_else(|| duplicate(&error, text))
                    .unwrap_or_else(|| error.message().replace('\n', ", ")),
            }),
        }
    }

    /// The top-level table.
    pub fn root(&self) -> TomlTable<'_> {
        TomlTable {
            source: Source {
                file: self.file,
                text: self.text,
                lines: &self.lines,
            },
            table: &self.root,
            position: Position { line: 1, column: 1 },
        }
    }
}

/// An entry of a list.
#[derive(Debug, Clone, Copy)]
pub enum Item<'a> {
    /// A string.
    Text(&'a str),
    /// A table.
    Table(TomlTable<'a>),
}

/// A table of a [`Document`].
#[derive(Debug, Clone, Copy)]
pub struct TomlTable<'a> {
    source: Source<'a>,
    table: &'a DeTable<'a>,
    position: Position,
}

impl<'a> TomlTable<'a> {
    /// The name of the file.
    pub fn file(&self) -> &'a str {
        self.source.file
    }

    /// Line of a field's value, or of the table if the field is missing.
    pub fn line(&self, field: &str) -> usize {
        self.position(field).line
    }

    /// Position of a field's value, or of the table if the field is missing.
    pub fn position(&self, field: &str) -> Position {
        let value = self.get(field);
        value.map_or(self.position, |value| {
            self.source.position(value.span().start)
        })
    }

    /// Byte offset of a field's name; 0 if the field is missing.
    pub fn byte_of_name(&self, field: &str) -> usize {
        let own = self.table.get_key_value(field);
        own.map_or(0, |(name, _)| name.span().start)
    }

    /// Byte range of a field's value.
    pub fn bytes(&self, field: &str) -> Option<std::ops::Range<usize>> {
        Some(self.get(field)?.span())
    }

    /// Whether the field exists.
    pub fn has(&self, field: &str) -> bool {
        self.get(field).is_some()
    }

    /// A number or a string as written: an expression.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn expression(&self, field: &str) -> Result<Option<String>, DocumentError> {
        self.value(field, "an expression in quotes, or a number", scalar)
    }

    /// Location of the content of a string, or of a string in an array, so that positions within it can be found. If
    /// the string contains escapes, it is the location of the value.
    pub fn content(&self, field: &str, entry: Option<usize>) -> Content {
        let value = self.get(field);
        let value = value.and_then(|value| match entry {
            None => Some(value),
            Some(entry) => value.get_ref().as_array()?.get(entry),
        });
        let start = value.map_or(0, |value| value.span().start);
        let found = value.and_then(|value| {
            let raw = self.source.text.get(value.span())?;
            raw.find(value.get_ref().as_str()?)
        });
        Content {
            start: start + found.unwrap_or_default(),
            plain: found.is_some(),
        }
    }

    /// An array of two numbers or strings, as written.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn pair(&self, field: &str) -> Result<Option<[String; 2]>, DocumentError> {
        let expected = "an array of two numbers or expressions: [-1, 1]";
        self.value(field, expected, |value| {
            let array = value.as_array().filter(|array| array.len() == 2)?;
            let entry = |k: usize| scalar(array.get(k)?.get_ref());
            Some([entry(0)?, entry(1)?])
        })
    }

    /// Place of a field's name, if the field exists.
    pub fn key_place(&self, field: &str) -> Option<Place> {
        let (key, _) = self.table.get_key_value(field)?;
        Some(self.source.place(key.span().start))
    }

    /// Place of a field's value, if the field exists.
    pub fn place(&self, field: &str) -> Option<Place> {
        Some(self.source.place(self.get(field)?.span().start))
    }

    /// Rejects fields other than the known ones.
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
            position: self.source.position(key.span().start),
            field: key.get_ref().to_string(),
            suggestion: suggestion(key.get_ref(), known.iter().copied()).map(str::to_owned),
            known: known.iter().map(|&name| name.to_owned()).collect(),
        })
    }

    /// A number, written as an integer or a float.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn number(&self, field: &str) -> Result<Option<f64>, DocumentError> {
        self.value(field, "a number", real)
    }

    /// An array of numbers.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn numbers(&self, field: &str) -> Result<Option<Vec<f64>>, DocumentError> {
        self.value(field, "an array of numbers", |value| entries(value, real))
    }

    /// An array of rows of numbers.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn rows(&self, field: &str) -> Result<Option<Vec<Vec<f64>>>, DocumentError> {
        self.value(field, "an array of rows of numbers", |value| {
            entries(value, |row| entries(row, real))
        })
    }

    /// A string.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn string(&self, field: &str) -> Result<Option<&'a str>, DocumentError> {
        self.value(field, "a string", DeValue::as_str)
    }

    /// A string or a list of strings, each with its place.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn strings(&self, field: &str) -> Result<Option<Vec<(&'a str, Place)>>, DocumentError> {
        let placed = |value: &'a Spanned<DeValue<'a>>| {
            let text = value.get_ref().as_str()?;
            Some((text, self.source.place(value.span().start)))
        };
        let whole = self.get(field);
        self.value(
            field,
            "a string or a list of strings",
            |value| match value {
                DeValue::Array(items) => items.iter().map(placed).collect(),
                _ => Some(vec![placed(whole?)?]),
            },
        )
    }

    /// A string, a table, or a list of these, each with its place.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn items(&self, field: &str) -> Result<Option<Vec<(Item<'a>, Place)>>, DocumentError> {
        let placed = |value: &'a Spanned<DeValue<'a>>| {
            let at = value.span().start;
            let item = match value.get_ref() {
                DeValue::String(text) => Item::Text(text),
                DeValue::Table(table) => Item::Table(TomlTable {
                    source: self.source,
                    table,
                    position: self.source.position(at),
                }),
                _ => return None,
            };
            Some((item, self.source.place(at)))
        };
        let whole = self.get(field);
        self.value(
            field,
            "a string or a list of strings",
            |value| match value {
                DeValue::Array(items) => items.iter().map(placed).collect(),
                _ => Some(vec![placed(whole?)?]),
            },
        )
    }

    /// A boolean.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn boolean(&self, field: &str) -> Result<Option<bool>, DocumentError> {
        self.value(field, "true or false", DeValue::as_bool)
    }

    /// A table within this one (`[field]`).
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn table(&self, field: &str) -> Result<Option<TomlTable<'a>>, DocumentError> {
        let position = self.source.position(self.byte_of_name(field));
        self.value(field, "a table", |value| {
            Some(TomlTable {
                source: self.source,
                table: value.as_table()?,
                position,
            })
        })
    }

    /// Names of all fields, in the order of the file.
    pub fn names(&self) -> Vec<&'a str> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.iter().map(|key| key.get_ref().as_ref()).collect()
    }

    /// A number, boolean or string as text, as written in the file.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn text(&self, field: &str) -> Result<Option<String>, DocumentError> {
        self.value(
            field,
            "a number, true, false or a string",
            |value| match value {
                DeValue::Boolean(value) => Some(value.to_string()),
                other => scalar(other),
            },
        )
    }

    /// Whether a field is a table.
    pub fn is_table(&self, field: &str) -> bool {
        self.get(field)
            .is_some_and(|value| value.get_ref().is_table())
    }

    /// Number of fields.
    pub fn count(&self) -> usize {
        self.table.len()
    }

    /// The tables of an array of tables (`[[field]]`); empty if the field is missing.
    ///
    /// # Errors
    /// If the value is of another kind.
    pub fn tables(&self, field: &str) -> Result<Vec<TomlTable<'a>>, DocumentError> {
        let tables = self.value(field, "an array of tables", |value| {
            (value.as_array()?.iter())
                .map(|item| {
                    Some(TomlTable {
                        source: self.source,
                        table: item.get_ref().as_table()?,
                        position: self.source.position(item.span().start),
                    })
                })
                .collect::<Option<Vec<_>>>()
        })?;
        Ok(tables.unwrap_or_default())
    }

    /// Turns a missing value of a required field into an error.
    ///
    /// # Errors
    /// If the value is missing.
    pub fn required<T>(&self, field: &str, value: Option<T>) -> Result<T, DocumentError> {
        value.ok_or_else(|| DocumentError::Missing {
            file: self.source.file.into(),
            position: self.position,
            field: field.into(),
        })
    }

    fn get(&self, field: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(field)
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
            position: self.source.position(value.span().start),
            field: field.into(),
            expected,
            found: kind(value.get_ref()),
        })
    }
}

/// A number, written as an integer or a float.
fn real(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) if is_beyond_range(number.as_str()) => None,
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
            .map(|number| number as f64)
            // More than 64 bits.
            .or_else(|_| number.as_str().parse())
            .ok(),
        _ => None,
    }
}

/// Whether the digits of a number are those of one above the largest double, such as `1e400`.
fn is_beyond_range(digits: &str) -> bool {
    let is_infinite = digits.parse().is_ok_and(f64::is_infinite);
    is_infinite && digits.contains(|c: char| c.is_ascii_digit())
}

/// Converts each entry of an array.
fn entries<T>(value: &DeValue<'_>, of: impl Fn(&DeValue<'_>) -> Option<T>) -> Option<Vec<T>> {
    value
        .as_array()?
        .iter()
        .map(|own| of(own.get_ref()))
        .collect()
}

/// A number or string as written.
fn scalar(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::Float(number) if is_beyond_range(number.as_str()) => None,
        DeValue::Float(number) => Some(number.as_str().to_owned()),
        DeValue::Integer(number) => {
            let whole = i64::from_str_radix(number.as_str(), number.radix());
            Some(whole.ok()?.to_string())
        }
        DeValue::String(text) => Some(text.to_string()),
        _ => None,
    }
}

/// Location of a string's content in a file.
#[derive(Debug, Clone, Copy)]
pub struct Content {
    start: usize,
    plain: bool,
}

impl Content {
    /// Byte offset in the text of a byte offset in the content.
    pub fn byte(&self, offset: usize) -> usize {
        match self.plain {
            true => self.start + offset,
            false => self.start,
        }
    }
}

/// A value's kind as text.
fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Float(number) if is_beyond_range(number.as_str()) => {
            "a number above the largest double"
        }
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}
