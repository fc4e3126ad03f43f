//! Losses of residuals.

use std::f64::consts::SQRT_2;

/// Term `w ℓ` of a recorded value `y` and the corresponding output `h`, with the weight `w` of the recording and
/// `r = y - h`.
///
/// All but the linear loss are, up to a constant, −2 log likelihoods of noise. Gauss–Newton replaces each by the
/// weighted square with the same slope, `ℓ'(r)/(2r) · r²`, whose curvature is never negative (iteratively reweighted
/// least squares: Holland & Welsch, Commun. Stat. A 6, 1977).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Loss {
    /// `r²`: normal noise, with `w = 1/sd²`.
    #[default]
    Square,
    /// `h` itself; of `y` it only matters whether it is missing. It represents terms of a likelihood such as `2 ln sd`
    /// of an estimated noise level.
    Linear,
    /// `(dof + 1) ln(1 + r²/dof)`: noise of Student's t distribution, for data with outliers (Lange, Little & Taylor,
    /// J. Am. Stat. Assoc. 84, 1989).
    Student {
        /// Degrees of freedom, above 0.
        dof: f64,
    },
    /// `r²` up to the threshold k and `2k|r| - k²` beyond: outliers have no more influence than residuals of size k
    /// (Huber, Ann. Math. Stat. 35, 1964).
    Huber {
        /// k, in the output's unit, above 0.
        threshold: f64,
    },
    /// `2√2 (√(r² + s²) - s)`: Laplace noise of unit standard deviation for `|r| ≫ s`, smooth at 0.
    Absolute {
        /// s, in the output's unit, above 0.
        smoothing: f64,
    },
}

/// Half the derivatives of a loss: those of a weighted square, and the differences from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HalfLoss {
    /// Weight of the square: `ℓ'/(2r)`.
    pub weight: f64,
    /// Derivative with respect to `h` minus that of the square, which is `-weight r`.
    pub slope: f64,
    /// Second derivative minus that of the square, which is `weight`.
    pub curvature: f64,
}

impl Loss {
    /// ℓ of a recorded value and an output.
    #[inline]
    pub fn value(self, recorded: f64, output: f64) -> f64 {
        let r = recorded - output;
        match self {
            Self::Square => r.powi(2),
            Self::Linear => output,
            Self::Student { dof } => (dof + 1.0) * (r * r / dof).ln_1p(),
            Self::Huber { threshold: k } => match r.abs() {
                size if size > k => k * (2.0 * size - k),
                _ => r * r,
            },
            Self::Absolute { smoothing: s } => 2.0 * SQRT_2 * r * r / (r.hypot(s) + s),
        }
    }

    /// Derivatives at a residual.
    #[inline]
    pub(super) fn halved(self, r: f64) -> HalfLoss {
        let (weight, slope, curvature) = match self {
            Self::Square => (1.0, 0.0, 0.0),
            Self::Linear => (0.0, 0.5, 0.0),
            Self::Student { dof } => {
                let weight = (dof + 1.0) / (dof + r * r);
                (weight, 0.0, -2.0 * weight * (r * r / (dof + r * r)))
            }
            Self::Huber { threshold: k } => match k / r.abs() {
                weight if weight < 1.0 => (weight, 0.0, -weight),
                _ => (1.0, 0.0, 0.0),
            },
            Self::Absolute { smoothing: s } => {
                let size = r.hypot(s);
                (SQRT_2 / size, 0.0, -SQRT_2 * (r / size).powi(2) / size)
            }
        };
        HalfLoss {
            weight,
            slope,
            curvature,
        }
    }

    /// # Panics
    /// If its parameter is not above 0.
    pub(super) fn check(self) {
        match self {
            Self::Square | Self::Linear => {}
            Self::Student { dof } => assert!(dof > 0.0, "degrees of freedom above 0"),
            Self::Huber { threshold } => assert!(threshold > 0.0, "a threshold above 0"),
            Self::Absolute { smoothing } => assert!(smoothing > 0.0, "a smoothing above 0"),
        }
    }
}
