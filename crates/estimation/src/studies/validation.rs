//! Validation: prediction of runs that were not fitted.

use crate::fit::{Observer, fit};
use crate::posed::unknowns::calibration;
use crate::posed::{Open, Posed};
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Noise, Per, ProblemFile, RunLine, Set, Sought};
use crate::result::{Fit, Found, RunFit};
use crate::search::begin::flown;
use crate::search::starts::given;
use pilotage_cosim::description::Spanned;
use pilotage_language::file::Formula;
use pilotage_sqp::Status;
use std::ops::ControlFlow;

/// Called repeatedly and asked whether to continue.
pub type GoesOn<'a> = dyn Fn() -> ControlFlow<Status> + Sync + 'a;

/// Penalty for an initial state that is estimated from the run that it is to predict. As in Akaike's criterion, it is
/// the expected gain in −2 log-likelihood, once for the fit to these data and once for others.
const ESTIMATED: f64 = 2.0;

/// A run that was not fitted.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The run, with the parameters estimated from others.
    pub run: RunFit,
    /// Its free initial states, estimated from the run itself with all parameters held.
    pub initial: Vec<Found>,
    /// Parameters per subject with the mean of the other subjects, since no fitted run has the subject of this one.
    pub averaged: Vec<String>,
    /// False if that estimate has not converged. The run then has no figures.
    pub is_answer: bool,
}

impl Judged {
    /// −2 log-likelihood of the recording, plus 2 for each initial state estimated from it; NaN if that estimate has
    /// not converged.
    pub fn surprise(&self, noises: &[Noise]) -> f64 {
        match self.is_answer {
            true => self.run.surprise(noises) + ESTIMATED * self.initial.len() as f64,
            false => f64::NAN,
        }
    }
}

/// The validation runs of a problem. Parameters have their fitted values, those per subject in the subject's runs. A
/// parameter per run has the mean of the fitted runs, and one per subject that of the subjects where no fitted run has the run's. Free initial states are estimated from the run with all
/// parameters held; without free ones the run is simulated.
///
/// # Errors
/// When a run cannot be read or is inconsistent with the problem.
pub fn validated(
    file: &ProblemFile,
    found: &Fit,
    open: Open<'_>,
    goes_on: &GoesOn<'_>,
) -> Result<Vec<Judged>, ProblemError> {
    if file.runs.iter().all(|run| run.fits) {
        return Ok(Vec::new());
    }
    let predicted = file.runs.iter().filter(|run| !run.fits);
    let averaged: Vec<Vec<String>> = predicted.map(|run| averaged(file, found, run)).collect();
    let file = fixed(file, found);
    let posed = Posed::new(&file, open)?;
    let is_simulated = (posed.runs.iter()).all(|run| run.initial.iter().all(Option::is_some));
    let judged: Vec<Judged> = match is_simulated {
        true => simulated(&posed),
        false => (0..file.runs.len())
            .map(|own| {
                let mut file = file.clone();
                file.runs = vec![file.runs.swap_remove(own)];
                estimated(&Posed::new(&file, open)?, goes_on)
            })
            .collect::<Result<_, _>>()?,
    };
    let all = judged.into_iter().zip(averaged);
    Ok(all
        .map(|(own, averaged)| Judged { averaged, ..own })
        .collect())
}

/// Names of the parameters per subject that no fitted run determines for the subject of this run.
fn averaged(file: &ProblemFile, fit: &Fit, run: &RunLine) -> Vec<String> {
    let is_known = |name: &str| {
        let fitted = file.runs.iter().filter(|other| other.fits);
        let mut own = fitted.filter(|other| other.subject == run.subject);
        run.subject.is_some() && own.any(|other| !other.is_set(name))
    };
    let names = (fit.parameters.iter())
        .filter(|found| found.per == Per::Subject)
        .map(|found| &found.name);
    names
        .filter(|name| !run.is_set(name) && !is_known(name))
        .cloned()
        .collect()
}

/// Simulates runs without unknowns.
fn simulated(posed: &Posed<'_>) -> Vec<Judged> {
    let ((problem, z), _) = flown(posed, &given(posed));
    let judged = |run: RunFit| Judged {
        run,
        initial: Vec::new(),
        averaged: Vec::new(),
        is_answer: true,
    };
    Fit::runs(posed, &problem, &z)
        .into_iter()
        .map(judged)
        .collect()
}

/// Estimates the initial states of a single run.
fn estimated(posed: &Posed<'_>, goes_on: &GoesOn<'_>) -> Result<Judged, ProblemError> {
    let observer: &mut Observer<'_> = &mut |_| goes_on();
    let mut found = fit(posed, observer);
    let is_free = |own: &Found| posed.free_states().any(|state| *state == own.name);
    let initial = found.initial(posed).into_iter().filter(is_free).collect();
    Ok(Judged {
        initial,
        averaged: Vec::new(),
        is_answer: found.is_answer(),
        run: found.runs.swap_remove(0),
    })
}

/// The problem of the validation runs, in which no parameter is sought.
fn fixed(file: &ProblemFile, fit: &Fit) -> ProblemFile {
    let mut file = file.clone();
    file.runs.retain(|run| !run.fits);
    file.stability = Default::default();
    (file.options.starts, file.options.covariance) = (Some(1), None);
    for run in &mut file.runs {
        run.fits = true;
    }
    // Parameters that were not sought remain unchanged.
    let is_name = |line: &Sought| !line.name.value.ends_with(".*");
    file.parameters
        .retain(|line| line.fixed || (is_name(line) && line.value.is_some()));
    for found in fit.parameters.iter().filter(|found| !found.is_tied) {
        hold(&mut file, found);
        for run in &mut file.runs {
            set_subject(run, found);
        }
    }
    file
}

/// Fixes a parameter at its estimate.
pub(crate) fn hold(file: &mut ProblemFile, found: &Found) {
    match sensor(file, &found.name) {
        Some((measured, what)) => {
            let value = Calibration::Found(found.mean());
            match what {
                "gain" => file.measured[measured].gain = value,
                _ => file.measured[measured].offset = value,
            }
        }
        None => {
            let is_other = |own: &Sought| own.name.value != found.name;
            file.parameters.retain(is_other);
            file.parameters.push(line(found));
        }
    }
}

/// The measured signal and the sensor quantity (gain or offset) that a name refers to.
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

/// The line of a parameter fixed at its estimate.
fn line(found: &Found) -> Sought {
    let is_own = !found.name.contains('.');
    Sought {
        name: Spanned::from(found.name.clone()),
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

/// Sets a parameter to the value of the run's subject.
fn set_subject(run: &mut RunLine, found: &Found) {
    let is_own = |(label, _): &&(Option<String>, f64)| label.is_some() && *label == run.subject;
    let own = found.values.iter().find(is_own);
    if let Some((_, value)) = own.filter(|_| !run.is_set(&found.name)) {
        run.set.push(Set {
            name: Spanned::from(found.name.clone()),
            value: Formula::of_number(*value),
        });
    }
}
