//! Files with the state of a run: `--save-state` and `--from-state`.

use super::Args;
use crate::atomic_file;
use crate::cli::number::number;
use crate::cli::system::Built;
use crate::cli::system::sum::sum;
use crate::cli::{Failure, overwrite};
use crate::cosim::{Clock, Coupling, Scenario, State};
use crate::file;
use pilotage_text::number::rounded;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io;
use std::path::{Path, PathBuf};

/// First line of these files.
pub const HEADER: &str = "pilotage state 1\n";
/// Length of the sum of all that follows it \[bytes\].
const SUM: usize = 32;

/// When a state is written, or at the end, and its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Save {
    time: Option<f64>,
    pub file: PathBuf,
}

/// Parses `TIME=FILE` or `FILE`.
pub fn save(text: &str) -> Result<Save, String> {
    let (time, file) = match text.split_once('=') {
        Some((time, file)) if !file.is_empty() => (Some(number(time)?), file),
        Some(_) => return Err("expected TIME=FILE, such as 10=run.state".to_owned()),
        None => (None, text),
    };
    let file = file.into();
    Ok(Save { time, file })
}

/// What a file says beside the state: that it is of the same run.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Of {
    version: String,
    /// Of the files, wires and values of the system.
    system: String,
    /// Algorithm and tolerances, and the scenario.
    coupling: String,
    /// Start, stop and step \[s\].
    times: [f64; 3],
}

impl Of {
    /// That of a run.
    pub fn run(
        args: &Args,
        built: &Built,
        clock: &Clock,
        coupling: Coupling,
        scenario: &Scenario,
    ) -> Result<Self, Failure> {
        // Neither changes a result.
        let coupling = Coupling {
            measure: false,
            parallel: false,
            ..coupling
        };
        let (tolerance, parts) = (args.coupling.component_tolerance(), args.coupling.parts());
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            system: sum(&built.description)?,
            coupling: format!("{coupling:?} {tolerance:?} {parts:?} {scenario:?}"),
            times: [clock.start(), clock.stop(), clock.step()],
        })
    }
}

/// A state that was read.
pub struct Read {
    of: Of,
    pub state: State,
    file: PathBuf,
}

impl Read {
    /// Reads a file that `--save-state` wrote.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        let bytes = file::bytes(path)
            .map_err(|error| Failure::new(format!("cannot read {shown}: {error}")))?;
        let Some(rest) = bytes.strip_prefix(HEADER.as_bytes()) else {
            return Err(Failure::new(format!("{shown} is no state of a run"))
                .hint("`pilotage cosim ... --save-state FILE` writes one"));
        };
        let damaged = || Failure::new(format!("{shown} is damaged, or of another version"));
        let (own, rest) = rest.split_at_checked(SUM).ok_or_else(damaged)?;
        if own != &Sha256::digest(rest)[..] {
            return Err(damaged());
        }
        let (of, state) = postcard::from_bytes(rest).map_err(|_| damaged())?;
        let file = path.to_owned();
        Ok(Self { of, state, file })
    }

    /// The clock of the run, which may end elsewhere.
    pub fn clock(&self, stop: Option<f64>) -> Result<Clock, Failure> {
        let [start, before, step] = self.of.times;
        let clock = Clock::new(start, stop.unwrap_or(before), step)?;
        let time = clock.time(self.state.step());
        if self.state.step() >= clock.steps() {
            let message = format!(
                "{} is at {time} s, and the run ends at {} s",
                self.file.display(),
                clock.stop()
            );
            return Err(Failure::new(message).hint("say a later end: --stop-time"));
        }
        Ok(clock)
    }

    /// Refuses a run that is not the one whose state it is.
    pub fn check(&self, own: &Of) -> Result<(), Failure> {
        let shown = self.file.display();
        let (what, hint) = if own.version != self.of.version {
            (
                format!("of version {}", self.of.version),
                "begin anew with this version",
            )
        } else if own.system != self.of.system {
            (
                "of another system: files, wires or values are not the same".to_owned(),
                "give those with which it was written",
            )
        } else if own.coupling != self.of.coupling {
            (
                "of a run with another coupling or scenario".to_owned(),
                "give --algorithm, --extrapolation, --tolerance, --scenario and the like as they were",
            )
        } else {
            return Ok(());
        };
        Err(Failure::new(format!("{shown} is {what}")).hint(hint))
    }
}

/// States to be written.
pub struct Saves {
    of: Of,
    /// Files with the numbers of completed steps, and those at the end.
    pub at: Vec<u64>,
    files: Vec<PathBuf>,
    at_end: Vec<PathBuf>,
}

impl Saves {
    /// Those of the arguments.
    pub fn new(args: &Args, of: Of, clock: &Clock, first: u64) -> Result<Self, Failure> {
        let (mut at, mut files, mut at_end) = (Vec::new(), Vec::new(), Vec::new());
        for Save { time, file } in &args.save_state {
            match time {
                Some(time) => {
                    at.push(step_at(*time, clock, first)?);
                    files.push(file.clone());
                }
                None => at_end.push(file.clone()),
            }
        }
        Ok(Self {
            of,
            at,
            files,
            at_end,
        })
    }

    /// Whether one is written at the end.
    pub fn has_end(&self) -> bool {
        !self.at_end.is_empty()
    }

    /// Writes the state with that index, or that at the end.
    pub fn keep(&self, which: Option<usize>, state: &State) -> io::Result<()> {
        let rest = postcard::to_stdvec(&(&self.of, state)).map_err(io::Error::other)?;
        let bytes = [HEADER.as_bytes(), &Sha256::digest(&rest)[..], &rest].concat();
        // An FMU may have changed the working folder.
        atomic_file::go_back();
        let files = match which {
            Some(k) => std::slice::from_ref(&self.files[k]),
            None => &self.at_end,
        };
        for file in files {
            overwrite::save(file, &bytes)
                .map_err(|failure| io::Error::other(failure.message().to_owned()))?;
        }
        Ok(())
    }
}

/// The number of steps of the clock to a time.
fn step_at(time: f64, clock: &Clock, first: u64) -> Result<u64, Failure> {
    let ratio = (time - clock.start()) / clock.step();
    let whole = ratio.round();
    let refused = |why: String| {
        Failure::new(format!("--save-state {time}=...: {why}"))
            .hint("states are written at communication points of the run")
    };
    if (ratio - whole).abs() > 1e-9 * ratio.abs().max(1.0) {
        let (below, above) = (ratio.floor().max(0.0) as u64, ratio.ceil().max(0.0) as u64);
        let [below, above] = [below, above].map(|step| rounded(clock.time(step), 9));
        let step = clock.step();
        return Err(refused(format!(
            "no step of {step} s ends there, but at {below} s and {above} s"
        )));
    }
    if !(first as f64..=clock.steps() as f64).contains(&whole) {
        let (begin, stop) = (clock.time(first), clock.stop());
        return Err(refused(format!("the run is from {begin} s to {stop} s")));
    }
    Ok(whole as u64)
}
