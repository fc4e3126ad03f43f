//! `--leave-one-out` and `--per-run`: fits of the same problem to some of its runs.

use super::summary;
use crate::cli::Failure;
use crate::cli::deadline::Deadline;
use crate::cli::folds::Folds;
use crate::cli::format::aligned;
use crate::estimation::file::Noise;
use crate::estimation::folds::{OpenInParallel, fitted, leave_one_out};
use crate::estimation::per_run::{Group, PerRun, per_run};
use crate::estimation::validation::Judged;
use crate::estimation::{Fit, ProblemFile};
use crate::inference::Interval;
use crate::inference::choice::SIZE;
use crate::inference::homogeneity::Homogeneity;
use crate::report::Parameters;
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};

/// Arguments of what fits a problem to some of its runs.
#[derive(Debug, clap::Args)]
pub struct Checks {
    /// Predict each run by a fit to the others.
    #[arg(long)]
    leave_one_out: bool,
    /// Fit each run, or the runs of each subject, alone, and test whether all have the same
    /// parameters.
    #[arg(long)]
    per_run: bool,
}

impl Checks {
    /// The first given flag that requires such fits.
    pub fn flag(&self) -> Option<&'static str> {
        let given = [
            ("--leave-one-out", self.leave_one_out),
            ("--per-run", self.per_run),
        ];
        given.into_iter().find(|own| own.1).map(|own| own.0)
    }

    /// Refuses these fits for fewer than two runs.
    pub fn check(&self, runs: usize) -> Result<(), Failure> {
        match self.flag().filter(|_| runs < 2) {
            Some(flag) => Err(Failure::new(format!(
                "{flag} requires at least two fitted runs, and there is {runs}"
            ))
            .hint("add [[run]]s, or leave it out")),
            None => Ok(()),
        }
    }

    /// Computes the requested fits; none if the fit to all runs has no answer.
    pub fn run(
        &self,
        (file, fit): (&ProblemFile, &Fit),
        open: OpenInParallel<'_>,
        deadline: Deadline,
    ) -> Result<Checked, Failure> {
        let folds = Folds::until(deadline);
        let ask = |done: usize, all: usize| folds.ask(done, all);
        let is_asked = |flag: bool| flag && fit.is_answer();
        let left_out = is_asked(self.leave_one_out)
            .then(|| leave_one_out((file, fit), open, &ask))
            .transpose()?;
        let per_run = is_asked(self.per_run)
            .then(|| per_run((file, fit), open, &ask))
            .transpose()?;
        let is_whole = folds.end_with_note();
        let names = fitted(file).into_iter().map(|k| file.runs[k].name.clone());
        Ok(Checked {
            is_whole,
            columns: (file.measured.iter().map(|own| own.column.value.clone())).collect(),
            left_out: left_out.map(|all| names.zip(all).collect()),
            noises: (file.measured.iter().map(|own| own.noise)).collect(),
            per_run,
        })
    }
}

/// Results of the fits to some of the runs.
#[derive(Default)]
pub struct Checked {
    /// Whether all fits came to their ends.
    pub is_whole: bool,
    /// The measured columns.
    columns: Vec<String>,
    /// Noise of the measured columns.
    noises: Vec<Noise>,
    /// Each run, predicted by a fit to the others.
    left_out: Option<Vec<(String, Option<Judged>)>>,
    /// Fits to each run or group of runs alone.
    per_run: Option<PerRun>,
}

impl Checked {
    /// Adds the results to the object of `--json`.
    pub fn add_to(&self, object: &mut Value) {
        if let Some(all) = &self.left_out {
            let runs = all
                .iter()
                .map(|(name, own)| self.left_out_json(name, own.as_ref()));
            object["leave_one_out"] = runs.collect();
        }
        if let Some(own) = &self.per_run {
            object["per_run"] = per_run_json(own);
        }
    }

