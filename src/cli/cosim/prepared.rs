//! A system that another program opens once and simulates any number of times.

use super::{Args, simulated};
use crate::cli::call::{self, Done, Stop};
use crate::cli::system::opened::{Opened, Renewal, checked, same_bits};
use crate::cli::{Failure, terminal};
use crate::cosim::Ending;
use serde_json::json;
use std::ffi::OsString;

/// The words of `pilotage cosim`, and what they name, opened.
pub struct Prepared {
    words: Vec<OsString>,
    args: Args,
    opened: Option<Opened>,
    /// What components give that are made new, once that is known.
    renewal: Option<Renewal>,
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
                renewal: None,
            }),
            None => Err(done),
        }
    }

    /// Simulates with other values of some parameters or inputs: names and values. The table `result` has the rows;
    /// stdout has a JSON object with `status`, `message`, `time` and `notes`.
    ///
    /// What was opened for a run is made new for the next one (`fmi2Reset`, `fmi3Reset`). The first time it is opened again, too,
    /// for the same run: if the numbers are not the same bits, this FMU forgets to reset something, and all runs open it.
    pub fn run(&mut self, settings: &[(String, String)], stop: &Stop) -> Done {
        let is_used = |_: &Opened| matches!(self.renewal, None | Some(Renewal::Works));
        let mut place = self.opened.take().filter(is_used);
        let run = |place: &mut _| {
            call::within(self.words.clone(), stop, |_| {
                let code = simulate(&self.args, place, settings);
                code.unwrap_or_else(|failure| said(&failure))
            })
        };
        let done = match place.is_some() && self.renewal.is_none() {
            false => run(&mut place),
            true => {
                let mut first = None;
                let once = |place: &mut _| match first.take().filter(|_| stop.is_asked()) {
                    Some(stopped) => stopped,
                    None => first.insert(run(place)).clone(),
                };
                let (mut done, renewal) = checked(&mut place, once, is_same);
                if done.code == 0 && !stop.is_asked() {
                    self.renewal = Some(renewal);
                    let doubt = renewal.doubt(&self.args.wiring);
                    done.stderr
                        .extend(doubt.map(|words| format!("warning: {words}\n")));
                }
                done
            }
        };
        self.opened = place;
        done
    }
}

fn is_same(a: &Done, b: &Done) -> bool {
    let tables = [a, b].map(|own| own.tables.iter().map(|(_, table)| table));
    let [first, second] = tables;
    (a.code, &a.stdout) == (b.code, &b.stdout) && same_bits(first, second)
}

fn simulate(
    args: &Args,
    place: &mut Option<Opened>,
    settings: &[(String, String)],
) -> Result<u8, Failure> {
    let mut opened = match place.take() {
        Some(opened) => opened,
        None => Opened::new(&args.wiring)?,
    };
    opened.wire(settings)?;
    let (done, built) = simulated(args, opened.take())?;
    let mut notes = done.notes.clone();
    notes.extend(done.not_finite.words());
    let summary = json!({
        "status": done.ending.status,
        "message": done.ending.message,
        "time": done.run.time,
        "notes": notes,
    });
    terminal::print(&summary.to_string())?;
    let code = done.outcome(args).code();
    let is_over = matches!(done.run.ending, Ending::Completed);
    *place = match is_over {
        true => opened.renewed(built, done.run.components)?,
        false => None,
    };
    Ok(code)
}

/// Says a failure, and returns its exit code.
fn said(failure: &Failure) -> u8 {
    terminal::eprint(&format!("{failure}\n"));
    failure.code()
}
