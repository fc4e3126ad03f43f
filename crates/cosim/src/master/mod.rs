//! Initialization and the stepping loop.

mod algebraic_loop;
mod assemble;
mod change;
mod controller;
mod exchange;
mod history;
mod initialize;
mod lu;
mod session;
mod state;
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
pub use self::session::{Kept, Session};
use self::state::NotKept;
pub use self::state::{Checkpoints, State};
use self::stepper::Stepper;
use self::summary::Wires;
use self::wired::Wired;
use super::algorithms::{
    Algorithm, Control, Coupling, Iteration, MAX_EXTRAPOLATION, gauss_seidel_order,
};
use super::clock::Clock;
use super::component::{Component, ComponentError, Experiment};
use super::recorder::{Recorder, Signal};
use super::report::Report;
use super::system::System;
use std::io;
use thiserror::Error;

/// Why a run could not begin or be recorded. Failures of components during the run are [`Ending`]s.
#[derive(Debug, Error)]
pub enum MasterError {
    /// A component failed before the first step.
    #[error("`{instance}` failed to {stage}")]
    Initialization {
        /// Name of the instance.
        instance: String,
        /// The failed operation.
        stage: Stage,
        /// The component's error.
        source: ComponentError,
    },
    /// Newton's method does not find a solution of an algebraic loop between components.
    #[error(
        "the initial values of {} depend on each other, and Newton's method finds no solution: after \
         {steps} steps they differ by {difference:.1e}; give the inputs other start values, or check \
         the loop's gain", names.join(", ")
    )]
    AlgebraicLoop {
        /// The outputs in and behind the loop.
        names: Vec<String>,
        /// Steps of Newton's method.
        steps: usize,
        /// Remaining largest difference between an output and the input that it feeds, relative to them.
        difference: f64,
    },
    /// A loop with non-real values does not settle.
    #[error("the initial values of {} depend on each other and do not settle in {sweeps} sweeps; cut the loop", names.join(", "))]
    Unsettled {
        /// The outputs in and behind the loop.
        names: Vec<String>,
        /// Number of sweeps.
        sweeps: usize,
    },
    /// Step-size control with a component that does not support variable steps.
    #[error(
        "`{instance}` cannot take communication steps of different lengths, which step-size control \
         needs; run without a tolerance"
    )]
    FixedSteps {
        /// Name of the instance.
        instance: String,
    },
    /// Invalid bounds of step-size control.
    #[error(
        "step-size control with a tolerance of {} and steps from {} s to {} s; expected a positive \
         tolerance, and a shortest step that is positive and no longer than the longest",
        control.tolerance, control.min_step, control.max_step
    )]
    Control {
        /// The given control.
        control: Control,
    },
    /// An iteration of strong coupling that would end before it begins.
    #[error(
        "strong coupling with a tolerance of {} and at most {} corrections; both must be above 0",
        iteration.tolerance, iteration.max
    )]
    Iteration {
        /// The given iteration.
        iteration: Iteration,
    },
    /// A tolerance that no error control can meet.
    #[error(
        "a tolerance of {tolerance} for the components' error control; expected a number above 0"
    )]
    Tolerance {
        /// The given tolerance.
        tolerance: f64,
    },
    /// Unsupported degree of extrapolation.
    #[error("extrapolation of degree {degree}; the highest is {MAX_EXTRAPOLATION}")]
    Extrapolation {
        /// The given degree.
        degree: usize,
    },
    /// A component whose state cannot be kept.
    #[error(
        "`{instance}` cannot write its state: an FMU can if it has canGetAndSetFMUstate and canSerializeFMUstate, and is one for \
         co-simulation"
    )]
    NoState {
        /// Name of the instance.
        instance: String,
    },
    /// A state of another system.
    #[error("the state is that of another system")]
    OtherState,
    /// A row could not be written.
    #[error("cannot write the result at {time} s")]
    Record {
        /// Time of the row \[s\].
        time: f64,
        /// The cause.
        source: io::Error,
    },
}

/// Operation of a component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Receiving start and stop time.
    Setup,
    /// Receiving a start value.
    Set(String),
    /// Entering initialization.
    EnterInitialization,
    /// Passing a value to another component.
    Propagate(String),
    /// Exiting initialization.
    ExitInitialization,
    /// Receiving its inputs.
    SetInputs,
    /// Stepping.
    Step,
    /// Providing its outputs.
    GetOutputs,
    /// Saving its state.
    Save,
    /// Restoring a saved state.
    Restore,
    /// Linearization.
    Linearize,
    /// Terminating.
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

