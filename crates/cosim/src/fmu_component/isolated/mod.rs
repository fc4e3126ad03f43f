//! An FMU in a separate process.
//!
//! Calls go through [memory](pilotage_process::channel) shared by both processes. A crash, `exit`, hang or excessive
//! memory use of the FMU ends only its process: the component fails with a message that names the call, the time and
//! the signal, and the calling process continues.
//!
//! ```no_run
//! use pilotage_cosim::{Isolated, Limits, Program};
//! use std::path::Path;
//!
//! // A program that does nothing but `pilotage_cosim::isolated::serve` with its last argument.
//! let program = Program { path: "serve".into(), arguments: Vec::new() };
//! let pilot = Isolated::open(&program, Limits::default(), Path::new("pilot.fmu"), "pilot", None)?;
//! # Ok::<(), pilotage_cosim::component::ComponentError>(())
//! ```

mod serve;
mod wire;

pub use serve::serve;

use crate::component::{
    Abilities, Component, ComponentError, Experiment, Linear, Progress, Suggested, Value,
    ValueKind, Variable,
};
use crate::fmu_component::Outline;
use pilotage_fmi::{ASKING, InterfaceType, call_name};
use pilotage_process::{Channel, Child, Place, Spoiled};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use thiserror::Error;
use wire::{Answer, Asked, Question, Set, Wanted};

/// Maximum time for the process to end after the FMU is freed.
const AFTERWARDS: Duration = Duration::from_secs(5);
/// Interval between memory checks while calls are short.
const BETWEEN: Duration = Duration::from_millis(10);

/// A command that runs [`serve`]; it receives the path of a channel as its last argument.
#[derive(Debug, Clone)]
pub struct Program {
    /// The program.
    pub path: PathBuf,
    /// Arguments before the channel.
    pub arguments: Vec<OsString>,
}

/// Resource limits of an isolated FMU; `None` means unlimited.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Maximum time of a call.
    pub time: Option<Duration>,
    /// Maximum memory of its process \[bytes\].
    pub memory: Option<u64>,
}

/// Why an isolated FMU no longer responds.
#[derive(Debug, Clone, Error)]
pub enum Gone {
    /// Its process has ended.
    #[error("{call} ended its process ({status})")]
    Ended {
        /// The active call and its time.
        call: String,
        /// Exit status.
        status: String,
    },
    /// A call took too long.
    #[error("{call} did not come back within {} s", .limit.as_secs_f64())]
    Late {
        /// As above.
        call: String,
        /// The limit.
        limit: Duration,
    },
    /// The process used too much memory.
    #[error("{call} took {} MB of memory, more than the limit of {} MB", .used / 1_000_000, .limit / 1_000_000)]
    Hungry {
        /// As above.
        call: String,
        /// Memory used \[bytes\].
        used: u64,
        /// The limit \[bytes\].
        limit: u64,
    },
    /// The FMU overwrote the shared memory.
    #[error("it has written over memory that is not its own")]
    Nonsense,
    /// The system does not report on the process.
    #[error("its process cannot be watched: {0}")]
    Unwatched(String),
}

impl From<Spoiled> for Gone {
    fn from(_: Spoiled) -> Self {
        Self::Nonsense
    }
}

/// An FMU in a separate process as a component.
#[derive(Debug)]
pub struct Isolated {
    outline: Outline,
    line: Line,
    /// Identifies the FMU to the supervisor of this process.
    place: Place,
    /// Serialized question and answer.
    bytes: Vec<u8>,
    /// Why it failed, if it did.
    gone: Option<Gone>,
    is_free: bool,
    next_jump: Option<f64>,
    /// Reals to be set with the next question.
    sets: Vec<Set>,
    /// Handles and values of reals received with the last answer.
    received: (Vec<u32>, Vec<f64>),
    /// Handles read first after the last step; they are read after the next step too.
    read: Vec<u32>,
    has_begun: bool,
    has_stepped: bool,
}

