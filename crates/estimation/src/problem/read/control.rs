//! Reads what a file says of optimal control.

use super::fields::{at, finite, place, positive, whole, word};
use super::{Read, Reader};
use crate::problem::control::{Control, First, Guess, Horizon, Objective, Optimal, PartOf};
use crate::problem::file::Initial;
use pilotage_cosim::description::Spanned;
use pilotage_language::file::{Formula, formula_in};
use pilotage_text::document::TomlTable;

/// Largest number of intervals.
const MOST_INTERVALS: usize = 2000;
/// Their number, unless given.
const INTERVALS: usize = 50;

/// What parts of an objective are called, with their lengths in mind: each is replaced by a name that is not longer.
const PARTS: [(&str, PartOf); 3] = [
    ("initial", PartOf::Initial),
    ("final", PartOf::Final),
    ("integral", PartOf::Integral),
];

impl Reader<'_> {
    /// What is optimised; none if the file has no objective.
    pub(super) fn optimal(&self, root: TomlTable<'_>) -> Read<Option<Optimal>> {
        let Some(objective) = root.table("objective")? else {
            let others = ["control", "horizon", "final", "guess"];
            return match others.into_iter().find(|key| root.has(key)) {
                Some(key) => Err(at(
                    root,
                    key,
                    "nothing is optimised; add [objective] with minimise = \"...\"",
                )),
                None => Ok(None),
            };
        };
        for key in [
            "measured",
            "run",
            "inputs",
            "process_noise",
            "stability",
            "derived",
        ] {
            if root.has(key) {
                let fault =
                    format!("a file with an [objective] has no `{key}` yet; leave one of them out");
                return Err(at(root, key, fault));
            }
        }
        let horizon = root.required("horizon", root.table("horizon")?)?;
        let controls = root.tables("control")?.into_iter();
        Ok(Some(Optimal {
            controls: controls.map(|own| self.control(own)).collect::<Read<_>>()?,
            objective: self.objective(objective)?,
            horizon: read_horizon(horizon)?,
            finals: self.finals(root)?,
            guess: self.guess(root)?,
        }))
    }

    fn control(&self, table: TomlTable<'_>) -> Read<Control> {
        table.only(&["signal", "min", "max", "rate", "start", "shape", "first"])?;
        let signal = table.required("signal", table.string("signal")?)?;
        let rate = positive(table, "rate")?;
        let first = match table.string("first") {
            Ok(Some(_)) => word(
                table,
                "first",
                &[("free", First::Free), ("trim", First::Trim)],
                First::Free,
            )?,
            _ => match finite(table, "first")? {
                Some(number) => First::Number(number),
                None if rate.is_some() => First::Trim,
                None => First::Free,
            },
        };
        Ok(Control {
            signal: Spanned {
                value: signal.to_owned(),
                place: table.place("signal"),
            },
            limits: [self.formula(table, "min")?, self.formula(table, "max")?],
            rate,
            start: finite(table, "start")?,
            is_constant: word(
                table,
                "shape",
                &[("linear", false), ("constant", true)],
                false,
            )?,
            first,
        })
    }

    fn objective(&self, table: TomlTable<'_>) -> Read<Objective> {
        table.only(&["minimise", "maximise", "regularise"])?;
        let key = match (table.has("minimise"), table.has("maximise")) {
            (true, true) => {
                let fault = "an objective is minimised or maximised; leave one of them out";
                return Err(at(table, "maximise", fault));
            }
            (false, true) => "maximise",
            _ => "minimise",
        };
        let text = table.required(key, table.string(key)?)?;
        let mut rest = text.to_owned();
        let mut parts = Vec::new();
        while let Some((kind, range, inner)) = first_part(&rest) {
            let (word, of) = PARTS[kind];
            let name = format!("{word}_{}", parts.len());
            if name.len() > range.len() || inner.is_empty() {
                let fault = format!("`{}` names nothing; write {word}(signal)", &rest[range]);
                return Err(at(table, key, fault));
            }
            // The part alone, and the rest with its name, each in its place.
            let alone = " ".repeat(inner.start) + &rest[inner];
            parts.push((name.clone(), of, self.formula_in(table, key, &alone)?));
            let filled = format!("{name:<width$}", width = range.len());
            rest.replace_range(range, &filled);
        }
        Ok(Objective {
            place: place(table, key),
            formula: self.formula_in(table, key, &rest)?,
            parts,
            is_maximised: key == "maximise",
            regularise: positive(table, "regularise")?.unwrap_or(0.0),
        })
    }

    fn formula_in(&self, table: TomlTable<'_>, key: &str, shown: &str) -> Read<Formula> {
        Ok(formula_in((self.file, self.text), table, key, shown)?)
    }

    fn finals(&self, root: TomlTable<'_>) -> Read<Vec<(Spanned<String>, Formula)>> {
        let mut all = Vec::new();
        for (name, value) in self.states(root, "final")? {
            match value {
                Initial::Formula(formula) => all.push((name, formula)),
                Initial::Free => {}
                Initial::Steady | Initial::FirstSample => {
                    let fault = "a final state is a number, an expression or \"free\"";
                    return Err(at(root, "final", fault));
                }
            }
        }
        Ok(all)
    }

    fn guess(&self, root: TomlTable<'_>) -> Read<Guess> {
        let mut guess = Guess::default();
        if let Ok(Some(own)) = root.string("guess") {
            match own {
                "simulate" => guess.is_simulated = true,
                table => guess.table = Some(table.to_owned()),
            }
            return Ok(guess);
        }
        for (table, field, name) in self.section(root, "guess")? {
            let pair = table.required(field, table.numbers(field)?)?;
            let Ok(pair) = <[f64; 2]>::try_from(pair) else {
                return Err(at(table, field, "a guess is [first, last], two numbers"));
            };
            guess.states.push((name, pair));
        }
        Ok(guess)
    }
}

