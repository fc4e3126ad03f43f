//! Diagnostics of a fit, with message and code.

use pilotage_flights::Check;
use pilotage_flights::checks::worst;
use pilotage_inference::spectrum::{Contradiction, Starved};
use pilotage_text::number::{rounded, short};
use thiserror::Error;

/// A reason to check a fit.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Diagnostic {
    /// A doubt about the recordings or the vehicle.
    #[error(transparent)]
    Check(#[from] Check),
    /// The closed loop has a pole in the right half-plane: this pilot leaves the target if the flight continues.
    #[error(
        "the closed loop is UNSTABLE: with its vehicle this pilot has a pole at {pole:+.2e} 1/s, so it \
         leaves the target when it is flown on{}",
        if *.allowed { "" } else { "; a fit of the response that converges keeps it stable" }
    )]
    UnstableLoop {
        /// Real part of the rightmost pole [1/s].
        pole: f64,
        /// Whether the options allow an unstable loop.
        allowed: bool,
    },
    /// The fit of one run is far worse than that of the others.
    #[error(
        "{run} is fitted {ratio:.1} times as badly as the others: its origin, its target or its unit may be \
         another, or another pilot flew; see what the fit is without it"
    )]
    Misfit {
        /// Name of the run.
        run: String,
        /// Its rms residual over the median of all runs.
        ratio: f64,
    },
    /// A long gap between rows, in a fit that failed.
    #[error("{run} has no rows from {from} s to {to} s: split it there, or fit with a --mesh-step")]
    Gap {
        /// Name of the run.
        run: String,
        /// Time of the last row before the gap \[s\].
        from: f64,
        /// Time of the first row after the gap \[s\].
        to: f64,
    },
    /// A target that keeps its values and jumps, in a fit that takes it as linear between samples.
    #[error(
        "the target of {run} keeps its values and jumps, and a fit of flights follows it along lines from sample to sample, \
         so that delay and lag of the pilot come out wrong; `pilotage init` writes a problem file in which it jumps (hold = \
         \"zero-order\")"
    )]
    SteppedTarget {
        /// Name of the first such run.
        run: String,
    },
    /// The residual jumps and does not return.
    #[error(
        "{run} jumps by {}{} at {} s and does not come back: part of it may have another origin or unit",
        short(*.size, 4),
        symbol(.unit),
        rounded(*.time, 9)
    )]
    Jump {
        /// Name of the run.
        run: String,
        /// Time of the first sample after the jump \[s\].
        time: f64,
        /// Size of the jump.
        size: f64,
        /// Unit of the size.
        unit: &'static str,
    },
    /// The stick of the fitted pilot stays at zero.
    #[error("the fitted pilot does nothing: its stick stays at zero")]
    IdlePilot,
    /// A residual that is far from its neighbours.
    #[error(
        "the sample of {run} at {} s is {}{} off and far from its neighbours{}; {:.0} % of the sum of squares come from there: \
         empty the cell if it is an error",
        rounded(*.time, 9),
        short(*.value, 4),
        symbol(.unit),
        worst(*.count),
        100.0 * .share
    )]
    Outlier {
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// Recorded minus modelled.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Number of such samples.
        count: usize,
        /// Their share of the objective, 0 to 1.
        share: f64,
    },
    /// The describing function of the flights contradicts the fit.
    #[error(transparent)]
    Contradicted(Contradiction),
    /// The target's sines determine fewer parameters than are sought.
    #[error(transparent)]
    Starved(Starved),
    /// The model explains little of the recording.
    #[error(
        "the model explains {:.0} % of the variance of what was recorded: another --order, --vehicle \
         or --initial-state may do better",
        100.0 * .explained.max(0.0)
    )]
    PoorFit {
        /// Variance accounted for, 1 at best.
        explained: f64,
    },
    /// The mesh is coarser than a tenth of a run.
    #[error(
        "a mesh step of {step} s is more than a tenth of a run of {duration} s: the states between are \
         those of the scheme, not of the equations; take a shorter --mesh-step"
    )]
    CoarseMesh {
        /// Length of an interval \[s\].
        step: f64,
        /// The shortest run \[s\].
        duration: f64,
    },
    /// The solution does not follow the equations between the nodes of the mesh.
    #[error(
        "the mesh is too coarse: solved with short steps, the equations are {} m rms from the solution, whose \
         residual is {} m rms{}; {run} is the worst, with an interval of {interval:.3} s; take a shorter --mesh-step, or \
         a --scheme of higher order",
        short(*.error, 3),
        short(*.residual, 3),
        if *.is_another { ", and so they fly otherwise: the parameters mean nothing" } else { "" }
    )]
    MeshError {
        /// Name of the worst run.
        run: String,
        /// Rms distance of all solutions from the equations solved with short steps \[m\].
        error: f64,
        /// Rms residual of the fit \[m\].
        residual: f64,
        /// Longest interval of the worst run's mesh \[s\].
        interval: f64,
        /// Whether the distance is a large part of the motion.
        is_another: bool,
    },
    /// The closed loop is stable about hover but leaves the target, since the stick reaches its stops.
    #[error(
        "the closed loop is stable for small errors alone: flown on towards a target {step:.3} m away, with \
         the stick at its stops, it is {error:.3} m off after {time:.0} s"
    )]
    Leaves {
        /// The target relative to the start \[m\].
        step: f64,
        /// Time at which the simulation was ended \[s\].
        time: f64,
        /// Distance from the target at that time \[m\].
        error: f64,
        /// Whether the options allow an unstable loop.
        allowed: bool,
    },
    /// The stick is at its stops in many samples.
    #[error(
        "the stick lies at its stop in {}{:.0} % of the fitted ones: a linear pilot that is held \
         there is not what the human did",
        .recorded.map_or(String::new(), |part| format!("{:.0} % of the recorded samples and ", 100.0 * part)),
        100.0 * .fitted
    )]
    SaturatedStick {
        /// Share of the recorded samples, 0 to 1; `None` without a recorded stick.
        recorded: Option<f64>,
        /// Share of the fitted samples, 0 to 1.
        fitted: f64,
    },
    /// Only one of several starts led to this objective, or only one ran: there may be a better optimum.
    #[error("{}", alone(*.starts))]
    OneStart {
        /// Number of starts.
        starts: usize,
    },
    /// The fit was stopped before all starts were tried.
    #[error(
        "{skipped} of {starts} starts were not tried, since the fit was ended; there may be a better optimum"
    )]
    StoppedEarly {
        /// Number of starts that were not tried.
        skipped: usize,
        /// Number of all starts.
        starts: usize,
    },
    /// A start reached a feasible iterate with a lower objective but did not converge: there is a better optimum.
    #[error(
        "start {start} came to a sum of squares of {objective:.6} and did not converge: there is a \
         better optimum, try --max-iterations or --random-starts 20"
    )]
    Lower {
        /// Number of the start, from 1.
        start: usize,
        /// That objective, in the unit of [`crate::Fit::objective`].
        objective: f64,
    },
    /// Free initial states that are unphysical: far beyond the vehicle's later motion.
    #[error(
        "{run} begins with {state} = {value:.2}, which stays within {later:.2} after a second: its free \
         initial states explain what the pilot should, and many optima do so; fit with --initial-state \
         vehicle-at-rest"
    )]
    WildStart {
        /// Name of the run.
        run: String,
        /// Name of the state.
        state: &'static str,
        /// Its initial value, in its own unit.
        value: f64,
        /// Its largest magnitude after the first second.
        later: f64,
    },
    /// The closed loop lies on its stability bound ([`crate::closed_loop::LOOP_MARGIN`]).
    #[error(
        "the closed loop lies on its stability bound, {}{}{}",
        place(*.pole, *.swings),
        .cost.map_or(String::new(), |cost| {
            format!("; the bound makes the sum of squares {:.2} % greater", 100.0 * cost)
        }),
        if *.contradicted { ": what was flown is no stable loop, see --allow-unstable-loop" } else { "" }
    )]
    LoopOnBound {
        /// Real part of the poles on the bound [1/s].
        pole: f64,
        /// The highest frequency of a pair among them [rad/s]; `None` if they do not oscillate.
        swings: Option<f64>,
        /// Relative increase of the objective due to the bound; `None` if not computed.
        cost: Option<f64>,
        /// Whether the human evidently flew something else: a pair oscillates, the bound costs as much as the remaining
        /// residual, and that is a visible part of the vehicle's motion.
        contradicted: bool,
    },
    /// The closed loop has a pole so slow that the runs hardly show it.
    #[error(
        "the slowest pole of the closed loop, {} 1/s, fades within {:.0} s, and the longest run \
         takes {duration:.0} s: it may as well be unstable",
        short(*.pole, 2),
        -1.0 / .pole
    )]
    SlowLoop {
        /// Real part of the pole [1/s].
        pole: f64,
        /// Duration of the longest run \[s\].
        duration: f64,
    },
    /// θ1 lies on its bound: the pilot is an integrator.
    #[error("θ1 lies on its bound: this pilot integrates, which runs this short cannot determine")]
    Integrates,
    /// Another condition for a stable pilot holds with equality: it oscillates undamped.
    #[error("the pilot lies on its stability bound: it swings undamped at {frequency:.3} rad/s")]
    PilotOnBound {
        /// Frequency of its rightmost pole [rad/s].
        frequency: f64,
    },
    /// A pole is faster than the sampling can resolve.
    #[error(
        "the pole at {} 1/s is faster than the samples resolve ({limit:.0} 1/s): its size means nothing",
        short(*.pole, 4)
    )]
    FastPole {
        /// Real part of the pole [1/s].
        pole: f64,
        /// π over the sampling interval [1/s].
        limit: f64,
    },
    /// A pole coincides with a zero: a pilot of lower order is equivalent.
    #[error("a pole of {pole:.3} 1/s lies on a zero: a lower --order says the same")]
    Cancelled {
        /// Magnitude of the pole [1/s].
        pole: f64,
    },
}

