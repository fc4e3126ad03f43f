//! Events, steps and model exchange (FMI 3.0, sections 2.3, 3.2 and 4.2).

use super::Fmi3;
use crate::abi::fmi3::types::*;
use crate::abi::fmi3::{Function, State};
use crate::guard::{Component, call, place};
use crate::instance::{Instance as Model, InterfaceType};
use crate::problem::Problem;
use crate::shared;
use crate::{Equations, SimulationUnit};

/// Enters a mode.
unsafe fn enter<U: SimulationUnit>(instance: Instance, function: Function, mode: State) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        if c.instance.kind() == InterfaceType::CoSimulation && !c.events.event_mode {
            return Err(Problem::NotSupported(
                "there is no event mode, since the instance was made with eventModeUsed = fmi3False",
            ));
        }
        c.state = mode;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, function, body) }
}

/// `fmi3EnterEventMode`.
pub unsafe fn fmi3EnterEventMode<U: SimulationUnit>(instance: Instance) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { enter::<U>(instance, Function::EnterEventMode, State::EventMode) }
}

/// `fmi3EnterStepMode`.
pub unsafe fn fmi3EnterStepMode<U: SimulationUnit>(instance: Instance) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { enter::<U>(instance, Function::EnterStepMode, State::StepMode) }
}

/// `fmi3EnterContinuousTimeMode`.
pub unsafe fn fmi3EnterContinuousTimeMode<E: Equations>(instance: Instance) -> Status {
    let function = Function::EnterContinuousTimeMode;
    // SAFETY: the importer passes NULL or its instance.
    unsafe { enter::<Model<E>>(instance, function, State::ContinuousTimeMode) }
}

/// `fmi3EvaluateDiscreteStates`: outputs are computed on request.
pub unsafe fn fmi3EvaluateDiscreteStates<U: SimulationUnit>(instance: Instance) -> Status {
    let body = |_: &mut Component<U, Fmi3>| Ok(());
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::EvaluateDiscreteStates, body) }
}

/// `fmi3UpdateDiscreteStates`: handles the event. One call suffices.
pub unsafe fn fmi3UpdateDiscreteStates<U: SimulationUnit>(
    instance: Instance,
    needs_update: *mut Boolean,
    terminate: *mut Boolean,
    nominals_changed: *mut Boolean,
    values_changed: *mut Boolean,
    next_event_defined: *mut Boolean,
    next_event: *mut Float64,
) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
        // SAFETY: the importer passes NULL or pointers to the results.
        let (flags, values_changed, next_event) = unsafe {
            (
                [
                    place(needs_update, "discreteStatesNeedUpdate")?,
                    place(terminate, "terminateSimulation")?,
                    place(nominals_changed, "nominalsOfContinuousStatesChanged")?,
                    place(next_event_defined, "nextEventTimeDefined")?,
                ],
                place(values_changed, "valuesOfContinuousStatesChanged")?,
                place(next_event, "nextEventTime")?,
            )
        };
        *values_changed = c.instance.handle_event()?;
        let next = c.instance.next_event();
        let [.., has_next] = flags.map(|flag| {
            *flag = false;
            flag
        });
        *has_next = next.is_some();
        *next_event = next.unwrap_or(0.0);
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::UpdateDiscreteStates, body) }
}

