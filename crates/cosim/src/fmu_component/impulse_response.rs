//! Linearization of an FMU known only by its responses.

use super::FmuComponent;
use crate::component::{Component, ComponentError, Linear, Progress};
use nalgebra::DMatrix;
use pilotage_linear::{Realization, realize, steps_needed};

/// Heights of the pulses relative to the inputs' magnitudes. High pulses are best for linear behaviour, low ones for
/// nonlinear behaviour, but a solver with error control is noisy with the lowest. The one with the least noise is used.
const HEIGHTS: [f64; 3] = [1e-2, 1e-4, 1e-6];

/// Slot in which the state is saved.
const PLACE: usize = 0;

/// Linearizes by responses to pulses of each input, one communication step of `step` [s] long, from the instance's
/// current state, which is restored afterwards.
pub(super) fn linearize(component: &mut FmuComponent, step: f64) -> Result<Linear, ComponentError> {
    let [(inputs, knowns), (outputs, unknowns)] = component.knowns.ends();
    let (inputs, knowns) = (inputs.to_vec(), knowns.to_vec());
    // The rounding of 32-bit outputs hides the responses of the others.
    let all = || outputs.iter().cloned().zip(unknowns.iter().copied());
    let is_fine = |own: &(String, u32)| component.access.is_scalar(own.1);
    let (fine, coarse): (Vec<_>, Vec<_>) = all().partition(is_fine);
    let (kept, coarse) = match fine.is_empty() {
        true => (coarse, Vec::new()),
        false => (fine, coarse),
    };
    let (outputs, unknowns): (Vec<String>, Vec<u32>) = kept.into_iter().unzip();
    let mut held = vec![0.0; knowns.len()];
    component.get_reals(&knowns, &mut held)?;
    component.save(PLACE)?;
    let time = component.time;
    let steps = steps_needed(inputs.len(), outputs.len());
    let mut response = |k: usize, height: f64| -> Result<Vec<Vec<f64>>, ComponentError> {
        component.restore(PLACE)?;
        let mut values = held.clone();
        values[k] += height;
        (0..steps)
            .map(|i| {
                component.set_reals(&knowns, &values)?;
                values[k] = held[k];
                let t = time + i as f64 * step;
                match component.step_revocably(t, step)? {
                    Progress::Done => {}
                    _ => return Err(format!("it did not finish a step of {step} s").into()),
                }
                let mut found = vec![0.0; unknowns.len()];
                component.get_reals(&unknowns, &mut found)?;
                Ok(found)
            })
            .collect()
    };
    let mut best: Option<Realization> = None;
    let mut failure = None;
    for relative in HEIGHTS {
        let mut pulses = vec![DMatrix::zeros(outputs.len(), inputs.len()); steps];
        for (k, value) in held.iter().enumerate() {
            let height = relative * value.abs().max(1.0);
            let (above, below) = (response(k, height)?, response(k, -height)?);
            for ((pulse, above), below) in pulses.iter_mut().zip(above).zip(below) {
                for (i, (above, below)) in above.iter().zip(below).enumerate() {
                    pulse[(i, k)] = (above - below) / (2.0 * height);
                }
            }
        }
        match realize(&pulses, step, inputs.clone(), outputs.clone()) {
            Ok(found) if best.as_ref().is_none_or(|best| noise(&found) < noise(best)) => {
                best = Some(found);
            }
            Ok(_) => {}
            Err(error) => failure = Some(error),
        }
    }
    component.restore(PLACE)?;
    component.set_reals(&knowns, &held)?;
    component.time = time;
    match (best, failure) {
        (Some(found), _) => Ok(with_note(found, step, steps, &coarse)),
        (None, Some(error)) => Err(error.into()),
        (None, None) => Err("it gave no responses".into()),
    }
}

/// Noise level relative to the largest singular value.
fn noise(found: &Realization) -> f64 {
    found.singular_values.last().copied().unwrap_or(0.0)
}

fn with_note(found: Realization, step: f64, steps: usize, coarse: &[(String, u32)]) -> Linear {
    let n = found.system.states.len();
    let values: Vec<String> = (found.singular_values.iter())
        .map(|value| format!("{value:.1e}"))
        .collect();
    let (kept, next) = values.split_at(n);
    let kept = match n {
        0 => "no states".to_owned(),
        _ => format!("{n} states by the singular values {}", kept.join(" ")),
    };
    let next = match (n, next.first()) {
        (_, None) => String::new(),
        (0, Some(next)) => format!(", since the largest singular value is {next}"),
        (_, Some(next)) => format!(" | {next}"),
    };
    let coarse = match coarse {
        [] => String::new(),
        [(first, _), ..] => format!(
            "; outputs of 32 bits, such as `{first}`, count as constant: their rounding hides their responses"
        ),
    };
    let note = format!(
        "gives no derivatives: found by its responses to pulses, {steps} steps of {step} s, inputs held \
         (eigensystem realization, matrix logarithm); {kept}{next}; right where it is at rest, or linear{coarse}"
    );
    Linear {
        note: Some(note),
        ..found.system.into()
    }
}
