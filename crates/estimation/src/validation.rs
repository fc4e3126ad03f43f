//! Runs that were not fitted: simulated with what was found, from initial states that are sought where they are free.

use crate::error::ProblemError;
use crate::file::{Calibration, Per, ProblemFile, RunLine, Set, Sought};
use crate::fit::{begin, fit};
use crate::posed::{Open, Posed};
use crate::result::{Fit, Found, RunFit};
use crate::starts::given;
use crate::unknowns::calibration;
use pilotage_cosim::description::Said;
use pilotage_language::file::Formula;
use std::ops::ControlFlow;

/// The validation runs of a problem, simulated. Parameters have their fitted values, those of a subject in its runs; one
/// for each run has the mean of the fitted runs. Free initial states belong to what was before a run, of which the model
/// says nothing: they are sought so that the run is met best, with all else held. Where that search does not converge they
/// are at the first measurement or the model's start value.
///
/// # Errors
/// When a run cannot be read or does not fit the problem.
pub fn validated(
    file: &ProblemFile,
    found: &Fit,
    open: Open<'_>,
) -> Result<Vec<RunFit>, ProblemError> {
    if file.runs.iter().all(|run| run.fits) {
        return Ok(Vec::new());
    }
    let file = fixed(file, found);
    let posed = Posed::new(&file, open)?;
    let begun = match free_initial(&posed) {
        0 => None,
        _ => Some(fit(&posed, &mut |_| ControlFlow::Continue(()))).filter(Fit::is_answer),
    };
    Ok(match begun {
        Some(begun) => begun.runs,
        None => {
            let (problem, z) = begin(&posed, &given(&posed), &|| false);
            Fit::runs(&posed, &problem, &z)
        }
    })
}

/// Number of free initial states of all runs.
pub(crate) fn free_initial(posed: &Posed<'_>) -> usize {
    let known = posed.runs.iter().flat_map(|run| &run.initial);
    known.filter(|known| known.is_none()).count()
}

/// The problem of the validation runs, in which initial states alone are sought.
fn fixed(file: &ProblemFile, fit: &Fit) -> ProblemFile {
    let mut file = file.clone();
    file.options.starts = 1;
    file.runs.retain(|run| !run.fits);
    file.stability = Default::default();
    for run in &mut file.runs {
        run.fits = true;
    }
    let is_name = |line: &Sought| !line.name.value.ends_with(".*");
    file.parameters
        .retain(|line| is_name(line) && line.value.is_some());
    for found in fit.parameters.iter().filter(|found| !found.is_tied) {
        if let Some((measured, what)) = sensor(&file, &found.name) {
            let formula = Calibration::Formula(Formula::of_number(found.mean()));
            match what {
                "gain" => file.measured[measured].gain = formula,
                _ => file.measured[measured].offset = formula,
            }
            continue;
        }
        file.parameters.push(line(found));
        for run in &mut file.runs {
            set_subject(run, found);
        }
    }
    file
}

/// The measured signal whose gain or offset a name means.
fn sensor(file: &ProblemFile, name: &str) -> Option<(usize, &'static str)> {
    let of = |what: &'static str| {
        let is_it = |column: &str| calibration(what, column) == name;
        let place = file
            .measured
            .iter()
            .position(|own| is_it(&own.column.value));
        place.map(|place| (place, what))
    };
    of("gain").or_else(|| of("offset"))
}

/// The line of a parameter that keeps what was found.
fn line(found: &Found) -> Sought {
    let is_own = !found.name.contains('.');
    Sought {
        name: Said::from(found.name.clone()),
        start: Some(found.mean()),
        min: None,
        max: None,
        nominal: None,
        unit: found.unit.clone().filter(|_| is_own),
        fixed: true,
        value: None,
        per: Per::All,
        log: false,
        prior: None,
    }
}

/// A run has the value of its subject.
fn set_subject(run: &mut RunLine, found: &Found) {
    let is_own = |(label, _): &&(Option<String>, f64)| label.is_some() && *label == run.subject;
    let is_set = run.set.iter().any(|set| set.name.value == found.name);
    if let Some((_, value)) = found.values.iter().find(is_own).filter(|_| !is_set) {
        run.set.push(Set {
            name: Said::from(found.name.clone()),
            value: Formula::of_number(*value),
        });
    }
}
