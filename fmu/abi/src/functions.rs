//! The functions of FMI 2.0 co-simulation: 25 common ones and 9 for co-simulation, as one table of
//! name, pointer type and legal states (FMI 2.0.5, sections 2.1 and 4.2; the states: section 4.2.4).

use crate::states::{self, State, States};
use crate::types::*;
use std::ffi::CStr;

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident, $c_name:literal, $states:expr,
        ($($arg:ty),*) -> $returns:ty;)*) => {
        /// Pointer types of the functions, named after them without the prefix `fmi2`.
        pub mod pointers {
            use super::*;
            $($(#[$doc])* pub type $name = unsafe extern "C" fn($($arg),*) -> $returns;)*
        }

        /// A function of the interface.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Function {
            $($(#[$doc])* $name,)*
        }

        impl Function {
            /// All functions, the common ones first.
            pub const ALL: [Self; 34] = [$(Self::$name,)*];

            /// Name of the exported symbol, such as `fmi2DoStep`.
            pub const fn symbol(self) -> &'static CStr {
                match self {
                    $(Self::$name => $c_name,)*
                }
            }

            /// The states in which it may be called (FMI 2.0.5, section 4.2.4).
            pub const fn legal_states(self) -> States {
                match self {
                    $(Self::$name => $states,)*
                }
            }
        }
    };
}

impl Function {
    /// Name of the function, such as `fmi2DoStep`.
    pub fn name(self) -> &'static str {
        self.symbol().to_str().unwrap_or_default()
    }

    /// Whether it may be called in `state`.
    pub const fn is_legal_in(self, state: State) -> bool {
        self.legal_states().contains(state)
    }
}

