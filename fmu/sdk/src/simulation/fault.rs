//! Why a step failed.

use crate::Table;
use crate::lti::TransitionError;
use pilotage_ode::IntegrationError;
use std::convert::Infallible;

/// Why a step failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepFault {
    /// The exact step of a linear model cannot be computed.
    #[error(transparent)]
    Linear(#[from] TransitionError),
    /// The integration was aborted.
    #[error(
        "{0} (times count from the beginning of the communication step; a solution that grows without bound \
         and a tolerance that is too strict end so as well)"
    )]
    Integration(#[from] IntegrationError<Infallible>),
    /// The integration was aborted where an expression is not finite.
    #[error("at {time} s: {cause}; the integration ends there")]
    Trouble {
        /// Time \[s\].
        time: f64,
        /// The expression and its position.
        cause: String,
    },
    /// The integration takes too long.
    #[error(
        "{limit} steps of the integrator were not enough for {step} s, only for {time} s; take a shorter \
         step or slower coefficients; a jump that pushes back from both sides, such as dry friction by sign(v), \
         needs a width, as in sat(v / 0.01, 1)"
    )]
    TooManySteps {
        /// Time reached, from the start of the step \[s\].
        time: f64,
        /// The step \[s\].
        step: f64,
        /// The limit.
        limit: usize,
    },
    /// A state is no longer finite.
    #[error("state {state} is {value} after {step} s; the model or what drives it is unstable")]
    NotFinite {
        /// The state's name.
        state: String,
        /// Its value.
        value: f64,
        /// The step \[s\].
        step: f64,
    },
    /// Events occur ever faster.
    #[error(
        "{limit} events within {step} s; the model's events follow each other without end, as those of \
         a bouncing ball do that never comes to rest"
    )]
    TooManyEvents {
        /// The limit.
        limit: usize,
        /// The step \[s\].
        step: f64,
    },
    /// The event iteration does not end.
    #[error("the event at {time} s changes the states again and again ({limit} times)")]
    EndlessEvent {
        /// Time \[s\].
        time: f64,
        /// The limit.
        limit: usize,
    },
}

/// A step that ended early. The simulation keeps the state that it reached.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{fault}")]
pub struct StepError {
    /// Reason.
    pub fault: StepFault,
    /// Time reached \[s\]: 0 if nothing has changed.
    pub reached: f64,
}

/// A state that is not finite, and its value.
pub(super) fn not_finite(table: &Table, state: usize, value: f64, step: f64) -> StepFault {
    let index = table.x().nth(state).unwrap_or_default();
    StepFault::NotFinite {
        state: table.variables()[index].name.clone(),
        value,
        step,
    }
}
