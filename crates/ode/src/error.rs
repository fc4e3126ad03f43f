//! Errors that end a solution.

use thiserror::Error;

/// Why a solution cannot be continued.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IntegrationError<E: std::error::Error + 'static> {
    /// An evaluation failed.
    #[error(transparent)]
    Evaluation(#[from] E),
    /// The state is not finite at the start, or the derivatives are not defined there.
    #[error("the states or their derivatives are not defined or not finite at {time} s")]
    Undefined {
        /// Time \[s\].
        time: f64,
    },
    /// The derivatives or indicators are not defined or not finite, however short the step.
    #[error("{what} are not defined or not finite shortly after {time} s, however short the step")]
    UndefinedBeyond {
        /// End of the last accepted step \[s\].
        time: f64,
        /// What is undefined: derivatives or event indicators.
        what: &'static str,
    },
    /// The error is too large even with the shortest step.
    #[error(
        "at {time} s a step of {step:e} s still has too large an error: is there a jump that is no event, or a pole?"
    )]
    StepTooShort {
        /// Time \[s\].
        time: f64,
        /// Length of the last attempt \[s\].
        step: f64,
    },
}