functions! {
    /// `fmi2GetTypesPlatform`
    GetTypesPlatform, c"fmi2GetTypesPlatform", states::ANY, () -> *const Char;
    /// `fmi2GetVersion`
    GetVersion, c"fmi2GetVersion", states::ANY, () -> *const Char;
    /// `fmi2SetDebugLogging`: on or off, number of categories (0: all), categories
    SetDebugLogging, c"fmi2SetDebugLogging", states::ALIVE,
        (Component, Boolean, usize, *const *const Char) -> Status;
    /// `fmi2Instantiate`: instance name, type, GUID, resource location, callbacks, visible, logging
    Instantiate, c"fmi2Instantiate", States::of(&[State::StartEnd]),
        (*const Char, Type, *const Char, *const Char, *const CallbackFunctions, Boolean, Boolean)
        -> Component;
    /// `fmi2FreeInstance`
    FreeInstance, c"fmi2FreeInstance", states::IDLE, (Component) -> ();
    /// `fmi2SetupExperiment`: tolerance defined, tolerance, start time, stop time defined, stop time
    SetupExperiment, c"fmi2SetupExperiment", States::of(&[State::Instantiated]),
        (Component, Boolean, Real, Real, Boolean, Real) -> Status;
    /// `fmi2EnterInitializationMode`
    EnterInitializationMode, c"fmi2EnterInitializationMode", States::of(&[State::Instantiated]),
        (Component) -> Status;
    /// `fmi2ExitInitializationMode`
    ExitInitializationMode, c"fmi2ExitInitializationMode",
        States::of(&[State::InitializationMode]), (Component) -> Status;
    /// `fmi2Terminate`
    Terminate, c"fmi2Terminate", States::of(&[State::StepComplete, State::StepFailed]),
        (Component) -> Status;
    /// `fmi2Reset`
    Reset, c"fmi2Reset", states::IDLE, (Component) -> Status;
    /// `fmi2GetReal`: value references, their number, values
    GetReal, c"fmi2GetReal", states::READ,
        (Component, *const ValueReference, usize, *mut Real) -> Status;
    /// `fmi2GetInteger`: value references, their number, values
    GetInteger, c"fmi2GetInteger", states::READ,
        (Component, *const ValueReference, usize, *mut Integer) -> Status;
    /// `fmi2GetBoolean`: value references, their number, values
    GetBoolean, c"fmi2GetBoolean", states::READ,
        (Component, *const ValueReference, usize, *mut Boolean) -> Status;
    /// `fmi2GetString`: value references, their number, values (valid until the next call)
    GetString, c"fmi2GetString", states::READ,
        (Component, *const ValueReference, usize, *mut *const Char) -> Status;
    /// `fmi2SetReal`: value references, their number, values
    SetReal, c"fmi2SetReal", states::WRITE,
        (Component, *const ValueReference, usize, *const Real) -> Status;
    /// `fmi2SetInteger`: value references, their number, values
    SetInteger, c"fmi2SetInteger", states::WRITE,
        (Component, *const ValueReference, usize, *const Integer) -> Status;
    /// `fmi2SetBoolean`: value references, their number, values
    SetBoolean, c"fmi2SetBoolean", states::WRITE,
        (Component, *const ValueReference, usize, *const Boolean) -> Status;
    /// `fmi2SetString`: value references, their number, values
    SetString, c"fmi2SetString", states::WRITE,
        (Component, *const ValueReference, usize, *const *const Char) -> Status;
    /// `fmi2GetFMUstate`: in: NULL or a state to overwrite; out: the state
    GetFmuState, c"fmi2GetFMUstate", states::IDLE, (Component, *mut FmuState) -> Status;
    /// `fmi2SetFMUstate`
    SetFmuState, c"fmi2SetFMUstate", states::IDLE, (Component, FmuState) -> Status;
    /// `fmi2FreeFMUstate`: writes NULL back
    FreeFmuState, c"fmi2FreeFMUstate", states::IDLE, (Component, *mut FmuState) -> Status;
    /// `fmi2SerializedFMUstateSize`: bytes needed
    SerializedFmuStateSize, c"fmi2SerializedFMUstateSize", states::IDLE,
        (Component, FmuState, *mut usize) -> Status;
    /// `fmi2SerializeFMUstate`: state, bytes, their number
    SerializeFmuState, c"fmi2SerializeFMUstate", states::IDLE,
        (Component, FmuState, *mut Byte, usize) -> Status;
    /// `fmi2DeSerializeFMUstate`: bytes, their number, state
    DeSerializeFmuState, c"fmi2DeSerializeFMUstate", states::IDLE,
        (Component, *const Byte, usize, *mut FmuState) -> Status;
    /// `fmi2GetDirectionalDerivative`: unknowns, their number, knowns, their number, seed, result
    GetDirectionalDerivative, c"fmi2GetDirectionalDerivative", states::READ,
        (Component, *const ValueReference, usize, *const ValueReference, usize, *const Real,
            *mut Real) -> Status;

    /// `fmi2SetRealInputDerivatives`: value references, their number, orders, values
    SetRealInputDerivatives, c"fmi2SetRealInputDerivatives", states::WRITE,
        (Component, *const ValueReference, usize, *const Integer, *const Real) -> Status;
    /// `fmi2GetRealOutputDerivatives`: value references, their number, orders, values
    GetRealOutputDerivatives, c"fmi2GetRealOutputDerivatives", states::STEPPED,
        (Component, *const ValueReference, usize, *const Integer, *mut Real) -> Status;
    /// `fmi2DoStep`: current communication point, step size, no SetFMUstate before this point
    DoStep, c"fmi2DoStep", States::of(&[State::StepComplete]),
        (Component, Real, Real, Boolean) -> Status;
    /// `fmi2CancelStep`
    CancelStep, c"fmi2CancelStep", States::of(&[State::StepInProgress]), (Component) -> Status;
    /// `fmi2GetStatus`
    GetStatus, c"fmi2GetStatus", states::STATUS, (Component, StatusKind, *mut Status) -> Status;
    /// `fmi2GetRealStatus`
    GetRealStatus, c"fmi2GetRealStatus", states::STATUS,
        (Component, StatusKind, *mut Real) -> Status;
    /// `fmi2GetIntegerStatus`
    GetIntegerStatus, c"fmi2GetIntegerStatus", states::STATUS,
        (Component, StatusKind, *mut Integer) -> Status;
    /// `fmi2GetBooleanStatus`
    GetBooleanStatus, c"fmi2GetBooleanStatus", states::STATUS,
        (Component, StatusKind, *mut Boolean) -> Status;
    /// `fmi2GetStringStatus`
    GetStringStatus, c"fmi2GetStringStatus", states::STATUS,
        (Component, StatusKind, *mut *const Char) -> Status;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_standards_and_differ() {
        let mut names: Vec<_> = Function::ALL.iter().map(|f| f.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 34);
        assert!(names.iter().all(|n| n.starts_with("fmi2") && n.len() > 8));
    }

    #[test]
    fn nothing_but_inquiries_is_legal_after_a_fatal_error() {
        let legal: Vec<_> = Function::ALL
            .into_iter()
            .filter(|f| f.is_legal_in(State::Fatal))
            .collect();
        assert_eq!(legal, [Function::GetTypesPlatform, Function::GetVersion]);
    }

    #[test]
    fn an_instance_in_error_can_be_read_reset_and_freed_but_not_stepped() {
        let legal = |f: Function| f.is_legal_in(State::Error);
        assert!(
            [Function::GetReal, Function::Reset, Function::FreeInstance].map(legal) == [true; 3]
        );
        assert!(
            [Function::DoStep, Function::SetReal, Function::Terminate].map(legal) == [false; 3]
        );
    }
}
