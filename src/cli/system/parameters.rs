//! Reads start values from a file.

use super::super::Failure;
use super::{full_name, only};
use crate::cosim::description::{Setting, Spanned};
use crate::cosim::{System, Unit};
use crate::document::{self, Document, DocumentError, Place, TomlTable};
use crate::series::{Cell, Numbers, Rows};
use pilotage_text::printable::excerpt;
use std::path::Path;

/// An entry of the file.
struct Entry {
    line: usize,
    /// `instance.variable`.
    name: String,
    value: String,
    /// Unit of the value; if empty, that of the variable.
    unit: String,
}

/// Reads the values, converted to the units of the variables; with a note on how the file was taken, if it is not plain.
pub fn read(system: &System, file: &Path) -> Result<(Vec<Setting>, Option<String>), Failure> {
    let (text, name) = (document::read(file)?, file.display().to_string());
    let (entries, note) = match file.extension().is_some_and(|extension| extension == "csv") {
        true => rows(&text, &name)?,
        false => {
            let mut entries = Vec::new();
            fields(Document::parse(&text, &name)?.root(), "", &mut entries)?;
            (entries, None)
        }
    };
    let setting = |mut entry: Entry| {
        entry.name = full_name(system, &entry.name, only(system));
        let place = Some(Place {
            file: name.clone(),
            line: entry.line,
            column: None,
        });
        let value = in_its_unit(system, &entry);
        let value = value.map_err(|why| Failure::new(why).at(place.as_ref()))?;
        let name = Spanned {
            value: entry.name,
            place,
        };
        Ok(Setting { name, value })
    };
    let settings: Result<_, Failure> = entries.into_iter().map(setting).collect();
    Ok((settings?, note))
}

/// The value in the unit of the variable.
fn in_its_unit(system: &System, entry: &Entry) -> Result<String, String> {
    if entry.unit.is_empty() {
        return Ok(entry.value.clone());
    }
    let variable = system
        .find(&entry.name)
        .map_err(|error| error.to_string())?;
    let unit = (variable.unit.as_ref())
        .ok_or_else(|| format!("`{}` has no unit; leave `{}` out", entry.name, entry.unit))?;
    let conversion = Unit::named(&entry.unit).conversion(unit).ok_or_else(|| {
        let (name, found, own) = (&entry.name, &entry.unit, &unit.name);
        format!("`{name}` is in {own}: {found} cannot be converted into it")
    })?;
    match entry.value.trim().parse() {
        Ok(value) => Ok(format!("{:?}", conversion.apply(value))),
        Err(_) => Err(format!(
            "`{}` is `{}`; expected a number",
            entry.name, entry.value
        )),
    }
}

/// Collects all fields of a TOML table and its subtables, with their names under `prefix`.
fn fields(table: TomlTable, prefix: &str, entries: &mut Vec<Entry>) -> Result<(), DocumentError> {
    for field in table.names() {
        let name = format!("{prefix}{field}");
        if table.is_table(field) {
            if let Some(inner) = table.table(field)? {
                fields(inner, &format!("{name}."), entries)?;
            }
        } else if let Some(value) = table.text(field)? {
            entries.push(Entry {
                line: table.line(field),
                name,
                value,
                unit: String::new(),
            });
        }
    }
    Ok(())
}

/// The rows of a CSV file with columns `name`, `value` and optionally `unit`, and how it was taken where it is not plain.
fn rows(text: &str, file: &str) -> Result<(Vec<Entry>, Option<String>), Failure> {
    let mut rows = Rows::new(text.as_bytes(), file)?;
    let mut entries = Vec::new();
    let mut count = 0;
    let mut numbers = Numbers::new(rows.separator());
    while rows.advance()? {
        let line = rows.line();
        let wrong = |what: String| Failure::new(format!("{file}:{line}: {what}"));
        if count == 0 {
            let found: Vec<&str> = rows.cells().collect();
            let known = found.iter().all(|c| ["name", "value", "unit"].contains(c));
            if !(known && found.len() >= 2 && found[..2] == ["name", "value"]) {
                return Err(wrong(format!(
                    "the header is `{}`; expected `name,value` or `name,value,unit`",
                    excerpt(&found.join(","))
                )));
            }
            count = found.len();
            continue;
        }
        if rows.count() != count {
            return Err(wrong(format!(
                "{} cells; expected {count}, as in the header",
                rows.count()
            )));
        }
        // Words stay: there are text and names of enumerations.
        let cell = rows.cell(1);
        let value = match numbers.read(cell, || (line, "value".to_owned())) {
            Cell::Number(value) if cell.contains(',') => format!("{value:?}"),
            Cell::Unclear(why) => return Err(wrong(format!("`{}` {why}", excerpt(cell)))),
            _ => cell.to_owned(),
        };
        entries.push(Entry {
            line,
            name: rows.cell(0).to_owned(),
            value,
            unit: if count > 2 { rows.cell(2) } else { "" }.to_owned(),
        });
    }
    let note = rows.note(numbers.taken(file)?);
    Ok((entries, note.map(|note| format!("{file}: {note}"))))
}
