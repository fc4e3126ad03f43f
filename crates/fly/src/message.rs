//! What page and server say to each other: text frames of the socket, each one JSON object.

use crate::hand::{Device, Input};
use crate::joystick::Reading;
use crate::task::Display;
use serde::{Deserialize, Serialize};

/// What the page says.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum FromPage {
    /// The hand, once per frame of the display.
    Input(Input),
    /// A state was drawn.
    Shown {
        /// Its simulation time \[s\].
        t: f64,
        /// Page time of the last input frame that it had seen \[ms\].
        seen: f64,
        /// When it was drawn, by the page's clock \[ms\].
        at: f64,
    },
    /// Who flies, with what; ends the welcome.
    Begin {
        /// A code, no name.
        subject: String,
        /// Whether the person agrees to be recorded.
        consent: bool,
        /// What the hand holds.
        device: Device,
        /// How the page reads it, for the record.
        #[serde(default)]
        calibration: serde_json::Value,
        /// On what the page is shown, for the record.
        #[serde(default)]
        about: About,
    },
    /// The next run.
    Go,
    /// End this run.
    Stop,
    /// This page takes the stick.
    Take,
    /// Work on what was recorded.
    Job {
        /// Which.
        kind: JobKind,
    },
}

/// On what a page is shown.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
pub struct About {
    /// The browser, as it calls itself.
    #[serde(default)]
    pub browser: String,
    /// The screen: its size, and device pixels of each CSS pixel.
    #[serde(default)]
    pub screen: String,
}

/// Work on what was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// Fit the pilot to the valid flights.
    Identify,
    /// Make FMUs of the pilot that was identified.
    Export,
    /// Fly with that pilot beside.
    Against,
    /// Fit each person, side by side.
    Compare,
}

/// What the server says.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ToPage {
    /// All that the page has to know once.
    Hello(Box<Hello>),
    /// Where the session is.
    Phase(Phase),
    /// Where the vehicle is.
    State(StateMessage),
    /// How a job goes.
    Job {
        /// Which.
        kind: JobKind,
        /// `running`, `done` or `failed`.
        state: JobState,
        /// How it goes, or what came out.
        words: String,
        /// What came out for people, in a sentence.
        #[serde(skip_serializing_if = "Option::is_none")]
        verdict: Option<String>,
        /// Where to look.
        #[serde(skip_serializing_if = "Option::is_none")]
        link: Option<String>,
    },
    /// What can be asked for now.
    Can {
        /// The jobs.
        can: Vec<JobKind>,
    },
    /// Something to read.
    Trouble {
        /// What.
        words: String,
    },
    /// The program ends.
    Over {
        /// What to do.
        words: String,
    },
    /// Another page has the stick.
    Taken {
        /// What to do.
        words: String,
    },
}

/// How far a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// It goes on.
    Running,
    /// It is done.
    Done,
    /// It came to nothing.
    Failed,
}

/// See [`ToPage::Hello`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hello {
    /// Of pilotage.
    pub version: String,
    /// What is flown.
    pub vehicle: VehicleMessage,
    /// What is to be done.
    pub protocol: ProtocolMessage,
    /// What there is already.
    pub recorded: Vec<Recorded>,
    /// Where the flights go.
    pub folder: String,
    /// What there is to know before the first run.
    pub notes: Vec<String>,
    /// What can be asked for now.
    pub can: Vec<JobKind>,
    /// The stick, where the server reads it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joystick: Option<JoystickMessage>,
}

/// A joystick that the server reads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JoystickMessage {
    /// Its name.
    pub name: String,
    /// How it is read, until the page says another way.
    pub reading: Reading,
}

/// The vehicle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleMessage {
    /// Its name.
    pub name: String,
    /// Its axes.
    pub axes: Vec<AxisMessage>,
    /// From where it is seen: `side` or `above`.
    pub view: &'static str,
    /// Whether states have tilts.
    pub tilts: bool,
    /// How large it is drawn, in the unit of its positions.
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
    /// What the person agrees to.
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
    /// How it is shown.
    pub display: Display,
    /// How long it takes \[s\].
    pub seconds: f64,
    /// The farthest place of its target, so that the picture's scale can be chosen before.
    pub reach: f64,
}

/// A flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recorded {
    /// Its file.
    pub file: String,
    /// Name of its task.
    pub task: String,
    /// Root mean square distance to the target.
    pub rms: f64,
    /// Whether it was for training.
    pub training: bool,
    /// Whether it counts.
    pub valid: bool,
    /// Why not.
    pub why: Option<String>,
}

/// See [`ToPage::Phase`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Which.
    pub phase: PhaseKind,
    /// Number of the task, from 0.
    pub task: usize,
    /// Number of the run, from 1: of the measured ones, or of the training of this task.
    pub run: usize,
    /// Of so many; none of training, which ends by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<usize>,
    /// Whether this is training.
    pub training: bool,
    /// Whether the person's model flies beside.
    pub against: bool,
    /// What to do, or what was.
    pub words: String,
    /// Of a countdown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Of a run that is over.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<ResultMessage>,
}

/// Where a session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseKind {
    /// Who flies is to be said.
    Welcome,
    /// A run waits for the person.
    Ready,
    /// It begins in a moment.
    Countdown,
    /// It goes on.
    Fly,
    /// It is over.
    After,
    /// All are.
    End,
}

/// What a run came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultMessage {
    /// Its file.
    pub file: String,
    /// Root mean square distance to the target.
    pub rms: f64,
    /// Its unit.
    pub unit: String,
    /// 100 where that is 0, 0 where it is what comes of letting go.
    pub score: u32,
    /// Whether it counts.
    pub valid: bool,
    /// Why not.
    pub why: Option<String>,
    /// The least distance of this task so far; none while no run counts.
    pub best: Option<f64>,
    /// Whether training is over.
    pub training_done: bool,
}

/// See [`ToPage::State`].
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct StateMessage {
    /// Simulation time \[s\].
    pub t: f64,
    /// Time left \[s\].
    pub left: f64,
    /// Positions.
    pub x: Vec<f64>,
    /// Angles \[rad\].
    pub tilt: Vec<f64>,
    /// Targets.
    pub target: Vec<f64>,
    /// The hand, -1 to 1.
    pub stick: Vec<f64>,
    /// Axes of the joystick that the server reads, while it is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw: Option<Vec<f64>>,
    /// Number of the last input frame that was seen.
    pub n: u64,
    /// Its page time \[ms\].
    pub at: f64,
    /// Positions of the model that flies beside.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<f64>,
}
