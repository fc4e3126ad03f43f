//! Describes in words what the data leave undetermined.

use super::Uncertainty;
use crate::posed::{Posed, Stands};
use crate::problem::file::Noise;
use crate::result::Fit;
use pilotage_collocation::Sensitivities;
use pilotage_inference::{Direction, Method};
use pilotage_text::counted;
use pilotage_text::number::short;

/// A direction along which the data do not change, over parameters with these names.
pub(crate) fn direction(direction: &Direction, names: &[String]) -> String {
    let parts: Vec<(&String, f64)> = (names.iter().zip(direction.0.iter().copied()))
        .filter(|(_, part)| *part != 0.0)
        .collect();
    if let [(name, _)] = parts[..] {
        return format!("`{name}` has no effect on what is measured");
    }
    // The parameter with component one comes first.
    let lead = parts.iter().position(|(_, part)| *part == 1.0).unwrap_or(0);
    let others = parts.iter().enumerate().filter(|(k, _)| *k != lead);
    let mut sum = parts[lead].0.clone();
    for (_, (name, part)) in others.clone() {
        let sign = if *part < 0.0 { '-' } else { '+' };
        sum += &format!(" {sign} {} {name}", short(part.abs(), 3));
    }
    let mut quoted: Vec<String> = vec![format!("`{}`", parts[lead].0)];
    quoted.extend(others.map(|(_, (name, _))| format!("`{name}`")));
    let last = quoted.pop().unwrap_or_default();
    format!(
        "{} and {last} cannot be told apart: nothing that is measured changes along {sum}",
        quoted.join(", ")
    )
}

/// The same at a solution. A parameter without effect may sit on a plateau, as a limit does that nothing reaches.
pub(super) fn direction_here(posed: &Posed<'_>, own: &Direction, names: &[String]) -> String {
    let words = direction(own, names);
    let is_alone = own.0.iter().filter(|part| **part != 0.0).count() == 1;
    match is_alone && posed.may_have_kinks() {
        true => format!("{words} at this value; none of those tried across its range fits better"),
        false => words,
    }
}

/// Active constraints other than ranges of parameters.
pub(super) fn held(posed: &Posed<'_>, at: &Sensitivities) -> Vec<String> {
    let names = &posed.names;
    let is_range = |k: &usize| names.parameters[*k].starts_with("the range of");
    let mut held: Vec<String> = Vec::new();
    for k in at.active.iter().filter(|k| !is_range(k)) {
        let name = &names.parameters[*k];
        let kept = if *k < names.stability {
            ""
        } else {
            "the stability of "
        };
        held.push(format!("{kept}{name}"));
    }
    held.dedup();
    let samples: usize = at.runs.iter().map(|own| own.active.nrows()).sum();
    // Conditions of states that begin steady are no limits.
    let samples = samples.saturating_sub(posed.runs.len() * posed.steady_states().count());
    let own = posed
        .unknowns
        .iter()
        .any(|(_, stands)| matches!(stands, Stands::State(_)));
    if samples > 0 && !own {
        held.push(format!("limits at {}", counted(samples, "sample")));
    }
    match held.is_empty() {
        true => Vec::new(),
        false => vec![format!(
            "held with equality: {}; intervals are along what that leaves free",
            held.join(", ")
        )],
    }
}

/// Signals with Huber noise of which more than half lies beyond the threshold. The few values within, mostly those that
/// the parameters can match, then determine how fast the score falls.
pub(super) fn beyond(posed: &Posed<'_>, fit: &Fit) -> Vec<String> {
    let mut notes = Vec::new();
    for (k, measured) in posed.file.measured.iter().enumerate() {
        let Noise::Huber(threshold) = measured.noise else {
            continue;
        };
        let residuals = fit
            .runs
            .iter()
            .flat_map(|run| run.residuals(k, measured.noise));
        let sizes: Vec<f64> = residuals.filter(|r| r.is_finite()).map(f64::abs).collect();
        let beyond = sizes.iter().filter(|size| **size > threshold).count();
        if 2 * beyond > sizes.len() {
            notes.push(format!(
                "{} % of `{}` lie beyond the threshold of its noise \"huber\", which is for outliers: standard deviations hang \
                 on the few within; state a larger sd",
                100 * beyond / sizes.len(),
                measured.column.value
            ));
        }
    }
    notes
}

/// The residuals of a measured signal wander.
pub(super) fn wanders(posed: &Posed<'_>, measured: usize) -> String {
    format!(
        "the residuals of {} wander like a random walk, so that the noise has no variance and the intervals mean little: the model \
         lacks something slow there, such as a drift, an offset or a state",
        posed.file.measured[measured].column.value
    )
}

/// Notes on the intervals other than what the data leave undetermined.
pub(super) fn notes(own: &Uncertainty, fit: &Fit) -> Vec<String> {
    let mut notes = Vec::new();
    if fit.chi2 <= fit.resolution {
        notes.push(
            "the residuals are hardly more than rounding: standard deviations do not apply to a recording with noise"
                .to_owned(),
        );
    }
    for found in &fit.derived {
        if let Some((_, value)) = found.values.iter().find(|(_, value)| !value.is_finite()) {
            notes.push(format!(
                "`{}` is {value} at the solution: it has no interval",
                found.name
            ));
        }
    }
    let deviations = own.covariance.deviations();
    for (k, error) in own.mesh_errors.iter().flatten().enumerate() {
        if *error > deviations[k] && deviations[k] > 0.0 && fit.chi2 > fit.resolution {
            notes.push(format!(
                "a finer mesh would change `{}` by {error:.1e}, more than its standard deviation {:.1e}: lower mesh_tolerance",
                own.names[k], deviations[k]
            ));
        }
    }
    if !own.is_even {
        notes.extend(uneven(own.method).map(str::to_owned));
    }
    if own.is_penalised {
        notes.push("priors are part of the fit: intervals are penalised".to_owned());
        // Residuals are `own.noise` times as large as stated; for a sought level this is 1.
        let squared = own.noise * own.noise;
        if fit.chi2 > fit.resolution && !(0.25..=4.0).contains(&squared) {
            notes.push(format!(
                "the residuals are {:.2} times the stated sd, against which priors count: they are weighed {} in the fit and in \
                 profiles; state the sd of the noise, or seek it as a parameter (sd = \"noise\")",
                own.noise,
                if squared < 1.0 { "too much" } else { "too little" }
            ));
        }
    }
    notes
}

/// Note on unevenly spaced samples for a method.
fn uneven(method: Method) -> Option<&'static str> {
    match method {
        Method::Ar => Some(
            "samples are not evenly spaced, or some are missing: `ar` takes the residuals for a process of first order in \
             continuous time",
        ),
        Method::Sidpac => Some(
            "samples are not evenly spaced, or some are missing: `sidpac` takes lags in samples for lags in time; take `ar`",
        ),
        Method::Plain | Method::Cr3 => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_sums_of_parameters() {
        let names = ["gain", "lead", "lag"].map(str::to_owned);
        let words = |parts: [f64; 3]| direction(&Direction(parts.to_vec()), &names);
        assert_eq!(
            words([1.0, 2.1, 0.0]),
            "`gain` and `lead` cannot be told apart: nothing that is measured changes along gain + 2.1 lead"
        );
        assert_eq!(
            words([-0.3, 1.0, 12345.6]),
            "`lead`, `gain` and `lag` cannot be told apart: nothing that is measured changes along lead - 0.3 gain + \
             12346 lag"
        );
        assert_eq!(
            words([0.0, 0.0, 1.0]),
            "`lag` has no effect on what is measured"
        );
    }
}
