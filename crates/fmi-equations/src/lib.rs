//! The equations of a model-exchange FMU, as needed by solvers for estimation and control.
//!
//! ```text
//! [ẋ; y] = F(t, x, u; p),   ∂F/∂[x, u] by the FMU's directional derivatives, or by differences whose step is checked
//! ```
//!
//! [`open`] returns them as a [`Model`] of `pilotage-expression`, whose derivatives and outputs are calls of the FMU:
//! it can be joined with other models, its parameters become numbers or unknowns, and first and second derivatives are
//! taken as of any expression. Second derivatives are differences of the first; they only steer a search, and no result
//! depends on their last digits. Several instances are evaluated in parallel if the FMU allows it; a changed parameter
//! requires initialising an instance again.
//!
//! Events are not handled here: between events an FMU's equations are smooth, and its event indicators, which are
//! appended to the outputs, show where an event would be ([`FmuEquations::indicators`], [`FmuEquations::next_event`]).
//!
//! ```no_run
//! use pilotage_expression::Tape;
//!
//! let vehicle = pilotage_fmi_equations::open("aircraft.fmu".as_ref())?;
//! let system = &vehicle.model.system;
//! println!("{:?} over {:?}", vehicle.model.states, vehicle.model.parameters);
//! let mut graph = system.graph.clone();
//! let by_first = graph.derivatives(&system.derivatives, system.state(0));
//! let tape = Tape::new(&graph, system.variables(), |_| false, &[&system.derivatives, &by_first]);
//! let values = tape.evaluate(&vec![0.0; system.variables()]); // time, states, inputs, parameters
//! # Ok::<(), pilotage_fmi_equations::EquationsError>(())
//! ```
//!
//! At a point where a call fails, the values are NaN, and [`Opaque::trouble`] returns the reason.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `layout` | the variables of the description that make up the equations |
//! | `pool` | instances, each initialised with certain parameters |
//! | `rates` | values and derivatives |
//! | `initial` | states after initialisation |
//! | `explore` | check of the FMU's derivatives and dependencies |

mod explore;
mod initial;
mod layout;
mod pool;
mod rates;

pub use layout::Variable;
pub use pool::PointError;

use initial::InitialStates;
use layout::Layout;
use pilotage_expression::{Graph, Model, Node, Opaque, Partial, System};
use pilotage_fmi::{Fmu, FmuError};
use pool::Pool;
use rates::Rates;
use std::path::Path;
use std::sync::{Arc, Mutex};
use thiserror::Error;

/// Why an FMU cannot be used as equations.
#[derive(Debug, Error)]
pub enum EquationsError {
    /// It cannot be opened or loaded.
    #[error(transparent)]
    Fmu(Box<FmuError>),
    /// It is not for model exchange.
    #[error(
        "it is not for model exchange: a fit needs its equations, which co-simulation hides; export it for model exchange"
    )]
    NoEquations,
    /// A listed derivative does not exist.
    #[error("its ModelStructure lists a derivative, number {index}, that is no variable")]
    Structure {
        /// Index of the variable, from 1.
        index: u32,
    },
    /// The derivative of a state, in an FMU that lists no states (FMI 2.0.4, section 2.2.8; FMI 3.0, section 2.4.8).
    #[error(
        "its ModelStructure lists no derivatives of states, and `{derivative}` is that of `{state}`: a fit needs model \
         exchange with all states and derivatives declared"
    )]
    Unlisted {
        /// The derivative.
        derivative: String,
        /// The state whose derivative it is.
        state: String,
    },
    /// Two variables with the same name.
    #[error(
        "its description has two variables called `{name}`, or lists the derivative of that state twice"
    )]
    Same {
        /// The name.
        name: String,
    },
    /// A variable that is no local, or none that can be an output.
    #[error("`{name}` is no local variable that may be an output")]
    NoLocal {
        /// The name.
        name: String,
    },
    /// A state is an array.
    #[error("its derivative `{name}` belongs to no state that is a single real")]
    Array {
        /// Name of the derivative.
        name: String,
    },
    /// It cannot be initialised, or returns no values at its start.
    #[error("it gives no values at its start")]
    Start {
        /// The cause.
        source: Box<PointError>,
    },
    /// A value at its start is not finite.
    #[error("at its start {name} is {value}")]
    NotFinite {
        /// Name of the value.
        name: String,
        /// The value.
        value: f64,
    },
}

impl From<FmuError> for EquationsError {
    fn from(error: FmuError) -> Self {
        Self::Fmu(Box::new(error))
    }
}

impl From<PointError> for EquationsError {
    fn from(error: PointError) -> Self {
        Self::Start {
            source: Box::new(error),
        }
    }
}

/// An FMU as equations.
#[derive(Debug, Clone)]
pub struct FmuEquations {
    /// The equations. Outputs that are states are left out; event indicators follow the outputs.
    pub model: Model,
    /// Start value of each state, as an expression of the parameters.
    pub starts: Vec<Node>,
    /// States, inputs, parameters and outputs.
    pub variables: Vec<Variable>,
    /// Names of the event indicators among the outputs.
    pub indicators: Vec<String>,
    /// Time of the first time event of an instance that starts at 0 with its start values \[s\].
    pub next_event: Option<f64>,
    /// For FMUs exported by pilotage: states, each with the parameter that sets its start value.
    pub start_parameters: Vec<(String, String)>,
    /// Names of all continuous local variables that [`open_with`] accepts.
    pub locals: Vec<String>,
    /// Parameters that are not scalar reals of double precision, each with its type.
    pub others: Vec<(String, String)>,
    /// Findings where the FMU contradicts its description.
    pub notes: Vec<String>,
    /// Whether the FMU can still be called.
    pub calls: Calls,
    /// The function itself, which holds the reason if a call failed.
    pub function: Arc<dyn Opaque>,
}

