//! Checks of the vehicle, and of flights that it cannot fly.

use super::Check;
use super::implied::implied_stick;
use crate::Trial;
use crate::vehicle::{PitchLoop, at_full_stick};
use pilotage_inference::outliers::median;
use pilotage_models::Quadcopter;

/// Correlation below which the stick's sign is doubtful.
const AGAINST: f64 = -0.5;
/// Radius of gyration over arm length of any body with motors on arms.
const GYRATION: std::ops::RangeInclusive<f64> = 0.05..=5.0;
/// Duration of the first samples of a run [s], at least three, that show whether it moves.
const BEGINNING: f64 = 0.5;
/// Number of standard errors by which a speed must exceed the possible speed from rest.
const SURE: f64 = 5.0;

/// The checks of a vehicle that is known, and of the sticks recorded with it.
pub fn of_vehicle(vehicle: &Quadcopter, trials: &[Trial]) -> Vec<Check> {
    let is_stable = PitchLoop::of(vehicle).is_stable();
    let all = [
        stick_sign(vehicle, trials),
        vehicle_size(vehicle),
        (!is_stable).then_some(Check::VehicleUnstable),
    ];
    all.into_iter().flatten().collect()
}

/// Compares the recorded stick with that of the inverted vehicle, over all runs that have one.
fn stick_sign(vehicle: &Quadcopter, trials: &[Trial]) -> Option<Check> {
    let (mut product, mut recorded, mut implied) = (0.0, 0.0, 0.0);
    for trial in trials {
        let Some(stick) = &trial.stick else {
            continue;
        };
        let motion = implied_stick(&trial.time, &trial.filled_position(), vehicle);
        for (u, v) in stick.iter().zip(motion) {
            if u.is_finite() && v.is_finite() {
                product += u * v;
                recorded += u * u;
                implied += v * v;
            }
        }
    }
    let correlation = product / (recorded * implied).sqrt();
    (correlation < AGAINST).then_some(Check::StickSign { correlation })
}

fn vehicle_size(vehicle: &Quadcopter) -> Option<Check> {
    let (gyration, arm) = ((vehicle.inertia / vehicle.mass).sqrt(), vehicle.arm_length);
    (!GYRATION.contains(&(gyration / arm))).then_some(Check::VehicleSize { gyration, arm })
}

/// A run that moves faster at its start than the vehicle from rest with the stick at its limit; `noise` is that of the
/// positions \[m\].
pub(super) fn moving(
    vehicle: &Quadcopter,
    stick_limit: f64,
    noise: f64,
    trials: &[Trial],
) -> Option<Check> {
    let of_run = |trial: &Trial| {
        let samples = beginning(trial);
        let count = samples.len() as f64;
        let (speed, time) = (slope(&samples)?, samples.iter().map(|(t, _)| t));
        let mean = time.clone().sum::<f64>() / count;
        let error = noise / time.map(|t| (t - mean).powi(2)).sum::<f64>().sqrt();
        let (first, last) = (samples[0].0, samples[samples.len() - 1].0);
        let most = at_full_stick(vehicle, stick_limit, last - first) / (last - first);
        let run = trial.name.clone();
        let excess = speed.abs() - most - SURE * error;
        Some((excess, Check::Moving { run, speed, most }))
    };
    let all = trials.iter().filter_map(of_run);
    let (excess, check) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (excess > 0.0).then_some(check)
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
