//! `pilotage compare`: selects one of several problems on the same data.

use super::folds::Folds;
use super::format::aligned;
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, interrupt, terminal};
use crate::cli::deadline::Deadline;
use crate::estimation::ProblemFile;
use crate::estimation::comparison::{Candidate, Compared, compare};
use crate::flights;
use crate::inference::choice::{Comparison, Contender, FEWEST_RUNS, SIZE};
use crate::inference::residuals::{LjungBox, autocorrelation};
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  # Does the pilot have a delay? Two problem files that differ in the pilot only.
  pilotage compare without_delay.toml with_delay.toml

  # For scripts: unknowns, AICc, BIC, the prediction of each left-out run, and the selected problem.
  pilotage compare order1.toml order2.toml order3.toml --json

Each problem is fitted to all runs, and once without each run, which is then predicted. A free initial state
of a left-out run is estimated from it with the parameters held, and adds 2 to its −2 log likelihood.
Selected is the problem with the fewest unknowns that no larger one surpasses in the prediction of left-out
runs (Student's test over runs, 5 % for all comparisons together). AICc and BIC are reported too; they
assume white residuals.
Exit codes: 0 done, 1 a problem has no solution, the comparison was stopped, or there are fewer than three
runs, 2 bad use or input.";

/// Arguments of `pilotage compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Problem files with the same runs and measured columns (docs/problems.md).
    #[arg(value_name = "PROBLEM", num_args = 2.., required = true)]
    problems: Vec<PathBuf>,
    /// Stop after this time [s].
    #[arg(long, value_name = "SECONDS", value_parser = super::number::positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    recognise::expect(&args.problems, &[FileKind::Problem], "problem files")?;
    let files = args.problems.iter().map(|path| ProblemFile::read(path));
    let files: Vec<ProblemFile> = files.collect::<Result<_, _>>()?;
    interrupt::listen("stopping")?;
    let folds = Folds::until(Deadline::after(args.time_limit));
    let compared = compare(&files, &flights::open, &|done, all| folds.ask(done, all))?;
    let is_whole = folds.end_with_note();
    let names: Vec<&str> = files.iter().map(|file| file.file.as_str()).collect();
    terminal::print(&match args.json {
        true => format!("{:#}\n", to_json(&names, &compared)),
        false => to_text(&names, &compared),
    })?;
    Ok(match compared.choice {
        Some(_) if is_whole => Outcome::Done,
        _ => Outcome::No,
    })
}

/// A row of the table.
struct Line<'a> {
    /// Name of the problem.
    name: &'a str,
    /// Status of its fit.
    status: &'a str,
    /// Whether its fit has an answer.
    is_answer: bool,
    /// The figures.
    figures: &'a Contender,
}

/// The figures of all problems as an aligned table.
fn table(what: &str, lines: &[Line<'_>]) -> String {
    let mut rows = vec![[what, "status", "unknowns", "AICc", "BIC", "left out"].map(str::to_owned)];
    rows.extend(lines.iter().map(|own| {
        let cell = |figure: f64| match own.is_answer && figure.is_finite() {
            true => significant(figure, 7),
            false => "–".to_owned(),
        };
        [
            own.name.to_owned(),
            own.status.to_owned(),
            own.figures.unknowns.to_string(),
            cell(own.figures.aicc()),
            cell(own.figures.bic()),
            cell(own.figures.held_out.iter().sum()),
        ]
    }));
    aligned(&rows)
}

fn lines<'a>(names: &[&'a str], compared: &'a Compared) -> Vec<Line<'a>> {
    let all = names.iter().zip(&compared.candidates);
    let line = |(name, own): (&&'a str, &'a Candidate)| Line {
        name,
        status: own.fit.ending(),
        is_answer: own.fit.is_answer(),
        figures: &own.figures,
    };
    all.map(line).collect()
}

