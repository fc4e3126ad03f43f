//! A table of signals over time as a component that feeds inputs.

use super::component::{
    Abilities, Component, ComponentError, Experiment, Linear, Progress, Role, Unit, Value,
    ValueKind, Variable,
};
use pilotage_linear::StateSpace;
use pilotage_series::{Column, Series};
use std::sync::Arc;
use thiserror::Error;

/// 2^63, beyond which a number is no 64-bit integer.
const TWO_TO_63: f64 = 9_223_372_036_854_775_808.0;

/// Why a table's column cannot feed an input.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SourceError {
    /// A column with missing samples only.
    #[error("column `{column}` has no samples")]
    Empty {
        /// The column.
        column: String,
    },
    /// Times that descend, or are no numbers.
    #[error(
        "the time {time} s follows {before} s; expected ascending times, equal ones where a value jumps"
    )]
    Order {
        /// A time \[s\].
        before: f64,
        /// The next one \[s\].
        time: f64,
    },
    /// An infinite sample, which cannot be interpolated linearly.
    #[error("column `{column}` is {value} at {time} s; expected finite numbers")]
    Infinite {
        /// The column.
        column: String,
        /// The sample.
        value: f64,
        /// Its time \[s\].
        time: f64,
    },
    /// A sample that is not a valid value of the input's type.
    #[error("column `{column}` is {value} at {time} s, which is no {kind}")]
    NotOfKind {
        /// The column.
        column: String,
        /// The sample.
        value: f64,
        /// Its time \[s\].
        time: f64,
        /// Type of the input to be fed.
        kind: ValueKind,
    },
    /// A table of numbers cannot provide text.
    #[error("column `{column}` holds numbers and cannot feed a String")]
    Text {
        /// The column.
        column: String,
    },
}

/// A table whose columns are outputs; a handle is a column's position.
///
/// Reals are interpolated linearly between samples; other types hold the last sample. A time in several rows is a jump:
/// from then on the last of these rows applies. Before the first and after the last sample of a column its value is
/// held.
///
/// Like any component, a table is sampled at communication points. [`next_jump`](Component::next_jump) reports its
/// jumps, so that a master that interpolates between communication points can reproduce them.
#[derive(Debug, Clone)]
pub struct Source {
    variables: Vec<Variable>,
    columns: Vec<Samples>,
    /// Times of jumps in any column, in increasing order.
    jumps: Vec<f64>,
    time: f64,
    saved: Vec<f64>,
}

/// The samples of one column without missing ones; columns without missing samples share their times.
#[derive(Debug, Clone, Default)]
struct Samples {
    times: Arc<Vec<f64>>,
    values: Vec<f64>,
    is_held: bool,
}

impl Source {
    /// A table whose columns are reals, in the units of its header. It takes over the values without copying: 8 bytes
    /// for each value and each time.
    ///
    /// # Errors
    /// If a column has no samples or an infinite one.
    pub fn new(series: Series) -> Result<Self, SourceError> {
        let mut source = Self {
            variables: Vec::new(),
            columns: Vec::new(),
            jumps: Vec::new(),
            time: series.time.first().copied().unwrap_or(0.0),
            saved: Vec::new(),
        };
        let is_wrong = |pair: &&[f64]| pair[0] > pair[1] || pair[0].is_nan() || pair[1].is_nan();
        if let Some(pair) = series.time.windows(2).find(is_wrong) {
            let (before, time) = (pair[0], pair[1]);
            return Err(SourceError::Order { before, time });
        }
        let times = Arc::new(series.time);
        for (column, handle) in series.columns.into_iter().zip(0..) {
            source.variables.push(Variable {
                unit: (!column.unit.is_empty()).then(|| Unit::named(&column.unit)),
                ..Variable::new(&column.name, handle, ValueKind::Real, Role::Output)
            });
            source.columns.push(samples(&times, column)?);
        }
        source.find_jumps();
        Ok(source)
    }

    fn find_jumps(&mut self) {
        self.jumps = self.columns.iter().flat_map(Samples::jumps).collect();
        self.jumps.sort_by(f64::total_cmp);
        self.jumps.dedup();
    }

