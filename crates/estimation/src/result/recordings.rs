//! What the recordings of the runs themselves give to doubt: their times, and the columns that drive inputs.

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::problem::file::Hold;
use crate::result::Fit;
use crate::result::diagnostic::Diagnostic;
use pilotage_inference::outliers::{frozen, median};

/// A time without rows is a gap from this multiple of the usual step on, if most steps are within half of that.
const GAP: f64 = 10.0;
const REGULAR: f64 = 0.8;
/// Number of rows from which on a run has a usual step.
const ROWS: usize = 50;
/// Duration of a run below which it is too short for a task [s], and longest plausible time between samples [s].
const SHORT: f64 = 1.0;
const SPARSE: f64 = 2.0;
/// The instance that is a person.
pub const PILOT: &str = "pilot";

/// All of these diagnostics.
pub fn of_recordings(posed: &Posed<'_>, fit: &Fit) -> Vec<Diagnostic> {
    let all = [
        posed.data.iter().find_map(|run| frozen_input(posed, run)),
        posed.data.iter().find_map(|run| gap(posed, run)),
        time_scale(posed, fit),
    ];
    all.into_iter().flatten().collect()
}

/// The columns that drive inputs along lines.
fn lines<'p>(posed: &'p Posed<'_>) -> impl Iterator<Item = &'p str> {
    let inputs = posed.file.inputs.iter();
    let along = inputs.filter(|own| own.hold != Some(Hold::Zero));
    along.map(|own| own.column.value.as_str())
}

fn frozen_input(posed: &Posed<'_>, run: &RunData<'_>) -> Option<Diagnostic> {
    lines(posed).find_map(|column| {
        let values = &run.series.column(column)?.values;
        let mut all = frozen(values);
        all.retain(|own| !own.is_end);
        let own = all.into_iter().max_by_key(|own| own.samples.len())?;
        Some(Diagnostic::FrozenInput {
            column: column.to_owned(),
            run: run.name().to_owned(),
            from: run.series.time[own.samples.start],
            to: run.series.time[own.samples.end - 1],
        })
    })
}

/// A time without rows in a run that is sampled regularly else.
fn gap(posed: &Posed<'_>, run: &RunData<'_>) -> Option<Diagnostic> {
    let time = &run.series.time;
    let steps = || time.windows(2).map(|pair| pair[1] - pair[0]);
    let usual = median(steps())?;
    let regular = steps().filter(|step| (step - usual).abs() <= 0.5 * usual);
    let is_regular = time.len() >= ROWS && regular.count() as f64 >= REGULAR * time.len() as f64;
    lines(posed).next().filter(|_| is_regular)?;
    let longest = (time.windows(2)).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    (longest[1] - longest[0] > GAP * usual).then(|| Diagnostic::Gap {
        run: run.name().to_owned(),
        from: longest[0],
        to: longest[1],
    })
}

fn time_scale(posed: &Posed<'_>, fit: &Fit) -> Option<Diagnostic> {
    let is_flown = posed.joint.parts.iter().any(|(name, _)| name == PILOT);
    let duration = |time: &[f64]| time[time.len() - 1] - time[0];
    let runs = fit.runs.iter().filter(|run| run.time.len() > 1);
    let longest = runs.max_by(|a, b| duration(&a.time).total_cmp(&duration(&b.time)))?;
    let duration = duration(&longest.time);
    let step = median(longest.time.windows(2).map(|pair| pair[1] - pair[0]))?;
    let is_odd = duration < SHORT || step > SPARSE;
    (is_flown && !fit.cuts.is_empty() && is_odd).then_some(Diagnostic::TimeScale { duration, step })
}
