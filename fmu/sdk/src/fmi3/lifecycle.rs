//! Version, creation and destruction (FMI 3.0, section 2.3).

use super::Fmi3;
use crate::abi::fmi3::types::*;
use crate::abi::fmi3::{Function, State};
use crate::guard::{self, Component, Events, string, strings};
use crate::instance::{Experiment, InterfaceType};
use crate::log::{Log, Sink};
use crate::problem::Problem;
use crate::{Load, SimulationUnit};

/// `fmi3GetVersion`.
pub unsafe fn fmi3GetVersion<U: SimulationUnit>() -> *const Char {
    VERSION.as_ptr()
}

/// `fmi3SetDebugLogging`.
pub unsafe fn fmi3SetDebugLogging<U: SimulationUnit>(
    instance: Instance,
    on: Boolean,
    count: usize,
    categories: *const String,
) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        // SAFETY: the importer passes NULL or `count` strings.
        let names = unsafe { strings(categories, count, "categories") }?;
        c.log.switch(on, &names)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(instance, Function::SetDebugLogging, body) }
}

/// Arguments that all kinds of instances have in common.
struct Order {
    function: Function,
    name: String,
    token: String,
    location: String,
    logging: bool,
    environment: InstanceEnvironment,
    logger: Option<LogMessageCallback>,
}

impl Order {
    /// Creates the instance.
    ///
    /// # Safety
    /// The strings are NULL or C strings.
    unsafe fn carry_out<U: SimulationUnit>(
        self,
        load: Load<U>,
        kind: Result<InterfaceType, Problem>,
        events: Events,
    ) -> Instance {
        // SAFETY: guaranteed by the caller.
        let name = unsafe { string(self.name, "instanceName") };
        let sink = Sink::Fmi3(self.logger, self.environment);
        let log = Log::new(sink, name.as_ref().unwrap_or(&c""), self.logging);
        let create = || {
            let kind = kind?;
            // SAFETY: guaranteed by the caller.
            let (token, location) = unsafe {
                (
                    string(self.token, "instantiationToken")?,
                    string(self.location, "").ok(),
                )
            };
            let fingerprint = ("instantiationToken", token);
            guard::create(load, name, kind, fingerprint, location)
        };
        guard::instantiate::<U, Fmi3>(self.function, log, State::Instantiated, events, create)
    }
}

/// `fmi3InstantiateModelExchange`.
pub unsafe fn fmi3InstantiateModelExchange<U: SimulationUnit>(
    load: Load<U>,
    name: String,
    token: String,
    location: String,
    _visible: Boolean,
    logging: Boolean,
    environment: InstanceEnvironment,
    logger: Option<LogMessageCallback>,
) -> Instance {
    let order = Order {
        function: Function::InstantiateModelExchange,
        name,
        token,
        location,
        logging,
        environment,
        logger,
    };
    // SAFETY: the importer passes NULL or C strings.
    unsafe { order.carry_out(load, Ok(InterfaceType::ModelExchange), Events::default()) }
}

/// `fmi3InstantiateCoSimulation`. An importer that lists no variables for intermediate updates gets no updates.
pub unsafe fn fmi3InstantiateCoSimulation<U: SimulationUnit>(
    load: Load<U>,
    name: String,
    token: String,
    location: String,
    _visible: Boolean,
    logging: Boolean,
    event_mode: Boolean,
    early_return: Boolean,
    _required: *const ValueReference,
    n_required: usize,
    environment: InstanceEnvironment,
    logger: Option<LogMessageCallback>,
    intermediate_update: Option<IntermediateUpdateCallback>,
) -> Instance {
    let order = Order {
        function: Function::InstantiateCoSimulation,
        name,
        token,
        location,
        logging,
        environment,
        logger,
    };
    let events = Events {
        event_mode,
        early_return,
        update: (intermediate_update.filter(|_| n_required > 0))
            .map(|callback| (callback, environment)),
    };
    // SAFETY: the importer passes NULL or C strings.
    unsafe { order.carry_out(load, Ok(InterfaceType::CoSimulation), events) }
}

/// `fmi3InstantiateScheduledExecution`: returns NULL, since no model has partitions.
pub unsafe fn fmi3InstantiateScheduledExecution<U: SimulationUnit>(
    load: Load<U>,
    name: String,
    token: String,
    location: String,
    _visible: Boolean,
    logging: Boolean,
    environment: InstanceEnvironment,
    logger: Option<LogMessageCallback>,
    _clock_update: Option<ClockUpdateCallback>,
    _lock: Option<PreemptionCallback>,
    _unlock: Option<PreemptionCallback>,
) -> Instance {
    let order = Order {
        function: Function::InstantiateScheduledExecution,
        name,
        token,
        location,
        logging,
        environment,
        logger,
    };
    let kind = Err(Problem::NotSupported(
        "this FMU is for co-simulation and model exchange; call fmi3InstantiateCoSimulation or \
         fmi3InstantiateModelExchange",
    ));
    // SAFETY: the importer passes NULL or C strings.
    unsafe { order.carry_out(load, kind, Events::default()) }
}

/// `fmi3FreeInstance`: frees in every state, to avoid leaks.
pub unsafe fn fmi3FreeInstance<U: SimulationUnit>(instance: Instance) {
    // SAFETY: the importer passes NULL or its instance, and does not use it afterwards.
    unsafe { guard::free::<U, Fmi3>(instance) }
}

/// `fmi3EnterInitializationMode`.
pub unsafe fn fmi3EnterInitializationMode<U: SimulationUnit>(
    instance: Instance,
    tolerance_defined: Boolean,
    tolerance: Float64,
    start: Float64,
    stop_defined: Boolean,
    stop: Float64,
) -> Status {
    let experiment = Experiment {
        tolerance: tolerance_defined.then_some(tolerance),
        start,
        stop: stop_defined.then_some(stop),
    };
    let body = |c: &mut Component<U, Fmi3>| {
        c.instance.setup(experiment)?;
        c.instance.enter_initialization()?;
        c.state = State::InitializationMode;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(instance, Function::EnterInitializationMode, body) }
}

/// `fmi3ExitInitializationMode`: if the importer handles no events, an event that is pending from the start is handled
/// here.
pub unsafe fn fmi3ExitInitializationMode<U: SimulationUnit>(instance: Instance) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        c.instance.exit_initialization()?;
        c.state = match c.instance.kind() == InterfaceType::ModelExchange || c.events.event_mode {
            true => State::EventMode,
            false => {
                c.instance.handle_event()?;
                State::StepMode
            }
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(instance, Function::ExitInitializationMode, body) }
}

/// `fmi3Terminate`.
pub unsafe fn fmi3Terminate<U: SimulationUnit>(instance: Instance) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        c.instance.terminate()?;
        c.state = State::Terminated;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(instance, Function::Terminate, body) }
}

/// `fmi3Reset`: restores the state after instantiation.
pub unsafe fn fmi3Reset<U: SimulationUnit>(instance: Instance) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        c.instance.reset()?;
        c.state = State::Instantiated;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(instance, Function::Reset, body) }
}
