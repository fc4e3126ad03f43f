//! Several problems on the same data: which model is it?

use crate::error::ProblemError;
use crate::file::{Noise, ProblemFile, RunLine};
use crate::fit::{Observer, fit};
use crate::part::Part;
use crate::posed::Posed;
use crate::result::Fit;
use crate::validation::{free_initial, validated};
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
    let posed: Vec<Posed<'_>> = (files.iter())
        .map(|file| Posed::new(file, open))
        .collect::<Result<_, _>>()?;
    posed[1..]
        .iter()
        .try_for_each(|other| check_data(&posed[0], other))?;
    let fitted: Vec<usize> = (0..files[0].runs.len())
        .filter(|k| files[0].runs[*k].fits)
        .collect();
    let (done, all) = (AtomicUsize::new(0), files.len() * (1 + fitted.len()));
    let ask = &|| ask(done.load(Ordering::Relaxed), all);
    let whole = posed.par_iter().map(|posed| {
        let fitted = (asked(posed, ask), posed.shared + free_initial(posed));
        done.fetch_add(1, Ordering::Relaxed);
        fitted
    });
    let whole: Vec<(Fit, usize)> = whole.collect();
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

/// −2 log likelihood of a run by a fit to the others, which begins where that to all runs ended, and 2 for each initial
/// state that is sought in the run itself (Akaike's count of what was fitted); not a number where there is no such fit.
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
    let states = posed.joint.model.states.len();
    let initial = posed.runs[0].initial[..states].iter();
    let sought = initial.filter(|known| known.is_none()).count();
    let surprise: f64 = judged.iter().map(|run| run.surprise(&noises)).sum();
    Ok(surprise + 2.0 * sought as f64)
}

fn asked(posed: &Posed<'_>, ask: &GoesOn<'_>) -> Fit {
    let observer: &mut Observer<'_> = &mut |_| ask();
    fit(posed, observer)
}

/// Likelihoods of different data are not to be compared.
fn check_data(first: &Posed<'_>, other: &Posed<'_>) -> Result<(), ProblemError> {
    let differs =
        differing_runs(first.file, other.file).or_else(|| differing_columns(first, other));
    match differs {
        None => Ok(()),
        Some(differs) => Err(ProblemError::Part(format!(
            "{}: {differs} in {}: likelihoods of different data cannot be compared; name the same `[[run]]`, with the same \
             weights, and `[[measured]]` columns in the same units in both",
            other.file.file, first.file.file
        ))),
    }
}

/// What differs between the runs that are fitted.
fn differing_runs(first: &ProblemFile, other: &ProblemFile) -> Option<String> {
    let fitted = |file: &ProblemFile| -> Vec<RunLine> {
        let fitted = file.runs.iter().filter(|run| run.fits);
        fitted.cloned().collect()
    };
    let (first, other) = (fitted(first), fitted(other));
    let path = |run: &RunLine| run.file.canonicalize().unwrap_or_else(|_| run.file.clone());
    if !first.iter().map(path).eq(other.iter().map(path)) {
        return Some("other runs are fitted, or in another order, than".to_owned());
    }
    let mut pairs = first.iter().zip(&other);
    let (a, b) = pairs.find(|(a, b)| a.weight != b.weight)?;
    Some(format!(
        "the run {} has the weight {}, and {}",
        b.name, b.weight, a.weight
    ))
}

/// What differs between the measured columns, as each problem reads them.
fn differing_columns(first: &Posed<'_>, other: &Posed<'_>) -> Option<String> {
    let columns = |posed: &Posed<'_>| {
        let measured = posed.file.measured.iter().enumerate();
        let mut columns: Vec<(String, usize)> = measured
            .map(|(k, own)| (own.column.value.clone(), k))
            .collect();
        columns.sort();
        columns
    };
    let (own, others) = (columns(first), columns(other));
    let names = |all: &[(String, usize)]| all.iter().map(|own| own.0.clone()).collect::<Vec<_>>();
    if names(&own) != names(&others) {
        return Some("other columns are measured than".to_owned());
    }
    let unit = |posed: &Posed<'_>, k: usize| {
        let unit = posed.file.measured[k].unit(&posed.joint);
        unit.unwrap_or("no unit").to_owned()
    };
    let mut pairs = own.iter().zip(&others);
    let (name, a, b) = pairs.find_map(|((name, a), (_, b))| {
        let is_same = have_same(&first.told.recorded[*a], &other.told.recorded[*b]);
        (!is_same || unit(first, *a) != unit(other, *b)).then_some((name, *a, *b))
    })?;
    let (a, b) = (unit(first, a), unit(other, b));
    Some(match a == b {
        true => format!("the column `{name}` has other values than"),
        false => format!("the column `{name}` is compared in {b}, and in {a}"),
    })
}

/// Whether two recordings have the same values in their order.
fn have_same(first: &[Vec<f64>], other: &[Vec<f64>]) -> bool {
    let known = |all: &[Vec<f64>]| -> Vec<f64> {
        let finite = all.iter().flatten().filter(|y| y.is_finite());
        finite.copied().collect()
    };
    known(first) == known(other)
}
