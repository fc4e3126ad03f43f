//! Initialization and the stepping loop.

use super::algorithms::{Algorithm, Propagation, gauss_seidel_order};
use super::clock::Clock;
use super::recorder::{Recorder, Signal};
use super::slave::{Experiment, Kind, Progress, Role, Slave, SlaveError, Value};
use super::system::{Connection, System};
use std::io;
use std::ops::Range;
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
            Self::Terminate => f.write_str("terminate"),
        }
    }
}

/// How a run ended. All rows up to then are recorded.
#[derive(Debug)]
pub enum Ending {
    /// At the stop time.
    Completed,
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
    mut system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    algorithm: Algorithm,
    recorder: &mut dyn Recorder,
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
                None
            }
            Err(stop) => Some(stop),
        };
    }
    let time = clock.time(steps);
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

/// Brings all slaves to the start time with consistent values.
fn initialize(system: &mut System, experiment: &Experiment) -> Result<(), MasterError> {
    let propagation = Propagation::of(system);
    each(system, Stage::Setup, |slave| slave.setup(experiment))?;
    apply_settings(system, |role| role != Role::Input)?;
    each(system, Stage::EnterInitialization, |slave| {
        slave.enter_initialization()
    })?;
    apply_settings(system, |role| role == Role::Input)?;
    propagate(system, &propagation)?;
    each(system, Stage::ExitInitialization, |slave| {
        slave.exit_initialization()
    })
}

fn each(
    system: &mut System,
    stage: Stage,
    mut call: impl FnMut(&mut dyn Slave) -> Result<(), SlaveError>,
) -> Result<(), MasterError> {
    for instance in &mut system.instances {
        call(instance.slave.as_mut()).map_err(|source| MasterError::Initialization {
            instance: instance.name.clone(),
            stage: stage.clone(),
            source,
        })?;
    }
    Ok(())
}

/// Gives the start values to variables of some roles.
fn apply_settings(system: &mut System, wanted: impl Fn(Role) -> bool) -> Result<(), MasterError> {
    for (port, value) in &system.settings {
        let instance = &mut system.instances[port.slave];
        let variable = &instance.slave.variables()[port.variable];
        if !wanted(variable.role) {
            continue;
        }
        let (handle, name) = (variable.handle, variable.name.clone());
        let failed = |source| MasterError::Initialization {
            instance: instance.name.clone(),
            stage: Stage::Set(name),
            source,
        };
        instance.slave.set(handle, value).map_err(failed)?;
    }
    Ok(())
}

/// Largest number of sweeps through an algebraic loop during initialization.
const MAX_SWEEPS: usize = 100;

/// Passes values along the connections until they are consistent.
fn propagate(system: &mut System, propagation: &Propagation) -> Result<(), MasterError> {
    for &c in &propagation.once {
        pass(system, system.connections[c])?;
    }
    let mut last: Vec<Option<Value>> = vec![None; propagation.repeated.len()];
    for sweep in 0.. {
        let mut has_settled = true;
        for (&c, last) in propagation.repeated.iter().zip(&mut last) {
            let value = pass(system, system.connections[c])?;
            has_settled &= last.as_ref().is_some_and(|last| is_close(last, &value));
            *last = Some(value);
        }
        if has_settled {
            break;
        }
        if sweep == MAX_SWEEPS {
            let names = propagation.repeated.iter();
            return Err(MasterError::AlgebraicLoop {
                names: names
                    .map(|&c| system.port_name(system.connections[c].from))
                    .collect(),
                sweeps: MAX_SWEEPS,
            });
        }
    }
    Ok(())
}

fn is_close(a: &Value, b: &Value) -> bool {
    const TOLERANCE: f64 = 1e-12;
    match (a, b) {
        (Value::Real(a), Value::Real(b)) => (a - b).abs() <= TOLERANCE * (1.0 + b.abs()),
        _ => a == b,
    }
}

/// Passes one value along one connection.
fn pass(system: &mut System, connection: Connection) -> Result<Value, MasterError> {
    let (from, to) = (
        system.variable(connection.from),
        system.variable(connection.to),
    );
    let (from_handle, kind, to_handle) = (from.handle, from.kind, to.handle);
    let name = from.name.clone();
    let failed = |instance: &str| {
        let instance = instance.to_owned();
        move |source| MasterError::Initialization {
            instance,
            stage: Stage::Propagate(name),
            source,
        }
    };
    let source = &mut system.instances[connection.from.slave];
    let got = source.slave.get(from_handle, kind);
    let value = got.map_err(failed.clone()(&source.name))?;
    let target = &mut system.instances[connection.to.slave];
    let set = target.slave.set(to_handle, &value);
    set.map_err(failed(&target.name))?;
    Ok(value)
}

