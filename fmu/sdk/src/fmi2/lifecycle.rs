//! Versions, creation and destruction, calling order (FMI 2.0.5, sections 2.1.4 to 2.1.6).

use super::Fmi2;
use crate::abi::fmi2::types::*;
use crate::abi::fmi2::{Function, State};
use crate::guard::{self, Component as Guarded, Events, string, strings};
use crate::instance::{Experiment, InterfaceType};
use crate::log::{Log, Sink};
use crate::problem::Problem;
use crate::{Load, SimulationUnit};

/// `fmi2GetTypesPlatform`.
pub unsafe fn fmi2GetTypesPlatform<U: SimulationUnit>() -> *const Char {
    TYPES_PLATFORM.as_ptr()
}

/// `fmi2GetVersion`.
pub unsafe fn fmi2GetVersion<U: SimulationUnit>() -> *const Char {
    VERSION.as_ptr()
}

/// `fmi2SetDebugLogging`.
pub unsafe fn fmi2SetDebugLogging<U: SimulationUnit>(
    component: Component,
    on: Boolean,
    count: usize,
    categories: *const *const Char,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        // SAFETY: the importer passes NULL or `count` strings.
        let names = unsafe { strings(categories, count, "categories") }?;
        c.log.switch(on != FALSE, &names)
    };
    // SAFETY: the importer passes NULL or its instance (FMI 2.0.5, section 2.1.5).
    unsafe { guard::call(component, Function::SetDebugLogging, body) }
}

/// `fmi2Instantiate`, for a model that `load` returns.
pub unsafe fn fmi2Instantiate<U: SimulationUnit>(
    load: Load<U>,
    name: *const Char,
    kind: Type,
    guid: *const Char,
    location: *const Char,
    callbacks: *const CallbackFunctions,
    _visible: Boolean,
    logging: Boolean,
) -> Component {
    // SAFETY: the importer passes NULL or its callbacks.
    let callbacks = unsafe { callbacks.as_ref() }.copied();
    // SAFETY: the importer passes NULL or a C string.
    let name = unsafe { string(name, "instanceName") };
    let sink = Sink::Fmi2(callbacks);
    let log = Log::new(sink, name.as_ref().unwrap_or(&c""), logging != FALSE);
    let create = || {
        let kind = match kind {
            Type::CO_SIMULATION => InterfaceType::CoSimulation,
            Type::MODEL_EXCHANGE => InterfaceType::ModelExchange,
            Type(found) => return Err(Problem::WrongType { found }),
        };
        // SAFETY: the importer passes NULL or C strings.
        let (guid, location) = unsafe { (string(guid, "fmuGUID")?, string(location, "").ok()) };
        guard::create(load, name, kind, ("fmuGUID", guid), location)
    };
    guard::instantiate::<U, Fmi2>(
        Function::Instantiate,
        log,
        State::Instantiated,
        Events::default(),
        create,
    )
}

/// `fmi2FreeInstance`: frees in every state, to avoid leaks.
pub unsafe fn fmi2FreeInstance<U: SimulationUnit>(component: Component) {
    // SAFETY: the importer passes NULL or its instance, and does not use it afterwards.
    unsafe { guard::free::<U, Fmi2>(component) }
}

/// `fmi2SetupExperiment`.
pub unsafe fn fmi2SetupExperiment<U: SimulationUnit>(
    component: Component,
    tolerance_defined: Boolean,
    tolerance: Real,
    start: Real,
    stop_defined: Boolean,
    stop: Real,
) -> Status {
    let experiment = Experiment {
        tolerance: (tolerance_defined != FALSE).then_some(tolerance),
        start,
        stop: (stop_defined != FALSE).then_some(stop),
    };
    let body = |c: &mut Guarded<U, Fmi2>| c.instance.setup(experiment);
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(component, Function::SetupExperiment, body) }
}

/// `fmi2EnterInitializationMode`.
pub unsafe fn fmi2EnterInitializationMode<U: SimulationUnit>(component: Component) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        c.instance.check_setup()?;
        c.instance.enter_initialization()?;
        c.state = State::InitializationMode;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(component, Function::EnterInitializationMode, body) }
}

/// `fmi2ExitInitializationMode`: co-simulation handles an event that is pending from the start.
pub unsafe fn fmi2ExitInitializationMode<U: SimulationUnit>(component: Component) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        c.instance.exit_initialization()?;
        c.state = match c.instance.kind() {
            InterfaceType::ModelExchange => State::EventMode,
            InterfaceType::CoSimulation => {
                c.instance.handle_event()?;
                State::StepComplete
            }
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(component, Function::ExitInitializationMode, body) }
}

/// `fmi2Terminate`.
pub unsafe fn fmi2Terminate<U: SimulationUnit>(component: Component) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        c.instance.terminate()?;
        c.state = State::Terminated;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(component, Function::Terminate, body) }
}

/// `fmi2Reset`: restores the state after instantiation.
pub unsafe fn fmi2Reset<U: SimulationUnit>(component: Component) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        c.instance.reset()?;
        c.state = State::Instantiated;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { guard::call(component, Function::Reset, body) }
}
