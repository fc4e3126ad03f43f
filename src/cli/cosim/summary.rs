//! The summary of a run for people and for scripts.

use super::{Args, Deadlines, Simulated, Traffic, report};
use crate::cli::Failure;
use crate::cli::made::{made, with_sums};
use crate::cli::terminal;
use crate::cosim::{Algorithm, NotFiniteSignal};
use crate::report::{Simulation, simulation_page};
use crate::series::{Series, SeriesError};
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A run and its context.
pub struct Summary<'a> {
    pub args: &'a Args,
    /// Input files.
    pub files: &'a [PathBuf],
    pub done: &'a Simulated,
}

fn not_finite(signal: &NotFiniteSignal) -> Value {
    // JSON has no NaN or infinity.
    json!({ "signal": signal.name, "time": signal.time, "value": signal.value.to_string(), "rows": signal.rows })
}

impl Summary<'_> {
    pub fn to_json(&self) -> serde_json::Value {
        let signals: Vec<_> = (self.done.signals.iter())
            .map(|signal| json!({ "name": signal.name, "unit": signal.unit }))
            .collect();
        let conversions: Vec<_> = (self.done.converted.iter())
            .map(|[from, from_unit, to, to_unit]| {
                json!({ "from": from, "fromUnit": from_unit, "to": to, "toUnit": to_unit })
            })
            .collect();
        json!({
            "status": self.done.ending.status,
            "message": self.done.ending.message,
            "algorithm": self.done.algorithm.to_string(),
            "order": self.done.run.order,
            "steps": self.done.run.steps,
            "step": self.done.clock.step(),
            "report": report::to_json(&self.done.run.report),
            "time": self.done.run.time,
            "seconds": self.done.seconds,
            "rows": self.done.rows,
            "signals": signals,
            "unrecorded": self.done.run.unrecorded,
            "conversions": conversions,
            "notes": self.done.notes,
            "outside": self.done.traffic.map(Traffic::to_json),
            "realTime": self.done.deadlines.as_ref().map(Deadlines::to_json),
            "not_finite": self.done.not_finite.0.iter().map(not_finite).collect::<Value>(),
            "output": self.args.output.display().to_string(),
        })
    }

    pub fn to_text(&self) -> String {
        let order = match self.done.algorithm {
            Algorithm::Jacobi | Algorithm::Strong => String::new(),
            Algorithm::GaussSeidel => format!(", in the order {}", self.done.run.order.join(", ")),
        };
        let mut text = format!(
            "{} of {} s from {} s to {} s ({}{order})\n{} of {} in {}\n",
            counted(self.done.run.steps as usize, "step"),
            self.done.clock.step(),
            self.done.run.begin,
            self.done.run.time,
            self.done.algorithm,
            counted(self.done.rows as usize, "row"),
            counted(self.done.signals.len(), "signal"),
            terminal::shown(&self.args.output)
        );
        let not_finite = match self.args.allow_nan {
            true => self.done.not_finite.words(),
            false => Vec::new(),
        };
        for note in self.notes().into_iter().chain(not_finite) {
            text += &terminal::labelled("note", &note);
        }
        text + &report::to_text(&self.done.run.report, self.args.coupling.details)
    }

    /// Notes for the user, without those of the master.
    fn notes(&self) -> Vec<String> {
        let converted = self
            .done
            .converted
            .iter()
            .map(|[from, from_unit, to, to_unit]| {
                format!("`{from}` [{from_unit}] is converted for `{to}` [{to_unit}]")
            });
        let wanted = &self.args.record;
        let unrecorded = self.done.run.unrecorded.iter();
        let unrecorded = unrecorded.filter(|name| wanted.is_empty() || wanted.contains(name));
        let unrecorded = unrecorded.map(|name| format!("`{name}` is text and not in the table"));
        (converted.chain(self.done.notes.iter().cloned()))
            .chain(unrecorded)
            .chain(self.done.deadlines.as_ref().map(Deadlines::words))
            .chain(self.done.traffic.as_ref().map(Traffic::words))
            .collect()
    }

    /// The HTML page, drawn from the written result.
    pub fn page(&self) -> Result<String, Failure> {
        let run = &self.done.run;
        let series = match Series::read_table(&self.args.output) {
            // The run failed before its first row.
            Err(SeriesError::NoSamples { .. }) => Series::default(),
            read => read?,
        };
        let ending = match (self.done.ending.status, self.done.ending.severity) {
            ("completed", _) => ("good", "completed"),
            (status, "error") => ("bad", status),
            (status, _) => ("doubtful", status),
        };
        let message = self.done.ending.message.iter().cloned();
        let notes = self.notes().into_iter();
        let notes = notes.chain(report::notes(&run.report));
        let duration = format!("{} to {} s", run.begin, run.time);
        let facts = [
            ("simulated", duration),
            ("step", format!("{} s", self.done.clock.step())),
            ("algorithm", self.done.algorithm.to_string()),
            ("communication steps", run.report.steps.accepted.to_string()),
            ("rejected", run.report.steps.rejected.to_string()),
            ("took", format!("{} s", significant(self.done.seconds, 3))),
        ];
        Ok(simulation_page(&Simulation {
            ending,
            warnings: &message
                .chain(self.done.not_finite.words())
                .chain(report::warnings(&run.report))
                .collect::<Vec<_>>(),
            notes: &notes.collect::<Vec<_>>(),
            facts: &facts,
            series: &series,
            report: &run.report,
            files: &with_sums(self.files),
            made: &made(),
        }))
    }
}
