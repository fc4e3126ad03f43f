//! Every function in every state that can be reached: the library does what the table says.

use super::raw::{Instance, Messages, Raw, call};
use pilotage::models::Model;
use pilotage_abi::Part;
use pilotage_abi::fmi2::{EventInfo, FmuState, Function, State, Status, StatusKind, Type};
use std::ptr::{null, null_mut};

/// A pilot that a step of 10 s makes overflow, so that steps can fail.
fn unstable() -> Model {
    Model::pilot(&[-1e3, 1.0], 1.0)
}

/// Brings a new instance into a state.
fn reach(instance: &Instance, state: State) {
    assert_eq!(instance.setup(None), Status::OK);
    if state == State::Instantiated {
        return;
    }
    if state == State::Error {
        assert_eq!(instance.setup(Some(f64::NAN)), Status::ERROR);
        return;
    }
    assert_eq!(call!(instance, EnterInitializationMode), Status::OK);
    if state == State::InitializationMode {
        return;
    }
    assert_eq!(call!(instance, ExitInitializationMode), Status::OK);
    match state {
        State::StepComplete | State::EventMode => {}
        State::ContinuousTimeMode => {
            assert_eq!(call!(instance, EnterContinuousTimeMode), Status::OK);
        }
        State::StepFailed => assert_eq!(instance.step(0.0, 10.0), Status::DISCARD),
        State::Terminated => assert_eq!(call!(instance, Terminate), Status::OK),
        _ => panic!("{} cannot be reached", state.name()),
    }
}

/// Calls a function with arguments that are right wherever it is allowed.
fn poke(instance: &Instance, function: Function, state: FmuState, saved_bytes: &[u8]) -> Status {
    use Function as F;
    let mut size = 0_usize;
    let mut saved = null_mut();
    let mut bytes = saved_bytes.to_vec();
    let (n, data) = (bytes.len(), bytes.as_mut_ptr().cast());
    let (mut real, mut boolean, mut integer, mut step) = (0.0, 0, 0, Status::OK);
    let mut string = null();
    let mut info = EventInfo {
        new_discrete_states_needed: 7,
        terminate_simulation: 7,
        nominals_of_continuous_states_changed: 7,
        values_of_continuous_states_changed: 7,
        next_event_time_defined: 7,
        next_event_time: f64::NAN,
    };
    let status = match function {
        F::SetDebugLogging => call!(instance, SetDebugLogging, 1, 0, null()),
        F::SetupExperiment => instance.setup(None),
        F::EnterInitializationMode => call!(instance, EnterInitializationMode),
        F::ExitInitializationMode => call!(instance, ExitInitializationMode),
        F::Terminate => call!(instance, Terminate),
        F::Reset => call!(instance, Reset),
        F::GetReal => call!(instance, GetReal, null(), 0, null_mut()),
        F::GetInteger => call!(instance, GetInteger, null(), 0, null_mut()),
        F::GetBoolean => call!(instance, GetBoolean, null(), 0, null_mut()),
        F::GetString => call!(instance, GetString, null(), 0, null_mut()),
        F::SetReal => call!(instance, SetReal, null(), 0, null()),
        F::SetInteger => call!(instance, SetInteger, null(), 0, null()),
        F::SetBoolean => call!(instance, SetBoolean, null(), 0, null()),
        F::SetString => call!(instance, SetString, null(), 0, null()),
        F::GetFmuState => call!(instance, GetFmuState, &raw mut saved),
        F::SetFmuState => call!(instance, SetFmuState, state),
        F::FreeFmuState => call!(instance, FreeFmuState, &raw mut saved),
        F::SerializedFmuStateSize => call!(instance, SerializedFmuStateSize, state, &raw mut size),
        F::SerializeFmuState => call!(instance, SerializeFmuState, state, data, n),
        F::DeSerializeFmuState => call!(instance, DeSerializeFmuState, data, n, &raw mut saved),
        F::GetDirectionalDerivative => {
            call!(
                instance,
                GetDirectionalDerivative,
                null(),
                0,
                null(),
                0,
                null(),
                null_mut()
            )
        }
        F::SetRealInputDerivatives => {
            call!(instance, SetRealInputDerivatives, null(), 0, null(), null())
        }
        F::GetRealOutputDerivatives => {
            call!(
                instance,
                GetRealOutputDerivatives,
                null(),
                0,
                null(),
                null_mut()
            )
        }
        F::DoStep => instance.step(0.0, 1e-3),
        F::CancelStep => call!(instance, CancelStep),
        F::GetStatus => call!(
            instance,
            GetStatus,
            StatusKind::DO_STEP_STATUS,
            &raw mut step
        ),
        F::GetRealStatus => {
            call!(
                instance,
                GetRealStatus,
                StatusKind::LAST_SUCCESSFUL_TIME,
                &raw mut real
            )
        }
        F::GetIntegerStatus => {
            call!(
                instance,
                GetIntegerStatus,
                StatusKind::TERMINATED,
                &raw mut integer
            )
        }
        F::GetBooleanStatus => {
            call!(
                instance,
                GetBooleanStatus,
                StatusKind::TERMINATED,
                &raw mut boolean
            )
        }
        F::GetStringStatus => {
            call!(
                instance,
                GetStringStatus,
                StatusKind::PENDING_STATUS,
                &raw mut string
            )
        }
        F::EnterEventMode => call!(instance, EnterEventMode),
        F::NewDiscreteStates => call!(instance, NewDiscreteStates, &raw mut info),
        F::EnterContinuousTimeMode => call!(instance, EnterContinuousTimeMode),
        F::CompletedIntegratorStep => {
            let (enter, terminate) = (&raw mut boolean, &raw mut integer);
            call!(instance, CompletedIntegratorStep, 1, enter, terminate)
        }
        F::SetTime => call!(instance, SetTime, 0.0),
        F::SetContinuousStates => call!(instance, SetContinuousStates, &raw const real, 1),
        F::GetDerivatives => call!(instance, GetDerivatives, &raw mut real, 1),
        F::GetEventIndicators => call!(instance, GetEventIndicators, null_mut(), 0),
        F::GetContinuousStates => call!(instance, GetContinuousStates, &raw mut real, 1),
        F::GetNominalsOfContinuousStates => {
            call!(instance, GetNominalsOfContinuousStates, &raw mut real, 1)
        }
        F::GetTypesPlatform | F::GetVersion | F::Instantiate | F::FreeInstance => {
            unreachable!("no calling order")
        }
    };
    if !saved.is_null() {
        call!(instance, FreeFmuState, &raw mut saved);
    }
    status
}

