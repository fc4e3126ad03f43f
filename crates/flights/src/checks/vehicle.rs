//! Checks of the vehicle, and of flights that it cannot fly.

use crate::Trial;
use crate::vehicle::{PitchLoop, at_full_stick};
use pilotage_estimation::Doubt;
use pilotage_inference::outliers::median;
use pilotage_models::Quadcopter;

/// Codes of what is found.
pub(super) const MOVING_START: &str = "moving-start";
pub(super) const VEHICLE_SIZE: &str = "vehicle-size";
pub(super) const VEHICLE_UNSTABLE: &str = "vehicle-unstable";
/// Radius of gyration over arm length of any body with motors on arms.
const GYRATION: std::ops::RangeInclusive<f64> = 0.05..=5.0;
/// Duration of the first samples of a run [s], at least three, that show whether it moves.
const BEGINNING: f64 = 0.5;
/// Number of standard errors by which a speed must exceed the possible speed from rest.
const SURE: f64 = 5.0;

fn doubt(code: &'static str, words: String) -> Doubt {
    Doubt {
        code,
        words,
        is_fatal: false,
    }
}

/// What a vehicle that is known gives to doubt.
pub(super) fn doubts(vehicle: &Quadcopter) -> impl Iterator<Item = Doubt> {
    let (gyration, arm) = ((vehicle.inertia / vehicle.mass).sqrt(), vehicle.arm_length);
    let size = || {
        let words = format!(
            "the vehicle's radius of gyration √(inertia/mass) is {gyration:.3} m with an arm of {arm} m: one of mass, inertia \
             and arm_length may be in another unit"
        );
        doubt(VEHICLE_SIZE, words)
    };
    let unstable = || {
        let words = "the vehicle's own pitch loop is unstable, so it cannot have been flown; see `pilotage vehicle check`";
        doubt(VEHICLE_UNSTABLE, words.to_owned())
    };
    let is_unstable = !PitchLoop::of(vehicle).is_stable();
    let size = (!GYRATION.contains(&(gyration / arm))).then(size);
    size.into_iter().chain(is_unstable.then(unstable))
}

/// A run that moves faster at its start than the vehicle from rest with the stick at its limit; `noise` is that of the
/// positions \[m\].
pub(super) fn moving(
    vehicle: &Quadcopter,
    stick_limit: f64,
    noise: f64,
    trials: &[Trial],
) -> Option<Doubt> {
    let of_run = |trial: &Trial| {
        let samples = beginning(trial);
        let count = samples.len() as f64;
        let (speed, time) = (slope(&samples)?, samples.iter().map(|(t, _)| t));
        let mean = time.clone().sum::<f64>() / count;
        let error = noise / time.map(|t| (t - mean).powi(2)).sum::<f64>().sqrt();
        let (first, last) = (samples[0].0, samples[samples.len() - 1].0);
        let most = at_full_stick(vehicle, stick_limit, last - first) / (last - first);
        let words = format!(
            "{} begins at {speed:.2} m/s, and full stick from rest gives {most:.2} m/s: it was in motion before its first \
             sample; begin the recording earlier, or fit with --initial-state free",
            trial.name
        );
        let excess = speed.abs() - most - SURE * error;
        Some((excess, doubt(MOVING_START, words)))
    };
    let all = trials.iter().filter_map(of_run);
    let (excess, found) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (excess > 0.0).then_some(found)
}

/// Times and positions of the first samples.
fn beginning(trial: &Trial) -> Vec<(f64, f64)> {
    let all = trial
        .time
        .iter()
        .copied()
        .zip(trial.position.iter().copied());
    let known: Vec<(f64, f64)> = all.filter(|(_, z)| z.is_finite()).collect();
    let end = known.first().map_or(0.0, |(t, _)| t + BEGINNING);
    let count = known.partition_point(|(t, _)| *t <= end).max(3);
    known.into_iter().take(count).collect()
}

/// The median slope between two samples (P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau",
/// J. Am. Stat. Assoc. 63, 1968), robust to a few wrong samples.
fn slope(samples: &[(f64, f64)]) -> Option<f64> {
    let after = |i: usize| samples[i + 1..].iter().map(move |b| (samples[i], b));
    let pairs = (0..samples.len()).flat_map(after);
    let slopes = pairs.map(|(a, b)| (b.1 - a.1) / (b.0 - a.0));
    median(slopes).filter(|_| samples.len() >= 3)
}
