//! `pilotage fit problem.toml`: fits any pilot, vehicle and task.

mod checks;
mod evaluate;
mod kept;
mod models;
mod page;
mod summary;
mod sure;

use super::refits::{NOTHING, Plan, Refitted};
use super::{Args, orders};
use crate::cli::deadline::Deadline;
use crate::cli::made::made;
use crate::cli::overwrite::{self, OutputKind};
use crate::cli::progress::Spinner;
use crate::cli::{Failure, Outcome, excitation, interrupt, recognise, terminal};
use crate::estimation::beforehand::beforehand;
use crate::estimation::fit::Progress;
use crate::estimation::left_over::processes;
use crate::estimation::validation::validated;
use crate::estimation::{Diagnostic, Fit, Posed, ProblemFile, refits};
use crate::flights;
use crate::sqp::{Iteration, Status};
pub use checks::Checks;
use models::Fitted;
pub use models::HEAD as FITTED;
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::Path;

/// The problem file among the arguments, if there is one.
pub fn of(args: &Args) -> Result<Option<&Path>, Failure> {
    let Some(problem) = args.trials.iter().find(|path| recognise::is_problem(path)) else {
        return Ok(None);
    };
    if args.trials.len() > 1 {
        let message = format!(
            "{} is a problem file, which names its runs itself",
            problem.display()
        );
        return Err(Failure::new(message).hint("give the problem file alone"));
    }
    if let Some(flag) = args.of_flights {
        let message = format!("{flag} belongs to `pilotage fit run*.csv`");
        return Err(Failure::new(message).hint("put it in the problem file; see docs/problems.md"));
    }
    Ok(Some(problem))
}