/// Whether an FMU can still be called.
#[derive(Debug, Clone)]
pub struct Calls(Arc<Rates>);

impl Calls {
    /// The call that ended with a fatal error; no further calls are made after it.
    pub fn fatal(&self) -> Option<String> {
        self.0.pool.fatal()
    }
}

/// Loads an FMU and checks its equations at its start.
///
/// # Foreign code
/// The FMU's code runs in this process, with its rights: [`Fmu::load`]; also whenever the equations are evaluated.
///
/// # Errors
/// If it cannot be loaded, is not for model exchange, has states that are arrays, or returns no values at its start.
pub fn open(path: &Path) -> Result<FmuEquations, EquationsError> {
    open_with(path, &[])
}

/// Like [`open`], with these of its [locals](FmuEquations::locals) among the outputs. Their derivatives are
/// differences: an FMU provides directional derivatives for its outputs only.
///
/// # Foreign code
/// As [`open`].
///
/// # Errors
/// As [`open`], and if a name is not among the locals.
pub fn open_with(path: &Path, locals: &[String]) -> Result<FmuEquations, EquationsError> {
    let mut fmu = Fmu::open(path)?;
    let mut layout = Layout::new(fmu.description(), locals)?;
    let start_parameters = layout.start_parameters(fmu.description());
    let pool = Pool::new(fmu.load()?);
    let parameters: Vec<f64> = layout.parameters.iter().map(|own| own.start).collect();
    let first = |layout: &mut Layout| -> Result<(Vec<f64>, Option<f64>), PointError> {
        let (initial, next, indicators) = pool.with(layout, &parameters, 0.0, |held| {
            Ok((held.initial.clone(), held.next_event, held.indicators))
        })?;
        layout.indicators = indicators;
        Ok((initial, next))
    };
    let (initial, next_event) = first(&mut layout)?;
    for (state, value) in layout.states.iter_mut().zip(&initial) {
        state.start = *value;
    }
    let all = [&layout.states, &layout.inputs, &layout.parameters];
    let starts = all.into_iter().flatten().map(|own| own.start);
    let start: Vec<f64> = [0.0].into_iter().chain(starts).collect();
    let size = start.len();
    let mut rates = Rates {
        by_fmu: layout.has_derivatives,
        curved: vec![vec![true; size]; size],
        steps: vec![explore::STEPS[0]; size],
        start,
        layout,
        pool,
        trouble: Mutex::new(None),
    };
    check_start(&rates)?;
    let notes = explore::explore(&mut rates);
    Ok(FmuEquations {
        next_event,
        notes,
        start_parameters,
        ..made(Arc::new(rates))
    })
}

/// Rejects derivatives and outputs that are not finite at the start.
fn check_start(rates: &Rates) -> Result<(), EquationsError> {
    let values = rates.values(&rates.start)?;
    let states = rates
        .layout
        .states
        .iter()
        .map(|own| format!("the derivative of `{}`", own.name));
    let outputs = rates
        .layout
        .outputs
        .iter()
        .map(|own| format!("`{}`", own.name));
    let mut named = states.chain(outputs).zip(values);
    match named.find(|(_, value)| !value.is_finite()) {
        Some((name, value)) => Err(EquationsError::NotFinite { name, value }),
        None => Ok(()),
    }
}

/// Builds the equations as calls of the FMU.
fn made(rates: Arc<Rates>) -> FmuEquations {
    let layout = &rates.layout;
    let mut graph = Graph::default();
    let variables: Vec<Node> = (0..layout.arguments()).map(|k| graph.variable(k)).collect();
    let given: Vec<Option<Node>> = variables.iter().copied().map(Some).collect();
    let function: Arc<dyn Opaque> = rates.clone();
    let mut values: Vec<Node> = (0..layout.unknowns() + layout.indicators)
        .map(|value| graph.call(&function, &given, Partial::of(value)))
        .collect();
    let outputs = values.split_off(layout.rates.len());
    let initial: Arc<dyn Opaque> = Arc::new(InitialStates(rates.clone()));
    let of_start = &given[layout.parameter_arguments()];
    let starts = layout
        .states
        .iter()
        .enumerate()
        .map(|(k, state)| match state.is_computed {
            true => graph.call(&initial, of_start, Partial::of(k)),
            false => graph.constant(state.start),
        });
    let starts = starts.collect();
    let names = |own: &[Variable]| own.iter().map(|own| own.name.clone()).collect::<Vec<_>>();
    let numbers = 1..=layout.indicators;
    let indicators: Vec<String> = numbers.map(|k| format!("event indicator {k}")).collect();
    let all = [
        &layout.states,
        &layout.inputs,
        &layout.parameters,
        &layout.outputs,
    ];
    FmuEquations {
        model: Model {
            system: System {
                graph,
                states: layout.states.len(),
                inputs: layout.inputs.len(),
                parameters: layout.parameters.len(),
                derivatives: values,
                outputs,
            },
            states: names(&layout.states),
            inputs: names(&layout.inputs),
            parameters: names(&layout.parameters),
            outputs: names(&layout.outputs)
                .into_iter()
                .chain(indicators.iter().cloned())
                .collect(),
        },
        starts,
        variables: all.into_iter().flatten().cloned().collect(),
        indicators,
        next_event: None,
        locals: layout.locals.clone(),
        others: layout.others.clone(),
        notes: Vec::new(),
        start_parameters: Vec::new(),
        calls: Calls(rates.clone()),
        function,
    }
}
