//! Flights of which frequency responses are known without a model.

use super::Trial;
use pilotage_inference::spectrum::Flight;

/// Trials as flights driven only by their target.
pub fn driven(trials: &[Trial]) -> Vec<Flight<'_>> {
    let error = |own: &Trial| {
        let pairs = own.target.iter().zip(&own.position);
        pairs.map(|(target, position)| target - position).collect()
    };
    let all = trials.iter().map(|trial| Flight {
        name: &trial.name,
        time: &trial.time,
        forcing: vec![&trial.target],
        error: error(trial),
        stick: trial.stick.as_deref(),
        position: &trial.position,
    });
    all.collect()
}
