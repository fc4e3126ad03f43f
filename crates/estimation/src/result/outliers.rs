//! Outlying samples and runs in the residuals of a fit.

use crate::posed::Posed;
use crate::problem::file::Noise;
use crate::result::diagnostic::Diagnostic;
use crate::result::{Fit, RunFit};
use pilotage_inference::outliers::{
    Breaks, Frozen, Kind, Values, clipped, error_of_repeats, frozen, misfit, of_fresh, resolution,
    rows_per_value,
};
use pilotage_inference::statistics::{range, rms};
use pilotage_inference::timing::{Response, late};

/// Repeated values matter if they are off by this part of the residuals.
const SEEN: f64 = 0.2;

/// A recording stands still if the model moves meanwhile by this part of the change after it.
const MOVES: f64 = 0.3;

/// The stretches in which a measured signal keeps a value while the model moves, for each run.
pub fn still(fit: &Fit, k: usize) -> Vec<Vec<Frozen>> {
    fit.runs.iter().map(|run| stood_still(run, k)).collect()
}

/// Those of one run.
fn stood_still(run: &RunFit, k: usize) -> Vec<Frozen> {
    let (recorded, modelled) = (&run.recorded[k], &run.predicted[k]);
    let mut all = frozen(recorded);
    let all_modelled = range(modelled);
    all.retain(|own| {
        let [low, high] = range(&modelled[own.samples.clone()]);
        let missed = match (own.is_end, own.next) {
            (false, Some(next)) => (recorded[next] - recorded[own.samples.start]).abs(),
            _ => all_modelled[1] - all_modelled[0],
        };
        high - low > MOVES * missed
    });
    all
}

/// The longest stretch in which a measured signal stands still.
pub fn of_frozen(
    posed: &Posed<'_>,
    fit: &Fit,
    k: usize,
    still: &[Vec<Frozen>],
) -> Option<Diagnostic> {
    let mut all: Vec<(&RunFit, &Frozen)> = Vec::new();
    for (run, still) in fit.runs.iter().zip(still) {
        all.extend(still.iter().map(|own| (run, own)));
    }
    let count = all.len();
    let (run, own) = all.into_iter().max_by_key(|(_, own)| own.samples.len())?;
    let value = run.recorded[k][own.samples.start];
    Some(Diagnostic::Frozen {
        measured: posed.file.measured[k].column.value.clone(),
        run: run.name.clone(),
        value,
        from: run.time[own.samples.start],
        to: run.time[own.samples.end - 1],
        size: own.next.map(|next| run.recorded[k][next] - value),
        unit: posed.unit_of(k).map(str::to_owned),
        count,
    })
}

/// Outlying samples of a measured signal. For a distribution with long tails they are expected.
pub fn of_samples(
    posed: &Posed<'_>,
    fit: &Fit,
    k: usize,
    still: &[Vec<Frozen>],
) -> Vec<Diagnostic> {
    let measured = &posed.file.measured[k];
    if measured.noise.has_tails() {
        return Vec::new();
    }
    let unit = posed.unit_of(k).map(str::to_owned);
    let runs: Vec<Values> = fit
        .runs
        .iter()
        .map(|run| looked_at(run, k, measured.noise))
        .collect();
    let mut breaks = Breaks::of(&runs, Kind::Residuals);
    for (run, still) in still.iter().enumerate() {
        breaks.forget_after(run, still);
    }
    let of_run = |run: usize| (measured.column.value.clone(), fit.runs[run].name.clone());
    let square = |(run, sample): (usize, usize)| runs[run].values[sample].powi(2);
    let largest = (breaks.samples()).max_by(|a, b| square(*a).total_cmp(&square(*b)));
    let outlier = largest.map(|(run, sample)| {
        let (measured, name) = of_run(run);
        let all = runs.iter().flat_map(|own| &own.values);
        let total: f64 = all.filter(|z| z.is_finite()).map(|z| z * z).sum();
        Diagnostic::Outlier {
            measured,
            run: name,
            time: fit.runs[run].time[sample],
            value: missed(&fit.runs[run], k)[sample],
            unit: unit.clone(),
            count: breaks.samples().count(),
            share: breaks.samples().map(square).sum::<f64>() / total,
            is_fitted: true,
        }
    });
    let jump = breaks.jump().map(|(run, sample, _)| {
        let (measured, name) = of_run(run);
        let missed = missed(&fit.runs[run], k);
        let before = missed[..sample].iter().rfind(|own| own.is_finite());
        Diagnostic::Jump {
            measured,
            run: name,
            time: fit.runs[run].time[sample],
            size: missed[sample] - before.copied().unwrap_or(0.0),
            unit: unit.clone(),
        }
    });
    outlier.into_iter().chain(jump).collect()
}

