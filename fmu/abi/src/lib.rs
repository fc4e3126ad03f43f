//! The C interfaces of FMI 2.0 and FMI 3.0, as types and data: what an importer and an FMU agree on.
//!
//! [`fmi2`] and [`fmi3`] have the same three modules:
//!
//! | module | what it holds |
//! | --- | --- |
//! | `types` | value types, status codes, callback functions (the standard's C headers) |
//! | `functions` | every function: name, pointer type, part, and the states in which it may be called |
//! | `states` | the states of an instance and sets of them |
//!
//! Nothing here is unsafe and nothing here does anything; this crate has no dependencies.

pub mod fmi2;
pub mod fmi3;
mod tables;

/// The part of an interface that a function belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// Needed by every kind of FMU.
    Common,
    /// For co-simulation alone.
    CoSimulation,
    /// For model exchange alone.
    ModelExchange,
    /// For scheduled execution alone (FMI 3.0).
    ScheduledExecution,
}
