//! `--orders`: selects the order of the linear pilot. The fit continues with the selected order.

use super::watch::Watch;
use super::{Args, MAX_ORDER};
use crate::cli::compare::{self, Line, coloured, comparisons_json, figures_json, table, words};
use crate::cli::deadline::Deadline;
use crate::cli::folds::Folds;
use crate::cli::{Failure, terminal};
use crate::estimation::comparison::{Candidate, Compared};
use crate::estimation::orders::Ordered as Solved;
use crate::estimation::{self, Fit, ProblemFile};
use crate::flights;
use crate::identification::orders::{self, Ordered};
use crate::identification::{FitOptions, InitialState, Objective, TrialSet};
use crate::inference::choice::{Comparison, Contender, choose};
use pilotage_text::counted;
use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// Orders to compare.
#[derive(Debug, Clone)]
pub struct Orders(RangeInclusive<u8>);

/// Parses an inclusive range of orders such as `1..5`.
pub fn orders(text: &str) -> Result<Orders, String> {
    let expected =
        || format!("expected two orders from 1 to {MAX_ORDER}, the lower first, such as 1..5");
    let (first, last) = text.split_once("..").ok_or_else(expected)?;
    let number = |text: &str| text.parse::<u8>().map_err(|_| expected());
    let (first, last) = (number(first)?, number(last)?);
    let is_range = 1 <= first && first < last && usize::from(last) <= MAX_ORDER;
    is_range
        .then_some(Orders(first..=last))
        .ok_or_else(expected)
}

/// The output of the comparison, and the selected item, if any.
pub struct Chosen<T> {
    pub text: String,
    pub json: Value,
    pub taken: Option<T>,
    /// False if Ctrl-C or the time limit ended the comparison.
    pub is_whole: bool,
}

impl Orders {
    /// Selects an order for a problem file. The returned problem starts at the result of its fit.
    pub fn problem(
        &self,
        file: &ProblemFile,
        deadline: Deadline,
    ) -> Result<Chosen<(ProblemFile, Fit)>, Failure> {
        let folds = Folds::until(deadline);
        let range = u32::from(*self.0.start())..=u32::from(*self.0.end());
        let ask = |done: usize, all: usize| folds.ask(done, all);
        let all = estimation::orders::ordered(file, range, &flights::open, &ask)?;
        let is_whole = folds.end();
        let is_known = |own: &Solved| own.candidate.fit.is_answer() && own.is_whole;
        let (known, last): (Vec<Solved>, Vec<Solved>) = all.into_iter().partition(is_known);
        let last = last.iter().map(|own| {
            let fit = &own.candidate.fit;
            let status = (!fit.is_answer()).then(|| fit.ending());
            (own.order as usize, status)
        });
        let last = unanswered(last);
        if known.is_empty() {
            return Ok(Chosen::none(last, is_whole));
        }
        let names = known.iter().map(|own| format!("order {}", own.order));
        let names: Vec<String> = names.collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let (mut files, candidates): (Vec<ProblemFile>, Vec<Candidate>) = known
            .into_iter()
            .map(|own| (own.file, own.candidate))
            .unzip();
        let mut compared = Compared::of(file, candidates);
        let (text, json) = (
            compare::to_text(&names, &compared),
            compare::to_json(&names, &compared),
        );
        let taken = compared.choice.as_ref().map(|(taken, _)| *taken);
        let taken = taken.map(|taken| {
            let candidate = compared.candidates.swap_remove(taken);
            (files.swap_remove(taken), candidate.fit)
        });
        Ok(Chosen {
            text,
            json,
            taken,
            is_whole,
        }
        .with_ending(last))
    }

    /// Selects an order for recorded flights.
    pub fn flights(
        &self,
        args: &Args,
        set: &TrialSet,
        options: &FitOptions,
        deadline: Deadline,
    ) -> Result<Chosen<Ordered>, Failure> {
        check(options)?;
        let mut watch = Watch::new(deadline, None, args.verbose);
        let range = usize::from(*self.0.start())..=usize::from(*self.0.end());
        let count = range.clone().count();
        let all = orders::ordered(set, options, range, &mut |progress| watch.flights(progress));
        watch.end();
        let all = all?;
        let is_whole = all.len() == count && all.iter().all(|own| own.is_whole);
        let (mut known, last): (Vec<_>, Vec<_>) =
            (all.into_iter()).partition(|own| own.fit.is_answer() && own.is_whole);
        let last = unanswered(last.iter().map(|own| {
            let status = (!own.fit.is_answer()).then(|| own.fit.status.as_str());
            (own.order, status)
        }));
        if known.is_empty() {
            return Ok(Chosen::none(last, is_whole));
        }
        let figures: Vec<Contender> = known.iter().map(|own| own.figures.clone()).collect();
        let choice = choose(&figures);
        let compared = ComparedOrders::new(&known, set);
        Ok(Chosen {
            text: compared.text(choice.as_ref()),
            json: compared.json(choice.as_ref()),
            taken: choice.map(|(taken, _)| known.swap_remove(taken)),
            is_whole,
        }
        .with_ending(last))
    }
}

