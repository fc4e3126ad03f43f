//! Contents of a problem file: instances, measured signals and sought parameters. No other file is opened here.

use super::control::Optimal;
use pilotage_collocation::Scheme;
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::Spanned;
use pilotage_inference::Method;
use pilotage_language::file::Formula;
use pilotage_series::Series;
use pilotage_text::document::Place;
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

/// A problem file.
#[derive(Debug, Clone)]
pub struct ProblemFile {
    /// The file, as the user named it.
    pub file: String,
    /// Its text.
    pub text: String,
    /// The folder to which its paths are relative.
    pub folder: PathBuf,
    /// Instances and connections.
    pub system: SystemDescription,
    /// Inputs driven by columns.
    pub inputs: Vec<Fed>,
    /// Measured signals.
    pub measured: Vec<Measured>,
    /// White noise that drives the system.
    pub process_noise: Vec<ProcessNoise>,
    /// Sought parameters, in the order of the file.
    pub parameters: Vec<Sought>,
    /// Initial states, in the order of the file. Later lines take precedence.
    pub initial: Vec<(Spanned<String>, Initial)>,
    /// Constraints on signals and parameters.
    pub constraints: Vec<Constraint>,
    /// Derived quantities: expressions of parameters that are reported beside them.
    pub derived: Vec<(Spanned<String>, Formula)>,
    /// What must be stable.
    pub stability: Stability,
    /// The runs.
    pub runs: Vec<RunLine>,
    /// Options of the fit.
    pub options: Options,
    /// What is optimised, if anything is.
    pub optimal: Option<Optimal>,
    /// Place of the mesh step, if the file gives one.
    pub mesh_place: Option<Place>,
}

impl ProblemFile {
    /// Place where an expression of the file begins.
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
    /// Starts the search of a parameter elsewhere. Returns false if `[parameters]` does not seek one of this name, in a line
    /// of its own or by a pattern.
    pub fn begin_at(&mut self, name: &str, start: f64) -> bool {
        let own = |line: &Sought| line.name.value == name;
        let k = self.parameters.iter().position(own).or_else(|| {
            let names = [name.to_owned()];
            let is_pattern = |line: &Sought| !matching(&line.name.value, &names).is_empty();
            let mut line = self
                .parameters
                .iter()
                .find(|line| is_pattern(line))?
                .clone();
            line.name.value = name.to_owned();
            self.parameters.push(line);
            Some(self.parameters.len() - 1)
        });
        let line = k.map(|k| &mut self.parameters[k]);
        let Some(line) = line.filter(|line| !line.fixed && line.value.is_none()) else {
            return false;
        };
        line.start = Some(start);
        true
    }

    /// Index of the line of `[initial]` that applies to a state: the line with its name, else the last matching
    /// pattern.
    pub(crate) fn initial_line(&self, state: &str) -> Option<usize> {
        let mut lines = self.initial.iter().map(|(name, _)| &name.value);
        let own = lines.clone().position(|name| name == state);
        let state = [state.to_owned()];
        own.or_else(|| lines.rposition(|name| !matching(name, &state).is_empty()))
    }

    /// Names of the measured and bounded signals.
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
        if let Some(own) = &self.optimal {
            own.objective.parts.iter().for_each(|part| take(&part.2));
        }
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
    pub signal: Spanned<String>,
    /// Name of the column.
    pub column: Spanned<String>,
    /// Interpolation between samples, if given; else linear.
    pub hold: Option<Hold>,
}

/// Interpolation of a column between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hold {
    /// Linear.
    Linear,
    /// Zero-order hold.
    Zero,
}

/// A measured signal.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Place of the entry in the file.
    pub place: Place,
    /// The measured quantity: a signal or an expression.
    pub of: Quantity,
    /// Name of the column.
    pub column: Spanned<String>,
    /// Standard deviation of its noise.
    pub sd: Deviation,
    /// Gain of the sensor.
    pub gain: Calibration,
    /// Offset of the sensor.
    pub offset: Calibration,
    /// Distribution of the noise.
    pub noise: Noise,
}

/// A measured quantity.
#[derive(Debug, Clone)]
pub enum Quantity {
    /// The signal of this name.
    Signal(String),
    /// An expression, with the name of its unit.
    Expression(Formula, Option<String>),
}

