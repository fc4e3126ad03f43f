//! Diagnostics of a result, with the message and the code of each.
//!
//! | module | contents |
//! | --- | --- |
//! | `codes` | what each code means |
//! | `words` | the messages |

mod codes;
mod words;

pub use codes::CODES;

use crate::posed::stability::CLOSED_LOOP;
use crate::result::changed::Changed;
use crate::result::events::Event;
use crate::result::explained::Nothing;
use crate::result::other::Other;
use crate::result::through::Contradicting;
use pilotage_inference::sampling::SHORT;
use pilotage_inference::spectrum::{Contradiction, Starved};
use pilotage_sqp::Status;

/// What a crate that knows where the recordings are from finds in them, or in a model, beside a fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doubt {
    /// Its code, for scripts.
    pub code: &'static str,
    /// The message.
    pub words: String,
    /// Whether it makes the result meaningless, converged or not.
    pub is_fatal: bool,
}

/// A reason to doubt a result.
#[derive(Debug, Clone, PartialEq)]
pub enum Diagnostic {
    /// A doubt about the recordings or a model that does not depend on the fit.
    Beside(Doubt),
    /// The solver did not converge.
    NotConverged {
        /// How it ended.
        status: Status,
        /// Whether derivatives of the equations jump where states move: `min`, `if`, a dead zone.
        has_kinks: bool,
        /// Whether a dead zone opens the loop whose stability is asked for.
        is_resting: bool,
        /// If the states do not satisfy the equations, or constraints are violated: the largest scaled violation.
        violation: Option<f64>,
    },
    /// The solve ended at kinks of the equations, away from an optimum by this many standard deviations.
    AtKinks(f64),
    /// A parameter lies on a bound of its range.
    AtBound {
        /// Its name.
        name: String,
        /// The bound.
        bound: f64,
        /// Whether it is tied to other parameters.
        is_tied: bool,
    },
    /// A constraint that is violated by a solve that did not converge.
    Violated {
        /// The constraint.
        name: String,
        /// Its violation, scaled.
        by: f64,
    },
    /// The limit of an output is exceeded by a simulation without process noise. With process noise it is not a
    /// constraint.
    BeyondLimit {
        /// The limit, and the run.
        name: String,
        /// The largest excess, in the output's unit.
        by: f64,
    },
    /// The limit of an output is active as a constraint.
    OnLimit {
        /// The limit.
        name: String,
        /// Number of samples at which it is active.
        samples: usize,
    },
    /// With process noise: the innovations are not white.
    Coloured {
        /// The column.
        measured: String,
        /// The smallest p-value of a run's innovations under the hypothesis of whiteness.
        p: f64,
    },
    /// With process noise: a sample is predicted almost exactly, and the likelihood may have no maximum.
    Unbounded {
        /// The column.
        measured: String,
        /// Smallest standard deviation of an innovation, in the column's unit.
        sd: f64,
    },
    /// The system is unstable.
    UnstableLoop {
        /// Growth rate \[1/s\].
        growth: f64,
        /// Whether `[stability]` keeps it stable where the first run begins.
        is_kept: bool,
    },
    /// Stable only because of a constraint: a condition of `[stability]` is active.
    OnStabilityBound(String),
    /// The mesh could not be refined to the requested error.
    MeshError {
        /// The estimated relative error of the states.
        error: f64,
        /// The requested tolerance.
        tolerance: f64,
        /// Whether the iteration limit ended the refinement.
        is_limited: bool,
        /// Number of refinements, if no more are made.
        rounds: Option<usize>,
    },
    /// The estimated relative error of the states is large on a mesh given by the problem.
    CoarseMesh(f64),
    /// A simulation with the estimates has a different objective.
    Simulated {
        /// The objective of the collocation.
        objective: f64,
        /// That of the simulation. None if the simulation fails.
        simulated: Option<f64>,
    },
    /// A limit or the user ended the fit before all starts and refinements were completed.
    Cut {
        /// What ended it.
        status: Status,
        /// Number of starts that were not completed.
        starts: usize,
        /// Whether the mesh still had to be refined.
        refinement: bool,
        /// Whether events of FMUs still had to be searched for.
        events: bool,
    },
    /// Other parameters give an objective of which the data do not tell which is better.
    OtherOptimum(Other),
    /// The last refinement of the mesh still changed the parameters, by this fraction of their size.
    MeshMoves(f64),
    /// Only one of this many starts led to the result.
    Alone(usize),
    /// The model explains little of the recording.
    PoorFit {
        /// The measured column.
        measured: String,
        /// Variance accounted for, at most 1.
        explained: f64,
    },
    /// The model explains nothing of any measured signal.
    NothingExplained(Nothing),
    /// A parameter is not constant along the runs.
    Changes(Changed),
    /// Residuals are correlated with earlier values of an input.
    InputLeft {
        /// The measured column.
        measured: String,
        /// The column that drives an input.
        input: String,
        /// Lag of the residuals behind the input at the largest correlation \[s\].
        lag: f64,
        /// The correlation at that lag.
        correlation: f64,
    },
    /// A column that keeps its values and jumps drives an input, linear between its samples unless stated otherwise.
    Stepped {
        /// The input.
        input: String,
        /// The column.
        column: String,
    },
    /// Outliers: samples whose residuals deviate from those of their neighbours on both sides.
    Outlier {
        /// The measured column.
        measured: String,
        /// Run of the largest outlier.
        run: String,
        /// Its time \[s\].
        time: f64,
        /// Its residual, recorded minus modelled, or what is recorded if nothing is fitted.
        value: f64,
        /// Its unit.
        unit: Option<String>,
        /// Number of such samples.
        count: usize,
        /// Their fraction of the column's sum of squares, 0 to 1.
        share: f64,
        /// Whether it is one of residuals.
        is_fitted: bool,
    },
    /// Residuals, or a recording, that jump and do not return.
    Jump {
        /// The measured column.
        measured: String,
        /// Name of the run.
        run: String,
        /// Time of the first sample after the jump \[s\].
        time: f64,
        /// Size of the jump.
        size: f64,
        /// Its unit.
        unit: Option<String>,
    },
    /// A measured signal repeats a value while the model moves on.
    Frozen {
        /// The measured column.
        measured: String,
        /// Name of the run.
        run: String,
        /// The value.
        value: f64,
        /// Time of the first such sample \[s\].
        from: f64,
        /// Time of the last such sample \[s\].
        to: f64,
        /// The next sample relative to the value; none at the end of the run.
        size: Option<f64>,
        /// Unit of value and size.
        unit: Option<String>,
        /// Number of such stretches, of which this is the longest.
        count: usize,
    },
    /// A column that drives an input along lines repeats a value and then jumps, and moves before and afterwards.
    FrozenInput {
        /// The column.
        column: String,
        /// Name of the run.
        run: String,
        /// Time of the first such sample \[s\].
        from: f64,
        /// Time of the last such sample \[s\].
        to: f64,
        /// Whether residuals are larger meanwhile; nothing is fitted otherwise.
        is_worse: bool,
    },
    /// A run without rows for a time in which inputs are driven along lines.
    Gap {
        /// Name of the run.
        run: String,
        /// Time of the last row before \[s\].
        from: f64,
        /// Time of the first row afterwards \[s\].
        to: f64,
    },
    /// The runs with a pilot are so short, or their samples so sparse, that another time unit is likely.
    TimeScale {
        /// Duration of the longest run \[s\].
        duration: f64,
        /// Median time between its samples \[s\].
        step: f64,
        /// Whether the files state the unit of their times.
        is_stated: bool,
    },
    /// A run that is fitted far worse than the others.
    Misfit {
        /// The measured column.
        measured: String,
        /// Name of the run.
        run: String,
        /// Its rms residual divided by the median over all runs.
        ratio: f64,
    },
    /// A measured signal is that of a sensor that is slower than the recording.
    SlowSensor {
        /// The measured column.
        measured: String,
        /// Name of the first such run.
        run: String,
        /// Number of rows for each value.
        rows: usize,
    },
    /// A run in which a measured signal is later or earlier against the model than in the others.
    Late {
        /// The measured column.
        measured: String,
        /// Name of the run.
        run: String,
        /// Time by which it is later than in the other runs \[s\].
        by: f64,
    },
    /// A measured signal stays at its largest or smallest value within runs: a stop, or the end of a sensor's range.
    Clipped {
        /// The measured column.
        measured: String,
        /// The run in which most samples do so.
        run: String,
        /// That value, in the signal's unit.
        value: f64,
        /// Its unit.
        unit: Option<String>,
        /// Fraction of its samples at this or the opposite extreme, 0 to 1.
        part: f64,
    },
    /// Two runs of different files have the same samples.
    Copy {
        /// Name of the run.
        run: String,
        /// Name of the earlier run.
        of: String,
        /// Number of such copies.
        count: usize,
    },
    /// Fewer measured values than unknowns.
    FewValues {
        /// Number of values.
        values: usize,
        /// Number of unknowns.
        unknowns: usize,
    },
    /// Nothing that is measured moves in any run.
    ConstantData,
    /// No run has a target away from where it begins, so that all motion is the person's own noise.
    NoForcing {
        /// Columns of position and target.
        columns: [String; 2],
    },
    /// The positions follow the targets with a factor that no person produces.
    WrongScale {
        /// Columns of position and target.
        columns: [String; 2],
        /// Slope of the positions over the targets, both relative to the start of the run.
        factor: f64,
        /// The run, if it is not so in all.
        run: Option<String>,
    },
    /// The positions follow the targets from another origin.
    Origin {
        /// Columns of position and target.
        columns: [String; 2],
        /// Name of the first such run.
        run: String,
        /// Mean of positions minus targets.
        offset: f64,
        /// Its unit.
        unit: Option<String>,
    },
    /// A target that differs for one or two samples.
    TargetOutlier {
        /// Its column.
        column: String,
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The target there.
        target: f64,
        /// The target before and after.
        around: f64,
        /// Its unit.
        unit: Option<String>,
    },
    /// Flights that do not belong together according to their own comments.
    Mixed(String),
    /// A quantity that is not finite where the search begins.
    Undefined(String),
    /// The solver did not converge, and a simulation with the start values ends early.
    EarlyEnd {
        /// Name of the run.
        run: String,
        /// The time that it reaches, with its unit.
        time: String,
    },
    /// The solver did not converge, and a call of an FMU failed during the solve.
    FmuFailed {
        /// The instance.
        instance: String,
        /// The last call that failed, and why.
        trouble: String,
    },
    /// An FMU would have an event in a run.
    Event(Event),
    /// The description of an FMU is incorrect.
    Description {
        /// The instance.
        instance: String,
        /// What is incorrect.
        note: String,
    },
    /// An instance does not answer its recorded inputs as recorded.
    Contradicting(Contradicting),
    /// The describing function of the runs contradicts that of the fit.
    Contradicted(Contradiction),
    /// The spectral lines determine fewer numbers than are sought.
    Starved(Starved),
    /// A direction that does not affect any measured signal, at several starts and after the fit.
    Unidentifiable(String),
    /// The data do not determine all parameters.
    Undetermined {
        /// Those whose intervals are as wide as their ranges.
        names: Vec<String>,
        /// Scaled curvature of the objective, if it is flat along some direction.
        curvature: Option<f64>,
    },
}

