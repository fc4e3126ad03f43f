//! `pilotage trials`: checks recorded flights, or generates synthetic ones.

mod flown;
mod synth;

use super::recognise::{self, FileKind};
use super::system::flags::pair;
use super::{Failure, Outcome, excitation, terminal};
use crate::estimation::result::recordings::before;
use crate::estimation::{Diagnostic, Posed};
use crate::flights::trials::{ColumnNames, SATURATED, Summary, TrialError, TrialSet, driven};
use crate::flights::{self, FlightOptions};
use crate::inference::spectrum::Excitation;
use crate::series::SeriesError;
use clap::Subcommand;
use pilotage_text::number::{short, significant};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `pilotage trials`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Check trial files and show each in a few numbers.
    Check {
        /// Recorded flights (CSV) or manifests of flights (TOML).
        #[arg(required = true)]
        trials: Vec<PathBuf>,
        #[command(flatten)]
        columns: Columns,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Generate flights of a synthetic human: one CSV file per run, and a manifest.
    Synth(Box<synth::Synth>),
}

/// Which columns of the files are what.
#[derive(Debug, clap::Args)]
pub struct Columns {
    /// Read `time`, `target`, `position` or `stick` from a column with another name; may be repeated.
    #[arg(long = "column", value_name = "WHAT=NAME", value_parser = pair)]
    named: Vec<(String, String)>,
}

impl Columns {
    /// The names of the columns.
    pub fn names(&self) -> Result<ColumnNames, Failure> {
        Ok(ColumnNames::new(&self.named)?)
    }

