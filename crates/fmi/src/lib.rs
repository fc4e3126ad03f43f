//! FMI 2.0 and 3.0: reads, loads and calls FMUs of any tool. `pilotage-fmi-check` checks conformity to the standard;
//! this crate checks what must hold before an FMU is unpacked and loaded.
//!
//! An FMU hides a model behind C functions (Modelica Association, *Functional Mock-up Interface*). For co-simulation it
//! performs the steps itself; for model exchange it provides the right-hand side and the events,
//!
//! ```text
//! y(t + h) = step(x(t), u)     or     ẋ = f(t, x, u),   y = g(t, x, u),   an event where z(t, x, u) changes its sign
//! ```
//!
//! which [`simulate`] integrates. This crate is meant for writing a simulator or a checker; `pilotage-cosim` couples
//! several FMUs, `pilotage-sdk` exports models as FMUs. Ten steps of an FMU of `ẋ = -x`, `x(0) = 1`:
//!
//! ```
//! use pilotage_fmi::{Fmu, InterfaceType, Step};
//! # mod example { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/decay/folder.rs")); }
//!
//! let path = example::decay_fmu()?; // a file `.fmu`, or the folder of an unpacked one, as here
//! let mut fmu = Fmu::open(path.as_ref())?;
//! let (_, x) = fmu.description().variable("x").expect("it says that it has an x");
//! let x = x.value_reference;
//!
//! let mut decay = fmu.load()?.instantiate("decay", InterfaceType::CoSimulation)?;
//! decay.setup_experiment(None, 0.0, 1.0)?;
//! decay.enter_initialization_mode()?;
//! decay.exit_initialization_mode()?;
//! for k in 0..10 {
//!     assert_eq!(decay.do_step(0.1 * f64::from(k), 0.1)?, Step::Done);
//! }
//! let mut values = [0.0];
//! decay.get_real(&[x], &mut values)?;
//! assert!((values[0] - (-1f64).exp()).abs() < 1e-6);
//! decay.terminate()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | what it does |
//! | --- | --- |
//! | [`description`] | modelDescription.xml: typed model, reader, writer |
//! | [`archive`] | the zip file: check and unpacking |
//! | [`platform`] | names of platforms; folder of this machine's binary |
//! | [`binary`] | check of the binary before it is loaded |
//! | [`binding`] | the loaded binary, with the addresses of its functions |
//! | [`instance`] | an instance, safe to call in any order |
//! | [`memory`] | memory that FMUs allocate by callbacks, and whether they free it |
//! | [`sources`] | what an FMU says about the compilation of its sources |
//! | [`simulate`] | a model exchange instance, integrated over time |
//! | [`surroundings`] | state of the process that an FMU must not change |
//! | [`fmu`] | all of these together: [`Fmu::open`], [`Fmu::load`], [`fmu::Library::instantiate`] |
//! | `environment` | callbacks of an instance |
//! | `logger` | logger callbacks |
//! | `message` | messages of FMUs |
//! | `misuse` | what FMUs do with callbacks that the standard does not allow |
//! | `version` | names and numbers that differ between versions of FMI |
//!
//! # Foreign code
//!
//! An FMU is native code of its author. From [`Fmu::load`] on it runs in this process and with its rights: when the library
//! is loaded, in the calls of a [`fmu::Library`] and of an [`Instance`], and when these are dropped. It can do what any
//! program can, and spoil the memory of this one. What comes before only reads: [`Fmu::open`], [`description`], [`archive`],
//! [`binary`].
//!
//! These functions are safe all the same. `unsafe` marks what a caller has to check; no caller can check the code of a
//! library, and that somebody trusts it is decided where the file is chosen, often in another program. The same is true of
//! `std::process::Command`. What a caller could do wrong (order of calls, lengths, pointers) is checked here. To be safe
//! from faults of the code, run it in a process of its own (`pilotage-process`).
//!
//! Messages of FMUs go to `tracing` (target `fmu`; fields `instance`, `category`, `status`) and, if a call fails, into
//! its error.

pub mod archive;
pub mod binary;
pub mod binding;
pub mod description;
mod environment;
pub mod fmu;
pub mod instance;
mod logger;
pub mod memory;
mod message;
mod misuse;
pub mod platform;
pub mod simulate;
pub mod sources;
pub mod surroundings;
mod version;

pub use description::FmiVersion;
pub use environment::{Intermediate, IntermediateUpdate};
pub use fmu::{Fmu, FmuError};
pub use instance::{CallError, Instance, InstanceOptions, Step};
pub use message::{Heard, Message};
pub use misuse::{CATEGORY, INSTANCE_NAME, Misuse, take_misuses};
pub use simulate::{ModelExchangeRun, Reached, RunError, RunOptions};
pub use version::{ASKING, Function, InterfaceType, State, call_name};
