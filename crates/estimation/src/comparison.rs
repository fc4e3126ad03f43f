//! Several problems on the same data: which model is it?

use crate::error::ProblemError;
use crate::file::{Noise, ProblemFile};
use crate::fit::{Observer, fit};
use crate::part::Part;
use crate::posed::Posed;
use crate::result::Fit;
use crate::validation::validated;
use pilotage_cosim::description::InstanceDescription;
use pilotage_inference::choice::{Comparison, Contender, choose};
use pilotage_sqp::Status;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A problem among others.
#[derive(Debug)]
pub struct Candidate {
    /// Its fit to all runs.
    pub fit: Fit,
    /// Its figures; what a run says against a fit to the others is not a number where there is no such fit.
    pub figures: Contender,
}

/// What came of a comparison.
#[derive(Debug)]
pub struct Compared {
    /// The problems, in their order.
    pub candidates: Vec<Candidate>,
    /// The runs, in their order.
    pub runs: Vec<String>,
    /// The problem that is taken, and the comparisons that led there; none with fewer than three runs that all predict, or
    /// where a problem has no answer.
    pub choice: Option<(usize, Vec<Comparison>)>,
}

/// Opens the model of an instance, on any thread.
pub type OpenInParallel<'o> =
    &'o (dyn Fn(&InstanceDescription) -> Result<Part, ProblemError> + Sync);

/// Asked again and again whether to go on.
pub type Ask<'a> = dyn Fn(usize, usize) -> ControlFlow<Status> + Sync + 'a;

/// Fits each problem to all runs, and to all but one, for each run. `ask` is told how many fits are done, and of how many.
///
/// # Errors
/// When a problem cannot be posed, or has other data than the first.
pub fn compare(
    files: &[ProblemFile],
    open: OpenInParallel<'_>,
    ask: &Ask<'_>,
) -> Result<Compared, ProblemError> {
    files[1..]
        .iter()
        .try_for_each(|file| check_data(&files[0], file))?;
    let fitted: Vec<usize> = (0..files[0].runs.len())
        .filter(|k| files[0].runs[*k].fits)
        .collect();
    let (done, all) = (AtomicUsize::new(0), files.len() * (1 + fitted.len()));
    let ask = &|| ask(done.load(Ordering::Relaxed), all);
    let whole = files.par_iter().map(|file| {
        let fitted = whole(file, open, ask);
        done.fetch_add(1, Ordering::Relaxed);
        fitted
    });
    let whole: Vec<(Fit, usize)> = whole.collect::<Result<_, _>>()?;
    let folds = (0..files.len()).flat_map(|file| fitted.iter().map(move |run| (file, *run)));
    let folds: Vec<(usize, usize)> = folds.collect();
    let surprises = folds.par_iter().map(|(file, run)| {
        let surprise = match whole[*file].0.is_answer() {
            true => held_out((&files[*file], &whole[*file].0), *run, open, ask),
            false => Ok(f64::NAN),
        };
        done.fetch_add(1, Ordering::Relaxed);
        surprise
    });
    let surprises: Vec<f64> = surprises.collect::<Result<_, _>>()?;
    let candidates = whole.into_iter().zip(surprises.chunks(fitted.len().max(1)));
    let candidates = candidates.map(|((fit, unknowns), held_out)| Candidate {
        figures: Contender {
            unknowns,
            samples: fit.samples,
            surprise: 2.0 * fit.nllh,
            held_out: held_out.to_vec(),
        },
        fit,
    });
    let candidates: Vec<Candidate> = candidates.collect();
    let figures: Vec<Contender> = candidates.iter().map(|own| own.figures.clone()).collect();
    let have_answers = candidates.iter().all(|own| own.fit.is_answer());
    let name = |k: &usize| files[0].runs[*k].name.clone();
    Ok(Compared {
        runs: fitted.iter().map(name).collect(),
        choice: choose(&figures).filter(|_| have_answers),
        candidates,
    })
}

/// Whether to go on.
type GoesOn<'a> = dyn Fn() -> ControlFlow<Status> + Sync + 'a;

/// The fit to all runs, and the number of its unknowns: shared parameters, those of runs, and free initial states.
fn whole(
    file: &ProblemFile,
    open: OpenInParallel<'_>,
    ask: &GoesOn<'_>,
) -> Result<(Fit, usize), ProblemError> {
    let posed = Posed::new(file, open)?;
    let free = posed.runs.iter().flat_map(|run| &run.initial);
    let unknowns = posed.shared + free.filter(|known| known.is_none()).count();
    Ok((asked(&posed, ask), unknowns))
}

/// −2 log likelihood of a run by a fit to the others, which begins where that to all runs ended; not a number where there
/// is no such fit.
fn held_out(
    (file, whole): (&ProblemFile, &Fit),
    run: usize,
    open: OpenInParallel<'_>,
    ask: &GoesOn<'_>,
) -> Result<f64, ProblemError> {
    let mut file = file.clone();
    let mut place = 0..;
    file.runs.retain_mut(|line| {
        let is_left_out = place.next() == Some(run);
        let is_kept = line.fits;
        line.fits &= !is_left_out;
        is_kept
    });
    if file.runs.iter().all(|line| !line.fits) {
        return Ok(f64::NAN);
    }
    file.options.starts = 1;
    let mut posed = Posed::new(&file, open)?;
    for (unknown, _) in &mut posed.unknowns {
        if let Some(found) = whole.parameters.iter().find(|own| own.name == unknown.name) {
            unknown.start = found.mean();
        }
    }
    let fit = asked(&posed, ask);
    if !fit.is_answer() {
        return Ok(f64::NAN);
    }
    let noises: Vec<Noise> = file.measured.iter().map(|own| own.noise).collect();
    let judged = validated(&file, &fit, open)?;
    Ok(judged.iter().map(|run| run.surprise(&noises)).sum())
}

fn asked(posed: &Posed<'_>, ask: &GoesOn<'_>) -> Fit {
    let observer: &mut Observer<'_> = &mut |_| ask();
    fit(posed, observer)
}

/// Likelihoods of different data are not to be compared.
fn check_data(first: &ProblemFile, other: &ProblemFile) -> Result<(), ProblemError> {
    let runs = |file: &ProblemFile| {
        let runs = file.runs.iter().filter(|run| run.fits);
        let canonical =
            |path: &std::path::Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        runs.map(|run| canonical(&run.file)).collect::<Vec<_>>()
    };
    let columns = |file: &ProblemFile| {
        let columns = file.measured.iter().map(|own| own.column.value.clone());
        let mut columns: Vec<String> = columns.collect();
        columns.sort();
        columns
    };
    let differs = if runs(first) != runs(other) {
        "other runs are fitted, or in another order"
    } else if columns(first) != columns(other) {
        "other columns are measured"
    } else {
        return Ok(());
    };
    Err(ProblemError::Part(format!(
        "{}: {differs} than in {}: likelihoods of different data cannot be compared; name the same `[[run]]` and \
         `[[measured]]` columns in both",
        other.file, first.file
    )))
}