    /// Converts a column to another type, whose values are held between samples.
    ///
    /// # Errors
    /// If a sample is not a valid value of that type.
    pub fn hold_as(&mut self, column: usize, kind: ValueKind) -> Result<(), SourceError> {
        let variable = &mut self.variables[column];
        let name = || variable.name.clone();
        let samples = &mut self.columns[column];
        let fits = |value: f64| match kind {
            ValueKind::Real => true,
            ValueKind::Integer | ValueKind::Enumeration => {
                value.fract() == 0.0 && (-TWO_TO_63..TWO_TO_63).contains(&value)
            }
            ValueKind::Boolean => value == 0.0 || value == 1.0,
            ValueKind::String => false,
        };
        if kind == ValueKind::String {
            return Err(SourceError::Text { column: name() });
        }
        if let Some(k) = samples.values.iter().position(|&value| !fits(value)) {
            return Err(SourceError::NotOfKind {
                column: name(),
                value: samples.values[k],
                time: samples.times[k],
                kind,
            });
        }
        samples.is_held = true;
        variable.kind = kind;
        variable.unit = variable.unit.take().filter(|_| kind == ValueKind::Real);
        self.find_jumps();
        Ok(())
    }

    fn value(&self, handle: u32) -> Result<f64, ComponentError> {
        match self.columns.get(handle as usize) {
            Some(samples) => Ok(samples.at(self.time)),
            None => Err(format!("there is no column {handle}").into()),
        }
    }
}

fn samples(times: &Arc<Vec<f64>>, column: Column) -> Result<Samples, SourceError> {
    if let Some(k) = column.values.iter().position(|value| value.is_infinite()) {
        return Err(SourceError::Infinite {
            value: column.values[k],
            time: times[k],
            column: column.name,
        });
    }
    let (times, values) = match column.values.iter().any(|value| value.is_nan()) {
        false => (times.clone(), column.values),
        true => {
            let all = times.iter().copied().zip(column.values);
            let (times, values) = all.filter(|(_, value)| !value.is_nan()).unzip();
            (Arc::new(times), values)
        }
    };
    match times.is_empty() {
        true => Err(SourceError::Empty {
            column: column.name,
        }),
        false => Ok(Samples {
            times,
            values,
            is_held: false,
        }),
    }
}

impl Samples {
    /// Times of discontinuities.
    fn jumps(&self) -> impl Iterator<Item = f64> {
        let pairs = self.times.windows(2).zip(self.values.windows(2));
        let jumping = pairs.filter(|(times, values)| {
            values[0] != values[1] && (self.is_held || times[0] == times[1])
        });
        jumping.map(|(times, _)| times[1])
    }

    /// The value at a time; at a jump the value after it.
    fn at(&self, time: f64) -> f64 {
        let next = self.times.partition_point(|&t| is_reached(t, time));
        let last = match next {
            0 => return self.values[0],
            next => next - 1,
        };
        if self.is_held || next == self.times.len() {
            return self.values[last];
        }
        let (t0, t1) = (self.times[last], self.times[next]);
        let part = ((time - t0) / (t1 - t0)).clamp(0.0, 1.0);
        self.values[last] + part * (self.values[next] - self.values[last])
    }
}

/// Whether `time` is at or after a sample. Communication points are counted and samples are decimals: 3 · 0.3 is
/// slightly less than 0.9 but means the same time.
pub(crate) fn is_reached(sample: f64, time: f64) -> bool {
    const ROUNDING: f64 = 4.0 * f64::EPSILON;
    sample <= time + ROUNDING * time.abs().max(sample.abs())
}

