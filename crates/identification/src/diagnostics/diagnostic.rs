//! What may be odd about a fit, with the words and the code of each.

use pilotage_inference::spectrum::{Contradiction, Starved};
use thiserror::Error;

/// One reason to look twice at a fit.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Diagnostic {
    /// The closed loop has a pole in the right half-plane: flown on, this pilot leaves the target.
    #[error(
        "the closed loop is UNSTABLE: with its vehicle this pilot has a pole at {pole:+.2e} 1/s, so it \
         leaves the target when it is flown on{}",
        if *.allowed { "" } else { "; a fit of the response that converges keeps it stable" }
    )]
    UnstableLoop {
        /// Real part of the rightmost pole [1/s].
        pole: f64,
        /// True where the options do not ask for a stable loop.
        allowed: bool,
    },
    /// The vehicle does not move in any run.
    #[error("the vehicle does not move in any run: nothing can be said of the pilot")]
    ConstantData,
    /// No run has a target away from where it begins, so that all that moves is the pilot's own noise.
    #[error(
        "{}: what moves is the human's own noise, and no pilot can be told from that; record runs to targets {}, or \
         to moving ones",
        targets(*.forcing, *.error),
        if *.forcing == 0.0 { "away from the start" } else { "farther away" }
    )]
    NoForcing {
        /// The farthest that a target is from where its run begins \[m\].
        forcing: f64,
        /// The largest error of a run \[m\].
        error: f64,
    },
    /// The positions follow the targets with a factor that no human flies.
    #[error(
        "the vehicle moves {factor:.3} times as far as its targets: position or target has {}",
        match *.factor < 0.0 {
            true => "the wrong sign",
            false => "the wrong unit; give the column its unit, as in `position [cm]`",
        }
    )]
    WrongScale {
        /// Slope of the positions over the targets, both from where the run begins.
        factor: f64,
    },
    /// The runs are so short, or their samples so far apart, that another unit of time is likely.
    #[error(
        "the longest run takes {duration:.1} s with a sample every {step:.2e} s: a pilot acts within tenths \
         of a second and takes seconds to a target, so the times may be in another unit; head the column \
         with it, as in `time [ms]`"
    )]
    TimeScale {
        /// The longest run \[s\].
        duration: f64,
        /// Median time between its samples \[s\].
        step: f64,
    },
    /// A run that is fitted far worse than the others.
    #[error(
        "{run} is fitted {ratio:.1} times as badly as the others: its origin, its target or its unit may be \
         another, or another pilot flew; see what the fit is without it"
    )]
    Misfit {
        /// Name of the run.
        run: String,
        /// Its rms residual over the median of all runs'.
        ratio: f64,
    },
    /// The recorded stick stays at zero, and the vehicle moves.
    #[error(
        "the recorded stick of {run} stays at zero while the vehicle moves: leave the column out"
    )]
    DeadStick {
        /// Name of the first run of which this is so.
        run: String,
    },
    /// A long time without a row, in a fit that came to nothing.
    #[error("{run} has no rows from {from} s to {to} s: split it there, or fit with a --mesh-step")]
    Gap {
        /// Name of the run.
        run: String,
        /// The last row before it \[s\].
        from: f64,
        /// The first after it \[s\].
        to: f64,
    },
    /// A run that is fitted from rest is already in motion.
    #[error(
        "{run} begins at {speed:.2} m/s, and full stick from rest gives {most:.2} m/s: it was in motion \
         before its first sample; begin the recording earlier, or fit with --initial-state free"
    )]
    Moving {
        /// Name of the run.
        run: String,
        /// Its speed over the first samples [m/s].
        speed: f64,
        /// What full stick from hover gives over the same time [m/s].
        most: f64,
    },
    /// A target that is elsewhere for one or two samples.
    #[error(
        "the target of {run} is {target} m at {time} s and {around} m before and after: if that is an error, \
         mend it, since the pilot is made to answer it"
    )]
    TargetOutlier {
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The target there \[m\].
        target: f64,
        /// The target before and after \[m\].
        around: f64,
    },
    /// The recording jumps and does not come back.
    #[error(
        "{run} jumps by {size:.3e}{} at {time} s and does not come back: part of it may have another origin \
         or unit",
        symbol(.unit)
    )]
    Jump {
        /// Name of the run.
        run: String,
        /// Time of the first sample after it \[s\].
        time: f64,
        /// How far, with its unit.
        size: f64,
        /// Unit of the size.
        unit: &'static str,
    },
    /// The stick of the fitted pilot stays at zero.
    #[error("the fitted pilot does nothing: its stick stays at zero")]
    IdlePilot,
    /// A sample far from its neighbours.
    #[error(
        "the sample of {run} at {time} s is {value:.3e}{} {}empty the cell if it is an error",
        symbol(.unit),
        weight(*.count, *.share)
    )]
    Outlier {
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// Recorded minus modelled; what was recorded, where the fit has no residual.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// How many such samples there are.
        count: usize,
        /// Their part of the objective, 0 to 1; none where the fit has no residual.
        share: Option<f64>,
    },
    /// The describing function of the flights is not that of the fit.
    #[error(transparent)]
    Contradicted(Contradiction),
    /// Sines tell fewer numbers than are sought.
    #[error(transparent)]
    Starved(Starved),
    /// The model explains little of what was recorded.
    #[error(
        "the model explains {:.0} % of the variance of what was recorded: another --order, --vehicle \
         or --initial-state may do better",
        100.0 * .explained.max(0.0)
    )]
    PoorFit {
        /// Variance accounted for, 1 at best.
        explained: f64,
    },
    /// The recorded stick pushes the other way than the vehicle's motion implies.
    #[error(
        "the recorded stick goes against the vehicle's motion (correlation {correlation:.2} with the \
         stick that the motion implies): forward is negative here, so its sign may be wrong"
    )]
    StickSign {
        /// Correlation of the recorded stick with that of the inverted vehicle.
        correlation: f64,
    },
    /// Mass, inertia and arm do not belong to one body.
    #[error(
        "the vehicle's radius of gyration √(inertia/mass) is {gyration:.3} m with an arm of {arm} m: \
         one of mass, inertia and arm_length may be in another unit"
    )]
    VehicleSize {
        /// Radius of gyration √(I/m) \[m\].
        gyration: f64,
        /// Arm length \[m\].
        arm: f64,
    },
    /// The vehicle's own pitch loop is unstable.
    #[error(
        "the vehicle's own pitch loop is unstable, so nobody can have flown it; see `pilotage vehicle \
         check`"
    )]
    VehicleUnstable,
    /// Two flights of the fit have the same samples.
    #[error(
        "{run} has the samples of {of}{}: what is in both counts twice, and intervals are too narrow; leave one out",
        others(*count)
    )]
    Copy {
        /// Name of the flight.
        run: String,
        /// Name of the one before.
        of: String,
        /// How many flights are such copies.
        count: usize,
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
    /// Between the nodes of the mesh the solution is not one of the equations.
    #[error(
        "the mesh is too coarse: solved with short steps, the equations are {error:.2e} m rms from the \
         solution, whose residual is {residual:.2e} m rms; {run} is the worst, with an interval of \
         {interval:.3} s; take a shorter --mesh-step, or a --scheme of higher order"
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
    },
    /// The closed loop is stable about hover and leaves the target all the same: the stick comes to its stops.
    #[error(
        "the closed loop is stable for small errors alone: flown on towards a target {step:.3} m away, with \
         the stick at its stops, it is {error:.3} m off after {time:.0} s"
    )]
    Leaves {
        /// The target, from where the flight begins \[m\].
        step: f64,
        /// When it was given up \[s\].
        time: f64,
        /// How far off it was then \[m\].
        error: f64,
        /// True where the options do not ask for a stable loop.
        allowed: bool,
    },
    /// The stick lies at its stops in many samples.
    #[error(
        "the stick lies at its stop in {}{:.0} % of the fitted ones: a linear pilot that is held \
         there is not what the human did",
        .recorded.map_or(String::new(), |part| format!("{:.0} % of the recorded samples and ", 100.0 * part)),
        100.0 * .fitted
    )]
    SaturatedStick {
        /// Part of the recorded samples, 0 to 1; none without a recorded stick.
        recorded: Option<f64>,
        /// Part of the fitted ones, 0 to 1.
        fitted: f64,
    },
    /// Of several starts, one alone led to this objective, or one alone ran: there may be a better optimum.
    #[error("{}", alone(*.starts))]
    OneStart {
        /// Number of starts.
        starts: usize,
    },
    /// The fit was ended before all starts were tried.
    #[error(
        "{skipped} of {starts} starts were not tried, since the fit was ended; there may be a better optimum"
    )]
    StoppedEarly {
        /// Starts that were not tried.
        skipped: usize,
        /// All of them.
        starts: usize,
    },
    /// A start passed a pilot with a lower objective, and did not converge: there is a better optimum.
    #[error(
        "start {start} came to a sum of squares of {objective:.6} and did not converge: there is a \
         better optimum, try --max-iterations or --random-starts 20"
    )]
    Lower {
        /// Which start, from 1.
        start: usize,
        /// That objective, in units of [`crate::Fit::objective`].
        objective: f64,
    },
    /// Free initial states that no vehicle has: far beyond what it does afterwards.
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
        /// Its value at the start, in its own unit.
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
        /// Real part of the poles there [1/s].
        pole: f64,
        /// The highest frequency of a pair among them [rad/s]; none where they do not swing.
        swings: Option<f64>,
        /// What the bound costs: how much greater the objective is than without it, relatively; none where it was
        /// not looked at.
        cost: Option<f64>,
        /// True where the human flew something else, as one sees: a pair swings, the bound costs as much as is left,
        /// and that is no small part of what the vehicle moved.
        contradicted: bool,
    },
    /// The closed loop has a pole so slow that the runs hardly show it.
    #[error(
        "the slowest pole of the closed loop, {pole:.1e} 1/s, fades within {:.0} s, and the longest run \
         takes {duration:.0} s: it may as well be unstable",
        -1.0 / .pole
    )]
    SlowLoop {
        /// Its real part [1/s].
        pole: f64,
        /// The longest run \[s\].
        duration: f64,
    },
    /// θ1 lies on its bound: the pilot integrates the error for ever.
    #[error("θ1 lies on its bound: this pilot integrates, which runs this short cannot tell")]
    Integrates,
    /// Another of the conditions for a stable pilot holds with equality: it swings undamped.
    #[error("the pilot lies on its stability bound: it swings undamped at {frequency:.3} rad/s")]
    PilotOnBound {
        /// Its rightmost pole's frequency [rad/s].
        frequency: f64,
    },
    /// A pole is faster than any that samples so far apart can tell.
    #[error(
        "the pole at {pole:.3e} 1/s is faster than the samples can tell ({limit:.0} 1/s): \
         its size means nothing"
    )]
    FastPole {
        /// Its real part [1/s].
        pole: f64,
        /// π over the time between samples [1/s].
        limit: f64,
    },
    /// A pole lies on a zero: a pilot of lower order does the same.
    #[error("a pole of {pole:.3} 1/s lies on a zero: a lower --order says the same")]
    Cancelled {
        /// Magnitude of the pole [1/s].
        pole: f64,
    },
}

