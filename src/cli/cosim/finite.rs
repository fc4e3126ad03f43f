//! What of a result is no finite number.

use crate::cosim::Recorder;
use crate::cosim::recorder::Signal;
use serde_json::{Value, json};
use std::io;

/// How many signals are named.
const NAMED: usize = 10;

/// A recorder that notes which signals are NaN or infinite.
pub struct Finite<R> {
    /// Where the rows go.
    pub inner: R,
    names: Vec<String>,
    /// Of each signal the first value that is no finite number, with its time, and in how many rows there is one.
    seen: Vec<Option<(f64, f64, u64)>>,
}

impl<R> Finite<R> {
    /// Of rows that go there.
    pub fn new(inner: R) -> Self {
        Self {
            inner,
            names: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// The recorder, and what was seen.
    pub fn finish(self) -> (R, NotFinite) {
        let seen = self.names.into_iter().zip(self.seen);
        let seen = seen.filter_map(|(name, seen)| Some((name, seen?)));
        (self.inner, NotFinite(seen.collect()))
    }
}

impl<R: Recorder> Recorder for Finite<R> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.names = signals.iter().map(|signal| signal.name.clone()).collect();
        self.seen = vec![None; signals.len()];
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        // Of finite numbers, times 0, the sum is finite, and this is one sweep.
        if !values
            .iter()
            .map(|value| value * 0.0)
            .sum::<f64>()
            .is_finite()
        {
            for (seen, value) in self.seen.iter_mut().zip(values) {
                if !value.is_finite() {
                    seen.get_or_insert((time, *value, 0)).2 += 1;
                }
            }
        }
        self.inner.row(time, values)
    }

    fn end_rows(&mut self) -> io::Result<()> {
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.inner.is_stop_asked()
    }
}

/// Signals that are not finite: first time, first value, rows.
#[derive(Debug, Default)]
pub struct NotFinite(Vec<(String, (f64, f64, u64))>);

impl NotFinite {
    /// Whether all of the result is finite.
    pub fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// A line for each signal.
    pub fn words(&self) -> Vec<String> {
        let line = |(name, (time, value, rows)): &(String, (f64, f64, u64))| {
            // Times are counted: 3 · 0.1 s.
            let time = (time * 1e9).round() / 1e9;
            match rows {
                1 => format!("`{name}` is {value} at {time} s"),
                _ => {
                    format!("`{name}` is {value} at {time} s, and no finite number in {rows} rows")
                }
            }
        };
        let mut lines: Vec<String> = self.0.iter().take(NAMED).map(line).collect();
        if let Some(more) = self.0.len().checked_sub(NAMED).filter(|more| *more > 0) {
            lines.push(format!("{more} more signals are not finite"));
        }
        lines
    }

    /// The same for scripts.
    pub fn to_json(&self) -> Value {
        let entry = |(name, (time, value, rows)): &(String, (f64, f64, u64))| json!({ "signal": name, "time": time, "value": value.to_string(), "rows": rows });
        self.0.iter().map(entry).collect()
    }
}