/// A slave with what it exchanges, so that each step needs one call for all its reals.
struct Wired {
    name: String,
    slave: Box<dyn Slave>,
    /// Handles of all real outputs, and where they go in the row.
    outputs: Vec<u32>,
    output_slots: Range<usize>,
    /// Handles of all other outputs, with slots in `others`.
    other_outputs: Vec<(u32, Kind, usize)>,
    /// Handles of the real inputs that are fed, the row's slots that feed them, and room for values.
    inputs: Vec<u32>,
    input_slots: Vec<usize>,
    input_values: Vec<f64>,
    /// Handles of the other inputs that are fed, and slots in `others`.
    other_inputs: Vec<(u32, usize)>,
}

/// The slaves and the values between them. Nothing is allocated after it is made, but for strings.
struct Exchange {
    wired: Vec<Wired>,
    /// The recorded values: of each slave the reals, then integers, enumerations and booleans.
    row: Vec<f64>,
    signals: Vec<Signal>,
    /// Outputs that are no reals, and their slots in the row; strings have none.
    others: Vec<Value>,
    other_slots: Vec<Option<usize>>,
    unrecorded: Vec<String>,
}

/// A failed call.
struct Failure {
    instance: String,
    stage: Stage,
    source: SlaveError,
}

impl Failure {
    fn at_start(self) -> MasterError {
        MasterError::Initialization {
            instance: self.instance,
            stage: self.stage,
            source: self.source,
        }
    }

    fn at(self, time: f64) -> Ending {
        Ending::Failed {
            instance: self.instance,
            time,
            stage: self.stage,
            source: self.source,
        }
    }
}

impl Exchange {
    fn new(system: System) -> Self {
        let mut exchange = Self {
            wired: Vec::new(),
            row: Vec::new(),
            signals: Vec::new(),
            others: Vec::new(),
            other_slots: Vec::new(),
            unrecorded: Vec::new(),
        };
        // Slot of each output: in the row for reals, in `others` for the rest.
        let mut slots = std::collections::HashMap::new();
        for (slave, instance) in system.instances.into_iter().enumerate() {
            exchange.add(slave, instance.name, instance.slave, &mut slots);
        }
        for connection in &system.connections {
            let target = &mut exchange.wired[connection.to.slave];
            let variable = &target.slave.variables()[connection.to.variable];
            let Some(&slot) = slots.get(&(connection.from.slave, connection.from.variable)) else {
                continue;
            };
            match variable.kind {
                Kind::Real => {
                    target.inputs.push(variable.handle);
                    target.input_slots.push(slot);
                    target.input_values.push(0.0);
                }
                _ => target.other_inputs.push((variable.handle, slot)),
            }
        }
        exchange
    }

    /// Takes in a slave; gives each of its outputs a slot.
    fn add(
        &mut self,
        position: usize,
        name: String,
        slave: Box<dyn Slave>,
        slots: &mut std::collections::HashMap<(usize, usize), usize>,
    ) {
        let first = self.row.len();
        let (mut outputs, mut other_outputs) = (Vec::new(), Vec::new());
        let all = || slave.variables().iter().enumerate();
        let is_output = |role| role == Role::Output;
        for (index, variable) in all().filter(|(_, v)| is_output(v.role) && v.kind == Kind::Real) {
            slots.insert((position, index), self.row.len());
            outputs.push(variable.handle);
            let unit = variable.unit.as_ref();
            self.add_signal(&name, &variable.name, unit.map_or("", |u| &u.name));
        }
        let output_slots = first..self.row.len();
        for (index, variable) in all().filter(|(_, v)| is_output(v.role) && v.kind != Kind::Real) {
            let slot = self.others.len();
            slots.insert((position, index), slot);
            other_outputs.push((variable.handle, variable.kind, slot));
            self.others.push(Value::Integer(0));
            if variable.kind == Kind::String {
                self.unrecorded.push(format!("{name}.{}", variable.name));
                self.other_slots.push(None);
            } else {
                self.other_slots.push(Some(self.row.len()));
                self.add_signal(&name, &variable.name, "");
            }
        }
        self.wired.push(Wired {
            name,
            slave,
            outputs,
            output_slots,
            other_outputs,
            inputs: Vec::new(),
            input_slots: Vec::new(),
            input_values: Vec::new(),
            other_inputs: Vec::new(),
        });
    }

