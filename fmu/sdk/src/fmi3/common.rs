//! Values, dependencies, FMU states and derivatives (FMI 3.0, sections 2.2.4 to 2.2.11).

use super::Fmi3;
use crate::SimulationUnit;
use crate::abi::fmi3::Function;
use crate::abi::fmi3::types::*;
use crate::guard::{Component, array_mut, call, place};
use crate::instance::check_number;
use crate::shared::{self, Direction, Partial};

/// `fmi3GetFloat64`.
pub unsafe fn fmi3GetFloat64<U: SimulationUnit>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut Float64,
    n_values: usize,
) -> Status {
    let function = Function::GetFloat64;
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::get::<U, Fmi3>(instance, function, references, count, values, n_values) }
}

/// `fmi3SetFloat64`.
pub unsafe fn fmi3SetFloat64<U: SimulationUnit>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const Float64,
    n_values: usize,
) -> Status {
    let function = Function::SetFloat64;
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe { shared::set::<U, Fmi3>(instance, function, references, count, values, n_values) }
}

/// `fmi3GetBoolean`.
pub unsafe fn fmi3GetBoolean<U: SimulationUnit>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut Boolean,
    n_values: usize,
) -> Status {
    let (function, values) = (Function::GetBoolean, values.cast::<u8>());
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says; a Boolean is a byte.
    unsafe {
        shared::get_booleans::<U, Fmi3, _>(instance, function, references, count, values, n_values)
    }
}

/// `fmi3SetBoolean`.
pub unsafe fn fmi3SetBoolean<U: SimulationUnit>(
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
        shared::set_booleans::<U, Fmi3, _>(instance, function, references, count, values, n_values)
    }
}

/// Get and set functions of the types that models lack.
macro_rules! others {
    ($($function:ident, $variant:ident, $shared:ident($($more:tt)?), $base_type:literal, $values:ty;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<U: SimulationUnit>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            values: $values,
            n_values: usize,
        ) -> Status {
            let (function, types) = (Function::$variant, [$base_type, "Float64"]);
            // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
            unsafe {
                shared::$shared::<U, Fmi3 $(, $more)?>(
                    instance, function, references, count, values, n_values, types,
                )
            }
        }
    )*};
}

others! {
    fmi3GetInt64, GetInt64, get_integers(_), "Int64", *mut Int64;
    fmi3GetString, GetString, get_strings(), "String", *mut String;
    fmi3SetInt64, SetInt64, set_integers(_), "Int64", *const Int64;
    fmi3SetString, SetString, set_strings(), "String", *const String;
}

/// `fmi3GetNumberOfVariableDependencies`.
pub unsafe fn fmi3GetNumberOfVariableDependencies<U: SimulationUnit>(
    instance: Instance,
    reference: ValueReference,
    count: *mut usize,
) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
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
pub unsafe fn fmi3GetVariableDependencies<U: SimulationUnit>(
    instance: Instance,
    dependent: ValueReference,
    dependent_elements: *mut usize,
    independents: *mut ValueReference,
    independent_elements: *mut usize,
    kinds: *mut DependencyKind,
    count: usize,
) -> Status {
    let body = |c: &mut Component<U, Fmi3>| {
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
pub unsafe fn fmi3GetFMUState<U: SimulationUnit>(
    instance: Instance,
    state: *mut FmuState,
) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::get_state::<U, Fmi3>(instance, Function::GetFmuState, state) }
}

/// `fmi3SetFMUState`.
pub unsafe fn fmi3SetFMUState<U: SimulationUnit>(instance: Instance, state: FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and its state.
    unsafe { shared::set_state::<U, Fmi3>(instance, Function::SetFmuState, state) }
}

/// `fmi3FreeFMUState`.
pub unsafe fn fmi3FreeFMUState<U: SimulationUnit>(
    instance: Instance,
    state: *mut FmuState,
) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::free_state::<U, Fmi3>(instance, Function::FreeFmuState, state) }
}

/// `fmi3SerializedFMUStateSize`.
pub unsafe fn fmi3SerializedFMUStateSize<U: SimulationUnit>(
    instance: Instance,
    state: FmuState,
    size: *mut usize,
) -> Status {
    let function = Function::SerializedFmuStateSize;
    // SAFETY: the importer passes NULL or its instance, its state, and a valid pointer.
    unsafe { shared::state_size::<U, Fmi3>(instance, function, state, size) }
}

/// `fmi3SerializeFMUState`.
pub unsafe fn fmi3SerializeFMUState<U: SimulationUnit>(
    instance: Instance,
    state: FmuState,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let function = Function::SerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, its state, and `size` bytes.
    unsafe { shared::serialize::<U, Fmi3>(instance, function, state, bytes, size) }
}

/// `fmi3DeserializeFMUState`.
pub unsafe fn fmi3DeserializeFMUState<U: SimulationUnit>(
    instance: Instance,
    bytes: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeserializeFmuState;
    // SAFETY: the importer passes NULL or its instance, `size` bytes, and a valid pointer.
    unsafe { shared::deserialize::<U, Fmi3>(instance, function, bytes, size, state) }
}

/// `fmi3GetDirectionalDerivative`.
pub unsafe fn fmi3GetDirectionalDerivative<U: SimulationUnit>(
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
    unsafe { shared::derivative::<U, Fmi3>(instance, function, direction, partial) }
}

/// `fmi3GetAdjointDerivative`.
pub unsafe fn fmi3GetAdjointDerivative<U: SimulationUnit>(
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
    unsafe { shared::derivative::<U, Fmi3>(instance, function, direction, partial) }
}

/// `fmi3GetOutputDerivatives`.
pub unsafe fn fmi3GetOutputDerivatives<U: SimulationUnit>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    orders: *const Int32,
    values: *mut Float64,
    n_values: usize,
) -> Status {
    let function = Function::GetOutputDerivatives;
    if n_values != count {
        let body = |_: &mut Component<U, Fmi3>| check_number("nValues", n_values, count);
        // SAFETY: the importer passes NULL or its instance.
        return unsafe { call(instance, function, body) };
    }
    // SAFETY: the importer passes NULL or its instance, and as many elements as it says.
    unsafe {
        shared::output_derivatives::<U, Fmi3>(instance, function, references, count, orders, values)
    }
}