/// The comparison as text for people.
pub fn to_text(names: &[&str], compared: &Compared) -> String {
    let names: Vec<String> = names.iter().map(|name| terminal::line(name)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let names = names.as_slice();
    let all = &compared.candidates;
    let mut text = format!(
        "{} on {}, {} values. Left out: −2 log likelihood of the runs by fits to the others{}.\n\n",
        counted(names.len(), "problem"),
        counted(compared.runs.len(), "run"),
        all[0].figures.samples,
        match all.iter().any(|own| own.is_begun) {
            true => ", and 2 for each initial state that is estimated from them",
            false => "",
        }
    );
    text += &table("problem", &lines(names, compared));
    text += "\n";
    for (name, own) in names.iter().zip(all) {
        let missing = compared.runs.iter().zip(&own.figures.held_out);
        let missing = missing.filter(|(_, surprise)| !surprise.is_finite());
        for (run, _) in missing {
            text += &format!("{name}: no fit without {run} predicts it\n");
        }
        let doubts = own.fit.diagnostics.iter();
        doubts.for_each(|doubt| text += &terminal::labelled(name, &doubt.to_string()));
    }
    match &compared.choice {
        None => text + &refusal(names, compared),
        Some(choice) => {
            let figures: Vec<&Contender> = all.iter().map(|own| &own.figures).collect();
            text + &words(names, &figures, choice, colour(&all[choice.0]))
                + &unscaled(&all[choice.0]).unwrap_or_default()
        }
    }
}

fn refusal(names: &[&str], compared: &Compared) -> String {
    let all = names.iter().zip(&compared.candidates);
    let open: Vec<&str> = all
        .filter(|(_, own)| !own.fit.is_answer())
        .map(|(name, _)| *name)
        .collect();
    match open.is_empty() {
        true => format!("{}\n", few()),
        false => format!(
            "none is taken: without an answer: {}; see `pilotage fit`\n",
            open.join(", ")
        ),
    }
}

/// Reason why no problem is selected although all have answers.
fn few() -> String {
    format!(
        "none is taken: each predicts fewer than {FEWEST_RUNS} runs that are left out; record more, or cut runs in parts"
    )
}

/// One comparison as a sentence.
fn sentence(names: &[&str], own: &Comparison) -> String {
    let (before, after) = (names[own.before], names[own.after]);
    if own.gain.is_nan() {
        return format!("{after} does not predict the runs that {before} predicts\n");
    }
    let gain = significant(own.gain, 3);
    let p = significant(own.p, 2);
    match own.is_taken {
        true => format!("{after} predicts runs better than {before}: by {gain} a run, p = {p}\n"),
        false => format!(
            "{after} predicts runs no better than {before}: a gain of {gain} a run, p = {p}\n"
        ),
    }
}

/// Each comparison, the selected problem, and the choices of the information criteria where they differ; with the
/// largest correlation of neighbouring residuals if they are not white.
fn words(
    names: &[&str],
    figures: &[&Contender],
    (taken, comparisons): &(usize, Vec<Comparison>),
    colour: Option<f64>,
) -> String {
    let best = |of: fn(&Contender) -> f64| {
        let figures = figures.iter().map(|own| of(own)).enumerate();
        figures
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(k, _)| k)
    };
    let (aicc, bic) = (best(Contender::aicc), best(Contender::bic));
    let mut text: String = comparisons.iter().map(|own| sentence(names, own)).collect();
    let why = match names.len() {
        1 => "which is compared with no other".to_owned(),
        _ => format!(
            "the smallest that no larger one predicts better (at {} % for all comparisons)",
            100.0 * SIZE
        ),
    };
    text += &format!("\ntaken: {}, {why}\n", names[*taken]);
    let others: Vec<String> = [("AICc", aicc), ("BIC", bic)]
        .into_iter()
        .filter(|(_, k)| k != taken)
        .map(|(criterion, k)| format!("{criterion} takes {}", names[k]))
        .collect();
    if !others.is_empty() {
        text += &others.join(", ");
        text += &match colour {
            Some(correlation) => format!(
                "; it assumes white residuals, but neighbouring ones have a correlation of {}\n",
                significant(correlation, 2)
            ),
            None => "; it predicts left-out runs no better\n".to_owned(),
        };
    }
    text
}

/// A warning if the magnitude of the residuals differs from their standard deviations, by which all figures weight
/// them.
fn unscaled(own: &Candidate) -> Option<String> {
    const FACTOR: f64 = 2.0;
    let size = (own.fit.chi2 / own.figures.samples as f64).sqrt();
    let is_odd = size.is_finite() && !(1.0 / FACTOR..FACTOR).contains(&size);
    is_odd.then(|| {
        format!(
            "note: residuals are {} times `sd` of [[measured]] (1 if none is given) in the mean, by which AICc, BIC and the \
             prediction of left-out runs weight the data; state sd, or estimate it as a parameter\n",
            significant(size, 2)
        )
    })
}

fn colour(own: &Candidate) -> Option<f64> {
    let residuals = own.fit.runs.iter().flat_map(|run| {
        let signals = run.recorded.iter().zip(&run.predicted);
        signals.map(|(y, h)| y.iter().zip(h).map(|(y, h)| y - h).collect::<Vec<f64>>())
    });
    coloured(residuals)
}

/// The largest lag-1 autocorrelation over the runs with non-white residuals; `None` if all may be white.
fn coloured(residuals: impl Iterator<Item = Vec<f64>>) -> Option<f64> {
    let coloured = residuals.filter(|r| LjungBox::of(r).is_some_and(|test| test.p < COLOURED));
    let lags = coloured.filter_map(|r| autocorrelation(&r, 1).get(1).copied());
    lags.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// p-value below which residuals are not white.
const COLOURED: f64 = 0.01;

/// The comparison as JSON for scripts.
pub fn to_json(names: &[&str], compared: &Compared) -> Value {
    let all = lines(names, compared);
    let problem = |(line, own): (&Line<'_>, &Candidate)| {
        let runs = compared.runs.iter().zip(&line.figures.held_out);
        let held_out: Map<String, Value> = runs.map(|(run, s)| (run.clone(), json!(s))).collect();
        let mut object = figures_json(line, own.fit.is_answer());
        object["held_out"] = Value::Object(held_out);
        object["doubts"] = own.fit.diagnostics.iter().map(|own| own.code()).collect();
        object
    };
    json!({
        "problems": all.iter().zip(&compared.candidates).map(problem).collect::<Vec<_>>(),
        "comparisons": comparisons_json(names, compared.choice.as_ref()),
        "taken": compared.choice.as_ref().map(|(taken, _)| names[*taken]),
    })
}

/// The figures of one problem.
fn figures_json(own: &Line<'_>, is_answer: bool) -> Value {
    json!({
        "file": own.name,
        "status": own.status,
        "converged": is_answer,
        "unknowns": own.figures.unknowns,
        "samples": own.figures.samples,
        "nllh": 0.5 * own.figures.surprise,
        "aicc": own.figures.aicc(),
        "bic": own.figures.bic(),
    })
}

/// The comparisons that led to the selection.
fn comparisons_json(names: &[&str], choice: Option<&(usize, Vec<Comparison>)>) -> Value {
    let all = choice.into_iter().flat_map(|(_, all)| all);
    let comparisons = all.map(|own| {
        json!({
            "before": names[own.before],
            "after": names[own.after],
            "gain": own.gain,
            "p": own.p,
            "taken": own.is_taken,
        })
    });
    comparisons.collect()
}
