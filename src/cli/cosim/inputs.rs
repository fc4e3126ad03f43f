//! Tables that feed inputs.

use super::super::Failure;
use super::wiring::instance;
use crate::cosim::{Clock, Kind, Role, Source, System, SystemError, Variable};
use crate::series::Series;
use std::path::PathBuf;

/// A table that has been added to the system.
pub struct Table {
    /// Its name as an instance.
    pub name: String,
    file: PathBuf,
    unused: Vec<String>,
    begin: f64,
    end: f64,
}

/// Adds a table as an instance and wires its columns that are named like inputs.
pub fn add(
    system: &mut System,
    argument: &str,
    connections: &[(String, String)],
) -> Result<Table, Failure> {
    let (name, file) = instance(argument);
    let series = Series::read_with_jumps(&file)?;
    let at = |error: &dyn std::error::Error| Failure::new(format!("{}: {error}", file.display()));
    let mut source = Source::new(&series).map_err(|error| at(&error))?;
    let (mut named, mut unused) = (Vec::new(), Vec::new());
    for (position, column) in series.columns.iter().enumerate() {
        let own = own_input(system, &column.name)
            .map_err(|error| at(&error).hint("rename the column, or leave it out"))?;
        let port = format!("{name}.{}", column.name);
        let wired = connections.iter().find(|(from, _)| *from == port);
        let held = match (own, wired) {
            (Some(held), _) => {
                named.push((port, column.name.clone()));
                held
            }
            (None, Some((_, to))) => held(system.find(to)?),
            (None, None) => {
                unused.push(column.name.clone());
                None
            }
        };
        if let Some(kind) = held {
            (source.hold_as(position, kind)).map_err(|error| at(&error))?;
        }
    }
    if unused.len() == series.columns.len() {
        let message = format!("{}: no column is named like an input", file.display());
        return Err(Failure::new(message).hint(format!(
            "name a column `INSTANCE.INPUT`, or wire one with --connect {name}.COLUMN=INSTANCE.INPUT"
        )));
    }
    let ends = (series.time.first(), series.time.last());
    system.add(&name, Box::new(source))?;
    for (port, input) in &named {
        system.connect(port, input)?;
    }
    Ok(Table {
        name,
        file,
        unused,
        begin: ends.0.copied().unwrap_or(0.0),
        end: ends.1.copied().unwrap_or(0.0),
    })
}

/// The type of a variable between whose samples values are held and not interpolated.
fn held(variable: &Variable) -> Option<Kind> {
    variable.is_discrete.then_some(variable.kind)
}

/// How the input that a column is named after takes its values, if it is named after one. Columns that are
/// named after nothing, or after an output (the results of another run), are none of our business; those of
/// an instance that has no such variable are probably a mistake.
fn own_input(system: &System, column: &str) -> Result<Option<Option<Kind>>, SystemError> {
    match system.find(column) {
        Ok(variable) => Ok((variable.role == Role::Input).then(|| held(variable))),
        Err(error @ SystemError::UnknownVariable { .. }) => Err(error),
        Err(_) => Ok(None),
    }
}

impl Table {
    /// What the user may not have meant.
    pub fn notes(&self, clock: &Clock) -> Vec<String> {
        let file = self.file.display();
        let mut notes = Vec::new();
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
        // As exact as decimal times are.
        if clock.stop() > self.end + 1e-9 * clock.step() {
            notes.push(format!(
                "{file} ends at {} s; from then on its last values are held",
                self.end
            ));
        }
        notes
    }
}
