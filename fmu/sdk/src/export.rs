//! The macro that makes C functions of the generic ones.

/// Makes the shared library of an FMU from a model.
///
/// Called once in a crate of type `cdylib`: `pilotage_sdk::export!(MyModel);` for a type that implements
/// [`Equations`](crate::Equations) and `Default`. It defines the functions of FMI 2.0 and FMI 3.0 and
/// `pilotageInterface`, from which `pilotage pack` reads the interface of the model.
///
/// If the model is read from the FMU's resources, a second argument names the function that reads it, see
/// [`Load`](crate::Load); `pilotageInterface` is then not defined.
#[macro_export]
macro_rules! export {
    ($model:ty) => {
        $crate::export!($model, $crate::interface::compiled_in);

        /// Interface of the model as JSON: a C string that is never freed.
        #[unsafe(no_mangle)]
        #[allow(non_snake_case)]
        pub extern "C" fn pilotageInterface() -> *const ::std::ffi::c_char {
            static TEXT: ::std::sync::OnceLock<::std::ffi::CString> = ::std::sync::OnceLock::new();
            TEXT.get_or_init($crate::interface::text_of::<$model>)
                .as_ptr()
        }
    };
    ($model:ty, $load:expr) => {
        $crate::__co_simulation!($crate::instance::Instance<$model>, |kind, resources| {
            let model: $model = $load(resources)?;
            Ok($crate::instance::Instance::new(model, kind))
        });
        $crate::__model_exchange!(__functions, $model);
    };
}

/// Makes the shared library of an FMU for co-simulation alone, of a [`SimulationUnit`](crate::SimulationUnit). The second
/// argument makes an instance: see [`Load`](crate::Load).
#[macro_export]
macro_rules! export_unit {
    ($unit:ty, $load:expr) => {
        $crate::__co_simulation!($unit, $load);
        // Some importers want to see all functions.
        $crate::__model_exchange!(__refused, $unit);
    };
}

/// The functions of both versions, but for model exchange.
#[doc(hidden)]
#[macro_export]
macro_rules! __co_simulation {
    ($unit:ty, $load:expr) => {
        $crate::__fmi2!($unit, $load);
        $crate::__fmi3!($unit, $load);
    };
}

/// Defines C functions that call the generic ones of the same name; the compiler checks that they have the types of the
/// standard.
#[doc(hidden)]
#[macro_export]
macro_rules! __functions {
    ($fmi:ident, $model:ty; $(
        $variant:ident = $name:ident($($argument:ident: $type:ty),* $(,)?) -> $returns:ty
            $(, $first:expr)?;
    )*) => {$(
        #[unsafe(no_mangle)]
        #[allow(non_snake_case, missing_docs, clippy::missing_safety_doc, clippy::too_many_arguments)]
        pub unsafe extern "C" fn $name($($argument: $type),*) -> $returns {
            // SAFETY: the caller guarantees what the standard requires.
            unsafe { $crate::$fmi::$name::<$model>($($first,)? $($argument),*) }
        }

        const _: $crate::abi::$fmi::functions::pointers::$variant = $name;
    )*};
}