impl Component for Source {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        self.time = experiment.start;
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], _values: &[f64]) -> Result<(), ComponentError> {
        match handles.first() {
            Some(handle) => Err(format!("column {handle} cannot be set").into()),
            None => Ok(()),
        }
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        for (&handle, value) in handles.iter().zip(values) {
            *value = self.value(handle)?;
        }
        Ok(())
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        let value = self.value(handle)?;
        Ok(match kind {
            ValueKind::Real => Value::Real(value),
            ValueKind::Integer | ValueKind::Enumeration => Value::Integer(value as i64),
            ValueKind::Boolean => Value::Boolean(value != 0.0),
            ValueKind::String => return Err("a column of numbers has no text".into()),
        })
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.time = t + h;
        Ok(Progress::Done)
    }

    fn renew(&mut self) -> Result<bool, ComponentError> {
        self.saved.clear();
        Ok(true)
    }

    /// The state consists of a time only. Derivatives are not provided: they are not unique at corners, and without
    /// them the master's linear interpolation between communication points is what the table means.
    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            serialization: true,
            variable_steps: true,
            ..Abilities::default()
        }
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        let next = self.jumps.partition_point(|&jump| is_reached(jump, t));
        self.jumps.get(next).copied()
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        if self.saved.len() <= place {
            self.saved.resize(place + 1, self.time);
        }
        self.saved[place] = self.time;
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        match self.saved.get(place) {
            Some(&time) => self.time = time,
            None => return Err(format!("no time is saved in place {place}").into()),
        }
        Ok(())
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        Ok(self.time.to_le_bytes().to_vec())
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        self.time = f64::from_le_bytes(bytes.try_into()?);
        Ok(())
    }

    /// An empty system: what it feeds are external inputs.
    fn linearize(&mut self, _step: f64) -> Result<Linear, ComponentError> {
        Ok(StateSpace::empty().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of a column at these times.
    fn followed(csv: &str, kind: ValueKind, times: &[f64]) -> Vec<f64> {
        let after = csv.replace(' ', "\n");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.csv");
        std::fs::write(&path, after).unwrap();
        let series = Series::read_table(&path).unwrap();
        let mut source = Source::new(series).unwrap();
        if kind != ValueKind::Real {
            source.hold_as(0, kind).unwrap();
        }
        let at = |time: &f64| {
            source.step(*time, 0.0).unwrap();
            source.get(0, kind).unwrap().as_number()
        };
        times.iter().map(at).collect()
    }

    #[test]
    fn reals_go_along_straight_lines_and_jump_where_a_time_repeats() {
        let csv = "time,u 0,1 1,3 1,10 3, 4,7";
        let times = [-1.0, 0.0, 0.5, 1.0 - 1e-9, 1.0, 2.0, 4.0, 9.0];
        let found = followed(csv, ValueKind::Real, &times);
        let expected = [1.0, 1.0, 2.0, 3.0 - 2e-9, 10.0, 9.0, 7.0, 7.0];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn other_types_are_held() {
        let csv = "time,u 0,1 1,0 3,1";
        let times = [0.0, 0.9, 1.0, 2.9, 3.0];
        for kind in [
            ValueKind::Boolean,
            ValueKind::Integer,
            ValueKind::Enumeration,
        ] {
            assert_eq!(followed(csv, kind, &times), [1.0, 1.0, 0.0, 0.0, 1.0]);
        }
    }

    /// Communication points are `k·h`, samples are decimals: for none of these steps is a jump late.
    #[test]
    fn a_jump_at_a_communication_point_is_not_missed_by_rounding() {
        for (h, k) in [(0.3, 3), (0.1, 7), (0.05, 3), (0.7, 9), (0.001, 9_999)] {
            let decimal = format!("{:.3}", h * f64::from(k));
            let csv = format!("time,u 0,0 {decimal},0 {decimal},1");
            let times = [f64::from(k) * h, f64::from(k - 1) * h];
            assert_eq!(followed(&csv, ValueKind::Real, &times), [1.0, 0.0], "{h}");
        }
    }

    #[test]
    fn columns_that_do_not_fit() {
        let series = Series {
            texts: Vec::new(),
            note: None,
            time: vec![0.0, 2.0],
            columns: vec![
                Column {
                    name: "a".into(),
                    unit: String::new(),
                    values: vec![0.0, 2.5],
                },
                Column {
                    name: "b".into(),
                    unit: String::new(),
                    values: vec![f64::NAN; 2],
                },
            ],
            ..Series::default()
        };
        let message = Source::new(series.clone()).unwrap_err().to_string();
        assert_eq!(message, "column `b` has no samples");
        let mut infinite = series.clone();
        infinite.columns[0].values[1] = f64::NEG_INFINITY;
        let message = Source::new(infinite).unwrap_err().to_string();
        assert_eq!(
            message,
            "column `a` is -inf at 2 s; expected finite numbers"
        );
        let columns = series.columns[..1].to_vec();
        let mut source = Source::new(Series { columns, ..series }).unwrap();
        let refused = |source: &mut Source, kind| source.hold_as(0, kind).unwrap_err().to_string();
        assert_eq!(
            refused(&mut source, ValueKind::Integer),
            "column `a` is 2.5 at 2 s, which is no Integer"
        );
        assert_eq!(
            refused(&mut source, ValueKind::String),
            "column `a` holds numbers and cannot feed a String"
        );
    }
}