/// How a run ended. All rows until then are recorded.
#[derive(Debug)]
pub enum Ending {
    /// At the stop time.
    Completed,
    /// The recorder requested the end on behalf of the user ([`Recorder::is_stop_asked`]).
    Stopped {
        /// Current time of the components \[s\].
        time: f64,
    },
    /// A component requested the end. If it stopped within a step and still provides outputs, the last row is at that
    /// time, with these outputs and the last exchanged values of the other components.
    EndRequested {
        /// Name of the instance.
        instance: String,
        /// Time at which it stopped \[s\].
        time: f64,
    },
    /// A component could not finish a step. If it reached a time within the step, the last row is at that time, as for
    /// `EndRequested`.
    Discarded {
        /// Name of the instance.
        instance: String,
        /// Beginning of the step \[s\].
        time: f64,
        /// Time reached by the component \[s\].
        reached: f64,
        /// Its message about it.
        words: Option<String>,
    },
    /// A component failed.
    Failed {
        /// Name of the instance.
        instance: String,
        /// Beginning of the step \[s\].
        time: f64,
        /// The failed operation.
        stage: Stage,
        /// The component's error.
        source: ComponentError,
    },
}

/// Result of a run.
#[derive(Debug)]
pub struct Run {
    /// How it ended.
    pub ending: Ending,
    /// Number of completed steps of the clock. One more row was recorded, and another if a component
    /// [ended](Ending::EndRequested) or [gave up](Ending::Discarded) within a step. With step-size control, each
    /// consists of one or more [communication steps](super::Steps).
    pub steps: u64,
    /// Time of the first row \[s\].
    pub begin: f64,
    /// Time of the last row \[s\].
    pub time: f64,
    /// Whether the last row lies within a step: the component that ended the run is there, all others are elsewhere in the
    /// step.
    pub ends_within_step: bool,
    /// Names of the instances in the order in which they stepped.
    pub order: Vec<String>,
    /// The recorded signals.
    pub signals: Vec<Signal>,
    /// Outputs that a table of numbers cannot hold: strings.
    pub unrecorded: Vec<String>,
    /// Statistics of the run and estimates of its coupling error.
    pub report: Report,
    /// The components, not yet terminated.
    pub components: Components,
}

/// The components of a run. They are terminated on drop or [earlier](Self::terminate): once the results are saved,
/// since third-party code may crash even then.
pub struct Components {
    wired: Vec<Wired>,
    /// Their current time \[s\].
    time: f64,
    /// Name of the component that failed and is no longer called.
    culprit: Option<String>,
}

impl Components {
    /// Terminates the remaining components. Returns the first failure.
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

