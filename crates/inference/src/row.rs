//! Terms of a log likelihood as rows of a least-squares problem.

use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;
use std::f64::consts::SQRT_2;

/// Most unknowns per value that the information of Laplace noise allows for: more are determined by priors.
const MOST_UNKNOWNS: f64 = 0.9;

/// The normal equations `(AᵀA, Aᵀr)` of a least-squares problem with these rows and residuals.
pub fn normal_equations(
    rows: &DMatrix<f64>,
    residuals: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    (rows.tr_mul(rows), rows.tr_mul(residuals))
}

/// Noise of a measured value, in terms of its residual `z = (y - h)/sd`.
///
/// The informations of the Laplace, Student and Huber variants are means over the residuals, so that `s² H⁻¹` is the
/// covariance of an M-estimate (Huber, *Robust Statistics*, 1981, section 7.6, without its factor for few values) for
/// any stated scale: the scale affects at most which estimate is chosen, not its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// Normal noise.
    Normal,
    /// Laplace noise of unit standard deviation; the absolute value is smoothed at 0 within `smoothing`.
    Laplace {
        /// Width of the smoothing, in standard deviations.
        smoothing: f64,
        /// Mean square of the score, `E ψ²`: a fit passes through as many values as it has unknowns, where ψ is 0.
        of_score: f64,
        /// Mean slope of the score, `E ψ'`.
        of_location: f64,
        /// The same for the noise level, `E(z²ψ' + zψ)`.
        of_level: f64,
    },
    /// Student's t of unit scale.
    Student {
        /// Degrees of freedom.
        dof: f64,
        /// As above.
        of_location: f64,
        /// As above.
        of_level: f64,
    },
    /// Huber's, with the score `z` clamped to ± the threshold.
    Huber {
        /// The threshold in standard deviations.
        threshold: f64,
        /// As above: the part of the residuals within the threshold.
        of_location: f64,
        /// As above.
        of_level: f64,
    },
}

impl Noise {
    /// Laplace noise for a signal with these residuals and weights, of a fit with this number of unknowns per value.
    ///
    /// All of its slope is at 0, where few residuals are, so their density there is taken from the Laplace distribution
    /// with their mean magnitude b, without those through which the fit passes. The density has a peak there, of the
    /// width b, and predictions are uncertain by about b√(unknowns / values): the slope is the mean over that normal
    /// distribution. For a median of n values it makes the variance 1 + 1.6/√n times as large, as that of the middle
    /// value of a sorted sample is.
    pub fn laplace(
        smoothing: f64,
        unknowns_per_value: f64,
        residuals: impl Iterator<Item = (f64, f64)>,
    ) -> Self {
        let [size] = means(residuals, |z| [z.abs()]);
        let unknowns = unknowns_per_value.clamp(0.0, MOST_UNKNOWNS);
        let left = 1.0 - unknowns;
        // E exp(-a|x|) for normal x.
        let under_the_peak = (0.5 * unknowns).exp() * erfc((0.5 * unknowns).sqrt());
        Self::Laplace {
            smoothing,
            of_score: 2.0 * left,
            of_location: SQRT_2 * under_the_peak / (size / left + smoothing),
            of_level: SQRT_2 * size,
        }
    }

    /// Student noise for a signal with these residuals and weights.
    pub fn student(dof: f64, residuals: impl Iterator<Item = (f64, f64)>) -> Self {
        let [location, level] = means(residuals, |z| {
            let room = dof + z * z;
            let slope = (dof + 1.0) * (dof - z * z) / (room * room);
            [slope, z * z * slope + (dof + 1.0) * z * z / room]
        });
        // A few extreme residuals may make it negative; then the expectation under Student's t is used.
        let or = |mean: f64, own: f64| if mean > 0.05 * own { mean } else { own };
        Self::Student {
            dof,
            of_location: or(location, (dof + 1.0) / (dof + 3.0)),
            of_level: or(level, 2.0 * dof / (dof + 3.0)),
        }
    }

