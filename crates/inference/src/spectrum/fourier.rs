//! Discrete Fourier transforms of any length.

use nalgebra::Complex;
use std::f64::consts::PI;

/// `Σ_t x_t e^(-2πi k t / n)` for any number n of values; if n is not a power of two, by Bluestein's convolution (IEEE
/// Trans. Audio Electroacoust. 18, 1970).
pub fn fourier(x: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let n = x.len();
    if n.is_power_of_two() || n == 0 {
        let mut all = x.to_vec();
        transform(&mut all);
        return all;
    }
    let size = (2 * n - 1).next_power_of_two();
    // k t = (k² + t² - (k - t)²)/2; k² is taken modulo 2n, the period of the angle.
    let angle = |k: usize| PI * ((k as u128 * k as u128) % (2 * n as u128)) as f64 / n as f64;
    let chirp: Vec<Complex<f64>> = (0..n)
        .map(|k| Complex::from_polar(1.0, -angle(k)))
        .collect();
    let zero = Complex::new(0.0, 0.0);
    let (mut a, mut b) = (vec![zero; size], vec![zero; size]);
    for (k, own) in chirp.iter().enumerate() {
        a[k] = x[k] * own;
        b[k] = own.conj();
        b[(size - k) % size] = own.conj();
    }
    transform(&mut a);
    transform(&mut b);
    // The inverse transform is that of the conjugates, conjugated.
    (a.iter_mut().zip(&b)).for_each(|(a, b)| *a = (*a * b).conj());
    transform(&mut a);
    let back = |(own, a): (&Complex<f64>, &Complex<f64>)| own * a.conj() / size as f64;
    chirp.iter().zip(&a).map(back).collect()
}

/// In-place transform of a number of values that is a power of two (Cooley & Tukey, Math. Comput. 19, 1965).
fn transform(x: &mut [Complex<f64>]) {
    let n = x.len();
    if n < 2 {
        return;
    }
    let bits = n.trailing_zeros();
    for k in 0..n {
        let turned = k.reverse_bits() >> (usize::BITS - bits);
        if k < turned {
            x.swap(k, turned);
        }
    }
    let roots: Vec<Complex<f64>> = (0..n / 2)
        .map(|k| Complex::from_polar(1.0, -2.0 * PI * k as f64 / n as f64))
        .collect();
    let mut half = 1;
    while half < n {
        for block in x.chunks_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let turned = roots[k * (n / (2 * half))] * *b;
                (*a, *b) = (*a + turned, *a - turned);
            }
        }
        half *= 2;
    }
}

/// Amplitudes `2/n Σ_t x_t e^(-2πi k t / n)` of the values minus their mean, for 0 ≤ k < n/2: a sine
/// `a sin(2πkt/n + φ)` has `|a|` at k.
pub fn amplitudes(values: &[f64]) -> Vec<Complex<f64>> {
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n as f64;
    let centred: Vec<Complex<f64>> = (values.iter())
        .map(|x| Complex::new(x - mean, 0.0))
        .collect();
    let mut all = fourier(&centred);
    all.truncate(n.div_ceil(2));
    all.iter_mut().for_each(|own| *own *= 2.0 / n as f64);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum() {
        for n in [1, 2, 3, 7, 16, 45, 90, 97] {
            let x: Vec<Complex<f64>> = (0..n)
                .map(|t| Complex::new((1.7 * t as f64).sin() + 0.3, (0.4 * t as f64).cos()))
                .collect();
            for (k, found) in fourier(&x).iter().enumerate() {
                let turn = |t: usize| -2.0 * PI * (k * t % n) as f64 / n as f64;
                let terms = x.iter().enumerate();
                let sum: Complex<f64> = terms
                    .map(|(t, x)| x * Complex::from_polar(1.0, turn(t)))
                    .sum();
                assert!((found - sum).norm() < 1e-12 * n as f64, "{n} {k}");
            }
        }
    }

    #[test]
    fn a_sine_has_its_amplitude_at_its_line() {
        let wave = |t: usize| 5.0 + 3.0 * (2.0 * PI * 7.0 * t as f64 / 90.0 + 0.4).sin();
        let found = amplitudes(&(0..90).map(wave).collect::<Vec<_>>());
        for (k, own) in found.iter().enumerate() {
            let expected = if k == 7 { 3.0 } else { 0.0 };
            assert!((own.norm() - expected).abs() < 1e-12, "{k}");
        }
    }
}
