//! Separate fits of each run, or of each subject's runs, to test whether the human is the same.

use crate::problem::error::ProblemError;
use crate::problem::file::{Deviation, ProblemFile, RunLine};
use crate::result::Fit;
use crate::studies::folds::{Ask, OpenInParallel, alone, each};
use nalgebra::{DMatrix, DVector};
use pilotage_inference::homogeneity::{Estimate, Homogeneity};
use pilotage_inference::{Class, Interval, Method};
use std::collections::HashSet;

/// Runs that were fitted separately.
#[derive(Debug)]
pub struct Group {
    /// The run, or the subject.
    pub name: String,
    /// Their fit.
    pub fit: Fit,
    /// Its estimate of the parameters of [`PerRun::names`], or the reason why it is not compared.
    pub estimate: Result<Estimate, String>,
    /// Their intervals, in the order of these names. Empty if the fit has none.
    pub intervals: Vec<Interval>,
}

/// All groups and their comparison.
#[derive(Debug)]
pub struct PerRun {
    /// Parameters that all runs share, in the coordinates of the search: `ln name` for a logarithmic scale.
    pub names: Vec<String>,
    /// The groups.
    pub groups: Vec<Group>,
    /// Test of whether all parameters are the same in all groups. None with fewer than two compared groups.
    pub together: Option<Homogeneity>,
    /// The same test for each parameter.
    pub each: Vec<Option<Homogeneity>>,
}

/// Fits each run alone, or the runs of each subject if runs have one, beginning at the fit to all. Covariances are
/// those of [`Method::Ar`], since the covariance of a single run requires a model of the noise.
///
/// # Errors
/// When a problem of some runs alone cannot be posed.
pub fn per_run(
    (file, whole): (&ProblemFile, &Fit),
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<PerRun, ProblemError> {
    let mut file = file.clone();
    file.options.covariance = Some(Method::Ar);
    let mut labels: Vec<&str> = Vec::new();
    for label in file.runs.iter().filter(|line| line.fits).map(label) {
        if !labels.contains(&label) {
            labels.push(label);
        }
    }
    let fits = each(&labels, (0, labels.len()), ask, |own, goes_on| {
        let is_own = |line: &RunLine| label(line) == *own;
        alone((&file, whole), is_own, open, goes_on)
    })?;
    let names = shared(whole);
    let groups = labels.iter().zip(fits).map(|(label, fit)| Group {
        name: (*label).to_owned(),
        estimate: estimate(&fit, &names),
        intervals: intervals(&fit, &names).unwrap_or_default(),
        fit,
    });
    let groups: Vec<Group> = groups.collect();
    let known: Vec<Estimate> = groups
        .iter()
        .filter_map(|own| own.estimate.clone().ok())
        .collect();
    let of = |k: usize| Homogeneity::of(&known.iter().map(|own| own.of(k)).collect::<Vec<_>>());
    // For a noise level the normal approximation is poor in a short run, and it is not part of the human's model.
    let levels = levels(&file);
    let is_compared = |k: &usize| !levels.contains(names[*k].trim_start_matches("ln "));
    let compared: Vec<usize> = (0..names.len()).filter(is_compared).collect();
    let together: Vec<Estimate> = known.iter().map(|own| own.of_all(&compared)).collect();
    Ok(PerRun {
        together: Homogeneity::of(&together).filter(|_| !compared.is_empty()),
        each: (0..names.len()).map(of).collect(),
        groups,
        names,
    })
}

/// Names that noise levels and densities depend on.
fn levels(file: &ProblemFile) -> HashSet<String> {
    let of_sensors = file.measured.iter().filter_map(|own| match &own.sd {
        Deviation::Formula(own) => Some(own),
        _ => None,
    });
    let formulas = of_sensors.chain(file.process_noise.iter().map(|own| &own.density));
    formulas
        .flat_map(|own| own.names().map(str::to_owned))
        .collect()
}

/// The subject of a run, or the run's name if it has none.
fn label(line: &RunLine) -> &str {
    line.subject.as_deref().unwrap_or(&line.name)
}

/// The parameters that a fit shares between all runs, in the coordinates of the search.
fn shared(whole: &Fit) -> Vec<String> {
    let is_shared = |name: &&String| place(whole, name).is_some();
    let known = whole.uncertainty.as_ref().ok();
    let names = known.into_iter().flat_map(|own| &own.names);
    names.filter(is_shared).cloned().collect()
}

/// Index of the parameter with one value for all runs that has this name in the search.
fn place(fit: &Fit, name: &str) -> Option<usize> {
    let plain = name.strip_prefix("ln ").unwrap_or(name);
    let is_it = |own: &crate::result::Found| own.name == plain && own.values.len() == 1;
    let found = fit.parameters.iter().position(is_it)?;
    fit.parameters[found].values[0].0.is_none().then_some(found)
}

/// The intervals of these parameters. None if the fit has none.
fn intervals(fit: &Fit, names: &[String]) -> Option<Vec<Interval>> {
    let own = fit.uncertainty.as_ref().ok()?;
    let of = |name: &String| own.intervals[place(fit, name)?].first().copied();
    names.iter().map(of).collect()
}

/// The estimate of these parameters by a fit, or the reason why it is not compared.
fn estimate(fit: &Fit, names: &[String]) -> Result<Estimate, String> {
    if !fit.is_answer() {
        return Err(format!("its fit has no answer ({})", fit.ending()));
    }
    let own = fit.uncertainty.as_ref().map_err(ToString::to_string)?;
    let intervals = intervals(fit, names).ok_or("it has other parameters")?;
    for (name, interval) in names.iter().zip(&intervals) {
        if interval.class == Class::OnBound {
            return Err(format!("`{name}` lies on its bound"));
        }
        if !interval.sd.is_finite() {
            return Err(format!("it does not determine `{name}`"));
        }
    }
    let places = names
        .iter()
        .map(|name| own.names.iter().position(|other| other == name));
    let places: Vec<usize> = places
        .collect::<Option<_>>()
        .ok_or("it has other parameters")?;
    let value = |name: &String| {
        let found = place(fit, name).map_or(f64::NAN, |k| fit.parameters[k].values[0].1);
        if name.starts_with("ln ") {
            found.ln()
        } else {
            found
        }
    };
    let (n, matrix) = (names.len(), &own.covariance.matrix);
    let degrees = places.iter().map(|k| own.covariance.degrees[*k]);
    Ok(Estimate {
        values: DVector::from_iterator(n, names.iter().map(value)),
        covariance: DMatrix::from_fn(n, n, |i, j| matrix[(places[i], places[j])]),
        degrees: degrees.fold(f64::INFINITY, f64::min),
    })
}
