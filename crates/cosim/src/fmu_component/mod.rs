//! An FMI 2.0 or 3.0 FMU as a component. Only this module depends on FMUs.

mod access;
mod arrays;
mod fmi3;
mod impulse_response;
pub mod isolated;
mod linear;
mod model_exchange;
mod ranges;
mod variables;

pub use model_exchange::ModelExchangeComponent;

use self::access::Access;
use self::arrays::Arrays;
use self::fmi3::{Fmi3, KeptFmi3};
use self::linear::Knowns;
use self::variables::variables;
use super::component::{
    Abilities, Component, ComponentError, Experiment, Linear, Progress, Suggested, Value,
    ValueKind, Variable,
};
use pilotage_fmi::description::{
    Causality, DefaultExperiment, FmiVersion, ModelDescription, ScalarVariable, VariableKind,
};
use pilotage_fmi::instance::{Saved, Serialized};
use pilotage_fmi::{Fmu, FmuError, Instance, InterfaceType, Step, fmu};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

/// Opens and loads an FMU and makes a component of it: with the wanted interface, if available, otherwise co-simulation
/// before model exchange.
///
/// # Foreign code
/// The FMU's code runs in this process, with its rights: [`Fmu::load`].
///
/// # Errors
/// If the FMU is invalid, or supports only scheduled execution.
pub fn open(
    path: &Path,
    name: &str,
    wanted: Option<InterfaceType>,
) -> Result<Box<dyn Component>, FmuError> {
    of_library(&Fmu::open(path)?.load()?, name, wanted)
}

/// As [`open`], of an FMU that lies unpacked in a folder.
///
/// # Foreign code
/// As [`open`].
///
/// # Errors
/// As [`open`].
pub fn open_in_folder(
    folder: &Path,
    name: &str,
    wanted: Option<InterfaceType>,
) -> Result<Box<dyn Component>, FmuError> {
    of_library(&fmu::Library::in_folder(folder)?, name, wanted)
}

fn of_library(
    library: &fmu::Library,
    name: &str,
    wanted: Option<InterfaceType>,
) -> Result<Box<dyn Component>, FmuError> {
    Ok(match chosen(library.description(), wanted) {
        InterfaceType::ModelExchange => Box::new(ModelExchangeComponent::new(library, name)?),
        _ => Box::new(FmuComponent::new(library, name)?),
    })
}

/// Interface type used for an FMU.
fn chosen(description: &ModelDescription, wanted: Option<InterfaceType>) -> InterfaceType {
    let has = |kind: &InterfaceType| match kind {
        InterfaceType::CoSimulation => description.co_simulation.is_some(),
        InterfaceType::ModelExchange => description.model_exchange.is_some(),
        InterfaceType::ScheduledExecution => description.scheduled_execution.is_some(),
    };
    let order = [InterfaceType::CoSimulation, InterfaceType::ModelExchange];
    let kind = wanted.into_iter().chain(order).find(has);
    kind.unwrap_or(InterfaceType::CoSimulation)
}

/// Properties of the component that [`open`] makes, from the model description only: no code of the FMU runs.
#[derive(Debug, Clone)]
pub struct Outline {
    /// The variables.
    pub variables: Vec<Variable>,
    /// Its capabilities.
    pub abilities: Abilities,
    /// Times that it suggests.
    pub suggested: Suggested,
    /// What is not simulated.
    pub limitation: Option<String>,
}

impl Outline {
    /// Reads the outline of an FMU.
    ///
    /// # Errors
    /// If the archive or the description is invalid.
    pub fn read(path: &Path, wanted: Option<InterfaceType>) -> Result<Self, FmuError> {
        let fmu = Fmu::open(path)?;
        let description = fmu.description();
        let arrays = Arrays::of(description);
        let variables = variables(description, &arrays);
        let access = Access::new(description, arrays);
        let abilities = match chosen(description, wanted) {
            InterfaceType::ModelExchange => model_exchange::abilities(description, &access),
            _ => {
                let is_fmi3 = description.fmi_version == FmiVersion::V3;
                let fmi3 = is_fmi3.then(|| Fmi3::of(description).0);
                abilities(description, &access, fmi3.as_ref())
            }
        };
        let experiment = description.default_experiment.unwrap_or_default();
        Ok(Self {
            abilities,
            suggested: suggested(&experiment),
            limitation: limitation(description, &variables),
            variables,
        })
    }
}

