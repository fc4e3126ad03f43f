//! Detects results that are not finite numbers.

use super::recorder::{Recorder, Signal};
use std::io;

/// Maximum number of signals that are named.
const NAMED: usize = 10;

/// A recorder that records which signals are NaN or infinite.
pub struct Finite<'r> {
    inner: &'r mut dyn Recorder,
    names: Vec<String>,
    /// For each signal, time and value of the first non-finite sample, and the number of rows with one.
    seen: Vec<Option<(f64, f64, u64)>>,
}

impl<'r> Finite<'r> {
    /// Forwards rows to `inner`.
    pub fn new(inner: &'r mut dyn Recorder) -> Self {
        Self {
            inner,
            names: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// The non-finite signals.
    pub fn finish(self) -> NotFinite {
        let seen = self.names.into_iter().zip(self.seen);
        let seen = seen.filter_map(|(name, seen)| {
            let (time, value, rows) = seen?;
            Some(NotFiniteSignal {
                name,
                time,
                value,
                rows,
            })
        });
        NotFinite(seen.collect())
    }
}

impl Recorder for Finite<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.names = signals.iter().map(|signal| signal.name.clone()).collect();
        self.seen = vec![None; signals.len()];
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        // Finite numbers times 0 sum to a finite number; this needs only one pass.
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

/// A signal that is NaN or infinite in some rows.
#[derive(Debug, Clone, PartialEq)]
pub struct NotFiniteSignal {
    /// `instance.variable`.
    pub name: String,
    /// Time of the first such sample \[s\].
    pub time: f64,
    /// Value of that sample.
    pub value: f64,
    /// Number of rows with such samples.
    pub rows: u64,
}

/// Signals that are NaN or infinite.
#[derive(Debug, Default)]
pub struct NotFinite(pub Vec<NotFiniteSignal>);

impl NotFinite {
    /// Whether the whole result is finite.
    pub fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// One line per signal.
    pub fn words(&self) -> Vec<String> {
        let line = |own: &NotFiniteSignal| {
            let NotFiniteSignal {
                name, value, rows, ..
            } = own;
            // Removes rounding noise of `k·h`, as in 3 · 0.1 s.
            let time = (own.time * 1e9).round() / 1e9;
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
}
