//! A system that another program opens once and simulates any number of times.

use super::{Args, simulated};
use crate::cli::call::{self, Done, Stop};
use crate::cli::system::opened::Opened;
use crate::cli::{Failure, terminal};
use crate::cosim::Ending;
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
            None => Opened::new(&self.args.wiring)?,
        };
        opened.wire(settings)?;
        let (done, built) = simulated(&self.args, opened.take())?;
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
        self.opened = match is_over {
            true => opened.renewed(built, done.run.components)?,
            false => None,
        };
        Ok(code)
    }
}

/// Says a failure, and returns its exit code.
fn said(failure: &Failure) -> u8 {
    terminal::eprint(&format!("{failure}\n"));
    failure.code()
}
