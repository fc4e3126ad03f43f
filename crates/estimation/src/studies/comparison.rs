//! Comparison of several models of the same data.

use crate::fit::{Observer, fit};
use crate::posed::Posed;
use crate::problem::error::ProblemError;
use crate::problem::file::{Noise, ProblemFile};
use crate::result::Fit;
use crate::studies::folds::{Ask, OpenInParallel, each, fitted, left_out};
use crate::studies::same_data::check_same;
use pilotage_inference::choice::{Comparison, Contender, choose};

/// One of the compared problems.
#[derive(Debug)]
pub struct Candidate {
    /// Its fit to all runs.
    pub fit: Fit,
    /// Its figures. The likelihood of a left-out run is NaN if there is no fit to the others.
    pub figures: Contender,
    /// Whether a left-out run has free initial states, which are estimated from it.
    pub is_begun: bool,
}

/// Result of a comparison.
#[derive(Debug)]
pub struct Compared {
    /// The problems, in the given order.
    pub candidates: Vec<Candidate>,
    /// The runs, in order.
    pub runs: Vec<String>,
    /// The selected problem, and the comparisons that led to it. None with fewer than three runs that all models
    /// predict, or if a problem has no solution.
    pub choice: Option<(usize, Vec<Comparison>)>,
}

/// Fits each problem to all runs, and to all but one for each run. `ask` is passed the number of completed fits and
/// their total.
///
/// # Errors
/// When a problem cannot be posed, or has other data than the first.
pub fn compare(
    files: &[ProblemFile],
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<Compared, ProblemError> {
    let posed = posed(files, open)?;
    let all = files.len() * (1 + fitted(&files[0]).len());
    let whole: Vec<Fit> = each(&posed, (0, all), ask, |posed, goes_on| {
        let observer: &mut Observer<'_> = &mut |_| goes_on();
        Ok(fit(posed, observer))
    })?;
    compared(files, &posed, whole, (open, ask))
}

/// As [`compare`], where the fits to all runs are known.
///
/// # Errors
/// As [`compare`].
pub fn compare_fits(
    files: &[ProblemFile],
    whole: Vec<Fit>,
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<Compared, ProblemError> {
    compared(files, &posed(files, open)?, whole, (open, ask))
}

fn compared(
    files: &[ProblemFile],
    posed: &[Posed<'_>],
    whole: Vec<Fit>,
    (open, ask): (OpenInParallel<'_>, &Ask<'_>),
) -> Result<Compared, ProblemError> {
    let runs = fitted(&files[0]);
    let all = files.len() * (1 + runs.len());
    // Runs have the same order in all files, possibly with validation runs between them.
    let folds = files.iter().zip(&whole).flat_map(|(file, whole)| {
        let runs = fitted(file).into_iter();
        runs.map(move |run| ((file, whole), run))
    });
    let folds: Vec<_> = folds.collect();
    let surprises = each(&folds, (files.len(), all), ask, |(own, run), goes_on| {
        let (file, whole) = *own;
        let noises: Vec<Noise> = file.measured.iter().map(|own| own.noise).collect();
        let judged = match whole.is_answer() {
            true => left_out(*own, *run, open, goes_on)?,
            false => None,
        };
        Ok(judged.map_or(f64::NAN, |run| run.surprise(&noises)))
    })?;
    let figures = posed
        .iter()
        .zip(&whole)
        .zip(surprises.chunks(runs.len().max(1)));
    let figures = figures.map(|((posed, fit), held_out)| Contender {
        unknowns: posed.count(),
        samples: fit.samples,
        surprise: 2.0 * fit.nllh,
        held_out: held_out.to_vec(),
    });
    let figures: Vec<Contender> = figures.collect();
    let have_answers = whole.iter().all(Fit::is_answer);
    Ok(Compared {
        runs: runs
            .iter()
            .map(|k| files[0].runs[*k].name.clone())
            .collect(),
        choice: choose(&figures).filter(|_| have_answers),
        candidates: (whole.into_iter().zip(figures).zip(posed))
            .map(|((fit, figures), posed)| Candidate {
                is_begun: posed.free_states().next().is_some(),
                fit,
                figures,
            })
            .collect(),
    })
}

/// The problems, which must have the same data.
fn posed<'f>(
    files: &'f [ProblemFile],
    open: OpenInParallel<'_>,
) -> Result<Vec<Posed<'f>>, ProblemError> {
    let posed = files.iter().map(|file| Posed::new(file, open));
    let posed: Vec<Posed<'_>> = posed.collect::<Result<_, _>>()?;
    let mut others = posed[1..].iter();
    others.try_for_each(|other| check_same(&posed[0], other))?;
    Ok(posed)
}