    fn left_out_json(&self, name: &str, own: Option<&Judged>) -> Value {
        let known = own.filter(|own| own.is_answer);
        let measured = self.columns.iter().enumerate().map(|(k, column)| {
            let figures = known.and_then(|own| own.run.explained(k));
            let figures =
                json!({ "vaf": figures.map(|own| own.vaf), "fit": figures.map(|own| own.fit) });
            (column.clone(), figures)
        });
        let measured: Map<String, Value> = measured.collect();
        json!({
            "name": name,
            "converged": known.is_some(),
            "mean_of_subjects": own.map(|own| &own.averaged),
            "surprise": known.map(|own| own.surprise(&self.noises)),
            "measured": measured,
        })
    }

    /// The results as text for the terminal.
    pub fn to_text(&self, fit: &Fit) -> String {
        let mut text = String::new();
        if let Some(rows) = self.left_out_rows(fit) {
            text += &format!("\n{}{LEFT_OUT}\n", aligned(&rows));
            self.averaged().for_each(|note| text += &note);
        }
        if let Some(own) = &self.per_run {
            text += &format!("\n{}", aligned(&alone_rows(own, fit)));
            notes(own)
                .iter()
                .for_each(|note| text += &format!("{note}\n"));
        }
        text
    }

    /// The results as tables for the page.
    pub fn tables(&self, fit: &Fit) -> Vec<(&'static str, Parameters)> {
        let left_out = self.left_out_rows(fit).map(|rows| {
            let table = Parameters {
                header: LEFT_OUT_HEADER.to_vec(),
                numeric: vec![2, 3, 4, 5],
                rows: rows.into_iter().skip(1).map(Vec::from).collect(),
                notes: std::iter::once(LEFT_OUT.to_owned())
                    .chain(self.averaged())
                    .collect(),
            };
            ("Left out", table)
        });
        let alone = self.per_run.as_ref().map(|own| {
            let table = Parameters {
                header: ALONE_HEADER.to_vec(),
                numeric: vec![2, 3, 4, 5],
                rows: (alone_rows(own, fit).into_iter().skip(1).map(Vec::from)).collect(),
                notes: notes(own),
            };
            ("Fitted alone", table)
        });
        left_out.into_iter().chain(alone).collect()
    }

    /// Notes about left-out runs whose subject has no other run.
    fn averaged(&self) -> impl Iterator<Item = String> {
        let all = self.left_out.iter().flatten();
        all.filter_map(|(_, own)| summary::averaged(own.as_ref()?))
    }

    fn left_out_rows(&self, fit: &Fit) -> Option<Vec<[String; 6]>> {
        let mut rows = vec![LEFT_OUT_HEADER.map(str::to_owned)];
        for ((name, own), fitted) in self.left_out.as_ref()?.iter().zip(&fit.runs) {
            let known = own.as_ref().filter(|own| own.is_answer);
            for (k, column) in self.columns.iter().enumerate() {
                let figures = known.and_then(|own| own.run.explained(k));
                let within = fitted.explained(k).map(|own| own.vaf);
                let surprise = known.map(|own| own.surprise(&self.noises));
                rows.push([
                    name.clone(),
                    column.clone(),
                    cell(figures.map(|own| own.vaf), 4),
                    cell(figures.map(|own| own.fit), 4),
                    cell(within, 4),
                    cell(surprise.filter(|_| k == 0), 6),
                ]);
            }
        }
        Some(rows)
    }
}

const LEFT_OUT_HEADER: [&str; 6] = [
    "left out",
    "column",
    "vaf [%]",
    "fit [%]",
    "vaf, fitted [%]",
    "−2 log L",
];
const LEFT_OUT: &str =
    "each run by a fit to the others; free initial states are estimated from it and count 2 each";
const ALONE_HEADER: [&str; 6] = ["parameter", "fitted to", "value", "sd", "low", "high"];

fn cell(value: Option<f64>, digits: usize) -> String {
    let known = value.filter(|own| own.is_finite());
    known.map_or("-".to_owned(), |own| significant(own, digits))
}

