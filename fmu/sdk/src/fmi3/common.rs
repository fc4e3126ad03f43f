//! Values, dependencies, FMU states and derivatives (FMI 3.0, sections 2.2.4 to 2.2.11).

use super::Fmi3;
use crate::Equations;
use crate::abi::fmi3::Function;
use crate::abi::fmi3::types::*;
use crate::guard::{Component, array_mut, call, place};
use crate::instance::check_number;
use crate::shared::{self, Direction, Partial};

/// `fmi3GetFloat64`.
pub unsafe fn fmi3GetFloat64<E: Equations>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut Float64,
    n_values: usize,
) -> Status {
    let function = Function::GetFloat64;
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::get::<E, Fmi3>(instance, function, references, count, values, n_values) }
}

/// `fmi3SetFloat64`.
pub unsafe fn fmi3SetFloat64<E: Equations>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const Float64,
    n_values: usize,
) -> Status {
    let function = Function::SetFloat64;
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::set::<E, Fmi3>(instance, function, references, count, values, n_values) }
}

/// `fmi3GetBoolean`.
pub unsafe fn fmi3GetBoolean<E: Equations>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut Boolean,
    n_values: usize,
) -> Status {
    let (function, values) = (Function::GetBoolean, values.cast::<u8>());
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says; a Boolean is a byte.
    unsafe {
        shared::get_booleans::<E, Fmi3, _>(instance, function, references, count, values, n_values)
    }
}

/// `fmi3SetBoolean`.
pub unsafe fn fmi3SetBoolean<E: Equations>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const Boolean,
    n_values: usize,
) -> Status {
    // As bytes: C may pass numbers other than 0 and 1, which a `bool` must not hold.
    let (function, values) = (Function::SetBoolean, values.cast::<u8>());
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says; a Boolean is a byte.
    unsafe {
        shared::set_booleans::<E, Fmi3, _>(instance, function, references, count, values, n_values)
    }
}

/// `fmi3GetNumberOfVariableDependencies`.
pub unsafe fn fmi3GetNumberOfVariableDependencies<E: Equations>(
    instance: Instance,
    reference: ValueReference,
    count: *mut usize,
) -> Status {
    let body = |c: &mut Component<E, Fmi3>| {
        // SAFETY: the importer passes NULL or a valid pointer.
        let count = unsafe { place(count, "nDependencies") }?;
        let (_, state) = c.phase();
        let unknown = c.instance.dependencies(reference, state)?;
        *count = unknown.dependencies.len();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::GetNumberOfVariableDependencies, body) }
}

/// `fmi3GetVariableDependencies`. All variables are scalars: element index 0 means the whole variable.
pub unsafe fn fmi3GetVariableDependencies<E: Equations>(
    instance: Instance,
    dependent: ValueReference,
    dependent_elements: *mut usize,
    independents: *mut ValueReference,
    independent_elements: *mut usize,
    kinds: *mut DependencyKind,
    count: usize,
) -> Status {
    let body = |c: &mut Component<E, Fmi3>| {
        // SAFETY: the importer passes NULL or `count` elements each.
        let (dependent_elements, independents, independent_elements, kinds) = unsafe {
            (
                array_mut(dependent_elements, count, "elementIndicesOfDependent")?,
                array_mut(independents, count, "independents")?,
                array_mut(independent_elements, count, "elementIndicesOfIndependents")?,
                array_mut(kinds, count, "dependencyKinds")?,
            )
        };
        let (_, state) = c.phase();
        let unknown = c.instance.dependencies(dependent, state)?;
        check_number("nDependencies", count, unknown.dependencies.len())?;
        dependent_elements.fill(0);
        independent_elements.fill(0);
        for (i, dependency) in unknown.dependencies.iter().enumerate() {
            independents[i] = crate::variable::reference(dependency.index);
            kinds[i] = match dependency.constant {
                true => DependencyKind::CONSTANT,
                false => DependencyKind::DEPENDENT,
            };
        }
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, Function::GetVariableDependencies, body) }
}

