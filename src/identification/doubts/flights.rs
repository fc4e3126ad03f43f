//! What the recorded flights and the vehicle say before anybody looks at θ.

use super::{Doubt, Fit, Options, Trial};
use crate::identification::Mesh;
use crate::identification::start::implied_stick;
use crate::vehicle::PitchLoop;

/// A run whose positions differ by less does not move [m].
const STILL: f64 = 1e-6;
/// A run is driven when its target is at least this part of its largest error away from its start.
const DRIVEN: f64 = 0.5;
/// Correlation below which the stick's sign is in doubt.
const AGAINST: f64 = -0.5;
/// Radius of gyration over arm length: that of any body with motors on arms.
const GYRATION: std::ops::RangeInclusive<f64> = 0.05..=5.0;
/// Longest mesh interval, as a part of a run.
const COARSE: f64 = 0.1;
/// Part of the samples at the stick's stops that is worth a word.
const SATURATED: f64 = 0.05;
/// A stick this near to its stop, relative, lies there: recordings are rounded.
const AT_STOP: f64 = 0.999;

/// The doubts.
pub fn doubts(fit: &Fit, options: &Options, trials: &[Trial]) -> Vec<Doubt> {
    let movement = match trials.iter().all(is_still) {
        true => Some(Doubt::ConstantData),
        false => (!trials.iter().any(is_driven)).then_some(Doubt::NoForcing),
    };
    let vehicle = options.loop_vehicle().is_some();
    [
        movement,
        stick_sign(options, trials).filter(|_| vehicle),
        vehicle_size(options).filter(|_| vehicle),
        (vehicle && !PitchLoop::of(&options.vehicle).is_stable()).then_some(Doubt::VehicleUnstable),
        coarse_mesh(options, trials),
        saturated(fit, options, trials),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn finite(values: &[f64]) -> impl Iterator<Item = f64> {
    values.iter().copied().filter(|value| value.is_finite())
}

fn is_still(trial: &Trial) -> bool {
    let (least, most) = finite(&trial.position)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
            (a.min(z), b.max(z))
        });
    most - least <= STILL
}

/// True when the target is, at some time, away from where the run began.
fn is_driven(trial: &Trial) -> bool {
    let first = finite(&trial.position).next().unwrap_or(0.0);
    let largest =
        |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m: f64, v| m.max(v.abs()));
    let forcing = largest(&mut trial.target.iter().map(|target| target - first));
    let pairs = trial.target.iter().zip(&trial.position);
    let error = largest(
        &mut pairs
            .map(|(target, z)| target - z)
            .filter(|e| e.is_finite()),
    );
    forcing >= DRIVEN * error && forcing > STILL
}

/// Compares the recorded stick with that of the inverted vehicle, over all runs that have one.
fn stick_sign(options: &Options, trials: &[Trial]) -> Option<Doubt> {
    let (mut product, mut recorded, mut implied) = (0.0, 0.0, 0.0);
    for trial in trials {
        let Some(stick) = &trial.stick else {
            continue;
        };
        let unknown = Trial {
            stick: None,
            ..trial.clone()
        };
        for (u, v) in stick.iter().zip(implied_stick(&unknown, &options.vehicle)) {
            if u.is_finite() && v.is_finite() {
                product += u * v;
                recorded += u * u;
                implied += v * v;
            }
        }
    }
    let correlation = product / (recorded * implied).sqrt();
    (correlation < AGAINST).then_some(Doubt::StickSign { correlation })
}

fn vehicle_size(options: &Options) -> Option<Doubt> {
    let vehicle = &options.vehicle;
    let (gyration, arm) = ((vehicle.inertia / vehicle.mass).sqrt(), vehicle.arm_length);
    (!GYRATION.contains(&(gyration / arm))).then_some(Doubt::VehicleSize { gyration, arm })
}

fn coarse_mesh(options: &Options, trials: &[Trial]) -> Option<Doubt> {
    let Mesh::Step(step) = options.mesh else {
        return None;
    };
    let durations = trials.iter().map(|t| t.time[t.time.len() - 1] - t.time[0]);
    let duration = durations.fold(f64::INFINITY, f64::min);
    (step > COARSE * duration).then_some(Doubt::CoarseMesh { step, duration })
}

fn saturated(fit: &Fit, options: &Options, trials: &[Trial]) -> Option<Doubt> {
    let part = |sticks: &mut dyn Iterator<Item = f64>, limit: f64| {
        let (at, all) = sticks.fold((0.0, 0.0), |(at, all), u| {
            (
                at + f64::from(u8::from(u.abs() >= AT_STOP * limit)),
                all + 1.0,
            )
        });
        (all > 0.0).then_some(at / all)
    };
    let sticks = trials.iter().filter_map(|trial| trial.stick.as_deref());
    // The hand stops at full deflection, whatever limit the fit is given.
    let recorded = part(&mut sticks.flat_map(finite), 1.0);
    let model = fit.runs.iter().flat_map(|run| finite(&run.stick));
    let fitted = part(&mut { model }, options.stick_limit).unwrap_or(0.0);
    let most = recorded.unwrap_or(0.0).max(fitted);
    (most >= SATURATED).then_some(Doubt::SaturatedStick { recorded, fitted })
}
