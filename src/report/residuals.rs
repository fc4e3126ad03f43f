//! What a fit leaves over: residuals over time, their autocorrelation and their spectrum. Residuals of a right model
//! with white noise have neither correlation nor colour (Ljung, *System Identification*, 2nd ed., section 16.6).

use super::figure::{Axis, Figure, Panel, Series};
use crate::inference::crossed::Crossed;
use crate::inference::residuals::{autocorrelation, centred, is_even};
use nalgebra::Complex;
use std::f64::consts::PI;

/// Quantile of the standard normal distribution for 95 % on both sides.
const NORMAL: f64 = 1.959_964;
/// Part of a run up to which lags are shown.
const LAGS: usize = 5;
/// Most samples of a segment of which a spectrum is taken.
const SEGMENT: usize = 1024;

/// The residuals of a signal in a run.
#[derive(Debug, Clone)]
pub struct Residuals<'a> {
    /// The run.
    pub run: &'a str,
    /// Its entry in the legend.
    pub label: String,
    /// Its colour.
    pub colour: String,
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// Recorded minus modelled; NaN where nothing was recorded.
    pub values: Vec<f64>,
}

/// Over time, and of samples that are evenly apart, by lag and by frequency. `unit` is the residuals'.
pub fn residual_figure(
    name: &str,
    title: &str,
    caption: &str,
    unit: &str,
    all: &[Residuals<'_>],
) -> Figure {
    let line = |own: &Residuals<'_>, [x, y]: [&[f64]; 2]| {
        Series::line(&own.label, own.colour.clone(), x, y).of(own.run)
    };
    let over_time = all.iter().map(|own| line(own, [own.time, &own.values]));
    let even: Vec<Residuals<'_>> =
        (all.iter().filter(|own| is_even([own.time])).cloned()).collect();
    let correlated = even.iter().map(|own| {
        let r = autocorrelation(&own.values, own.values.len() / LAGS);
        let lags: Vec<f64> = (0..r.len()).map(|k| k as f64 * step(own.time)).collect();
        line(own, [&lags, &r])
    });
    let correlated: Vec<Series> = white_band(&even).into_iter().chain(correlated).collect();
    let spectra = even.iter().map(|own| {
        let (frequency, density) = spectrum(&own.values, step(own.time));
        line(own, [&frequency, &density])
    });
    let squared = match unit {
        "" | "1" => "1/(rad/s)".to_owned(),
        unit => format!("{unit}²/(rad/s)"),
    };
    let panel = |x: Axis, y: Axis, series: Vec<Series>| Panel {
        x,
        y,
        height: 220.0,
        series,
        ..Panel::default()
    };
    let log = |label: String| Axis {
        log: true,
        ..Axis::linear(label)
    };
    let mut panels = vec![panel(
        Axis::time(),
        Axis::of("residual", unit),
        over_time.collect(),
    )];
    // Lags and frequencies are those of samples that are evenly apart.
    if !even.is_empty() {
        let density = log(format!("spectral density [{squared}]"));
        panels.push(panel(
            Axis::linear("lag [s]"),
            Axis::linear("autocorrelation"),
            correlated,
        ));
        panels.push(panel(Axis::frequency(), density, spectra.collect()));
    }
    Figure {
        panels,
        ..Figure::of(name, title, caption, Panel::default())
    }
}

/// What the lines beside a correlation mean.
const LEFT: &str = "99 % where nothing is left";

/// Residuals beside an input, by lag, with the band of 99 %.
pub fn crossed_panel(label: &str, own: &Crossed) -> Panel {
    let low: Vec<f64> = own.bands.iter().map(|half| -half).collect();
    Panel {
        x: Axis::linear("lag [s]"),
        y: Axis::linear(format!("correlation ({label})")),
        height: 220.0,
        series: vec![
            // As lines, since axes do not follow bands as far as these are wide.
            Series::line(LEFT, "quiet", &own.lags, &low),
            Series::line(LEFT, "quiet", &own.lags, &own.bands),
            Series::line("correlation", "line-1", &own.lags, &own.correlations),
        ],
        ..Panel::default()
    }
}

