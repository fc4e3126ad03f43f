//! Why a fit may say less than it seems to: something is odd about the flights or the vehicle, other starts
//! ended elsewhere, or the data cannot tell some of the pilot's parameters.

mod flights;
mod flown;
mod samples;
mod solution;
mod words;

use super::{Fit, Options, Trial};

/// One reason to look twice at a fit.
#[derive(Debug, Clone, PartialEq)]
pub enum Doubt {
    /// The closed loop has a pole in the right half-plane: flown on, this pilot leaves the target.
    UnstableLoop {
        /// Real part of the rightmost pole [1/s].
        pole: f64,
        /// True where the options do not ask for a stable loop.
        allowed: bool,
    },
    /// The vehicle does not move in any run.
    ConstantData,
    /// No run has a target away from where it begins, so that all that moves is the pilot's own noise.
    NoForcing {
        /// The farthest that a target is from where its run begins \[m\].
        forcing: f64,
        /// The largest error of a run \[m\].
        error: f64,
    },
    /// The positions follow the targets with a factor that no human flies.
    WrongScale {
        /// Slope of the positions over the targets, both from where the run begins.
        factor: f64,
    },
    /// The runs are so short, or their samples so far apart, that another unit of time is likely.
    TimeScale {
        /// The longest run \[s\].
        duration: f64,
        /// Median time between its samples \[s\].
        step: f64,
    },
    /// A run that is fitted far worse than the others.
    Misfit {
        /// Name of the run.
        run: String,
        /// Its rms residual over the median of all runs'.
        ratio: f64,
    },
    /// The recorded stick stays at zero, and the vehicle moves.
    DeadStick {
        /// Name of the first run of which this is so.
        run: String,
    },
    /// A long time without a row, in a fit that came to nothing.
    Gap {
        /// Name of the run.
        run: String,
        /// The last row before it \[s\].
        from: f64,
        /// The first after it \[s\].
        to: f64,
    },
    /// A run that is fitted from rest is already in motion.
    Moving {
        /// Name of the run.
        run: String,
        /// Its speed over the first samples [m/s].
        speed: f64,
        /// What full stick from hover gives over the same time [m/s].
        most: f64,
    },
    /// A target that is elsewhere for one or two samples.
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
    IdlePilot,
    /// A sample far from its neighbours.
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
    /// The model explains little of what was recorded.
    PoorFit {
        /// Variance accounted for, 1 at best.
        explained: f64,
    },
    /// The recorded stick pushes the other way than the vehicle's motion implies.
    StickSign {
        /// Correlation of the recorded stick with that of the inverted vehicle.
        correlation: f64,
    },
    /// Mass, inertia and arm do not belong to one body.
    VehicleSize {
        /// Radius of gyration √(I/m) \[m\].
        gyration: f64,
        /// Arm length \[m\].
        arm: f64,
    },
    /// The vehicle's own pitch loop is unstable.
    VehicleUnstable,
    /// The mesh is coarser than a tenth of a run.
    CoarseMesh {
        /// Length of an interval \[s\].
        step: f64,
        /// The shortest run \[s\].
        duration: f64,
    },
    /// Between the nodes of the mesh the solution is not one of the equations.
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
    SaturatedStick {
        /// Part of the recorded samples, 0 to 1; none without a recorded stick.
        recorded: Option<f64>,
        /// Part of the fitted ones, 0 to 1.
        fitted: f64,
    },
    /// Of several starts, one alone led to this objective, or one alone ran: there may be a better optimum.
    OneStart {
        /// Number of starts.
        starts: usize,
    },
    /// The fit was ended before all starts were tried.
    StoppedEarly {
        /// Starts that were not tried.
        skipped: usize,
        /// All of them.
        starts: usize,
    },
    /// A start passed a pilot with a lower objective, and did not converge: there is a better optimum.
    Lower {
        /// Which start, from 1.
        start: usize,
        /// That objective, in units of [`Fit::objective`].
        objective: f64,
    },
    /// Free initial states that no vehicle has: far beyond what it does afterwards.
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
    /// The closed loop lies on its stability bound ([`super::closed_loop::LOOP_MARGIN`]).
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
    SlowLoop {
        /// Its real part [1/s].
        pole: f64,
        /// The longest run \[s\].
        duration: f64,
    },
    /// θ1 lies on its bound: the pilot integrates the error for ever.
    Integrates,
    /// Another of the conditions for a stable pilot holds with equality: it swings undamped.
    PilotOnBound {
        /// Its rightmost pole's frequency [rad/s].
        frequency: f64,
    },
    /// A pole is faster than any that samples so far apart can tell.
    FastPole {
        /// Its real part [1/s].
        pole: f64,
        /// π over the time between samples [1/s].
        limit: f64,
    },
    /// A pole lies on a zero: a pilot of lower order does the same.
    Cancelled {
        /// Magnitude of the pole [1/s].
        pole: f64,
    },
}

/// Part of the objective above which outliers govern the result.
const GOVERNS: f64 = 0.5;
impl Doubt {
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
            Self::PoorFit { .. } => "poor-fit",
            Self::StickSign { .. } => "stick-sign",
            Self::VehicleSize { .. } => "vehicle-size",
            Self::VehicleUnstable => "vehicle-unstable",
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

    /// True when it makes the result meaningless: the fit is then no answer, converged or not.
    pub fn is_fatal(&self) -> bool {
        match self {
            Self::ConstantData | Self::IdlePilot => true,
            Self::NoForcing { .. } | Self::WrongScale { .. } => true,
            Self::UnstableLoop { allowed, .. } | Self::Leaves { allowed, .. } => !allowed,
            Self::Outlier { share, .. } => share.is_some_and(|share| share > GOVERNS),
            Self::LoopOnBound { contradicted, .. } => *contradicted,
            _ => false,
        }
    }
}

/// What speaks against taking `fit` at its word, the gravest first.
pub fn doubts(fit: &Fit, options: &Options, trials: &[Trial]) -> Vec<Doubt> {
    let mut doubts = flights::doubts(fit, options, trials);
    doubts.extend(samples::doubts(fit, options, trials));
    doubts.extend(flown::doubts(fit, options, trials));
    doubts.extend(solution::doubts(fit, options));
    if doubts.contains(&Doubt::ConstantData) {
        // What a pilot of nothing is like, nobody needs to know.
        doubts.retain(Doubt::is_fatal);
    }
    let rank = |doubt: &Doubt| {
        (
            !matches!(doubt, Doubt::UnstableLoop { .. }),
            !doubt.is_fatal(),
        )
    };
    doubts.sort_by_key(rank);
    doubts
}