    fn add_signal(&mut self, instance: &str, variable: &str, unit: &str) {
        self.row.push(f64::NAN);
        self.signals.push(Signal {
            name: format!("{instance}.{variable}"),
            unit: unit.to_owned(),
        });
    }

    /// One communication step from `t` by `h`.
    fn advance(
        &mut self,
        algorithm: Algorithm,
        order: &[usize],
        t: f64,
        h: f64,
    ) -> Result<(), Ending> {
        let failed = |failure: Failure| failure.at(t);
        match algorithm {
            Algorithm::Jacobi => {
                for &i in order {
                    self.set_inputs(i).map_err(failed)?;
                }
                for &i in order {
                    self.step(i, t, h)?;
                }
                for &i in order {
                    self.get_outputs(i).map_err(failed)?;
                }
            }
            Algorithm::GaussSeidel => {
                for &i in order {
                    self.set_inputs(i).map_err(failed)?;
                    self.step(i, t, h)?;
                    self.get_outputs(i).map_err(failed)?;
                }
            }
        }
        Ok(())
    }

    fn set_inputs(&mut self, i: usize) -> Result<(), Failure> {
        let wired = &mut self.wired[i];
        for (value, &slot) in wired.input_values.iter_mut().zip(&wired.input_slots) {
            *value = self.row[slot];
        }
        let mut result = Ok(());
        if !wired.inputs.is_empty() {
            result = wired.slave.set_reals(&wired.inputs, &wired.input_values);
        }
        for &(handle, slot) in &wired.other_inputs {
            result = result.and_then(|()| wired.slave.set(handle, &self.others[slot]));
        }
        result.map_err(|source| wired.failure(Stage::SetInputs, source))
    }

    fn get_outputs(&mut self, i: usize) -> Result<(), Failure> {
        let wired = &mut self.wired[i];
        let mut result = Ok(());
        if !wired.outputs.is_empty() {
            let values = &mut self.row[wired.output_slots.clone()];
            result = wired.slave.get_reals(&wired.outputs, values);
        }
        for &(handle, kind, slot) in &wired.other_outputs {
            result = result.and_then(|()| {
                self.others[slot] = wired.slave.get(handle, kind)?;
                if let Some(column) = self.other_slots[slot] {
                    self.row[column] = self.others[slot].as_number();
                }
                Ok(())
            });
        }
        result.map_err(|source| wired.failure(Stage::GetOutputs, source))
    }

    fn step(&mut self, i: usize, t: f64, h: f64) -> Result<(), Ending> {
        let wired = &mut self.wired[i];
        let instance = || wired.name.clone();
        match wired.slave.step(t, h) {
            Ok(Progress::Done) => Ok(()),
            Ok(Progress::Discarded { reached }) => Err(Ending::Discarded {
                instance: instance(),
                time: t,
                reached,
            }),
            Ok(Progress::EndRequested { reached }) => Err(Ending::EndRequested {
                instance: instance(),
                time: reached,
            }),
            Err(source) => Err(wired.failure(Stage::Step, source).at(t)),
        }
    }

    /// Terminates the slaves that still can be, and says how the run ended at `time`.
    fn end(&mut self, stopped: Option<Ending>, time: f64) -> Ending {
        let culprit = match &stopped {
            Some(Ending::Discarded { instance, .. } | Ending::Failed { instance, .. }) => instance,
            _ => "",
        };
        let mut failure = None;
        for wired in self.wired.iter_mut().filter(|w| w.name != culprit) {
            if let Err(source) = wired.slave.terminate() {
                failure.get_or_insert(wired.failure(Stage::Terminate, source));
            }
        }
        match (stopped, failure) {
            (Some(ending), _) => ending,
            (None, Some(failure)) => failure.at(time),
            (None, None) => Ending::Completed,
        }
    }
}

impl Wired {
    fn failure(&self, stage: Stage, source: SlaveError) -> Failure {
        Failure {
            instance: self.name.clone(),
            stage,
            source,
        }
    }
}
