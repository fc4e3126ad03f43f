//! Burg's method.

use crate::restricted::LARGEST;

/// Partial autocorrelations of a process, estimated from several series of it, up to an order.
///
/// Each one minimises the sum of the forward and backward prediction errors (J. P. Burg, *Maximum Entropy Spectral
/// Analysis*, 1975). Estimates from sample autocovariances are too small if values change little between samples, so
/// that a likelihood based on them chooses too low an order.
pub fn partial(series: Vec<Vec<f64>>, order: usize) -> Vec<f64> {
    // Forward prediction error of each value, and backward prediction error of the value as many samples before.
    let mut left: Vec<[Vec<f64>; 2]> = series.into_iter().map(|own| [own.clone(), own]).collect();
    let mut found = Vec::new();
    for _ in 0..order {
        let (mut product, mut squares) = (0.0, 0.0);
        for (a, b) in left.iter().flat_map(pairs) {
            product += 2.0 * a * b;
            squares += a * a + b * b;
        }
        let k = if squares > 0.0 {
            product / squares
        } else {
            0.0
        };
        let k = k.clamp(-LARGEST, LARGEST);
        for own in &mut left {
            *own = pairs(own)
                .map(|(a, b)| (a - k * b, b - k * a))
                .unzip()
                .into();
        }
        found.push(k);
    }
    found
}

fn pairs([later, earlier]: &[Vec<f64>; 2]) -> impl Iterator<Item = (f64, f64)> {
    later.iter().skip(1).copied().zip(earlier.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autoregression::Autoregression;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Series of x = 1.675 x₋₁ - 0.7165 x₋₂ + w + 0.9 w₋₁ with w = 0.9 w₋₁ + e, a remnant smoothed by a loop.
    fn smooth(runs: u64, count: usize) -> Vec<Vec<f64>> {
        let run = |seed| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let (mut x, mut w) = ([0.0; 2], 0.0);
            let step = |_| {
                let e: f64 = StandardNormal.sample(&mut random);
                let next = 0.9 * w + e;
                x = [1.675 * x[0] - 0.7165 * x[1] + next + 0.9 * w, x[0]];
                w = next;
                x[0]
            };
            (0..count + 200).map(step).skip(200).collect()
        };
        (0..runs).map(run).collect()
    }

    /// A moving average requires many orders; the variance of an offset depends on the spectrum at 0.
    #[test]
    fn smooth_noise_has_a_high_order_and_its_power_at_low_frequencies() {
        let time: Vec<f64> = (0..300).map(f64::from).collect();
        let series = smooth(8, 300).into_iter().map(|own| (own, time.clone()));
        let process = Autoregression::of_series(&series.collect::<Vec<_>>());
        let ones = process.one_step(&[1.0; 300], &time)[299];
        let power = process.variance / (1.0 - ones).powi(2);
        // Transfer function from e at z = 1.
        let expected = (1.9_f64 / (0.0415 * 0.1)).powi(2);
        assert!(process.order() > 4, "{process:?}");
        assert!((power / expected).ln().abs() < 0.5, "{power} {expected}");
    }

    /// Each value of an undamped oscillation is predicted by the two before it, even in a short series.
    #[test]
    fn a_sine_is_predicted() {
        let series = (0..40).map(|t| (0.3 * f64::from(t) + 0.2).sin()).collect();
        let found = partial(vec![series], 2);
        assert!((found[0] - 0.3_f64.cos()).abs() < 0.01, "{found:?}");
        assert!((found[1] + 1.0).abs() < 1e-3, "{found:?}");
    }
}