/// The run in which a measured signal is fitted worst, if it is far worse than in the others.
pub fn of_runs(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    let measured = &posed.file.measured[k];
    let has_some = |run: &&RunFit| run.recorded[k].iter().any(|y| y.is_finite());
    let runs: Vec<&RunFit> = fit.runs.iter().filter(has_some).collect();
    let rms: Vec<f64> = (runs.iter())
        .map(|run| rms(&run.residuals(k, measured.noise)))
        .collect();
    let tasks: Vec<f64> = runs.iter().map(|run| variation(run, k)).collect();
    let (run, ratio) = misfit(&rms, &tasks)?;
    Some(Diagnostic::Misfit {
        measured: measured.column.value.clone(),
        run: runs[run].name.clone(),
        ratio,
    })
}

/// A run whose measured signal most rows repeat, if the repeated values are off by a visible part of the residuals.
pub fn of_repeats(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    let slow = |run: &RunFit| {
        let rows = rows_per_value(&run.recorded[k])?;
        let error = error_of_repeats(&run.time, &run.recorded[k]);
        (error > SEEN * rms(&missed(run, k))).then(|| Diagnostic::SlowSensor {
            measured: posed.file.measured[k].column.value.clone(),
            run: run.name.clone(),
            rows,
        })
    };
    fit.runs.iter().find_map(slow)
}

/// The run in which a measured signal comes later or earlier than in the others. Not in loops: a pilot acts otherwise in each
/// run, and the response is as early or late for it.
pub fn of_times(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    if !fit.cuts.is_empty() {
        return None;
    }
    let runs = fit.runs.iter().map(|run| Response {
        time: &run.time,
        recorded: &run.recorded[k],
        modelled: &run.predicted[k],
    });
    let (run, by) = late(&runs.collect::<Vec<_>>())?;
    Some(Diagnostic::Late {
        measured: posed.file.measured[k].column.value.clone(),
        run: fit.runs[run].name.clone(),
        by,
    })
}

/// A measured signal that stays at the ends of its range within a run.
pub fn of_ends(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    let of_run = |run: &RunFit| clipped(&run.recorded[k], Some(&run.predicted[k]));
    let most = fit.runs.iter().filter_map(|run| Some((run, of_run(run)?)));
    let (run, (part, value)) = most.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    Some(Diagnostic::Clipped {
        measured: posed.file.measured[k].column.value.clone(),
        run: run.name.clone(),
        value,
        unit: posed.unit_of(k).map(str::to_owned),
        part,
    })
}

/// The residuals of a measured signal, in standard deviations.
fn looked_at(run: &RunFit, k: usize, noise: Noise) -> Values {
    let of = |y: &f64, sd: &f64| match noise {
        Noise::LogNormal => y.ln() / sd,
        _ => y / sd,
    };
    let recorded = run.recorded[k].iter().zip(&run.deviations[k]);
    let recorded: Vec<f64> = recorded.map(|(y, sd)| of(y, sd)).collect();
    // Not the prediction of a filter, which follows a discontinuity of the recording.
    let modelled = run.predicted[k].iter().zip(&run.deviations[k]);
    Values {
        time: run.time.clone(),
        values: of_fresh(run.residuals(k, noise), &run.recorded[k]),
        resolution: resolution(&recorded),
        modelled: modelled.map(|(h, sd)| of(h, sd)).collect(),
    }
}

/// Recorded minus modelled, in the unit of the signal: the residuals before scaling.
fn missed(run: &RunFit, k: usize) -> Vec<f64> {
    let ahead = run.ahead.as_ref().map(|ahead| &ahead.predicted[k]);
    let samples = run.recorded[k]
        .iter()
        .zip(ahead.unwrap_or(&run.predicted[k]));
    samples.map(|(y, h)| y - h).collect()
}

/// Standard deviation of a recorded signal.
fn variation(run: &RunFit, k: usize) -> f64 {
    let known: Vec<f64> = run.recorded[k]
        .iter()
        .copied()
        .filter(|y| y.is_finite())
        .collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    rms(&known.iter().map(|y| y - mean).collect::<Vec<_>>())
}
