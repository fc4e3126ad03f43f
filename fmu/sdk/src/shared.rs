//! C functions that differ between FMI 2.0 and FMI 3.0 only in their names.

use crate::guard::{Component, Version, array, array_mut, call, place, string};
use crate::instance::{Instance, check_number};
use crate::problem::{Problem, Severity};
use crate::{Equations, SimulationUnit};
use std::ffi::{c_char, c_void};

type Pointer = *mut c_void;

/// The references of scalar variables, and the value of each.
///
/// # Safety
/// As [`array`].
unsafe fn to_read<'a, T>(
    references: *const u32,
    count: usize,
    values: *const T,
    n_values: usize,
) -> Result<(&'a [u32], &'a [T]), Problem> {
    // SAFETY: guaranteed by the caller.
    let references = unsafe { array(references, count, "valueReferences")? };
    // SAFETY: as above.
    let values = unsafe { array(values, n_values, "values")? };
    check_number("nValues", n_values, count)?;
    Ok((references, values))
}

/// As [`to_read`], with values to be written.
///
/// # Safety
/// As [`array`], and [`array_mut`] for the values.
unsafe fn to_write<'a, T>(
    references: *const u32,
    count: usize,
    values: *mut T,
    n_values: usize,
) -> Result<(&'a [u32], &'a mut [T]), Problem> {
    // SAFETY: guaranteed by the caller.
    let references = unsafe { array(references, count, "valueReferences")? };
    // SAFETY: as above.
    let values = unsafe { array_mut(values, n_values, "values")? };
    check_number("nValues", n_values, count)?;
    Ok((references, values))
}

/// Values of real variables.
///
/// # Safety
/// `component` as for [`call`]; the pointers are NULL or point to `count` elements.
pub unsafe fn get<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *mut f64,
    n_values: usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_write(references, count, values, n_values)? };
        c.instance.get(references, values)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Sets real variables.
///
/// # Safety
/// As [`get`].
pub unsafe fn set<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *const f64,
    n_values: usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_read(references, count, values, n_values)? };
        let now = c.phase();
        c.instance.set(references, values, now)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Values of Boolean variables; `B` is their type in C.
///
/// # Safety
/// As [`get`].
pub unsafe fn get_booleans<U: SimulationUnit, V: Version, B: From<bool>>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *mut B,
    n_values: usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_write(references, count, values, n_values)? };
        for (reference, value) in references.iter().zip(values) {
            *value = c.instance.get_boolean(*reference)?.into();
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Sets Boolean variables; any value other than 0 is true.
///
/// # Safety
/// As [`get`].
pub unsafe fn set_booleans<U: SimulationUnit, V: Version, B: Copy + Default + PartialEq>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *const B,
    n_values: usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_read(references, count, values, n_values)? };
        let now = c.phase();
        for (reference, value) in references.iter().zip(values) {
            let value = *value != B::default();
            c.instance.set_boolean(*reference, value, now)?;
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Integers and enumerations; `I` is their type in C. Units without any refuse the call as [`no_variables`].
///
/// # Safety
/// As [`get`].
pub unsafe fn get_integers<U: SimulationUnit, V: Version, I: TryFrom<i64>>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *mut I,
    n_values: usize,
    types: [&'static str; 2],
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_write(references, count, values, n_values)? };
        for (reference, value) in references.iter().zip(values) {
            let found = c.instance.get_integer(*reference)?;
            *value = I::try_from(found).map_err(|_| Problem::Inside {
                severity: Severity::Error,
                message: format!("{found} (value reference {reference}) is no {}", types[0]),
            })?;
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call_of_type(component, function, count, types, body) }
}

/// Sets integers and enumerations.
///
/// # Safety
/// As [`get`].
pub unsafe fn set_integers<U: SimulationUnit, V: Version, I: Copy + Into<i64>>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *const I,
    n_values: usize,
    types: [&'static str; 2],
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_read(references, count, values, n_values)? };
        let now = c.phase();
        for (reference, value) in references.iter().zip(values) {
            c.instance.set_integer(*reference, (*value).into(), now)?;
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call_of_type(component, function, count, types, body) }
}

