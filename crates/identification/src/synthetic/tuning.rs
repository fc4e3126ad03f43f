//! Gain, lead and lag that suit a vehicle, by McRuer's rules: people make the loop look like K/s about its crossover,
//! by lead where the vehicle is slower than that, by lag where it is faster.

use super::{Human, ModelVehicle, SyntheticError, Vehicle};
use nalgebra::Complex;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Highest crossover frequency [rad/s]: that of people with a vehicle like K/s.
const CROSSOVER: f64 = 2.5;

/// Lowest crossover frequency that is still called flying [rad/s].
const SLOWEST: f64 = 0.05;

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

    /// Frequency [rad/s], open loop without gain, lead and lag, and its unwrapped phase \[rad\], upwards.
    fn responses(&self, vehicle: &ModelVehicle, axis: usize) -> Vec<(f64, Complex<f64>, f64)> {
        let sign = vehicle.sign(axis);
        let steps = (CROSSOVER / SLOWEST).ln() / 0.01;
        let mut phase: Option<f64> = None;
        (0..=steps.floor() as usize)
            .map(|k| CROSSOVER * (-0.01 * (steps.floor() - k as f64)).exp())
            .map(|frequency| {
                let s = Complex::new(0.0, frequency);
                let own = sign
                    * vehicle.linear().transfer(axis, axis, s)
                    * self.arm(s)
                    * (-s * self.delay).exp();
                // From -270 to 90 degrees at first, without jumps from there on.
                let about = phase.unwrap_or(-FRAC_PI_2);
                let next = own.arg() + 2.0 * PI * ((about - own.arg()) / (2.0 * PI)).round();
                phase = Some(next);
                (frequency, own, next)
            })
            .collect()
    }

    /// The arm's transfer function.
    fn arm(&self, s: Complex<f64>) -> Complex<f64> {
        let w = self.frequency;
        Complex::from(w * w) / (s * s + 2.0 * self.damping * w * s + w * w)
    }
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
