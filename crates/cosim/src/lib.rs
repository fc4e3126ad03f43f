//! Co-simulation: connected components that are stepped together.
//!
//! ```text
//! components + connections -> System -> run(clock, algorithm) -> Recorder
//! ```
//!
//! The master handles [`Component`]s, independent of FMI, and counts time (`t = t0 + k·h`) instead of summing it. It
//! never gets a value after a set without a step in between, as FMI 2.0 requires (section 4.2.4).
//!
//! | module | content |
//! | --- | --- |
//! | [`component`] | interface of a component: variables and calls |
//! | [`fmu_component`] | FMI 2.0 and 3.0 FMUs as components: co-simulation, and model exchange with a solver; in this or a separate process |
//! | [`native_component`] | Rust models as components |
//! | [`system`] | instances and connections, with checks |
//! | [`description`] | description of a system in files and command lines |
//! | [`clock`] | communication points |
//! | [`container`] | a system inside one FMU: what its resources say |
//! | [`algorithms`] | Jacobi, Gauss-Seidel and strong coupling; extrapolation; step-size control |
//! | [`master`] | initialization and the stepping loop |
//! | [`finite`] | detection of signals that are NaN or infinite |
//! | [`mod@linearize`] | linearization of the coupled system about its current state, and its loops |
//! | [`recorder`] | output of recorded rows |
//! | [`report`] | statistics of a run and estimates of its coupling error |
//! | [`scenario`] | what happens in a run: signals that are replaced, frozen, delayed, ... |
//! | [`selection`] | selection of recorded signals and their sampling |
//! | [`source`] | signals over time from a table |
//! | [`linearize`](mod@linearize) | the coupled system about its current state |

pub mod algorithms;
pub mod clock;
pub mod component;
pub mod container;
pub mod description;
pub mod finite;
pub mod fmu_component;
pub mod linearize;
pub mod master;
pub mod native_component;
pub mod recorder;
pub mod report;
pub mod scenario;
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
pub use master::{
    Checkpoints, Components, Ending, Kept, MasterError, Run, Session, State, run, run_between,
    run_open,
};
pub use native_component::NativeComponent;
#[cfg(feature = "parquet")]
pub use recorder::ParquetRecorder;
pub use recorder::{CsvRecorder, Recorder, SeriesRecorder};
pub use report::{
    Calls, ConnectionReport, CouplingError, Divergence, InstanceReport, Report, Steps, Transfer,
};
pub use scenario::{Scenario, ScenarioError};
pub use selection::{Selection, SelectionError, Thinned};
pub use source::{Source, SourceError};
pub use system::{Port, System, SystemError};
