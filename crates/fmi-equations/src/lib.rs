//! An FMU for model exchange as equations: what a solver for estimation or control needs of it.
//!
//! ```text
//! [ẋ; y] = F(t, x, u; p),   ∂F/∂[x, u] by the FMU's directional derivatives, or by differences whose step is checked
//! ```
//!
//! [`open`] gives them as a [`Model`] of `pilotage-expression`, whose derivatives and outputs are calls of the FMU: it is
//! joined with other models, its parameters become numbers or unknowns, and first and second derivatives are taken as of
//! any expression. Second derivatives are differences of the first; they steer a search, and no result depends on their
//! last digits. Several instances work side by side where the FMU allows it; a parameter that changes initialises one
//! anew.
//!
//! Nothing happens at events here: between them an FMU's equations are smooth, and its event indicators, which are
//! outputs too, tell where one would be ([`FmuEquations::indicators`], [`FmuEquations::next_event`]).
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
//! A point where a call fails has NaN for values, and [`Opaque::trouble`] tells why.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `layout` | what of the description the equations are made of |
//! | `pool` | instances, each initialised with some parameters |
//! | `rates` | values and derivatives |
//! | `initial` | states after initialisation |
//! | `explore` | whether what the FMU says of its derivatives is right |

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

/// Why an FMU cannot be taken as equations.
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
    /// A listed derivative is not there.
    #[error("its ModelStructure lists a derivative, number {index}, that is no variable")]
    Structure {
        /// Index of the variable, from 1.
        index: u32,
    },
    /// A derivative that would define a state, of an FMU that lists no state (FMI 2.0.4, section 2.2.8; FMI 3.0, section
    /// 2.4.8).
    #[error(
        "its ModelStructure lists no derivatives of states, and `{derivative}` is that of `{state}`: a fit needs model \
         exchange with all states and derivatives declared"
    )]
    Unlisted {
        /// The derivative.
        derivative: String,
        /// What it is the derivative of.
        state: String,
    },
    /// Two variables of one name.
    #[error(
        "its description has two variables called `{name}`, or lists the derivative of that state twice"
    )]
    Same {
        /// The name.
        name: String,
    },
    /// A state that is an array.
    #[error("its derivative `{name}` belongs to no state that is a single real")]
    Array {
        /// Name of the derivative.
        name: String,
    },
    /// It cannot be initialised, or gives no values at its start.
    #[error("it gives no values at its start")]
    Start {
        /// Why.
        source: Box<PointError>,
    },
    /// The same, without an error.
    #[error("at its start {name} is {value}")]
    NotFinite {
        /// What.
        name: String,
        /// Its value.
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
    /// The equations. Outputs that are states are left out; event indicators stand behind the outputs.
    pub model: Model,
    /// Start value of each state, as an expression of parameters.
    pub starts: Vec<Node>,
    /// States, inputs, parameters and outputs.
    pub variables: Vec<Variable>,
    /// Names of the event indicators among the outputs.
    pub indicators: Vec<String>,
    /// The first time event, of an instance with its start values that begins at 0 \[s\].
    pub next_event: Option<f64>,
    /// Of FMUs that pilotage has made: states, each with the parameter that it begins at.
    pub start_parameters: Vec<(String, String)>,
    /// Names of all continuous locals that may be asked for ([`open_with`]).
    pub locals: Vec<String>,
    /// Parameters that are no single reals of double precision, each with its type.
    pub others: Vec<(String, String)>,
    /// What of the description is not so.
    pub notes: Vec<String>,
    /// Whether it can still be called.
    pub calls: Calls,
    /// The function itself, which knows why it had no values.
    pub function: Arc<dyn Opaque>,
}

/// Whether an FMU can still be called.
#[derive(Debug, Clone)]
pub struct Calls(Arc<Rates>);

impl Calls {
    /// The call that ended with a fatal error, after which none is made.
    pub fn fatal(&self) -> Option<String> {
        self.0.pool.fatal()
    }
}

/// Loads an FMU and looks at its equations where it starts.
///
/// # Errors
/// When it cannot be loaded, is not for model exchange, has states that are arrays, or gives no values at its start.
pub fn open(path: &Path) -> Result<FmuEquations, EquationsError> {
    open_with(path, &[])
}

/// The same with these of its [locals](FmuEquations::locals) among the outputs. Their derivatives are differences: an FMU
/// tells those of its outputs alone.
///
/// # Errors
/// As [`open`].
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

/// Refuses derivatives and outputs that are not finite at the start.
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

/// The equations as calls of the FMU.
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