/// An instance of an FMU for co-simulation.
#[derive(Debug)]
pub struct FmuComponent {
    instance: Instance,
    description: Arc<ModelDescription>,
    access: Access,
    knowns: Knowns,
    variables: Vec<Variable>,
    /// The description's `DefaultExperiment`.
    experiment: DefaultExperiment,
    abilities: Abilities,
    /// Current time [s].
    time: f64,
    /// State of FMI 3.0 co-simulation.
    fmi3: Option<Fmi3>,
    /// Saved states, each with its time and the time of the next time event [s].
    saved: Vec<(Saved, f64, Option<f64>)>,
    /// Derivative order 1 for each variable of a call.
    orders: Vec<i32>,
    limitation: Option<String>,
}

impl FmuComponent {
    /// Opens and loads an FMU and instantiates it.
    ///
    /// # Foreign code
    /// The FMU's code runs in this process, with its rights: [`Fmu::load`].
    ///
    /// # Errors
    /// If the FMU is invalid.
    pub fn open(path: &Path, name: &str) -> Result<Self, FmuError> {
        Self::new(&Fmu::open(path)?.load()?, name)
    }

    /// Instantiates a loaded FMU.
    ///
    /// # Errors
    /// If the FMU rejects it.
    pub fn new(library: &fmu::Library, name: &str) -> Result<Self, FmuError> {
        let description = library.description();
        let (fmi3, options) = match description.fmi_version {
            FmiVersion::V2 => (None, pilotage_fmi::InstanceOptions::default()),
            FmiVersion::V3 => {
                let (fmi3, options) = Fmi3::of(description);
                (Some(fmi3), options)
            }
        };
        let instance = library.instantiate_with(name, InterfaceType::CoSimulation, options)?;
        let arrays = Arrays::of(description);
        let variables = variables(description, &arrays);
        let access = Access::new(description, arrays);
        Ok(Self {
            abilities: abilities(description, &access, fmi3.as_ref()),
            fmi3,
            time: 0.0,
            saved: Vec::new(),
            orders: vec![1; variables.len()],
            instance,
            description: Arc::clone(description),
            access,
            knowns: Knowns::of(description),
            limitation: limitation(description, &variables),
            variables,
            experiment: description.default_experiment.unwrap_or_default(),
        })
    }
}

/// The state of an FMU between two steps, as bytes.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// In the FMU's own format.
    bytes: Vec<u8>,
    time: f64,
    fmi3: Option<KeptFmi3>,
}

/// What an FMU suggests. A step that is no positive number is none.
fn suggested(experiment: &DefaultExperiment) -> Suggested {
    Suggested {
        stop: experiment.stop_time,
        step: (experiment.step_size).filter(|step| *step > 0.0 && step.is_finite()),
    }
}

/// What the master does not simulate of an FMU of FMI 3.0: clocks that an importer has to tick, and inputs and outputs that
/// are not among `variables`.
fn limitation(description: &ModelDescription, variables: &[Variable]) -> Option<String> {
    let is_clock = |own: &ScalarVariable| matches!(own.kind, VariableKind::Clock { .. });
    let has_input = |own: &&ScalarVariable| own.causality == Causality::Input && is_clock(own);
    let handled: HashSet<&str> = (variables.iter())
        .map(|own| own.name.split_once('[').map_or(&own.name[..], |own| own.0))
        .collect();
    let is_left_out = |own: &&ScalarVariable| {
        let is_end = matches!(own.causality, Causality::Input | Causality::Output);
        let name = own.name.split_once('[').map_or(&own.name[..], |own| own.0);
        is_end && !is_clock(own) && !handled.contains(name)
    };
    let all = || description.variables.iter();
    let clocks = named(all().filter(has_input)).map(|(names, count)| match count {
        1 => {
            format!("the clock {names} never ticks: input clocks of FMI 3.0 are not simulated here")
        }
        _ => {
            format!("the clocks {names} never tick: input clocks of FMI 3.0 are not simulated here")
        }
    });
    let left_out = named(all().filter(is_left_out)).map(|(names, _)| {
        format!("without {names}: binary variables and very large arrays are not simulated here")
    });
    let both: Vec<String> = clocks.into_iter().chain(left_out).collect();
    (!both.is_empty()).then(|| both.join("; "))
}