#[doc(hidden)]
#[macro_export]
macro_rules! __fmi2 {
    ($model:ty, $load:expr) => {
        const _: () = {
            use $crate::abi::fmi2::types::*;
            $crate::__functions! { fmi2, $model;
                GetTypesPlatform = fmi2GetTypesPlatform() -> *const Char;
                GetVersion = fmi2GetVersion() -> *const Char;
                SetDebugLogging = fmi2SetDebugLogging(c: Component, on: Boolean, n: usize,
                    categories: *const *const Char) -> Status;
                Instantiate = fmi2Instantiate(name: *const Char, kind: Type, guid: *const Char,
                    location: *const Char, callbacks: *const CallbackFunctions, visible: Boolean,
                    logging: Boolean) -> Component, $load;
                FreeInstance = fmi2FreeInstance(c: Component) -> ();
                SetupExperiment = fmi2SetupExperiment(c: Component, tolerance_defined: Boolean,
                    tolerance: Real, start: Real, stop_defined: Boolean, stop: Real) -> Status;
                EnterInitializationMode = fmi2EnterInitializationMode(c: Component) -> Status;
                ExitInitializationMode = fmi2ExitInitializationMode(c: Component) -> Status;
                Terminate = fmi2Terminate(c: Component) -> Status;
                Reset = fmi2Reset(c: Component) -> Status;
                GetReal = fmi2GetReal(c: Component, vr: *const ValueReference, n: usize,
                    values: *mut Real) -> Status;
                GetInteger = fmi2GetInteger(c: Component, vr: *const ValueReference, n: usize,
                    values: *mut Integer) -> Status;
                GetBoolean = fmi2GetBoolean(c: Component, vr: *const ValueReference, n: usize,
                    values: *mut Boolean) -> Status;
                GetString = fmi2GetString(c: Component, vr: *const ValueReference, n: usize,
                    values: *mut *const Char) -> Status;
                SetReal = fmi2SetReal(c: Component, vr: *const ValueReference, n: usize,
                    values: *const Real) -> Status;
                SetInteger = fmi2SetInteger(c: Component, vr: *const ValueReference, n: usize,
                    values: *const Integer) -> Status;
                SetBoolean = fmi2SetBoolean(c: Component, vr: *const ValueReference, n: usize,
                    values: *const Boolean) -> Status;
                SetString = fmi2SetString(c: Component, vr: *const ValueReference, n: usize,
                    values: *const *const Char) -> Status;
                GetFmuState = fmi2GetFMUstate(c: Component, state: *mut FmuState) -> Status;
                SetFmuState = fmi2SetFMUstate(c: Component, state: FmuState) -> Status;
                FreeFmuState = fmi2FreeFMUstate(c: Component, state: *mut FmuState) -> Status;
                SerializedFmuStateSize = fmi2SerializedFMUstateSize(c: Component, state: FmuState,
                    size: *mut usize) -> Status;
                SerializeFmuState = fmi2SerializeFMUstate(c: Component, state: FmuState,
                    bytes: *mut Byte, size: usize) -> Status;
                DeSerializeFmuState = fmi2DeSerializeFMUstate(c: Component, bytes: *const Byte,
                    size: usize, state: *mut FmuState) -> Status;
                GetDirectionalDerivative = fmi2GetDirectionalDerivative(c: Component,
                    unknowns: *const ValueReference, n_unknowns: usize, knowns: *const ValueReference,
                    n_knowns: usize, seed: *const Real, result: *mut Real) -> Status;
                SetRealInputDerivatives = fmi2SetRealInputDerivatives(c: Component,
                    vr: *const ValueReference, n: usize, orders: *const Integer, values: *const Real)
                    -> Status;
                GetRealOutputDerivatives = fmi2GetRealOutputDerivatives(c: Component,
                    vr: *const ValueReference, n: usize, orders: *const Integer, values: *mut Real)
                    -> Status;
                DoStep = fmi2DoStep(c: Component, time: Real, step: Real, no_set_state: Boolean) -> Status;
                CancelStep = fmi2CancelStep(c: Component) -> Status;
                GetStatus = fmi2GetStatus(c: Component, kind: StatusKind, value: *mut Status) -> Status;
                GetRealStatus = fmi2GetRealStatus(c: Component, kind: StatusKind, value: *mut Real) -> Status;
                GetIntegerStatus = fmi2GetIntegerStatus(c: Component, kind: StatusKind,
                    value: *mut Integer) -> Status;
                GetBooleanStatus = fmi2GetBooleanStatus(c: Component, kind: StatusKind,
                    value: *mut Boolean) -> Status;
                GetStringStatus = fmi2GetStringStatus(c: Component, kind: StatusKind,
                    value: *mut *const Char) -> Status;
            }
        };
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __fmi3 {
    ($model:ty, $load:expr) => {
        const _: () = {
            use $crate::abi::fmi3::types::*;
            $crate::__functions! { fmi3, $model;
                GetVersion = fmi3GetVersion() -> *const Char;
                SetDebugLogging = fmi3SetDebugLogging(i: Instance, on: Boolean, n: usize,
                    categories: *const String) -> Status;
                InstantiateModelExchange = fmi3InstantiateModelExchange(name: String, token: String,
                    location: String, visible: Boolean, logging: Boolean,
                    environment: InstanceEnvironment, logger: Option<LogMessageCallback>)
                    -> Instance, $load;
                InstantiateCoSimulation = fmi3InstantiateCoSimulation(name: String, token: String,
                    location: String, visible: Boolean, logging: Boolean, event_mode: Boolean,
                    early_return: Boolean, required: *const ValueReference, n_required: usize,
                    environment: InstanceEnvironment, logger: Option<LogMessageCallback>,
                    update: Option<IntermediateUpdateCallback>) -> Instance, $load;
                InstantiateScheduledExecution = fmi3InstantiateScheduledExecution(name: String,
                    token: String, location: String, visible: Boolean, logging: Boolean,
                    environment: InstanceEnvironment, logger: Option<LogMessageCallback>,
                    clock_update: Option<ClockUpdateCallback>, lock: Option<PreemptionCallback>,
                    unlock: Option<PreemptionCallback>) -> Instance, $load;
                FreeInstance = fmi3FreeInstance(i: Instance) -> ();
                EnterInitializationMode = fmi3EnterInitializationMode(i: Instance,
                    tolerance_defined: Boolean, tolerance: Float64, start: Float64,
                    stop_defined: Boolean, stop: Float64) -> Status;
                ExitInitializationMode = fmi3ExitInitializationMode(i: Instance) -> Status;
                EnterEventMode = fmi3EnterEventMode(i: Instance) -> Status;
                Terminate = fmi3Terminate(i: Instance) -> Status;
                Reset = fmi3Reset(i: Instance) -> Status;
                EnterConfigurationMode = fmi3EnterConfigurationMode(i: Instance) -> Status;
                ExitConfigurationMode = fmi3ExitConfigurationMode(i: Instance) -> Status;
                EvaluateDiscreteStates = fmi3EvaluateDiscreteStates(i: Instance) -> Status;
                EnterStepMode = fmi3EnterStepMode(i: Instance) -> Status;
                GetFloat32 = fmi3GetFloat32(i: Instance, vr: *const ValueReference, n: usize, values: *mut Float32,
                    n_values: usize) -> Status;
                SetFloat32 = fmi3SetFloat32(i: Instance, vr: *const ValueReference, n: usize, values: *const Float32,
                    n_values: usize) -> Status;
                GetFloat64 = fmi3GetFloat64(i: Instance, vr: *const ValueReference, n: usize, values: *mut Float64,
                    n_values: usize) -> Status;
                SetFloat64 = fmi3SetFloat64(i: Instance, vr: *const ValueReference, n: usize, values: *const Float64,
                    n_values: usize) -> Status;
                GetInt8 = fmi3GetInt8(i: Instance, vr: *const ValueReference, n: usize, values: *mut Int8,
                    n_values: usize) -> Status;
                SetInt8 = fmi3SetInt8(i: Instance, vr: *const ValueReference, n: usize, values: *const Int8,
                    n_values: usize) -> Status;
                GetUInt8 = fmi3GetUInt8(i: Instance, vr: *const ValueReference, n: usize, values: *mut UInt8,
                    n_values: usize) -> Status;
                SetUInt8 = fmi3SetUInt8(i: Instance, vr: *const ValueReference, n: usize, values: *const UInt8,
                    n_values: usize) -> Status;
                GetInt16 = fmi3GetInt16(i: Instance, vr: *const ValueReference, n: usize, values: *mut Int16,
                    n_values: usize) -> Status;
                SetInt16 = fmi3SetInt16(i: Instance, vr: *const ValueReference, n: usize, values: *const Int16,
                    n_values: usize) -> Status;
                GetUInt16 = fmi3GetUInt16(i: Instance, vr: *const ValueReference, n: usize, values: *mut UInt16,
                    n_values: usize) -> Status;
                SetUInt16 = fmi3SetUInt16(i: Instance, vr: *const ValueReference, n: usize, values: *const UInt16,
                    n_values: usize) -> Status;
                GetInt32 = fmi3GetInt32(i: Instance, vr: *const ValueReference, n: usize, values: *mut Int32,
                    n_values: usize) -> Status;
                SetInt32 = fmi3SetInt32(i: Instance, vr: *const ValueReference, n: usize, values: *const Int32,
                    n_values: usize) -> Status;
                GetUInt32 = fmi3GetUInt32(i: Instance, vr: *const ValueReference, n: usize, values: *mut UInt32,
                    n_values: usize) -> Status;
                SetUInt32 = fmi3SetUInt32(i: Instance, vr: *const ValueReference, n: usize, values: *const UInt32,
                    n_values: usize) -> Status;
                GetInt64 = fmi3GetInt64(i: Instance, vr: *const ValueReference, n: usize, values: *mut Int64,
                    n_values: usize) -> Status;
                SetInt64 = fmi3SetInt64(i: Instance, vr: *const ValueReference, n: usize, values: *const Int64,
                    n_values: usize) -> Status;
                GetUInt64 = fmi3GetUInt64(i: Instance, vr: *const ValueReference, n: usize, values: *mut UInt64,
                    n_values: usize) -> Status;
                SetUInt64 = fmi3SetUInt64(i: Instance, vr: *const ValueReference, n: usize, values: *const UInt64,
                    n_values: usize) -> Status;
                GetBoolean = fmi3GetBoolean(i: Instance, vr: *const ValueReference, n: usize, values: *mut Boolean,
                    n_values: usize) -> Status;
                SetBoolean = fmi3SetBoolean(i: Instance, vr: *const ValueReference, n: usize, values: *const Boolean,
                    n_values: usize) -> Status;
                GetString = fmi3GetString(i: Instance, vr: *const ValueReference, n: usize, values: *mut String,
                    n_values: usize) -> Status;
                SetString = fmi3SetString(i: Instance, vr: *const ValueReference, n: usize, values: *const String,
                    n_values: usize) -> Status;
                GetBinary = fmi3GetBinary(i: Instance, vr: *const ValueReference, n: usize,
                    sizes: *mut usize, values: *mut Binary, n_values: usize) -> Status;
                SetBinary = fmi3SetBinary(i: Instance, vr: *const ValueReference, n: usize,
                    sizes: *const usize, values: *const Binary, n_values: usize) -> Status;
                GetClock = fmi3GetClock(i: Instance, vr: *const ValueReference, n: usize,
                    values: *mut Clock) -> Status;
                SetClock = fmi3SetClock(i: Instance, vr: *const ValueReference, n: usize,
                    values: *const Clock) -> Status;
                GetNumberOfVariableDependencies = fmi3GetNumberOfVariableDependencies(i: Instance,
                    vr: ValueReference, n: *mut usize) -> Status;
                GetVariableDependencies = fmi3GetVariableDependencies(i: Instance,
                    dependent: ValueReference, dependent_elements: *mut usize,
                    independents: *mut ValueReference, independent_elements: *mut usize,
                    kinds: *mut DependencyKind, n: usize) -> Status;
                GetFmuState = fmi3GetFMUState(i: Instance, state: *mut FmuState) -> Status;
                SetFmuState = fmi3SetFMUState(i: Instance, state: FmuState) -> Status;
                FreeFmuState = fmi3FreeFMUState(i: Instance, state: *mut FmuState) -> Status;
                SerializedFmuStateSize = fmi3SerializedFMUStateSize(i: Instance, state: FmuState,
                    size: *mut usize) -> Status;
                SerializeFmuState = fmi3SerializeFMUState(i: Instance, state: FmuState,
                    bytes: *mut Byte, size: usize) -> Status;
                DeserializeFmuState = fmi3DeserializeFMUState(i: Instance, bytes: *const Byte,
                    size: usize, state: *mut FmuState) -> Status;
                GetDirectionalDerivative = fmi3GetDirectionalDerivative(i: Instance,
                    unknowns: *const ValueReference, n_unknowns: usize, knowns: *const ValueReference,
                    n_knowns: usize, seed: *const Float64, n_seed: usize, result: *mut Float64,
                    n_result: usize) -> Status;
                GetAdjointDerivative = fmi3GetAdjointDerivative(i: Instance,
                    unknowns: *const ValueReference, n_unknowns: usize, knowns: *const ValueReference,
                    n_knowns: usize, seed: *const Float64, n_seed: usize, result: *mut Float64,
                    n_result: usize) -> Status;
                GetIntervalDecimal = fmi3GetIntervalDecimal(i: Instance, vr: *const ValueReference,
                    n: usize, intervals: *mut Float64, qualifiers: *mut IntervalQualifier) -> Status;
                GetIntervalFraction = fmi3GetIntervalFraction(i: Instance, vr: *const ValueReference,
                    n: usize, counters: *mut UInt64, resolutions: *mut UInt64,
                    qualifiers: *mut IntervalQualifier) -> Status;
                GetShiftDecimal = fmi3GetShiftDecimal(i: Instance, vr: *const ValueReference, n: usize,
                    shifts: *mut Float64) -> Status;
                GetShiftFraction = fmi3GetShiftFraction(i: Instance, vr: *const ValueReference, n: usize,
                    counters: *mut UInt64, resolutions: *mut UInt64) -> Status;
                SetIntervalDecimal = fmi3SetIntervalDecimal(i: Instance, vr: *const ValueReference,
                    n: usize, intervals: *const Float64) -> Status;
                SetIntervalFraction = fmi3SetIntervalFraction(i: Instance, vr: *const ValueReference,
                    n: usize, counters: *const UInt64, resolutions: *const UInt64) -> Status;
                SetShiftDecimal = fmi3SetShiftDecimal(i: Instance, vr: *const ValueReference, n: usize,
                    shifts: *const Float64) -> Status;
                SetShiftFraction = fmi3SetShiftFraction(i: Instance, vr: *const ValueReference, n: usize,
                    counters: *const UInt64, resolutions: *const UInt64) -> Status;
                UpdateDiscreteStates = fmi3UpdateDiscreteStates(i: Instance, needs_update: *mut Boolean,
                    terminate: *mut Boolean, nominals_changed: *mut Boolean,
                    values_changed: *mut Boolean, next_event_defined: *mut Boolean,
                    next_event: *mut Float64) -> Status;
                GetOutputDerivatives = fmi3GetOutputDerivatives(i: Instance, vr: *const ValueReference,
                    n: usize, orders: *const Int32, values: *mut Float64, n_values: usize) -> Status;
                DoStep = fmi3DoStep(i: Instance, time: Float64, step: Float64, no_set_state: Boolean,
                    event_needed: *mut Boolean, terminate: *mut Boolean, early_return: *mut Boolean,
                    last_successful_time: *mut Float64) -> Status;
                ActivateModelPartition = fmi3ActivateModelPartition(i: Instance, clock: ValueReference,
                    time: Float64) -> Status;
            }
        };
    };
}

/// Defines C functions that refuse every call.
#[doc(hidden)]
#[macro_export]
macro_rules! __refused {
    ($fmi:ident, $unit:ty; $(
        $variant:ident = $name:ident($first:ident: $first_type:ty $(, $argument:ident: $type:ty)* $(,)?)
            -> $returns:ty;
    )*) => {$(
        #[unsafe(no_mangle)]
        #[allow(non_snake_case, missing_docs, clippy::missing_safety_doc, clippy::too_many_arguments)]
        pub unsafe extern "C" fn $name($first: $first_type $(, $argument: $type)*) -> $returns {
            let _ = ($($argument,)*);
            let function = $crate::abi::$fmi::Function::$variant;
            // SAFETY: the caller guarantees what the standard requires.
            unsafe { $crate::$fmi::refused::<$unit>($first, function) }
        }

        const _: $crate::abi::$fmi::functions::pointers::$variant = $name;
    )*};
}

/// The functions for model exchange, as that macro defines them.
#[doc(hidden)]
#[macro_export]
macro_rules! __model_exchange {
    ($how:ident, $model:ty) => {
        const _: () = {
            use $crate::abi::fmi2::types::*;
            $crate::$how! { fmi2, $model;
                EnterEventMode = fmi2EnterEventMode(c: Component) -> Status;
                NewDiscreteStates = fmi2NewDiscreteStates(c: Component, info: *mut EventInfo) -> Status;
                EnterContinuousTimeMode = fmi2EnterContinuousTimeMode(c: Component) -> Status;
                CompletedIntegratorStep = fmi2CompletedIntegratorStep(c: Component, no_set_state: Boolean,
                    enter_event_mode: *mut Boolean, terminate: *mut Boolean) -> Status;
                SetTime = fmi2SetTime(c: Component, time: Real) -> Status;
                SetContinuousStates = fmi2SetContinuousStates(c: Component, x: *const Real, n: usize)
                    -> Status;
                GetDerivatives = fmi2GetDerivatives(c: Component, dx: *mut Real, n: usize) -> Status;
                GetEventIndicators = fmi2GetEventIndicators(c: Component, z: *mut Real, n: usize) -> Status;
                GetContinuousStates = fmi2GetContinuousStates(c: Component, x: *mut Real, n: usize) -> Status;
                GetNominalsOfContinuousStates = fmi2GetNominalsOfContinuousStates(c: Component,
                    x: *mut Real, n: usize) -> Status;
            }
        };
        const _: () = {
            use $crate::abi::fmi3::types::*;
            $crate::$how! { fmi3, $model;
                EnterContinuousTimeMode = fmi3EnterContinuousTimeMode(i: Instance) -> Status;
                CompletedIntegratorStep = fmi3CompletedIntegratorStep(i: Instance, no_set_state: Boolean,
                    enter_event_mode: *mut Boolean, terminate: *mut Boolean) -> Status;
                SetTime = fmi3SetTime(i: Instance, time: Float64) -> Status;
                GetContinuousStateDerivatives = fmi3GetContinuousStateDerivatives(i: Instance, x: *mut Float64, n: usize) -> Status;
                GetEventIndicators = fmi3GetEventIndicators(i: Instance, x: *mut Float64, n: usize) -> Status;
                GetContinuousStates = fmi3GetContinuousStates(i: Instance, x: *mut Float64, n: usize) -> Status;
                GetNominalsOfContinuousStates = fmi3GetNominalsOfContinuousStates(i: Instance, x: *mut Float64, n: usize) -> Status;
                SetContinuousStates = fmi3SetContinuousStates(i: Instance, x: *const Float64, n: usize) -> Status;
                GetNumberOfEventIndicators = fmi3GetNumberOfEventIndicators(i: Instance, n: *mut usize)
                    -> Status;
                GetNumberOfContinuousStates = fmi3GetNumberOfContinuousStates(i: Instance, n: *mut usize)
                    -> Status;
            }
        };
    };
}
