//! Co-simulation: components that are wired together and stepped side by side.
//!
//! ```text
//! components + connections -> System -> run(clock, algorithm) -> Recorder
//! ```
//!
//! The master knows [`Component`]s, not FMUs, and counts time (`t = t0 + k·h`) instead of summing it. It
//! never gets a value after a set without a step between them, as FMI 2.0 asks (section 4.2.4).
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`component`] | what a component offers: variables, and ten calls |
//! | [`fmu_component`] | FMUs of FMI 2.0 and 3.0 as components: co-simulation, and model exchange with a solver; in this process or in one of their own |
//! | [`native_component`] | models in Rust as components |
//! | [`system`] | who is wired to whom, checked |
//! | [`description`] | what a system is made of, as files and command lines say it |
//! | [`clock`] | communication points, counted |
//! | [`algorithms`] | Jacobi, Gauss-Seidel and strong coupling; extrapolation; step-size control |
//! | [`master`] | initialization and the stepping loop |
//! | [`finite`] | which signals of a run are NaN or infinite |
//! | [`mod@linearize`] | the linear system about where the components stand, and its loops |
//! | [`recorder`] | where the rows go |
//! | [`report`] | what a run did, and how far its coupling is to be trusted |
//! | [`selection`] | which signals are recorded, and how often |
//! | [`source`] | signals over time, from a table |

pub mod algorithms;
pub mod clock;
pub mod component;
pub mod description;
pub mod finite;
pub mod fmu_component;
pub mod linearize;
pub mod master;
pub mod native_component;
pub mod recorder;
pub mod report;
pub mod selection;
pub mod source;
pub mod system;

pub use algorithms::{Algorithm, Control, Coupling, Iteration, MAX_EXTRAPOLATION};
pub use clock::Clock;
pub use component::{
    Abilities, Base, Component, Conversion, Experiment, Progress, Role, Unit, Value, ValueKind,
    Variable,
};
pub use description::{DescriptionError, SystemDescription};
pub use finite::{Finite, NotFinite, NotFiniteSignal};
pub use fmu_component::isolated::{Isolated, Limits, Program};
pub use fmu_component::{FmuComponent, ModelExchangeComponent};
pub use linearize::{Linearization, LinearizeError, Loop, linearize};
pub use master::{Components, Ending, MasterError, Run, run, run_open};
pub use native_component::NativeComponent;
pub use recorder::{CsvRecorder, Recorder, SeriesRecorder};
pub use report::{
    Calls, ConnectionReport, CouplingError, Divergence, InstanceReport, Report, Steps, Transfer,
};
pub use selection::{Selection, SelectionError, Thinned};
pub use source::{Source, SourceError};
pub use system::{System, SystemError};
