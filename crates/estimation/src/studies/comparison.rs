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
    let problems: Vec<_> = posed.iter().zip(whole).collect();
    let candidates = candidates(problems, (open, ask), (files.len(), all))?;
    Ok(Compared::of(&files[0], candidates))
}

impl Compared {
    /// Selects one of these candidates, of problems with the runs of this one.
    pub fn of(file: &ProblemFile, candidates: Vec<Candidate>) -> Self {
        let figures: Vec<Contender> = candidates.iter().map(|own| own.figures.clone()).collect();
        let have_answers = candidates.iter().all(|own| own.fit.is_answer());
        let runs = fitted(file).into_iter();
        Self {
            runs: runs.map(|k| file.runs[k].name.clone()).collect(),
            choice: choose(&figures).filter(|_| have_answers),
            candidates,
        }
    }
}

/// Fits problems without each of their runs; `count` has the number of fits done before and that of all.
pub(crate) fn candidates(
    problems: Vec<(&Posed<'_>, Fit)>,
    (open, ask): (OpenInParallel<'_>, &Ask<'_>),
    count: (usize, usize),
) -> Result<Vec<Candidate>, ProblemError> {
    // Runs have the same order in all files, possibly with validation runs between them.
    let folds = problems.iter().flat_map(|(posed, whole)| {
        let runs = fitted(posed.file).into_iter();
        runs.map(move |run| ((posed.file, whole), run))
    });
    let folds: Vec<_> = folds.collect();
    let surprises = each(&folds, count, ask, |(own, run), goes_on| {
        let (file, whole) = *own;
        let noises: Vec<Noise> = file.measured.iter().map(|own| own.noise).collect();
        let judged = match whole.is_answer() {
            true => left_out(*own, *run, open, goes_on)?,
            false => None,
        };
        Ok(judged.map_or(f64::NAN, |run| run.surprise(&noises)))
    })?;
    let mut surprises = surprises.into_iter();
    let candidate = |(posed, fit): (&Posed<'_>, Fit)| Candidate {
        is_begun: posed.free_states().next().is_some(),
        figures: Contender {
            unknowns: posed.count(),
            samples: fit.samples,
            surprise: 2.0 * fit.nllh,
            held_out: surprises.by_ref().take(fitted(posed.file).len()).collect(),
        },
        fit,
    };
    Ok(problems.into_iter().map(candidate).collect())
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