/// Strings; they live until the next call that asks for strings (FMI 2.0.5, section 2.1.7; FMI 3.0, section 2.2.6).
///
/// # Safety
/// As [`get`].
pub unsafe fn get_strings<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *mut *const c_char,
    n_values: usize,
    types: [&'static str; 2],
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_write(references, count, values, n_values)? };
        let found = references.iter().map(|own| c.instance.get_string(*own));
        c.strings = found.collect::<Result<_, Problem>>()?;
        for (value, own) in values.iter_mut().zip(&c.strings) {
            *value = own.as_ptr();
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call_of_type(component, function, count, types, body) }
}

/// Sets strings.
///
/// # Safety
/// As [`get`]; the values are NULL or C strings.
pub unsafe fn set_strings<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    values: *const *const c_char,
    n_values: usize,
    types: [&'static str; 2],
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, values) = unsafe { to_read(references, count, values, n_values)? };
        let now = c.phase();
        for (reference, value) in references.iter().zip(values) {
            // SAFETY: guaranteed by the caller.
            let value = unsafe { string(*value, "value") }?.to_string_lossy();
            c.instance.set_string(*reference, &value, now)?;
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call_of_type(component, function, count, types, body) }
}

/// As [`call`], for a type that only some units have.
///
/// # Safety
/// As [`call`].
unsafe fn call_of_type<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    count: usize,
    types: [&'static str; 2],
    body: impl FnOnce(&mut Component<U, V>) -> Result<(), Problem>,
) -> V::Status {
    // SAFETY: guaranteed by the caller.
    unsafe {
        match U::HAS_ALL_TYPES {
            true => call(component, function, body),
            false => no_variables::<U, V>(component, function, count, types),
        }
    }
}

