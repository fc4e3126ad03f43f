//! FMI 2.0 and 3.0: anybody's FMU, read, loaded and called. Whether it follows the standard is `pilotage-fmi-check`'s
//! to say; what must hold before it is unpacked and loaded is checked here.
//!
//! An FMU hides a model behind C functions (Modelica Association, *Functional Mock-up Interface*). For
//! co-simulation it takes steps by itself; for model exchange it gives the right-hand side and the events,
//!
//! ```text
//! y(t + h) = step(x(t), u)     or     ẋ = f(t, x, u),   y = g(t, x, u),   an event where z(t, x, u) changes its sign
//! ```
//!
//! and [`simulate`] solves them. This crate is for those who write a simulator or a checker; several FMUs together
//! are `pilotage-cosim`'s, FMUs of one's own models `pilotage-sdk`'s. An FMU of `ẋ = -x`, `x(0) = 1`, in ten
//! steps:
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
//! | [`archive`] | the zip file: checked, then unpacked |
//! | [`platform`] | names of platforms; which folder holds this machine's binary |
//! | [`binary`] | a look into the binary before it is loaded |
//! | [`binding`] | the binary loaded, with the addresses of its functions |
//! | [`instance`] | an instance, safe to call in any order |
//! | [`memory`] | what FMUs get by callbacks, and whether they give it back |
//! | [`simulate`] | a model exchange instance, integrated in time |
//! | [`surroundings`] | what is the whole process's, and no FMU's to change |
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
mod message;
pub mod platform;
pub mod simulate;
pub mod surroundings;
mod version;

pub use description::FmiVersion;
pub use environment::{Intermediate, IntermediateUpdate, take_stray_messages};
pub use fmu::{Fmu, FmuError};
pub use instance::{CallError, Instance, InstanceOptions, Step};
pub use message::Message;
pub use simulate::{ModelExchangeRun, Reached, RunError, RunOptions};
pub use version::{ASKING, Function, InterfaceType, State, call_name};
