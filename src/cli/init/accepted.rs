//! Comments out the parts of a generated problem file that `pilotage fit` would refuse, with the reason.

use crate::cli::Failure;
use crate::document::Place;
use crate::estimation::search::begin::is_resting;
use crate::estimation::{Posed, ProblemError, ProblemFile};
use crate::flights;
use pilotage_text::printable::comment;
use std::path::Path;

/// Sections whose lines are independent of each other.
const OF_LINES: [&str; 5] = [
    "[connect]",
    INPUTS,
    "[parameters]",
    "[initial]",
    "[stability]",
];

/// The section of the columns that drive inputs.
const INPUTS: &str = "[inputs]";

/// The section of a measured signal and its column.
const MEASURED: &str = "[[measured]]";

/// Comments out lines of a problem file at `path` until `pilotage fit` accepts it. Also returns the reasons for data that are
/// left out with them; what `init` itself proposed may go without a word.
///
/// # Errors
/// If nothing can be left out: a model without equations, a run that is no time series, no measured signal, the only column that
/// drives an input.
pub fn accepted(mut text: String, path: &Path) -> Result<(String, Vec<String>), Failure> {
    let mut reasons = Vec::new();
    loop {
        let refused = match refusal(&text, path) {
            None => return Ok((text, reasons)),
            Some(error) => error,
        };
        text = match &refused {
            ProblemError::At { place, fault } => {
                let (text, section) =
                    without(&text, place, fault).ok_or_else(|| Failure::new(fault.clone()))?;
                if section == INPUTS && !is_driven(&text) {
                    let hint = "nothing else drives an input, and a fit without any says nothing of the runs";
                    return Err(Failure::new(fault.clone()).hint(hint));
                }
                if [INPUTS, MEASURED].contains(&section.as_str()) {
                    reasons.push(fault.clone());
                }
                text
            }
            _ => return Err(refused.into()),
        };
    }
}

/// Whether a column drives an input.
fn is_driven(text: &str) -> bool {
    let inputs = text.lines().skip_while(|line| !line.starts_with(INPUTS));
    let lines = inputs.skip(1).take_while(|line| !line.starts_with('['));
    lines.into_iter().any(|line| line.starts_with('"'))
}

/// What an open loop is commented out with.
const OPEN: &str = "the stability asked for is that where the first run begins, and a dead zone opens the loop there";

/// Why the text is no valid problem, or one that has no solution.
fn refusal(text: &str, path: &Path) -> Option<ProblemError> {
    let file = match ProblemFile::parse(text, path) {
        Ok(file) => file,
        Err(error) => return Some(error),
    };
    let posed = match Posed::new(&file, &flights::open) {
        Ok(posed) => posed,
        Err(error) => return Some(error),
    };
    let place = file.stability.closed_loop.as_ref()?;
    is_resting(&posed).then(|| ProblemError::at(place, OPEN))
}

/// The text with the refused part commented out, and the section of that; `None` if the problem requires it.
fn without(text: &str, place: &Place, fault: &str) -> Option<(String, String)> {
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
            kept += &comment(&format!("{fault}:"));
        }
        if refused.contains(&k) && !line.starts_with('#') {
            kept += "# ";
        }
        kept += line;
        kept += "\n";
    }
    Some((kept, section.to_owned()))
}
