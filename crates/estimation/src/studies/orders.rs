//! A problem with different orders of its linear model.

use crate::fit::{Observer, fit};
use crate::posed::Posed;
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Deviation, Initial, Per, ProblemFile, Quantity, Sought};
use crate::result::Fit;
use crate::studies::comparison::{Candidate, candidates};
use crate::studies::folds::{Ask, OpenInParallel, fitted};
use pilotage_cosim::description::{InstanceSource, Spanned};
use pilotage_language::file::Formula;
use pilotage_models::library;
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicBool, Ordering};

/// An added pole is this many times as fast as the geometric mean of the existing poles.
const FASTER: f64 = 3.0;
/// The added zero is faster than the added pole by this factor, so that the pole has an effect on the search.
const APART: f64 = 1.1;

/// A problem of one order, and its fit.
#[derive(Debug)]
pub struct Ordered {
    /// The order.
    pub order: u32,
    /// The problem, with start values at the result of the fit.
    pub file: ProblemFile,
    /// The fit, and how well it predicts runs that are left out.
    pub candidate: Candidate,
    /// Whether no fit was stopped: neither that to all runs nor one to the others.
    pub is_whole: bool,
}

/// Fits the problem with each of these orders of the only instance whose model has an order (`linear`). The transfer
/// function of each order begins at the previous solution, if there is one, with an added fast pole and a zero near it,
/// so that a larger order does not fit worse than a smaller one. Each order is fitted without each run too before the next
/// one. If `ask` stops a fit, higher orders are not fitted. `ask` is passed the number of completed fits and their total.
///
/// # Errors
/// When not exactly one instance has an order, or a coefficient has any setting beyond a plain search: coefficients of
/// another order have another meaning.
pub fn ordered(
    file: &ProblemFile,
    orders: RangeInclusive<u32>,
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<Vec<Ordered>, ProblemError> {
    let instance = instance(file)?;
    check(file, &instance)?;
    let fits = 1 + fitted(file).len();
    let total = orders.clone().count() * fits;
    let is_stopped = AtomicBool::new(false);
    let ask = |done: usize, total: usize| {
        let asked = ask(done, total);
        is_stopped.fetch_or(asked.is_break(), Ordering::Relaxed);
        asked
    };
    let mut all: Vec<Ordered> = Vec::new();
    for order in orders {
        let done = all.len() * fits;
        if ask(done, total).is_break() {
            break;
        }
        let before = all.last().map(|own| &own.candidate.fit);
        let before = before.filter(|own| own.is_answer());
        let start = before.map(|own| grown(&coefficients(own, &instance)));
        let mut file = with_order(file, &instance, order, start.as_deref());
        let candidate = {
            let posed = Posed::new(&file, open)?;
            let observer: &mut Observer<'_> = &mut |_| ask(done, total);
            let whole = fit(&posed, observer);
            candidates(vec![(&posed, whole)], (open, &ask), (done + 1, total))?.remove(0)
        };
        let is_answer = candidate.fit.is_answer();
        file.options.starts = 1;
        for line in &mut file.parameters {
            let own = candidate
                .fit
                .parameters
                .iter()
                .find(|own| own.name == line.name.value);
            if let Some(own) = own.filter(|own| is_answer && !own.is_tied) {
                line.start = Some(own.mean());
            }
        }
        all.push(Ordered {
            order,
            file,
            candidate,
            is_whole: !is_stopped.load(Ordering::Relaxed),
        });
    }
    Ok(all)
}

/// The only instance whose model has an order.
fn instance(file: &ProblemFile) -> Result<String, ProblemError> {
    let has_order = |source: &InstanceSource| match source {
        InstanceSource::BuiltIn(name) => library::find(name).is_some_and(|own| own.has_order),
        InstanceSource::Model(_) | InstanceSource::Table(_) => false,
    };
    let instances = file.system.instances.iter();
    let found: Vec<&String> = instances
        .filter(|own| has_order(&own.source.value))
        .map(|own| &own.name)
        .collect();
    match found[..] {
        [one] => Ok(one.clone()),
        ref all => Err(ProblemError::Part(format!(
            "{}: {} instances have a model with an order; one must have it, such as model = \"linear\"",
            file.file,
            all.len()
        ))),
    }
}

/// Rejects settings of a coefficient other than that it is sought.
fn check(file: &ProblemFile, instance: &str) -> Result<(), ProblemError> {
    let is_meant = |name: &str| number(name, instance).is_some();
    let fault = |name: &str| {
        format!(
            "`{name}` has another meaning in each order: where orders are compared it is free, without range, prior or other \
             settings"
        )
    };
    let is_special = |line: &&Sought| {
        let is_bounded = line.min.is_some() || line.max.is_some() || line.prior.is_some();
        is_bounded || line.fixed || line.value.is_some() || line.per != Per::All || line.log
    };
    let lines = file
        .parameters
        .iter()
        .filter(|line| is_meant(&line.name.value));
    if let Some(line) = lines.clone().find(is_special) {
        let name = &line.name;
        return Err(ProblemError::maybe_at(
            name.place.as_ref(),
            fault(&name.value),
        ));
    }
    for formula in formulas(file) {
        if let Some(name) = formula.names().find(|name| is_meant(name)) {
            return Err(ProblemError::at(&file.place(formula), fault(name)));
        }
    }
    let set = file.runs.iter().flat_map(|run| run.sets());
    match set.map(|set| &set.name).find(|name| is_meant(&name.value)) {
        Some(name) => Err(ProblemError::maybe_at(
            name.place.as_ref(),
            fault(&name.value),
        )),
        None => Ok(()),
    }
}

/// All expressions of a file.
fn formulas(file: &ProblemFile) -> Vec<&Formula> {
    let mut all: Vec<&Formula> = Vec::new();
    for own in &file.measured {
        if let Deviation::Formula(formula) = &own.sd {
            all.push(formula);
        }
        if let Quantity::Expression(formula, _) = &own.of {
            all.push(formula);
        }
        for calibrated in [&own.gain, &own.offset] {
            if let Calibration::Formula(formula) = calibrated {
                all.push(formula);
            }
        }
    }
    all.extend(file.process_noise.iter().map(|own| &own.density));
    all.extend(file.parameters.iter().filter_map(|own| own.value.as_ref()));
    all.extend(file.initial.iter().filter_map(|(_, own)| match own {
        Initial::Formula(formula) => Some(formula),
        Initial::Free | Initial::Steady | Initial::FirstSample => None,
    }));
    all.extend(file.constraints.iter().map(|own| &own.formula));
    all.extend(file.derived.iter().map(|(_, formula)| formula));
    all.extend(
        file.runs
            .iter()
            .flat_map(|run| run.sets())
            .map(|set| &set.value),
    );
    all
}

/// Number, from 1, of the coefficient of an instance with this name.
fn number(name: &str, instance: &str) -> Option<usize> {
    let own = name.strip_prefix(instance)?.strip_prefix(".theta")?;
    own.parse().ok()
}

/// The problem with another order. All coefficients are sought, from these values or those of the model.
fn with_order(
    file: &ProblemFile,
    instance: &str,
    order: u32,
    start: Option<&[f64]>,
) -> ProblemFile {
    let mut file = file.clone();
    let mut is_own = false;
    for own in file
        .system
        .instances
        .iter_mut()
        .filter(|own| own.name == instance)
    {
        is_own = own.order.as_ref().is_some_and(|own| own.value == order);
        own.order = Some(Spanned::from(order));
    }
    if is_own && start.is_none() {
        return file;
    }
    let lines = file.parameters.iter();
    let first = lines
        .clone()
        .position(|line| number(&line.name.value, instance).is_some());
    let first = first.unwrap_or(file.parameters.len());
    file.parameters
        .retain(|line| number(&line.name.value, instance).is_none());
    let lines = (0..2 * order as usize).map(|k| Sought {
        name: Spanned::from(format!("{instance}.theta{}", k + 1)),
        start: start.map(|start| start[k]),
        min: None,
        max: None,
        nominal: None,
        unit: None,
        fixed: false,
        value: None,
        per: Per::All,
        log: false,
        prior: None,
    });
    let place = first.min(file.parameters.len());
    file.parameters.splice(place..place, lines);
    file
}

/// The estimated coefficients: those of the denominator in ascending powers of s without the leading 1, then those of
/// the numerator.
fn coefficients(fit: &Fit, instance: &str) -> Vec<f64> {
    let found = fit.parameters.iter();
    let found = found.filter_map(|own| Some((number(&own.name, instance)?, own.mean())));
    let mut all: Vec<(usize, f64)> = found.collect();
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, value)| value).collect()
}

/// The coefficients of almost the same transfer function with one more pole and zero.
fn grown(theta: &[f64]) -> Vec<f64> {
    let order = theta.len() / 2;
    let (below, above) = theta.split_at(order);
    let size = below[0].abs().powf(1.0 / order as f64);
    let pole = FASTER * if size > 0.0 { size } else { 1.0 };
    // (s + a) times a polynomial with its leading coefficient last.
    let times = |own: &[f64], a: f64| -> Vec<f64> {
        let shifted = std::iter::once(0.0).chain(own.iter().copied());
        let scaled = own.iter().map(|c| a * c).chain(std::iter::once(0.0));
        scaled.zip(shifted).map(|(a, b)| a + b).collect()
    };
    let mut grown = times(&[below, &[1.0]].concat(), pole);
    grown.truncate(order + 1);
    let numerator = times(above, APART * pole);
    grown.extend(numerator.iter().map(|c| c / APART));
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1/(s + 2) becomes (s + 6.6)/1.1 / ((s + 2)(s + 6)), with the same static gain.
    #[test]
    fn a_grown_transfer_function_is_nearly_the_same() {
        let found = grown(&[2.0, 1.0]);
        let expected = [12.0, 8.0, 6.0, 1.0 / 1.1];
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
    }
}
