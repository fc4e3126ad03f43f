//! Likelihood of measured values for each noise distribution.

use crate::problem::file::Noise;
use pilotage_collocation::Loss;
use statrs::function::erf::erf;
use std::f64::consts::{LN_2, PI, SQRT_2};

impl Noise {
    /// Whether values far from the others are expected.
    pub(crate) fn has_tails(self) -> bool {
        !matches!(self, Self::Normal | Self::LogNormal)
    }

    /// `(y - h)/sd`; for log-normal noise, of the logarithms.
    pub fn residual(self, recorded: f64, predicted: f64, sd: f64) -> f64 {
        match self {
            Self::LogNormal => (recorded.ln() - predicted.ln()) / sd,
            Self::Normal | Self::Laplace | Self::Student(_) | Self::Huber(_) => {
                (recorded - predicted) / sd
            }
        }
    }

    /// −2 log-likelihood of a recorded value, including constants.
    pub fn surprise(self, recorded: f64, predicted: f64, sd: f64) -> f64 {
        let r = self.residual(recorded, predicted, sd);
        let scale = 2.0 * sd.ln();
        match self {
            Self::Normal => r * r + scale + (2.0 * PI).ln(),
            Self::LogNormal => r * r + scale + (2.0 * PI).ln() + 2.0 * recorded.ln(),
            Self::Laplace => 2.0 * SQRT_2 * r.abs() + scale + LN_2,
            Self::Huber(k) => {
                let within = (2.0 * PI).sqrt() * erf(k / SQRT_2);
                let beyond = 2.0 / k * (-0.5 * k * k).exp();
                let loss = Loss::Huber { threshold: k }.value(r, 0.0);
                loss + scale + 2.0 * (within + beyond).ln()
            }
            Self::Student(dof) => {
                let constant = log_gamma(0.5 * dof) - log_gamma(0.5 * (dof + 1.0));
                (dof + 1.0) * (r * r / dof).ln_1p() + scale + (dof * PI).ln() + 2.0 * constant
            }
        }
    }
}

/// `ln Γ(x)` for x above 0: Stirling's series beyond 10, and the recurrence below (Abramowitz & Stegun, 6.1.41).
fn log_gamma(x: f64) -> f64 {
    let (mut x, mut product) = (x, 1.0);
    while x < 10.0 {
        product *= x;
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y / 1680.0))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * (2.0 * PI).ln() + series - product.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gamma_function_is_that_of_factorials_and_halves() {
        for (x, gamma) in [
            (1.0, 1.0),
            (0.5, PI.sqrt()),
            (2.5, 0.75 * PI.sqrt()),
            (6.0, 120.0),
            (12.0, 39_916_800.0),
        ] {
            assert!((log_gamma(x) - f64::ln(gamma)).abs() < 1e-10, "{x}");
        }
    }

    /// Each is a density: it integrates to 1 over all possible recorded values.
    #[test]
    fn likelihoods_are_densities() {
        for noise in [
            Noise::Normal,
            Noise::LogNormal,
            Noise::Laplace,
            Noise::Student(4.0),
            Noise::Huber(1.345),
        ] {
            // y = 2 + tan(v), or y = exp(tan(v)) for positive values.
            let step = 1e-5;
            let count = (PI / step) as usize;
            let sum: f64 = (1..count)
                .map(|k| {
                    let v = -0.5 * PI + step * k as f64;
                    let (t, slope) = (v.tan(), 1.0 + v.tan().powi(2));
                    let (y, slope) = match noise {
                        Noise::LogNormal if t.abs() < 50.0 => (t.exp(), slope * t.exp()),
                        Noise::LogNormal => return 0.0,
                        _ => (2.0 + t, slope),
                    };
                    (-0.5 * noise.surprise(y, 2.0, 0.7)).exp() * slope * step
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-4, "{noise:?}: {sum}");
        }
    }
}
