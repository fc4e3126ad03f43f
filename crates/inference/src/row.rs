//! Terms of a log likelihood as rows of a least-squares problem.

/// Noise of a measured value, by its residual `z = (y - h)/sd`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// Normal noise.
    Normal,
    /// Laplace's, of unit standard deviation; the absolute value is rounded off at 0 within `smoothing`.
    Laplace {
        /// Where it is rounded off, in standard deviations.
        smoothing: f64,
    },
    /// Student's t of unit scale.
    Student {
        /// Degrees of freedom.
        dof: f64,
    },
    /// Huber's, whose score is `z` within ± the threshold and the threshold beyond.
    Huber {
        /// In standard deviations.
        threshold: f64,
        /// Mean slope of the score, `E ψ'`: the part of the residuals within the threshold.
        of_location: f64,
        /// The same of the noise level's, `E(z²ψ' + zψ)`.
        of_level: f64,
    },
}

impl Noise {
    /// Huber's, of a signal with these residuals and their weights. The informations are means over the residuals and no
    /// property of a distribution, so that `s² H⁻¹` is the covariance of Huber (*Robust Statistics*, 1981, section 7.6,
    /// without its factor for few values).
    pub fn huber(threshold: f64, residuals: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut all, mut location, mut level) = (0.0, 0.0, 0.0);
        for (z, weight) in residuals {
            let is_within = z.abs() <= threshold;
            all += weight;
            location += if is_within { weight } else { 0.0 };
            level += weight * z.abs() * if is_within { 2.0 * z.abs() } else { threshold };
        }
        Self::Huber {
            threshold,
            of_location: location / all,
            of_level: level / all,
        }
    }
}

/// A measured value as up to two rows: one of its location `h`, one of its noise level `ln sd`.
///
/// With the score `ψ(z)` of the location and the Fisher informations `i_h` of `h/sd` and `i_s` of `ln sd` the rows have
/// the residuals `ψ/√i_h` and `(zψ - 1)/√i_s`, and the derivatives `√i_h ∂h/sd` and `√i_s ∂ ln sd`: their normal
/// equations are those of Fisher scoring, and with the right model they are uncorrelated and have unit variance. (Lange,
/// Little & Taylor, J. Am. Stat. Assoc. 84, 1989, for Student's t.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Residual of the location.
    pub location: f64,
    /// What its derivatives `∂h/sd` are multiplied with.
    pub location_scale: f64,
    /// Residual of the noise level.
    pub level: f64,
    /// What its derivatives `∂ ln sd` are multiplied with.
    pub level_scale: f64,
}

impl Row {
    /// Of a residual `z = (y - h)/sd` with a weight.
    pub fn new(noise: Noise, z: f64, weight: f64) -> Self {
        let (psi, of_location, of_level) = match noise {
            Noise::Normal => (z, 1.0, 2.0),
            Noise::Laplace { smoothing } => {
                (std::f64::consts::SQRT_2 * z / z.hypot(smoothing), 2.0, 1.0)
            }
            Noise::Student { dof } => (
                (dof + 1.0) * z / (dof + z * z),
                (dof + 1.0) / (dof + 3.0),
                2.0 * dof / (dof + 3.0),
            ),
            Noise::Huber {
                threshold,
                of_location,
                of_level,
            } => (z.clamp(-threshold, threshold), of_location, of_level),
        };
        let root = weight.sqrt();
        Self {
            location: root * psi / of_location.sqrt(),
            location_scale: root * of_location.sqrt(),
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
        let values = (-4_000_000..=4_000_000).map(|k| 1e-5 * f64::from(k));
        let fitted = Noise::huber(1.345, values.map(|z| (z, huber(z))));
        let cases: [(Noise, &dyn Fn(f64) -> f64); 4] = [
            (fitted, &huber),
            (Noise::Normal, &|z| normal.pdf(z)),
            (Noise::Laplace { smoothing: 1e-6 }, &|z| laplace.pdf(z)),
            (Noise::Student { dof: 4.0 }, &|z| student.pdf(z)),
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
}
