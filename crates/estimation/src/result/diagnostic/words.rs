//! The message of each diagnostic: what was found, and what to do.

use super::Diagnostic;
use crate::posed::stability::CLOSED_LOOP;
use pilotage_text::counted;
use pilotage_text::number::{rounded, short};
use std::fmt;

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Beside(own) => f.write_str(&own.words),
            Self::NotConverged {
                status,
                has_kinks,
                is_resting,
                violation,
            } => write!(
                f,
                "the solver ended with \"{status}\": this is its best iterate, not a result{}; {}try other start values, ranges \
                 (min, max) or more `starts`",
                violation.map_or(String::new(), |violation| format!(
                    ", and its states do not fulfil equations and constraints (largest scaled violation {violation:.1e})"
                )),
                match has_kinks {
                    true if *is_resting =>
                        "`closed_loop = true` asks that the loop is stable where the first run begins, and a dead zone opens it \
                         there: take that line out; else ",
                    true =>
                        "the equations have kinks (`min`, `max`, `abs`, `if`, `sat`, `deadzone` ...), at which their \
                         derivatives jump: a smooth form often converges, as sqrt(x^2 + w^2) with a small w for abs(x); else ",
                    false => "",
                }
            ),
            Self::AtKinks(offset) => write!(
                f,
                "the solver ended at kinks of the equations (`min`, `max`, `abs`, `if`, `sat`, `deadzone` ...): the parameters \
                 may be {} of a standard deviation beside the optimum; a smaller mesh_tolerance or a smooth form may do better",
                short(*offset, 1)
            ),
            Self::AtBound {
                name,
                bound,
                is_tied,
            } => write!(
                f,
                "`{name}` lies on the end {bound} of its range: widen the range, or {}",
                match is_tied {
                    true => "tie it otherwise: it keeps what it follows from",
                    false => "fix the parameter",
                }
            ),
            Self::Violated { name, by } => write!(
                f,
                "{name} is violated by {by:.1e} (scaled): what is asked for there may not go with the rest{}",
                match name.ends_with(CLOSED_LOOP) {
                    true =>
                        "; a pilot without lead, such as `crossover`, stabilises no vehicle that integrates twice",
                    false => "",
                }
            ),
            Self::BeyondLimit { name, by } => write!(
                f,
                "{name} is exceeded by up to {by:.1e}: as constraints limits say nothing of prediction errors, \
                 and an exported model stays within; fit again without limits = \"constrain\", as it saturates then"
            ),
            Self::OnLimit { name, samples } => write!(
                f,
                "{name} holds the solution at {}: as a constraint it bends the parameters where the recorded output \
                 saturated; fit again without limits = \"constrain\", as it saturates then",
                counted(*samples, "sample")
            ),
            Self::Coloured { measured, p } => write!(
                f,
                "the innovations of {measured} are not white (Ljung and Box, p = {p:.0e}): the noise of the model does not \
                 account for what it lacks, and intervals are too short; add what is missing, or noise where it enters"
            ),
            Self::Unbounded { measured, sd } => write!(
                f,
                "a sample of {measured} is predicted to {sd:.1e}: where an initial state is free and a noise level is sought, the \
                 likelihood grows without end as that goes to 0; state `sd`, or give the level a `min`"
            ),
            Self::UnstableLoop { growth, is_kept } => write!(
                f,
                "the system, linearised where the first run ends, grows by {} 1/s: right if the recorded one grew or \
                 oscillated by itself; {}",
                short(*growth, 3),
                match is_kept {
                    true => "[stability] keeps it stable where the first run begins alone",
                    false => "if not, add [stability] with closed_loop = true",
                }
            ),
            Self::PoorFit {
                measured,
                explained,
            } => write!(
                f,
                "the model explains {:.0} % of the variance of {measured} within the runs: another structure or other starts \
                 may do better, or the runs move it by little more than noise",
                100.0 * explained.max(0.0)
            ),
            Self::InputLeft {
                measured,
                input,
                lag,
                correlation,
            } => write!(
                f,
                "the residuals of {measured} are correlated with {input}, most with what it was {lag:.3} s before \
                 ({correlation:.2}): the model lacks a path or a delay from there, or has a wrong one"
            ),
            Self::Outlier {
                measured,
                run,
                time,
                value,
                unit,
                count,
                share,
                is_fitted,
            } => write!(
                f,
                "{measured} of {run} at {} s is {}{}{} and breaks away from its neighbours ({}{}): empty the cells if they are \
                 errors, or fit with noise = \"student\"",
                rounded(*time, 9),
                short(*value, 4),
                spaced(unit.as_deref()),
                if *is_fitted { " from the model" } else { "" },
                match count {
                    1 => "one such sample".to_owned(),
                    _ => format!("{count} such samples"),
                },
                match is_fitted {
                    true => format!(", {:.0} % of the column's sum of squares", 100.0 * share),
                    false => String::new(),
                },
            ),
            Self::Jump {
                measured,
                run,
                time,
                size,
                unit,
            } => write!(
                f,
                "{measured} of {run} jumps by {}{} at {} s, which nothing explains, and does not come back: part of the column may \
                 have another origin or unit",
                short(*size, 4),
                spaced(unit.as_deref()),
                rounded(*time, 9),
            ),
            Self::Frozen {
                measured,
                run,
                value,
                from,
                to,
                size,
                unit,
                count,
            } => {
                let unit = spaced(unit.as_deref());
                write!(
                    f,
                    "{measured} of {run} stays at {}{unit} from {} s to {} s{}{}: the sensor or the recording stood still; \
                 empty these cells",
                    short(*value, 6),
                    rounded(*from, 9),
                    rounded(*to, 9),
                    match size {
                        Some(size) =>
                            format!(" and is {}{unit} away at the next sample", short(*size, 4)),
                        None => " while what drives it moves".to_owned(),
                    },
                    match count {
                        1 => String::new(),
                        _ => format!(" (the longest of {count} such stretches)"),
                    },
                )
            }
            Self::FrozenInput {
                column,
                run,
                from,
                to,
                is_worse,
            } => write!(
                f,
                "{column} of {run}, which drives an input, stands still from {} s to {} s, then jumps{}: if the recording \
                 stood still, cut the run there",
                rounded(*from, 9),
                rounded(*to, 9),
                match is_worse {
                    true => ", and the model is farther from the recording meanwhile",
                    false => "",
                }
            ),
            Self::Gap { run, from, to } => write!(
                f,
                "{run} has no rows from {} s to {} s, and its inputs are taken along lines there: cut the run there",
                rounded(*from, 9),
                rounded(*to, 9)
            ),
            Self::TimeScale {
                duration,
                step,
                is_stated,
            } => write!(
                f,
                "the longest run takes {} s with a sample every {} s: a pilot acts within tenths of a second and takes \
                 seconds to a target, so the times may be in another unit; head the column with it, as in `time [ms]`{}",
                short(*duration, 3),
                short(*step, 3),
                if *is_stated { "" } else { ", or `time [s]` if it is so" }
            ),
            Self::Misfit {
                measured,
                run,
                ratio,
            } => write!(
                f,
                "{measured} of {run} is fitted {ratio:.1} times as badly as that of the others: an origin, an input or a \
                 unit may be another there, or another pilot flew; see what the fit is without it"
            ),
            Self::SlowSensor {
                measured,
                run,
                rows,
            } => write!(
                f,
                "{measured} of {run} is new in one of {rows} rows alone, and repeated in the others: a fit takes every row for a \
                 sample, and delays come out too long; empty the cells that repeat the one before"
            ),
            Self::Late { measured, run, by } => write!(
                f,
                "{measured} of {run} comes {} s {} than in the other runs, and the \
                 inputs do not explain it: its columns may be of different clocks, or it was another vehicle",
                short(by.abs(), 2),
                if *by > 0.0 { "later" } else { "earlier" }
            ),
            Self::Clipped {
                measured,
                run,
                value,
                unit,
                part,
            } => write!(
                f,
                "{:.0} % of the samples of {measured} in {run} stay at the ends of what was recorded, such as {value}{}: if that is a \
                 stop, the model saturates there (`sat`, or a limit with limits = \"saturate\"); if a sensor's range, empty those cells",
                100.0 * part,
                spaced(unit.as_deref()),
            ),
            Self::Copy { run, of, count } => write!(
                f,
                "{run} has the samples of {of}{}: what is in both counts twice, and intervals are too narrow; leave one out",
                match count {
                    1 => String::new(),
                    _ => format!(" ({count} runs are such copies)"),
                }
            ),
            Self::FewValues { values, unknowns } => write!(
                f,
                "{} do not determine {unknowns} unknowns and their intervals: record more, fix parameters or give them priors",
                counted(*values, "measured value")
            ),
            Self::ConstantData => f.write_str(
                "what is measured does not move in any run: nothing can be said of what moves it",
            ),
            Self::NoForcing { columns: [position, target] } => write!(
                f,
                "in no run is {target} farther from where {position} begins than {position} strays from it: what moves is the \
                 human's own noise, and no pilot can be identified from that; record runs to targets away from the start, or to \
                 moving ones"
            ),
            Self::WrongScale {
                columns: [position, target],
                factor,
                run,
            } => write!(
                f,
                "{}{position} moves {} times as far as {target}: one of them has {}",
                (run.as_ref()).map_or(String::new(), |run| format!("in {run}, unlike in other runs, ")),
                short(*factor, 4),
                match *factor < 0.0 {
                    true => "the wrong sign, or another origin than the other".to_owned(),
                    false =>
                        format!("the wrong unit; give the column its unit, as in `{position} [cm]`"),
                }
            ),
            Self::Origin {
                columns: [position, target],
                run,
                offset,
                unit,
            } => write!(
                f,
                "{position} of {run} follows {target} {}{} beside it: one of the two may have another origin",
                short(*offset, 3),
                spaced(unit.as_deref())
            ),
            Self::TargetOutlier {
                column,
                run,
                time,
                target,
                around,
                unit,
            } => write!(
                f,
                "{column} of {run} is {target}{unit} at {time} s and {around}{unit} before and after: if that is an error, mend it, \
                 since the pilot is made to answer it",
                unit = spaced(unit.as_deref())
            ),
            Self::OnStabilityBound(of) => write!(
                f,
                "{of} lies on the bound that [stability] keeps: runs this short do not show how it settles in the \
                 long run, or the data ask for what grows"
            ),
            Self::CoarseMesh(error) => write!(
                f,
                "the states have an estimated relative error of {error:.1e} on this mesh, and parameters may be off by \
                 as much: leave `mesh` and `mesh_step` out, or lower the step (--mesh-step)"
            ),
            Self::MeshError {
                error,
                tolerance,
                is_limited,
                rounds,
            } => write!(
                f,
                "the states have an estimated relative error of {error:.1e} where {tolerance:.1e} was asked for{}",
                match (is_limited, rounds) {
                    (true, _) =>
                        ", since a solve on a finer mesh was ended by max_iterations: raise it"
                            .to_owned(),
                    (false, Some(rounds)) => format!(
                        " after {rounds} refinements, and there are no more: try another `scheme` (docs/schemes.md), or \
                         raise `mesh_tolerance`"
                    ),
                    (false, None) => {
                        "; a finer mesh has no solution, or too many intervals: fit shorter runs, try another `scheme` \
                         (docs/schemes.md), or raise `mesh_tolerance`".to_owned()
                    }
                }
            ),
            Self::MeshMoves(change) => write!(
                f,
                "the last refinement of the mesh still moved a parameter by {change:.1e} of its size: lower \
                 mesh_tolerance and compare"
            ),
            Self::Simulated {
                objective,
                simulated: Some(simulated),
            } => write!(
                f,
                "a simulation with the estimated initial states and parameters has the objective {simulated:.6e}, not \
                 {objective:.6e}: the mesh is too coarse, or the system is so unstable that small errors grow"
            ),
            Self::Simulated {
                simulated: None, ..
            } => write!(
                f,
                "a simulation with the estimates does not complete: the mesh is too coarse, or the system is unstable"
            ),
            Self::Cut {
                status,
                starts,
                refinement,
                events,
            } => write!(
                f,
                "{status} ended the fit before {}: this is the best result so far",
                undone(*starts, *refinement, *events)
            ),
            Self::Alone(starts) => write!(
                f,
                "of {starts} starts one alone led to this optimum: there may be better ones; raise `starts` (--random-starts)"
            ),
            Self::Changes(change) => change.fmt(f),
            Self::OtherOptimum(other) => other.fmt(f),
            Self::Mixed(words) => write!(f, "{words}"),
            Self::Stepped { input, column } => write!(
                f,
                "{column} keeps its values and jumps, and `{input}` follows it along lines from sample to sample, so that \
                 delays and lags come out wrong: write `\"{input}\" = {{ column = \"{column}\", hold = \"zero-order\" }}`, or \
                 hold = \"linear\" if it is so"
            ),
            Self::Undefined(what) => write!(f, "where the search begins, in {what}"),
            Self::EarlyEnd { run, time } => write!(
                f,
                "with the start values, the simulation of {run} ends at {time}: it diverges, or it oscillates so often that \
                 its steps are more than a mesh has room for; give other start values, or shorter runs"
            ),
            Self::FmuFailed { instance, trouble } => {
                write!(f, "the FMU of `{instance}` failed on the way, {trouble}")
            }
            Self::Contradicted(found) => found.fmt(f),
            Self::Starved(found) => found.fmt(f),
            Self::Unidentifiable(words) => {
                write!(
                    f,
                    "{words}: fix a parameter, give it a prior, or measure more"
                )
            }
            Self::Undetermined { names, curvature } => {
                let flat = curvature.map(|own| {
                    format!("in some direction the objective is flat (scaled curvature {own:.1e}): ")
                });
                let (which, what) = match names.as_slice() {
                    [] => ("all parameters".to_owned(), "one"),
                    [one] => (one.clone(), "it"),
                    all => (all.join(", "), "one"),
                };
                write!(
                    f,
                    "{}the data do not determine {which}: fix {what}, give a prior, begin where all have an effect, or measure \
                     more; the intervals of other parameters hold near this estimate alone (`pilotage fit --profile` goes further)",
                    flat.unwrap_or_default()
                )
            }
            Self::Event(event) => event.fmt(f),
            Self::NothingExplained(own) => own.fmt(f),
            Self::Contradicting(own) => own.fmt(f),
            Self::Description { instance, note } => write!(f, "the FMU of `{instance}`: {note}"),
        }
    }
}

/// A unit after a number.
fn spaced(unit: Option<&str>) -> String {
    match unit {
        None | Some("1") => String::new(),
        Some(unit) => format!(" {unit}"),
    }
}

/// The remaining work of a fit that was ended early.
fn undone(starts: usize, refinement: bool, events: bool) -> String {
    let some = (starts > 0).then(|| counted(starts, "start"));
    let others = [
        (refinement, "the refinement of the mesh"),
        (events, "the search for events"),
    ];
    let others = others.into_iter().filter(|(is_undone, _)| *is_undone);
    let all = some
        .into_iter()
        .chain(others.map(|(_, what)| what.to_owned()));
    let all: Vec<String> = all.collect();
    let verb = match (all.len(), starts) {
        (1, 0 | 1) => "was",
        _ => "were",
    };
    format!("{} {verb} complete", all.join(" and "))
}
