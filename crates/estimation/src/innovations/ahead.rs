//! Predictions of each sample of a run from the samples before it.

use super::likelihood::{Likelihood, MOST_PARTS, NEGLIGIBLE};
use crate::posed::Posed;
use pilotage_filter::{Course, Innovation};
use std::f64::consts::PI;

/// Predictions of a run and their innovations; NaN where nothing was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Ahead {
    /// Model output for each sensor at each sample, predicted from earlier samples, in the unit of its signal.
    pub predicted: Vec<Vec<f64>>,
    /// For each measured signal and sample, the innovation divided by its standard deviation. Within a sample, each
    /// signal is also predicted from the signals before it.
    pub innovations: Vec<Vec<f64>>,
    /// Standard deviations of the innovations, in the unit of the signal.
    pub deviations: Vec<Vec<f64>>,
}

/// The predictions of a run from these initial states. None if no noise drives the system.
pub(crate) fn ahead(posed: &Posed<'_>, j: usize, initial: &[f64], theta: &[f64]) -> Option<Ahead> {
    let mut likelihood = Likelihood::of(posed)?;
    let sum =
        |course: &Course<0>| -> f64 { course.innovations.iter().map(Innovation::surprise).sum() };
    let mut course = likelihood.from(j, initial, theta);
    while likelihood.parts < MOST_PARTS {
        likelihood = likelihood.doubled();
        let finer = likelihood.from(j, initial, theta);
        let change = sum(&finer) - sum(&course);
        course = finer;
        if change.is_nan() || change.abs() <= NEGLIGIBLE {
            break;
        }
    }
    let missing = || {
        course
            .predicted
            .iter()
            .map(|own| vec![f64::NAN; own.len()])
            .collect()
    };
    let (mut innovations, mut deviations): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (missing(), missing());
    for own in &course.innovations {
        innovations[own.signal][own.sample] = own.standardised();
        deviations[own.signal][own.sample] = own.variance.value.sqrt();
    }
    Some(Ahead {
        predicted: course.predicted,
        innovations,
        deviations,
    })
}

impl Ahead {
    /// −2 log-likelihood of the recording, including constants.
    pub fn surprise(&self) -> f64 {
        let values = self
            .innovations
            .iter()
            .flatten()
            .zip(self.deviations.iter().flatten());
        let known = values.filter(|(z, _)| z.is_finite());
        known
            .map(|(z, sd)| z * z + 2.0 * sd.ln() + (2.0 * PI).ln())
            .sum()
    }

    /// Sum of the squared innovations divided by their variances.
    pub fn chi2(&self) -> f64 {
        let all = self.innovations.iter().flatten();
        all.filter(|z| z.is_finite()).map(|z| z * z).sum()
    }
}
