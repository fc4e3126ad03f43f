//! The runs: their columns, inputs and sample times.

use crate::problem::error::ProblemError;
use crate::problem::file::{Change, Hold, ProblemFile, RunLine};
use crate::system::joint::{Joint, unknown};
use pilotage_cosim::description::Spanned;
use pilotage_series::{Series, SeriesError};
use pilotage_units::Unit;
use std::sync::Arc;

/// Maximum time from the start of a run to its first row, relative to the run's length.
const FARTHEST: f64 = 1000.0;
/// Maximum magnitude of a number: sums of squares of larger ones are infinite.
const LARGEST: f64 = 1e100;

/// Source of the values of an input.
#[derive(Debug, Clone)]
pub enum Source {
    /// A column of each run.
    Column {
        /// Its name.
        name: Spanned<String>,
        /// Unit of the input, if it has one.
        unit: Option<String>,
        /// Interpolation between samples.
        hold: Hold,
        /// Value of missing samples. If none, they are interpolated between their neighbours.
        missing: Option<f64>,
    },
    /// Time since the run began \[s\].
    Elapsed,
    /// 1 where a column of each run has a number, else 0.
    Presence(Spanned<String>),
    /// For each run, values and the times from which they hold. The first holds from the start.
    Given(Vec<Vec<(f64, f64)>>),
}

/// A run as read from its file.
#[derive(Debug, Clone)]
pub struct RunData<'f> {
    /// Its entry in the problem.
    pub line: &'f RunLine,
    /// Its columns.
    pub series: Arc<Series>,
    /// The unit of its times, in seconds.
    seconds: f64,
}

/// The samples of a run: its rows, and additional times at which something changes.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Inputs at each sample.
    pub inputs: Vec<Vec<f64>>,
    /// Row of the file for each sample, if it is one.
    pub rows: Vec<Option<usize>>,
}

/// An input over time: samples and their interpolation.
struct Signal {
    time: Vec<f64>,
    values: Vec<f64>,
    hold: Hold,
}

impl<'f> RunData<'f> {
    /// Reads a run, unless it has been read.
    ///
    /// # Errors
    /// When the file cannot be read, has a number that is infinite or too large to be squared, or begins before its start
    /// time.
    pub fn read(line: &'f RunLine) -> Result<Self, ProblemError> {
        let unread = |error| match error {
            SeriesError::Read { .. } => ProblemError::unread(Some(&line.place), &line.file, &error),
            other => other.into(),
        };
        let series = match &line.recorded {
            Some(series) => series.clone(),
            None => {
                let time = line.time_column.as_deref().unwrap_or("time");
                Arc::new(Series::read_table_with_time(&line.file, time).map_err(unread)?)
            }
        };
        let second = Unit::named("s");
        let seconds = Unit::named(&series.time_unit).conversion(&second);
        let own = Self {
            seconds: seconds.map_or(1.0, |seconds| seconds.factor),
            line,
            series,
        };
        own.check()?;
        Ok(own)
    }

    /// Rejects infinite numbers, and times outside the run.
    fn check(&self) -> Result<(), ProblemError> {
        let Self { line, series, .. } = self;
        let file = line.file.display();
        for column in &series.columns {
            let mut values = column.values.iter();
            if let Some(k) = values.position(|value| value.abs() > LARGEST) {
                let fault = format!(
                    "{file}: `{}` is {:e} at {} s; expected a number of magnitude {LARGEST:e} or less, or an empty cell",
                    column.name, column.values[k], series.time[k]
                );
                return Err(ProblemError::at(&line.place, fault));
            }
        }
        let first = series.time[0];
        let last = series.time[series.time.len() - 1];
        let begin = self.begin();
        let shown = |time: f64| self.shown(time);
        let fault = match () {
            () if begin > first => Some(format!(
                "{file} begins at {}, before start_time = {}; begin no later",
                shown(first),
                shown(begin)
            )),
            () if first - begin > FARTHEST * (last - first) => Some(format!(
                "start_time = {} is more than {FARTHEST} times the run's length before its first row at {}; begin later",
                shown(begin),
                shown(first)
            )),
            () => None,
        };
        if let (Some(fault), Some(start)) = (fault, &line.start_time) {
            return Err(ProblemError::maybe_at(start.place.as_ref(), fault));
        }
        if last <= begin {
            let begin = shown(begin);
            let fault = format!("{file} has no sample after {begin}; a run lasts some time");
            return Err(ProblemError::at(&line.place, fault));
        }
        let is_out = |(time, _): &(f64, &Change)| *time < begin || *time >= last;
        if let Some((time, change)) = self.changes().find(is_out) {
            let fault = format!(
                "a change at {} is not within {file}, from {} to before {}",
                shown(time),
                shown(begin),
                shown(last)
            );
            return Err(ProblemError::at(&change.place, fault));
        }
        Ok(())
    }

