//! Initialization and the stepping loop.

mod algebraic_loop;
mod assemble;
mod change;
mod controller;
mod exchange;
mod history;
mod initialize;
mod lu;
mod stepper;
mod stopwatch;
mod strong;
mod substeps;
mod summary;
mod watch;
mod wired;
mod wires;

use self::exchange::Exchange;
use self::initialize::initialize;
use self::stepper::Stepper;
use self::summary::Wires;
use self::wired::Wired;
use super::algorithms::{Algorithm, Control, Coupling, MAX_EXTRAPOLATION, gauss_seidel_order};
use super::clock::Clock;
use super::component::{Component, ComponentError, Experiment};
use super::recorder::{Recorder, Signal};
use super::report::Report;
use super::system::System;
use std::io;
use thiserror::Error;

/// Why a run could not begin or be recorded. What happens to a component on the way is an [`Ending`].
#[derive(Debug, Error)]
pub enum MasterError {
    /// A component failed before the first step.
    #[error("`{instance}` failed to {stage}")]
    Initialization {
        /// Name of the instance.
        instance: String,
        /// What it was asked to do.
        stage: Stage,
        /// Its own words.
        source: ComponentError,
    },
    /// An algebraic loop between the components has no solution that Newton's method finds.
    #[error(
        "the initial values of {} depend on each other, and Newton's method finds no solution: after \
         {steps} steps they differ by {difference:.1e}; give the inputs other start values, or check \
         the loop's gain", names.join(", ")
    )]
    AlgebraicLoop {
        /// The outputs in the loop, and behind it.
        names: Vec<String>,
        /// Steps of Newton's method.
        steps: usize,
        /// What is left of the largest difference between an output and what it feeds, relative to
        /// `1 + |value|`.
        difference: f64,
    },
    /// A loop with values that are no reals does not come to rest.
    #[error("the initial values of {} depend on each other and do not settle in {sweeps} sweeps; cut the loop", names.join(", "))]
    Unsettled {
        /// The outputs in the loop, and behind it.
        names: Vec<String>,
        /// How often values were passed around.
        sweeps: usize,
    },
    /// Step-size control, and a component that cannot vary its steps.
    #[error(
        "`{instance}` cannot take communication steps of different lengths, which step-size control \
         needs; run without a tolerance"
    )]
    FixedSteps {
        /// Name of the instance.
        instance: String,
    },
    /// Bounds of step-size control that no step and no error can keep.
    #[error(
        "step-size control with a tolerance of {} and steps from {} s to {} s; expected a positive \
         tolerance, and a shortest step that is positive and no longer than the longest",
        control.tolerance, control.min_step, control.max_step
    )]
    Control {
        /// As given.
        control: Control,
    },
    /// A degree of extrapolation that there is not.
    #[error("extrapolation of degree {degree}; the highest is {MAX_EXTRAPOLATION}")]
    Extrapolation {
        /// As given.
        degree: usize,
    },
    /// A row could not be written.
    #[error("cannot write the result at {time} s")]
    Record {
        /// Time of the row \[s\].
        time: f64,
        /// Why.
        source: io::Error,
    },
}

/// What a component was doing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Taking start and stop time.
    Setup,
    /// Taking a start value.
    Set(String),
    /// Entering initialization.
    EnterInitialization,
    /// Passing a value to another component.
    Propagate(String),
    /// Leaving initialization.
    ExitInitialization,
    /// Taking its inputs.
    SetInputs,
    /// Stepping.
    Step,
    /// Giving its outputs.
    GetOutputs,
    /// Saving its state.
    Save,
    /// Going back to a saved state.
    Restore,
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
            Self::Save => f.write_str("save its state"),
            Self::Restore => f.write_str("go back to a saved state"),
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
        /// Where the components stand \[s\].
        time: f64,
    },
    /// A component asked for the end. If it stands within a step, the last row is at that time, if it still gives
    /// its outputs: these, and of the others what was exchanged last.
    EndRequested {
        /// Name of the instance.
        instance: String,
        /// Where it stands \[s\].
        time: f64,
    },
    /// A component could not finish a step. If it came to somewhere within it, the last row is at that time, as
    /// above.
    Discarded {
        /// Name of the instance.
        instance: String,
        /// Begin of the step \[s\].
        time: f64,
        /// Where the component stands \[s\].
        reached: f64,
        /// What it said of it.
        words: Option<String>,
    },
    /// A component failed.
    Failed {
        /// Name of the instance.
        instance: String,
        /// Begin of the step \[s\].
        time: f64,
        /// What it was doing.
        stage: Stage,
        /// Its own words.
        source: ComponentError,
    },
}

