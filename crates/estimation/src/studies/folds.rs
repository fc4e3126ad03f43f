//! Fits to some of the runs: all but one, or one alone.

use crate::fit::{Observer, fit};
use crate::posed::Posed;
use crate::problem::error::ProblemError;
use crate::problem::file::{ProblemFile, RunLine};
use crate::result::{Fit, Found};
use crate::studies::validation::{GoesOn, Judged, hold, validated};
use crate::system::part::Part;
use pilotage_cosim::description::InstanceDescription;
use pilotage_sqp::Status;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Opens the model of an instance, on any thread.
pub type OpenInParallel<'o> =
    &'o (dyn Fn(&InstanceDescription) -> Result<Part, ProblemError> + Sync);

/// Called repeatedly with the number of completed fits and their total, and asked whether to continue.
pub type Ask<'a> = dyn Fn(usize, usize) -> ControlFlow<Status> + Sync + 'a;

/// Indices of the fitted runs among all runs.
pub fn fitted(file: &ProblemFile) -> Vec<usize> {
    let runs = file.runs.iter().enumerate();
    runs.filter(|(_, run)| run.fits).map(|(k, _)| k).collect()
}

/// Does work for each item in parallel, and reports the progress to [`Ask`].
pub(crate) fn each<T: Sync, R: Send>(
    all: &[T],
    (before, whole): (usize, usize),
    ask: &Ask<'_>,
    work: impl Fn(&T, &GoesOn<'_>) -> Result<R, ProblemError> + Sync,
) -> Result<Vec<R>, ProblemError> {
    let done = AtomicUsize::new(before);
    let goes_on = || ask(done.load(Ordering::Relaxed), whole);
    let one = |own: &T| {
        let found = work(own, &goes_on);
        done.fetch_add(1, Ordering::Relaxed);
        found
    };
    all.par_iter().map(one).collect()
}

/// Predicts each fitted run by a fit to the others that begins at the fit to all. None if such a fit has no solution.
///
/// # Errors
/// When a problem without a run cannot be posed.
pub fn leave_one_out(
    (file, whole): (&ProblemFile, &Fit),
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<Vec<Option<Judged>>, ProblemError> {
    let runs = fitted(file);
    each(&runs, (0, runs.len()), ask, |run, goes_on| {
        left_out((file, whole), *run, open, goes_on)
    })
}

/// Predicts a run by a fit to the others that begins at the fit to all.
pub(crate) fn left_out(
    (file, whole): (&ProblemFile, &Fit),
    run: usize,
    open: OpenInParallel<'_>,
    goes_on: &GoesOn<'_>,
) -> Result<Option<Judged>, ProblemError> {
    let mut file = file.clone();
    let mut place = 0..;
    file.runs.retain_mut(|line| {
        let is_fitted = line.fits;
        line.fits &= place.next() != Some(run);
        is_fitted
    });
    if file.runs.iter().all(|line| !line.fits) {
        return Ok(None);
    }
    let anew = file.clone();
    let mut found = refit(&mut file, whole, open, goes_on)?;
    if !found.is_answer() && goes_on().is_continue() {
        // From all of its own starts.
        file = anew;
        let observer: &mut Observer<'_> = &mut |_| goes_on();
        found = fit(&Posed::new(&file, open)?, observer);
    }
    match found.is_answer() {
        true => Ok(validated(&file, &found, open, goes_on)?.pop()),
        false => Ok(None),
    }
}

/// A fit to some runs alone that begins at the fit to all.
pub(crate) fn alone(
    (file, whole): (&ProblemFile, &Fit),
    is_own: impl Fn(&RunLine) -> bool,
    open: OpenInParallel<'_>,
    goes_on: &GoesOn<'_>,
) -> Result<Fit, ProblemError> {
    let mut file = file.clone();
    file.runs.retain(|line| line.fits && is_own(line));
    refit(&mut file, whole, open, goes_on)
}

/// A fit that begins at the result of another.
fn refit(
    file: &mut ProblemFile,
    whole: &Fit,
    open: OpenInParallel<'_>,
    goes_on: &GoesOn<'_>,
) -> Result<Fit, ProblemError> {
    file.options.starts = Some(1);
    let fitted: Vec<RunLine> = file.runs.iter().filter(|run| run.fits).cloned().collect();
    let is_set = |found: &&Found| fitted.iter().all(|run| run.is_set(&found.name));
    for found in whole.parameters.iter().filter(is_set) {
        hold(file, found);
    }
    let mut posed = Posed::new(file, open)?;
    let labels: Vec<&String> = (posed.data.iter())
        .flat_map(|run| [Some(&run.line.name), run.line.subject.as_ref()])
        .flatten()
        .collect();
    for (unknown, _) in &mut posed.unknowns {
        let found = whole.parameters.iter().find(|own| own.name == unknown.name);
        // A search may not be able to begin at the bound of a range, such as a density of 0.
        if let Some(found) = found.filter(|own| own.bound.is_none()) {
            unknown.start = found.mean_of(&labels);
        }
    }
    let observer: &mut Observer<'_> = &mut |_| goes_on();
    Ok(fit(&posed, observer))
}
