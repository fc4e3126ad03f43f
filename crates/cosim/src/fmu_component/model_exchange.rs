//! A model-exchange FMU with a solver as a component.

use super::access::Access;
use super::arrays::Arrays;
use super::linear::Knowns;
use super::variables::variables;
use crate::component::{
    Abilities, Component, ComponentError, Experiment, Linear, Progress, Suggested, Value,
    ValueKind, Variable,
};
use pilotage_fmi::description::{DefaultExperiment, ModelDescription};
use pilotage_fmi::simulate::{KeptRun, RunWork, SavedRun};
use pilotage_fmi::{FmuError, ModelExchangeRun, Reached, RunOptions, fmu};

/// Part of a communication step over which output slopes are estimated. The neglected terms are of second order in it,
/// and rounding errors of the values are divided by it.
const GLANCE: f64 = 1e-4;

/// An instance of a model-exchange FMU with a solver. Inputs are held or linear during a step.
#[derive(Debug)]
pub struct ModelExchangeComponent {
    run: ModelExchangeRun,
    access: Access,
    knowns: Knowns,
    variables: Vec<Variable>,
    /// The description's `DefaultExperiment`.
    experiment: DefaultExperiment,
    start: f64,
    /// Interval over which output slopes are estimated [s].
    glance: f64,
    has_begun: bool,
    abilities: Abilities,
    saved: Vec<Option<SavedRun>>,
    /// Inputs set last.
    last: Vec<f64>,
    limitation: Option<String>,
}

impl ModelExchangeComponent {
    /// Instantiates a loaded FMU.
    ///
    /// # Errors
    /// If the FMU does not support model exchange, or rejects the instantiation.
    pub fn new(library: &fmu::Library, name: &str) -> Result<Self, FmuError> {
        let description = library.description();
        let instance = library.instantiate(name, pilotage_fmi::InterfaceType::ModelExchange)?;
        let arrays = Arrays::of(description);
        let variables = variables(description, &arrays);
        let access = Access::new(description, arrays);
        Ok(Self {
            run: ModelExchangeRun::new(instance, description, RunOptions::default()),
            abilities: abilities(description, &access),
            access,
            knowns: Knowns::of(description),
            limitation: super::limitation(description, &variables),
            variables,
            experiment: description.default_experiment.unwrap_or_default(),
            start: 0.0,
            // Assumes steps of 10 ms until the step is known.
            glance: 1e-2 * GLANCE,
            has_begun: false,
            saved: Vec::new(),
            last: Vec::new(),
        })
    }

    /// Work of the solver so far.
    pub fn work(&self) -> RunWork {
        self.run.work()
    }
}

/// Capabilities from the model description.
pub(super) fn abilities(description: &ModelDescription, access: &Access) -> Abilities {
    let me = description.model_exchange.as_ref();
    Abilities {
        rollback: me.is_some_and(|me| me.can_get_and_set_fmu_state),
        serialization: me
            .is_some_and(|me| me.can_get_and_set_fmu_state && me.can_serialize_fmu_state),
        variable_steps: true,
        input_derivatives: access.has_simple_inputs(),
        output_derivatives: access.has_simple_outputs(),
        directional_derivatives: me.is_some_and(|me| me.provides_directional_derivative)
            && access.has_simple_inputs()
            && access.has_simple_outputs(),
        cuts_steps: false,
    }
}

impl Component for ModelExchangeComponent {
    fn words_of_discard(&mut self) -> Option<String> {
        self.run.instance().words_of_discard().map(str::to_owned)
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        let tolerance = experiment.tolerance.or(self.experiment.tolerance);
        if let Some(tolerance) = tolerance {
            self.run.set_tolerance(tolerance);
        }
        self.start = experiment.start;
        let (start, stop) = (experiment.start, experiment.stop);
        let stop = stop.is_finite().then_some(stop);
        self.run.set_stop(stop);
        let instance = self.run.instance();
        Ok(instance.setup_experiment(tolerance, start, stop)?)
    }

    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(self.run.instance().enter_initialization_mode()?)
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.run.instance().exit_initialization_mode()?;
        self.run.begin(self.start)?;
        self.has_begun = true;
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        if !self.has_begun {
            let instance = self.run.instance();
            return self.access.set_reals(instance, handles, values);
        }
        self.last.clear();
        self.last.extend_from_slice(values);
        if handles.iter().all(|handle| self.access.is_scalar(*handle)) {
            return Ok(self.run.set_inputs(handles, values, None)?);
        }
        // Others are held: only calls for 64-bit scalars follow lines.
        self.access
            .set_reals(self.run.event_mode()?, handles, values)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        let instance = self.run.instance();
        Ok(self.access.get_reals(instance, handles, values)?)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        let instance = match (self.has_begun, value) {
            (true, Value::Real(value)) => return self.set_reals(&[handle], &[*value]),
            (true, _) => self.run.event_mode()?,
            (false, _) => self.run.instance(),
        };
        self.access.set(instance, handle, value)
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        self.access.get(self.run.instance(), handle, kind)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.glance = GLANCE * h;
        Ok(match self.run.step_to(t + h)? {
            Reached::Target => Progress::Done,
            Reached::EndRequested(reached) => Progress::EndRequested { reached },
        })
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        self.run.next_event().filter(|&next| next > t)
    }

    fn suggested(&self) -> Suggested {
        super::suggested(&self.experiment)
    }

    fn limitation(&self) -> Option<String> {
        self.limitation.clone()
    }

    fn terminate(&mut self) -> Result<(), ComponentError> {
        Ok(self.run.instance().terminate()?)
    }

    fn abilities(&self) -> Abilities {
        self.abilities
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        if self.saved.len() <= place {
            self.saved.resize(place + 1, None);
        }
        let old = self.saved[place].take();
        self.saved[place] = Some(self.run.save(old)?);
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        match self.saved.get(place) {
            Some(Some(saved)) => Ok(self.run.restore(saved)?),
            _ => Err(format!("no state is saved in place {place}").into()),
        }
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        let kept = (self.run.serialize()?, self.glance);
        Ok(postcard::to_stdvec(&kept)?)
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        let (kept, glance): (KeptRun, f64) = postcard::from_bytes(bytes)?;
        self.run.deserialize(&kept)?;
        self.glance = glance;
        Ok(())
    }

    /// The slopes apply to the inputs set last.
    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        Ok(self.run.set_inputs(handles, &self.last, Some(slopes))?)
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        Ok(self.run.output_slopes(handles, self.glance, slopes)?)
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        let instance = self.run.instance();
        Ok(instance.directional_derivative(outputs, inputs, seed, result)?)
    }

    fn linearize(&mut self, _step: f64) -> Result<Linear, ComponentError> {
        Ok(self.knowns.of_run(&mut self.run, &self.access)?.into())
    }
}
