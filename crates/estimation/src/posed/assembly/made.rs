//! What the equations are made of, by name and place.

use pilotage_expression::Node;

/// What messages call bounds and constraints.
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// The bounds, in their order.
    pub bounds: Vec<String>,
    /// The constraints on the shared parameters, in their order.
    pub parameters: Vec<String>,
    /// Number of the first of these that is a condition of stability; all behind it are, and called by what is kept
    /// stable.
    pub stability: usize,
}

/// A state of the equations.
#[derive(Debug, Clone)]
pub struct State {
    /// Its name; that of the parameter, of a run's own one.
    pub name: String,
    /// Typical magnitude, where one is known.
    pub nominal: Option<f64>,
    /// For each run, what it begins with where that is not known.
    pub guesses: Vec<f64>,
    /// What is added to it, where it begins at zero by that.
    pub shift: Option<Node>,
}

impl State {
    /// One that is 0 throughout so many runs, where a problem has none.
    pub(crate) fn at_rest(runs: usize) -> Self {
        Self {
            name: "no state".to_owned(),
            nominal: Some(1.0),
            guesses: vec![0.0; runs],
            shift: None,
        }
    }
}

/// Where an unknown stands among the variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stands {
    /// Among the shared parameters.
    Shared(usize),
    /// Among the shared parameters, one for each subject.
    Subjects(Vec<(String, usize)>),
    /// Among the states.
    State(usize),
}

impl Stands {
    /// Its variables in the equations, where the shared parameters begin at that one.
    pub(crate) fn variables(&self, shared: usize) -> Vec<usize> {
        match self {
            Self::Shared(k) => vec![shared + k],
            Self::Subjects(all) => all.iter().map(|(_, k)| shared + k).collect(),
            Self::State(k) => vec![1 + k],
        }
    }
}

/// What is told of a solution, in the graph of the equations.
#[derive(Debug, Clone)]
pub struct Told {
    /// What each sensor should show, in the unit of the signal.
    pub predicted: Vec<Node>,
    /// The standard deviation of each one's noise.
    pub deviations: Vec<Node>,
    /// The variables of the joint model: time, states, inputs, parameters.
    pub joint: Vec<Node>,
    /// Parameters that are tied to others.
    pub tied: Vec<(String, Node)>,
    /// What the file derives from parameters.
    pub derived: Vec<(String, Node)>,
    /// For each measured signal, the input that is what was recorded, where its residual is an expression of that.
    pub seen: Vec<Option<usize>>,
    /// For each measured signal, the recorded values of each run's samples, in the unit of the signal.
    pub recorded: Vec<Vec<Vec<f64>>>,
}
