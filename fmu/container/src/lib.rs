//! The shared library inside an FMU of many: FMI 2.0 and FMI 3.0, for co-simulation.
//!
//! The FMU's `resources/container.toml` says what the [parts](pilotage_cosim::container) are; they lie unpacked beside it. The
//! master of [`pilotage_cosim`] steps them. The C functions are those of [`pilotage_sdk`].
//!
//! | module | content |
//! | --- | --- |
//! | `load` | opens and wires the parts |
//! | `unit` | one instance: values, steps, initialization |
//! | `grid` | communication points between the parts, counted from the start |
//! | `saved` | FMU states |
//! | `inbox` | messages of the parts |
//!
//! There is no global state of its own: instances share nothing but what their parts' libraries share.

mod grid;
mod inbox;
mod load;
mod saved;
mod unit;

pilotage_sdk::export_unit!(unit::Container, load::load);