    /// Its name.
    pub fn name(&self) -> String {
        self.line.name.clone()
    }

    /// A time \[s\] in the unit of the file.
    pub fn shown(&self, time: f64) -> String {
        let unit = match self.series.time_unit.as_str() {
            "" => "s",
            unit => unit,
        };
        let own = time / self.seconds;
        // Rounds away the error of a conversion to seconds and back.
        let rounded: f64 = format!("{own:.12e}").parse().unwrap_or(own);
        format!("{rounded} {unit}")
    }

    /// The changes within it, and their times \[s\].
    pub fn changes(&self) -> impl Iterator<Item = (f64, &'f Change)> {
        let seconds = self.seconds;
        let changes = self.line.changes.iter();
        changes.map(move |change| (change.time * seconds, change))
    }

    /// Its start time \[s\].
    pub fn begin(&self) -> f64 {
        let start = self.line.start_time.as_ref();
        start.map_or(self.series.time[0], |start| start.value * self.seconds)
    }

    /// Mean of a column's samples at the start time. None if it has none there.
    pub fn at_begin(&self, values: &[f64]) -> Option<f64> {
        let begin = self.begin();
        let rows = self.series.time.iter().zip(values);
        let there = rows.filter(|(time, value)| **time == begin && value.is_finite());
        let there: Vec<f64> = there.map(|(_, value)| *value).collect();
        (!there.is_empty()).then(|| there.iter().sum::<f64>() / there.len() as f64)
    }

    /// Its end time \[s\].
    pub fn end(&self) -> f64 {
        self.series.time[self.series.time.len() - 1]
    }

    /// A column, converted to a unit.
    ///
    /// # Errors
    /// When it does not exist, or its unit is incompatible.
    pub fn column(
        &self,
        name: &Spanned<String>,
        unit: Option<&str>,
    ) -> Result<Vec<f64>, ProblemError> {
        let fault = |text: String| ProblemError::maybe_at(name.place.as_ref(), text);
        let file = self.line.file.display();
        if let Some(text) = self.series.text(&name.value) {
            return Err(text.error(&file.to_string()).into());
        }
        let column = self.series.column(&name.value).ok_or_else(|| {
            let known: Vec<String> = self
                .series
                .columns
                .iter()
                .map(|own| own.name.clone())
                .collect();
            fault(format!(
                "{file}: {}",
                unknown("column", &name.value, &known)
            ))
        })?;
        let wanted = match unit {
            Some(unit) if !column.unit.is_empty() => unit,
            _ => return Ok(column.values.clone()),
        };
        let conversion = Unit::named(&column.unit).conversion(&Unit::named(wanted));
        let conversion = conversion.ok_or_else(|| {
            fault(format!(
                "{file}: the column `{}` is in {}; expected a unit of {wanted}",
                column.name, column.unit
            ))
        })?;
        Ok(column
            .values
            .iter()
            .map(|value| conversion.apply(*value))
            .collect())
    }

