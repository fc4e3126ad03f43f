//! Values, FMU states and directional derivatives (FMI 2.0.5, sections 2.1.7 to 2.1.9).

use super::Fmi2;
use crate::Equations;
use crate::abi::fmi2::Function;
use crate::abi::fmi2::types::*;
use crate::shared::{self, Direction, Partial};

/// `fmi2GetReal`.
pub unsafe fn fmi2GetReal<E: Equations>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Real,
) -> Status {
    let function = Function::GetReal;
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::get::<E, Fmi2>(component, function, references, count, values, count) }
}

/// `fmi2SetReal`.
pub unsafe fn fmi2SetReal<E: Equations>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Real,
) -> Status {
    let function = Function::SetReal;
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::set::<E, Fmi2>(component, function, references, count, values, count) }
}

/// `fmi2GetBoolean`.
pub unsafe fn fmi2GetBoolean<E: Equations>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Boolean,
) -> Status {
    let (function, n) = (Function::GetBoolean, count);
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::get_booleans::<E, Fmi2, _>(component, function, references, n, values, n) }
}

/// `fmi2SetBoolean`.
pub unsafe fn fmi2SetBoolean<E: Equations>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Boolean,
) -> Status {
    let (function, n) = (Function::SetBoolean, count);
    // SAFETY: the importer passes NULL or its instance, and `count` elements each.
    unsafe { shared::set_booleans::<E, Fmi2, _>(component, function, references, n, values, n) }
}

/// Get and set functions of the types for which there are no variables.
macro_rules! no_variables {
    ($($function:ident, $variant:ident, $base_type:literal, $values:ty;)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<E: Equations>(
            component: Component,
            _references: *const ValueReference,
            count: usize,
            _values: $values,
        ) -> Status {
            let types = [$base_type, "Real"];
            // SAFETY: the importer passes NULL or its instance.
            unsafe { shared::no_variables::<E, Fmi2>(component, Function::$variant, count, types) }
        }
    )*};
}

no_variables! {
    fmi2GetInteger, GetInteger, "Integer", *mut Integer;
    fmi2GetString, GetString, "String", *mut *const Char;
    fmi2SetInteger, SetInteger, "Integer", *const Integer;
    fmi2SetString, SetString, "String", *const *const Char;
}

/// `fmi2GetFMUstate`.
pub unsafe fn fmi2GetFMUstate<E: Equations>(component: Component, state: *mut FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::get_state::<E, Fmi2>(component, Function::GetFmuState, state) }
}

/// `fmi2SetFMUstate`.
pub unsafe fn fmi2SetFMUstate<E: Equations>(component: Component, state: FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and its state.
    unsafe { shared::set_state::<E, Fmi2>(component, Function::SetFmuState, state) }
}

/// `fmi2FreeFMUstate`.
pub unsafe fn fmi2FreeFMUstate<E: Equations>(component: Component, state: *mut FmuState) -> Status {
    // SAFETY: the importer passes NULL or its instance, and a pointer to NULL or its state.
    unsafe { shared::free_state::<E, Fmi2>(component, Function::FreeFmuState, state) }
}

/// `fmi2SerializedFMUstateSize`.
pub unsafe fn fmi2SerializedFMUstateSize<E: Equations>(
    component: Component,
    state: FmuState,
    size: *mut usize,
) -> Status {
    let function = Function::SerializedFmuStateSize;
    // SAFETY: the importer passes NULL or its instance, its state, and a valid pointer.
    unsafe { shared::state_size::<E, Fmi2>(component, function, state, size) }
}

/// `fmi2SerializeFMUstate`.
pub unsafe fn fmi2SerializeFMUstate<E: Equations>(
    component: Component,
    state: FmuState,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let function = Function::SerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, its state, and `size` bytes.
    unsafe { shared::serialize::<E, Fmi2>(component, function, state, bytes.cast(), size) }
}

/// `fmi2DeSerializeFMUstate`.
pub unsafe fn fmi2DeSerializeFMUstate<E: Equations>(
    component: Component,
    bytes: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeSerializeFmuState;
    // SAFETY: the importer passes NULL or its instance, `size` bytes, and a valid pointer.
    unsafe { shared::deserialize::<E, Fmi2>(component, function, bytes.cast(), size, state) }
}

/// `fmi2GetDirectionalDerivative`.
pub unsafe fn fmi2GetDirectionalDerivative<E: Equations>(
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
    unsafe { shared::derivative::<E, Fmi2>(component, function, direction, partial) }
}