/// White noise added to an input of an instance or to the derivative of a state.
#[derive(Debug, Clone)]
pub struct ProcessNoise {
    /// `instance.input`, or `instance.state`.
    pub signal: Spanned<String>,
    /// Power spectral density: a number or an expression of parameters. Its unit is the square of the signal's unit
    /// (for a state, of its derivative's unit) times seconds.
    pub density: Formula,
}

/// A noise level.
#[derive(Debug, Clone)]
pub enum Deviation {
    /// A number or an expression of parameters.
    Formula(Formula),
    /// A column with one value per sample.
    Column(Spanned<String>),
}

impl Deviation {
    /// Whether a file states none, which stands for 1.
    pub(crate) fn is_missing(&self) -> bool {
        matches!(self, Self::Formula(own) if own.number() == Some(1.0))
    }
}

/// Gain or offset of a sensor.
#[derive(Debug, Clone)]
pub enum Calibration {
    /// A number or an expression of parameters.
    Formula(Formula),
    /// Sought, with one value for all runs or one per run or subject.
    Sought(Per),
    /// Was sought in other runs; runs may set it.
    Found(f64),
}

/// Distribution of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// Normal.
    Normal,
    /// Log-normal: the logarithm is normally distributed.
    LogNormal,
    /// Laplace.
    Laplace,
    /// Student's t, with this many degrees of freedom.
    Student(f64),
    /// Huber: normal up to this many standard deviations, exponential beyond.
    Huber(f64),
}

/// What a parameter has separate values for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Per {
    /// One value for all runs.
    All,
    /// One value per run.
    Run,
    /// One value per subject, shared by the subject's runs.
    Subject,
}

/// A line of `[parameters]`.
#[derive(Debug, Clone)]
pub struct Sought {
    /// Its name, or `instance.*` for all parameters of an instance.
    pub name: Spanned<String>,
    /// Where the search starts.
    pub start: Option<f64>,
    /// Minimum value.
    pub min: Option<f64>,
    /// Maximum value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Its unit, if the parameter is declared by the problem itself.
    pub unit: Option<String>,
    /// Not sought: the parameter keeps its start value.
    pub fixed: bool,
    /// Expression of other parameters that this parameter is tied to.
    pub value: Option<Formula>,
    /// What it has separate values for.
    pub per: Per,
    /// The search uses its logarithm.
    pub log: bool,
    /// Prior: mean and standard deviation.
    pub prior: Option<Prior>,
}

/// Prior of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Mean, of the logarithm if `log` is set.
    pub mean: f64,
    /// Standard deviation, of the logarithm if `log` is set.
    pub sd: f64,
    /// The logarithm is normally distributed.
    pub log: bool,
}

/// Condition on an initial state.
#[derive(Debug, Clone)]
pub enum Initial {
    /// Free.
    Free,
    /// Its derivative is zero.
    Steady,
    /// It is the first measurement.
    FirstSample,
    /// It is an expression of parameters.
    Formula(Formula),
}

/// `lb ≤ g ≤ ub`.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// Place of the constraint in the file.
    pub place: Place,
    /// The bounded expression.
    pub formula: Formula,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Where it holds.
    pub at: Holds,
}

/// Where a constraint applies.
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

/// What must be stable.
#[derive(Debug, Clone, Default)]
pub struct Stability {
    /// Instances.
    pub models: Vec<Spanned<String>>,
    /// The closed loop of all connected instances.
    pub closed_loop: Option<Place>,
}

/// A run.
#[derive(Debug, Clone)]
pub struct RunLine {
    /// Its file, relative to the working directory.
    pub file: PathBuf,
    /// What it holds, if it has been read; else the file is read.
    pub recorded: Option<Arc<Series>>,
    /// Name of its time column, if not `time`.
    pub time_column: Option<String>,
    /// Its name: the shortest end of its path that no other run shares.
    pub name: String,
    /// Place of the run in the problem file.
    pub place: Place,
    /// False for a run used only for validation.
    pub fits: bool,
    /// Weight of its residuals.
    pub weight: f64,
    /// The subject who flew the run.
    pub subject: Option<String>,
    /// Start time, in the unit of the run's times. If missing, the time of the first row.
    pub start_time: Option<Spanned<f64>>,
    /// Values that apply to this run.
    pub set: Vec<Set>,
    /// Changes within the run, in order of time.
    pub changes: Vec<Change>,
}

