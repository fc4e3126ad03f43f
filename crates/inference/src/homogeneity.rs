//! Tests whether estimates from several groups of data are estimates of the same parameters.
//!
//! Cochran's Q (Biometrics 10, 1954) sums the squared differences from the weighted mean, each over its covariance.
//! Since the covariances are estimates themselves, its distribution is that of Welch and James (S. Johansen, *The
//! Welch–James approximation to the distribution of the residual sum of squares in a weighted linear regression*,
//! Biometrika 67, 1980). For one parameter this is Welch's analysis of variance (B. L. Welch, Biometrika 38, 1951).

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Degrees of freedom beyond which a covariance counts as known.
const MANY: f64 = 1e5;

/// Estimate from one group of data.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The parameters.
    pub values: DVector<f64>,
    /// Their covariance, of full rank.
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom of the covariance.
    pub degrees: f64,
}

impl Estimate {
    /// The estimate of a subset of its parameters.
    pub fn of_all(&self, parameters: &[usize]) -> Self {
        Self {
            values: self.values.select_rows(parameters),
            covariance: (self.covariance.select_rows(parameters)).select_columns(parameters),
            degrees: self.degrees,
        }
    }

    /// The estimate of one parameter.
    pub fn of(&self, parameter: usize) -> Self {
        Self {
            values: DVector::from_element(1, self.values[parameter]),
            covariance: DMatrix::from_element(1, 1, self.covariance[(parameter, parameter)]),
            degrees: self.degrees,
        }
    }
}

/// Result of the test.
#[derive(Debug, Clone, PartialEq)]
pub struct Homogeneity {
    /// Mean, weighted by the inverse covariances.
    pub mean: DVector<f64>,
    /// `Q = Σ (θ_g − θ̄)ᵀ V_g⁻¹ (θ_g − θ̄)`.
    pub statistic: f64,
    /// Degrees of freedom of Q: parameters times (groups minus one). Q is about this large if all groups agree.
    pub degrees: f64,
    /// Probability of a Q as large or larger if all groups have the same parameters.
    pub p: f64,
}

impl Homogeneity {
    /// Tests two groups or more; `None` for fewer, or if a covariance is not positive definite.
    pub fn of(all: &[Estimate]) -> Option<Self> {
        let size = all.first()?.values.len();
        let weights = all.iter().map(|own| own.covariance.clone().cholesky());
        let weights: Vec<DMatrix<f64>> = weights
            .map(|own| Some(own?.inverse()))
            .collect::<Option<_>>()?;
        let zero = DMatrix::zeros(size, size);
        let inverse = weights
            .iter()
            .fold(zero, |sum, own| sum + own)
            .cholesky()?
            .inverse();
        let weighed = weights.iter().zip(all).map(|(w, own)| w * &own.values);
        let mean = &inverse * weighed.fold(DVector::zeros(size), |sum, own| sum + own);
        let (mut statistic, mut spread) = (0.0, 0.0);
        for (own, weight) in all.iter().zip(&weights) {
            let off = &own.values - &mean;
            statistic += off.dot(&(weight * &off));
            let rest = DMatrix::identity(size, size) - &inverse * weight;
            let traces = (&rest * &rest).trace() + rest.trace().powi(2);
            spread += traces / (2.0 * own.degrees.max(1.0));
        }
        let degrees = (size * (all.len() - 1)) as f64;
        (degrees > 0.0).then(|| Self {
            p: probability(statistic, degrees, spread),
            mean,
            statistic,
            degrees,
        })
    }
}

/// Probability of a statistic this large or larger, with Johansen's f, A and c.
fn probability(statistic: f64, f: f64, a: f64) -> f64 {
    let c = f + 2.0 * a - 6.0 * a / (f + 2.0);
    let others = f * (f + 2.0) / (3.0 * a);
    match others < MANY {
        true => FisherSnedecor::new(f, others).map_or(f64::NAN, |law| law.sf(statistic / c)),
        false => ChiSquared::new(f).map_or(f64::NAN, |law| law.sf(statistic)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use statrs::distribution::StudentsT;

    fn estimate(value: f64, variance: f64, degrees: f64) -> Estimate {
        Estimate {
            values: DVector::from_element(1, value),
            covariance: DMatrix::from_element(1, 1, variance),
            degrees,
        }
    }

    /// For two groups the test is Welch's t with Satterthwaite's degrees of freedom.
    #[test]
    fn two_groups_are_welchs_test() {
        let (v, w, m, n) = (0.4, 0.1, 6.0, 11.0);
        let found = Homogeneity::of(&[estimate(1.0, v, m), estimate(2.2, w, n)]).expect("two");
        let t = 1.2 / f64::sqrt(v + w);
        let degrees = (v + w) * (v + w) / (v * v / m + w * w / n);
        let law = StudentsT::new(0.0, 1.0, degrees).expect("a law");
        assert!((found.statistic - t * t).abs() < 1e-12);
        assert!((found.p - 2.0 * law.sf(t)).abs() < 1e-6, "{found:?}");
        assert!((found.mean[0] - (1.0 / v + 2.2 / w) / (1.0 / v + 1.0 / w)).abs() < 1e-12);
    }

    #[test]
    fn known_covariances_give_the_chi_squared_law() {
        let all = [1.0, 2.0, 4.0].map(|value| estimate(value, 1.0, 1e12));
        let found = Homogeneity::of(&all).expect("three");
        let q = 14.0 / 3.0;
        assert!((found.statistic - q).abs() < 1e-12 && found.degrees == 2.0);
        // With two degrees of freedom the distribution is exponential.
        assert!((found.p - f64::exp(-0.5 * q)).abs() < 1e-12);
        assert_eq!(Homogeneity::of(&all[..1]), None);
        assert_eq!(
            Homogeneity::of(&[estimate(1.0, 0.0, 9.0), estimate(1.0, 1.0, 9.0)]),
            None
        );
    }

    /// Means of ten values each of six groups with unequal variances: 5 % are rejected if all have the same mean.
    #[test]
    fn the_test_has_its_size() {
        let mut random = ChaCha8Rng::seed_from_u64(21);
        let mut group = |sd: f64| {
            let draws = [(); 10].map(|()| StandardNormal.sample(&mut random));
            let draws: [f64; 10] = draws.map(|own: f64| sd * own);
            let mean = draws.iter().sum::<f64>() / 10.0;
            let squares: f64 = draws.iter().map(|own| (own - mean).powi(2)).sum();
            estimate(mean, squares / 90.0, 9.0)
        };
        let sets = 4000;
        let refused = (0..sets).filter(|_| {
            let all = [1.0, 1.0, 2.0, 2.0, 5.0, 0.5].map(&mut group);
            Homogeneity::of(&all).expect("six").p < 0.05
        });
        let share = refused.count() as f64 / f64::from(sets);
        assert!((share - 0.05).abs() < 0.015, "{share}");
    }
}
