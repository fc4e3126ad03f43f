//! Names of runs, and detection of duplicate runs.

use crate::problem::error::ProblemError;
use crate::problem::file::{RunLine, Set};
use pilotage_text::printable::one_line;
use std::fs::canonicalize;
use std::path::{Component, Path, PathBuf};

/// Names each run by the shortest end of its path that no other file shares. If a file is listed several times, all but
/// the first get a number as suffix.
pub fn name(runs: &mut [RunLine]) {
    let paths: Vec<Vec<String>> = runs.iter().map(|run| parts(&run.file)).collect();
    for (k, run) in runs.iter_mut().enumerate() {
        let own = &paths[k];
        let others = || paths.iter().filter(|other| *other != own);
        let is_own = |count: &usize| others().all(|other| end(other, *count) != end(own, *count));
        let count = (1..own.len()).find(is_own).unwrap_or(own.len());
        run.name = one_line(&end(own, count).join("/")).into_owned();
        let before = paths[..k].iter().filter(|other| *other == own).count();
        if before > 0 {
            run.name += &format!("#{}", before + 1);
        }
    }
}

/// The components of a path, without `.`.
fn parts(path: &Path) -> Vec<String> {
    let parts = path.components().filter(|part| *part != Component::CurDir);
    parts
        .map(|part| part.as_os_str().to_string_lossy().into_owned())
        .collect()
}

/// The last `count` parts, or all if there are fewer.
fn end(parts: &[String], count: usize) -> &[String] {
    &parts[parts.len().saturating_sub(count)..]
}

/// Rejects a run that is fitted twice, since its data would count twice.
///
/// # Errors
/// When two entries have the same file and the same settings.
pub fn check_twice(runs: &[RunLine]) -> Result<(), ProblemError> {
    let file = |run: &RunLine| canonicalize(&run.file).unwrap_or_else(|_| run.file.clone());
    let fitted = runs.iter().filter(|run| run.fits);
    let fitted: Vec<(PathBuf, &RunLine)> = fitted.map(|run| (file(run), run)).collect();
    for (k, (file, run)) in fitted.iter().enumerate() {
        let mut before = fitted[..k].iter();
        if let Some((_, other)) = before.find(|(own, other)| own == file && is_alike(other, run)) {
            let fault = format!(
                "{} stands twice with the same settings, and its data would count twice; leave one out, or write weight \
                 = 2 at the other",
                other.name
            );
            return Err(ProblemError::at(&run.place, fault));
        }
    }
    Ok(())
}

/// Whether the settings of two runs differ at most in their weight.
fn is_alike(a: &RunLine, b: &RunLine) -> bool {
    let start = |run: &RunLine| run.start_time.as_ref().map(|time| time.value);
    a.subject == b.subject
        && start(a) == start(b)
        && settings(&a.set) == settings(&b.set)
        && changed(a) == changed(b)
}

/// Names and values.
type Settings<'r> = Vec<(&'r str, &'r str)>;

/// The changes in a run, and their times.
fn changed(run: &RunLine) -> Vec<(f64, [Settings<'_>; 2])> {
    let changes = run.changes.iter();
    changes
        .map(|change| {
            (
                change.time,
                [&change.set, &change.add].map(|own| settings(own)),
            )
        })
        .collect()
}

/// Names and values that are set, sorted: their order in the file does not matter.
fn settings(set: &[Set]) -> Settings<'_> {
    let pairs = set
        .iter()
        .map(|own| (own.name.value.as_str(), own.value.expression.text.as_str()));
    let mut all: Vec<(&str, &str)> = pairs.collect();
    all.sort_unstable();
    all
}
