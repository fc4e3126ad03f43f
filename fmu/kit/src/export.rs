//! The macro that makes C functions of the generic ones.

/// Makes the library of an FMU out of a model.
///
/// In a crate of type `cdylib`, once: `pilotage_kit::export!(MyModel);` for a type that implements
/// [`Equations`](crate::Equations) and `Default`. It defines the functions of FMI 2.0 and FMI 3.0 and
/// `pilotage_interface`, by which `pilotage pack` learns what the model is.
///
/// Where the model is read from the FMU's resources, a second argument names the function that does so:
/// see [`Load`](crate::Load); there is no `pilotage_interface` then.
#[macro_export]
macro_rules! export {
    ($model:ty) => {
        $crate::export!($model, $crate::interface::compiled_in);

        /// What the model is, as JSON: a C string that stays.
        #[unsafe(no_mangle)]
        pub extern "C" fn pilotage_interface() -> *const ::std::ffi::c_char {
            static TEXT: ::std::sync::OnceLock<::std::ffi::CString> = ::std::sync::OnceLock::new();
            TEXT.get_or_init($crate::interface::text_of::<$model>)
                .as_ptr()
        }
    };
    ($model:ty, $load:expr) => {
        $crate::__fmi2!($model, $load);
    };
}

/// Defines C functions that call the generic ones of the same name, and has the compiler check that
/// they have the types of the standard.
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
            // SAFETY: the caller promises what the standard asks of it.
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
    };
}
