//! The 75 functions of FMI 3.0: co-simulation with event mode and early return, and model exchange. Scheduled
//! execution, clocks and structural parameters are rejected, since models have none.
//!
//! They are generic over the model; [`export!`](crate::export) makes C functions of them. Each pointer must be NULL or
//! valid as the standard requires; the C caller guarantees this.

// Names and conditions on pointers are those of the standard.
#![allow(non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments)]

mod absent;
mod common;
mod lifecycle;
mod modes;

pub use absent::*;
pub use common::*;
pub use lifecycle::*;
pub use modes::*;

use crate::SimulationUnit;
use crate::abi::Part;
use crate::abi::fmi3::{Function, State, Status};
use crate::guard::{Component, Version, call};
use crate::instance::Phase;
use crate::problem::{Problem, Severity};

/// FMI 3.0.
#[derive(Debug, Clone, Copy)]
pub struct Fmi3;

/// A function for model exchange, of a unit for co-simulation alone: the call is refused.
pub unsafe fn refused<U: SimulationUnit>(
    instance: crate::abi::fmi3::types::Instance,
    function: Function,
) -> Status {
    let body = |_: &mut Component<U, Fmi3>| Ok(());
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(instance, function, body) }
}

impl Version for Fmi3 {
    type State = State;
    type Function = Function;
    type Status = Status;
    const NUMBER: u8 = 3;

    fn legal(function: Function, state: State) -> Result<(), String> {
        match function.is_legal_in(state) {
            true => Ok(()),
            false => {
                let states = function.legal_states();
                let names: Vec<_> = states.iter().map(State::name).collect();
                Err(names.join(", "))
            }
        }
    }

    fn part(function: Function) -> Part {
        function.part()
    }

    fn name(function: Function) -> &'static str {
        function.name()
    }

    fn state_name(state: State) -> &'static str {
        state.name()
    }

    fn phase(state: State) -> Phase {
        match state {
            State::Instantiated | State::InitializationMode => Phase::Start,
            State::ContinuousTimeMode | State::IntermediateUpdateMode => Phase::Continuous,
            _ => Phase::Event,
        }
    }

    fn after(problem: &Problem, state: State) -> State {
        match problem.severity() {
            _ if state == State::Fatal => State::Fatal,
            Severity::Fatal => State::Fatal,
            Severity::Error => State::Error,
            _ => state,
        }
    }

    fn status(severity: Option<Severity>) -> Status {
        Status(severity.map_or(0, |s| s as i32))
    }

    fn bits(state: State) -> u16 {
        state as u16
    }

    fn from_bits(bits: u16) -> Option<State> {
        let living = |s: &State| !matches!(s, State::StartEnd | State::Fatal);
        State::ALL
            .into_iter()
            .filter(living)
            .find(|s| *s as u16 == bits)
    }
}
