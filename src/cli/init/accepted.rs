//! What `pilotage fit` refuses of a problem to be written stands in it as a comment, with the reason.

use crate::cli::Failure;
use crate::document::Place;
use crate::estimation::{Posed, ProblemError, ProblemFile, part};
use std::path::Path;

/// Sections of which each line stands for itself.
const OF_LINES: [&str; 5] = [
    "[connect]",
    "[inputs]",
    "[parameters]",
    "[initial]",
    "[stability]",
];

/// The section of a signal and its column.
const MEASURED: &str = "[[measured]]";

/// A problem file at a path as `pilotage fit` takes it: lines that it refuses become comments.
///
/// # Errors
/// Where nothing can be left out: a model that is no equations, a run that is no series, no signal that is measured.
pub fn accepted(mut text: String, path: &Path) -> Result<String, Failure> {
    loop {
        let refused = match refusal(&text, path) {
            None => return Ok(text),
            Some(error) => error,
        };
        text = match &refused {
            ProblemError::At { place, fault } => {
                without(&text, place, fault).ok_or_else(|| Failure::new(fault.clone()))?
            }
            _ => return Err(refused.into()),
        };
    }
}

/// Why a problem is none.
fn refusal(text: &str, path: &Path) -> Option<ProblemError> {
    match ProblemFile::parse(text, path) {
        Ok(file) => Posed::new(&file, &part::open).err(),
        Err(error) => Some(error),
    }
}

/// The text with what stands at a place as a comment; none where the problem needs it.
fn without(text: &str, place: &Place, fault: &str) -> Option<String> {
    let lines: Vec<&str> = text.lines().collect();
    let at = place.line.checked_sub(1)?;
    let head = lines
        .get(..=at)?
        .iter()
        .rposition(|line| line.starts_with('['))?;
    let section = lines[head].split_whitespace().next()?;
    let measured = lines.iter().filter(|line| **line == MEASURED).count();
    let refused = match section {
        MEASURED if measured > 1 => {
            let length = lines[head..].iter().take_while(|line| !line.is_empty());
            head..head + length.count()
        }
        own if OF_LINES.contains(&own) && at > head && !lines[at].starts_with('#') => at..at + 1,
        _ => return None,
    };
    let mut kept = String::new();
    for (k, line) in lines.iter().enumerate() {
        if k == refused.start {
            kept += &format!("# {fault}:\n");
        }
        if refused.contains(&k) && !line.starts_with('#') {
            kept += "# ";
        }
        kept += line;
        kept += "\n";
    }
    Some(kept)
}