    /// Reads trials and manifests.
    pub fn read(&self, paths: &[PathBuf]) -> Result<TrialSet, Failure> {
        let what = "recorded flights (CSV) or lists of them (TOML)";
        recognise::expect(
            paths,
            &[FileKind::Trial, FileKind::Table, FileKind::Manifest],
            what,
        )?;
        let read = TrialSet::read_with(paths, &self.names()?);
        read.map_err(|error| {
            let quantity = match &error {
                TrialError::NoColumn { column, .. } => column.clone(),
                TrialError::Series(SeriesError::NoTime { expected, .. }) => expected.clone(),
                _ => return Failure::from(error),
            };
            // No hint if the missing name was given by the user.
            let is_given = self.named.iter().any(|(_, name)| *name == quantity);
            let failure = Failure::from(error);
            match is_given {
                true => failure,
                false => failure.hint(format!("--column {quantity}=NAME says which column it is")),
            }
        })
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    match args.command {
        Command::Check {
            trials,
            columns,
            json,
        } => check(&columns.read(&trials)?, json),
        Command::Synth(synth) => synth.run(),
    }
}

fn check(set: &TrialSet, json: bool) -> Result<Outcome, Failure> {
    match json {
        true => terminal::print(&format!("{:#}\n", to_json(set, &checks(set)?)))?,
        false => terminal::print(&to_table(set, &checks(set)?))?,
    }
    Ok(Outcome::Done)
}

/// Each trial with its summary and usage.
fn uses(set: &TrialSet) -> Vec<(&crate::flights::Trial, Summary, &'static str)> {
    let fit = set.fit.iter().map(|trial| (trial, "fit"));
    let validation = set.validation.iter().map(|trial| (trial, "validation"));
    (fit.chain(validation))
        .map(|(trial, used)| (trial, trial.summary(), used))
        .collect()
}

fn to_json(set: &TrialSet, doubts: &[Diagnostic]) -> Value {
    let trials: Vec<Value> = (uses(set).iter())
        .map(|(trial, summary, used)| {
            json!({
                "name": trial.name,
                "file": trial.origin,
                "sha256": trial.sha256,
                "use": used,
                "weight": trial.weight,
                "samples": summary.samples,
                "missing": summary.missing,
                "duration_s": summary.duration,
                "rate_per_s": summary.rate,
                "largest_gap": summary.largest_gap,
                "target_m": summary.target,
                "target_range_m": summary.target_range,
                "final_error_m": summary.final_error,
                "rms_error_m": summary.rms_error,
                "overshoot": summary.overshoot,
                "peak_stick": summary.peak_stick,
                "stick_at_stop": summary.stick_at_stop,
            })
        })
        .collect();
    let doubts: Vec<Value> = (doubts.iter())
        .map(|own| json!({ "code": own.code(), "words": own.to_string(), "fatal": own.is_fatal() }))
        .collect();
    let excitation = excited(set);
    json!({
        "trials": trials,
        "notes": set.notes,
        "doubts": doubts,
        "excitation": excitation::to_json(excitation.as_ref()),
    })
}

fn to_table(set: &TrialSet, doubts: &[Diagnostic]) -> String {
    let uses = uses(set);
    let width =
        |cells: &mut dyn Iterator<Item = usize>, least: usize| cells.fold(least, usize::max);
    let names = &mut uses.iter().map(|(trial, ..)| trial.name.chars().count());
    let names = width(names, 5);
    let targets = width(&mut uses.iter().map(|(_, run, _)| target_of(run).len()), 6);
    let mut text = format!(
        "{:<names$}  use         weight  samples  missing     rate  {:>targets$}  rms error  final error  overshoot  peak stick\n\
         {:<names$}                                         [1/s]  {:>targets$}        [m]          [m]        [%]         [1]\n",
        "trial", "target", "", "[m]"
    );
    let or_none = |number: Option<String>| number.unwrap_or_else(|| "-".into());
    for (trial, summary, used) in &uses {
        text += &format!(
            "{:<names$}  {used:<10}  {:>6}  {:>7}  {:>7}  {:>7}  {:>targets$}  {:>9.3}  {:>11.3}  {:>9}  {:>10}\n",
            trial.name,
            short(trial.weight, 4),
            summary.samples,
            summary.missing,
            significant(summary.rate, 4),
            target_of(summary),
            summary.rms_error,
            summary.final_error,
            or_none(summary.overshoot.map(|part| format!("{:.1}", 100.0 * part))),
            or_none(summary.peak_stick.map(|peak| format!("{peak:.3}"))),
        );
    }
    for note in &set.notes {
        text += &terminal::labelled("note", note);
    }
    for (trial, summary, _) in uses
        .iter()
        .filter(|(_, summary, _)| summary.largest_gap > 1.9)
    {
        text += &format!(
            "note: {}: the longest time step is {:.1} times the usual one; is a stretch of the recording lost?\n",
            trial.name, summary.largest_gap
        );
    }
    for (trial, summary, _) in &uses {
        if let Some(part) = summary.stick_at_stop.filter(|part| *part >= SATURATED) {
            text += &format!(
                "note: {}: {:.0} % of the stick's samples are at its stops, where it says little about the human; ease the task\n",
                trial.name,
                100.0 * part
            );
        }
    }
    for check in doubts {
        let label = format!("diagnostic ({})", check.code());
        text += &terminal::labelled(&label, &check.to_string());
    }
    text + &excited(set).map_or(String::new(), |own| excitation::to_text(&own))
}

/// The target of a run \[m\], or its range if it moves.
fn target_of(summary: &Summary) -> String {
    let [least, greatest] = summary.target_range.map(|target| short(target, 4));
    match summary.target_range[0] == summary.target_range[1] {
        true => least,
        false => format!("{least} to {greatest}"),
    }
}

/// What the recordings of the fit, and those of its validation, let doubt before any fit.
fn checks(set: &TrialSet) -> Result<Vec<Diagnostic>, Failure> {
    let mut found = Vec::new();
    for trials in [&set.fit, &set.validation] {
        if !trials.is_empty() {
            let alone = TrialSet {
                fit: trials.clone(),
                validation: Vec::new(),
                ..set.clone()
            };
            let file = FlightOptions::default().problem(&alone)?;
            found.extend(before(&Posed::new(&file, &flights::open)?));
        }
    }
    Ok(found)
}

/// The excitation by the trials of the fit.
fn excited(set: &TrialSet) -> Option<Excitation> {
    Excitation::of(&driven(&set.fit))
}
