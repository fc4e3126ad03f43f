//! The C interface of FMI 2.0 co-simulation, as types and data: what an importer and an FMU agree on.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`types`] | value types, status codes, callback functions (`fmi2TypesPlatform.h`, `fmi2FunctionTypes.h`) |
//! | [`functions`] | the 34 functions: names, pointer types, and the states in which each may be called |
//! | [`states`] | the states of a co-simulation slave (FMI 2.0.5, section 4.2.4) and sets of them |
//!
//! Nothing here is unsafe and nothing here does anything; this crate has no dependencies.

pub mod functions;
pub mod states;
pub mod types;

pub use functions::Function;
pub use states::{State, States};
pub use types::{
    Boolean, Byte, CallbackFunctions, Char, Component, ComponentEnvironment, FALSE, FmuState,
    Integer, Real, Status, StatusKind, TRUE, TYPES_PLATFORM, Type, VERSION, ValueReference,
};
