//! `pilotage optimise`: optimal control of any system of models.

use super::deadline::Deadline;
use super::overwrite::{self, OutputKind, Overwrite};
use super::progress::Spinner;
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, interrupt, terminal};
use crate::control::optimise::{Answer, Effort, Verdict, optimise};
use crate::control::pose::{Earlier, Posed, Variable};
use crate::estimation::ProblemFile;
use crate::estimation::file::Mesh;
use crate::flights;
use crate::series::{Column, Series};
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

const EXAMPLES: &str = "\
Examples:
  # The highest flight of Goddard's rocket; its trajectory as a table over time.
  pilotage optimise goddard.toml -o flight.csv

  # Another like it, from there.
  pilotage optimise heavier.toml --from flight.csv

  # For scripts: verdict, objective, parameters, active constraints, and the certificate.
  pilotage optimise goddard.toml --json

The file has a system, [[control]] (inputs that are chosen), an [objective] and a [horizon]: docs/optimise.md.
The controls that are found are integrated once more with error control: the answer is optimal only if that
flight has the same objective and meets the constraints, and if a finer mesh does not change it.
It is a local optimum, the best of several starts.
Exit codes: 0 optimal, 1 not (inaccurate, infeasible, not converged, stopped), 2 bad use or input.";

/// Starts, unless the file says how many.
const STARTS: usize = 3;

/// Arguments of `pilotage optimise`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Problem file with an [objective] (docs/optimise.md).
    #[arg(value_name = "PROBLEM")]
    problem: PathBuf,
    /// Write the trajectory as a table over time (CSV): states, controls and other signals.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Begin from the trajectory of an earlier answer (a table as -o writes it), with its duration and parameters.
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Number of starts, instead of that in the file (3 if it gives none).
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=1000))]
    starts: Option<u16>,
    /// Solve on the given mesh alone.
    #[arg(long)]
    no_refinement: bool,
    /// Stop after this time [s].
    #[arg(long, value_name = "SECONDS", value_parser = super::number::positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    recognise::expect([&args.problem], &[FileKind::Problem], "a problem file")?;
    let outputs: Vec<(&Path, OutputKind)> = (args.output.iter())
        .map(|path| (path.as_path(), OutputKind::Result))
        .collect();
    let inputs: Vec<PathBuf> = [&args.problem]
        .into_iter()
        .chain(&args.from)
        .cloned()
        .collect();
    args.overwrite.check(&inputs, &outputs)?;
    let file = ProblemFile::read(&args.problem)?;
    let mut posed = Posed::new(&file, &flights::open)?;
    posed.check()?;
    if let Some(path) = &args.from {
        posed.earlier = Some(Earlier::read(path, &posed)?);
    }
    let given = args.starts.map(usize::from).or(file.options.starts);
    let effort = Effort {
        starts: given.unwrap_or(STARTS),
        rounds: match args.no_refinement {
            true => 0,
            false => Effort::default().rounds,
        },
        mesh_tolerance: match file.options.mesh {
            Mesh::Tolerance(tolerance) => tolerance,
            _ => Effort::default().mesh_tolerance,
        },
        most_iterations: file.options.max_iterations,
    };
    interrupt::listen("stopping")?;
    let deadline = Deadline::after(args.time_limit);
    let spinner = Spinner::new("optimising");
    let clock = Instant::now();
    let answer = optimise(&posed, &effort, &mut |at| {
        spinner.show(format!(
            "iteration {}, objective {:.6e}, violation {:.1e}, KKT residual {:.1e}",
            at.number, at.objective, at.violation, at.kkt
        ));
        match deadline.ask() {
            ControlFlow::Continue(()) => ControlFlow::Continue(()),
            ControlFlow::Break(_) => ControlFlow::Break(()),
        }
    });
    let seconds = clock.elapsed().as_secs_f64();
    spinner.clear();
    if let Some(path) = &args.output {
        overwrite::save_table(path, &table(&posed, &answer))?;
    }
    terminal::print(&match args.json {
        true => format!("{:#}\n", to_json(&posed, &answer, seconds)),
        false => to_text(&file.file, &posed, &answer),
    })?;
    Ok(match answer.verdict {
        Verdict::Optimal | Verdict::Converged => Outcome::Done,
        _ => Outcome::No,
    })
}

/// The parameters that were sought, without the duration and those of the objective.
fn sought<'a>(posed: &'a Posed, answer: &'a Answer) -> impl Iterator<Item = (&'a Variable, f64)> {
    let all = posed
        .parameters
        .iter()
        .zip(answer.parameters.iter().copied());
    all.filter(|(own, _)| own.name != "duration" && !own.name.contains(' '))
}

/// The trajectory as a table over time, with the parameters in its comments.
pub fn table(posed: &Posed, answer: &Answer) -> Series {
    let mut columns = Vec::new();
    let variables = posed.states.iter().filter(|own| own.name.contains('.'));
    for (k, own) in variables.enumerate() {
        let values = answer.trajectory.iter().map(|at| at.states[k]).collect();
        columns.push(column(&own.name, own.unit.as_deref(), values));
    }
    for (k, own) in posed.controls.iter().enumerate() {
        let values = answer.trajectory.iter().map(|at| at.controls[k]).collect();
        columns.push(column(&own.name, own.unit.as_deref(), values));
    }
    for (k, (name, unit)) in posed.signals.iter().enumerate() {
        let values = answer.trajectory.iter().map(|at| at.signals[k]).collect();
        columns.push(column(name, unit.as_deref(), values));
    }
    Series {
        time: answer.trajectory.iter().map(|at| at.time).collect(),
        comments: sought(posed, answer)
            .map(|(own, value)| format!("{}: {value}", own.name))
            .collect(),
        columns,
        ..Series::default()
    }
}

