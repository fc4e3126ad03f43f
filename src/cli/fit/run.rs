//! One fit, from the problem to what is written.

use super::log::Log;
use super::models::{self, Fitted};
use super::refits::{NOTHING, Plan, Refitted};
use super::start::Begin;
use super::summary::{self, Outcomes};
use super::task::Task;
use super::{Args, Watch, evaluate, handed, log, orders, page, start};
use crate::atomic_file::AtomicFile;
use crate::cli::deadline::Deadline;
use crate::cli::made::{made, program, quoted};
use crate::cli::overwrite::{self, OutputKind};
use crate::cli::progress::Spinner;
use crate::cli::{Failure, Outcome, excitation, interrupt, terminal};
use crate::cosim::description::InstanceDescription;
use crate::estimation::beforehand::beforehand;
use crate::estimation::file::{Mesh, Options};
use crate::estimation::fit::alone::alone;
use crate::estimation::left_over::processes;
use crate::estimation::validation::{Judged, validated};
use crate::estimation::{Diagnostic, Fit, Posed, fit_delays, refits};
use crate::flights;
use crate::sqp::Status;
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Fits a problem.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    args.check_alone()?;
    let clock = Instant::now();
    let task = Task::of(args)?;
    let mut reading = clock.elapsed().as_secs_f64();
    let mut file = task.file.clone();
    args.override_options(&mut file.options)?;
    let deadline = Deadline::after(args.time_limit);
    let mut chosen = None;
    let mut known = None;
    if let Some(orders) = &args.orders {
        interrupt::listen("stopping")?;
        let found = orders.chosen(&file, deadline)?;
        orders::print_choice(args, &found)?;
        match found.taken {
            Some(taken) => (file, known) = (taken.0, Some(taken.1)),
            None => return args.without_order(&found.json),
        }
        chosen = Some((found.json, found.is_whole));
    }
    // Flights have been posed with all of θ.
    let is_theta = |given: &[Begin]| task.flights.is_some() && start::is_unnamed(given);
    if let Some(given) = args.start.as_ref().filter(|given| !is_theta(given)) {
        let mut begun = file.clone();
        start::set(given, &Posed::new(&file, &flights::open)?, &mut begun)?;
        file = begun;
    }
    let clock = Instant::now();
    let posed = {
        let _shown = Spinner::new("reading the runs");
        Posed::new(&file, &flights::open).map_err(|error| match &args.start {
            Some(_) => Failure::from(error).hint("--start has other values than the file"),
            None => error.into(),
        })?
    };
    reading += clock.elapsed().as_secs_f64();
    // Those of flights are among the notes on them.
    let read = summary::notes(&posed).into_iter();
    let read = read.filter(|_| task.flights.is_none());
    (posed.words_of_left_out().into_iter().chain(read)).for_each(|words| terminal::note(&words));
    let solves_again = args.refits.flag().or(args.checks.flag());
    if let (true, Some(flag)) = (args.evaluate, solves_again) {
        let message = format!("{flag} solves again, and --evaluate solves nothing");
        return Err(Failure::new(message).hint("leave one of them out"));
    }
    let written = [
        ("--report", args.report.is_some()),
        ("--output", args.output.is_some()),
        ("--log", args.log.is_some()),
    ];
    if let (true, Some((flag, _))) = (
        args.evaluate,
        written.iter().find(|(_, is_given)| *is_given),
    ) {
        let message = format!("{flag} writes a fit, and --evaluate makes none");
        return Err(Failure::new(message).hint("leave one of them out"));
    }
    if args.evaluate {
        return evaluate::run(&posed, args.json);
    }
    let plan = args
        .refits
        .plan(&refits::sought(&posed), posed.runs.len())?;
    args.checks.check(posed.runs.len())?;
    let output = args.output.as_deref().or(task.default_output());
    let fitted = models::planned(&posed, output)?;
    check_outputs(args, &task, &fitted)?;
    models::make_folder(output, &fitted)?;
    // What cannot be written is told before the fit. A pipe is opened once.
    let written = fitted.iter().map(|own| own.path.as_path());
    for path in written.chain(args.report.as_deref()) {
        if !path.exists() || path.is_file() || path.is_dir() {
            AtomicFile::create(path).map_err(|error| Failure::cannot_write(path, &error))?;
        }
    }
    if args.orders.is_none() {
        interrupt::listen("stopping")?;
    }
    let clock = Instant::now();
    let before = {
        let _shown = Spinner::new("looking at the runs");
        beforehand(&posed, &|| deadline.ask().is_break())
    };
    let is_shown = !args.json && !args.logs_to_stdout();
    if let Some(own) = before.excitation.as_ref().filter(|_| is_shown) {
        args.print(&excitation::first_lines(own))?;
    }
    (before.words().iter()).for_each(|words| terminal::note(words));
    let looking = clock.elapsed().as_secs_f64();
    let log = args.log.as_deref().map(Log::open).transpose()?;
    let (raised, mut fit, log) = match known {
        Some(known) => (None, known, log),
        None => solved(&posed, Watch::new(deadline, log, args.verbose)),
    };
    let posed = raised.as_ref().unwrap_or(&posed);
    // Other fits have its order of delays.
    let open = |own: &InstanceDescription| match posed.delaying(own) {
        Some(part) => Ok(part),
        None => flights::open(own),
    };
    fit.seconds.reading += reading;
    fit.seconds.diagnostics += looking;
    let doubts = before.doubts(&fit);
    // It names what cannot be told apart, too.
    let tells = |own: &Diagnostic| matches!(own, Diagnostic::Unidentifiable(_));
    if doubts.iter().any(tells) {
        (fit.diagnostics).retain(|own| !matches!(own, Diagnostic::Undetermined { .. }));
    }
    fit.diagnostics.extend(doubts);
    task.doubt(&mut fit);
    // A user who stopped the fit still wants to see its validation.
    let asked = interrupt::flag();
    let was_asked = interrupt::is_asked();
    let goes_on = || match asked.load(Ordering::SeqCst) && !was_asked {
        true => ControlFlow::Break(Status::Interrupted),
        false => ControlFlow::Continue(()),
    };
    let judged = {
        let _shown = Spinner::new("validating");
        validated(&file, &fit, &open, &goes_on)?
    };
    let refitted = match &plan {
        Some(plan) => refitted(plan, posed, &fit, deadline)?,
        None => None,
    };
    let checked = args.checks.run((&file, &fit), &open, deadline)?;
    let alone = alone(posed, &fit, &|| deadline.ask().is_break());
    let outcome = Outcomes {
        posed,
        fit: &fit,
        judged: &judged,
        refitted: refitted.as_ref(),
        before: Some(&before),
        processes: processes(posed, &fit),
        checked: Some(&checked),
        alone: alone.as_deref(),
    };
    for own in &fitted {
        own.write(posed, &fit)?;
    }
    handed::over(&outcome);
    if let Some(path) = &args.report {
        overwrite::save(path, page::page(&outcome, Vec::new(), &made()))?;
    }
    let (orders, is_compared) = chosen.unzip();
    args.print(&match args.json {
        true => format!("{:#}\n", with_orders(summary::to_json(&outcome), orders)),
        false => {
            summary::to_text(&outcome) + &next(args, &fit, &fitted, file.options.max_iterations)
        }
    })?;
    if let Some(log) = log {
        log.close(&summary::to_json(&outcome))?;
    }
    let is_whole = refitted.as_ref().is_none_or(Refitted::is_whole) && checked.is_whole;
    let is_cut = |own: &Diagnostic| matches!(own, Diagnostic::Cut { .. });
    let is_whole = is_whole && is_compared.unwrap_or(true) && !fit.diagnostics.iter().any(is_cut);
    let outcome = match fit.is_answer() && is_whole {
        true => Outcome::Done,
        false => Outcome::No,
    };
    // FMUs are freed after this: a failure there does not affect the written results.
    pilotage_process::finished(outcome.code());
    Ok(outcome)
}

