//! Components of the assembled equations, by name and place.

use pilotage_expression::Node;

/// Names of bounds and constraints in messages.
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// The bounds, in their order.
    pub bounds: Vec<String>,
    /// The constraints on the shared parameters, in their order.
    pub parameters: Vec<String>,
    /// Index of the first of these that is a stability condition. All later ones are, and have the name of the stable
    /// system.
    pub stability: usize,
}

/// A state of the equations.
#[derive(Debug, Clone)]
pub struct State {
    /// Its name, or that of the parameter for a run's own parameter.
    pub name: String,
    /// Typical magnitude, if known.
    pub nominal: Option<f64>,
    /// For each run, a guess of its initial value, used where that is unknown.
    pub guesses: Vec<f64>,
    /// An offset added to the state: where it begins, if that is sought, and what runs have added to it.
    pub shift: Option<Node>,
}

impl State {
    /// A state that is 0 throughout all runs, for a problem without states.
    pub(crate) fn at_rest(runs: usize) -> Self {
        Self {
            name: "no state".to_owned(),
            nominal: Some(1.0),
            guesses: vec![0.0; runs],
            shift: None,
        }
    }
}

/// Place of an unknown among the variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stands {
    /// Among the shared parameters.
    Shared(usize),
    /// Among the shared parameters, one per subject.
    Subjects(Vec<(String, usize)>),
    /// Among the states.
    State(usize),
}

impl Stands {
    /// Its variables in the equations, with the shared parameters starting at index `shared`.
    pub(crate) fn variables(&self, shared: usize) -> Vec<usize> {
        match self {
            Self::Shared(k) => vec![shared + k],
            Self::Subjects(all) => all.iter().map(|(_, k)| shared + k).collect(),
            Self::State(k) => vec![1 + k],
        }
    }
}

/// Expressions to evaluate at a solution, in the graph of the equations.
#[derive(Debug, Clone)]
pub struct Quantities {
    /// Model output for each sensor, in the unit of its signal.
    pub predicted: Vec<Node>,
    /// Standard deviation of the noise of each sensor.
    pub deviations: Vec<Node>,
    /// The variables of the joint model: time, states, inputs, parameters.
    pub joint: Vec<Node>,
    /// Parameters that are tied to others.
    pub tied: Vec<(String, Node)>,
    /// Derived quantities of the file.
    pub derived: Vec<(String, Node)>,
    /// For each measured signal, the input that holds its recorded values, if its residual is an expression of them.
    pub seen: Vec<Option<usize>>,
    /// For each measured signal, the recorded values at each run's samples, in the unit of the signal.
    pub recorded: Vec<Vec<Vec<f64>>>,
}
