//! What a problem file says: instances, what was measured, what is sought. Nothing is opened here.

use pilotage_collocation::Scheme;
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::Said;
use pilotage_inference::Method;
use pilotage_language::file::Formula;
use pilotage_text::document::Place;
use std::collections::HashSet;
use std::path::PathBuf;

/// A problem file.
#[derive(Debug, Clone)]
pub struct ProblemFile {
    /// The file, as the user named it.
    pub file: String,
    /// Its text.
    pub text: String,
    /// The folder from which it names others.
    pub folder: PathBuf,
    /// Instances and wires.
    pub system: SystemDescription,
    /// Columns that drive inputs.
    pub inputs: Vec<Fed>,
    /// Measured signals.
    pub measured: Vec<Measured>,
    /// White noise that drives the system.
    pub process_noise: Vec<ProcessNoise>,
    /// What is sought, in the order of the file.
    pub parameters: Vec<Sought>,
    /// Initial states, in the order of the file: later lines go before.
    pub initial: Vec<(Said<String>, Initial)>,
    /// Constraints on signals and parameters.
    pub constraints: Vec<Constraint>,
    /// What is told beside the parameters: expressions of them.
    pub derived: Vec<(Said<String>, Formula)>,
    /// What is to be stable.
    pub stability: Stability,
    /// The runs.
    pub runs: Vec<RunLine>,
    /// How it is solved.
    pub options: Options,
    /// Where the step of the mesh stands, if it does.
    pub mesh_place: Option<Place>,
}

impl ProblemFile {
    /// Where an expression of it begins.
    pub fn place(&self, formula: &Formula) -> Place {
        let position = formula.position(&self.text);
        Place {
            file: self.file.clone(),
            line: position.line,
            column: Some(position.column),
        }
    }
}

impl ProblemFile {
    /// The line of `[initial]` that is meant for a state: its own, else the last pattern.
    pub(crate) fn initial_line(&self, state: &str) -> Option<usize> {
        let mut lines = self.initial.iter().map(|(name, _)| &name.value);
        let own = lines.clone().position(|name| name == state);
        let state = [state.to_owned()];
        own.or_else(|| lines.rposition(|name| !matching(name, &state).is_empty()))
    }

    /// Names of what is measured or bounded.
    pub(crate) fn named_signals(&self) -> HashSet<String> {
        let mut names = HashSet::new();
        let mut take = |formula: &Formula| names.extend(formula.names().map(str::to_owned));
        for measured in &self.measured {
            if let Deviation::Formula(formula) = &measured.sd {
                take(formula);
            }
            if let Quantity::Expression(formula, _) = &measured.of {
                take(formula);
            }
        }
        self.constraints.iter().for_each(|own| take(&own.formula));
        names.extend(self.measured.iter().filter_map(|own| match &own.of {
            Quantity::Signal(name) => Some(name.clone()),
            Quantity::Expression(..) => None,
        }));
        names
    }
}

/// An input and the column that drives it.
#[derive(Debug, Clone)]
pub struct Fed {
    /// `instance.input`.
    pub signal: Said<String>,
    /// Name of the column.
    pub column: Said<String>,
    /// What it does between two samples.
    pub hold: Hold,
}

/// What a column does between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hold {
    /// It goes on a straight line.
    Linear,
    /// It keeps its value until the next sample.
    Zero,
}

/// A measured signal.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Where it stands.
    pub place: Place,
    /// What was measured: a signal, or an expression.
    pub of: Quantity,
    /// Name of the column.
    pub column: Said<String>,
    /// Standard deviation of its noise.
    pub sd: Deviation,
    /// Gain of the sensor.
    pub gain: Calibration,
    /// What the sensor adds.
    pub offset: Calibration,
    /// The noise.
    pub noise: Noise,
}

/// What was measured.
#[derive(Debug, Clone)]
pub enum Quantity {
    /// A signal by its name.
    Signal(String),
    /// An expression, in a unit of this name.
    Expression(Formula, Option<String>),
}

/// White noise that is added to an input of an instance, or to the derivative of a state.
#[derive(Debug, Clone)]
pub struct ProcessNoise {
    /// `instance.input`, or `instance.state`.
    pub signal: Said<String>,
    /// Its power spectral density: a number, or an expression of parameters, in the square of the signal's unit (of a
    /// state, of its derivative's) times seconds.
    pub density: Formula,
}

/// A noise level.
#[derive(Debug, Clone)]
pub enum Deviation {
    /// A number, or an expression with parameters.
    Formula(Formula),
    /// A column: one for each sample.
    Column(Said<String>),
}

/// A number of a sensor.
#[derive(Debug, Clone)]
pub enum Calibration {
    /// A number, or an expression of parameters.
    Formula(Formula),
    /// Sought, with one value for all runs or one for each.
    Sought(Per),
}

/// What is distributed as the noise is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// Gauss's distribution.
    Normal,
    /// The logarithm has Gauss's distribution.
    LogNormal,
    /// Laplace's distribution.
    Laplace,
    /// Student's distribution, with this many degrees of freedom.
    Student(f64),
    /// Huber's: normal up to this many standard deviations, exponential beyond.
    Huber(f64),
}