/// The other process and the connection to it.
#[derive(Debug)]
struct Line {
    channel: Channel,
    child: Child,
    limits: Limits,
    /// Time of the last memory check.
    looked: Instant,
    /// Whether the FMU is unpacked and loaded.
    is_open: bool,
}

impl Isolated {
    /// Starts a process and instantiates an FMU in it: with the wanted interface, if available, otherwise co-simulation
    /// before model exchange.
    ///
    /// # Foreign code
    /// The FMU's code runs in that process, but with the rights of this one.
    ///
    /// # Errors
    /// If the process does not start, or the FMU is invalid.
    pub fn open(
        program: &Program,
        limits: Limits,
        path: &Path,
        name: &str,
        wanted: Option<InterfaceType>,
    ) -> Result<Self, ComponentError> {
        let outline = Outline::read(path, wanted)?;
        let started = |error: std::io::Error| {
            let why = format!("cannot start a process for {}: {error}", path.display());
            ComponentError::from(why)
        };
        let (channel, its_name) = Channel::create().map_err(started)?;
        let mut command = Command::new(&program.path);
        command.args(&program.arguments).arg(its_name.path());
        let child = Child::start(command, true).map_err(started)?;
        let mut own = Self {
            outline,
            line: Line {
                channel,
                child,
                limits,
                looked: Instant::now(),
                is_open: false,
            },
            place: Place::new(&format!("`{name}`")),
            bytes: Vec::new(),
            gone: None,
            is_free: false,
            next_jump: None,
            sets: Vec::new(),
            received: (Vec::new(), Vec::new()),
            read: Vec::new(),
            has_begun: false,
            has_stepped: false,
        };
        own.ask(Question::Open {
            path: serve::bytes_of(path).into(),
            name: name.into(),
            wanted: wanted.map(|kind| match kind {
                InterfaceType::ModelExchange => Wanted::ModelExchange,
                _ => Wanted::CoSimulation,
            }),
        })?;
        // The other process has opened the channel.
        drop(its_name);
        own.line.is_open = true;
        Ok(own)
    }

    /// Sends a question and waits for the answer.
    fn ask(&mut self, question: Question<'_>) -> Result<Answer, ComponentError> {
        if let Some(gone) = &self.gone {
            return Err(gone.clone().into());
        }
        let mut bytes = std::mem::take(&mut self.bytes);
        let sets = self.sets.as_slice().into();
        wire::write(&Asked { sets, question }, &mut bytes)?;
        self.sets.clear();
        self.received.0.clear();
        // The FMU's process may end this one too: it may kill its parent.
        let (line, place) = (&mut self.line, &self.place);
        let heard = place.call(ASKING, || {
            let heard = line.exchange(place, &mut bytes);
            if heard.is_err() {
                // If this process is being terminated, it has ended its children, and no FMU is to blame.
                pilotage_process::leftovers::stay_if_ending();
            }
            heard
        });
        if let Err(gone) = heard {
            return Err(self.end(gone));
        }
        let answer = wire::read(&bytes);
        self.bytes = bytes;
        match answer {
            Ok(Answer::Failed(words)) => Err(wire::error(words)),
            Ok(answer) => Ok(answer),
            Err(_) => Err(self.nonsense()),
        }
    }

    /// Ends the process; no further questions are possible.
    fn end(&mut self, gone: Gone) -> ComponentError {
        self.line.child.kill();
        self.line.child.sweep();
        self.gone = Some(gone.clone());
        gone.into()
    }

    /// The answer does not match the question.
    fn nonsense(&mut self) -> ComponentError {
        self.end(Spoiled.into())
    }

    fn done(&mut self, question: Question<'_>) -> Result<(), ComponentError> {
        match self.ask(question)? {
            Answer::Done => Ok(()),
            _ => Err(self.nonsense()),
        }
    }

