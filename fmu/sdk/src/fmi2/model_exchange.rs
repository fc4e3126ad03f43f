//! Model exchange: time, states, events (FMI 2.0.5, section 3.2).

use super::Fmi2;
use crate::Equations;
use crate::abi::fmi2::types::*;
use crate::abi::fmi2::{Function, State};
use crate::guard::{Component as Guarded, call, place};
use crate::instance::Instance;
use crate::shared;

/// Enters a mode.
unsafe fn enter<E: Equations>(component: Component, function: Function, mode: State) -> Status {
    let body = |c: &mut Guarded<Instance<E>, Fmi2>| {
        c.state = mode;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, function, body) }
}

/// `fmi2EnterEventMode`.
pub unsafe fn fmi2EnterEventMode<E: Equations>(component: Component) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { enter::<E>(component, Function::EnterEventMode, State::EventMode) }
}

/// `fmi2EnterContinuousTimeMode`.
pub unsafe fn fmi2EnterContinuousTimeMode<E: Equations>(component: Component) -> Status {
    let function = Function::EnterContinuousTimeMode;
    // SAFETY: the importer passes NULL or its instance.
    unsafe { enter::<E>(component, function, State::ContinuousTimeMode) }
}

/// `fmi2NewDiscreteStates`: handles the event. One call suffices.
pub unsafe fn fmi2NewDiscreteStates<E: Equations>(
    component: Component,
    info: *mut EventInfo,
) -> Status {
    let body = |c: &mut Guarded<Instance<E>, Fmi2>| {
        // SAFETY: the importer passes NULL or a pointer to the information.
        let info = unsafe { place(info, "fmi2EventInfo") }?;
        let changed = c.instance.handle_event()?;
        let next = c.instance.next_event();
        *info = EventInfo {
            new_discrete_states_needed: FALSE,
            terminate_simulation: FALSE,
            nominals_of_continuous_states_changed: FALSE,
            values_of_continuous_states_changed: changed.into(),
            next_event_time_defined: next.is_some().into(),
            next_event_time: next.unwrap_or(0.0),
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::NewDiscreteStates, body) }
}

/// `fmi2CompletedIntegratorStep`: has no effect.
pub unsafe fn fmi2CompletedIntegratorStep<E: Equations>(
    component: Component,
    _no_set_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate: *mut Boolean,
) -> Status {
    let body = |_: &mut Guarded<Instance<E>, Fmi2>| {
        // SAFETY: the importer passes NULL or pointers to the results.
        let (enter_event_mode, terminate) = unsafe {
            (
                place(enter_event_mode, "enterEventMode")?,
                place(terminate, "terminateSimulation")?,
            )
        };
        (*enter_event_mode, *terminate) = (FALSE, FALSE);
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::CompletedIntegratorStep, body) }
}

/// `fmi2SetTime`.
pub unsafe fn fmi2SetTime<E: Equations>(component: Component, time: Real) -> Status {
    let body = |c: &mut Guarded<Instance<E>, Fmi2>| c.instance.set_time(time);
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SetTime, body) }
}

/// `fmi2SetContinuousStates`.
pub unsafe fn fmi2SetContinuousStates<E: Equations>(
    component: Component,
    states: *const Real,
    count: usize,
) -> Status {
    let function = Function::SetContinuousStates;
    // SAFETY: the importer passes NULL or its instance, and `count` elements.
    unsafe { shared::set_states::<E, Fmi2>(component, function, states, count) }
}

/// The functions that read a vector.
macro_rules! vectors {
    ($($function:ident, $variant:ident, $method:ident;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<E: Equations>(
            component: Component,
            values: *mut Real,
            count: usize,
        ) -> Status {
            let (function, write) = (Function::$variant, Instance::$method);
            // SAFETY: the importer passes NULL or its instance, and `count` elements.
            unsafe { shared::vector::<E, Fmi2>(component, function, values, count, write) }
        }
    )*};
}

vectors! {
    fmi2GetDerivatives, GetDerivatives, derivatives;
    fmi2GetEventIndicators, GetEventIndicators, indicators;
    fmi2GetContinuousStates, GetContinuousStates, get_states;
    fmi2GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, nominals;
}