/// Fits a problem.
pub fn run(args: &Args, path: &Path) -> Result<Outcome, Failure> {
    let mut file = ProblemFile::read(path)?;
    file.options.covariance = args.covariance.or(file.options.covariance);
    let deadline = Deadline::after(args.time_limit);
    let mut chosen = None;
    let mut known = None;
    if let Some(orders) = &args.orders {
        interrupt::listen("stopping")?;
        let found = orders.problem(&file, deadline)?;
        orders::print_choice(args, &found)?;
        match found.taken {
            Some(taken) => (file, known) = (taken.0, Some(taken.1)),
            None => return args.without_order(&found.json),
        }
        chosen = Some((found.json, found.is_whole));
    }
    let posed = Posed::new(&file, &flights::open)?;
    (posed.words_of_left_out().iter()).for_each(|words| terminal::note(words));
    let solves_again = args.refits.flag().or(args.checks.flag());
    if let (true, Some(flag)) = (args.evaluate, solves_again) {
        let message = format!("{flag} solves again, and --evaluate solves nothing");
        return Err(Failure::new(message).hint("leave one of them out"));
    }
    let written = [
        ("--report", args.report.is_some()),
        ("--output", args.output.is_some()),
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
    let fitted = models::planned(&posed, args.output.as_deref())?;
    check_outputs(args, path, &fitted)?;
    models::make_folder(args.output.as_deref(), &fitted)?;
    if args.orders.is_none() {
        interrupt::listen("stopping")?;
    }
    let before = beforehand(&posed, &|| deadline.ask().is_break());
    if let Some(own) = before.excitation.as_ref().filter(|_| !args.json) {
        terminal::print(&excitation::first_lines(own))?;
    }
    (before.words().iter()).for_each(|words| terminal::note(words));
    let mut fit = known.unwrap_or_else(|| solved(args, &posed, deadline));
    let doubts = before.doubts(&fit);
    // It names what cannot be told apart, too.
    let tells = |own: &Diagnostic| matches!(own, Diagnostic::Unidentifiable(_));
    if doubts.iter().any(tells) {
        (fit.diagnostics).retain(|own| !matches!(own, Diagnostic::Undetermined(_)));
    }
    fit.diagnostics.extend(doubts);
    // A user who stopped the fit still wants to see its validation.
    let was_asked = interrupt::is_asked();
    let goes_on = || match interrupt::is_asked() && !was_asked {
        true => ControlFlow::Break(Status::Interrupted),
        false => ControlFlow::Continue(()),
    };
    let judged = validated(&file, &fit, &flights::open, &goes_on)?;
    let refitted = match &plan {
        Some(plan) => refitted(plan, &posed, &fit, deadline)?,
        None => None,
    };
    let checked = args.checks.run((&file, &fit), deadline)?;
    let outcome = summary::Outcomes {
        posed: &posed,
        fit: &fit,
        judged: &judged,
        refitted: refitted.as_ref(),
        before: Some(&before),
        processes: &processes(&posed, &fit),
        checked: &checked,
    };
    for own in &fitted {
        own.write(&posed, &fit, path)?;
    }
    if let Some(path) = &args.report {
        overwrite::save(path, page::page(&outcome, &made()))?;
    }
    let (orders, is_compared) = chosen.unzip();
    terminal::print(&match args.json {
        true => format!("{:#}\n", with_orders(summary::to_json(&outcome), orders)),
        false => summary::to_text(&outcome) + &next(args, &fit, &fitted),
    })?;
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
    let file = ProblemFile::read(path)?;
    let posed = Posed::new(&file, &flights::open)?;
    let fit = crate::estimation::fit(&posed, &mut |_| ControlFlow::Continue(()));
    let judged = validated(&file, &fit, &flights::open, &|| ControlFlow::Continue(()))?;
    let outcome = summary::Outcomes {
        posed: &posed,
        fit: &fit,
        judged: &judged,
        refitted: None,
        before: None,
        processes: &processes(&posed, &fit),
        checked: &checks::Checked::default(),
    };
    if !fit.is_answer() {
        terminal::note(&format!("{}: {}", path.display(), fit.verdict()));
    }
    Ok((page::page(&outcome, &made()), fit.is_answer()))
}

fn check_outputs(args: &Args, path: &Path, fitted: &[Fitted]) -> Result<(), Failure> {
    let mut outputs: Vec<(&Path, OutputKind)> = Vec::new();
    outputs.extend(
        fitted
            .iter()
            .map(|own| (own.path.as_path(), OutputKind::Fitted)),
    );
    outputs.extend(args.report.as_deref().map(|path| (path, OutputKind::Page)));
    outputs.extend(args.refits.output());
    args.overwrite.check(&[path.to_owned()], &outputs)
}

/// Computes the fit with progress output, time limit and Ctrl-C.
fn solved(args: &Args, posed: &Posed<'_>, deadline: Deadline) -> Fit {
    let mut spinner = Spinner::new();
    let fit = crate::estimation::fit(posed, &mut |progress| {
        if let Some(iteration) = progress.iteration {
            let line = line(posed, progress, iteration);
            match args.verbose {
                true => terminal::eprint(&line),
                false => spinner.show(line.trim_end().to_owned()),
            }
        }
        deadline.ask()
    });
    spinner.clear();
    fit
}

/// One line per iteration.
fn line(posed: &Posed<'_>, progress: &Progress<'_>, iteration: &Iteration) -> String {
    let of = match progress.refinement {
        0 => format!("start {} of {}", progress.start + 1, progress.starts),
        round => format!("refinement {round}"),
    };
    format!(
        "{of}, iteration {:3}: objective {:.9e}, KKT residual {:.1e}, step {:.1e}\n",
        iteration.number,
        iteration.objective / posed.factor,
        iteration.kkt.residual(),
        iteration.step
    )
}

/// Written files and the suggested next command.
fn next(args: &Args, fit: &Fit, fitted: &[Fitted]) -> String {
    use crate::cli::made::{program, quoted};
    let mut text = String::from("\n");
    for own in fitted {
        text += &format!("wrote {}\n", own.path.display());
    }
    if let Some(report) = &args.report {
        text += &format!("wrote {}\n", report.display());
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
    text
}