    /// The samples with these inputs. `run` is the number of the run.
    ///
    /// # Errors
    /// When a column is missing.
    pub fn rows(&self, run: usize, sources: &[Source]) -> Result<Rows, ProblemError> {
        let signals: Vec<Signal> = (sources.iter())
            .map(|source| self.signal(run, source))
            .collect::<Result<_, _>>()?;
        let mut times: Vec<f64> = self.series.time.clone();
        times.push(self.begin());
        times.extend(self.changes().map(|(time, _)| time));
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut found = Rows {
            time: Vec::new(),
            inputs: Vec::new(),
            rows: Vec::new(),
        };
        let mut push = |time: f64, row: Option<usize>, inputs: Vec<f64>| {
            found.time.push(time);
            found.rows.push(row);
            found.inputs.push(inputs);
        };
        for time in times {
            let own = |signal: &Signal, row: usize| signal.at_row(time, row, &self.series.time);
            let before: Vec<f64> = signals.iter().map(|signal| signal.before(time)).collect();
            let after: Vec<f64> = signals.iter().map(|signal| signal.after(time)).collect();
            let first = self.series.time.partition_point(|t| *t < time);
            let end = self.series.time.partition_point(|t| *t <= time);
            if before != after && time > self.begin() {
                push(time, None, before);
            }
            for row in first..end {
                let inputs = signals.iter().map(|signal| own(signal, row)).collect();
                push(time, Some(row), inputs);
            }
            if first == end {
                push(time, None, after);
            }
        }
        Ok(found)
    }

    fn signal(&self, run: usize, source: &Source) -> Result<Signal, ProblemError> {
        match source {
            Source::Elapsed => Ok(Signal {
                time: vec![self.begin(), self.end()],
                values: vec![0.0, self.end() - self.begin()],
                hold: Hold::Linear,
            }),
            Source::Given(values) => Ok(Signal {
                time: values[run].iter().map(|(time, _)| *time).collect(),
                values: values[run].iter().map(|(_, value)| *value).collect(),
                hold: Hold::Zero,
            }),
            Source::Presence(name) => {
                let values = self.column(name, None)?;
                Ok(Signal {
                    time: self.series.time.clone(),
                    values: values
                        .iter()
                        .map(|value| f64::from(!value.is_nan()))
                        .collect(),
                    hold: Hold::Linear,
                })
            }
            Source::Column {
                name,
                unit,
                hold,
                missing,
            } => {
                let values = self.column(name, unit.as_deref())?;
                let samples = self.series.time.iter().copied().zip(values);
                let kept = |(time, value): (f64, f64)| match (value.is_nan(), missing) {
                    (true, None) => None,
                    (true, Some(missing)) => Some((time, *missing)),
                    (false, _) => Some((time, value)),
                };
                let (time, values): (Vec<f64>, Vec<f64>) = samples.filter_map(kept).unzip();
                if time.is_empty() {
                    let fault = format!(
                        "{}: the column `{}` has no number",
                        self.line.file.display(),
                        name.value
                    );
                    return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
                }
                // A held column that hardly ever keeps its value does not do so in a gap either.
                let moves = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
                let is_held = *hold == Hold::Zero;
                let gap = gap(&self.series.time, &time).filter(|_| missing.is_none());
                if let Some([from, to]) = gap.filter(|_| !is_held || 2 * moves > values.len()) {
                    let or = match is_held {
                        true => ", and it seldom keeps its value elsewhere",
                        false => ", or write hold = \"zero-order\" where it keeps its last value",
                    };
                    let fault = format!(
                        "{}: the column `{}` is empty from {from} to {to} s, and an input is needed all the time; fill it, \
                         end the run before or begin it after{or}",
                        self.line.file.display(),
                        name.value
                    );
                    return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
                }
                Ok(Signal {
                    time,
                    values,
                    hold: *hold,
                })
            }
        }
    }
}

/// Where a column has no samples for much longer than its usual spacing, so that interpolation would invent data. A
/// column recorded at a lower rate than others has empty cells but no such gap.
pub fn gap(rows: &[f64], known: &[f64]) -> Option<[f64; 2]> {
    const MUCH: f64 = 5.0;
    let (first, last) = (*rows.first()?, *rows.last()?);
    if rows.len() == known.len() {
        return None;
    }
    let mut steps: Vec<f64> = known.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let usual = *steps.get(steps.len() / 2)?;
    let ends = [first]
        .into_iter()
        .chain(known.iter().copied())
        .chain([last]);
    let ends: Vec<f64> = ends.collect();
    let longest = ends
        .windows(2)
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    (longest[1] - longest[0] > MUCH * usual).then_some([longest[0], longest[1]])
}