    /// Huber noise for a signal with these residuals and weights.
    pub fn huber(threshold: f64, residuals: impl Iterator<Item = (f64, f64)>) -> Self {
        let [of_location, of_level] = means(residuals, |z| match z.abs() <= threshold {
            true => [1.0, 2.0 * z * z],
            false => [0.0, z.abs() * threshold],
        });
        Self::Huber {
            threshold,
            of_location,
            of_level,
        }
    }
}

/// Weighted means of functions of the residuals.
fn means<const N: usize>(
    residuals: impl Iterator<Item = (f64, f64)>,
    values: impl Fn(f64) -> [f64; N],
) -> [f64; N] {
    let (mut sums, mut all) = ([0.0; N], 0.0);
    for (z, weight) in residuals {
        all += weight;
        for (sum, value) in sums.iter_mut().zip(values(z)) {
            *sum += weight * value;
        }
    }
    sums.map(|sum| sum / all)
}

/// A measured value as up to two rows: one for its location `h`, one for its noise level `ln sd`.
///
/// With the score `ψ(z)` of the location and the Fisher informations `i_h` of `h/sd` and `i_s` of `ln sd` the rows have
/// the residuals `ψ/√i_h` and `(zψ - 1)/√i_s` and the derivatives `√i_h ∂h/sd` and `√i_s ∂ ln sd`. Their normal
/// equations are those of Fisher scoring; with the right model they are uncorrelated and have unit variance (Lange,
/// Little & Taylor, J. Am. Stat. Assoc. 84, 1989, for Student's t). For Laplace noise the square of the score and its
/// slope differ: the residuals are `ψ/√(E ψ²)` and the derivatives `E ψ'/√(E ψ²) ∂h/sd`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Residual of the location.
    pub location: f64,
    /// Factor of its derivatives `∂h/sd`.
    pub location_scale: f64,
    /// Residual of the noise level.
    pub level: f64,
    /// Factor of its derivatives `∂ ln sd`.
    pub level_scale: f64,
}

