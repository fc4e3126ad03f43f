//! What the recordings of the runs themselves give to doubt: their times, and the columns that drive inputs.

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::problem::file::Hold;
use crate::result::diagnostic::Diagnostic;
use crate::result::{Fit, RunFit};
use pilotage_inference::outliers::frozen;
use pilotage_inference::sampling::{self, median_step, steps};
use pilotage_inference::statistics::rms;

/// A run is sampled regularly if this part of its steps is within half of the usual one.
const REGULAR: f64 = 0.8;
/// Number of rows from which on a run has a usual step.
const ROWS: usize = 50;
/// Ratio of residuals within a stretch to those outside that the stretch makes worse.
const WORSE: f64 = 1.5;
/// The instance that is a person.
pub const PILOT: &str = "pilot";

/// All of these diagnostics.
pub fn of_recordings(posed: &Posed<'_>, fit: &Fit) -> Vec<Diagnostic> {
    let all = [
        frozen_input(posed, fit),
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

/// The longest stretch in which an input stands still that moves before and afterwards, if a measured signal is fitted worse
/// there: else it may well have rested.
fn frozen_input(posed: &Posed<'_>, fit: &Fit) -> Option<Diagnostic> {
    let of_run = |(data, run): (&RunData<'_>, &RunFit)| {
        let of_column = |column: &str| {
            let time = &data.series.time;
            let mut all = frozen(&data.series.column(column)?.values);
            all.retain(|own| !own.is_end);
            let own = all.into_iter().max_by_key(|own| own.samples.len())?;
            let [from, to] = [own.samples.start, own.samples.end - 1].map(|k| time[k]);
            let is_worse = |k: usize| is_worse_within(posed, run, k, [from, to]);
            let is_doubted = (0..posed.file.measured.len()).any(is_worse);
            is_doubted.then(|| Diagnostic::FrozenInput {
                column: column.to_owned(),
                run: run.name.clone(),
                from,
                to,
            })
        };
        lines(posed).find_map(of_column)
    };
    posed.data.iter().zip(&fit.runs).find_map(of_run)
}

/// Whether the residuals of a measured signal are larger within these times than outside.
fn is_worse_within(posed: &Posed<'_>, run: &RunFit, k: usize, [from, to]: [f64; 2]) -> bool {
    let residuals = run.residuals(k, posed.file.measured[k].noise);
    let pairs = run.time.iter().zip(residuals);
    let (inside, outside): (Vec<_>, Vec<_>) = pairs.partition(|(t, _)| (from..=to).contains(*t));
    let size = |all: Vec<(&f64, f64)>| rms(&all.iter().map(|own| own.1).collect::<Vec<_>>());
    size(inside) > WORSE * size(outside)
}

/// A time without rows in a run that is sampled regularly else.
fn gap(posed: &Posed<'_>, run: &RunData<'_>) -> Option<Diagnostic> {
    let time = &run.series.time;
    let usual = median_step(time)?;
    let regular = steps(time).filter(|step| (step - usual).abs() <= 0.5 * usual);
    let is_regular = time.len() >= ROWS && regular.count() as f64 >= REGULAR * time.len() as f64;
    lines(posed).next().filter(|_| is_regular)?;
    let [from, to] = sampling::gap(time)?;
    Some(Diagnostic::Gap {
        run: run.name(),
        from,
        to,
    })
}

fn time_scale(posed: &Posed<'_>, fit: &Fit) -> Option<Diagnostic> {
    let is_flown = posed.joint.parts.iter().any(|(name, _)| name == PILOT);
    let runs = fit.runs.iter().map(|run| run.time.as_slice());
    let [duration, step] = sampling::time_scale(runs)?;
    let mut units = posed.data.iter().map(|run| &run.series.time_unit);
    (is_flown && !fit.cuts.is_empty()).then(|| Diagnostic::TimeScale {
        duration,
        step,
        is_stated: units.all(|unit| !unit.is_empty()),
    })
}