impl Diagnostic {
    /// Its code, for scripts: one of [`CODES`].
    pub fn code(&self) -> &'static str {
        match self {
            Self::Beside(own) => own.code,
            Self::NotConverged { .. } => "not-converged",
            Self::AtKinks(_) => "kinks",
            Self::AtBound { .. } => "at-bound",
            Self::Violated { .. } => "violated",
            Self::BeyondLimit { .. } => "beyond-limit",
            Self::OnLimit { .. } => "on-limit",
            Self::Coloured { .. } => "coloured",
            Self::Unbounded { .. } => "unbounded",
            Self::UnstableLoop { .. } => "unstable-loop",
            Self::OnStabilityBound(of) if of == CLOSED_LOOP => "loop-on-bound",
            Self::OnStabilityBound(_) => "model-on-bound",
            Self::MeshError { .. } | Self::CoarseMesh(_) | Self::MeshMoves(_) => "mesh-error",
            Self::Simulated { .. } => "simulation",
            Self::Cut { .. } => "cut",
            Self::OtherOptimum(_) => "other-optimum",
            Self::Alone(_) => "alone",
            Self::PoorFit { .. } => "poor-fit",
            Self::NothingExplained(_) => "nothing-explained",
            Self::Changes(_) => "changes",
            Self::InputLeft { .. } => "input-left",
            Self::Stepped { .. } => "stepped-input",
            Self::Outlier { .. } => "outlier",
            Self::Jump { .. } => "jump",
            Self::Frozen { .. } | Self::FrozenInput { .. } => "frozen",
            Self::Gap { .. } => "gap",
            Self::TimeScale { .. } => "time-scale",
            Self::Misfit { .. } => "misfit",
            Self::SlowSensor { .. } => "slow-sensor",
            Self::Late { .. } => "late",
            Self::Clipped { .. } => "clipped",
            Self::Copy { .. } => "copy",
            Self::FewValues { .. } => "few-values",
            Self::ConstantData => "constant-data",
            Self::NoForcing { .. } => "no-forcing",
            Self::WrongScale { .. } => "wrong-scale",
            Self::Origin { .. } => "origin",
            Self::TargetOutlier { .. } => "target-outlier",
            Self::Mixed(_) => "mixed",
            Self::Contradicting(_) => "open-loop",
            Self::Contradicted(_) => "describing-function",
            Self::Starved(_) => "few-lines",
            Self::Unidentifiable(_) => "unidentifiable",
            Self::Undetermined { .. } => "undetermined",
            Self::Undefined(_) => "undefined",
            Self::EarlyEnd { .. } => "early-end",
            Self::FmuFailed { .. } => "fmu-failed",
            Self::Event(_) => "event",
            Self::Description { .. } => "fmu-description",
        }
    }

    /// Whether it makes the result meaningless, converged or not: the fit is one of what is no recording of the system.
    pub fn is_fatal(&self) -> bool {
        /// Fraction of the sum of squares above which outliers govern the result.
        const GOVERNS: f64 = 0.95;
        /// The same of recorded values, which may be part of the motion.
        const GOVERNS_RECORDED: f64 = 0.999;
        match self {
            Self::Beside(own) => own.is_fatal,
            Self::Outlier {
                share, is_fitted, ..
            } => {
                *share
                    > if *is_fitted {
                        GOVERNS
                    } else {
                        GOVERNS_RECORDED
                    }
            }
            Self::NothingExplained(_)
            | Self::FewValues { .. }
            | Self::ConstantData
            | Self::NoForcing { .. }
            | Self::WrongScale { run: None, .. } => true,
            // Nobody acts once in seconds; a task may be short.
            Self::TimeScale {
                duration,
                is_stated,
                ..
            } => !is_stated && *duration >= SHORT,
            _ => false,
        }
    }
}