/// Asks the importer, if it wants intermediate updates, for the inputs at the end of a step; they change linearly
/// within the step.
///
/// # Safety
/// `instance` as for [`call`].
unsafe fn ask_inputs<U: SimulationUnit>(
    instance: Instance,
    time: Float64,
    step: Float64,
) -> Status {
    let function = Function::DoStep;
    let (mut asked, mut before) = (None, Vec::new());
    let body = |c: &mut Component<U, Fmi3>| {
        asked = c.events.update.filter(|_| step > 0.0);
        if asked.is_some() {
            before = c.instance.inputs().to_vec();
            c.state = State::IntermediateUpdateMode;
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller; the same applies below.
    let status = unsafe { call(instance, function, body) };
    let Some((update, environment)) = asked else {
        return status;
    };
    let (mut wants_return, mut return_time) = (false, 0.0);
    let (may_set, may_get, is_finished, may_return) = (true, false, false, false);
    // SAFETY: the function and its first argument come from the importer, which keeps them until it frees the instance;
    // both results outlive the call. No reference to the instance exists during the call, so that the importer may call
    // the instance's functions from the callback.
    unsafe {
        update(
            environment,
            time + step,
            may_set,
            may_get,
            is_finished,
            may_return,
            &raw mut wants_return,
            &raw mut return_time,
        );
    }
    let body = |c: &mut Component<U, Fmi3>| {
        // Unless a call from the callback has failed.
        if c.state == State::IntermediateUpdateMode {
            c.state = State::StepMode;
            c.instance.lead_inputs(&before, step)?;
        }
        Ok(())
    };
    // A function that is legal in every state in which the callback may leave the instance.
    // SAFETY: as above.
    unsafe { call(instance, Function::GetFloat64, body) }
}

/// `fmi3DoStep`: ends at the first event if the importer handles events and allows early return.
pub unsafe fn fmi3DoStep<U: SimulationUnit>(
    instance: Instance,
    time: Float64,
    step: Float64,
    _no_set_state_prior_to_current_point: Boolean,
    event_needed: *mut Boolean,
    terminate: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut Float64,
) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    let asked = unsafe { ask_inputs::<U>(instance, time, step) };
    if asked > Status::WARNING {
        return asked;
    }
    let body = |c: &mut Component<U, Fmi3>| {
        // SAFETY: the importer passes NULL or pointers to the results.
        let (event_needed, terminate, early_return, last) = unsafe {
            (
                place(event_needed, "eventHandlingNeeded")?,
                place(terminate, "terminateSimulation")?,
                place(early_return, "earlyReturn")?,
                place(last_successful_time, "lastSuccessfulTime")?,
            )
        };
        (*event_needed, *terminate, *early_return) = (false, false, false);
        let stops = c.events.event_mode && c.events.early_return;
        let result = c.instance.step(time, step, stops);
        *last = c.instance.time();
        if result.is_err() && c.instance.is_end_requested() {
            (*terminate, *early_return) = (true, *last < time + step);
            return Ok(());
        }
        let reached = result?;
        *event_needed = reached.event;
        *early_return = reached.event && *last < time + step;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::DoStep, body) }
}

/// `fmi3CompletedIntegratorStep`: has no effect.
pub unsafe fn fmi3CompletedIntegratorStep<E: Equations>(
    instance: Instance,
    _no_set_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate: *mut Boolean,
) -> Status {
    let body = |_: &mut Component<Model<E>, Fmi3>| {
        // SAFETY: the importer passes NULL or pointers to the results.
        let (enter_event_mode, terminate) = unsafe {
            (
                place(enter_event_mode, "enterEventMode")?,
                place(terminate, "terminateSimulation")?,
            )
        };
        (*enter_event_mode, *terminate) = (false, false);
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::CompletedIntegratorStep, body) }
}

/// `fmi3SetTime`.
pub unsafe fn fmi3SetTime<E: Equations>(instance: Instance, time: Float64) -> Status {
    let body = |c: &mut Component<Model<E>, Fmi3>| c.instance.set_time(time);
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::SetTime, body) }
}

/// `fmi3SetContinuousStates`.
pub unsafe fn fmi3SetContinuousStates<E: Equations>(
    instance: Instance,
    states: *const Float64,
    count: usize,
) -> Status {
    let function = Function::SetContinuousStates;
    // SAFETY: the importer passes NULL or its instance, and `count` elements.
    unsafe { shared::set_states::<E, Fmi3>(instance, function, states, count) }
}

/// The functions that read a vector.
macro_rules! vectors {
    ($($function:ident, $variant:ident, $method:ident;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<E: Equations>(
            instance: Instance,
            values: *mut Float64,
            count: usize,
        ) -> Status {
            let (function, write) = (Function::$variant, Model::$method);
            // SAFETY: the importer passes NULL or its instance, and `count` elements.
            unsafe { shared::vector::<E, Fmi3>(instance, function, values, count, write) }
        }
    )*};
}

vectors! {
    fmi3GetContinuousStateDerivatives, GetContinuousStateDerivatives, derivatives;
    fmi3GetEventIndicators, GetEventIndicators, indicators;
    fmi3GetContinuousStates, GetContinuousStates, get_states;
    fmi3GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, nominals;
}

/// The functions that return a number.
macro_rules! numbers {
    ($($function:ident, $variant:ident, $argument:literal, $count:ident;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<E: Equations>(instance: Instance, count: *mut usize) -> Status {
            let body = |c: &mut Component<Model<E>, Fmi3>| {
                // SAFETY: the importer passes NULL or a valid pointer.
                *unsafe { place(count, $argument) }? = c.instance.simulation().table().$count();
                Ok(())
            };
            // SAFETY: the importer passes NULL or its instance.
            unsafe { call(instance, Function::$variant, body) }
        }
    )*};
}

numbers! {
    fmi3GetNumberOfEventIndicators, GetNumberOfEventIndicators, "nEventIndicators", n_indicators;
    fmi3GetNumberOfContinuousStates, GetNumberOfContinuousStates, "nContinuousStates", n_states;
}