/// Values at these times. NaNs are replaced by linear interpolation between their neighbours.
pub fn filled(time: &[f64], values: &[f64]) -> Vec<f64> {
    let known = time.iter().zip(values).filter(|(_, value)| !value.is_nan());
    let (times, known) = known.unzip();
    let signal = Signal {
        time: times,
        values: known,
        hold: Hold::Linear,
    };
    let own = |(time, value): (&f64, &f64)| match value.is_nan() {
        true => signal.after(*time),
        false => *value,
    };
    time.iter().zip(values).map(own).collect()
}

impl Signal {
    /// Just before a time.
    fn before(&self, time: f64) -> f64 {
        self.between(self.time.partition_point(|t| *t < time), time)
    }

    /// At a time and just after it.
    fn after(&self, time: f64) -> f64 {
        self.between(self.time.partition_point(|t| *t <= time), time)
    }

    /// In a row of the file: rows with equal times have separate values.
    fn at_row(&self, time: f64, row: usize, times: &[f64]) -> f64 {
        let all_there = self.time.len() == times.len();
        match all_there && self.time[row] == time {
            true => self.values[row],
            false => self.after(time),
        }
    }

    /// Between the sample `next` and the one before it.
    fn between(&self, next: usize, time: f64) -> f64 {
        let (from, to) = (next.saturating_sub(1), next.min(self.time.len() - 1));
        let span = self.time[to] - self.time[from];
        if self.hold == Hold::Zero || span <= 0.0 {
            return self.values[from];
        }
        let part = ((time - self.time[from]) / span).clamp(0.0, 1.0);
        // Exact at both ends: a rounding error would act as a jump.
        (1.0 - part) * self.values[from] + part * self.values[to]
    }
}

/// Rejects runs in which an FMU has a time event.
pub(crate) fn check_times(
    file: &ProblemFile,
    joint: &Joint,
    data: &[RunData<'_>],
) -> Result<(), ProblemError> {
    for (instance, part) in &joint.parts {
        let Some((fmu, event)) = part
            .fmu
            .as_ref()
            .and_then(|fmu| Some((fmu, fmu.next_event?)))
        else {
            continue;
        };
        if let Some(run) = data.iter().find(|run| run.end() > event) {
            let source = file
                .system
                .instances
                .iter()
                .find(|own| own.name == *instance);
            let place = source.and_then(|own| own.source.place.as_ref());
            let fault = format!(
                "{} has an event at {event} s, and {} goes on to {} s; a fit takes equations without events: cut the \
                 runs there",
                fmu.path.display(),
                run.name(),
                run.end()
            );
            return Err(ProblemError::maybe_at(place, fault));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{filled, gap};

    #[test]
    fn gaps_are_lines_between_their_neighbours_and_constant_at_the_ends() {
        let (time, none) = ([0.0, 1.0, 3.0, 5.0, 6.0], f64::NAN);
        let known = [none, 2.0, none, -1.0, none];
        assert_eq!(filled(&time, &known), [2.0, 2.0, 0.5, -1.0, -1.0]);
    }

    #[test]
    fn a_gap_is_much_longer_than_what_is_usual() {
        let rows: Vec<f64> = (0..=300).map(|k| 0.1 * f64::from(k)).collect();
        let kept = |is_kept: &dyn Fn(usize) -> bool| -> Vec<f64> {
            (0..=300).filter(|k| is_kept(*k)).map(|k| rows[k]).collect()
        };
        // All samples, every third, and single samples lost.
        assert_eq!(gap(&rows, &rows), None);
        assert_eq!(gap(&rows, &kept(&|k| k % 3 == 0)), None);
        assert_eq!(gap(&rows, &kept(&|k| k % 50 != 7)), None);
        assert_eq!(
            gap(&rows, &kept(&|k| !(100..200).contains(&k))),
            Some([rows[99], rows[200]])
        );
        assert_eq!(gap(&rows, &kept(&|k| k >= 20)), Some([0.0, rows[20]]));
        assert_eq!(gap(&rows, &kept(&|k| k < 250)), Some([rows[249], 30.0]));
    }
}
