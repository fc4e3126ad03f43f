//! Selection of recorded signals and rows.

use super::component::{Conversion, Role, Value, ValueKind};
use super::recorder::{Recorder, Signal};
use super::system::{Port, System};
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::collections::{HashMap, HashSet};
use std::io;
use thiserror::Error;

/// Why signals cannot be selected.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SelectionError {
    /// A pattern that matches no variable.
    #[error("no variable is named like `{pattern}`{}", did_you_mean(suggestion.as_deref()))]
    Nothing {
        /// The pattern.
        pattern: String,
        /// The most similar name.
        suggestion: Option<String>,
    },
    /// A pattern that matches only variables that a table of numbers cannot hold.
    #[error("`{pattern}` is text and cannot be in a table of numbers")]
    Text {
        /// The pattern.
        pattern: String,
    },
}

/// Selected signals, in recording order.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    chosen: Vec<Chosen>,
}

#[derive(Debug, Clone)]
struct Chosen {
    signal: Signal,
    /// Name of the run's signal with its values: its own name or, for a connected input, that of the output.
    source: String,
    change: Change,
}

/// What a wire does with the values of an output.
#[derive(Debug, Clone)]
struct Change {
    conversion: Conversion,
    /// Values with others in their place.
    map: Vec<(f64, f64)>,
}

impl Change {
    fn apply(&self, value: f64) -> f64 {
        match self.map.iter().find(|(from, _)| *from == value) {
            Some((_, to)) => *to,
            None => self.conversion.apply(value),
        }
    }
}

impl Selection {
    /// Selects the variables whose `instance.variable` or alias matches one of the patterns, in which `*` matches any
    /// characters and `?` one. Parameters, which do not change, are selected only if nothing else matches. The system
    /// is set to read those that it otherwise would not: locals, parameters and unconnected inputs. A connected input
    /// has the value of the output that feeds it, in the input's unit.
    ///
    /// # Errors
    /// If a pattern matches nothing that can be recorded.
    pub fn new(system: &mut System, patterns: &[String]) -> Result<Self, SelectionError> {
        let chosen = Self::matching(system, patterns)?;
        Ok(Self::of(system, chosen))
    }

    /// The variables that [`new`](Self::new) selects, with their names.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn matching(
        system: &System,
        patterns: &[String],
    ) -> Result<Vec<(Port, String)>, SelectionError> {
        let names: Vec<(Port, String)> = system.names().collect();
        let (mut chosen, mut known) = (Vec::new(), HashSet::new());
        for pattern in patterns {
            let mut fitting: Vec<&(Port, String)> = (names.iter())
                .filter(|(_, name)| fits(pattern, name))
                .collect();
            // If a variable's own name matches, its aliases are ignored.
            fitting.retain(|(port, name)| {
                let own = system.port_name(*port);
                *name == own || !fits(pattern, &own)
            });
            if fitting.is_empty() {
                let all = names.iter().map(|(_, name)| name.as_str());
                return Err(SelectionError::Nothing {
                    pattern: pattern.clone(),
                    suggestion: suggestion(pattern, all).map(str::to_owned),
                });
            }
            let is_number = |port: Port| system.variable(port).kind != ValueKind::String;
            if !fitting.iter().any(|(port, _)| is_number(*port)) {
                let pattern = pattern.clone();
                return Err(SelectionError::Text { pattern });
            }
            fitting.retain(|(port, _)| is_number(*port));
            let is_variable = |port: Port| system.variable(port).role != Role::Parameter;
            let has_variables = fitting.iter().any(|(port, _)| is_variable(*port));
            let wanted = (fitting.into_iter())
                .filter(|(port, _)| is_variable(*port) || !has_variables)
                .filter(|(_, name)| known.insert(name.clone()));
            chosen.extend(wanted.cloned());
        }
        Ok(chosen)
    }

    /// The selected signals.
    pub fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.chosen.iter().map(|own| &own.signal)
    }

    /// All outputs except those of some components; instead, the inputs that these feed are recorded, since the input's
    /// name describes a table's signal best.
    pub fn without(system: &mut System, sources: &[String]) -> Self {
        let is_source = |port: Port| sources.contains(&system.instances[port.instance].name);
        let is_wanted = |port: &Port| {
            let variable = system.variable(*port);
            let is_fed = |from: Port| is_source(from) && variable.role == Role::Input;
            variable.kind != ValueKind::String
                && match system.feeding(*port) {
                    Some(wire) => is_fed(wire.from),
                    None => variable.role == Role::Output && !is_source(*port),
                }
        };
        let ports = system.ports().filter(is_wanted);
        let ports: Vec<_> = ports.map(|port| (port, system.port_name(port))).collect();
        Self::of(system, ports)
    }

    fn of(system: &mut System, ports: Vec<(Port, String)>) -> Self {
        let mut chosen = Vec::new();
        for (port, name) in ports {
            let unit = system.variable(port).unit.as_ref();
            let signal = Signal {
                name,
                unit: unit.map_or(String::new(), |unit| unit.name.clone()),
                description: system.variable(port).description.clone(),
            };
            let number = |(from, to): &(Value, Value)| (from.as_number(), to.as_number());
            let wire = system.feeding(port);
            let change = Change {
                conversion: wire.map_or(Conversion::NONE, |wire| wire.conversion),
                map: wire.map_or(Vec::new(), |wire| wire.map.iter().map(number).collect()),
            };
            let from = wire.map_or(port, |wire| wire.from);
            if from == port {
                system.observe(port);
            }
            chosen.push(Chosen {
                signal,
                source: system.port_name(from),
                change,
            });
        }
        Self { chosen }
    }
}