/// For what a parameter has a value of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Per {
    /// One for all.
    All,
    /// One for each run.
    Run,
    /// One for the runs of a subject.
    Subject,
}

/// A line of `[parameters]`.
#[derive(Debug, Clone)]
pub struct Sought {
    /// Its name, `instance.*` for all of an instance.
    pub name: Said<String>,
    /// Where the search starts.
    pub start: Option<f64>,
    /// Least value.
    pub min: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Its unit, of a parameter of the problem's own.
    pub unit: Option<String>,
    /// Not sought: it keeps its start value.
    pub fixed: bool,
    /// Tied to others by an expression.
    pub value: Option<Formula>,
    /// For what it has a value of its own.
    pub per: Per,
    /// The search goes along its logarithm.
    pub log: bool,
    /// What is known of it beforehand: mean and standard deviation.
    pub prior: Option<Prior>,
}

/// What is known of a parameter beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Mean, of the logarithm where `log` says so.
    pub mean: f64,
    /// Standard deviation of the same.
    pub sd: f64,
    /// It is the logarithm that has Gauss's distribution.
    pub log: bool,
}

/// What is known of an initial state.
#[derive(Debug, Clone)]
pub enum Initial {
    /// Nothing.
    Free,
    /// Its derivative is zero.
    Steady,
    /// The first measurement.
    FirstSample,
    /// An expression of parameters.
    Formula(Formula),
}

/// `lb ≤ g ≤ ub`.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// Where it stands.
    pub place: Place,
    /// What is bounded.
    pub formula: Formula,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Where it holds.
    pub at: Holds,
}

/// Where a constraint holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// At every sample.
    Samples,
    /// At the first sample.
    Start,
    /// At the last sample.
    End,
    /// On parameters alone.
    Parameters,
}

/// What is to be stable.
#[derive(Debug, Clone, Default)]
pub struct Stability {
    /// Instances.
    pub models: Vec<Said<String>>,
    /// All instances, wired.
    pub closed_loop: Option<Place>,
}

/// A run.
#[derive(Debug, Clone)]
pub struct RunLine {
    /// Its file, from the folder in which the command runs.
    pub file: PathBuf,
    /// What it is called: the shortest end of its path that no other run has.
    pub name: String,
    /// Where it is named.
    pub place: Place,
    /// False where it is for validation alone.
    pub fits: bool,
    /// Weight of its residuals.
    pub weight: f64,
    /// Whose run it is.
    pub subject: Option<String>,
    /// When it begins, in the unit of its times; with its first row where this is missing.
    pub start_time: Option<Said<f64>>,
    /// What differs in it.
    pub set: Vec<Set>,
    /// What changes within it, in the order of time.
    pub changes: Vec<Change>,
}

/// What changes at a time of a run.
#[derive(Debug, Clone)]
pub struct Change {
    /// When, in the unit of the run's times.
    pub time: f64,
    /// Where that stands.
    pub place: Place,
    /// The values from then on.
    pub set: Vec<Set>,
}

impl RunLine {
    /// All that is set in it, from its begin or later.
    pub fn sets(&self) -> impl Iterator<Item = &Set> {
        let changes = self.changes.iter().flat_map(|change| &change.set);
        self.set.iter().chain(changes)
    }
}

/// A value of a run.
#[derive(Debug, Clone)]
pub struct Set {
    /// What has it.
    pub name: Said<String>,
    /// The value.
    pub value: Formula,
}

/// How a problem is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What is minimised.
    pub objective: Objective,
    /// The collocation scheme; none where one that suits the equations is to be taken.
    pub scheme: Option<Scheme>,
    /// Where the nodes are.
    pub mesh: Mesh,
    /// Scaled KKT residual at which the solve has converged.
    pub tolerance: f64,
    /// Starts, the given one among them.
    pub starts: usize,
    /// Iteration limit of each solve.
    pub max_iterations: usize,
    /// What limits of outputs do.
    pub limits: Limits,
    /// How residuals become a covariance; none where the number of runs is to tell.
    pub covariance: Option<Method>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            objective: Objective::Response,
            scheme: None,
            mesh: Mesh::Tolerance(1e-6),
            tolerance: 1e-8,
            starts: 8,
            max_iterations: 500,
            limits: Limits::Constrain,
            covariance: None,
        }
    }
}

/// What limits of outputs do in a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limits {
    /// They are constraints at all samples, as in the paper: a solution does not go there.
    Constrain,
    /// Outputs saturate there, as in a simulation.
    Saturate,
}

/// What is minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Objective {
    /// What is recorded, against a simulation without noise.
    Response,
    /// What is recorded, against what is predicted from all that was recorded before.
    PredictionError,
}

/// Where the nodes of a mesh are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mesh {
    /// At the samples, and between them until the estimated relative error of the states is below this.
    Tolerance(f64),
    /// This far from each other, about \[s\].
    Step(f64),
    /// At the samples.
    Samples,
}

/// The names that a name or a pattern `instance.*` means.
pub fn matching<'n>(pattern: &str, names: &'n [String]) -> Vec<&'n String> {
    let is_meant = |name: &&String| match pattern.strip_suffix('*') {
        Some(begin) if begin.ends_with('.') => name.starts_with(begin),
        _ => *name == pattern,
    };
    names.iter().filter(is_meant).collect()
}