/// Between which values 95 of 100 autocorrelations of white noise of the longest run lie.
fn white_band(all: &[Residuals<'_>]) -> Option<Series> {
    let count = |own: &Residuals<'_>| own.values.iter().filter(|e| e.is_finite()).count();
    let longest = all.iter().max_by_key(|own| own.values.len())?;
    let (end, half) = (
        (longest.values.len() / LAGS) as f64 * step(longest.time),
        NORMAL / (count(longest) as f64).sqrt(),
    );
    let band = Series::band(
        "95 % of white noise",
        "quiet",
        &[0.0, end],
        [&[-half; 2], &[half; 2]],
    );
    half.is_finite().then_some(band)
}

/// Mean distance of samples \[s\].
fn step(time: &[f64]) -> f64 {
    match time {
        [first, .., last] => (last - first) / (time.len() - 1) as f64,
        _ => 1.0,
    }
}

/// Frequencies [rad/s] and one-sided spectral density [1/(rad/s), times units²], by Welch's method: Hann windows over
/// halves that overlap (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967). Its integral is the variance.
pub fn spectrum(values: &[f64], step: f64) -> (Vec<f64>, Vec<f64>) {
    let e = centred(values);
    // The largest power of two that is no longer than the run.
    let n = SEGMENT.min((e.len() + 1).next_power_of_two() / 2);
    if n < 8 {
        return (Vec::new(), Vec::new());
    }
    let window: Vec<f64> = (0..n)
        .map(|k| (PI * (k as f64 + 0.5) / n as f64).sin().powi(2))
        .collect();
    let power: f64 = window.iter().map(|w| w * w).sum();
    let mut density = vec![0.0; n / 2];
    let starts: Vec<usize> = (0..=e.len() - n).step_by(n / 2).collect();
    for first in &starts {
        let cut = e[*first..]
            .iter()
            .zip(&window)
            .map(|(e, w)| Complex::new(e * w, 0.0));
        let transformed = fourier(&cut.collect::<Vec<_>>());
        for (own, value) in density.iter_mut().zip(&transformed[1..]) {
            *own += value.norm_sqr() * step / (PI * power * starts.len() as f64);
        }
    }
    let frequency = (1..=n / 2).map(|k| 2.0 * PI * k as f64 / (n as f64 * step));
    (frequency.collect(), density)
}

/// `Σ_t x_t e^(-2πi k t / n)` for a power of two of values (Cooley & Tukey, Math. Comput. 19, 1965).
fn fourier(x: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let n = x.len();
    if n == 1 {
        return x.to_vec();
    }
    let part =
        |first: usize| fourier(&x.iter().copied().skip(first).step_by(2).collect::<Vec<_>>());
    let (even, odd) = (part(0), part(1));
    let turned =
        |k: usize| Complex::from_polar(1.0, -2.0 * PI * k as f64 / n as f64) * odd[k % (n / 2)];
    (0..n).map(|k| even[k % (n / 2)] + turned(k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// `e_t = a e_{t-1} + w_t`.
    fn coloured(n: usize, a: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut e = 0.0;
        let mut next = || {
            let w: f64 = StandardNormal.sample(&mut random);
            e = a * e + w;
            e
        };
        (0..n).map(|_| next()).collect()
    }

    #[test]
    fn the_transform_is_the_sum() {
        let x: Vec<Complex<f64>> = coloured(16, 0.5)
            .into_iter()
            .map(|e| Complex::new(e, 0.0))
            .collect();
        for (k, found) in fourier(&x).iter().enumerate() {
            let term = |(t, x): (usize, &Complex<f64>)| {
                x * Complex::from_polar(1.0, -PI * (k * t) as f64 / 8.0)
            };
            let sum: Complex<f64> = x.iter().enumerate().map(term).sum();
            assert!((found - sum).norm() < 1e-12, "{k}");
        }
    }

    /// The density of `e_t = a e_{t-1} + w_t` is `Δt/π / |1 - a e^(-iωΔt)|²` for ω from 0 to π/Δt.
    #[test]
    fn the_spectrum_is_that_of_the_process() {
        let (a, step) = (0.8, 0.1);
        let (frequency, density) = spectrum(&coloured(200_000, a), step);
        for (omega, found) in frequency.iter().zip(&density).take(500).step_by(50) {
            let exact = step
                / PI
                / (Complex::new(1.0, 0.0) - Complex::from_polar(a, -omega * step)).norm_sqr();
            assert!(
                (found / exact - 1.0).abs() < 0.25,
                "{omega} {found} {exact}"
            );
        }
        let variance: f64 = density.iter().sum::<f64>() * frequency[0];
        assert!((variance * (1.0 - a * a) - 1.0).abs() < 0.05, "{variance}");
    }
}