/// A change at a time of a run.
#[derive(Debug, Clone)]
pub struct Change {
    /// Time of the change, in the unit of the run's times.
    pub time: f64,
    /// Place of that time in the file.
    pub place: Place,
    /// The values from that time on.
    pub set: Vec<Set>,
    /// States, and what is added to each.
    pub add: Vec<Set>,
}

impl RunLine {
    /// All values set in the run, at its start or later.
    pub fn sets(&self) -> impl Iterator<Item = &Set> {
        let changes = self.changes.iter().flat_map(|change| &change.set);
        self.set.iter().chain(changes)
    }

    /// All that is added to states in the run.
    pub fn added(&self) -> impl Iterator<Item = &Set> {
        self.changes.iter().flat_map(|change| &change.add)
    }

    /// Whether a parameter is set for the whole run, or how a state begins.
    pub fn is_set(&self, name: &str) -> bool {
        self.set.iter().any(|set| set.name.value == name)
    }
}

/// A value set for a run.
#[derive(Debug, Clone)]
pub struct Set {
    /// Name of the variable.
    pub name: Spanned<String>,
    /// The value.
    pub value: Formula,
}

/// Options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The objective to minimise.
    pub objective: Objective,
    /// The collocation scheme. If none, a scheme that suits the equations is selected.
    pub scheme: Option<Scheme>,
    /// Placement of the nodes.
    pub mesh: Mesh,
    /// Scaled KKT residual below which the solve has converged.
    pub tolerance: f64,
    /// Number of starts, including the given one. If none, [`Self::STARTS`], and more where ranges span many decades and
    /// the starts end at many optima.
    pub starts: Option<usize>,
    /// Iteration limit of each solve.
    pub max_iterations: usize,
    /// How limits of outputs are treated.
    pub limits: Limits,
    /// Estimator of the covariance. If none, it is selected by the number of runs.
    pub covariance: Option<Method>,
}

impl Options {
    /// Maximum number of iterations of a start.
    pub const MOST_ITERATIONS: usize = 100_000;

    /// Number of starts where none is given.
    pub const STARTS: usize = 8;

    /// Maximum number of starts of a fit. All are kept in memory until the best is known.
    pub const MOST_STARTS: usize = 1000;

    /// Number of starts that are tried in any case.
    pub fn starts(&self) -> usize {
        self.starts.unwrap_or(Self::STARTS)
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            objective: Objective::Response,
            scheme: None,
            mesh: Mesh::Tolerance(1e-6),
            tolerance: 1e-8,
            starts: None,
            max_iterations: 500,
            limits: Limits::Saturate,
            covariance: None,
        }
    }
}

/// How limits of outputs are treated in a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limits {
    /// They are constraints at all samples, as in the paper: a solution does not exceed them.
    Constrain,
    /// Outputs saturate at them, as in a simulation and as a stick does at its stops.
    Saturate,
}

impl Limits {
    /// All ways, the default first.
    pub const ALL: [Self; 2] = [Self::Saturate, Self::Constrain];

    /// Its name in files and on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Constrain => "constrain",
            Self::Saturate => "saturate",
        }
    }
}

/// The objective to minimise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Objective {
    /// Deviation of the recording from a simulation without noise.
    Response,
    /// Deviation of the recording from its prediction from all earlier samples.
    PredictionError,
}

/// Placement of the nodes of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mesh {
    /// At the samples, and refined between them until the estimated relative error of the states is below this.
    Tolerance(f64),
    /// Approximately this far apart \[s\].
    Step(f64),
    /// At the samples.
    Samples,
}

/// The names that a name or a pattern `instance.*` matches.
pub fn matching<'n>(pattern: &str, names: &'n [String]) -> Vec<&'n String> {
    let is_meant = |name: &&String| match pattern.strip_suffix('*') {
        Some(begin) if begin.ends_with('.') => name.starts_with(begin),
        _ => *name == pattern,
    };
    names.iter().filter(is_meant).collect()
}
