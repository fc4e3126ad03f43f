//! Steps, their status, and derivatives of inputs and outputs (FMI 2.0.5, section 4.2).

use super::Fmi2;
use crate::SimulationUnit;
use crate::abi::fmi2::types::*;
use crate::abi::fmi2::{Function, State};
use crate::guard::{Component as Guarded, array, call, place};
use crate::problem::Problem;
use crate::shared;

/// `fmi2SetRealInputDerivatives`.
pub unsafe fn fmi2SetRealInputDerivatives<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *const Real,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (references, orders, values) = unsafe {
            (
                array(references, count, "valueReferences")?,
                array(orders, count, "order")?,
                array(values, count, "values")?,
            )
        };
        c.instance.set_slopes(references, orders, values)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SetRealInputDerivatives, body) }
}

/// `fmi2GetRealOutputDerivatives`.
pub unsafe fn fmi2GetRealOutputDerivatives<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *mut Real,
) -> Status {
    let function = Function::GetRealOutputDerivatives;
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe {
        shared::output_derivatives::<U, Fmi2>(
            component, function, references, count, orders, values,
        )
    }
}

/// `fmi2DoStep`. The last argument is ignored: states can be restored at any time.
pub unsafe fn fmi2DoStep<U: SimulationUnit>(
    component: Component,
    time: Real,
    step: Real,
    _no_set_state_prior_to_current_point: Boolean,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| c.instance.step(time, step, false).map(|_| ());
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::DoStep, body) }
}

/// `fmi2CancelStep`: never legal, since no step is asynchronous.
pub unsafe fn fmi2CancelStep<U: SimulationUnit>(component: Component) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe {
        call(
            component,
            Function::CancelStep,
            |_: &mut Guarded<U, Fmi2>| Ok(()),
        )
    }
}

fn no_status<T>(kind: StatusKind) -> Result<T, Problem> {
    Err(Problem::NoStatus { kind: kind.0 })
}

/// `fmi2GetStatus`: status of the last step.
pub unsafe fn fmi2GetStatus<U: SimulationUnit>(
    component: Component,
    kind: StatusKind,
    value: *mut Status,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        // SAFETY: the importer passes NULL or a pointer to the value.
        let value = unsafe { place(value, "value") }?;
        *value = match (kind, c.state) {
            (StatusKind::DO_STEP_STATUS, State::StepFailed) => Status::DISCARD,
            (StatusKind::DO_STEP_STATUS, _) => Status::OK,
            _ => return no_status(kind),
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetStatus, body) }
}

/// `fmi2GetRealStatus`: time reached by the last step.
pub unsafe fn fmi2GetRealStatus<U: SimulationUnit>(
    component: Component,
    kind: StatusKind,
    value: *mut Real,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        // SAFETY: the importer passes NULL or a pointer to the value.
        let value = unsafe { place(value, "value") }?;
        *value = match kind {
            StatusKind::LAST_SUCCESSFUL_TIME => c.instance.time(),
            _ => return no_status(kind),
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetRealStatus, body) }
}

/// `fmi2GetIntegerStatus`: the standard defines no such status.
pub unsafe fn fmi2GetIntegerStatus<U: SimulationUnit>(
    component: Component,
    kind: StatusKind,
    _value: *mut Integer,
) -> Status {
    let body = |_: &mut Guarded<U, Fmi2>| no_status(kind);
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetIntegerStatus, body) }
}

/// `fmi2GetBooleanStatus`: whether the FMU requests the end of the simulation, which models never do.
pub unsafe fn fmi2GetBooleanStatus<U: SimulationUnit>(
    component: Component,
    kind: StatusKind,
    value: *mut Boolean,
) -> Status {
    let body = |c: &mut Guarded<U, Fmi2>| {
        // SAFETY: the importer passes NULL or a pointer to the value.
        let value = unsafe { place(value, "value") }?;
        *value = match kind {
            StatusKind::TERMINATED => c.instance.is_end_requested().into(),
            _ => return no_status(kind),
        };
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetBooleanStatus, body) }
}

/// `fmi2GetStringStatus`: concerns pending steps, and no step is ever pending.
pub unsafe fn fmi2GetStringStatus<U: SimulationUnit>(
    component: Component,
    kind: StatusKind,
    _value: *mut *const Char,
) -> Status {
    let body = |_: &mut Guarded<U, Fmi2>| no_status(kind);
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetStringStatus, body) }
}