/// The first part of an objective that has no other in it: its kind, and the ranges of it and of what is in its brackets.
fn first_part(text: &str) -> Option<(usize, std::ops::Range<usize>, std::ops::Range<usize>)> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let found = PARTS.iter().enumerate().flat_map(|(kind, (word, _))| {
        let hits = text.match_indices(word);
        hits.filter_map(move |(start, _)| {
            let before = text[..start].chars().next_back();
            let after = text[start + word.len()..].trim_start();
            let open = text.len() - after.len();
            (after.starts_with('(') && !before.is_some_and(is_name)).then_some((start, kind, open))
        })
    });
    let (start, kind, open) = found.min()?;
    let mut depth = 0;
    for (k, c) in text[open..].char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            let end = open + k;
            return Some((kind, start..end + 1, open + 1..end));
        }
    }
    None
}

fn read_horizon(table: TomlTable<'_>) -> Read<Horizon> {
    table.only(&["duration", "intervals"])?;
    let intervals = whole(table, "intervals", INTERVALS, MOST_INTERVALS)?;
    if !table.is_table("duration") {
        let known = table.required("duration", positive(table, "duration")?)?;
        return Ok(Horizon {
            start: known,
            min: known,
            max: known,
            intervals,
        });
    }
    let own = table.required("duration", table.table("duration")?)?;
    own.only(&["start", "min", "max"])?;
    let start = own.required("start", positive(own, "start")?)?;
    let min = positive(own, "min")?.unwrap_or(1e-3 * start);
    let max = positive(own, "max")?.unwrap_or(f64::INFINITY);
    if !(min < max && (min..=max).contains(&start)) {
        let fault = format!("the duration starts at {start}, which is not within {min} to {max}");
        return Err(at(own, "start", fault));
    }
    Ok(Horizon {
        start,
        min,
        max,
        intervals,
    })
}
