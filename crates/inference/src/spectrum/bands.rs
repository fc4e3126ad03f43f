//! Coherence over flights in octave bands, for forcing functions that are not sums of sines, such as steps and ramps.

use super::Flight;
use super::excitation::Row;
use nalgebra::Complex;
use statrs::distribution::{Beta, ContinuousCDF};
use std::f64::consts::{PI, TAU};

/// Maximum number of frequencies of a band.
const IN_BAND: usize = 8;
/// Highest frequency of a band, far above the bandwidth of a human hand [rad/s].
const TOP: f64 = 32.0;
/// Minimum number of flights for a coherence: with one or two it is large by chance.
const FEWEST: usize = 3;

/// Octaves from one period of the shortest flight up to half of the lowest sampling frequency. `None` without samples.
///
/// Transforms are taken of the signals' increments, which for a flight that begins and ends at rest are contained in
/// the record; a target is treated as a step from the vehicle's initial position.
pub(super) fn bands(flights: &[Flight<'_>], of_stick: bool) -> Option<Vec<Row>> {
    let known: Vec<&Flight<'_>> = flights.iter().filter(|own| own.time.len() > 2).collect();
    let duration = |own: &&Flight<'_>| own.time[own.time.len() - 1] - own.time[0];
    let shortest = known.iter().map(duration).fold(f64::INFINITY, f64::min);
    let slowest = known
        .iter()
        .map(|own| duration(own) / (own.time.len() - 1) as f64)
        .fold(0.0, f64::max);
    let (first, top) = (TAU / shortest, TOP.min(PI / slowest));
    if known.is_empty() || !first.is_finite() || !top.is_finite() {
        return None;
    }
    let count = (top / first).log2().ceil().clamp(0.0, 32.0) as i32;
    let row = |band: i32| {
        let (low, high) = (
            first * 2f64.powi(band),
            (first * 2f64.powi(band + 1)).min(top),
        );
        let bins = (((high - low) / first).round() as usize).clamp(1, IN_BAND);
        let step = (high - low) / bins as f64;
        let all: Vec<f64> = (0..bins).map(|k| low + step * k as f64).collect();
        averaged(&known, of_stick, (low * high).sqrt(), &all, shortest)
    };
    Some((0..count).map(row).collect())
}

/// One band with these frequencies [rad/s], from the first `duration` seconds of each flight.
fn averaged(
    flights: &[&Flight<'_>],
    of_stick: bool,
    centre: f64,
    all: &[f64],
    duration: f64,
) -> Row {
    let (mut driven, mut coherent, mut possible, mut power) = (0.0, 0.0, 0.0, 0.0);
    let mut runs = 0;
    for omega in all {
        let transformed: Vec<[Complex<f64>; 2]> = flights
            .iter()
            .filter_map(|own| transforms(own, of_stick, *omega, duration))
            .collect();
        runs = transformed.len();
        let own: f64 = transformed.iter().map(|[f, _]| f.norm_sqr()).sum();
        let response: f64 = transformed.iter().map(|[_, u]| u.norm_sqr()).sum();
        let cross: Complex<f64> = transformed.iter().map(|[f, u]| f.conj() * u).sum();
        if runs == 0 {
            continue;
        }
        driven += own / (runs as f64 * omega * omega);
        power += response / (runs as f64 * omega * omega);
        coherent += cross.norm_sqr();
        possible += own * response;
    }
    let n = runs as f64;
    // A coherence estimated from n values is at least 1/n by chance.
    let found = coherent / possible;
    let coherence = ((n * found - 1.0) / (n - 1.0)).clamp(0.0, 1.0);
    let coherence = Some(coherence).filter(|own| runs >= FEWEST && own.is_finite());
    let bins = all.len() as f64;
    let chance = coherence.map(|_| chance(found, n, bins));
    let sd = |own: f64| ((1.0 - own) / (2.0 * n * bins * own)).sqrt();
    Row {
        frequency: centre,
        forcing: (driven / bins).sqrt(),
        coherence,
        chance,
        remnant: coherence.map(|own| (1.0 - own) * power / bins / (PI * duration)),
        sd: coherence.filter(|own| *own > 0.0).map(sd),
    }
}

/// Probability of a mean coherence this large over several frequencies of n flights if there is no common signal. The
/// coherence at one frequency has the beta distribution with 1 and n - 1 (Bendat & Piersol, *Random Data*, 4th ed.,
/// chapter 9); that of the mean is the beta distribution with the same mean and variance.
fn chance(found: f64, n: f64, frequencies: f64) -> f64 {
    let a = ((n + 1.0) * frequencies - 1.0) / n;
    let all = Beta::new(a, a * (n - 1.0));
    all.map_or(1.0, |all| all.sf(found.clamp(0.0, 1.0)))
}

/// Transforms of the increments of forcing function and response. `None` without a response.
fn transforms(
    flight: &Flight<'_>,
    of_stick: bool,
    omega: f64,
    duration: f64,
) -> Option<[Complex<f64>; 2]> {
    let response = if of_stick {
        flight.stick?
    } else {
        flight.position
    };
    let end = flight.time[0] + duration;
    let origin = flight
        .position
        .iter()
        .copied()
        .find(|own| own.is_finite())?;
    // A target steps from the initial position; a disturbance is not relative to it.
    let is_target = |own: &[f64]| {
        let pairs = own.iter().zip(&flight.error).zip(flight.position);
        pairs.clone().next().is_some()
            && pairs
                .take(1)
                .all(|((f, e), z)| (f - z - e).abs() <= 1e-9 * (1.0 + f.abs()))
    };
    let of = |values: &[f64], from: Option<f64>| {
        let (mut last, mut sum) = (from, Complex::new(0.0, 0.0));
        for (time, value) in flight
            .time
            .iter()
            .zip(values)
            .filter(|(time, x)| **time <= end && x.is_finite())
        {
            let step = value - last.unwrap_or(*value);
            sum += Complex::from_polar(step, -omega * (time - flight.time[0]));
            last = Some(*value);
        }
        sum
    };
    let forcing = flight
        .forcing
        .iter()
        .map(|own| of(own, is_target(own).then_some(origin)));
    let forcing = forcing.sum();
    Some([forcing, of(response, None)])
}