/// The first of the names, how many others there are, and the number of all; `None` without any.
fn named<'d>(variables: impl Iterator<Item = &'d ScalarVariable>) -> Option<(String, usize)> {
    let names: Vec<&str> = variables.map(|own| &own.name[..]).collect();
    let first = names.first()?;
    Some(match names.len() {
        1 => (format!("`{first}`"), 1),
        count => (format!("`{first}` and {} more", count - 1), count),
    })
}

impl Component for FmuComponent {
    fn words_of_discard(&mut self) -> Option<String> {
        self.instance.words_of_discard().map(str::to_owned)
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        let tolerance = experiment.tolerance.or(self.experiment.tolerance);
        let (start, stop) = (experiment.start, experiment.stop);
        let stop = stop.is_finite().then_some(stop);
        self.time = start;
        Ok(self.instance.setup_experiment(tolerance, start, stop)?)
    }

    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(self.instance.enter_initialization_mode()?)
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.instance.exit_initialization_mode()?;
        match &mut self.fmi3 {
            Some(fmi3) => fmi3.begin(&mut self.instance),
            None => Ok(()),
        }
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        let (access, instance) = (&self.access, &mut self.instance);
        match &mut self.fmi3 {
            Some(fmi3) => fmi3.set_reals(access, instance, handles, values),
            None => access.set_reals(instance, handles, values),
        }
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        let instance = &mut self.instance;
        Ok(self.access.get_reals(instance, handles, values)?)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        if let Some(fmi3) = &mut self.fmi3
            && fmi3.is_for_events(handle, value)
        {
            return fmi3.defer(&self.access, &mut self.instance, handle, value);
        }
        self.access.set(&mut self.instance, handle, value)
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        self.access.get(&mut self.instance, handle, kind)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.time = t + h;
        match &mut self.fmi3 {
            Some(fmi3) => fmi3.step(&self.access, &mut self.instance, (t, h), false),
            None => match self.instance.do_step(t, h) {
                Ok(Step::Done) => Ok(Progress::Done),
                other => Ok(progress(other?, t)),
            },
        }
    }

    fn suggested(&self) -> Suggested {
        suggested(&self.experiment)
    }

    fn limitation(&self) -> Option<String> {
        self.limitation.clone()
    }

    fn terminate(&mut self) -> Result<(), ComponentError> {
        Ok(self.instance.terminate()?)
    }

    /// By `fmi2Reset`, `fmi3Reset`.
    fn renew(&mut self) -> Result<bool, ComponentError> {
        self.instance.terminate()?;
        self.instance.reset()?;
        if self.fmi3.is_some() {
            self.fmi3 = Some(Fmi3::of(&self.description).0);
        }
        self.time = 0.0;
        Ok(true)
    }

    /// By directional derivatives, if the description lists the states; otherwise by responses with steps of `step`, if
    /// the instance supports rollback.
    fn linearize(&mut self, step: f64) -> Result<Linear, ComponentError> {
        let can_derive = self.instance.provides_directional_derivatives();
        if can_derive && self.knowns.has_states() || !self.abilities.rollback {
            let system = self.knowns.by_derivatives(&mut self.instance)?;
            return Ok(system.into());
        }
        impulse_response::linearize(self, step)
    }

    fn abilities(&self) -> Abilities {
        self.abilities
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        if let Some(fmi3) = &mut self.fmi3 {
            fmi3.flush(&self.access, &mut self.instance)?;
        }
        while self.saved.len() <= place {
            self.saved.push((self.instance.save()?, self.time, None));
        }
        let (saved, time, next_event) = &mut self.saved[place];
        *time = self.time;
        *saved = self.instance.save_into(*saved)?;
        *next_event = self.fmi3.as_ref().and_then(|fmi3| fmi3.next_event);
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        match self.saved.get(place) {
            Some(&(saved, time, next_event)) => {
                self.time = time;
                if let Some(fmi3) = &mut self.fmi3 {
                    fmi3.forget();
                    fmi3.next_event = next_event;
                }
                Ok(self.instance.restore(saved)?)
            }
            None => Err(format!("no state is saved in place {place}").into()),
        }
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        if let Some(fmi3) = &mut self.fmi3 {
            fmi3.flush(&self.access, &mut self.instance)?;
        }
        let saved = self.instance.save()?;
        let serialized = self.instance.serialize(saved)?;
        self.instance.free(saved)?;
        let kept = Kept {
            bytes: serialized.bytes,
            time: self.time,
            fmi3: self.fmi3.as_ref().map(Fmi3::kept),
        };
        Ok(postcard::to_stdvec(&kept)?)
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        let kept: Kept = postcard::from_bytes(bytes)?;
        // Between two steps, as it was.
        let serialized = Serialized {
            bytes: kept.bytes,
            state: self.instance.state(),
        };
        let saved = self.instance.deserialize(&serialized)?;
        self.instance.restore(saved)?;
        self.instance.free(saved)?;
        self.time = kept.time;
        if let (Some(fmi3), Some(kept)) = (&mut self.fmi3, kept.fmi3) {
            fmi3.take(kept);
        }
        Ok(())
    }

    fn step_revocably(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.time = t + h;
        match &mut self.fmi3 {
            Some(fmi3) => fmi3.step(&self.access, &mut self.instance, (t, h), true),
            None => Ok(progress(self.instance.do_step_revocably(t, h)?, t)),
        }
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        let fmi3 = self.fmi3.as_ref()?;
        fmi3.next_event.filter(|&next| next > t)
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        if let Some(fmi3) = &mut self.fmi3 {
            return fmi3.set_slopes(handles, slopes);
        }
        let orders = &self.orders[..handles.len()];
        Ok(self
            .instance
            .set_input_derivatives(handles, orders, slopes)?)
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        let orders = &self.orders[..handles.len()];
        Ok(self
            .instance
            .get_output_derivatives(handles, orders, slopes)?)
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        Ok(self
            .instance
            .directional_derivative(outputs, inputs, seed, result)?)
    }
}