    fn moved(&mut self, question: Question<'_>) -> Result<Progress, ComponentError> {
        match self.ask(question)? {
            Answer::Moved(progress, next_jump, _) => {
                self.next_jump = next_jump;
                Ok(progress)
            }
            _ => Err(self.nonsense()),
        }
    }

    fn stepped(&mut self, t: f64, h: f64, is_revocable: bool) -> Result<Progress, ComponentError> {
        self.place.at(t);
        let outputs = std::mem::take(&mut self.read);
        let question = Question::Step {
            t,
            h,
            is_revocable,
            outputs: outputs.as_slice().into(),
        };
        let answer = self.ask(question)?;
        self.has_stepped = true;
        let Answer::Moved(progress, next_jump, reals) = answer else {
            return Err(self.nonsense());
        };
        self.next_jump = next_jump;
        if progress == Progress::Done {
            self.place.at(t + h);
        }
        if let Some(reals) = reals.filter(|reals| reals.len() == outputs.len()) {
            self.received = (outputs, reals);
        }
        Ok(progress)
    }

    fn reals(&mut self, question: Question<'_>, values: &mut [f64]) -> Result<(), ComponentError> {
        match self.ask(question)? {
            Answer::Reals(reals) if reals.len() == values.len() => {
                values.copy_from_slice(&reals);
                Ok(())
            }
            _ => Err(self.nonsense()),
        }
    }

    /// Frees the FMU and waits until its process has ended.
    fn free(&mut self) -> Result<(), ComponentError> {
        self.is_free = true;
        let limits = &mut self.line.limits;
        let limit = limits.time.map_or(AFTERWARDS, |own| own.min(AFTERWARDS));
        limits.time = Some(limit);
        self.done(Question::Free)?;
        let begun = Instant::now();
        while self.line.child.try_end()?.is_none() && begun.elapsed() < limit {
            std::thread::sleep(Duration::from_millis(1));
        }
        // The FMU may have kept its process from removing its own files.
        self.line.child.sweep();
        Ok(())
    }
}

impl Line {
    /// Sends a question and receives the answer into `bytes`.
    fn exchange(&mut self, place: &Place, bytes: &mut Vec<u8>) -> Result<(), Gone> {
        let mut begun = Instant::now();
        let Self {
            channel,
            child,
            limits,
            ..
        } = self;
        channel.send(bytes, || look(child, begun, *limits))?;
        channel.receive(bytes, || {
            match child.page().going().first() {
                // The supervisor of this process is informed which call takes so long.
                Some(going) => place.doing(going.call),
                // Unpacking does not count as time of a call.
                None if !self.is_open => begun = Instant::now(),
                None => {}
            }
            look(child, begun, *limits)
        })?;
        match self.looked.elapsed() > BETWEEN {
            true => {
                self.looked = Instant::now();
                check_memory(&self.child, self.limits)
            }
            false => Ok(()),
        }
    }
}

/// Checks that an answer can still be expected.
fn look(child: &mut Child, begun: Instant, limits: Limits) -> Result<(), Gone> {
    let ended = child.try_end();
    let gone = match ended {
        Ok(Some(status)) => Gone::Ended {
            call: call(child),
            status: status.to_string(),
        },
        Err(error) => Gone::Unwatched(error.to_string()),
        Ok(None) => {
            if let Some(limit) = limits.time.filter(|limit| begun.elapsed() > *limit) {
                let call = call(child);
                return Err(Gone::Late { call, limit });
            }
            return check_memory(child, limits);
        }
    };
    Err(gone)
}

fn check_memory(child: &Child, limits: Limits) -> Result<(), Gone> {
    let over = |limit: &u64| child.memory().filter(|used| used > limit);
    match limits.memory.and_then(|limit| Some((over(&limit)?, limit))) {
        Some((used, limit)) => Err(Gone::Hungry {
            call: call(child),
            used,
            limit,
        }),
        None => Ok(()),
    }
}

