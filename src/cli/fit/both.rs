//! `--objective both`: fits the response and the stick, and lets both pilots fly alone (the paper's Fig. 2).

use super::models::planned;
use super::page::page;
use super::run::{outcomes, solved};
use super::summary::to_json;
use super::task::Task;
use super::{Args, Watch};
use crate::cli::deadline::Deadline;
use crate::cli::format::aligned;
use crate::cli::made::made;
use crate::cli::overwrite::{self, OutputKind};
use crate::cli::{Failure, Outcome, interrupt, terminal};
use crate::estimation::evaluate::evaluate;
use crate::estimation::result::RunFit;
use crate::estimation::result::courses::courses;
use crate::estimation::{Fit, Posed, ProblemFile};
use crate::flights::options::{InitialState, Objective};
use crate::flights::trials::TrialSet;
use crate::flights::{self, FlightOptions, Trial};
use crate::report::figure::{Figure, Look, Panel, Series};
use pilotage_inference::statistics::rms;
use pilotage_text::number::significant;
use serde_json::json;
use std::path::{Path, PathBuf};

/// A trial as recorded, and as flown alone by the pilots of the response and of the stick.
struct Flown<'a> {
    trial: &'a Trial,
    flown: [RunFit; 2],
    /// The sticks of both, at the samples.
    sticks: [Vec<f64>; 2],
}

/// Output path for the pilot of the stick fit, next to the other one.
fn stick_file(output: &Path) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-stick.toml"))
}

/// A fit of one of the two.
struct Half {
    name: &'static str,
    task: Task,
    path: PathBuf,
}

/// Computes and reports both fits.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    check(args)?;
    let task = Task::of(args)?;
    let Some((set, options)) = task.flights else {
        return Err(Failure::new("--objective both takes recorded flights"));
    };
    let output = args.output.as_deref().unwrap_or(Path::new("pilot.toml"));
    let half = |name: &'static str, objective: Objective, path: PathBuf| {
        let options = FlightOptions {
            objective,
            ..options.clone()
        };
        let mut task = Task::of_flights(set.clone(), options)?;
        args.override_options(&mut task.file.options)?;
        Ok::<_, Failure>(Half { name, task, path })
    };
    let halves = [
        half("response", Objective::Response, output.to_owned())?,
        half("stick", Objective::Stick, stick_file(output))?,
    ];
    let outputs = halves
        .iter()
        .map(|own| (own.path.as_path(), OutputKind::Fitted));
    let report = args.report.as_deref().map(|path| (path, OutputKind::Page));
    let outputs: Vec<(&Path, OutputKind)> = outputs.chain(report).collect();
    args.overwrite.check(&halves[0].task.inputs, &outputs)?;
    interrupt::listen("stopping at the next iteration")?;
    let deadline = Deadline::after(args.time_limit);

    let [response, stick] = halves
        .each_ref()
        .map(|own| Posed::new(&own.task.file, &flights::open));
    let posed = [response?, stick?];
    let (mut fits, mut raised): (Vec<Fit>, Vec<Option<Posed<'_>>>) = (Vec::new(), Vec::new());
    for (half, posed) in halves.iter().zip(&posed) {
        let (own, mut fit, _) = solved(posed, Watch::new(deadline, None, args.verbose));
        half.task.doubt(&mut fit);
        for written in planned(posed, Some(&half.path))? {
            written.write(own.as_ref().unwrap_or(posed), &fit)?;
        }
        fits.push(fit);
        raised.push(own);
    }
    let of = |k: usize| raised[k].as_ref().unwrap_or(&posed[k]);
    let flown = flown(&set, &options, &fits)?;
    if let Some(path) = &args.report {
        let outcome = outcomes((of(0), &fits[0]), &[]);
        overwrite::save(path, page(&outcome, vec![figure(&flown)], &made()))?;
    }
    terminal::print(&match args.json {
        true => {
            let runs = flown.iter().map(|run| {
                let [response, stick] = run.errors();
                json!({ "name": run.trial.name, "response_rms_m": response, "stick_rms_m": stick })
            });
            let all = json!({
                "response": to_json(&outcomes((of(0), &fits[0]), &[])),
                "stick": to_json(&outcomes((of(1), &fits[1]), &[])),
                "flown_alone": runs.collect::<Vec<_>>(),
            });
            format!("{all:#}\n")
        }
        false => text(args, &halves, &fits, &flown),
    })?;
    Ok(match fits.iter().all(Fit::is_answer) {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

/// Refuses what belongs to one fit.
fn check(args: &Args) -> Result<(), Failure> {
    let given = [
        ("--log", args.log.is_some()),
        ("--orders", args.orders.is_some()),
        ("--evaluate", args.evaluate),
    ];
    let flags = given.into_iter().find(|own| own.1).map(|own| own.0);
    match flags.or(args.refits.flag()).or(args.checks.flag()) {
        Some(flag) => {
            let message = format!("{flag} takes one fit, and --objective both are two");
            Err(Failure::new(message).hint("fit one after the other"))
        }
        None => Ok(()),
    }
}

/// All trials with the pilots of both fits, from rest at the first recorded position.
fn flown<'a>(
    set: &'a TrialSet,
    options: &FlightOptions,
    fits: &[Fit],
) -> Result<Vec<Flown<'a>>, Failure> {
    let all = TrialSet {
        fit: set.all().cloned().collect(),
        validation: Vec::new(),
        ..set.clone()
    };
    let mut sides = Vec::new();
    for fit in fits {
        let options = FlightOptions {
            theta: Some(theta(fit, options.order)),
            initial_state: InitialState::AtRest,
            objective: Objective::Response,
            ..options.clone()
        };
        let file: ProblemFile = options.problem(&all)?;
        let posed = Posed::new(&file, &flights::open)?;
        let found = evaluate(&posed);
        let at = (&found.at.0, &found.at.1[..]);
        let sticks = courses(&posed, at, &["pilot.stick"]).remove(0);
        sides.push((found.runs, sticks.unwrap_or_default()));
    }
    let (stick, response) = (sides.pop(), sides.pop());
    let pairs = response.into_iter().zip(stick);
    let of_pair = |(response, stick): (Side, Side)| {
        let flown = response.0.into_iter().zip(stick.0);
        let sticks = response.1.into_iter().zip(stick.1);
        let all = set.all().zip(flown).zip(sticks);
        all.map(|((trial, flown), sticks)| Flown {
            trial,
            flown: flown.into(),
            sticks: sticks.into(),
        })
        .collect::<Vec<_>>()
    };
    Ok(pairs.flat_map(of_pair).collect())
}

/// θ of a fitted pilot of this order.
fn theta(fit: &Fit, order: usize) -> Vec<f64> {
    let all = (1..=2 * order).filter_map(|k| fit.value(&format!("pilot.theta{k}")));
    all.collect()
}

/// Runs of one pilot and its sticks.
type Side = (Vec<RunFit>, Vec<Vec<f64>>);

impl Flown<'_> {
    /// Rms deviation of both from the recording \[m\].
    fn errors(&self) -> [f64; 2] {
        [0, 1].map(|k| {
            let run = &self.flown[k];
            let pairs = run.recorded[0].iter().zip(&run.predicted[0]);
            rms(&pairs.map(|(y, h)| y - h).collect::<Vec<f64>>())
        })
    }
}

