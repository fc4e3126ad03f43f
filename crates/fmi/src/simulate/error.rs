//! Why a run of model exchange cannot go on.

use crate::CallError;
use crate::instance::MAX_EVENT_INDICATORS;
use pilotage_ode::IntegrationError;
use thiserror::Error;

/// Why a run of model exchange cannot go on.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RunError {
    /// A call failed.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The solver cannot go on.
    #[error(transparent)]
    Integration(#[from] IntegrationError<CallError>),
    /// The event iteration does not end.
    #[error(
        "at {time} s the FMU still wants new discrete states after {rounds} rounds of the event iteration"
    )]
    EventIteration {
        /// Where \[s\].
        time: f64,
        /// How many rounds there were.
        rounds: u32,
    },
    /// It says that it has more event indicators than any model.
    #[error(
        "it has {indicators} event indicators; {MAX_EVENT_INDICATORS} are the most that are taken"
    )]
    Indicators {
        /// How many.
        indicators: usize,
    },
    /// Events come faster and faster (Zeno), or chatter.
    #[error(
        "{events} events within {span:e} s at {time} s: the model chatters, or its events come ever faster"
    )]
    Chattering {
        /// Where \[s\].
        time: f64,
        /// How many there were.
        events: u32,
        /// In which time \[s\].
        span: f64,
    },
}
