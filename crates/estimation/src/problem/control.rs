//! What a problem file says of optimal control: controls, objective, horizon, and where the search begins.

use pilotage_cosim::description::Spanned;
use pilotage_language::file::Formula;
use pilotage_text::document::Place;

/// A problem of optimal control.
#[derive(Debug, Clone)]
pub struct Optimal {
    /// The controls.
    pub controls: Vec<Control>,
    /// The objective.
    pub objective: Objective,
    /// How long it lasts, and on how many intervals.
    pub horizon: Horizon,
    /// Final states.
    pub finals: Vec<(Spanned<String>, Formula)>,
    /// Where the search begins.
    pub guess: Guess,
}

/// An input that the optimiser chooses.
#[derive(Debug, Clone)]
pub struct Control {
    /// `instance.input`.
    pub signal: Spanned<String>,
    /// Its limits, as expressions of parameters and signals.
    pub limits: [Option<Formula>; 2],
    /// Largest magnitude of its rate, per second.
    pub rate: Option<f64>,
    /// Where the search begins.
    pub start: Option<f64>,
    /// Constant in each interval rather than linear.
    pub is_constant: bool,
    /// Value at the start.
    pub first: First,
}

/// Value of a control at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum First {
    /// Free.
    Free,
    /// A number.
    Number(f64),
    /// The start value of the input in its model.
    Trim,
}

/// What is minimised.
#[derive(Debug, Clone)]
pub struct Objective {
    /// Its place in the file.
    pub place: Place,
    /// The expression, with a name in the place of each part.
    pub formula: Formula,
    /// The parts, with their names.
    pub parts: Vec<(String, PartOf, Formula)>,
    /// Whether it is maximised.
    pub is_maximised: bool,
    /// Weight of the squared steps of the controls.
    pub regularise: f64,
}

/// Part of an objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartOf {
    /// `initial(x)`.
    Initial,
    /// `final(x)`.
    Final,
    /// `integral(x)`.
    Integral,
}

/// The horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Horizon {
    /// Where the search begins, and the range; equal numbers where the duration is known \[s\].
    pub start: f64,
    /// Least duration.
    pub min: f64,
    /// Largest duration.
    pub max: f64,
    /// Number of intervals of the first mesh.
    pub intervals: usize,
}

/// States where the search begins.
#[derive(Debug, Clone, Default)]
pub struct Guess {
    /// Simulated with the controls at their starts.
    pub is_simulated: bool,
    /// A table of an earlier answer, by its path in the file, relative to its folder.
    pub table: Option<String>,
    /// First and last value of states.
    pub states: Vec<(Spanned<String>, [f64; 2])>,
}
