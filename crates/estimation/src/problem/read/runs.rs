//! Reads runs and constraints.

use super::fields::{at, finite, place, place_of, positive, range, word};
use super::{Read, Reader};
use crate::problem::error::ProblemError;
use crate::problem::file::{Change, Constraint, Holds, RunLine, Set};
use crate::problem::runs;
use pilotage_cosim::description::Spanned;
use pilotage_text::document::TomlTable;

impl Reader<'_> {
    pub(super) fn constraints(&self, root: TomlTable<'_>) -> Read<Vec<Constraint>> {
        const PLACES: [(&str, Holds); 4] = [
            ("samples", Holds::Samples),
            ("start", Holds::Start),
            ("end", Holds::End),
            ("parameters", Holds::Parameters),
        ];
        let mut all = Vec::new();
        for table in root.tables("constraint")? {
            table.only(&["expression", "min", "max", "at"])?;
            let formula = table.required("expression", self.formula(table, "expression")?)?;
            let [min, max] = range(table)?;
            if min.is_none() && max.is_none() {
                let fault = "nothing is bounded; write `min`, `max` or both";
                return Err(ProblemError::at(&place_of(table), fault));
            }
            let holds = word(table, "at", &PLACES, Holds::Samples)?;
            if holds == Holds::Parameters && min == max {
                let fault = "an equation of parameters; tie one of them by `value = \"...\"` in [parameters]";
                return Err(at(table, "min", fault));
            }
            all.push(Constraint {
                place: place(table, "expression"),
                formula,
                min: min.unwrap_or(f64::NEG_INFINITY),
                max: max.unwrap_or(f64::INFINITY),
                at: holds,
            });
        }
        Ok(all)
    }

    pub(super) fn runs(&self, root: TomlTable<'_>) -> Read<Vec<RunLine>> {
        let mut runs = Vec::new();
        for table in root.tables("run")? {
            runs.push(self.run(table)?);
        }
        if !runs.iter().any(|run| run.fits) {
            let fault = "no run to fit; add [[run]] with file = \"run.csv\"";
            return Err(at(root, "run", fault));
        }
        runs::name(&mut runs);
        runs::check_twice(&runs)?;
        Ok(runs)
    }

    fn run(&self, table: TomlTable<'_>) -> Read<RunLine> {
        table.only(&[
            "file",
            "use",
            "weight",
            "subject",
            "set",
            "change",
            "start_time",
            "time_column",
        ])?;
        let file = table.required("file", table.string("file")?)?;
        let mut changes: Vec<Change> = Vec::new();
        for change in table.tables("change")? {
            change.only(&["time", "set", "add"])?;
            let time = change.required("time", finite(change, "time")?)?;
            if changes.last().is_some_and(|before| time <= before.time) {
                let fault = "changes stand in the order of their times; this one is not later than the one before";
                return Err(at(change, "time", fault));
            }
            let values = |key: &str| match change.table(key)? {
                Some(table) => self.set(table),
                None => Ok(Vec::new()),
            };
            let (set, add) = (values("set")?, values("add")?);
            if set.is_empty() && add.is_empty() {
                let fault = "nothing changes; write `set` for parameters and inputs, `add` for states, or both";
                return Err(at(change, "time", fault));
            }
            changes.push(Change {
                time,
                place: place(change, "time"),
                set,
                add,
            });
        }
        Ok(RunLine {
            file: self.folder.join(file),
            recorded: None,
            time_column: table.text("time_column")?,
            name: String::new(),
            place: place(table, "file"),
            fits: word(table, "use", &[("fit", true), ("validation", false)], true)?,
            weight: positive(table, "weight")?.unwrap_or(1.0),
            subject: table.text("subject")?,
            start_time: finite(table, "start_time")?.map(|value| Spanned {
                value,
                place: table.place("start_time"),
            }),
            set: match table.table("set")? {
                Some(set) => self.set(set)?,
                None => Vec::new(),
            },
            changes,
        })
    }

    fn set(&self, table: TomlTable<'_>) -> Read<Vec<Set>> {
        let mut all = Vec::new();
        for (table, field, name) in self.entries(table)? {
            let value = table.required(field, self.formula(table, field)?)?;
            all.push(Set { name, value });
        }
        Ok(all)
    }
}