/// Description of the current or last call.
fn call(child: &Child) -> String {
    let going = child.page().going();
    let Some(going) = going.first() else {
        return "the FMU, between two calls,".to_owned();
    };
    let time = going.time.map(|time| format!(" at {time} s"));
    format!("{}{}", call_name(going.call), time.unwrap_or_default())
}

impl Drop for Isolated {
    fn drop(&mut self) {
        if self.gone.is_none() && !self.is_free {
            // Errors no longer matter here.
            let _ = self.free();
        }
    }
}

impl Component for Isolated {
    fn variables(&self) -> &[Variable] {
        &self.outline.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        self.done(Question::Setup(*experiment))
    }

    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        self.done(Question::EnterInitialization)
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.moved(Question::ExitInitialization)?;
        self.has_begun = true;
        Ok(())
    }

    fn words_of_discard(&mut self) -> Option<String> {
        match self.ask(Question::WordsOfDiscard) {
            Ok(Answer::Words(words)) => words,
            _ => None,
        }
    }

    /// After initialization, the values are sent with the next question.
    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.sets.push((handles.into(), values.into()));
        match self.has_begun {
            true => Ok(()),
            false => self.done(Question::Nothing),
        }
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        if std::mem::take(&mut self.has_stepped) {
            self.read = handles.into();
        }
        let (received, reals) = &self.received;
        if self.sets.is_empty() && received == handles && !handles.is_empty() {
            values.copy_from_slice(reals);
            return Ok(());
        }
        self.reals(Question::GetReals(handles.into()), values)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        let value = std::borrow::Cow::Borrowed(value);
        self.done(Question::Set(handle, value))
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        match self.ask(Question::Get(handle, kind))? {
            Answer::Value(value) => Ok(value),
            _ => Err(self.nonsense()),
        }
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.stepped(t, h, false)
    }

    fn suggested(&self) -> Suggested {
        self.outline.suggested
    }

    fn limitation(&self) -> Option<String> {
        self.outline.limitation.clone()
    }

    /// Also frees the FMU, so that errors there are reported too.
    fn terminate(&mut self) -> Result<(), ComponentError> {
        if self.gone.is_some() {
            // Already reported.
            return Ok(());
        }
        self.done(Question::Terminate)?;
        self.free()
    }

    /// The process stays.
    fn renew(&mut self) -> Result<bool, ComponentError> {
        let is_new = match self.ask(Question::Renew)? {
            Answer::Renewed(is_new) => is_new,
            _ => return Err(self.nonsense()),
        };
        if !is_new {
            self.free()?;
        }
        self.next_jump = None;
        self.received = (Vec::new(), Vec::new());
        self.read.clear();
        (self.has_begun, self.has_stepped) = (false, false);
        Ok(is_new)
    }

    fn linearize(&mut self, step: f64) -> Result<Linear, ComponentError> {
        match self.ask(Question::Linearize(step))? {
            Answer::Linear(system) => system.read().ok_or_else(|| self.nonsense()),
            _ => Err(self.nonsense()),
        }
    }

    fn abilities(&self) -> Abilities {
        self.outline.abilities
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        self.done(Question::Save(place))
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        self.moved(Question::Restore(place)).map(drop)
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        match self.ask(Question::Serialize)? {
            Answer::Bytes(bytes) => Ok(bytes),
            _ => Err(self.nonsense()),
        }
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        self.moved(Question::Deserialize(bytes.into())).map(drop)
    }

    fn step_revocably(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.stepped(t, h, true)
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        self.done(Question::SetInputDerivatives(handles.into(), slopes.into()))
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        self.reals(Question::GetOutputDerivatives(handles.into()), slopes)
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        self.next_jump.filter(|&next| next > t)
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        let question = Question::DirectionalDerivative {
            outputs: outputs.into(),
            inputs: inputs.into(),
            seed: seed.into(),
        };
        self.reals(question, result)
    }
}
