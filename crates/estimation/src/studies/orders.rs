//! A problem with different orders of its linear model.

use crate::fit::{Observer, fit};
use crate::posed::Posed;
use crate::problem::error::ProblemError;
use crate::problem::file::ProblemFile;
use crate::problem::order::{check, instance, number, with_order, with_pair};
use crate::result::Fit;
use crate::studies::comparison::{Candidate, candidates};
use crate::studies::folds::{Ask, OpenInParallel, fitted};
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
        let start = before.map(|own| with_pair(&coefficients(own, &instance), FASTER, APART));
        let mut file = with_order(file, &instance, order, start.as_deref());
        let candidate = {
            let posed = Posed::new(&file, open)?;
            let observer: &mut Observer<'_> = &mut |_| ask(done, total);
            let whole = fit(&posed, observer);
            candidates(vec![(&posed, whole)], (open, &ask), (done + 1, total))?.remove(0)
        };
        let is_answer = candidate.fit.is_answer();
        file.options.starts = Some(1);
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

/// The estimated coefficients: those of the denominator in ascending powers of s without the leading 1, then those of
/// the numerator.
fn coefficients(fit: &Fit, instance: &str) -> Vec<f64> {
    let found = fit.parameters.iter();
    let found = found.filter_map(|own| Some((number(&own.name, instance)?, own.mean())));
    let mut all: Vec<(usize, f64)> = found.collect();
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, value)| value).collect()
}
