//! `--orders`: selects the order of the linear pilot. The fit continues with the selected order.

use super::{Args, MAX_ORDER};
use crate::cli::compare;
use crate::cli::deadline::Deadline;
use crate::cli::folds::Folds;
use crate::cli::{Failure, terminal};
use crate::estimation::comparison::{Candidate, Compared};
use crate::estimation::orders::Ordered as Solved;
use crate::estimation::{self, Fit, ProblemFile};
use crate::flights;
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
pub struct Chosen {
    pub text: String,
    pub json: Value,
    pub taken: Option<(ProblemFile, Fit)>,
    /// False if Ctrl-C or the time limit ended the comparison.
    pub is_whole: bool,
}

impl Orders {
    /// Selects an order of a problem's linear pilot. The returned problem starts at the result of its fit.
    pub fn chosen(&self, file: &ProblemFile, deadline: Deadline) -> Result<Chosen, Failure> {
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
}

impl Chosen {
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

/// Prints the choice before the fit continues; with `--json` it is part of the fit's object.
pub fn print_choice(args: &Args, chosen: &Chosen) -> Result<(), Failure> {
    match (args.json, args.logs_to_stdout()) {
        (true, _) => {}
        (false, true) => terminal::eprint(&chosen.text),
        (false, false) => terminal::print(&format!("{}\n", chosen.text))?,
    }
    Ok(())
}