/// Share of the objective above which outliers dominate the result.
const GOVERNS: f64 = 0.5;
impl Diagnostic {
    /// Code for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Check(check) => check.code(),
            Self::UnstableLoop { .. } => "unstable-loop",
            Self::Misfit { .. } => "misfit",
            Self::Gap { .. } => "gap",
            Self::SteppedTarget { .. } => "stepped-target",
            Self::Jump { .. } => "jump",
            Self::MeshError { .. } => "mesh-error",
            Self::Leaves { .. } => "leaves-target",
            Self::IdlePilot => "idle-pilot",
            Self::Outlier { .. } => "outlier",
            Self::Contradicted(_) => "describing-function",
            Self::Starved(_) => "few-lines",
            Self::PoorFit { .. } => "poor-fit",
            Self::CoarseMesh { .. } => "coarse-mesh",
            Self::SaturatedStick { .. } => "saturated-stick",
            Self::OneStart { .. } => "one-start",
            Self::StoppedEarly { .. } => "stopped-early",
            Self::Lower { .. } => "lower-start",
            Self::WildStart { .. } => "wild-start",
            Self::LoopOnBound { .. } => "loop-on-bound",
            Self::SlowLoop { .. } => "slow-loop",
            Self::Integrates => "integrating-pilot",
            Self::PilotOnBound { .. } => "pilot-on-bound",
            Self::FastPole { .. } => "fast-pole",
            Self::Cancelled { .. } => "cancelled-pole",
        }
    }

    /// Whether the recorded data contain no information about a pilot, whatever the fit is.
    pub fn is_of_data_without_pilot(&self) -> bool {
        match self {
            Self::Check(check) => check.is_fatal(),
            own => matches!(own, Self::IdlePilot),
        }
    }

    /// Whether it makes the result meaningless, converged or not.
    pub fn is_fatal(&self) -> bool {
        match self {
            own if own.is_of_data_without_pilot() => true,
            Self::UnstableLoop { allowed, .. } | Self::Leaves { allowed, .. } => !allowed,
            Self::Outlier { share, .. } => *share > GOVERNS,
            Self::LoopOnBound { contradicted, .. } => *contradicted,
            Self::MeshError { is_another, .. } => *is_another,
            _ => false,
        }
    }
}

/// Message for the number of starts of which one led to the result.
fn alone(starts: usize) -> String {
    match starts {
        0 | 1 => "one start alone ran, so there may be a better optimum; leave --start out, or \
                  try --random-starts 8"
            .to_owned(),
        _ => format!(
            "only one of {starts} starts ended here; there may be a better optimum, try --random-starts {}",
            (2 * starts).max(20)
        ),
    }
}

/// Poles on the stability bound and their meaning.
fn place(pole: f64, swings: Option<f64>) -> String {
    let pole = short(pole, 2);
    match swings {
        Some(frequency) => format!(
            "a pair at {pole} ± {frequency:.2}i 1/s: it hardly settles, and the human's own loop may not \
             have been stable"
        ),
        None => format!(
            "a pole at {pole} 1/s: flights this short do not show how it settles in the long run"
        ),
    }
}

/// Unit after a number.
fn symbol(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        _ => format!(" {unit}"),
    }
}
