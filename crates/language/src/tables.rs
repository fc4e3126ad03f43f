//! The files of `table("file.csv", x)`.

use crate::error::{Fault, ModelFileError};
use crate::file::ModelFile;
use crate::scope::Scope;
use crate::syntax::Term;
use pilotage_expression::Curve;
use pilotage_series::{Cell, Numbers, Rows, SeriesError};
use pilotage_text::counted;
use pilotage_text::printable::excerpt;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A table that was read.
#[derive(Debug, Clone)]
pub struct TableFile {
    /// Text of the file.
    pub text: String,
    /// Names of the units of both columns, empty if not given.
    units: [String; 2],
    curve: Arc<Curve>,
    /// How the file was taken where it is not of the plain form, for the user.
    pub note: Option<String>,
}

/// The tables of a model by file name.
pub type TableFiles = BTreeMap<String, TableFile>;

/// The tables of a model.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    pub(crate) files: TableFiles,
}

/// Returns the text of a table, given the name of its file.
pub type ReadTable<'a> = &'a dyn Fn(&str) -> std::io::Result<String>;

impl Tables {
    /// Reads the tables of a model.
    pub(crate) fn read(
        file: &ModelFile,
        scope: &Scope<'_>,
        read: ReadTable<'_>,
    ) -> Result<Self, ModelFileError> {
        let mut tables = Self::default();
        for (_, formula) in scope.formulas() {
            for (part, term) in formula.expression.terms.iter().enumerate() {
                let Term::Text(name) = term else { continue };
                if !tables.files.contains_key(name) {
                    let table = table(name, read);
                    let table = table.map_err(|fault| file.at(formula.byte(part), fault))?;
                    tables.files.insert(name.clone(), table);
                }
            }
        }
        Ok(tables)
    }

    /// Names of the units of the columns of a file.
    pub(crate) fn units(&self, file: &str) -> [&str; 2] {
        let found = self.files.get(file);
        found.map_or(["", ""], |table| table.units.each_ref().map(String::as_str))
    }

    /// The curve of a file.
    pub(crate) fn curve(&self, file: &str) -> Arc<Curve> {
        self.files[file].curve.clone()
    }
}

/// Reads a table.
fn table(name: &str, read: ReadTable<'_>) -> Result<TableFile, Fault> {
    let plain =
        !name.contains(['/', '\\', ':', '\0']) && !name.is_empty() && name != ".." && name != ".";
    if !plain {
        return Err(Fault::TablePlace(name.to_owned()));
    }
    let text = read(name).map_err(|source| Fault::TableUnread {
        file: name.to_owned(),
        source,
    })?;
    parse(name, text)
}

fn parse(name: &str, text: String) -> Result<TableFile, Fault> {
    let fault = |line: usize, reason: String| Fault::TableContent {
        file: name.to_owned(),
        line,
        reason,
    };
    let unread = |error: SeriesError| Fault::TableUnread {
        file: name.to_owned(),
        source: std::io::Error::other(error),
    };
    let mut rows = Rows::new(text.as_bytes(), name).map_err(unread)?;
    let is_there = rows.advance().map_err(unread)?;
    let count = if is_there { rows.count() } else { 0 };
    if count != 2 {
        let reason = format!(
            "{}; expected two: `speed [m/s],drag [N]`",
            counted(count, "column")
        );
        return Err(fault(rows.line().max(1), reason));
    }
    let line = rows.line();
    let mut units = [String::new(), String::new()];
    for (unit, cell) in units.iter_mut().zip(rows.cells()) {
        if cell.parse::<f64>().is_ok() {
            let reason = "a number; the first line names both columns: `speed [m/s],drag [N]`";
            return Err(fault(line, reason.to_owned()));
        }
        *unit = unit_of(cell).map_err(|reason| fault(line, reason))?;
    }
    let names: Vec<String> = rows.cells().map(str::to_owned).collect();
    let mut taken = Vec::new();
    let mut numbers = Numbers::new(rows.separator());
    let (mut x, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    while rows.advance().map_err(unread)? {
        let line = rows.line();
        if rows.count() != 2 {
            return Err(fault(line, format!("{} cells; expected two", rows.count())));
        }
        let below = rows.units().filter(|_| x.is_empty() && taken.is_empty());
        if let Some(below) = below.filter(|_| units.iter().all(String::is_empty)) {
            for (unit, cell) in units.iter_mut().zip(below) {
                *unit = known(&cell).map_err(|reason| fault(line, reason))?;
            }
            taken.push("units from the line below the header".to_owned());
            continue;
        }
        let mut number = |k: usize| {
            let cell = rows.cell(k);
            match numbers.read(cell, || (line, names[k].clone())) {
                Cell::Number(value) if value.is_finite() => Ok(value),
                Cell::Unclear(why) => Err(fault(line, format!("`{}` {why}", excerpt(cell)))),
                _ => Err(fault(
                    line,
                    format!("`{}` is not a finite number", excerpt(cell)),
                )),
            }
        };
        let (at, value) = (number(0)?, number(1)?);
        if x.last().is_some_and(|last| at <= *last) {
            let reason = format!(
                "{at} does not lie above {}; the first column increases",
                x[x.len() - 1]
            );
            return Err(fault(line, reason));
        }
        x.push(at);
        y.push(value);
    }
    taken.extend(numbers.taken(name).map_err(unread)?);
    let note = rows.note(taken);
    let curve = Curve::through(x, y);
    let curve = curve.ok_or_else(|| fault(1, "fewer than two rows of numbers".to_owned()))?;
    Ok(TableFile {
        units,
        curve: Arc::new(curve),
        note,
        text,
    })
}

/// The unit of a header cell `name [unit]`; empty if there is none.
fn unit_of(cell: &str) -> Result<String, String> {
    let Some((_, unit)) = cell.trim().split_once('[') else {
        return Ok(String::new());
    };
    known(unit.strip_suffix(']').unwrap_or(unit).trim())
}

/// The name of a unit; that of numbers without one may be `-` or nothing.
fn known(unit: &str) -> Result<String, String> {
    match pilotage_units::Base::of(unit) {
        Some(_) => Ok(unit.to_owned()),
        None if unit.is_empty() || unit == "-" => Ok(String::new()),
        None => Err(format!(
            "unknown unit `{unit}`; write it as in m/s2 or 1/(m.s)"
        )),
    }
}
