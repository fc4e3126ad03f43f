//! Errors of model exchange runs.

use crate::CallError;
use crate::instance::MAX_EVENT_INDICATORS;
use pilotage_ode::IntegrationError;
use thiserror::Error;

/// Why a model exchange run failed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RunError {
    /// A call failed.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The solver failed.
    #[error(transparent)]
    Integration(#[from] IntegrationError<CallError>),
    /// The requested time is not after the current one.
    #[error("the run is at {time} s and cannot go to {target} s")]
    Backwards {
        /// Current time \[s\].
        time: f64,
        /// Requested time \[s\].
        target: f64,
    },
    /// A saved state is that of another model.
    #[error("the state has {found} continuous states, and the FMU {expected}")]
    OtherStates {
        /// Of the state.
        found: usize,
        /// Of the FMU.
        expected: usize,
    },
    /// The event iteration does not end.
    #[error(
        "at {time} s the FMU still wants new discrete states after {rounds} rounds of the event iteration"
    )]
    EventIteration {
        /// Time \[s\].
        time: f64,
        /// Number of rounds.
        rounds: u32,
    },
    /// It reports more event indicators than any model has.
    #[error(
        "it has {indicators} event indicators; {MAX_EVENT_INDICATORS} are the most that are taken"
    )]
    Indicators {
        /// Number of event indicators.
        indicators: usize,
    },
    /// Events accumulate (Zeno behaviour), or chatter.
    #[error(
        "{events} events within {span:e} s at {time} s: the model chatters, or its events come ever faster"
    )]
    Chattering {
        /// Time \[s\].
        time: f64,
        /// Number of events.
        events: u32,
        /// Time span of the events \[s\].
        span: f64,
    },
}