/// Whether a name matches a pattern with `*` and `?`.
fn fits(pattern: &str, name: &str) -> bool {
    let mut rest = name.chars();
    let mut parts = pattern.chars();
    match parts.next() {
        None => name.is_empty(),
        Some('*') => {
            let after = parts.as_str();
            let starts = name.char_indices().map(|(at, _)| at);
            starts
                .chain([name.len()])
                .any(|at| fits(after, &name[at..]))
        }
        Some(c) => {
            rest.next().is_some_and(|found| c == '?' || c == found)
                && fits(parts.as_str(), rest.as_str())
        }
    }
}

/// Records selected signals in every `every`-th row, starting with the first, and in the last row.
pub struct Thinned<'r> {
    /// Recorder of the selected values.
    inner: &'r mut dyn Recorder,
    selection: Option<Selection>,
    /// Slot in the run's row and change of each selected signal; empty without a selection.
    slots: Vec<(usize, Change)>,
    row: Vec<f64>,
    every: u64,
    /// Number of rows to skip before the next recorded one.
    wait: u64,
    /// Time and values of the last row, if it was skipped.
    skipped: Option<f64>,
    last: Vec<f64>,
    /// The recorded signals.
    pub signals: Vec<Signal>,
    /// Number of recorded rows.
    pub rows: u64,
}

impl<'r> Thinned<'r> {
    /// Without a selection, all signals are recorded.
    ///
    /// # Panics
    /// If `every` is 0.
    pub fn new(inner: &'r mut dyn Recorder, selection: Option<Selection>, every: u64) -> Self {
        assert!(every > 0, "every 0th row cannot be recorded");
        Self {
            inner,
            selection,
            slots: Vec::new(),
            row: Vec::new(),
            every,
            wait: 0,
            skipped: None,
            last: Vec::new(),
            signals: Vec::new(),
            rows: 0,
        }
    }
}

impl Thinned<'_> {
    /// Goes on as after that number of rows.
    #[must_use]
    pub fn after(mut self, rows: u64) -> Self {
        self.wait = (self.every - rows % self.every) % self.every;
        self
    }

    fn record(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.rows += 1;
        if self.selection.is_none() {
            return self.inner.row(time, values);
        }
        for (value, (slot, change)) in self.row.iter_mut().zip(&self.slots) {
            *value = change.apply(values[*slot]);
        }
        self.inner.row(time, &self.row)
    }
}

impl Recorder for Thinned<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.last = vec![f64::NAN; signals.len()];
        let Some(selection) = &self.selection else {
            self.signals = signals.to_vec();
            return self.inner.begin(signals);
        };
        let slots: HashMap<&str, usize> = (signals.iter().enumerate())
            .map(|(slot, signal)| (signal.name.as_str(), slot))
            .collect();
        // Every selected signal is an output or observed, so the run contains it.
        let (chosen, found): (Vec<Signal>, Vec<(usize, Change)>) = (selection.chosen.iter())
            .filter_map(|chosen| {
                let slot = *slots.get(chosen.source.as_str())?;
                Some((chosen.signal.clone(), (slot, chosen.change.clone())))
            })
            .unzip();
        self.row = vec![0.0; found.len()];
        self.slots = found;
        self.signals = chosen;
        self.inner.begin(&self.signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        if self.wait > 0 {
            self.wait -= 1;
            self.skipped = Some(time);
            self.last.copy_from_slice(values);
            return Ok(());
        }
        self.wait = self.every - 1;
        self.skipped = None;
        self.record(time, values)
    }

    fn end_rows(&mut self) -> io::Result<()> {
        if let Some(time) = self.skipped.take() {
            let last = std::mem::take(&mut self.last);
            self.record(time, &last)?;
        }
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.inner.is_stop_asked()
    }
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn patterns() {
        for (pattern, name) in [
            ("pilot.stick", "pilot.stick"),
            ("pilot.*", "pilot.stick"),
            ("*", ""),
            ("*.z", "quadcopter.z"),
            ("*.x?", "pilot.x1"),
            ("a*b*c", "a.b.b.c"),
            ("*größe?", "x.größe1"),
            ("q[1]", "q[1]"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("pilot.*", "copilot.stick"),
            ("*.x?", "pilot.x"),
            ("a*b", "a.b.c"),
            ("", "a"),
            ("pilot", "pilot.stick"),
        ] {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
    }
}
