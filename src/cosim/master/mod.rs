//! Initialization and the stepping loop.

mod exchange;
mod initialize;

use self::exchange::Exchange;
use self::initialize::initialize;
use super::algorithms::{Algorithm, gauss_seidel_order};
use super::clock::Clock;
use super::recorder::{Recorder, Signal};
use super::slave::{Experiment, Slave, SlaveError};
use super::system::System;
use std::io;
use thiserror::Error;

/// Why a run could not begin or be recorded. What happens to a slave on the way is an [`Ending`].
#[derive(Debug, Error)]
pub enum MasterError {
    /// A slave failed before the first step.
    #[error("`{instance}` failed to {stage}")]
    Initialization {
        /// Name of the slave.
        instance: String,
        /// What it was asked to do.
        stage: Stage,
        /// Its own words.
        source: SlaveError,
    },
    /// An algebraic loop between the slaves has no solution that repeated substitution finds.
    #[error("the initial values of {} depend on each other and do not settle in {sweeps} sweeps", names.join(", "))]
    AlgebraicLoop {
        /// The outputs in the loop.
        names: Vec<String>,
        /// How often values were passed around.
        sweeps: usize,
    },
    /// A row could not be written.
    #[error("cannot write the result at {time} s")]
    Record {
        /// Time of the row [s].
        time: f64,
        /// Why.
        source: io::Error,
    },
}

/// What a slave was doing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Taking start and stop time.
    Setup,
    /// Taking a start value.
    Set(String),
    /// Entering initialization.
    EnterInitialization,
    /// Passing a value to another slave.
    Propagate(String),
    /// Leaving initialization.
    ExitInitialization,
    /// Taking its inputs.
    SetInputs,
    /// Stepping.
    Step,
    /// Giving its outputs.
    GetOutputs,
    /// Telling how it depends on its states and inputs.
    Linearize,
    /// Ending.
    Terminate,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Setup => f.write_str("set up the experiment"),
            Self::Set(name) => write!(f, "take the value of `{name}`"),
            Self::EnterInitialization => f.write_str("enter initialization"),
            Self::Propagate(name) => write!(f, "pass on `{name}` during initialization"),
            Self::ExitInitialization => f.write_str("leave initialization"),
            Self::SetInputs => f.write_str("take its inputs"),
            Self::Step => f.write_str("step"),
            Self::GetOutputs => f.write_str("give its outputs"),
            Self::Linearize => f.write_str("be linearised"),
            Self::Terminate => f.write_str("terminate"),
        }
    }
}

/// How a run ended. All rows up to then are recorded.
#[derive(Debug)]
pub enum Ending {
    /// At the stop time.
    Completed,
    /// The recorder asked for the end ([`Recorder::is_stop_asked`]), for the user.
    Stopped {
        /// Where the slaves stand [s].
        time: f64,
    },
    /// A slave asked for the end.
    EndRequested {
        /// Name of the slave.
        instance: String,
        /// Where it stands [s].
        time: f64,
    },
    /// A slave could not finish a step.
    Discarded {
        /// Name of the slave.
        instance: String,
        /// Begin of the step [s].
        time: f64,
        /// Where the slave stands [s].
        reached: f64,
    },
    /// A slave failed.
    Failed {
        /// Name of the slave.
        instance: String,
        /// Begin of the step [s].
        time: f64,
        /// What it was doing.
        stage: Stage,
        /// Its own words.
        source: SlaveError,
    },
}

/// What a run did.
#[derive(Debug)]
pub struct Run {
    /// How it ended.
    pub ending: Ending,
    /// Number of completed steps; one row more was recorded.
    pub steps: u64,
    /// Time of the last row [s].
    pub time: f64,
    /// Names of the slaves in the order in which they stepped.
    pub order: Vec<String>,
    /// The recorded signals.
    pub signals: Vec<Signal>,
    /// Outputs that no table of numbers can hold: strings.
    pub unrecorded: Vec<String>,
}

/// Steps a system from the clock's start to its stop, recording every output at each communication
/// point.
///
/// # Errors
/// If the initialization or the recording fails. A slave that fails later ends the run, which is
/// told by [`Run::ending`].
pub fn run(
    system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    algorithm: Algorithm,
    recorder: &mut dyn Recorder,
) -> Result<Run, MasterError> {
    run_and_look(system, clock, tolerance, algorithm, recorder, None)
}

/// What looks at a slave at the end of a run.
pub(super) type Look<'a> = &'a mut dyn FnMut(&mut dyn Slave) -> Result<(), SlaveError>;

/// As [`run`]; at the end, if it is reached, every slave is looked at in the order in which they were added,
/// after it has got the inputs that belong to the outputs there.
pub(super) fn run_and_look(
    mut system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    algorithm: Algorithm,
    recorder: &mut dyn Recorder,
    look: Option<Look>,
) -> Result<Run, MasterError> {
    let order = match algorithm {
        Algorithm::Jacobi => (0..system.instances.len()).collect(),
        Algorithm::GaussSeidel => gauss_seidel_order(&system),
    };
    let experiment = Experiment {
        start: clock.start(),
        stop: clock.stop(),
        tolerance,
    };
    initialize(&mut system, &experiment)?;
    let mut exchange = Exchange::new(system);
    let begin = clock.time(0);
    for i in 0..exchange.wired.len() {
        exchange.get_outputs(i).map_err(|f| f.at_start())?;
    }
    let record = |time| move |source| MasterError::Record { time, source };
    recorder.begin(&exchange.signals).map_err(record(begin))?;
    recorder.row(begin, &exchange.row).map_err(record(begin))?;

    let mut steps = 0;
    let mut stop = None;
    while steps < clock.steps() && stop.is_none() {
        stop = match exchange.advance(algorithm, &order, clock.time(steps), clock.step()) {
            Ok(()) => {
                steps += 1;
                let time = clock.time(steps);
                recorder.row(time, &exchange.row).map_err(record(time))?;
                (steps < clock.steps() && recorder.is_stop_asked())
                    .then_some(Ending::Stopped { time })
            }
            Err(stop) => Some(stop),
        };
    }
    let time = clock.time(steps);
    if let (None, Some(look)) = (&stop, look) {
        stop = exchange.look(look).err().map(|failure| failure.at(time));
    }
    let ending = exchange.end(stop, time);
    let name = |&i: &usize| exchange.wired[i].name.clone();
    Ok(Run {
        ending,
        steps,
        time,
        order: order.iter().map(name).collect(),
        signals: exchange.signals,
        unrecorded: exchange.unrecorded,
    })
}
