//! The human's parameters.

use super::{SyntheticError, check_ranges};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A human's parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Human {
    /// Gain `k`: stick per metre (or other unit of the position) of error.
    pub gain: f64,
    /// Lead time `T_L` \[s\].
    pub lead: f64,
    /// Lag time `T_I` \[s\]; 0 for none.
    pub lag: f64,
    /// Reaction delay `τ` \[s\].
    pub delay: f64,
    /// Natural frequency of the arm `ω_n` [rad/s].
    pub frequency: f64,
    /// Damping ratio of the arm `ζ`.
    pub damping: f64,
    /// Maximum speed of the stick [1/s]; infinite for no limit.
    pub stick_rate: f64,
    /// Standard deviation of the remnant, relative to the initial stick command for the target (`k |ŷ|`): human noise
    /// is proportional to the motion.
    pub remnant: f64,
    /// Correlation time of the remnant \[s\].
    pub remnant_time: f64,
}

impl Default for Human {
    fn default() -> Self {
        Self {
            gain: 0.03,
            lead: 2.5,
            lag: 0.0,
            delay: 0.15,
            frequency: 10.0,
            damping: 0.7,
            stick_rate: f64::INFINITY,
            remnant: 0.04,
            remnant_time: 0.5,
        }
    }
}

/// A human who flies one or two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Hands {
    /// The human in each axis.
    pub axes: Vec<Human>,
    /// Fraction of each hand's command that is added to the other.
    pub coupling: f64,
}

impl Hands {
    pub(super) fn check(&self) -> Result<(), SyntheticError> {
        self.axes.iter().try_for_each(Human::check)?;
        check_ranges([("coupling", self.coupling, -1.0, 1.0)])
    }

    /// The hands with the random variation of one run, each varied independently.
    pub(super) fn on_a_day(&self, variation: f64, random: &mut ChaCha8Rng) -> Self {
        let axes = self.axes.iter();
        Self {
            axes: axes
                .map(|human| human.on_a_day(variation, random))
                .collect(),
            ..*self
        }
    }
}

impl Human {
    pub(super) fn check(&self) -> Result<(), SyntheticError> {
        check_ranges([
            ("gain", self.gain, 1e-6, 1e6),
            ("lead", self.lead, 0.0, 20.0),
            ("lag", self.lag, 0.0, 20.0),
            ("delay", self.delay, 0.0, 2.0),
            ("omega-n", self.frequency, 0.5, 100.0),
            ("zeta", self.damping, 0.05, 5.0),
            ("stick-rate", self.stick_rate, 0.01, f64::INFINITY),
            ("remnant", self.remnant, 0.0, 1.0),
            ("remnant-time", self.remnant_time, 0.01, 10.0),
        ])
    }

    /// The human with the random variation of one run: gain, lead, delay and arm vary by the relative standard
    /// deviation `variation`, limited to 2.5 standard deviations.
    pub(super) fn on_a_day(&self, variation: f64, random: &mut ChaCha8Rng) -> Self {
        let mut vary = |value: f64| {
            let deviate: f64 = StandardNormal.sample(random);
            value * (1.0 + variation * deviate.clamp(-2.5, 2.5))
        };
        Self {
            gain: vary(self.gain),
            lead: vary(self.lead),
            delay: vary(self.delay),
            frequency: vary(self.frequency),
            ..*self
        }
    }
}
