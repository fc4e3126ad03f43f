//! Gain, lead and lag suited to a vehicle, by McRuer's rules: humans make the loop resemble K/s about its crossover, by
//! lead if the vehicle is slower than that, by lag if it is faster.

use super::{Human, ModelVehicle, SyntheticError, Vehicle};
use nalgebra::Complex;
use pilotage_text::number::rounded;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Highest crossover frequency [rad/s]: that of humans with a K/s-like vehicle.
const CROSSOVER: f64 = 2.5;

/// Lowest acceptable crossover frequency [rad/s].
pub(super) const SLOWEST: f64 = 0.05;

/// Phase margin \[rad\].
const MARGIN: f64 = FRAC_PI_4;

/// Maximum `ω T_L` at the crossover: more lead mainly amplifies noise.
const LEAD: f64 = 3.0;

/// Maximum lag \[s\].
const LAG: f64 = 5.0;

/// Given parameters of a human; the others are chosen to suit the vehicle.
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
    /// The human with gain, lead and lag suited to an axis of a vehicle about its start, to three digits: the highest
    /// crossover frequency up to 2.5 rad/s with a phase margin of 45 degrees and a lead of at most `3 / ω`. The
    /// parameters in `given` are kept.
    ///
    /// # Errors
    /// If there is no such frequency above 0.05 rad/s, and the gain is not given.
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
                gain: rounded(gain, 3),
                lead: rounded(lead, 3),
                lag: rounded(lag, 3),
                ..*self
            })
        });
        suited
            .next()
            .ok_or(SyntheticError::Unsuited { axis: axis + 1 })
    }

    /// Frequency [rad/s], open loop without gain, lead and lag, and its phase \[rad\], by ascending frequency. The
    /// phase is continued without jumps from 0 on the real axis.
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

    /// Transfer function from an error to the hand's command.
    pub(super) fn eye(&self, s: Complex<f64>) -> Complex<f64> {
        (-s * self.delay).exp() * (s * self.lead + 1.0) * self.gain
    }

    /// Transfer function from the command to the stick.
    pub(super) fn arm(&self, s: Complex<f64>) -> Complex<f64> {
        let w = self.frequency;
        let arm = s * s + s * (2.0 * self.damping * w) + w * w;
        Complex::from(w * w) / (arm * (s * self.lag + 1.0))
    }
}

/// Ascending frequencies one percent apart.
fn spread(low: f64, high: f64) -> Vec<f64> {
    let steps = ((high / low).ln() / 0.01).round();
    let part = |k: usize| (0.01 * (k as f64 - steps)).exp();
    (0..=steps as usize).map(|k| high * part(k)).collect()
}

/// Lead and lag that achieve the phase margin at that frequency.
fn equalisation(frequency: f64, phase: f64, given: Given) -> Option<(f64, f64)> {
    // Phase to be added; a negative value may be removed.
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
