//! What the C functions call: one instance of an FMU, whatever is inside.

use crate::Equations;
use crate::checkpoint::Checkpoint;
use crate::instance::{Experiment, Instance, InterfaceType, Phase, References};
use crate::problem::{Problem, Severity};
use crate::simulation::Reached;
use crate::structure::Unknown;
use std::ffi::CString;

/// What may be set and asked for now, and the name of the instance's state.
pub type Now = (Phase, &'static str);

/// A message of something inside, for the importer's logger; without a severity it is an information.
pub type Message = (Option<Severity>, String);

/// One instance of an FMU, without the calling order of a version of FMI: a [model](Instance), or something else that steps
/// itself. The functions for model exchange exist for models alone.
///
/// What has a default is refused, or does nothing, where there is no such feature.
pub trait SimulationUnit: Sized {
    /// A copy of the instance, to which `fmi2FMUstate` and `fmi3FMUState` point.
    type State;

    /// Whether there may be integers, enumerations and strings; models have real and Boolean variables alone.
    const HAS_ALL_TYPES: bool = false;

    /// Purpose.
    fn kind(&self) -> InterfaceType;

    /// GUID of the FMU.
    fn guid(&self) -> &str;

    /// Sets up an experiment.
    fn setup(&mut self, experiment: Experiment) -> Result<(), Problem>;

    /// Checks that an experiment is set up.
    fn check_setup(&self) -> Result<(), Problem>;

    /// Begins initialization, where inputs and start values are set and outputs follow them.
    fn enter_initialization(&mut self) -> Result<(), Problem> {
        Ok(())
    }

    /// Ends initialization.
    fn exit_initialization(&mut self) -> Result<(), Problem> {
        Ok(())
    }

    /// Ends the simulation.
    fn terminate(&mut self) -> Result<(), Problem> {
        Ok(())
    }

    /// Restores the state after instantiation.
    fn reset(&mut self) -> Result<(), Problem>;

    /// Values of real variables.
    fn get(&mut self, references: References<'_>, values: &mut [f64]) -> Result<(), Problem>;

    /// Sets real variables.
    fn set(&mut self, references: References<'_>, values: &[f64], now: Now) -> Result<(), Problem>;

    /// Value of a Boolean variable.
    fn get_boolean(&mut self, reference: u32) -> Result<bool, Problem>;

    /// Sets a Boolean variable.
    fn set_boolean(&mut self, reference: u32, value: bool, now: Now) -> Result<(), Problem>;

    /// Value of an integer or an enumeration.
    fn get_integer(&mut self, reference: u32) -> Result<i64, Problem> {
        let _ = reference;
        no_variable("Integer")
    }

    /// Sets an integer or an enumeration.
    fn set_integer(&mut self, reference: u32, value: i64, now: Now) -> Result<(), Problem> {
        let _ = (reference, value, now);
        no_variable("Integer")
    }

    /// Value of a string.
    fn get_string(&mut self, reference: u32) -> Result<CString, Problem> {
        let _ = reference;
        no_variable("String")
    }

    /// Sets a string.
    fn set_string(&mut self, reference: u32, value: &str, now: Now) -> Result<(), Problem> {
        let _ = (reference, value, now);
        no_variable("String")
    }

    /// One step from `time` by `step` \[s\], on request only up to the first event.
    fn step(&mut self, time: f64, step: f64, stop_at_event: bool) -> Result<Reached, Problem>;

    /// Time \[s\]: the last communication point.
    fn time(&self) -> f64;

    /// Whether the last step ended early because something inside asks for the end of the simulation.
    fn is_end_requested(&self) -> bool {
        false
    }

    /// Messages since the last call.
    fn take_messages(&mut self) -> Vec<Message> {
        Vec::new()
    }

    /// A copy, with the given version of FMI and state of the calling order.
    fn checkpoint(&mut self, version: u8, state: u16) -> Result<Self::State, Problem>;

    /// Version and state with which a copy was made.
    fn origin(state: &Self::State) -> (u8, u16);

    /// Restores a copy.
    fn restore(&mut self, state: &Self::State) -> Result<(), Problem>;

    /// A copy as bytes.
    fn to_bytes(&mut self, state: &Self::State) -> Result<Vec<u8>, Problem>;

    /// A copy, from its bytes.
    fn read_bytes(&mut self, bytes: &[u8]) -> Result<Self::State, Problem>;

    /// Handles pending events. Returns whether a state has changed.
    fn handle_event(&mut self) -> Result<bool, Problem> {
        Ok(false)
    }

    /// The next time at which an event is due \[s\], after events were handled.
    fn next_event(&self) -> Option<f64> {
        None
    }

    /// Time derivatives of inputs for the next step.
    fn set_slopes(
        &mut self,
        references: References<'_>,
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Problem> {
        let _ = (orders, values);
        none_of(references, "inputs are held within a step")
    }

    /// Time derivatives of outputs at the end of the last step.
    fn get_slopes(
        &self,
        references: References<'_>,
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), Problem> {
        let _ = (orders, values);
        none_of(references, "derivatives of outputs are not known")
    }

    /// Values of the inputs.
    fn inputs(&self) -> &[f64] {
        &[]
    }

    /// Makes the inputs change linearly from `before` to their current values in the next step of `h` \[s\].
    fn lead_inputs(&mut self, before: &[f64], h: f64) -> Result<(), Problem> {
        let _ = (before, h);
        Ok(())
    }

    /// `Σ ∂unknown/∂known · seed` for each unknown.
    fn directional_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        now: Now,
    ) -> Result<(), Problem> {
        let _ = (knowns, seed, result, now);
        none_of(unknowns, "partial derivatives are not known")
    }

    /// `Σ seed · ∂unknown/∂known` for each known.
    fn adjoint_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        now: Now,
    ) -> Result<(), Problem> {
        let _ = (knowns, seed, result, now);
        none_of(unknowns, "partial derivatives are not known")
    }

    /// Dependencies of an unknown.
    fn dependencies(&self, reference: u32, state: &'static str) -> Result<&Unknown, Problem> {
        let _ = (reference, state);
        Err(Problem::NotSupported(
            "dependencies are those of modelDescription.xml",
        ))
    }
}

fn no_variable<T>(base_type: &'static str) -> Result<T, Problem> {
    Err(Problem::NoSuchType {
        base_type,
        used: "real and Boolean variables",
        count: 1,
    })
}

/// A call for no variables is allowed.
fn none_of(references: References<'_>, why: &'static str) -> Result<(), Problem> {
    match references.is_empty() {
        true => Ok(()),
        false => Err(Problem::NotSupported(why)),
    }
}

impl<E: Equations> SimulationUnit for Instance<E> {
    type State = Checkpoint;

    fn kind(&self) -> InterfaceType {
        self.kind
    }

    fn guid(&self) -> &str {
        self.guid()
    }

    fn setup(&mut self, experiment: Experiment) -> Result<(), Problem> {
        self.setup(experiment)
    }

    fn check_setup(&self) -> Result<(), Problem> {
        self.check_setup()
    }

    fn reset(&mut self) -> Result<(), Problem> {
        self.reset();
        Ok(())
    }

    fn get(&mut self, references: References<'_>, values: &mut [f64]) -> Result<(), Problem> {
        Self::get(self, references, values)
    }

    fn set(&mut self, references: References<'_>, values: &[f64], now: Now) -> Result<(), Problem> {
        self.set(references, values, now.0, now.1)
    }

    fn get_boolean(&mut self, reference: u32) -> Result<bool, Problem> {
        Self::get_boolean(self, reference)
    }

    fn set_boolean(&mut self, reference: u32, value: bool, now: Now) -> Result<(), Problem> {
        self.set_boolean(reference, value, now.0, now.1)
    }

    fn step(&mut self, time: f64, step: f64, stop_at_event: bool) -> Result<Reached, Problem> {
        self.step(time, step, stop_at_event)
    }

    fn time(&self) -> f64 {
        self.time()
    }

    fn checkpoint(&mut self, version: u8, state: u16) -> Result<Checkpoint, Problem> {
        Ok(Self::checkpoint(self, version, state))
    }

    fn origin(state: &Checkpoint) -> (u8, u16) {
        (state.version, state.state)
    }

    fn restore(&mut self, state: &Checkpoint) -> Result<(), Problem> {
        self.restore(state)
    }

    fn to_bytes(&mut self, state: &Checkpoint) -> Result<Vec<u8>, Problem> {
        Ok(state.to_bytes())
    }

    fn read_bytes(&mut self, bytes: &[u8]) -> Result<Checkpoint, Problem> {
        Checkpoint::from_bytes(bytes, self.simulation().table(), self.guid())
    }

    fn handle_event(&mut self) -> Result<bool, Problem> {
        self.handle_event()
    }

    fn next_event(&self) -> Option<f64> {
        self.next_event()
    }

    fn set_slopes(
        &mut self,
        references: References<'_>,
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Problem> {
        self.set_slopes(references, orders, values)
    }

    fn get_slopes(
        &self,
        references: References<'_>,
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), Problem> {
        self.get_slopes(references, orders, values)
    }

    fn inputs(&self) -> &[f64] {
        self.inputs()
    }

    fn lead_inputs(&mut self, before: &[f64], h: f64) -> Result<(), Problem> {
        self.lead_inputs(before, h)
    }

    fn directional_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        now: Now,
    ) -> Result<(), Problem> {
        self.directional_derivative(unknowns, knowns, seed, result, now)
    }

    fn adjoint_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        now: Now,
    ) -> Result<(), Problem> {
        self.adjoint_derivative(unknowns, knowns, seed, result, now)
    }

    fn dependencies(&self, reference: u32, state: &'static str) -> Result<&Unknown, Problem> {
        self.dependencies(reference, state)
    }
}