/// Capabilities from the model description. 32-bit inputs or outputs and arrays have no derivatives here.
fn abilities(description: &ModelDescription, access: &Access, fmi3: Option<&Fmi3>) -> Abilities {
    let Some(cs) = &description.co_simulation else {
        return Abilities::default();
    };
    let (inputs, outputs) = (access.has_simple_inputs(), access.has_simple_outputs());
    Abilities {
        rollback: cs.can_get_and_set_fmu_state,
        serialization: cs.can_get_and_set_fmu_state && cs.can_serialize_fmu_state,
        variable_steps: cs.can_handle_variable_communication_step_size,
        // FMI 3.0 uses intermediate updates for this.
        input_derivatives: match fmi3 {
            Some(fmi3) => fmi3.has_ramps() && inputs,
            None => cs.can_interpolate_inputs,
        },
        output_derivatives: cs.max_output_derivative_order >= 1 && outputs,
        directional_derivatives: cs.provides_directional_derivative && inputs && outputs,
        cuts_steps: false,
    }
}

/// Result of a step from time `t` [s].
fn progress(step: Step, t: f64) -> Progress {
    match step {
        Step::Done => Progress::Done,
        Step::Discarded {
            last_successful,
            is_end_requested,
        } => {
            let reached = last_successful.unwrap_or(t);
            match is_end_requested {
                true => Progress::EndRequested { reached },
                false => Progress::Discarded { reached },
            }
        }
        Step::Stopped {
            reached,
            is_end_requested: true,
            ..
        } => Progress::EndRequested { reached },
        // Early return, in FMI 3.0 only; not the end of the simulation.
        Step::Stopped { .. } => Progress::Done,
    }
}