/// Part of the objective above which outliers govern the result.
const GOVERNS: f64 = 0.5;
impl Diagnostic {
    /// One word for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::UnstableLoop { .. } => "unstable-loop",
            Self::ConstantData => "constant-data",
            Self::NoForcing { .. } => "no-forcing",
            Self::WrongScale { .. } => "wrong-scale",
            Self::TimeScale { .. } => "time-scale",
            Self::Misfit { .. } => "misfit",
            Self::DeadStick { .. } => "dead-stick",
            Self::Gap { .. } => "gap",
            Self::Moving { .. } => "moving-start",
            Self::TargetOutlier { .. } => "target-outlier",
            Self::Jump { .. } => "jump",
            Self::MeshError { .. } => "mesh-error",
            Self::Leaves { .. } => "leaves-target",
            Self::IdlePilot => "idle-pilot",
            Self::Outlier { .. } => "outlier",
            Self::Contradicted(_) => "describing-function",
            Self::Starved(_) => "few-lines",
            Self::PoorFit { .. } => "poor-fit",
            Self::StickSign { .. } => "stick-sign",
            Self::VehicleSize { .. } => "vehicle-size",
            Self::VehicleUnstable => "vehicle-unstable",
            Self::Copy { .. } => "copy",
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

    /// True when the recorded data hold nothing of a pilot, whatever was found.
    pub fn is_of_data_without_pilot(&self) -> bool {
        matches!(
            self,
            Self::ConstantData | Self::IdlePilot | Self::NoForcing { .. } | Self::WrongScale { .. }
        )
    }

