//! Numbers of samples, and what draws of a normal distribution are made of.

use nalgebra::DMatrix;

/// The value below which a part of ascending numbers lies, interpolated linearly (Hyndman & Fan, Am. Stat. 50, 1996, number
/// 7); NaN of none.
pub fn quantile(ascending: &[f64], part: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = part * last as f64;
    let (k, rest) = (place as usize, place.fract());
    ascending[k] + rest * (ascending[(k + 1).min(last)] - ascending[k])
}

/// A matrix whose product with its transpose is a covariance, which may be singular.
pub fn square_root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let parts = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
    let sizes = parts.eigenvalues.map(|value| value.max(0.0).sqrt());
    parts.eigenvectors * DMatrix::from_diagonal(&sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_interpolated() {
        let values = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(
            [0.0, 0.5, 0.75, 1.0].map(|part| quantile(&values, part)),
            [1.0, 3.0, 5.0, 8.0]
        );
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn a_root_of_a_singular_covariance_gives_it_back() {
        let own = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 1.0]);
        let root = square_root(&own);
        assert!((&root * root.transpose() - own).norm() < 1e-14);
    }
}