impl<T> Chosen<T> {
    fn none(last: (String, Value), is_whole: bool) -> Self {
        Self {
            text: String::new(),
            json: json!({ "problems": [], "comparisons": [], "taken": null }),
            taken: None,
            is_whole,
        }
        .with_ending(last)
    }

    /// Adds the orders that were not compared, and whether the comparison is complete.
    fn with_ending(mut self, (words, others): (String, Value)) -> Self {
        self.text += &words;
        self.json["not_compared"] = others;
        self.json["complete"] = json!(self.is_whole);
        if !self.is_whole {
            self.text += match self.taken {
                Some(_) => {
                    "the comparison was stopped: other orders may predict runs better; allow more time\n"
                }
                None => "the comparison was stopped, and nothing is written: allow more time\n",
            };
        }
        self
    }
}

/// Orders that are not compared, with the status of a fit without an answer; none if fits to some of the runs were stopped.
fn unanswered<'a>(all: impl Iterator<Item = (usize, Option<&'a str>)>) -> (String, Value) {
    let all: Vec<(usize, Option<&str>)> = all.collect();
    let words = all.iter().map(|(order, status)| match status {
        Some(status) => format!("order {order} has no answer ({status}), and is not compared\n"),
        None => {
            format!("order {order} is not compared: not every run was left out before the end\n")
        }
    });
    let objects = all.iter().map(|(order, status)| {
        json!({ "file": format!("order {order}"), "status": status.unwrap_or("runs-not-left-out") })
    });
    (words.collect(), objects.collect())
}

/// Checks the options: trials that are left out are flown from rest, and their positions are compared.
fn check(options: &FitOptions) -> Result<(), Failure> {
    if options.objective != Objective::Response {
        let message = "--orders compares responses, and --objective stick fits the stick";
        return Err(Failure::new(message).hint("leave --objective out"));
    }
    if options.initial_state != InitialState::AtRest {
        let message = "--orders flies trials that are left out from rest, and --initial-state says that they are not";
        return Err(Failure::new(message)
            .hint("--initial-state at-rest, or a problem file, where free states are estimated"));
    }
    Ok(())
}

/// The compared orders of recorded flights.
struct ComparedOrders<'a> {
    all: &'a [Ordered],
    set: &'a TrialSet,
    names: Vec<String>,
}

impl<'a> ComparedOrders<'a> {
    fn new(all: &'a [Ordered], set: &'a TrialSet) -> Self {
        let names = all
            .iter()
            .map(|own| format!("order {}", own.order))
            .collect();
        Self { all, set, names }
    }

    fn lines(&self) -> Vec<Line<'_>> {
        let all = self.names.iter().zip(self.all);
        all.map(|(name, own)| Line {
            name,
            status: own.fit.status.as_str(),
            is_answer: true,
            figures: &own.figures,
        })
        .collect()
    }

    fn text(&self, choice: Option<&(usize, Vec<Comparison>)>) -> String {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let figures: Vec<&Contender> = self.all.iter().map(|own| &own.figures).collect();
        let head = format!(
            "{} on {}, {} values. Left out: −2 log likelihood of the runs, flown from rest by pilots of the others.\n\n",
            counted(names.len(), "order"),
            counted(self.set.fit.len(), "run"),
            figures[0].samples
        );
        let text = match choice {
            None => format!("{}\n", compare::few()),
            Some(choice) => {
                let runs = self.all[choice.0].fit.runs.iter();
                words(
                    &names,
                    &figures,
                    choice,
                    coloured(runs.map(|run| run.residual.clone())),
                )
            }
        };
        head + &table("pilot", &self.lines()) + "\n" + &text
    }

    fn json(&self, choice: Option<&(usize, Vec<Comparison>)>) -> Value {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let problems = self.lines().into_iter().map(|line| {
            let runs = self.set.fit.iter().zip(&line.figures.held_out);
            let mut object = figures_json(&line, true);
            object["held_out"] = runs
                .map(|(run, own)| (run.name.clone(), json!(own)))
                .collect();
            object
        });
        json!({
            "problems": problems.collect::<Vec<_>>(),
            "comparisons": comparisons_json(&names, choice),
            "taken": choice.map(|(taken, _)| names[*taken]),
        })
    }
}

/// Prints the choice before the fit continues; with `--json` it is part of the fit's object.
pub fn print_choice<T>(args: &Args, chosen: &Chosen<T>) -> Result<(), Failure> {
    match (args.json, args.logs_to_stdout()) {
        (true, _) => {}
        (false, true) => terminal::eprint(&chosen.text),
        (false, false) => terminal::print(&format!("{}\n", chosen.text))?,
    }
    Ok(())
}
