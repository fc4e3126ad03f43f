//! Functions for features that models lack: variables of other types, clocks, structural parameters, partitions.

use super::Fmi3;
use crate::SimulationUnit;
use crate::abi::fmi3::Function;
use crate::abi::fmi3::types::*;
use crate::guard::{Component, call};
use crate::problem::Problem;
use crate::shared;

/// Functions for variables of types that models lack: a call for zero variables is allowed.
macro_rules! no_variables {
    ($($function:ident, $variant:ident, $base_type:literal, ($($argument:ident: $type:ty),*);)*) => {$(
        #[doc = concat!("`", stringify!($function), "`.")]
        pub unsafe fn $function<U: SimulationUnit>(
            instance: Instance,
            _references: *const ValueReference,
            count: usize,
            $($argument: $type),*
        ) -> Status {
            let types = [$base_type, "Float64"];
            // SAFETY: the importer passes NULL or its instance.
            unsafe { shared::no_variables::<U, Fmi3>(instance, Function::$variant, count, types) }
        }
    )*};
}

no_variables! {
    fmi3GetFloat32, GetFloat32, "Float32", (_values: *mut Float32, _n: usize);
    fmi3GetInt8, GetInt8, "Int8", (_values: *mut Int8, _n: usize);
    fmi3GetUInt8, GetUInt8, "UInt8", (_values: *mut UInt8, _n: usize);
    fmi3GetInt16, GetInt16, "Int16", (_values: *mut Int16, _n: usize);
    fmi3GetUInt16, GetUInt16, "UInt16", (_values: *mut UInt16, _n: usize);
    fmi3GetInt32, GetInt32, "Int32", (_values: *mut Int32, _n: usize);
    fmi3GetUInt32, GetUInt32, "UInt32", (_values: *mut UInt32, _n: usize);
    fmi3GetUInt64, GetUInt64, "UInt64", (_values: *mut UInt64, _n: usize);
    fmi3GetBinary, GetBinary, "Binary", (_sizes: *mut usize, _values: *mut Binary, _n: usize);
    fmi3GetClock, GetClock, "Clock", (_values: *mut Clock);
    fmi3SetFloat32, SetFloat32, "Float32", (_values: *const Float32, _n: usize);
    fmi3SetInt8, SetInt8, "Int8", (_values: *const Int8, _n: usize);
    fmi3SetUInt8, SetUInt8, "UInt8", (_values: *const UInt8, _n: usize);
    fmi3SetInt16, SetInt16, "Int16", (_values: *const Int16, _n: usize);
    fmi3SetUInt16, SetUInt16, "UInt16", (_values: *const UInt16, _n: usize);
    fmi3SetInt32, SetInt32, "Int32", (_values: *const Int32, _n: usize);
    fmi3SetUInt32, SetUInt32, "UInt32", (_values: *const UInt32, _n: usize);
    fmi3SetUInt64, SetUInt64, "UInt64", (_values: *const UInt64, _n: usize);
    fmi3SetBinary, SetBinary, "Binary", (_sizes: *const usize, _values: *const Binary, _n: usize);
    fmi3SetClock, SetClock, "Clock", (_values: *const Clock);
    fmi3GetIntervalDecimal, GetIntervalDecimal, "Clock",
        (_intervals: *mut Float64, _qualifiers: *mut IntervalQualifier);
    fmi3GetIntervalFraction, GetIntervalFraction, "Clock",
        (_counters: *mut UInt64, _resolutions: *mut UInt64, _qualifiers: *mut IntervalQualifier);
    fmi3GetShiftDecimal, GetShiftDecimal, "Clock", (_shifts: *mut Float64);
    fmi3GetShiftFraction, GetShiftFraction, "Clock",
        (_counters: *mut UInt64, _resolutions: *mut UInt64);
    fmi3SetIntervalDecimal, SetIntervalDecimal, "Clock", (_intervals: *const Float64);
    fmi3SetIntervalFraction, SetIntervalFraction, "Clock",
        (_counters: *const UInt64, _resolutions: *const UInt64);
    fmi3SetShiftDecimal, SetShiftDecimal, "Clock", (_shifts: *const Float64);
    fmi3SetShiftFraction, SetShiftFraction, "Clock",
        (_counters: *const UInt64, _resolutions: *const UInt64);
}

/// Rejects the call.
unsafe fn refuse<U: SimulationUnit>(
    instance: Instance,
    function: Function,
    why: &'static str,
) -> Status {
    let body = |_: &mut Component<U, Fmi3>| Err(Problem::NotSupported(why));
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, function, body) }
}

const NO_STRUCTURE: &str =
    "this FMU has no structural parameters, so there is nothing to configure";

/// `fmi3EnterConfigurationMode`.
pub unsafe fn fmi3EnterConfigurationMode<U: SimulationUnit>(instance: Instance) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { refuse::<U>(instance, Function::EnterConfigurationMode, NO_STRUCTURE) }
}

/// `fmi3ExitConfigurationMode`.
pub unsafe fn fmi3ExitConfigurationMode<U: SimulationUnit>(instance: Instance) -> Status {
    // SAFETY: the importer passes NULL or its instance.
    unsafe { refuse::<U>(instance, Function::ExitConfigurationMode, NO_STRUCTURE) }
}

/// `fmi3ActivateModelPartition`.
pub unsafe fn fmi3ActivateModelPartition<U: SimulationUnit>(
    instance: Instance,
    _clock: ValueReference,
    _time: Float64,
) -> Status {
    let why = "this FMU has no model partitions";
    // SAFETY: the importer passes NULL or its instance.
    unsafe { refuse::<U>(instance, Function::ActivateModelPartition, why) }
}
