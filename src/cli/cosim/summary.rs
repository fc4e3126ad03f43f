//! What a run has done, for people and for scripts.

use super::ending::Words;
use super::{Args, report};
use crate::cosim::recorder::Signal;
use crate::cosim::{Algorithm, Run};
use serde_json::json;

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
            "report": report::to_json(&self.run.report),
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
            Algorithm::Jacobi | Algorithm::Strong => String::new(),
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
        text + &report::to_text(&self.run.report, self.args.coupling.report)
    }
}
