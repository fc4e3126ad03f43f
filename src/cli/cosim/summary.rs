//! What a run has done, for people and for scripts.

use super::Args;
use crate::cosim::recorder::Signal;
use crate::cosim::{Algorithm, Ending, Run};
use serde_json::json;
use std::error::Error;

/// How a run ended, in words.
pub struct Words {
    /// For scripts.
    pub status: &'static str,
    /// `note` or `error`.
    pub severity: &'static str,
    /// What went wrong, if anything.
    pub message: Option<String>,
}

impl Words {
    /// How that run ended.
    pub fn of(run: &Run) -> Self {
        let (status, severity, message) = match &run.ending {
            Ending::Completed => ("completed", "note", None),
            Ending::Stopped { time } => {
                let message = format!("stopped at {time} s; the rows until then are kept");
                ("stopped", "note", Some(message))
            }
            Ending::EndRequested { instance, time } => {
                let message = format!("`{instance}` asked for the end at {time} s");
                ("end-requested", "note", Some(message))
            }
            Ending::Discarded {
                instance,
                time,
                reached,
            } => {
                let message = format!(
                    "`{instance}` discarded the step from {time} s, it came to {reached} s; \
                 the rows until {} s are kept",
                    run.time
                );
                ("discarded", "error", Some(message))
            }
            Ending::Failed {
                instance,
                time,
                stage,
                source,
            } => {
                let message = format!(
                    "`{instance}` failed to {stage} at {time} s: {}; the rows until {} s are kept",
                    chain(source.as_ref()),
                    run.time
                );
                ("failed", "error", Some(message))
            }
        };
        Self {
            status,
            severity,
            message,
        }
    }
}

/// An error with all that caused it.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text += &format!(": {cause}");
        next = cause.source();
    }
    text
}

/// A run and what belongs to it.
pub struct Summary<'a> {
    pub args: &'a Args,
    pub algorithm: Algorithm,
    pub run: &'a Run,
    pub ending: &'a Words,
    /// Time that it took [s].
    pub seconds: f64,
    /// Recorded rows.
    pub rows: u64,
    /// Recorded signals.
    pub signals: &'a [Signal],
    /// Connections whose values are converted: output, its unit, input, its unit.
    pub converted: Vec<[String; 4]>,
    pub notes: Vec<String>,
}

impl Summary<'_> {
    pub fn to_json(&self) -> serde_json::Value {
        let signals: Vec<_> = (self.signals.iter())
            .map(|signal| json!({ "name": signal.name, "unit": signal.unit }))
            .collect();
        let conversions: Vec<_> = (self.converted.iter())
            .map(|[from, from_unit, to, to_unit]| {
                json!({ "from": from, "fromUnit": from_unit, "to": to, "toUnit": to_unit })
            })
            .collect();
        json!({
            "status": self.ending.status,
            "message": self.ending.message,
            "algorithm": self.algorithm.to_string(),
            "order": self.run.order,
            "steps": self.run.steps,
            "step": self.args.step,
            "time": self.run.time,
            "seconds": self.seconds,
            "rows": self.rows,
            "signals": signals,
            "unrecorded": self.run.unrecorded,
            "conversions": conversions,
            "notes": self.notes,
            "output": self.args.output.display().to_string(),
        })
    }

    pub fn to_text(&self) -> String {
        let order = match self.algorithm {
            Algorithm::Jacobi => String::new(),
            Algorithm::GaussSeidel => format!(", in the order {}", self.run.order.join(", ")),
        };
        let mut text = format!(
            "{} steps of {} s from {} s to {} s ({}{order})\n{} rows of {} signals in {}\n",
            self.run.steps,
            self.args.step,
            self.args.start_time,
            self.run.time,
            self.algorithm,
            self.rows,
            self.signals.len(),
            self.args.output.display()
        );
        for [from, from_unit, to, to_unit] in &self.converted {
            text += &format!("note: `{from}` [{from_unit}] is converted for `{to}` [{to_unit}]\n");
        }
        for note in &self.notes {
            text += &format!("note: {note}\n");
        }
        for output in &self.run.unrecorded {
            text += &format!("note: `{output}` is text and not in the table\n");
        }
        text
    }
}
