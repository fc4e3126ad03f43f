//! Values, FMU states and directional derivatives (FMI 2.0.5, sections 2.1.7 to 2.1.9).

use super::{array, array_mut, call, place};
use crate::checkpoint::Checkpoint;
use crate::instance::Instance;
use crate::problem::Problem;
use pilotage_abi::fmi2::functions::{Function, pointers};
use pilotage_abi::fmi2::types::*;

/// `fmi2GetReal`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (references, values) = unsafe {
            (
                array(references, count, "vr")?,
                array_mut(values, count, "value")?,
            )
        };
        instance.get(references, values)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetReal, body) }
}

/// `fmi2SetReal`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (references, values) = unsafe {
            (
                array(references, count, "vr")?,
                array(values, count, "value")?,
            )
        };
        instance.set(references, values)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SetReal, body) }
}

/// The get and set functions of the types of which this FMU has no variables: asking for none of them
/// is allowed.
macro_rules! no_variables {
    ($($function:ident, $variant:ident, $base_type:literal, $values:ty;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(
            component: Component,
            _references: *const ValueReference,
            count: usize,
            _values: $values,
        ) -> Status {
            let base_type = $base_type;
            let body = |_: &mut Instance| match count {
                0 => Ok(()),
                _ => Err(Problem::NoSuchType { base_type, count }),
            };
            // SAFETY: the importer passes NULL or its instance.
            unsafe { call(component, Function::$variant, body) }
        }

        const _: pointers::$variant = $function;
    )*};
}

no_variables! {
    fmi2GetInteger, GetInteger, "Integer", *mut Integer;
    fmi2GetBoolean, GetBoolean, "Boolean", *mut Boolean;
    fmi2GetString, GetString, "String", *mut *const Char;
    fmi2SetInteger, SetInteger, "Integer", *const Integer;
    fmi2SetBoolean, SetBoolean, "Boolean", *const Boolean;
    fmi2SetString, SetString, "String", *const *const Char;
}

/// `fmi2GetFMUstate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(component: Component, state: *mut FmuState) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or a place for the state.
        let slot = unsafe { place(state, "FMUstate") }?;
        // SAFETY: by the standard it holds NULL or a state of this FMU, which is then overwritten.
        match unsafe { slot.cast::<Checkpoint>().as_mut() } {
            Some(checkpoint) => *checkpoint = instance.checkpoint(),
            None => *slot = Box::into_raw(Box::new(instance.checkpoint())).cast(),
        }
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetFmuState, body) }
}

/// `fmi2SetFMUstate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(component: Component, state: FmuState) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or a state that it got.
        let checkpoint = unsafe { place(state.cast::<Checkpoint>(), "FMUstate") }?;
        instance.restore(checkpoint)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SetFmuState, body) }
}

/// `fmi2FreeFMUstate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(component: Component, state: *mut FmuState) -> Status {
    let body = |_: &mut Instance| {
        // SAFETY: the importer passes NULL or the place of a state.
        if let Some(slot) = unsafe { state.as_mut() }
            && !slot.is_null()
        {
            // SAFETY: it came from `Box::into_raw`, and the importer gives it up.
            drop(unsafe { Box::from_raw(slot.cast::<Checkpoint>()) });
            *slot = std::ptr::null_mut();
        }
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::FreeFmuState, body) }
}

/// `fmi2SerializedFMUstateSize`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializedFMUstateSize(
    component: Component,
    state: FmuState,
    size: *mut usize,
) -> Status {
    let body = |_: &mut Instance| {
        // SAFETY: the importer passes NULL or a state that it got, and NULL or a place for the size.
        let (checkpoint, size) = unsafe {
            (
                place(state.cast::<Checkpoint>(), "FMUstate")?,
                place(size, "size")?,
            )
        };
        *size = checkpoint.to_bytes().len();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SerializedFmuStateSize, body) }
}

/// `fmi2SerializeFMUstate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializeFMUstate(
    component: Component,
    state: FmuState,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let body = |_: &mut Instance| {
        // SAFETY: the importer passes NULL or a state that it got, and NULL or `size` bytes.
        let (checkpoint, target) = unsafe {
            (
                place(state.cast::<Checkpoint>(), "FMUstate")?,
                array_mut(bytes.cast::<u8>(), size, "serializedState")?,
            )
        };
        let source = checkpoint.to_bytes();
        let needed = source.len();
        let target = target.get_mut(..needed).ok_or(Problem::NoSpace {
            found: size,
            needed,
        })?;
        target.copy_from_slice(&source);
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::SerializeFmuState, body) }
}

/// `fmi2DeSerializeFMUstate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DeSerializeFMUstate(
    component: Component,
    bytes: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `size` bytes, and NULL or a place for the state.
        let (bytes, slot) = unsafe {
            (
                array(bytes.cast::<u8>(), size, "serializedState")?,
                place(state, "FMUstate")?,
            )
        };
        let checkpoint = instance.deserialize(bytes)?;
        *slot = Box::into_raw(Box::new(checkpoint)).cast();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::DeSerializeFmuState, body) }
}

/// `fmi2GetDirectionalDerivative`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    component: Component,
    unknowns: *const ValueReference,
    n_unknowns: usize,
    knowns: *const ValueReference,
    n_knowns: usize,
    seed: *const Real,
    result: *mut Real,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or as many elements as there are unknowns and knowns.
        let (unknowns, knowns, seed, result) = unsafe {
            (
                array(unknowns, n_unknowns, "vUnknown_ref")?,
                array(knowns, n_knowns, "vKnown_ref")?,
                array(seed, n_knowns, "dvKnown")?,
                array_mut(result, n_unknowns, "dvUnknown")?,
            )
        };
        instance.directional_derivative(unknowns, knowns, seed, result)
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::GetDirectionalDerivative, body) }
}

// The compiler checks that these functions have the types of the standard.
const _: pointers::GetReal = fmi2GetReal;
const _: pointers::SetReal = fmi2SetReal;
const _: pointers::GetFmuState = fmi2GetFMUstate;
const _: pointers::SetFmuState = fmi2SetFMUstate;
const _: pointers::FreeFmuState = fmi2FreeFMUstate;
const _: pointers::SerializedFmuStateSize = fmi2SerializedFMUstateSize;
const _: pointers::SerializeFmuState = fmi2SerializeFMUstate;
const _: pointers::DeSerializeFmuState = fmi2DeSerializeFMUstate;
const _: pointers::GetDirectionalDerivative = fmi2GetDirectionalDerivative;