/// Adds the comparison of orders to the JSON object.
fn with_orders(mut object: Value, orders: Option<Value>) -> Value {
    if let Some(orders) = orders {
        object["orders"] = orders;
    }
    object
}

/// Runs the refits of a fit; `None` if it cannot be refitted.
fn refitted(
    plan: &Plan,
    posed: &Posed<'_>,
    fit: &Fit,
    deadline: Deadline,
) -> Result<Option<Refitted>, Failure> {
    match refits::study(posed, fit) {
        Ok(study) => Ok(Some(plan.run(&study, deadline)?)),
        Err(_) => {
            terminal::note(NOTHING);
            Ok(None)
        }
    }
}

/// Fits a problem and returns its page, and whether the fit has an answer.
pub fn page_of(path: &Path) -> Result<(String, bool), Failure> {
    let file = Task::of_file(path)?.file;
    let posed = Posed::new(&file, &flights::open)?;
    let (raised, fit) = fit_delays(&posed, &mut |_| ControlFlow::Continue(()));
    let posed = raised.as_ref().unwrap_or(&posed);
    let open = |own: &InstanceDescription| match posed.delaying(own) {
        Some(part) => Ok(part),
        None => flights::open(own),
    };
    let judged = validated(&file, &fit, &open, &|| ControlFlow::Continue(()))?;
    let alone = alone(posed, &fit, &|| false);
    let outcome = Outcomes {
        alone: alone.as_deref(),
        ..outcomes((posed, &fit), &judged)
    };
    if !fit.is_answer() {
        terminal::note(&format!("{}: {}", path.display(), fit.verdict()));
    }
    Ok((page::page(&outcome, Vec::new(), &made()), fit.is_answer()))
}

/// A fit with its validation runs, without what takes more than it.
pub fn outcomes<'a>((posed, fit): (&'a Posed<'a>, &'a Fit), judged: &'a [Judged]) -> Outcomes<'a> {
    Outcomes {
        posed,
        fit,
        judged,
        refitted: None,
        before: None,
        processes: processes(posed, fit),
        checked: None,
        alone: None,
    }
}