/// What a run did.
#[derive(Debug)]
pub struct Run {
    /// How it ended.
    pub ending: Ending,
    /// Number of completed steps of the clock; one row more was recorded, and another one if a component
    /// [ended](Ending::EndRequested) or [gave up](Ending::Discarded) within a step. With step-size control each is one or more
    /// [communication steps](super::Steps).
    pub steps: u64,
    /// Time of the last row \[s\].
    pub time: f64,
    /// Names of the instances in the order in which they stepped.
    pub order: Vec<String>,
    /// The recorded signals.
    pub signals: Vec<Signal>,
    /// Outputs that no table of numbers can hold: strings.
    pub unrecorded: Vec<String>,
    /// What was done, and how far the coupling is to be trusted.
    pub report: Report,
    /// The components, still alive.
    pub components: Components,
}

/// The components of a run. They are terminated when this goes, or [before](Self::terminate): when the results are safe,
/// since code of strangers may crash even then.
pub struct Components {
    wired: Vec<Wired>,
    /// Where they stand \[s\].
    time: f64,
    /// Who failed and is not called any more.
    culprit: Option<String>,
}

impl Components {
    /// Terminates those that still can be. The first that fails is told.
    pub fn terminate(&mut self) -> Option<Ending> {
        let mut failed = None;
        for mut wired in self.wired.drain(..) {
            if self.culprit.as_ref() != Some(&wired.name)
                && let Err(source) = wired.component.terminate()
            {
                let failure = wired.failure(Stage::Terminate, source);
                failed.get_or_insert(failure.at(self.time));
            }
        }
        failed
    }
}

impl Drop for Components {
    fn drop(&mut self) {
        self.terminate();
    }
}

impl std::fmt::Debug for Components {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = self.wired.iter().map(|wired| &wired.name);
        f.debug_list().entries(names).finish()
    }
}

/// Steps a system from the clock's start to its stop, recording every output at each of the clock's
/// communication points. `tolerance` is for components with error control of their own.
///
/// # Errors
/// If the components cannot be coupled like that, or the initialization or the recording fails. A component
/// that fails later ends the run, which is told by [`Run::ending`].
pub fn run(
    system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: impl Into<Coupling>,
    recorder: &mut dyn Recorder,
) -> Result<Run, MasterError> {
    let mut run = run_open(system, clock, tolerance, coupling, recorder)?;
    run.terminate();
    Ok(run)
}

/// As [`run`], but the components are not terminated: [`Run::terminate`] does that when the results are safe.
///
/// # Errors
/// As [`run`].
pub fn run_open(
    system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: impl Into<Coupling>,
    recorder: &mut dyn Recorder,
) -> Result<Run, MasterError> {
    run_and_look(system, clock, tolerance, coupling.into(), recorder, None)
}

impl Run {
    /// Terminates and frees the components. If one of a run that was completed fails at that, the run has failed.
    pub fn terminate(&mut self) {
        let failed = self.components.terminate();
        if let (Ending::Completed, Some(failed)) = (&self.ending, failed) {
            self.ending = failed;
        }
    }
}

/// What looks at a component at the end of a run.
pub(super) type Look<'a> = &'a mut dyn FnMut(&mut dyn Component) -> Result<(), ComponentError>;

