//! The functions of FMI 3.0: common ones, for co-simulation, for model exchange and for scheduled
//! execution, as one table of name, pointer type and legal states (FMI 3.0, sections 2.2, 3.2, 4.2 and
//! 5.2; the states: sections 2.3, 3.3, 4.3 and 5.3).

use super::states::{self, State, States};
use super::types::*;
use std::ffi::CStr;

crate::tables::functions! {
    common {
        /// `fmi3GetVersion`
        GetVersion, c"fmi3GetVersion", states::ANY, () -> *const Char;
        /// `fmi3SetDebugLogging`: on or off, number of categories (0: all), categories
        SetDebugLogging, c"fmi3SetDebugLogging", states::ALIVE,
            (Instance, Boolean, usize, *const String) -> Status;
        /// `fmi3InstantiateModelExchange`: instance name, instantiation token, resource path, visible,
        /// logging, environment, logger
        InstantiateModelExchange, c"fmi3InstantiateModelExchange", States::of(&[State::StartEnd]),
            (String, String, String, Boolean, Boolean, InstanceEnvironment, Option<LogMessageCallback>)
            -> Instance;
        /// `fmi3InstantiateCoSimulation`: instance name, instantiation token, resource path, visible,
        /// logging, event mode used, early return allowed, required intermediate variables, their number,
        /// environment, logger, intermediate update
        InstantiateCoSimulation, c"fmi3InstantiateCoSimulation", States::of(&[State::StartEnd]),
            (String, String, String, Boolean, Boolean, Boolean, Boolean, *const ValueReference, usize,
                InstanceEnvironment, Option<LogMessageCallback>, Option<IntermediateUpdateCallback>)
            -> Instance;
        /// `fmi3InstantiateScheduledExecution`: instance name, instantiation token, resource path, visible,
        /// logging, environment, logger, clock update, lock and unlock preemption
        InstantiateScheduledExecution, c"fmi3InstantiateScheduledExecution",
            States::of(&[State::StartEnd]),
            (String, String, String, Boolean, Boolean, InstanceEnvironment, Option<LogMessageCallback>,
                Option<ClockUpdateCallback>, Option<PreemptionCallback>, Option<PreemptionCallback>)
            -> Instance;
        /// `fmi3FreeInstance`
        FreeInstance, c"fmi3FreeInstance", states::ALIVE, (Instance) -> ();
        /// `fmi3EnterInitializationMode`: tolerance defined, tolerance, start time, stop time defined, stop
        /// time
        EnterInitializationMode, c"fmi3EnterInitializationMode", States::of(&[State::Instantiated]),
            (Instance, Boolean, Float64, Float64, Boolean, Float64) -> Status;
        /// `fmi3ExitInitializationMode`
        ExitInitializationMode, c"fmi3ExitInitializationMode",
            States::of(&[State::InitializationMode]), (Instance) -> Status;
        /// `fmi3EnterEventMode`
        EnterEventMode, c"fmi3EnterEventMode",
            States::of(&[State::ContinuousTimeMode, State::StepMode]), (Instance) -> Status;
        /// `fmi3Terminate`
        Terminate, c"fmi3Terminate", states::RUNNING, (Instance) -> Status;
        /// `fmi3Reset`
        Reset, c"fmi3Reset", states::ALIVE, (Instance) -> Status;
        /// `fmi3GetFloat32`: value references, their number, values, their number
        GetFloat32, c"fmi3GetFloat32", states::READ,
            (Instance, *const ValueReference, usize, *mut Float32, usize) -> Status;
        /// `fmi3GetFloat64`: value references, their number, values, their number
        GetFloat64, c"fmi3GetFloat64", states::READ,
            (Instance, *const ValueReference, usize, *mut Float64, usize) -> Status;
        /// `fmi3GetInt8`: value references, their number, values, their number
        GetInt8, c"fmi3GetInt8", states::READ,
            (Instance, *const ValueReference, usize, *mut Int8, usize) -> Status;
        /// `fmi3GetUInt8`: value references, their number, values, their number
        GetUInt8, c"fmi3GetUInt8", states::READ,
            (Instance, *const ValueReference, usize, *mut UInt8, usize) -> Status;
        /// `fmi3GetInt16`: value references, their number, values, their number
        GetInt16, c"fmi3GetInt16", states::READ,
            (Instance, *const ValueReference, usize, *mut Int16, usize) -> Status;
        /// `fmi3GetUInt16`: value references, their number, values, their number
        GetUInt16, c"fmi3GetUInt16", states::READ,
            (Instance, *const ValueReference, usize, *mut UInt16, usize) -> Status;
        /// `fmi3GetInt32`: value references, their number, values, their number
        GetInt32, c"fmi3GetInt32", states::READ,
            (Instance, *const ValueReference, usize, *mut Int32, usize) -> Status;
        /// `fmi3GetUInt32`: value references, their number, values, their number
        GetUInt32, c"fmi3GetUInt32", states::READ,
            (Instance, *const ValueReference, usize, *mut UInt32, usize) -> Status;
        /// `fmi3GetInt64`: value references, their number, values, their number
        GetInt64, c"fmi3GetInt64", states::READ,
            (Instance, *const ValueReference, usize, *mut Int64, usize) -> Status;
        /// `fmi3GetUInt64`: value references, their number, values, their number
        GetUInt64, c"fmi3GetUInt64", states::READ,
            (Instance, *const ValueReference, usize, *mut UInt64, usize) -> Status;
        /// `fmi3GetBoolean`: value references, their number, values, their number
        GetBoolean, c"fmi3GetBoolean", states::READ,
            (Instance, *const ValueReference, usize, *mut Boolean, usize) -> Status;
        /// `fmi3GetString`: value references, their number, values, their number
        GetString, c"fmi3GetString", states::READ,
            (Instance, *const ValueReference, usize, *mut String, usize) -> Status;
        /// `fmi3GetBinary`: value references, their number, sizes, values, their number
        GetBinary, c"fmi3GetBinary", states::READ,
            (Instance, *const ValueReference, usize, *mut usize, *mut Binary, usize) -> Status;
        /// `fmi3GetClock`: value references, their number, values
        GetClock, c"fmi3GetClock", states::READ,
            (Instance, *const ValueReference, usize, *mut Clock) -> Status;
        /// `fmi3SetFloat32`: value references, their number, values, their number
        SetFloat32, c"fmi3SetFloat32", states::WRITE,
            (Instance, *const ValueReference, usize, *const Float32, usize) -> Status;
        /// `fmi3SetFloat64`: value references, their number, values, their number
        SetFloat64, c"fmi3SetFloat64", states::WRITE,
            (Instance, *const ValueReference, usize, *const Float64, usize) -> Status;
        /// `fmi3SetInt8`: value references, their number, values, their number
        SetInt8, c"fmi3SetInt8", states::WRITE,
            (Instance, *const ValueReference, usize, *const Int8, usize) -> Status;
        /// `fmi3SetUInt8`: value references, their number, values, their number
        SetUInt8, c"fmi3SetUInt8", states::WRITE,
            (Instance, *const ValueReference, usize, *const UInt8, usize) -> Status;
        /// `fmi3SetInt16`: value references, their number, values, their number
        SetInt16, c"fmi3SetInt16", states::WRITE,
            (Instance, *const ValueReference, usize, *const Int16, usize) -> Status;
        /// `fmi3SetUInt16`: value references, their number, values, their number
        SetUInt16, c"fmi3SetUInt16", states::WRITE,
            (Instance, *const ValueReference, usize, *const UInt16, usize) -> Status;
        /// `fmi3SetInt32`: value references, their number, values, their number
        SetInt32, c"fmi3SetInt32", states::WRITE,
            (Instance, *const ValueReference, usize, *const Int32, usize) -> Status;
        /// `fmi3SetUInt32`: value references, their number, values, their number
        SetUInt32, c"fmi3SetUInt32", states::WRITE,
            (Instance, *const ValueReference, usize, *const UInt32, usize) -> Status;
        /// `fmi3SetInt64`: value references, their number, values, their number
        SetInt64, c"fmi3SetInt64", states::WRITE,
            (Instance, *const ValueReference, usize, *const Int64, usize) -> Status;
        /// `fmi3SetUInt64`: value references, their number, values, their number
        SetUInt64, c"fmi3SetUInt64", states::WRITE,
            (Instance, *const ValueReference, usize, *const UInt64, usize) -> Status;
        /// `fmi3SetBoolean`: value references, their number, values, their number
        SetBoolean, c"fmi3SetBoolean", states::WRITE,
            (Instance, *const ValueReference, usize, *const Boolean, usize) -> Status;
        /// `fmi3SetString`: value references, their number, values, their number
        SetString, c"fmi3SetString", states::WRITE,
            (Instance, *const ValueReference, usize, *const String, usize) -> Status;
        /// `fmi3SetBinary`: value references, their number, sizes, values, their number
        SetBinary, c"fmi3SetBinary", states::WRITE,
            (Instance, *const ValueReference, usize, *const usize, *const Binary, usize) -> Status;
        /// `fmi3SetClock`: value references, their number, values
        SetClock, c"fmi3SetClock", states::WRITE,
            (Instance, *const ValueReference, usize, *const Clock) -> Status;
        /// `fmi3GetNumberOfVariableDependencies`: value reference, number
        GetNumberOfVariableDependencies, c"fmi3GetNumberOfVariableDependencies", states::ALIVE,
            (Instance, ValueReference, *mut usize) -> Status;
        /// `fmi3GetVariableDependencies`: dependent, its element indices, independents, their element
        /// indices, kinds, number of dependencies
        GetVariableDependencies, c"fmi3GetVariableDependencies", states::ALIVE,
            (Instance, ValueReference, *mut usize, *mut ValueReference, *mut usize, *mut DependencyKind,
                usize) -> Status;
        /// `fmi3GetFMUState`: in: NULL or a state to overwrite; out: the state
        GetFmuState, c"fmi3GetFMUState", states::ALIVE, (Instance, *mut FmuState) -> Status;
        /// `fmi3SetFMUState`
        SetFmuState, c"fmi3SetFMUState", states::ALIVE, (Instance, FmuState) -> Status;
        /// `fmi3FreeFMUState`: writes NULL back
        FreeFmuState, c"fmi3FreeFMUState", states::ALIVE, (Instance, *mut FmuState) -> Status;
        /// `fmi3SerializedFMUStateSize`: bytes needed
        SerializedFmuStateSize, c"fmi3SerializedFMUStateSize", states::ALIVE,
            (Instance, FmuState, *mut usize) -> Status;
        /// `fmi3SerializeFMUState`: state, bytes, their number
        SerializeFmuState, c"fmi3SerializeFMUState", states::ALIVE,
            (Instance, FmuState, *mut Byte, usize) -> Status;
        /// `fmi3DeserializeFMUState`: bytes, their number, state
        DeserializeFmuState, c"fmi3DeserializeFMUState", states::ALIVE,
            (Instance, *const Byte, usize, *mut FmuState) -> Status;
        /// `fmi3GetDirectionalDerivative`: unknowns, their number, knowns, their number, seed, its length,
        /// sensitivity, its length
        GetDirectionalDerivative, c"fmi3GetDirectionalDerivative", states::DERIVATIVES,
            (Instance, *const ValueReference, usize, *const ValueReference, usize, *const Float64, usize,
                *mut Float64, usize) -> Status;
        /// `fmi3GetAdjointDerivative`: unknowns, their number, knowns, their number, seed, its length,
        /// sensitivity, its length
        GetAdjointDerivative, c"fmi3GetAdjointDerivative", states::DERIVATIVES,
            (Instance, *const ValueReference, usize, *const ValueReference, usize, *const Float64, usize,
                *mut Float64, usize) -> Status;
        /// `fmi3EnterConfigurationMode`
        EnterConfigurationMode, c"fmi3EnterConfigurationMode", states::CONFIGURABLE,
            (Instance) -> Status;
        /// `fmi3ExitConfigurationMode`
        ExitConfigurationMode, c"fmi3ExitConfigurationMode",
            States::of(&[State::ConfigurationMode, State::ReconfigurationMode]), (Instance) -> Status;
        /// `fmi3GetIntervalDecimal`: value references, their number, intervals \[s\], qualifiers
        GetIntervalDecimal, c"fmi3GetIntervalDecimal", states::CLOCKS,
            (Instance, *const ValueReference, usize, *mut Float64, *mut IntervalQualifier) -> Status;
        /// `fmi3GetIntervalFraction`: value references, their number, counters, resolutions, qualifiers
        GetIntervalFraction, c"fmi3GetIntervalFraction", states::CLOCKS,
            (Instance, *const ValueReference, usize, *mut UInt64, *mut UInt64, *mut IntervalQualifier)
            -> Status;
        /// `fmi3GetShiftDecimal`: value references, their number, shifts \[s\]
        GetShiftDecimal, c"fmi3GetShiftDecimal", states::CLOCKS,
            (Instance, *const ValueReference, usize, *mut Float64) -> Status;
        /// `fmi3GetShiftFraction`: value references, their number, counters, resolutions
        GetShiftFraction, c"fmi3GetShiftFraction", states::CLOCKS,
            (Instance, *const ValueReference, usize, *mut UInt64, *mut UInt64) -> Status;
        /// `fmi3SetIntervalDecimal`: value references, their number, intervals \[s\]
        SetIntervalDecimal, c"fmi3SetIntervalDecimal", states::CLOCKS,
            (Instance, *const ValueReference, usize, *const Float64) -> Status;
        /// `fmi3SetIntervalFraction`: value references, their number, counters, resolutions
        SetIntervalFraction, c"fmi3SetIntervalFraction", states::CLOCKS,
            (Instance, *const ValueReference, usize, *const UInt64, *const UInt64) -> Status;
        /// `fmi3SetShiftDecimal`: value references, their number, shifts \[s\]
        SetShiftDecimal, c"fmi3SetShiftDecimal", states::CLOCKS,
            (Instance, *const ValueReference, usize, *const Float64) -> Status;
        /// `fmi3SetShiftFraction`: value references, their number, counters, resolutions
        SetShiftFraction, c"fmi3SetShiftFraction", states::CLOCKS,
            (Instance, *const ValueReference, usize, *const UInt64, *const UInt64) -> Status;
        /// `fmi3EvaluateDiscreteStates`
        EvaluateDiscreteStates, c"fmi3EvaluateDiscreteStates",
            States::of(&[State::InitializationMode, State::EventMode]), (Instance) -> Status;
        /// `fmi3UpdateDiscreteStates`: out: discrete states need update, terminate simulation, nominals of
        /// states changed, values of states changed, next event time defined, next event time
        UpdateDiscreteStates, c"fmi3UpdateDiscreteStates", States::of(&[State::EventMode]),
            (Instance, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean,
                *mut Float64) -> Status;
    }
    co_simulation {
        /// `fmi3EnterStepMode`
        EnterStepMode, c"fmi3EnterStepMode", States::of(&[State::EventMode]), (Instance) -> Status;
        /// `fmi3GetOutputDerivatives`: value references, their number, orders, values, their number
        GetOutputDerivatives, c"fmi3GetOutputDerivatives", states::STEPPED,
            (Instance, *const ValueReference, usize, *const Int32, *mut Float64, usize) -> Status;
        /// `fmi3DoStep`: current communication point, step size, no SetFMUState before this point; out:
        /// event handling needed, terminate simulation, early return, last successful time
        DoStep, c"fmi3DoStep", States::of(&[State::StepMode]),
            (Instance, Float64, Float64, Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Float64)
            -> Status;
    }
    model_exchange {
        /// `fmi3EnterContinuousTimeMode`
        EnterContinuousTimeMode, c"fmi3EnterContinuousTimeMode", States::of(&[State::EventMode]),
            (Instance) -> Status;
        /// `fmi3CompletedIntegratorStep`: no SetFMUState before this point; out: enter event mode, terminate
        /// simulation
        CompletedIntegratorStep, c"fmi3CompletedIntegratorStep",
            States::of(&[State::ContinuousTimeMode]),
            (Instance, Boolean, *mut Boolean, *mut Boolean) -> Status;
        /// `fmi3SetTime`
        SetTime, c"fmi3SetTime", States::of(&[State::EventMode, State::ContinuousTimeMode]),
            (Instance, Float64) -> Status;
        /// `fmi3SetContinuousStates`: values, their number
        SetContinuousStates, c"fmi3SetContinuousStates", States::of(&[State::ContinuousTimeMode]),
            (Instance, *const Float64, usize) -> Status;
        /// `fmi3GetContinuousStateDerivatives`: values, their number
        GetContinuousStateDerivatives, c"fmi3GetContinuousStateDerivatives", states::CONTINUOUS,
            (Instance, *mut Float64, usize) -> Status;
        /// `fmi3GetEventIndicators`: values, their number
        GetEventIndicators, c"fmi3GetEventIndicators", states::CONTINUOUS,
            (Instance, *mut Float64, usize) -> Status;
        /// `fmi3GetContinuousStates`: values, their number
        GetContinuousStates, c"fmi3GetContinuousStates", states::CONTINUOUS,
            (Instance, *mut Float64, usize) -> Status;
        /// `fmi3GetNominalsOfContinuousStates`: values, their number
        GetNominalsOfContinuousStates, c"fmi3GetNominalsOfContinuousStates", states::CONTINUOUS,
            (Instance, *mut Float64, usize) -> Status;
        /// `fmi3GetNumberOfEventIndicators`
        GetNumberOfEventIndicators, c"fmi3GetNumberOfEventIndicators", states::ALIVE,
            (Instance, *mut usize) -> Status;
        /// `fmi3GetNumberOfContinuousStates`
        GetNumberOfContinuousStates, c"fmi3GetNumberOfContinuousStates", states::ALIVE,
            (Instance, *mut usize) -> Status;
    }
    scheduled_execution {
        /// `fmi3ActivateModelPartition`: clock, activation time
        ActivateModelPartition, c"fmi3ActivateModelPartition", States::of(&[State::ClockActivationMode]),
            (Instance, ValueReference, Float64) -> Status;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Part;

    #[test]
    fn names_are_the_standards_and_differ() {
        let mut names: Vec<_> = Function::ALL.iter().map(|f| f.name()).collect();
        names.sort_unstable();
        names.dedup();
        let count = |part| Function::ALL.iter().filter(|f| f.part() == part).count();
        assert_eq!(names.len(), Function::ALL.len());
        assert!(names.iter().all(|n| n.starts_with("fmi3") && n.len() > 8));
        let parts = [
            Part::Common,
            Part::CoSimulation,
            Part::ModelExchange,
            Part::ScheduledExecution,
        ];
        assert_eq!(parts.map(count), [61, 3, 10, 1]);
    }

    #[test]
    fn nothing_but_the_version_is_legal_after_a_fatal_error() {
        let legal: Vec<_> = Function::ALL
            .iter()
            .filter(|f| f.is_legal_in(State::Fatal))
            .collect();
        assert_eq!(legal, [&Function::GetVersion]);
    }
}