fn column(name: &str, unit: Option<&str>, values: Vec<f64>) -> Column {
    Column {
        name: name.to_owned(),
        unit: unit.unwrap_or_default().to_owned(),
        values,
    }
}

/// Magnitude of an objective that nothing seems to bound.
const UNBOUNDED: f64 = 1e9;

fn verdict(answer: &Answer) -> String {
    let (same, converged) = answer.agreeing();
    let all = counted(answer.starts.len(), "start");
    let far = &answer.certificate;
    match answer.verdict {
        Verdict::Optimal => format!(
            "a local optimum: {same} of {all} ended there, {} elsewhere",
            converged - same
        ),
        Verdict::Converged => format!(
            "converged on this mesh, which was not refined: what a finer one changes is not known; {same} of {all} ended there"
        ),
        Verdict::Inaccurate if !far.is_whole => {
            "no optimum: the program converged, but its controls cannot be integrated to the end"
                .into()
        }
        Verdict::Inaccurate => {
            "no optimum: the program converged, but the replay differs or a finer mesh changes it; \
                                write more `intervals`"
                .into()
        }
        Verdict::Infeasible => format!("infeasible: none of {all} met the constraints"),
        Verdict::NotConverged if answer.objective.is_nan() => {
            "not converged: the objective is not a number where the search is; limit what it is taken of".into()
        }
        Verdict::NotConverged if answer.objective.abs() > UNBOUNDED => format!(
            "not converged: the objective came to {}; is it bounded? Limit the controls, or add a cost",
            significant(answer.objective, 2)
        ),
        Verdict::NotConverged => {
            format!("not converged: none of {all}; write other starts, or a [guess]")
        }
        Verdict::Stopped => "stopped: the best so far".into(),
    }
}

fn to_text(file: &str, posed: &Posed, answer: &Answer) -> String {
    let mut text = format!("{}: {}\n", terminal::line(file), verdict(answer));
    if let Some(name) = &answer.violated {
        text += &format!("violated most: {}\n", terminal::line(name));
    }
    let word = if posed.is_maximised {
        "maximum"
    } else {
        "minimum"
    };
    text += &format!("{word}: {}\n", significant(answer.objective, 8));
    text += &format!("duration: {} s\n", significant(answer.duration, 8));
    let certificate = &answer.certificate;
    text += &format!(
        "replay: objective {}, largest violation {} of the limit's size{}\n",
        significant(certificate.objective, 8),
        significant(certificate.violation, 2),
        match certificate.violated.as_str() {
            "" => String::new(),
            name => format!(" ({})", terminal::line(name)),
        }
    );
    for (own, value) in sought(posed, answer) {
        let unit = own.unit.as_deref().unwrap_or_default();
        text += &format!(
            "{} = {} {unit}\n",
            terminal::line(&own.name),
            significant(value, 8)
        );
    }
    for own in &answer.active {
        let side = if own.is_upper { "upper" } else { "lower" };
        text += &format!(
            "active: {} at its {side} limit, {}\n",
            terminal::line(&own.name),
            counted(own.count, "place")
        );
    }
    for name in &answer.singular {
        text += &format!(
            "singular: {} is between its limits, and enters linearly\n",
            terminal::line(name)
        );
    }
    let (intervals, _) = answer.meshes[answer.meshes.len() - 1];
    text += &format!(
        "{}, {}, largest local error {}\n",
        counted(intervals, "interval"),
        counted(answer.iterations, "iteration"),
        significant(answer.mesh_error, 2)
    );
    text
}

fn to_json(posed: &Posed, answer: &Answer, seconds: f64) -> Value {
    let pairs = posed.parameters.iter().zip(&answer.parameters);
    let parameters: Map<String, Value> = pairs
        .filter(|(own, _)| !own.name.contains(' '))
        .map(|(own, value)| {
            (
                own.name.clone(),
                json!({ "value": value, "unit": own.unit }),
            )
        })
        .collect();
    let active = answer.active.iter().map(|own| {
        json!({
            "name": own.name,
            "limit": if own.is_upper { "max" } else { "min" },
            "places": own.count,
            "multiplier": own.multiplier,
        })
    });
    let starts = answer.starts.iter().map(|own| {
        json!({ "status": own.status.as_str(), "objective": own.objective, "iterations": own.iterations, "seconds": own.seconds })
    });
    let meshes = answer.meshes.iter();
    let costates: Map<String, Value> = posed
        .states
        .iter()
        .enumerate()
        .map(|(k, own)| {
            let ends = [answer.costates.first(), answer.costates.last()];
            let signs = ends.map(|end| end.map(|own| own[k].signum()));
            (
                own.name.clone(),
                json!({ "start": signs[0], "end": signs[1] }),
            )
        })
        .collect();
    json!({
        "status": answer.verdict.as_str(),
        "objective": answer.objective,
        "duration": answer.duration,
        "parameters": parameters,
        "certificate": {
            "objective": answer.certificate.objective,
            "violation": answer.certificate.violation,
            "violated": answer.certificate.violated,
            "distance": answer.certificate.distance,
            "whole": answer.certificate.is_whole,
        },
        "violated": answer.violated,
        "active": active.collect::<Vec<_>>(),
        "singular": answer.singular,
        "costate_signs": costates,
        "starts": starts.collect::<Vec<_>>(),
        "meshes": meshes.map(|(count, objective)| json!({ "intervals": count, "objective": objective })).collect::<Vec<_>>(),
        "mesh_error": answer.mesh_error,
        "kkt": answer.kkt,
        "iterations": answer.iterations,
        "seconds": seconds,
    })
}
