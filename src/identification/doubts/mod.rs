//! Why a fit may say less than it seems to: something is odd about the flights or the vehicle, other starts
//! ended elsewhere, or the data cannot tell some of the pilot's parameters.

mod flights;
mod solution;

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
    NoForcing,
    /// The stick of the fitted pilot stays at zero.
    IdlePilot,
    /// A sample far from its neighbours.
    Outlier {
        /// Name of the run.
        run: String,
        /// Time of the sample [s].
        time: f64,
        /// Recorded minus modelled, with its unit.
        residual: f64,
        /// Unit of the residual.
        unit: &'static str,
        /// How many such samples there are.
        count: usize,
        /// Their part of the objective, 0 to 1.
        share: f64,
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
        /// Radius of gyration √(I/m) [m].
        gyration: f64,
        /// Arm length [m].
        arm: f64,
    },
    /// The vehicle's own pitch loop is unstable.
    VehicleUnstable,
    /// The mesh is coarser than a tenth of a run.
    CoarseMesh {
        /// Length of an interval [s].
        step: f64,
        /// The shortest run [s].
        duration: f64,
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
        /// Real part of its slowest pole [1/s].
        pole: f64,
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
            Self::NoForcing => "no-forcing",
            Self::IdlePilot => "idle-pilot",
            Self::Outlier { .. } => "outlier",
            Self::PoorFit { .. } => "poor-fit",
            Self::StickSign { .. } => "stick-sign",
            Self::VehicleSize { .. } => "vehicle-size",
            Self::VehicleUnstable => "vehicle-unstable",
            Self::CoarseMesh { .. } => "coarse-mesh",
            Self::SaturatedStick { .. } => "saturated-stick",
            Self::OneStart { .. } => "one-start",
            Self::Lower { .. } => "lower-start",
            Self::WildStart { .. } => "wild-start",
            Self::LoopOnBound { .. } => "loop-on-bound",
            Self::Integrates => "integrating-pilot",
            Self::PilotOnBound { .. } => "pilot-on-bound",
            Self::FastPole { .. } => "fast-pole",
            Self::Cancelled { .. } => "cancelled-pole",
        }
    }

    /// True when it makes the result meaningless: the fit is then no answer, converged or not.
    pub fn is_fatal(&self) -> bool {
        match self {
            Self::ConstantData | Self::NoForcing | Self::IdlePilot => true,
            Self::UnstableLoop { allowed, .. } => !allowed,
            Self::Outlier { share, .. } => *share > GOVERNS,
            _ => false,
        }
    }
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::UnstableLoop { pole, allowed } => write!(
                f,
                "the closed loop is UNSTABLE: with its vehicle this pilot has a pole at {pole:+.2e} 1/s, so it \
                 leaves the target when it is flown on{}",
                match allowed {
                    true => "",
                    false => "; a fit of the response that converges keeps it stable",
                }
            ),
            Self::ConstantData => write!(
                f,
                "the vehicle does not move in any run: nothing can be said of the pilot"
            ),
            Self::NoForcing => write!(
                f,
                "every run begins at its target, which stays there: what moves is the human's own noise, and \
                 no pilot can be told from that; record runs to targets away from the start, or to moving ones"
            ),
            Self::IdlePilot => write!(f, "the fitted pilot does nothing: its stick stays at zero"),
            Self::Outlier {
                run,
                time,
                residual,
                unit,
                count,
                share,
            } => {
                let others = match count {
                    1 => String::new(),
                    _ => format!(", the worst of {count} such samples"),
                };
                let unit = if *unit == "1" {
                    String::new()
                } else {
                    format!(" {unit}")
                };
                write!(
                    f,
                    "the sample of {run} at {time} s is {residual:.3e}{unit} off and far from its neighbours{others}; \
                     {:.0} % of the sum of squares come from there: empty the cell if it is an error",
                    100.0 * share
                )
            }
            Self::PoorFit { explained } => write!(
                f,
                "the model explains {:.0} % of the variance of what was recorded: another --order, --vehicle \
                 or --initial-state may do better",
                100.0 * explained.max(0.0)
            ),
            Self::StickSign { correlation } => write!(
                f,
                "the recorded stick goes against the vehicle's motion (correlation {correlation:.2} with the \
                 stick that the motion implies): forward is negative here, so its sign may be wrong"
            ),
            Self::VehicleSize { gyration, arm } => write!(
                f,
                "the vehicle's radius of gyration √(inertia/mass) is {gyration:.3} m with an arm of {arm} m: \
                 one of mass, inertia and arm_length may be in another unit"
            ),
            Self::VehicleUnstable => write!(
                f,
                "the vehicle's own pitch loop is unstable, so nobody can have flown it; see `pilotage vehicle \
                 check`"
            ),
            Self::CoarseMesh { step, duration } => write!(
                f,
                "a mesh step of {step} s is more than a tenth of a run of {duration} s: the states between are \
                 those of the scheme, not of the equations; take a shorter --mesh-step"
            ),
            Self::SaturatedStick { recorded, fitted } => {
                let percent = |part: f64| format!("{:.0} %", 100.0 * part);
                let recorded =
                    recorded.map(|part| format!("{} of the recorded samples and ", percent(part)));
                write!(
                    f,
                    "the stick lies at its stop in {}{} of the fitted ones: a linear pilot that is held \
                     there is not what the human did",
                    recorded.unwrap_or_default(),
                    percent(*fitted)
                )
            }
            Self::OneStart { starts: 0 | 1 } => write!(
                f,
                "one start alone ran, so nothing tells whether there is a better optimum; leave --start out, or \
                 try --random-starts 8"
            ),
            Self::OneStart { starts } => write!(
                f,
                "only one of {starts} starts ended here; there may be a better optimum, \
                 try --random-starts 20"
            ),
            Self::Lower { start, objective } => write!(
                f,
                "start {start} came to a sum of squares of {objective:.6} and did not converge: there is a \
                 better optimum, try --max-iterations or --random-starts 20"
            ),
            Self::WildStart {
                run,
                state,
                value,
                later,
            } => write!(
                f,
                "{run} begins with {state} = {value:.2}, which stays within {later:.2} after a second: its free \
                 initial states explain what the pilot should, and many optima do so; fit with --initial-state \
                 vehicle-at-rest"
            ),
            Self::LoopOnBound { pole } => write!(
                f,
                "the closed loop lies on its stability bound (a pole at {pole:.1e} 1/s): flights this short do \
                 not tell how it settles in the long run"
            ),
            Self::Integrates => write!(
                f,
                "θ1 lies on its bound: this pilot integrates, which runs this short cannot tell"
            ),
            Self::PilotOnBound { frequency } => write!(
                f,
                "the pilot lies on its stability bound: it swings undamped at {frequency:.3} rad/s"
            ),
            Self::FastPole { pole, limit } => write!(
                f,
                "the pole at {pole:.3e} 1/s is faster than the samples can tell ({limit:.0} 1/s): \
                 its size means nothing"
            ),
            Self::Cancelled { pole } => write!(
                f,
                "a pole of {pole:.3} 1/s lies on a zero: a lower --order says the same"
            ),
        }
    }
}

/// What speaks against taking `fit` at its word, the gravest first.
pub fn doubts(fit: &Fit, options: &Options, trials: &[Trial]) -> Vec<Doubt> {
    let mut doubts = flights::doubts(fit, options, trials);
    doubts.extend(solution::doubts(fit, options));
    let rank = |doubt: &Doubt| {
        (
            !matches!(doubt, Doubt::UnstableLoop { .. }),
            !doubt.is_fatal(),
        )
    };
    doubts.sort_by_key(rank);
    doubts
}