/// Estimates of each shared parameter from all runs, and from each group alone.
fn alone_rows(own: &PerRun, whole: &Fit) -> Vec<[String; 6]> {
    let mut rows = vec![ALONE_HEADER.map(str::to_owned)];
    for (k, name) in own.names.iter().enumerate() {
        let plain = name.trim_start_matches("ln ");
        let place = whole
            .parameters
            .iter()
            .position(|found| found.name == plain);
        let known = whole.uncertainty.as_ref().ok();
        let joint = known
            .zip(place)
            .and_then(|(own, place)| own.intervals[place].first());
        rows.push(row(plain, "all", (whole, joint)));
        for group in &own.groups {
            rows.push(row(
                plain,
                &group.name,
                (&group.fit, group.intervals.get(k)),
            ));
        }
    }
    rows
}

fn row(name: &str, group: &str, (fit, interval): (&Fit, Option<&Interval>)) -> [String; 6] {
    let found = fit.parameters.iter().find(|found| found.name == name);
    let value = found.filter(|_| fit.is_answer()).map(|own| own.mean());
    let interval = interval.filter(|_| fit.is_answer());
    [
        name.to_owned(),
        group.to_owned(),
        cell(value, 7),
        cell(interval.map(|own| own.sd), 3),
        cell(interval.map(|own| own.low), 5),
        cell(interval.map(|own| own.high), 5),
    ]
}

/// The verdict and the basis of it.
fn notes(own: &PerRun) -> Vec<String> {
    let mut notes = vec![verdict(own)];
    for Group { name, estimate, .. } in &own.groups {
        if let Err(reason) = estimate {
            notes.push(format!("not compared: {name}, since {reason}"));
        }
    }
    notes.push(
        "the test is Cochran's Q by the law of Welch and James, with `ar` covariances of each fit"
            .to_owned(),
    );
    notes
}

/// The verdict whether all runs have the same parameters, in words.
fn verdict(own: &PerRun) -> String {
    let Some(test) = &own.together else {
        return "one human? unknown: fewer than two fits determine all parameters".to_owned();
    };
    let p = significant(test.p, 2);
    let q = format!(
        "Q = {} with {} degrees of freedom",
        significant(test.statistic, 3),
        test.degrees
    );
    if test.p >= SIZE {
        return format!(
            "one human? no evidence against it: separate fits differ by no more than their noise ({q}, p = {p})"
        );
    }
    let each = own.names.iter().zip(&own.each);
    let known = each.filter_map(|(name, test)| Some((name, test.as_ref()?.p)));
    let most = known.min_by(|a, b| a.1.total_cmp(&b.1));
    let most = most.map_or(String::new(), |(name, p)| {
        format!("; most in `{name}` (p = {})", significant(p, 2))
    });
    format!("one human? no: separate fits differ by more than their noise ({q}, p = {p}){most}")
}

fn per_run_json(own: &PerRun) -> Value {
    let test = |own: &Homogeneity| json!({ "statistic": own.statistic, "degrees_of_freedom": own.degrees, "p": own.p });
    let group = |group: &Group| {
        let parameters = own.names.iter().enumerate().map(|(k, name)| {
            let plain = name.trim_start_matches("ln ");
            let found = group
                .fit
                .parameters
                .iter()
                .find(|found| found.name == plain);
            let interval = group.intervals.get(k).filter(|_| group.fit.is_answer());
            let object = json!({
                "value": found.filter(|_| group.fit.is_answer()).map(|own| own.mean()),
                "sd": interval.map(|own| own.sd),
                "low": interval.map(|own| own.low),
                "high": interval.map(|own| own.high),
            });
            (plain.to_owned(), object)
        });
        json!({
            "name": group.name,
            "status": group.fit.ending(),
            "converged": group.fit.is_answer(),
            "parameters": parameters.collect::<Map<_, _>>(),
            "not_compared": group.estimate.as_ref().err(),
        })
    };
    let each = own.names.iter().zip(&own.each);
    let each = each.map(|(name, own)| (name.clone(), json!(own.as_ref().map(test))));
    json!({
        "groups": own.groups.iter().map(group).collect::<Vec<_>>(),
        "homogeneity": own.together.as_ref().map(test),
        "parameters": each.collect::<Map<_, _>>(),
        "one_human": own.together.as_ref().map(|own| own.p >= SIZE),
        "covariance": "ar",
        "verdict": verdict(own),
    })
}
