//! The shared library inside every FMU that pilotage exports: FMI 2.0 co-simulation of the models.
//!
//! One library serves every model: which one, and with which start values, stands in the FMU's
//! `resources/model.toml`, so that exporting needs no compiler.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `exports` | the 34 C functions: a thin skin that checks pointers and keeps panics from the host |
//! | `instance` | one instance: the calling order by the table of legal states, get, set, step |
//! | `clock` | communication points, counted |
//! | `checkpoint` | FMU states, and their bytes |
//! | `resources` | from the resource location to the model |
//! | `log` | messages to the importer |
//! | `problem` | everything that can be wrong with a call |
//!
//! There is no global state: instances share nothing.

mod checkpoint;
mod clock;
mod exports;
mod instance;
mod log;
mod problem;
mod resources;