fn text(args: &Args, halves: &[Half], fits: &[Fit], flown: &[Flown<'_>]) -> String {
    let mut text = String::new();
    for (half, fit) in halves.iter().zip(fits) {
        let values = theta(fit, usize::from(args.order)).into_iter();
        let values: Vec<String> = values.map(|own| significant(own, 5)).collect();
        let (name, verdict) = (half.name, fit.verdict());
        text += &format!("{name} fit: {verdict}, theta = {}\n", values.join(", "));
    }
    let header = [
        "flown alone, rms from the recording",
        "response fit",
        "stick fit",
    ];
    let mut rows = vec![header.map(str::to_owned)];
    let shown = |rms: f64| match rms.is_finite() {
        true => format!("{} m", significant(rms, 3)),
        false => "out of bounds".to_owned(),
    };
    rows.extend(flown.iter().map(|run| {
        let [response, stick] = run.errors().map(shown);
        [run.trial.name.clone(), response, stick]
    }));
    text += "\n";
    text += &aligned(&rows);
    text += "\n";
    for path in halves.iter().map(|own| &own.path).chain(&args.report) {
        text += &format!("wrote {}\n", terminal::shown(path));
    }
    text
}

/// Both pilots flying alone, with the recordings.
fn figure(flown: &[Flown<'_>]) -> Figure {
    const NAMES: [(&str, &str); 2] = [("response fit", "line-1"), ("stick fit", "line-2")];
    let (mut positions, mut sticks) = (Vec::new(), Vec::new());
    for run in flown {
        let trial = run.trial;
        let line = |label: &str, colour: &str, y: &[f64]| {
            Series::line(label, colour, &trial.time, y).of(&trial.name)
        };
        positions.push(line("target", "goal", &trial.target).looks(Look::Dashed));
        positions.push(line("recorded", "data", &trial.position));
        sticks.extend(
            trial
                .stick
                .iter()
                .map(|stick| line("recorded", "data", stick)),
        );
        for (k, (name, colour)) in NAMES.into_iter().enumerate() {
            positions.push(line(name, colour, &run.flown[k].predicted[0]));
            sticks.push(line(name, colour, &run.sticks[k]));
        }
    }
    let caption = "Each pilot flies alone, from rest; nothing is left of the optimiser here.";
    let mut figure = Figure::of(
        "both",
        "Both pilots",
        caption,
        Panel::over_time("position [m]", 340.0, positions),
    );
    figure.panels.push(Panel::over_time("stick", 240.0, sticks));
    figure
}
