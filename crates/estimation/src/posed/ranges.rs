//! Checks of parameter ranges: of values, of start values, and against the range of the model.

use crate::posed::unknowns::Unknown;
use crate::problem::error::ProblemError;
use crate::problem::file::Sought;
use crate::system::joint::Joint;
use crate::system::part::About;
use pilotage_text::document::Place;

/// Rejects a range beyond that of the model. A value outside it could not be read back into the model, and an FMU need
/// not support it.
pub fn check_model_range(line: &Sought, about: &About, joint: &Joint) -> Result<(), ProblemError> {
    let is_below = |a: Option<f64>, b: Option<f64>| a.zip(b).is_some_and(|(a, b)| a < b);
    if !is_below(line.min, about.min) && !is_below(about.max, line.max) {
        return Ok(());
    }
    let name = &line.name.value;
    let shown = |min: Option<f64>, max: Option<f64>| {
        let [min, max] = [
            min.unwrap_or(f64::NEG_INFINITY),
            max.unwrap_or(f64::INFINITY),
        ];
        format!("{min} to {max}")
    };
    let fault = format!(
        "`{name}` may be {} here, and {} takes {} alone; narrow it, or change the range there",
        shown(line.min.or(about.min), line.max.or(about.max)),
        joint.source_of(name),
        shown(about.min, about.max),
    );
    Err(ProblemError::maybe_at(line.name.place.as_ref(), fault))
}

/// Rejects a number outside a parameter's range.
pub fn check_range(
    name: &str,
    value: f64,
    [min, max]: [Option<f64>; 2],
    place: Option<&Place>,
) -> Result<(), ProblemError> {
    let [min, max] = [
        min.unwrap_or(f64::NEG_INFINITY),
        max.unwrap_or(f64::INFINITY),
    ];
    match (min..=max).contains(&value) && value.is_finite() {
        true => Ok(()),
        false => {
            let fault = format!("`{name}` is {value}, out of its range {min} to {max}; change it");
            Err(ProblemError::maybe_at(place, fault))
        }
    }
}

/// Rejects an invalid start value of a search.
pub fn check_start(unknown: &Unknown) -> Result<(), ProblemError> {
    let Unknown { name, start, .. } = unknown;
    let fault = |text: String| ProblemError::maybe_at(unknown.place.as_ref(), text);
    let within = unknown.min.unwrap_or(f64::NEG_INFINITY)..=unknown.max.unwrap_or(f64::INFINITY);
    if !within.contains(start) {
        return Err(fault(format!(
            "`{name}` starts at {start}, out of its range {} to {}; give it a start, or another range",
            within.start(),
            within.end()
        )));
    }
    if unknown.min.is_some() && unknown.min == unknown.max {
        return Err(fault(format!(
            "the range of `{name}` is one value; write fixed = true"
        )));
    }
    if unknown.prior.is_some_and(|prior| prior.log) && *start <= 0.0 {
        return Err(fault(format!(
            "`{name}` starts at {start}, and a log-normal prior is of a value above 0; give it a start above 0"
        )));
    }
    if unknown.log && *start <= 0.0 {
        return Err(fault(format!(
            "`{name}` starts at {start}, which has no logarithm; give it a start above 0"
        )));
    }
    Ok(())
}