/// `fmi3GetFMUState`.
pub unsafe fn fmi3GetFMUState<E: Equations>(instance: Instance, state: *mut FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::get_state::<E, Fmi3>(instance, Function::GetFmuState, state) }
}

/// `fmi3SetFMUState`.
pub unsafe fn fmi3SetFMUState<E: Equations>(instance: Instance, state: FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and its state.
    unsafe { shared::set_state::<E, Fmi3>(instance, Function::SetFmuState, state) }
}

/// `fmi3FreeFMUState`.
pub unsafe fn fmi3FreeFMUState<E: Equations>(instance: Instance, state: *mut FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::free_state::<E, Fmi3>(instance, Function::FreeFmuState, state) }
}

/// `fmi3SerializedFMUStateSize`.
pub unsafe fn fmi3SerializedFMUStateSize<E: Equations>(
    instance: Instance,
    state: FmuState,
    size: *mut usize,
) -> Status {
    let function = Function::SerializedFmuStateSize;
    // SAFETY: the importer passes NULL or its instance, its state, and a valid pointer.
    unsafe { shared::state_size::<E, Fmi3>(instance, function, state, size) }
}

/// `fmi3SerializeFMUState`.
pub unsafe fn fmi3SerializeFMUState<E: Equations>(
    instance: Instance,
    state: FmuState,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let function = Function::SerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, its state, and `size` bytes.
    unsafe { shared::serialize::<E, Fmi3>(instance, function, state, bytes, size) }
}

/// `fmi3DeserializeFMUState`.
pub unsafe fn fmi3DeserializeFMUState<E: Equations>(
    instance: Instance,
    bytes: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeserializeFmuState;
    // SAFETY: the importer passes NULL or its instance, `size` bytes, and a valid pointer.
    unsafe { shared::deserialize::<E, Fmi3>(instance, function, bytes, size, state) }
}

/// `fmi3GetDirectionalDerivative`.
pub unsafe fn fmi3GetDirectionalDerivative<E: Equations>(
    instance: Instance,
    unknowns: *const ValueReference,
    n_unknowns: usize,
    knowns: *const ValueReference,
    n_knowns: usize,
    seed: *const Float64,
    n_seed: usize,
    sensitivity: *mut Float64,
    n_sensitivity: usize,
) -> Status {
    let (function, direction) = (Function::GetDirectionalDerivative, Direction::Forward);
    let partial = Partial {
        unknowns: (unknowns, n_unknowns),
        knowns: (knowns, n_knowns),
        seed: (seed, n_seed),
        result: (sensitivity, n_sensitivity),
    };
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::derivative::<E, Fmi3>(instance, function, direction, partial) }
}

/// `fmi3GetAdjointDerivative`.
pub unsafe fn fmi3GetAdjointDerivative<E: Equations>(
    instance: Instance,
    unknowns: *const ValueReference,
    n_unknowns: usize,
    knowns: *const ValueReference,
    n_knowns: usize,
    seed: *const Float64,
    n_seed: usize,
    sensitivity: *mut Float64,
    n_sensitivity: usize,
) -> Status {
    let (function, direction) = (Function::GetAdjointDerivative, Direction::Adjoint);
    let partial = Partial {
        unknowns: (unknowns, n_unknowns),
        knowns: (knowns, n_knowns),
        seed: (seed, n_seed),
        result: (sensitivity, n_sensitivity),
    };
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::derivative::<E, Fmi3>(instance, function, direction, partial) }
}

/// `fmi3GetOutputDerivatives`.
pub unsafe fn fmi3GetOutputDerivatives<E: Equations>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    orders: *const Int32,
    values: *mut Float64,
    n_values: usize,
) -> Status {
    let function = Function::GetOutputDerivatives;
    if n_values != count {
        let body = |_: &mut Component<E, Fmi3>| check_number("nValues", n_values, count);
        // SAFETY: the importer passes NULL or its instance.
        return unsafe { call(instance, function, body) };
    }
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe {
        shared::output_derivatives::<E, Fmi3>(instance, function, references, count, orders, values)
    }
}
