//! The words of each doubt.

use super::Doubt;

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
            Self::NoForcing { forcing: 0.0, .. } => write!(
                f,
                "every run begins at its target, which stays there: what moves is the human's own noise, and \
                 no pilot can be told from that; record runs to targets away from the start, or to moving ones"
            ),
            Self::NoForcing { forcing, error } => write!(
                f,
                "no target is more than {forcing:.3} m from where its run begins, and the vehicle strays up to \
                 {error:.3} m from it: what moves is the human's own noise, and no pilot can be told from that; \
                 record runs to targets farther away, or to moving ones"
            ),
            Self::WrongScale { factor } => write!(
                f,
                "the vehicle moves {factor:.3} times as far as its targets: position or target has {}",
                match *factor < 0.0 {
                    true => "the wrong sign",
                    false => "the wrong unit; give the column its unit, as in `position [cm]`",
                }
            ),
            Self::TimeScale { duration, step } => write!(
                f,
                "the longest run takes {duration:.1} s with a sample every {step:.2e} s: a pilot acts within tenths \
                 of a second and takes seconds to a target, so the times may be in another unit; head the column \
                 with it, as in `time [ms]`"
            ),
            Self::Misfit { run, ratio } => write!(
                f,
                "{run} is fitted {ratio:.1} times as badly as the others: its origin, its target or its unit may be \
                 another, or another pilot flew; see what the fit is without it"
            ),
            Self::DeadStick { run } => write!(
                f,
                "the recorded stick of {run} stays at zero while the vehicle moves: leave the column out"
            ),
            Self::Gap { run, from, to } => write!(
                f,
                "{run} has no rows from {from} s to {to} s: split it there, or fit with a --mesh-step"
            ),
            Self::Moving { run, speed, most } => write!(
                f,
                "{run} begins at {speed:.2} m/s, and full stick from rest gives {most:.2} m/s: it was in motion \
                 before its first sample; begin the recording earlier, or fit with --initial-state free"
            ),
            Self::TargetOutlier {
                run,
                time,
                target,
                around,
            } => write!(
                f,
                "the target of {run} is {target} m at {time} s and {around} m before and after: if that is an error, \
                 mend it, since the pilot is made to answer it"
            ),
            Self::Jump {
                run,
                time,
                size,
                unit,
            } => write!(
                f,
                "{run} jumps by {size:.3e}{} at {time} s and does not come back: part of it may have another origin \
                 or unit",
                symbol(unit)
            ),
            Self::IdlePilot => write!(f, "the fitted pilot does nothing: its stick stays at zero"),
            Self::Outlier {
                run,
                time,
                value,
                unit,
                count,
                share,
            } => {
                let others = match count {
                    1 => String::new(),
                    _ => format!(", the worst of {count} such samples"),
                };
                let unit = symbol(unit);
                let (off, part) = match share {
                    Some(share) => (
                        "off and far",
                        format!(
                            "{:.0} % of the sum of squares come from there: ",
                            100.0 * share
                        ),
                    ),
                    None => ("and far", String::new()),
                };
                write!(
                    f,
                    "the sample of {run} at {time} s is {value:.3e}{unit} {off} from its neighbours{others}; {part}empty \
                     the cell if it is an error"
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
            Self::MeshError {
                run,
                error,
                residual,
                interval,
            } => write!(
                f,
                "the mesh is too coarse: solved with short steps, the equations are {error:.2e} m rms from the \
                 solution, whose residual is {residual:.2e} m rms; {run} is the worst, with an interval of \
                 {interval:.3} s; take a shorter --mesh-step, or a --scheme of higher order"
            ),
            Self::Leaves {
                step, time, error, ..
            } => write!(
                f,
                "the closed loop is stable for small errors alone: flown on towards a target {step:.3} m away, with \
                 the stick at its stops, it is {error:.3} m off after {time:.0} s"
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
                 try --random-starts {}",
                (2 * starts).max(20)
            ),
            Self::StoppedEarly { skipped, starts } => write!(
                f,
                "{skipped} of {starts} starts were not tried, since the fit was ended; there may be a better optimum"
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
            Self::LoopOnBound {
                pole, swings, cost, ..
            } => {
                let at = match swings {
                    Some(frequency) => format!(
                        "a pair at {pole:.1e} ± {frequency:.2}i 1/s: it hardly comes to rest, and the human's own loop \
                         may not have been stable"
                    ),
                    None => format!(
                        "a pole at {pole:.1e} 1/s: flights this short do not tell how it settles in the long run"
                    ),
                };
                write!(f, "the closed loop lies on its stability bound, {at}")?;
                if let Some(cost) = cost {
                    let percent = 100.0 * cost;
                    write!(
                        f,
                        "; the bound makes the sum of squares {percent:.2} % greater"
                    )?;
                }
                match self.is_fatal() {
                    true => write!(
                        f,
                        ": what was flown is no stable loop, see --allow-unstable-loop"
                    ),
                    false => Ok(()),
                }
            }
            Self::SlowLoop { pole, duration } => write!(
                f,
                "the slowest pole of the closed loop, {pole:.1e} 1/s, fades within {:.0} s, and the longest run \
                 takes {duration:.0} s: it may as well be unstable",
                -1.0 / pole
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

/// A unit behind a number.
fn symbol(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        _ => format!(" {unit}"),
    }
}
