//! Steps, their status, and derivatives of inputs and outputs (FMI 2.0.5, section 4.2).

use super::{array, array_mut, call, place};
use crate::instance::Instance;
use crate::problem::Problem;
use pilotage_abi::fmi2::functions::{Function, pointers};
use pilotage_abi::fmi2::types::*;

/// `fmi2SetRealInputDerivatives`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetRealInputDerivatives(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *const Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (references, orders, values) = unsafe {
            (
                array(references, count, "vr")?,
                array(orders, count, "order")?,
                array(values, count, "value")?,
            )
        };
        instance.set_slopes(references, orders, values)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SetRealInputDerivatives, body) }
}

/// `fmi2GetRealOutputDerivatives`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealOutputDerivatives(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *mut Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (references, orders, values) = unsafe {
            (
                array(references, count, "vr")?,
                array(orders, count, "order")?,
                array_mut(values, count, "value")?,
            )
        };
        instance.get_slopes(references, orders, values)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetRealOutputDerivatives, body) }
}

/// `fmi2DoStep`. The last argument is of no use here: states can be set back at any time.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    component: Component,
    time: Real,
    step: Real,
    _no_set_state_prior_to_current_point: Boolean,
) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::DoStep, |i| i.step(time, step)) }
}

/// `fmi2CancelStep`: never legal, since no step is asynchronous.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2CancelStep(component: Component) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::CancelStep, |_| Ok(())) }
}

/// `fmi2GetStatus`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetStatus(
    component: Component,
    kind: StatusKind,
    value: *mut Status,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or a place for the value.
        *unsafe { place(value, "value") }? = instance.step_status(kind)?;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetStatus, body) }
}

/// `fmi2GetRealStatus`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealStatus(
    component: Component,
    kind: StatusKind,
    value: *mut Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or a place for the value.
        *unsafe { place(value, "value") }? = instance.last_successful_time(kind)?;
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetRealStatus, body) }
}

/// `fmi2GetIntegerStatus`: the standard defines none.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetIntegerStatus(
    component: Component,
    kind: StatusKind,
    _value: *mut Integer,
) -> Status {
    let body = |_: &mut Instance| Err(Problem::NoStatus { kind });
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetIntegerStatus, body) }
}

/// `fmi2GetBooleanStatus`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBooleanStatus(
    component: Component,
    kind: StatusKind,
    value: *mut Boolean,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or a place for the value.
        *unsafe { place(value, "value") }? = instance.wants_to_end(kind)?.into();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetBooleanStatus, body) }
}

/// `fmi2GetStringStatus`: it is about pending steps, and no step is ever pending.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetStringStatus(
    component: Component,
    kind: StatusKind,
    _value: *mut *const Char,
) -> Status {
    let body = |_: &mut Instance| Err(Problem::NoStatus { kind });
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetStringStatus, body) }
}

// The compiler checks that these functions have the types of the standard.
const _: pointers::SetRealInputDerivatives = fmi2SetRealInputDerivatives;
const _: pointers::GetRealOutputDerivatives = fmi2GetRealOutputDerivatives;
const _: pointers::DoStep = fmi2DoStep;
const _: pointers::CancelStep = fmi2CancelStep;
const _: pointers::GetStatus = fmi2GetStatus;
const _: pointers::GetRealStatus = fmi2GetRealStatus;
const _: pointers::GetIntegerStatus = fmi2GetIntegerStatus;
const _: pointers::GetBooleanStatus = fmi2GetBooleanStatus;
const _: pointers::GetStringStatus = fmi2GetStringStatus;