/// Variables of a type that no variable has: a call for zero variables is allowed.
///
/// # Safety
/// `component` as for [`call`].
pub unsafe fn no_variables<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    count: usize,
    [base_type, used]: [&'static str; 2],
) -> V::Status {
    let body = |_: &mut Component<U, V>| match count {
        0 => Ok(()),
        _ => Err(Problem::NoSuchType {
            base_type,
            used,
            count,
        }),
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Writes a vector with one element for each state or event indicator.
///
/// # Safety
/// `component` as for [`call`]; `values` is NULL or points to `count` elements.
pub unsafe fn vector<E: Equations, V: Version>(
    component: Pointer,
    function: V::Function,
    values: *mut f64,
    count: usize,
    write: impl FnOnce(&Instance<E>, &mut [f64]) -> Result<(), Problem>,
) -> V::Status {
    let body = |c: &mut Component<Instance<E>, V>| {
        // SAFETY: guaranteed by the caller.
        let values = unsafe { array_mut(values, count, "values") }?;
        write(&c.instance, values)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Model exchange: sets the states.
///
/// # Safety
/// `component` as for [`call`]; `values` is NULL or points to `count` elements.
pub unsafe fn set_states<E: Equations, V: Version>(
    component: Pointer,
    function: V::Function,
    values: *const f64,
    count: usize,
) -> V::Status {
    let body = |c: &mut Component<Instance<E>, V>| {
        // SAFETY: guaranteed by the caller.
        let values = unsafe { array(values, count, "x") }?;
        c.instance.set_states(values)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Direction of partial derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// A seed for each known, a result for each unknown.
    Forward,
    /// A seed for each unknown, a result for each known.
    Adjoint,
}

/// Value references of unknowns and knowns, seeds and results, each with its length.
#[derive(Debug, Clone, Copy)]
pub struct Partial {
    /// The unknowns.
    pub unknowns: (*const u32, usize),
    /// The knowns.
    pub knowns: (*const u32, usize),
    /// The seed.
    pub seed: (*const f64, usize),
    /// Buffer for the results.
    pub result: (*mut f64, usize),
}

/// Partial derivatives in the direction of a seed.
///
/// # Safety
/// `component` as for [`call`]; each pointer of `partial` is NULL or points to that number of elements.
pub unsafe fn derivative<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    direction: Direction,
    partial: Partial,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (unknowns, knowns, seed, result) = unsafe {
            (
                array(partial.unknowns.0, partial.unknowns.1, "unknowns")?,
                array(partial.knowns.0, partial.knowns.1, "knowns")?,
                array(partial.seed.0, partial.seed.1, "seed")?,
                array_mut(partial.result.0, partial.result.1, "sensitivity")?,
            )
        };
        let (n_seed, n_result) = match direction {
            Direction::Forward => (knowns.len(), unknowns.len()),
            Direction::Adjoint => (unknowns.len(), knowns.len()),
        };
        check_number("nSeed", seed.len(), n_seed)?;
        check_number("nSensitivity", result.len(), n_result)?;
        let (i, at) = (&c.instance, c.phase());
        match direction {
            Direction::Forward => i.directional_derivative(unknowns, knowns, seed, result, at),
            Direction::Adjoint => i.adjoint_derivative(unknowns, knowns, seed, result, at),
        }
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Time derivatives of outputs.
///
/// # Safety
/// `component` as for [`call`]; the pointers are NULL or point to `count` elements.
pub unsafe fn output_derivatives<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    references: *const u32,
    count: usize,
    orders: *const i32,
    values: *mut f64,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (references, orders, values) = unsafe {
            (
                array(references, count, "valueReferences")?,
                array(orders, count, "order")?,
                array_mut(values, count, "values")?,
            )
        };
        c.instance.get_slopes(references, orders, values)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Takes a copy of an instance.
///
/// # Safety
/// `component` as for [`call`]; `state` is NULL, or points to NULL or to a state of this library.
pub unsafe fn get_state<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    state: *mut Pointer,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let slot = unsafe { place(state, "FMUstate") }?;
        // SAFETY: according to the standard it holds NULL or a state of this FMU, which is then overwritten.
        match unsafe { slot.cast::<U::State>().as_mut() } {
            Some(checkpoint) => *checkpoint = c.checkpoint()?,
            None => *slot = Box::into_raw(Box::new(c.checkpoint()?)).cast(),
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Restores a copy.
///
/// # Safety
/// `component` as for [`call`]; `state` is NULL or a state of this library.
pub unsafe fn set_state<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    state: Pointer,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let checkpoint = unsafe { place(state.cast::<U::State>(), "FMUstate") }?;
        c.restore(checkpoint)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Frees a copy and writes NULL back.
///
/// # Safety
/// As [`get_state`]; the state must not be used afterwards.
pub unsafe fn free_state<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    state: *mut Pointer,
) -> V::Status {
    let body = |_: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        if let Some(slot) = unsafe { state.as_mut() }
            && !slot.is_null()
        {
            // SAFETY: it came from `Box::into_raw` in `get_state` or `deserialize`.
            drop(unsafe { Box::from_raw(slot.cast::<U::State>()) });
            *slot = std::ptr::null_mut();
        }
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Number of bytes of a copy.
///
/// # Safety
/// As [`set_state`]; `size` is NULL or a valid pointer.
pub unsafe fn state_size<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    state: Pointer,
    size: *mut usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (checkpoint, size) = unsafe {
            (
                place(state.cast::<U::State>(), "FMUstate")?,
                place(size, "size")?,
            )
        };
        *size = c.instance.to_bytes(checkpoint)?.len();
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Writes a copy as bytes.
///
/// # Safety
/// As [`set_state`]; `bytes` is NULL or points to `size` bytes.
pub unsafe fn serialize<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    state: Pointer,
    bytes: *mut u8,
    size: usize,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (checkpoint, target) = unsafe {
            (
                place(state.cast::<U::State>(), "FMUstate")?,
                array_mut(bytes, size, "serializedState")?,
            )
        };
        let source = c.instance.to_bytes(checkpoint)?;
        let needed = source.len();
        let target = target.get_mut(..needed).ok_or(Problem::NoSpace {
            found: size,
            needed,
        })?;
        target.copy_from_slice(&source);
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}

/// Makes a copy from bytes.
///
/// # Safety
/// `component` as for [`call`]; `bytes` is NULL or points to `size` bytes, `state` is NULL or a valid pointer.
pub unsafe fn deserialize<U: SimulationUnit, V: Version>(
    component: Pointer,
    function: V::Function,
    bytes: *const u8,
    size: usize,
    state: *mut Pointer,
) -> V::Status {
    let body = |c: &mut Component<U, V>| {
        // SAFETY: guaranteed by the caller.
        let (bytes, slot) = unsafe {
            (
                array(bytes, size, "serializedState")?,
                place(state, "FMUstate")?,
            )
        };
        let checkpoint = c.instance.read_bytes(bytes)?;
        c.state_of(&checkpoint)?;
        *slot = Box::into_raw(Box::new(checkpoint)).cast();
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { call(component, function, body) }
}