fn check_outputs(args: &Args, task: &Task, fitted: &[Fitted]) -> Result<(), Failure> {
    let mut outputs: Vec<(&Path, OutputKind)> = Vec::new();
    outputs.extend(
        fitted
            .iter()
            .map(|own| (own.path.as_path(), OutputKind::Fitted)),
    );
    outputs.extend(args.report.as_deref().map(|path| (path, OutputKind::Page)));
    let log = args.log.as_deref().filter(|log| !log::is_stdout(log));
    outputs.extend(log.map(|path| (path, OutputKind::Log)));
    outputs.extend(args.refits.output());
    args.overwrite.check(&task.inputs, &outputs)
}

/// Computes the fit with progress output, log, time limit and Ctrl-C, and the problem with another order of its delays if it needs one.
pub fn solved<'f>(posed: &Posed<'f>, mut watch: Watch) -> (Option<Posed<'f>>, Fit, Option<Log>) {
    let (raised, fit) = fit_delays(posed, &mut |progress| watch.see(progress, posed.factor));
    (raised, fit, watch.end())
}

impl Args {
    /// Options that take precedence over those of the file.
    pub(super) fn override_options(&self, own: &mut Options) -> Result<(), Failure> {
        let within = |flag: &str, value: usize, most: usize| match (1..=most).contains(&value) {
            true => Ok(value),
            false => Err(Failure::new(format!("{flag} is out of range"))
                .hint(format!("at most {most} in all"))),
        };
        if let Some(limit) = self.max_iterations {
            own.max_iterations = within("--max-iterations", limit, Options::MOST_ITERATIONS)?;
        }
        if let Some(random) = self.random_starts {
            let starts = random.saturating_add(1);
            own.starts = Some(within("--random-starts", starts, Options::MOST_STARTS)?);
        }
        own.tolerance = self.tolerance.unwrap_or(own.tolerance);
        own.scheme = self.scheme.or(own.scheme);
        own.mesh = self.mesh_step.map_or(own.mesh, Mesh::Step);
        own.covariance = self.covariance.or(own.covariance);
        own.limits = self.limits.unwrap_or(own.limits);
        Ok(())
    }
}

/// Written files and the suggested next command.
fn next(args: &Args, fit: &Fit, fitted: &[Fitted], limit: usize) -> String {
    let mut text = String::from("\n");
    for own in fitted {
        text += &format!("wrote {}\n", terminal::shown(&own.path));
    }
    if let Some(report) = &args.report {
        text += &format!("wrote {}\n", terminal::shown(report));
    }
    if let (true, Some(own)) = (fit.is_answer(), fitted.first()) {
        let model = quoted(&own.path.to_string_lossy());
        let fmu = own.path.with_extension("fmu");
        let fmu = quoted(&fmu.to_string_lossy());
        text += &match own.is_fmu {
            true => format!("next: {} cosim {model} --step 0.01\n", program()),
            false => format!("next: {} export {model} -o {fmu}\n", program()),
        };
    }
    let is_meaningless = fit.diagnostics.iter().any(Diagnostic::is_fatal);
    if !fit.is_answer() && is_meaningless {
        text += "next: mend what the first diagnostic says, and fit again\n";
    } else if !fit.is_answer() {
        let end = fit.cut.unwrap_or(match fit.refinement.is_limited {
            true => Status::IterationLimit,
            false => fit.status,
        });
        text += &what_else(args, end, &values(fit), limit);
    }
    text
}

/// Suggestions for a solve that did not converge, with the values of `--start` at which it ended and its iteration limit.
fn what_else(args: &Args, end: Status, start: &str, limit: usize) -> String {
    let mut text = String::from("next: this is the best iterate, not a result; try\n");
    let ended_by = |status: Status| end == status;
    let was_cut_short = [
        Status::IterationLimit,
        Status::TimeLimit,
        Status::Interrupted,
    ]
    .into_iter()
    .any(ended_by);
    text += &match was_cut_short && !start.is_empty() {
        true => format!("      --start {start}, to go on from here\n"),
        false => "      --random-starts 20, or --start with other values\n".into(),
    };
    if let (true, Some(limit)) = (ended_by(Status::TimeLimit), args.time_limit) {
        text += &format!("      --time-limit above {limit}\n");
    }
    if ended_by(Status::IterationLimit) {
        text += &format!("      --max-iterations above {limit}\n");
    }
    text
}

/// The estimates as values of `--start`; a parameter with a value for each run begins at their mean.
fn values(fit: &Fit) -> String {
    let sought = fit
        .parameters
        .iter()
        .filter(|own| !own.is_tied && !own.name.ends_with(')'));
    let values = sought.map(|own| quoted(&format!("{}={}", own.name, own.mean())));
    values.collect::<Vec<_>>().join(",")
}
