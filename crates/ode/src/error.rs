//! Why a solution cannot go on.

use thiserror::Error;

/// Why a solution cannot go on.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IntegrationError<E: std::error::Error + 'static> {
    /// An evaluation failed.
    #[error(transparent)]
    Evaluation(#[from] E),
    /// The derivatives are not defined where the solver has to start.
    #[error("the derivatives are not defined at {time} s")]
    Undefined {
        /// Where \[s\].
        time: f64,
    },
    /// However short the step: something is not defined, NaN or infinite there.
    #[error("{what} are not defined or not finite shortly after {time} s, however short the step")]
    UndefinedBeyond {
        /// Where the last good step ended \[s\].
        time: f64,
        /// What is not: derivatives or event indicators.
        what: &'static str,
    },
    /// No step is short enough.
    #[error(
        "at {time} s a step of {step:e} s still has too large an error: is there a jump that is no event, or a pole?"
    )]
    StepTooShort {
        /// Where \[s\].
        time: f64,
        /// Length of the last attempt \[s\].
        step: f64,
    },
}