    /// True when it makes the result meaningless: the fit is then no answer, converged or not.
    pub fn is_fatal(&self) -> bool {
        match self {
            own if own.is_of_data_without_pilot() => true,
            Self::UnstableLoop { allowed, .. } | Self::Leaves { allowed, .. } => !allowed,
            Self::Outlier { share, .. } => share.is_some_and(|share| share > GOVERNS),
            Self::LoopOnBound { contradicted, .. } => *contradicted,
            _ => false,
        }
    }
}

/// How far the targets are from where the runs begin \[m\].
fn targets(forcing: f64, error: f64) -> String {
    match forcing {
        0.0 => "every run begins at its target, which stays there".to_owned(),
        _ => format!(
            "no target is more than {forcing:.3} m from where its run begins, and the vehicle strays up to \
             {error:.3} m from it"
        ),
    }
}

/// How many flights are copies, where there is more than one.
fn others(count: usize) -> String {
    match count {
        1 => String::new(),
        _ => format!(" ({count} flights are such copies)"),
    }
}

/// How many samples are like the worst, and what part of the objective they are.
fn weight(count: usize, share: Option<f64>) -> String {
    let others = match count {
        1 => String::new(),
        _ => format!(", the worst of {count} such samples"),
    };
    match share {
        None => format!("and far from its neighbours{others}; "),
        Some(share) => format!(
            "off and far from its neighbours{others}; {:.0} % of the sum of squares come from there: ",
            100.0 * share
        ),
    }
}

/// Of so many starts, one came here.
fn alone(starts: usize) -> String {
    match starts {
        0 | 1 => "one start alone ran, so nothing tells whether there is a better optimum; leave --start out, or \
                  try --random-starts 8"
            .to_owned(),
        _ => format!(
            "only one of {starts} starts ended here; there may be a better optimum, try --random-starts {}",
            (2 * starts).max(20)
        ),
    }
}

/// Where the loop lies on its bound, and what that means.
fn place(pole: f64, swings: Option<f64>) -> String {
    match swings {
        Some(frequency) => format!(
            "a pair at {pole:.1e} ± {frequency:.2}i 1/s: it hardly comes to rest, and the human's own loop may not \
             have been stable"
        ),
        None => format!(
            "a pole at {pole:.1e} 1/s: flights this short do not tell how it settles in the long run"
        ),
    }
}

/// A unit behind a number.
fn symbol(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        _ => format!(" {unit}"),
    }
}
