//! The functions of FMI 2.0: 25 common ones, 9 for co-simulation and 10 for model exchange, as one table
//! of name, pointer type and legal states (FMI 2.0.5, sections 2.1, 3.2 and 4.2; the states: sections
//! 3.2.3 and 4.2.4).

use super::states::{self, State, States};
use super::types::*;
use std::ffi::CStr;

crate::tables::functions! {
    common {
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
        Terminate, c"fmi2Terminate", States::of(&[
            State::StepComplete,
            State::StepFailed,
            State::EventMode,
            State::ContinuousTimeMode,
        ]), (Component) -> Status;
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
    }
    co_simulation {
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
    model_exchange {
        /// `fmi2EnterEventMode`
        EnterEventMode, c"fmi2EnterEventMode",
            States::of(&[State::EventMode, State::ContinuousTimeMode]), (Component) -> Status;
        /// `fmi2NewDiscreteStates`: event iteration; out: what it changed
        NewDiscreteStates, c"fmi2NewDiscreteStates", States::of(&[State::EventMode]),
            (Component, *mut EventInfo) -> Status;
        /// `fmi2EnterContinuousTimeMode`
        EnterContinuousTimeMode, c"fmi2EnterContinuousTimeMode", States::of(&[State::EventMode]),
            (Component) -> Status;
        /// `fmi2CompletedIntegratorStep`: no SetFMUstate before this point; out: enter event mode,
        /// terminate simulation
        CompletedIntegratorStep, c"fmi2CompletedIntegratorStep",
            States::of(&[State::ContinuousTimeMode]),
            (Component, Boolean, *mut Boolean, *mut Boolean) -> Status;
        /// `fmi2SetTime`
        SetTime, c"fmi2SetTime", States::of(&[State::EventMode, State::ContinuousTimeMode]),
            (Component, Real) -> Status;
        /// `fmi2SetContinuousStates`: values, their number
        SetContinuousStates, c"fmi2SetContinuousStates", States::of(&[State::ContinuousTimeMode]),
            (Component, *const Real, usize) -> Status;
        /// `fmi2GetDerivatives`: values, their number
        GetDerivatives, c"fmi2GetDerivatives", states::CONTINUOUS,
            (Component, *mut Real, usize) -> Status;
        /// `fmi2GetEventIndicators`: values, their number
        GetEventIndicators, c"fmi2GetEventIndicators", states::CONTINUOUS,
            (Component, *mut Real, usize) -> Status;
        /// `fmi2GetContinuousStates`: values, their number
        GetContinuousStates, c"fmi2GetContinuousStates", states::CONTINUOUS,
            (Component, *mut Real, usize) -> Status;
        /// `fmi2GetNominalsOfContinuousStates`: values, their number
        GetNominalsOfContinuousStates, c"fmi2GetNominalsOfContinuousStates", states::NOMINALS,
            (Component, *mut Real, usize) -> Status;
    }
    scheduled_execution {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_standards_and_differ() {
        let mut names: Vec<_> = Function::ALL.iter().map(|f| f.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 44);
        assert!(names.iter().all(|n| n.starts_with("fmi2") && n.len() > 8));
    }

    #[test]
    fn nothing_but_inquiries_is_legal_after_a_fatal_error() {
        let legal: Vec<_> = Function::ALL
            .iter()
            .copied()
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
