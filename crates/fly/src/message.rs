//! Messages between page and server: text frames of the socket, each one JSON object.

use crate::hand::{Device, Input};
use crate::joystick::Reading;
use crate::task::Display;
use serde::{Deserialize, Serialize};

/// A message from the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum FromPage {
    /// The hand's input, once per frame of the display.
    Input(Input),
    /// A state was drawn.
    Shown {
        /// Its simulation time \[s\].
        t: f64,
        /// Page time of the last input frame included in it \[ms\].
        seen: f64,
        /// Time of the drawing by the page's clock \[ms\].
        at: f64,
    },
    /// Subject, consent and device; ends the welcome phase.
    Begin {
        /// An anonymous code.
        subject: String,
        /// Whether the person consents to the recording.
        consent: bool,
        /// The device.
        device: Device,
        /// The page's calibration of the device, for the record.
        #[serde(default)]
        calibration: serde_json::Value,
        /// Browser and screen, for the record.
        #[serde(default)]
        about: About,
    },
    /// Start the next run.
    Go,
    /// Stop the current run.
    Stop,
    /// This page takes control of the stick.
    Take,
    /// Start a job on the recorded flights.
    Job {
        /// Kind of the job.
        kind: JobKind,
    },
}

/// Browser and screen of a page.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
pub struct About {
    /// The browser's user agent.
    #[serde(default)]
    pub browser: String,
    /// Size of the screen, and device pixels per CSS pixel.
    #[serde(default)]
    pub screen: String,
}

/// A job on the recorded flights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// Fit the pilot to the valid flights.
    Identify,
    /// Export the identified pilot as FMUs.
    Export,
    /// Fly together with the identified pilot.
    Against,
    /// Fit and compare all subjects.
    Compare,
}

/// A message from the server.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ToPage {
    /// Static data, sent once.
    Hello(Box<Hello>),
    /// Phase of the session.
    Phase(Phase),
    /// State of the vehicle.
    State(StateMessage),
    /// Progress of a job.
    Job {
        /// Kind of the job.
        kind: JobKind,
        /// `running`, `done` or `failed`.
        state: JobState,
        /// Progress or result.
        words: String,
        /// Summary of the result in one sentence.
        #[serde(skip_serializing_if = "Option::is_none")]
        verdict: Option<String>,
        /// Link to the result.
        #[serde(skip_serializing_if = "Option::is_none")]
        link: Option<String>,
    },
    /// Available jobs.
    Can {
        /// The jobs.
        can: Vec<JobKind>,
    },
    /// A problem to be shown.
    Trouble {
        /// Its description.
        words: String,
    },
    /// The program ends.
    Over {
        /// Instructions.
        words: String,
    },
    /// Another page controls the stick.
    Taken {
        /// Instructions.
        words: String,
    },
}

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// In progress.
    Running,
    /// Completed.
    Done,
    /// Failed.
    Failed,
}

/// See [`ToPage::Hello`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hello {
    /// Version of pilotage.
    pub version: String,
    /// The flown vehicle.
    pub vehicle: VehicleMessage,
    /// The protocol.
    pub protocol: ProtocolMessage,
    /// Flights recorded so far.
    pub recorded: Vec<Recorded>,
    /// Folder of the flights.
    pub folder: String,
    /// Notes to read before the first run.
    pub notes: Vec<String>,
    /// Available jobs.
    pub can: Vec<JobKind>,
    /// The joystick, if the server reads one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joystick: Option<JoystickMessage>,
}

/// A joystick read by the server.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JoystickMessage {
    /// Its name.
    pub name: String,
    /// Its calibration, until the page sends another.
    pub reading: Reading,
}

/// The vehicle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleMessage {
    /// Its name.
    pub name: String,
    /// Its axes.
    pub axes: Vec<AxisMessage>,
    /// View: `side` or `above`.
    pub view: &'static str,
    /// Whether states include tilts.
    pub tilts: bool,
    /// Drawn size, in the unit of its positions.
    pub size: f64,
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisMessage {
    /// Name of the position.
    pub position: String,
    /// Its unit.
    pub unit: String,
    /// Name of the input.
    pub stick: String,
}

/// The protocol.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProtocolMessage {
    /// Its title.
    pub title: String,
    /// Its tasks.
    pub tasks: Vec<TaskMessage>,
    /// Declaration of consent.
    pub consent: String,
}

/// A task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TaskMessage {
    /// Its name.
    pub name: String,
    /// Its title.
    pub title: String,
    /// `step` or `sines`.
    pub kind: &'static str,
    /// How it is displayed.
    pub display: Display,
    /// Duration \[s\].
    pub seconds: f64,
    /// Largest distance of its target, from which the page chooses the scale.
    pub reach: f64,
}

/// A recorded flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recorded {
    /// Its file.
    pub file: String,
    /// Name of its task.
    pub task: String,
    /// Root mean square distance to the target.
    pub rms: f64,
    /// Whether it was a training run.
    pub training: bool,
    /// Whether it is valid.
    pub valid: bool,
    /// The reason if it is not valid.
    pub why: Option<String>,
}

/// See [`ToPage::Phase`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Kind of phase.
    pub phase: PhaseKind,
    /// Number of the task, from 0.
    pub task: usize,
    /// Number of the run, from 1, among the measured runs or this task's training runs.
    pub run: usize,
    /// Total number of runs; `None` in training, whose length is not fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<usize>,
    /// Whether this is training.
    pub training: bool,
    /// Whether the identified pilot flies too.
    pub against: bool,
    /// Instructions or result.
    pub words: String,
    /// Remaining time of a countdown \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Result of a completed run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<ResultMessage>,
}

/// Kind of phase of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseKind {
    /// Waiting for the subject's data.
    Welcome,
    /// Waiting for the person to start the run.
    Ready,
    /// Countdown.
    Countdown,
    /// The run is in progress.
    Fly,
    /// The run is over.
    After,
    /// All runs are over.
    End,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultMessage {
    /// Its file.
    pub file: String,
    /// Root mean square distance to the target.
    pub rms: f64,
    /// Its unit.
    pub unit: String,
    /// Score: 100 for an rms of 0, 0 for the rms with the stick released.
    pub score: u32,
    /// Whether it is valid.
    pub valid: bool,
    /// The reason if it is not valid.
    pub why: Option<String>,
    /// Smallest rms of this task so far; `None` without a valid run.
    pub best: Option<f64>,
    /// Whether training is complete.
    pub training_done: bool,
}

/// See [`ToPage::State`].
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct StateMessage {
    /// Simulation time \[s\].
    pub t: f64,
    /// Remaining time \[s\].
    pub left: f64,
    /// Positions.
    pub x: Vec<f64>,
    /// Angles \[rad\].
    pub tilt: Vec<f64>,
    /// Targets.
    pub target: Vec<f64>,
    /// The hand, -1 to 1.
    pub stick: Vec<f64>,
    /// Raw axes of the joystick read by the server, while it is connected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw: Option<Vec<f64>>,
    /// Number of the last input frame included.
    pub n: u64,
    /// Its page time \[ms\].
    pub at: f64,
    /// Positions of the vehicle flown by the identified pilot.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<f64>,
}