    /// The components, [made new](Component::renew) for another run. `None` if one of them has failed or cannot be.
    pub fn renewed(mut self) -> Option<Vec<(String, Box<dyn Component>)>> {
        if self.culprit.is_some() {
            return None;
        }
        let wired = std::mem::take(&mut self.wired);
        let renew = |mut own: Wired| {
            let mut component = match own.component.without_scenario() {
                Some(within) => within?,
                None => own.component,
            };
            let is_new = component.renew().unwrap_or(false);
            Some(is_new.then_some((own.name, component)))
        };
        wired.into_iter().filter_map(renew).collect()
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

/// Steps a system from the clock's start to its stop, and records every output at each of the clock's communication
/// points. `tolerance` is for components with their own error control.
///
/// # Errors
/// If the components cannot be coupled in this way, or initialization or recording fails. A component that fails later
/// ends the run; [`Run::ending`] reports it.
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

/// As [`run`], but the components are not terminated: call [`Run::terminate`] once the results are saved.
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
    let (coupling, checkpoints) = (coupling.into(), Checkpoints::default());
    run_between(system, clock, tolerance, coupling, recorder, checkpoints)
}

/// As [`run_open`], from a state that another run has kept, and keeping states.
///
/// # Errors
/// As [`run`]; and if a component cannot write its state, or the state is that of another system.
pub fn run_between(
    system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: Coupling,
    recorder: &mut dyn Recorder,
    mut checkpoints: Checkpoints,
) -> Result<Run, MasterError> {
    run_and_look(
        system,
        clock,
        tolerance,
        coupling,
        recorder,
        &mut checkpoints,
        None,
    )
}

impl Run {
    /// Terminates and frees the components. If this fails after a completed run, the run has failed.
    pub fn terminate(&mut self) {
        let failed = self.components.terminate();
        if let (Ending::Completed, Some(failed)) = (&self.ending, failed) {
            self.ending = failed;
        }
    }
}

/// Callback that inspects a component at the end of a run.
pub(super) type Look<'a> = &'a mut dyn FnMut(&mut dyn Component) -> Result<(), ComponentError>;

/// As [`run`]; if the end is reached, calls `look` for every instance in the order in which they were added, after
/// setting the inputs that belong to the outputs there.
pub(super) fn run_and_look(
    mut system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: Coupling,
    recorder: &mut dyn Recorder,
    checkpoints: &mut Checkpoints,
    look: Option<Look>,
) -> Result<Run, MasterError> {
    check(&coupling)?;
    let is_possible = |tolerance: &f64| *tolerance > 0.0 && tolerance.is_finite();
    if let Some(tolerance) = tolerance.filter(|tolerance| !is_possible(tolerance)) {
        return Err(MasterError::Tolerance { tolerance });
    }
    let experiment = Experiment {
        start: clock.start(),
        // `look` may step further.
        stop: match look {
            None => clock.stop(),
            Some(_) => f64::INFINITY,
        },
        tolerance,
    };
    checkpoints.check(&system)?;
    initialize(&mut system, &experiment)?;
    let wires = Wires::of(&system);
    let mut stepper = Stepper::of(system, &coupling)?;
    stepper.begin(clock.start())?;
    let first = checkpoints.from.as_ref().map_or(0, State::step);
    if let Some(state) = checkpoints.from.take() {
        stepper.resume(state)?;
    }
    let span = (clock, first);
    let (steps, mut stop, last_row) = match stepper.parallel {
        // Started on a rayon thread, a step need not wake the pool: this costs a tenth of starting from outside.
        true => rayon::scope(|_| follow(&mut stepper, span, recorder, checkpoints))?,
        false => follow(&mut stepper, span, recorder, checkpoints)?,
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
    let report = wires.report(&stepper, &coupling, steps - first, time - clock.time(first));
    Ok(Run {
        ending,
        steps: steps - first,
        begin: clock.time(first),
        time: last_row,
        ends_within_step: last_row > time,
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

/// Refuses options that are impossible together.
fn check(coupling: &Coupling) -> Result<(), MasterError> {
    if let Some(degree) = coupling.extrapolation.filter(|&d| d > MAX_EXTRAPOLATION) {
        return Err(MasterError::Extrapolation { degree });
    }
    if let Some(control) = coupling.control.filter(|control| !control.is_possible()) {
        return Err(MasterError::Control { control });
    }
    if coupling.algorithm == Algorithm::Strong && !coupling.iteration.is_possible() {
        let iteration = coupling.iteration;
        return Err(MasterError::Iteration { iteration });
    }
    Ok(())
}

impl Stepper {
    /// The components of an initialized system.
    fn of(system: System, coupling: &Coupling) -> Result<Self, MasterError> {
        let order = match coupling.algorithm {
            Algorithm::Jacobi | Algorithm::Strong => (0..system.instances.len()).collect(),
            Algorithm::GaussSeidel => gauss_seidel_order(&system),
        };
        Self::new(Exchange::new(system, coupling), coupling, order)
    }
}

/// Steps and records, from the clock's step `first`, until its stop or until a component ends the run. Returns the number of
/// completed steps of the clock, the ending, and the time of the last row.
fn follow(
    stepper: &mut Stepper,
    (clock, first): (&Clock, u64),
    recorder: &mut dyn Recorder,
    checkpoints: &mut Checkpoints,
) -> Result<(u64, Option<Ending>, f64), MasterError> {
    let begin = clock.time(first);
    let signals = &stepper.exchange.signals;
    recorder.begin(signals).map_err(unwritten(begin))?;
    row(stepper, recorder, begin)?;
    let done = step_to_end(stepper, (clock, first), recorder, checkpoints)?;
    recorder.end_rows().map_err(unwritten(done.2))?;
    Ok(done)
}

/// The part of [`follow`] after the first row.
fn step_to_end(
    stepper: &mut Stepper,
    (clock, first): (&Clock, u64),
    recorder: &mut dyn Recorder,
    checkpoints: &mut Checkpoints,
) -> Result<(u64, Option<Ending>, f64), MasterError> {
    let mut time = clock.time(first);
    let failed = |step, time, why| match why {
        NotKept::Component(failure) => Ok((step, Some(failure.at(time)), time)),
        NotKept::File(error) => Err(error),
    };
    if let Err(why) = checkpoints.after(stepper, first, time) {
        return failed(first, time, why);
    }
    for step in first..clock.steps() {
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
        if let Err(why) = checkpoints.after(stepper, step + 1, time) {
            return failed(step + 1, time, why);
        }
        if step + 1 < clock.steps() && recorder.is_stop_asked() {
            let kept = checkpoints.at_end(stepper, step + 1, time);
            return match kept {
                Ok(()) => Ok((step + 1, Some(Ending::Stopped { time }), time)),
                Err(why) => failed(step + 1, time, why),
            };
        }
    }
    match checkpoints.at_end(stepper, clock.steps(), time) {
        Ok(()) => Ok((clock.steps(), None, time)),
        Err(why) => failed(clock.steps(), time, why),
    }
}

#[inline]
fn row(stepper: &Stepper, recorder: &mut dyn Recorder, time: f64) -> Result<(), MasterError> {
    let written = recorder.row(time, &stepper.exchange.values.row);
    written.map_err(unwritten(time))
}

fn unwritten(time: f64) -> impl FnOnce(io::Error) -> MasterError {
    move |source| MasterError::Record { time, source }
}
