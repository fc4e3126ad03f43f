//! A system that another program opens once and simulates any number of times.

use super::{Args, simulated};
use crate::cli::call::{self, Done, Stop};
use crate::cli::overwrite::Overwrite;
use crate::cli::system::{self, Built};
use crate::cli::{Failure, terminal};
use crate::cosim::description::Setting;
use crate::cosim::{Component, Ending, System, SystemDescription};
use serde_json::json;
use std::ffi::OsString;

/// The words of `pilotage cosim`, and what they name, opened.
pub struct Prepared {
    words: Vec<OsString>,
    args: Args,
    opened: Option<Opened>,
}

impl Prepared {
    /// Reads the words of `pilotage cosim` without its name, and opens what they name at the first run.
    ///
    /// # Errors
    /// The words of the command on what is wrong.
    pub fn new(words: Vec<OsString>) -> Result<Self, Done> {
        let mut args = None;
        let words: Vec<OsString> = std::iter::once("pilotage cosim".into())
            .chain(words)
            .collect();
        let done = call::within(words.clone(), &Stop::default(), |words| {
            match Args::of(words) {
                Ok(read) => {
                    args = Some(read);
                    0
                }
                Err(failure) => said(&failure),
            }
        });
        match args {
            Some(args) => Ok(Self {
                words,
                args,
                opened: None,
            }),
            None => Err(done),
        }
    }

    /// Simulates with other values of some parameters or inputs: names and values. The table `result` has the rows;
    /// stdout has a JSON object with `status`, `message`, `time` and `notes`.
    pub fn run(&mut self, settings: &[(String, String)], stop: &Stop) -> Done {
        call::within(self.words.clone(), stop, |_| {
            self.simulate(settings)
                .unwrap_or_else(|failure| said(&failure))
        })
    }

    fn simulate(&mut self, settings: &[(String, String)]) -> Result<u8, Failure> {
        let mut opened = match self.opened.take() {
            Some(opened) => opened,
            None => Opened::new(&self.args)?,
        };
        opened.wire(settings)?;
        let Opened { built, description } = opened;
        let (done, mut built) = simulated(&self.args, built)?;
        let mut notes = done.notes.clone();
        notes.extend(done.not_finite.words());
        let summary = json!({
            "status": done.ending.status,
            "message": done.ending.message,
            "time": done.run.time,
            "notes": notes,
        });
        terminal::print(&summary.to_string())?;
        let code = done.outcome(&self.args).code();
        let is_over = matches!(done.run.ending, Ending::Completed);
        let renewed = is_over.then(|| done.run.components.renewed()).flatten();
        if let Some(components) = renewed {
            built.system = joined(components)?;
            self.opened = Some(Opened { built, description });
        }
        Ok(code)
    }
}

/// Opened components, and the system that the words describe.
struct Opened {
    built: Built,
    description: SystemDescription,
}

impl Opened {
    fn new(args: &Args) -> Result<Self, Failure> {
        let mut built = args.wiring.build(&Overwrite::default(), &[])?;
        // That was a check of the wires; values may still be replaced.
        built.system = joined(built.system.components())?;
        let description = built.description.clone();
        Ok(Self { built, description })
    }

    /// Wires the components and sets the values of the description, but for those that are replaced.
    fn wire(&mut self, settings: &[(String, String)]) -> Result<(), Failure> {
        let system = &mut self.built.system;
        let setting = |(name, value): &(String, String)| Setting {
            name: system::full_name(system, name, system::only(system)).into(),
            value: value.clone(),
        };
        let settings = settings.iter().map(setting).collect();
        self.built.description = self.description.clone();
        self.built.description.override_wiring(Vec::new(), settings);
        for (from, to) in self.built.tables.iter().flat_map(|table| &table.wires) {
            system.connect(from, to)?;
        }
        Ok(self.built.description.wire(system)?)
    }
}

/// Says a failure, and returns its exit code.
fn said(failure: &Failure) -> u8 {
    terminal::eprint(&format!("{failure}\n"));
    failure.code()
}

/// A system of these components, not yet wired.
fn joined(components: Vec<(String, Box<dyn Component>)>) -> Result<System, Failure> {
    let mut system = System::new();
    for (name, component) in components {
        system.add(name, component)?;
    }
    Ok(system)
}
