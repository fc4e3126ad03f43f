//! Co-simulation: slaves that are wired together and stepped side by side.
//!
//! ```text
//! slaves + connections -> System -> run(clock, algorithm) -> Recorder
//! ```
//!
//! The master knows [`Slave`]s, not FMUs, and counts time (`t = t0 + k·h`) instead of summing it. It
//! never gets a value after a set without a step between them, as FMI 2.0 asks (section 4.2.4).
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`slave`] | what a slave offers: variables, and ten calls |
//! | [`fmu_slave`] | FMUs of FMI 2.0 and 3.0 as slaves: co-simulation, and model exchange with a solver |
//! | [`native_slave`] | models in Rust as slaves |
//! | [`system`] | who is wired to whom, checked |
//! | [`clock`] | communication points, counted |
//! | [`algorithms`] | Jacobi, Gauss-Seidel and strong coupling; extrapolation; step-size control |
//! | [`master`] | initialization and the stepping loop |
//! | [`mod@linearize`] | the linear system about where the slaves stand, and its loops |
//! | [`recorder`] | where the rows go |
//! | [`report`] | what a run did, and how far its coupling is to be trusted |
//! | [`selection`] | which signals are recorded, and how often |
//! | [`source`] | signals over time, from a table |

pub mod algorithms;
pub mod clock;
pub mod fmu_slave;
pub mod linearize;
pub mod master;
pub mod native_slave;
pub mod recorder;
pub mod report;
pub mod selection;
pub mod slave;
pub mod source;
pub mod system;

pub use algorithms::{Algorithm, Control, Coupling, Iteration, MAX_EXTRAPOLATION};
pub use clock::Clock;
pub use fmu_slave::{FmuSlave, ModelExchangeSlave};
pub use linearize::{Linearization, LinearizeError, Loop, linearize};
pub use master::{Ending, MasterError, Run, run};
pub use native_slave::NativeSlave;
pub use recorder::{CsvRecorder, Recorder, SeriesRecorder};
pub use report::{
    Calls, ConnectionReport, CouplingError, Divergence, Report, SlaveReport, Steps, Transfer,
};
pub use selection::{Selection, SelectionError, Thinned};
pub use slave::{
    Abilities, Base, Conversion, Experiment, Kind, Progress, Role, Slave, Unit, Value, Variable,
};
pub use source::{Source, SourceError};
pub use system::{System, SystemError};
