//! Spectral lines corrected for transients, and the remnant next to them.

use nalgebra::{Complex, DMatrix, Matrix3, Vector3};

/// Number of bins next to a line from which transient and remnant are estimated.
const NEIGHBOURS: usize = 8;
/// Coefficients of the local polynomial.
const TERMS: usize = 3;

/// A line in several signals of a run.
#[derive(Debug, Clone)]
pub(super) struct Line {
    /// Value of each signal at the line, without the transient.
    pub values: Vec<Complex<f64>>,
    /// Residuals of the transient's fit in the neighbouring bins: one row per signal.
    pub beside: DMatrix<Complex<f64>>,
    /// Number of independent complex values in a row of `beside`.
    pub degrees: f64,
    /// Variance of `values` relative to that of the noise in a bin.
    pub inflation: f64,
}

/// The line k of these spectra. The start and end of a run cause a transient with a smooth spectrum: a parabola is
/// fitted to the bins that are not excited, by least squares, and subtracted at the line; its residuals in these bins
/// are noise (the local polynomial method: Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*,
/// 2nd ed., section 7.3). `None` if there are not enough such bins.
pub(super) fn line(spectra: &[Vec<Complex<f64>>], k: usize, excited: &[usize]) -> Option<Line> {
    let beside = neighbours(k, spectra.first()?.len(), excited);
    let degrees = beside.len().checked_sub(TERMS).filter(|left| *left > 0)?;
    let row = |bin: usize| {
        let x = (bin as f64 - k as f64) / NEIGHBOURS as f64;
        Vector3::new(1.0, x, x * x)
    };
    let normal: Matrix3<f64> = beside
        .iter()
        .map(|bin| row(*bin) * row(*bin).transpose())
        .sum();
    let inverse = normal.try_inverse()?;
    let mut left = DMatrix::zeros(spectra.len(), beside.len());
    let mut values = Vec::new();
    for (i, spectrum) in spectra.iter().enumerate() {
        let mut right = [Vector3::zeros(); 2];
        for bin in &beside {
            right[0] += row(*bin) * spectrum[*bin].re;
            right[1] += row(*bin) * spectrum[*bin].im;
        }
        let [re, im] = right.map(|own| inverse * own);
        let smooth = |bin: usize| Complex::new(row(bin).dot(&re), row(bin).dot(&im));
        for (j, bin) in beside.iter().enumerate() {
            left[(i, j)] = spectrum[*bin] - smooth(*bin);
        }
        values.push(spectrum[k] - smooth(k));
    }
    Some(Line {
        values,
        beside: left,
        degrees: degrees as f64,
        inflation: 1.0 + inverse[(0, 0)],
    })
}

/// The bins nearest to k that are not excited, without the mean (bin 0).
fn neighbours(k: usize, bins: usize, excited: &[usize]) -> Vec<usize> {
    let is_free = |bin: &usize| excited.binary_search(bin).is_err();
    let mut all: Vec<usize> = (1..bins).filter(is_free).collect();
    all.sort_by_key(|bin| bin.abs_diff(k));
    all.truncate(NEIGHBOURS);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola with lines added to it, and no noise.
    #[test]
    fn a_smooth_transient_is_taken_away() {
        let smooth = |k: usize| Complex::new(1.0 + 0.1 * k as f64, 0.02 * (k * k) as f64);
        let mut spectrum: Vec<Complex<f64>> = (0..30).map(smooth).collect();
        let excited = [2, 3, 5, 12];
        for k in excited {
            spectrum[k] += Complex::new(k as f64, -1.0);
        }
        for k in excited {
            let found = line(&[spectrum.clone()], k, &excited).unwrap();
            assert!((found.values[0] - Complex::new(k as f64, -1.0)).norm() < 1e-10);
            assert!(found.beside.iter().all(|own| own.norm() < 1e-10) && found.degrees == 5.0);
            assert!(found.inflation > 1.0);
        }
        assert!(line(&[spectrum[..6].to_vec()], 2, &excited).is_none());
    }
}
