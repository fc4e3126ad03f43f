//! The C interfaces between importer and FMU of FMI 2.0 and FMI 3.0, as types and data.
//!
//! [`fmi2`] and [`fmi3`] have the same three modules:
//!
//! | module | content |
//! | --- | --- |
//! | `types` | value types, status codes, callback functions (the standard's C headers) |
//! | `functions` | every function: name, pointer type, part, and the states in which it may be called |
//! | `states` | the states of an instance and sets of them |
//! | [`fmi2`](mod@fmi2) | FMI 2.0 |
//! | [`fmi3`](mod@fmi3) | FMI 3.0 |
//! | `tables` | macros for the tables of both |
//!
//! This crate contains declarations only: no unsafe code, no behaviour, no dependencies.

pub mod fmi2;
pub mod fmi3;
mod tables;

/// The part of an interface that a function belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// Needed by every kind of FMU.
    Common,
    /// For co-simulation only.
    CoSimulation,
    /// For model exchange only.
    ModelExchange,
    /// For scheduled execution only (FMI 3.0).
    ScheduledExecution,
}
