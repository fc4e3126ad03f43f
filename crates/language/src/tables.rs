//! The files of `table("file.csv", x)`.

use crate::error::{Fault, ModelFileError};
use crate::file::ModelFile;
use crate::scope::Scope;
use crate::syntax::Term;
use pilotage_expression::Curve;
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
    let fault = |line: u64, reason: String| Fault::TableContent {
        file: name.to_owned(),
        line,
        reason,
    };
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .flexible(true)
        .from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|error| fault(1, error.to_string()))?;
    if header.len() != 2 {
        let reason = format!(
            "{}; expected two: `speed [m/s],drag [N]`",
            counted(header.len(), "column")
        );
        return Err(fault(1, reason));
    }
    let mut units = [String::new(), String::new()];
    for (unit, cell) in units.iter_mut().zip(header) {
        if cell.trim().parse::<f64>().is_ok() {
            let reason = "a number; the first line names both columns: `speed [m/s],drag [N]`";
            return Err(fault(1, reason.to_owned()));
        }
        *unit = unit_of(cell).map_err(|reason| fault(1, reason))?;
    }
    let (mut x, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for row in reader.records() {
        let row = row.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            fault(line, error.to_string())
        })?;
        let line = row.position().map_or(0, csv::Position::line);
        if row.len() != 2 {
            return Err(fault(line, format!("{} cells; expected two", row.len())));
        }
        let number = |cell: &str| match cell.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(fault(
                line,
                format!("`{}` is not a finite number", excerpt(cell)),
            )),
        };
        let (at, value) = (number(&row[0])?, number(&row[1])?);
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
    let curve = Curve::through(x, y);
    let curve = curve.ok_or_else(|| fault(1, "fewer than two rows of numbers".to_owned()))?;
    Ok(TableFile {
        units,
        curve: Arc::new(curve),
        text,
    })
}

/// The unit of a header cell `name [unit]`; empty if there is none.
fn unit_of(cell: &str) -> Result<String, String> {
    let Some((_, unit)) = cell.trim().split_once('[') else {
        return Ok(String::new());
    };
    let unit = unit.strip_suffix(']').unwrap_or(unit).trim();
    match pilotage_units::Base::of(unit) {
        Some(_) => Ok(unit.to_owned()),
        None => Err(format!(
            "unknown unit `{unit}`; write it as in m/s2 or 1/(m.s)"
        )),
    }
}