/// States of an instance that can be reached, and the part of the interface that is for the other kind.
const KINDS: [(Type, Part, &[State]); 2] = [
    (
        Type::CO_SIMULATION,
        Part::ModelExchange,
        &[
            State::Instantiated,
            State::InitializationMode,
            State::StepComplete,
            State::StepFailed,
            State::Terminated,
            State::Error,
        ],
    ),
    (
        Type::MODEL_EXCHANGE,
        Part::CoSimulation,
        &[
            State::Instantiated,
            State::InitializationMode,
            State::EventMode,
            State::ContinuousTimeMode,
            State::Terminated,
            State::Error,
        ],
    ),
];

/// FMI rule 24: the calling order, of both kinds.
#[test]
fn the_table_of_legal_states_is_obeyed() {
    use Function as F;
    let raw = Raw::new(unstable());
    let messages = Messages::default();
    let free = [
        F::GetTypesPlatform,
        F::GetVersion,
        F::Instantiate,
        F::FreeInstance,
    ];
    let functions = Function::ALL.iter().filter(|f| !free.contains(f));
    let (mut allowed, mut refused, mut foreign) = (0, 0, 0);
    for (kind, other, states) in KINDS {
        let keeper = raw.instantiate_as(kind, &messages);
        let state = keeper.get_state(null_mut());
        let saved_bytes = keeper.serialize(state);
        for &function in functions.clone() {
            for &at in states {
                let instance = raw.instantiate_as(kind, &messages);
                // The step fails for the state's sake; the input must not be 0.
                assert_eq!(instance.set("target", 1.0), Status::OK);
                reach(&instance, at);
                messages.take();
                let status = poke(&instance, function, state, &saved_bytes);
                let logged = messages.take();
                let place = format!("{} in {}: {logged:?}", function.name(), at.name());
                if function.is_legal_in(at) && function.part() != other {
                    allowed += 1;
                    // The kinds of status that do not exist are discarded, which is no refusal.
                    assert!(status == Status::OK || status == Status::DISCARD, "{place}");
                    continue;
                }
                assert_eq!(status, Status::ERROR, "{place}");
                let reason = match function.is_legal_in(at) {
                    false => format!("not allowed in state \"{}\"; it is allowed in ", at.name()),
                    true => "it is for ".to_owned(),
                };
                refused += usize::from(!function.is_legal_in(at));
                foreign += usize::from(function.is_legal_in(at));
                let expected = format!(
                    "test: fmi2Error [logStatusError] {}: {reason}",
                    function.name()
                );
                assert!(logged[0].starts_with(&expected), "{place}");
            }
        }
        keeper.free_state(state);
    }
    assert_eq!((allowed, refused, foreign), (236, 220, 24));
}

/// FMI rule 25: a step that cannot be done is discarded.
#[test]
fn a_discarded_step_tells_how_far_it_came_and_changes_nothing() {
    let raw = Raw::new(unstable());
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    assert_eq!(instance.set("target", 1.0), Status::OK);
    instance.initialize();
    assert_eq!(instance.step(0.0, 0.01), Status::OK);
    let state = instance.get_state(null_mut());
    let before = instance.bits();
    assert_eq!(instance.step(0.01, 10.0), Status::DISCARD);
    assert_eq!(
        messages.take(),
        [
            "test: fmi2Discard [logStatusDiscard] fmi2DoStep: the step from 0.01 s could not be done: \
             the linear system overflows within a step of 10 s; take a smaller step"
        ]
    );
    let (mut time, mut ended, mut status) = (f64::NAN, 7, Status::FATAL);
    let kind = StatusKind::LAST_SUCCESSFUL_TIME;
    assert_eq!(
        call!(instance, GetRealStatus, kind, &raw mut time),
        Status::OK
    );
    let kind = StatusKind::TERMINATED;
    assert_eq!(
        call!(instance, GetBooleanStatus, kind, &raw mut ended),
        Status::OK
    );
    let kind = StatusKind::DO_STEP_STATUS;
    assert_eq!(
        call!(instance, GetStatus, kind, &raw mut status),
        Status::OK
    );
    assert_eq!((time, ended, status), (0.01, 0, Status::DISCARD));
    assert_eq!(instance.bits(), before);
    // The importer goes back and takes a shorter step.
    assert_eq!(call!(instance, SetFmuState, state), Status::OK);
    assert_eq!(instance.step(0.01, 0.01), Status::OK);
    instance.free_state(state);
}