/// As [`run`]; at the end, if it is reached, every instance is looked at in the order in which they were added,
/// after it has got the inputs that belong to the outputs there.
pub(super) fn run_and_look(
    mut system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: Coupling,
    recorder: &mut dyn Recorder,
    look: Option<Look>,
) -> Result<Run, MasterError> {
    if let Some(degree) = coupling.extrapolation.filter(|&d| d > MAX_EXTRAPOLATION) {
        return Err(MasterError::Extrapolation { degree });
    }
    if let Some(control) = coupling.control.filter(|control| !control.is_possible()) {
        return Err(MasterError::Control { control });
    }
    let order = match coupling.algorithm {
        Algorithm::Jacobi | Algorithm::Strong => (0..system.instances.len()).collect(),
        Algorithm::GaussSeidel => gauss_seidel_order(&system),
    };
    let experiment = Experiment {
        start: clock.start(),
        // Who looks may step on.
        stop: match look {
            None => clock.stop(),
            Some(_) => f64::INFINITY,
        },
        tolerance,
    };
    initialize(&mut system, &experiment)?;
    let wires = Wires::of(&system);
    let exchange = Exchange::new(system, &coupling);
    let mut stepper = Stepper::new(exchange, &coupling, order)?;
    stepper.begin(clock.start())?;
    let (steps, mut stop, last_row) = match stepper.parallel {
        // From one of rayon's own threads a step costs the others no waking: a tenth of what it does from outside.
        true => rayon::scope(|_| follow(&mut stepper, clock, recorder))?,
        false => follow(&mut stepper, clock, recorder)?,
    };
    let time = clock.time(steps);
    if let (None, Some(look)) = (&stop, look) {
        stop = (stepper.exchange.look(look).err()).map(|failure| failure.at(time));
    }
    let ending = stop.unwrap_or(Ending::Completed);
    let culprit = match &ending {
        Ending::Discarded { instance, .. } | Ending::Failed { instance, .. } => {
            Some(instance.clone())
        }
        _ => None,
    };
    let name = |&i: &usize| stepper.exchange.wired[i].name.clone();
    let order = stepper.order().iter().map(name).collect();
    let report = wires.report(&stepper, &coupling, steps, time - clock.start());
    Ok(Run {
        ending,
        steps,
        time: last_row,
        order,
        report,
        components: Components {
            wired: stepper.exchange.wired,
            time,
            culprit,
        },
        signals: stepper.exchange.signals,
        unrecorded: stepper.exchange.unrecorded,
    })
}

/// Steps and records until the clock's stop or until a component ends it: completed steps, the end, and the time of
/// the last row.
fn follow(
    stepper: &mut Stepper,
    clock: &Clock,
    recorder: &mut dyn Recorder,
) -> Result<(u64, Option<Ending>, f64), MasterError> {
    let begin = clock.time(0);
    let signals = &stepper.exchange.signals;
    recorder.begin(signals).map_err(unwritten(begin))?;
    row(stepper, recorder, begin)?;
    let done = step_to_end(stepper, clock, recorder)?;
    recorder.end_rows().map_err(unwritten(done.2))?;
    Ok(done)
}

/// What [`follow`] does after the first row.
fn step_to_end(
    stepper: &mut Stepper,
    clock: &Clock,
    recorder: &mut dyn Recorder,
) -> Result<(u64, Option<Ending>, f64), MasterError> {
    let mut time = clock.time(0);
    for step in 0..clock.steps() {
        let next = clock.time(step + 1);
        if let Err(ending) = stepper.advance(time, next, clock.step()) {
            if let Some(reached) = stepper.exchange.read_at_end(&ending, time) {
                row(stepper, recorder, reached)?;
                time = reached;
            }
            return Ok((step, Some(ending), time));
        }
        row(stepper, recorder, next)?;
        time = next;
        if step + 1 < clock.steps() && recorder.is_stop_asked() {
            return Ok((step + 1, Some(Ending::Stopped { time }), time));
        }
    }
    Ok((clock.steps(), None, time))
}

#[inline]
fn row(stepper: &Stepper, recorder: &mut dyn Recorder, time: f64) -> Result<(), MasterError> {
    let written = recorder.row(time, &stepper.exchange.values.row);
    written.map_err(unwritten(time))
}

fn unwritten(time: f64) -> impl FnOnce(io::Error) -> MasterError {
    move |source| MasterError::Record { time, source }
}
