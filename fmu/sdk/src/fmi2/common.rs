//! Values, FMU states and directional derivatives (FMI 2.0.5, sections 2.1.7 to 2.1.9).

use super::Fmi2;
use crate::SimulationUnit;
use crate::abi::fmi2::Function;
use crate::abi::fmi2::types::*;
use crate::shared::{self, Direction, Partial};

/// `fmi2GetReal`.
pub unsafe fn fmi2GetReal<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Real,
) -> Status {
    let function = Function::GetReal;
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::get::<U, Fmi2>(component, function, references, count, values, count) }
}

/// `fmi2SetReal`.
pub unsafe fn fmi2SetReal<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Real,
) -> Status {
    let function = Function::SetReal;
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::set::<U, Fmi2>(component, function, references, count, values, count) }
}

/// `fmi2GetBoolean`.
pub unsafe fn fmi2GetBoolean<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Boolean,
) -> Status {
    let (function, n) = (Function::GetBoolean, count);
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::get_booleans::<U, Fmi2, _>(component, function, references, n, values, n) }
}

/// `fmi2SetBoolean`.
pub unsafe fn fmi2SetBoolean<U: SimulationUnit>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Boolean,
) -> Status {
    let (function, n) = (Function::SetBoolean, count);
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::set_booleans::<U, Fmi2, _>(component, function, references, n, values, n) }
}

/// Get and set functions of the types that models lack.
macro_rules! others {
    ($($function:ident, $variant:ident, $shared:ident($($more:tt)?), $base_type:literal, $values:ty;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<U: SimulationUnit>(
            component: Component,
            references: *const ValueReference,
            count: usize,
            values: $values,
        ) -> Status {
            let (function, types) = (Function::$variant, [$base_type, "Real"]);
            let n = count;
            // SAFETY: the importer passes NULL or its instance, and `count` elements each.
            unsafe {
                shared::$shared::<U, Fmi2 $(, $more)?>(component, function, references, count, values, n, types)
            }
        }
    )*};
}

others! {
    fmi2GetInteger, GetInteger, get_integers(_), "Integer", *mut Integer;
    fmi2GetString, GetString, get_strings(), "String", *mut *const Char;
    fmi2SetInteger, SetInteger, set_integers(_), "Integer", *const Integer;
    fmi2SetString, SetString, set_strings(), "String", *const *const Char;
}

/// `fmi2GetFMUstate`.
pub unsafe fn fmi2GetFMUstate<U: SimulationUnit>(
    component: Component,
    state: *mut FmuState,
) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::get_state::<U, Fmi2>(component, Function::GetFmuState, state) }
}

/// `fmi2SetFMUstate`.
pub unsafe fn fmi2SetFMUstate<U: SimulationUnit>(component: Component, state: FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and its state.
    unsafe { shared::set_state::<U, Fmi2>(component, Function::SetFmuState, state) }
}

/// `fmi2FreeFMUstate`.
pub unsafe fn fmi2FreeFMUstate<U: SimulationUnit>(
    component: Component,
    state: *mut FmuState,
) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::free_state::<U, Fmi2>(component, Function::FreeFmuState, state) }
}

/// `fmi2SerializedFMUstateSize`.
pub unsafe fn fmi2SerializedFMUstateSize<U: SimulationUnit>(
    component: Component,
    state: FmuState,
    size: *mut usize,
) -> Status {
    let function = Function::SerializedFmuStateSize;
    // SAFETY: the importer passes NULL or its instance, its state, and a valid pointer.
    unsafe { shared::state_size::<U, Fmi2>(component, function, state, size) }
}

/// `fmi2SerializeFMUstate`.
pub unsafe fn fmi2SerializeFMUstate<U: SimulationUnit>(
    component: Component,
    state: FmuState,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let function = Function::SerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, its state, and `size` bytes.
    unsafe { shared::serialize::<U, Fmi2>(component, function, state, bytes.cast(), size) }
}

/// `fmi2DeSerializeFMUstate`.
pub unsafe fn fmi2DeSerializeFMUstate<U: SimulationUnit>(
    component: Component,
    bytes: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeSerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, `size` bytes, and a valid pointer.
    unsafe { shared::deserialize::<U, Fmi2>(component, function, bytes.cast(), size, state) }
}

/// `fmi2GetDirectionalDerivative`.
pub unsafe fn fmi2GetDirectionalDerivative<U: SimulationUnit>(
    component: Component,
    unknowns: *const ValueReference,
    n_unknowns: usize,
    knowns: *const ValueReference,
    n_knowns: usize,
    seed: *const Real,
    result: *mut Real,
) -> Status {
    let (function, direction) = (Function::GetDirectionalDerivative, Direction::Forward);
    let partial = Partial {
        unknowns: (unknowns, n_unknowns),
        knowns: (knowns, n_knowns),
        seed: (seed, n_knowns),
        result: (result, n_unknowns),
    };
    // SAFETY: the importer passes NULL or its instance, and as many elements as unknowns and knowns.
    unsafe { shared::derivative::<U, Fmi2>(component, function, direction, partial) }
}
