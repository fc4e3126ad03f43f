//! Tables that feed inputs.

use super::super::Failure;
use super::full_name;
use crate::cosim::description::Wire;
use crate::cosim::{Clock, Role, Source, System, SystemError, ValueKind, Variable};
use crate::series::{Column, Series};
use std::path::{Path, PathBuf};

/// A table that has been added to the system.
pub struct InputTable {
    /// Name of its instance.
    pub name: String,
    file: PathBuf,
    unused: Vec<String>,
    begin: f64,
    end: f64,
    /// How the file was taken.
    note: Option<String>,
    /// Columns that are named like inputs, with these.
    pub wires: Vec<(String, String)>,
}

/// Adds a table as an instance and connects the columns named like inputs: `instance.input`, or `input` if there is
/// only one instance.
pub fn add(
    system: &mut System,
    name: &str,
    file: &Path,
    connections: &[Wire],
    only: Option<&str>,
) -> Result<InputTable, Failure> {
    let mut series = Series::read_table(file)?;
    let at = |error: &dyn std::error::Error| Failure::new(format!("{}: {error}", file.display()));
    let (mut named, mut unused, mut holds) = (Vec::new(), Vec::new(), Vec::new());
    let mut is_used = false;
    for column in std::mem::take(&mut series.columns) {
        let input = full_name(system, &column.name, only);
        let own = own_input(system, &input)
            .map_err(|error| at(&error).hint("rename the column, or leave it out"))?;
        let port = format!("{name}.{}", column.name);
        let wired = connections.iter().find(|wire| wire.from.value == port);
        let held = match (own, wired) {
            (Some(held), _) => {
                named.push((port, input));
                held
            }
            (None, Some(wire)) => system.find(&wire.to.value).map_or(None, held),
            (None, None) => {
                unused.push(column.name.clone());
                // Results of a run may have columns that cannot be used and are not needed.
                if !is_usable(&column) {
                    continue;
                }
                None
            }
        };
        is_used |= own.is_some() || wired.is_some();
        holds.extend(held.map(|kind| (series.columns.len(), kind)));
        series.columns.push(column);
    }
    for text in &series.texts {
        let own = own_input(system, &full_name(system, &text.name, only));
        let port = format!("{name}.{}", text.name);
        let is_wired = connections.iter().any(|wire| wire.from.value == port);
        if is_wired || !matches!(own, Ok(None)) {
            return Err(text.error(&file.display().to_string()).into());
        }
        unused.push(text.name.clone());
    }
    if !is_used {
        let message = format!("{}: no column is named like an input", file.display());
        return Err(Failure::new(message).hint(format!(
            "name a column `INSTANCE.INPUT`, or wire one with --connect {name}.COLUMN=INSTANCE.INPUT"
        )));
    }
    let ends = [series.time.first(), series.time.last()].map(|time| time.copied().unwrap_or(0.0));
    let note = series.note.take();
    let mut source = Source::new(series).map_err(|error| at(&error))?;
    for (column, kind) in holds {
        (source.hold_as(column, kind)).map_err(|error| at(&error))?;
    }
    system.add(name, Box::new(source))?;
    for (port, input) in &named {
        system.connect(port, input)?;
    }
    Ok(InputTable {
        name: name.to_owned(),
        file: file.to_owned(),
        unused,
        begin: ends[0],
        end: ends[1],
        note,
        wires: named,
    })
}

/// Whether a column has values that can feed an input.
fn is_usable(column: &Column) -> bool {
    let values = &column.values;
    values.iter().any(|value| !value.is_nan()) && !values.iter().any(|value| value.is_infinite())
}

/// The type of a variable whose values are held between samples, not interpolated.
fn held(variable: &Variable) -> Option<ValueKind> {
    variable.is_discrete.then_some(variable.kind)
}

/// How the input named like the column takes its values, if there is one. Columns named like no variable, or like an
/// output (the results of another run), are ignored; unknown variables of an existing instance are errors, since they
/// are probably a mistake.
fn own_input(system: &System, column: &str) -> Result<Option<Option<ValueKind>>, SystemError> {
    match system.find(column) {
        Ok(variable) => Ok((variable.role == Role::Input).then(|| held(variable))),
        Err(error @ SystemError::UnknownVariable { .. }) => Err(error),
        Err(_) => Ok(None),
    }
}

impl InputTable {
    /// Notes on what the user may not have intended.
    pub fn notes(&self, clock: &Clock) -> Vec<String> {
        let file = self.file.display();
        let mut notes: Vec<String> = (self.note.iter())
            .map(|note| format!("{file}: {note}"))
            .collect();
        if !self.unused.is_empty() {
            let names: Vec<String> = self.unused.iter().map(|name| format!("`{name}`")).collect();
            notes.push(format!("{file}: nothing uses {}", names.join(", ")));
        }
        if clock.start() < self.begin {
            notes.push(format!(
                "{file} begins at {} s; until then its first values are held",
                self.begin
            ));
        }
        // Tolerance for decimal times.
        if clock.stop() > self.end + 1e-9 * clock.step() {
            notes.push(format!(
                "{file} ends at {} s; from then on its last values are held",
                self.end
            ));
        }
        notes
    }
}