impl Row {
    /// The rows of a residual `z = (y - h)/sd` with a weight.
    pub fn new(noise: Noise, z: f64, weight: f64) -> Self {
        let (psi, of_score, of_location, of_level) = match noise {
            Noise::Normal => (z, 1.0, 1.0, 2.0),
            Noise::Laplace {
                smoothing,
                of_score,
                of_location,
                of_level,
            } => {
                let psi = SQRT_2 * z / z.hypot(smoothing);
                (psi, of_score, of_location, of_level)
            }
            Noise::Student {
                dof,
                of_location,
                of_level,
            } => {
                let psi = (dof + 1.0) * z / (dof + z * z);
                (psi, of_location, of_location, of_level)
            }
            Noise::Huber {
                threshold,
                of_location,
                of_level,
            } => {
                let psi = z.clamp(-threshold, threshold);
                (psi, of_location, of_location, of_level)
            }
        };
        let root = weight.sqrt();
        Self {
            location: root * psi / of_score.sqrt(),
            location_scale: root * of_location / of_score.sqrt(),
            level: root * (z * psi - 1.0) / of_level.sqrt(),
            level_scale: root * of_level.sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{Continuous, Laplace, Normal, StudentsT};

    /// `∫ exp(-ρ)` of Huber's loss ρ with the threshold 1.345: √(2π)(2Φ(1.345) - 1) + 2 exp(-1.345²/2)/1.345.
    const HUBER_INTEGRAL: f64 = 2.6607238093896783;

    /// Mean and variance of both residuals, by integration over the density.
    #[test]
    fn residuals_have_mean_zero_and_unit_variance() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        let laplace = Laplace::new(0.0, 0.5_f64.sqrt()).unwrap();
        let student = StudentsT::new(0.0, 1.0, 4.0).unwrap();
        let huber = |z: f64| {
            let beyond = (z.abs() - 1.345).max(0.0);
            (-0.5 * (z * z - beyond * beyond)).exp() / HUBER_INTEGRAL
        };
        let values = || (-4_000_000..=4_000_000).map(|k| 1e-5 * f64::from(k));
        let of_huber = Noise::huber(1.345, values().map(|z| (z, huber(z))));
        let of_laplace = Noise::laplace(1e-6, 0.0, values().map(|z| (z, laplace.pdf(z))));
        let of_student = Noise::student(4.0, values().map(|z| (z, student.pdf(z))));
        let cases: [(Noise, &dyn Fn(f64) -> f64); 4] = [
            (of_huber, &huber),
            (Noise::Normal, &|z| normal.pdf(z)),
            (of_laplace, &|z| laplace.pdf(z)),
            (of_student, &|z| student.pdf(z)),
        ];
        for (noise, density) in cases {
            let mut moments = [0.0; 4];
            // z = tan v spans all values.
            let step = 1e-5;
            for k in 1..(std::f64::consts::PI / step) as usize {
                let v = -0.5 * std::f64::consts::PI + step * k as f64;
                let mass = density(v.tan()) * (1.0 + v.tan().powi(2)) * step;
                let row = Row::new(noise, v.tan(), 1.0);
                moments[0] += mass * row.location;
                moments[1] += mass * row.location.powi(2);
                moments[2] += mass * row.level;
                moments[3] += mass * row.level.powi(2);
            }
            for (moment, expected) in moments.iter().zip([0.0, 1.0, 0.0, 1.0]) {
                assert!((moment - expected).abs() < 2e-4, "{noise:?}: {moments:?}");
            }
        }
    }

    /// For a mean and any stated scale, the variance from the rows equals that over many samples.
    #[test]
    fn a_wrong_scale_makes_no_interval_wrong() {
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::SeedableRng;
        use rand_distr::{Distribution, Exp1, StandardUniform, StudentT};
        type Fitted = fn(&[f64]) -> Noise;
        let laplace: Fitted = |z| Noise::laplace(1e-3, 1.0 / 400.0, z.iter().map(|&z| (z, 1.0)));
        let student: Fitted = |z| Noise::student(4.0, z.iter().map(|&z| (z, 1.0)));
        for (seed, noise, stated) in [
            (1, laplace, 0.2),
            (2, laplace, 1.0),
            (3, laplace, 20.0),
            (4, student, 0.2),
            (5, student, 1.0),
            (6, student, 5.0),
        ] {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let is_laplace = seed <= 3;
            let mut draw = || -> f64 {
                let sign = if StandardUniform.sample(&mut random) {
                    1.0
                } else {
                    -1.0
                };
                let exponential: f64 = Exp1.sample(&mut random);
                let t: f64 = StudentT::new(4.0).unwrap().sample(&mut random);
                match is_laplace {
                    true => sign * exponential / SQRT_2,
                    false => t,
                }
            };
            const SETS: usize = 600;
            let (mut squares, mut variances) = (0.0, 0.0);
            for _ in 0..SETS {
                let y: Vec<f64> = (0..400).map(|_| draw() / stated).collect();
                // Fisher scoring with the rows themselves, starting from the median.
                let mut sorted = y.clone();
                sorted.sort_by(f64::total_cmp);
                let mut mean = 0.5 * (sorted[199] + sorted[200]);
                let mut variance = 0.0;
                for _ in 0..if is_laplace { 1 } else { 60 } {
                    let z: Vec<f64> = y.iter().map(|y| y - mean).collect();
                    let noise = noise(&z);
                    let rows: Vec<Row> = z.iter().map(|&z| Row::new(noise, z, 1.0)).collect();
                    let h: f64 = rows.iter().map(|row| row.location_scale.powi(2)).sum();
                    let g: f64 = rows
                        .iter()
                        .map(|row| row.location_scale * row.location)
                        .sum();
                    let s2 = rows.iter().map(|row| row.location.powi(2)).sum::<f64>() / 399.0;
                    variance = s2 / h;
                    if !is_laplace {
                        mean += g / h;
                    }
                }
                squares += mean * mean;
                variances += variance;
            }
            let ratio = (variances / squares).sqrt();
            assert!((ratio - 1.0).abs() < 0.12, "{seed}: {ratio}");
        }
    }
}
