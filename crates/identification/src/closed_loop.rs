//! The bound on the closed loop of pilot and vehicle, by which a fit keeps it stable.

use nalgebra::Complex;
use pilotage_flights::vehicle::ClosedLoop;
use pilotage_models::Scalar;

/// Smallest decay rate of the closed loop in a fit [1/s]: the real part of each pole is at most minus this. A slow mode
/// then decays within a thousand seconds; flights of seconds cannot determine more.
pub const LOOP_MARGIN: f64 = 1e-3;
/// A pole within this factor of the bound lies on it.
const ON_BOUND: f64 = 1.01;

/// The pole of highest frequency among those on the bound [`LOOP_MARGIN`]; `None` if the loop is unstable or no pole is
/// on the bound.
pub fn on_bound(closed_loop: &ClosedLoop) -> Option<Complex<f64>> {
    let on_bound = |pole: &Complex<f64>| pole.re >= -ON_BOUND * LOOP_MARGIN;
    let poles = closed_loop.poles.iter().copied().filter(on_bound);
    let fastest = poles.max_by(|a, b| a.im.total_cmp(&b.im))?;
    closed_loop.is_stable().then_some(fastest)
}

/// First column of Routh's array of `p(s - margin)`, without its leading entry: all entries are positive exactly if
/// each root of `p` has a real part below `-margin` (Gantmacher, *The Theory of Matrices*, vol. 2, ch. XV, §3). `p` has
/// ascending coefficients and the leading one 1; `out` is as long as its degree.
///
/// When a path leaves the stable region, one of the last two entries vanishes first: a real root, or a pair, is on the
/// margin.
pub fn routh<T: Scalar>(p: &[T], margin: f64, out: &mut [T]) {
    let mut p = p.to_vec();
    shift(&mut p, -margin);
    p.reverse();
    let at = |row: &[T], k: usize| row.get(k).copied().unwrap_or_else(|| T::from(0.0));
    let mut upper: Vec<T> = p.iter().copied().step_by(2).collect();
    let mut lower: Vec<T> = p.iter().copied().skip(1).step_by(2).collect();
    for out in out.iter_mut() {
        *out = lower[0];
        let factor = upper[0] / lower[0];
        let next = (1..upper.len()).map(|k| upper[k] - factor * at(&lower, k));
        let next = next.collect();
        upper = std::mem::replace(&mut lower, next);
        if lower.is_empty() {
            break;
        }
    }
}

/// `p(s)` becomes `p(s + by)`, by Horner's scheme.
fn shift<T: Scalar>(p: &mut [T], by: f64) {
    for first in 0..p.len() - 1 {
        for k in (first..p.len() - 1).rev() {
            let above = p[k + 1];
            p[k] += above * by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
        let mut p = super::super::start::denominator(roots.iter().copied());
        p.push(1.0);
        p
    }

    fn worst(roots: &[Complex<f64>]) -> f64 {
        roots.iter().map(|r| r.re).fold(f64::NEG_INFINITY, f64::max)
    }

    proptest! {
        /// The array agrees with the roots from which the polynomial was made.
        #[test]
        fn the_array_is_positive_where_all_roots_are_left_of_the_margin(
            real in prop::collection::vec(-4.0..0.5_f64, 0..4),
            pairs in prop::collection::vec((-4.0..0.5_f64, 0.1..5.0_f64), 0..4),
            margin in prop::sample::select(vec![0.0, 1e-3, 0.1]),
        ) {
            let pairs = pairs.iter().flat_map(|&(re, im)| [Complex::new(re, im), Complex::new(re, -im)]);
            let roots: Vec<_> = real.iter().map(|&re| Complex::new(re, 0.0)).chain(pairs).collect();
            prop_assume!(!roots.is_empty() && (worst(&roots) + margin).abs() > 1e-4);
            let mut out = vec![f64::NAN; roots.len()];
            routh(&polynomial(&roots), margin, &mut out);
            let stable = worst(&roots) < -margin;
            prop_assert_eq!(out.iter().all(|v| *v > 0.0), stable, "{:?}", out);
        }
    }
}
