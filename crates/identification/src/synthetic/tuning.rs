//! Gain, lead and lag that suit a vehicle, by McRuer's rules: people make the loop look like K/s about its crossover,
//! by lead where the vehicle is slower than that, by lag where it is faster.

use super::{Human, ModelVehicle, SyntheticError, Vehicle};
use nalgebra::Complex;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Highest crossover frequency [rad/s]: that of people with a vehicle like K/s.
const CROSSOVER: f64 = 2.5;

/// Lowest crossover frequency that is still called flying [rad/s].
pub(super) const SLOWEST: f64 = 0.05;

/// Phase margin \[rad\].
const MARGIN: f64 = FRAC_PI_4;

/// Largest `ω T_L` at the crossover: more lead than that is mostly noise.
const LEAD: f64 = 3.0;

/// Longest lag \[s\].
const LAG: f64 = 5.0;

/// What is given of a human; the rest is to suit the vehicle.
#[derive(Debug, Clone, Copy, Default)]
pub struct Given {
    /// Gain.
    pub gain: Option<f64>,
    /// Lead time \[s\].
    pub lead: Option<f64>,
    /// Lag time \[s\].
    pub lag: Option<f64>,
}

impl Human {
    /// This human with the gain, lead and lag that suit an axis of a vehicle about its start, to three digits: the highest
    /// crossover frequency up to 2.5 rad/s that has a phase margin of 45 degrees with a lead of at most `3 / ω`. What is
    /// `given` stays.
    ///
    /// # Errors
    /// When there is no such frequency above 0.05 rad/s, and the gain is not given.
    pub fn suited(
        &self,
        vehicle: &ModelVehicle,
        axis: usize,
        given: Given,
    ) -> Result<Self, SyntheticError> {
        if let Given {
            gain: Some(gain),
            lead: Some(lead),
            lag,
        } = given
        {
            return Ok(Self {
                gain,
                lead,
                lag: lag.unwrap_or(0.0),
                ..*self
            });
        }
        let candidates = self.responses(vehicle, axis).into_iter().rev();
        let mut suited = candidates.filter_map(|(frequency, response, phase)| {
            let (lead, lag) = equalisation(frequency, phase, given)?;
            let at = |time: f64| Complex::new(1.0, time * frequency);
            let gain = given
                .gain
                .unwrap_or(1.0 / (response * at(lead) / at(lag)).norm());
            gain.is_finite().then_some(Self {
                gain: rounded(gain),
                lead: rounded(lead),
                lag: rounded(lag),
                ..*self
            })
        });
        suited
            .next()
            .ok_or(SyntheticError::Unsuited { axis: axis + 1 })
    }

    /// Frequency [rad/s], open loop without gain, lead and lag, and its phase \[rad\], upwards. The phase is followed
    /// without jumps from where it is 0, on the real axis.
    fn responses(&self, vehicle: &ModelVehicle, axis: usize) -> Vec<(f64, Complex<f64>, f64)> {
        let plain = Self {
            gain: 1.0,
            lead: 0.0,
            lag: 0.0,
            ..*self
        };
        let far = vehicle.anchor();
        let arc = (1..=100).map(|k| Complex::from_polar(far, FRAC_PI_2 * f64::from(k) / 100.0));
        let along = |frequency| Complex::new(0.0, frequency);
        let path = arc.chain(spread(SLOWEST, far).into_iter().rev().map(along));
        let mut phase = 0.0;
        let mut follow = |s: Complex<f64>| {
            let open = vehicle.linear().transfer(axis, axis, s)
                * plain.eye(s)
                * plain.arm(s)
                * vehicle.sign(axis);
            phase = open.arg() + 2.0 * PI * ((phase - open.arg()) / (2.0 * PI)).round();
            (open, phase)
        };
        for s in path {
            follow(s);
        }
        let responses = spread(SLOWEST, CROSSOVER).into_iter().map(|frequency| {
            let (open, phase) = follow(along(frequency));
            (frequency, open, phase)
        });
        responses.collect()
    }

    /// The transfer function from an error to what the hand is told.
    pub(super) fn eye(&self, s: Complex<f64>) -> Complex<f64> {
        (-s * self.delay).exp() * (s * self.lead + 1.0) * self.gain
    }

    /// The transfer function from there to the stick.
    pub(super) fn arm(&self, s: Complex<f64>) -> Complex<f64> {
        let w = self.frequency;
        let arm = s * s + s * (2.0 * self.damping * w) + w * w;
        Complex::from(w * w) / (arm * (s * self.lag + 1.0))
    }
}

/// Frequencies one percent apart, upwards.
fn spread(low: f64, high: f64) -> Vec<f64> {
    let steps = ((high / low).ln() / 0.01).round();
    let part = |k: usize| (0.01 * (k as f64 - steps)).exp();
    (0..=steps as usize).map(|k| high * part(k)).collect()
}

/// Lead and lag with which the phase margin is kept at that frequency.
fn equalisation(frequency: f64, phase: f64, given: Given) -> Option<(f64, f64)> {
    // The phase that is to be added; what may be taken away where it is negative.
    let mut needed = MARGIN - PI - phase;
    let lag = given.lag.unwrap_or_else(|| {
        let excess = (-needed).clamp(0.0, 0.49 * PI);
        if excess > FRAC_PI_4 {
            (excess.tan() / frequency).min(LAG)
        } else {
            0.0
        }
    });
    needed += (lag * frequency).atan();
    let least = needed.max(0.0).tan() / frequency;
    let is_reached = |lead: f64| (lead * frequency).atan() > needed - 1e-9;
    match given.lead {
        Some(lead) => is_reached(lead).then_some((lead, lag)),
        None => (needed < LEAD.atan()).then_some((least, lag)),
    }
}

/// To three digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let digits = (2.0 - value.abs().log10().floor()) as i32;
    let scale = 10_f64.powi(digits.abs());
    match digits >= 0 {
        true => (value * scale).round() / scale,
        false => (value / scale).round() * scale,
    }
}
