//! FMI 2.0 and 3.0: anybody's FMU, read, loaded and called. Whether it follows the standard is `pilotage-fmi-check`'s
//! to say; what must hold before it is unpacked and loaded is checked here.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`description`] | modelDescription.xml: typed model, reader, writer |
//! | [`archive`] | the zip file: checked, then unpacked |
//! | [`platform`] | names of platforms; which folder holds this machine's binary |
//! | [`binary`] | a look into the binary before it is loaded |
//! | [`binding`] | the binary loaded, with the addresses of its functions |
//! | [`instance`] | an instance, safe to call in any order |
//! | [`memory`] | what FMUs get by callbacks, and whether they give it back |
//! | [`simulate`] | a model exchange instance, integrated in time |
//! | [`fmu`] | all of it together: [`Fmu::open`], [`Fmu::load`], [`fmu::Library::instantiate`] |
//!
//! What FMUs say goes to `tracing` (target `fmu`; fields `instance`, `category`, `status`) and, where a call
//! fails, into its error.

pub mod archive;
pub mod binary;
pub mod binding;
pub mod description;
mod environment;
pub mod fmu;
pub mod instance;
mod logger;
pub mod memory;
pub mod platform;
pub mod simulate;
mod version;

pub use description::FmiVersion;
pub use environment::{Intermediate, IntermediateUpdate, take_stray_messages};
pub use fmu::{Fmu, FmuError};
pub use instance::{CallError, Instance, Options, Step};
pub use logger::Message;
pub use simulate::{ModelExchangeRun, Reached, RunError, RunOptions};
pub use version::{Function, Kind, State};
