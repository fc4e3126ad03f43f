//! Figures of residuals: over time, their autocorrelation and their spectrum. For a correct model with white noise,
//! residuals are neither autocorrelated nor coloured (Ljung, *System Identification*, 2nd ed., section 16.6).

use super::figure::{Axis, Figure, Panel, Series};
use crate::inference::crossed::Crossed;
use crate::inference::residuals::{autocorrelation, centred, is_even};
use crate::inference::spectrum::fourier;
use nalgebra::Complex;
use std::f64::consts::PI;

/// Two-sided 95 % quantile of the standard normal distribution.
const NORMAL: f64 = 1.959_964;
/// Lags are shown up to the length of the run divided by this.
const LAGS: usize = 5;
/// Maximum number of samples in a segment of a spectrum.
const SEGMENT: usize = 1024;

/// The residuals of a signal in one run.
#[derive(Debug, Clone)]
pub struct Residuals<'a> {
    /// Name of the run.
    pub run: &'a str,
    /// Legend entry.
    pub label: String,
    /// Name of the colour.
    pub colour: String,
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// Recorded minus modelled; NaN for missing samples.
    pub values: Vec<f64>,
}

/// Residuals over time and, for evenly spaced samples, by lag and by frequency. `unit` is the unit of the residuals.
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
    // Autocorrelation and spectrum require evenly spaced samples.
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

/// Legend entry of the confidence limits of a correlation.
const LEFT: &str = "99 % where nothing is left";

/// Cross-correlation of residuals and an input by lag, with the 99 % band.
pub fn crossed_panel(label: &str, own: &Crossed) -> Panel {
    let low: Vec<f64> = own.bands.iter().map(|half| -half).collect();
    Panel {
        x: Axis::linear("lag [s]"),
        y: Axis::linear(format!("correlation ({label})")),
        height: 220.0,
        series: vec![
            // Drawn as lines, since axes do not fully cover wide bands.
            Series::line(LEFT, "quiet", &own.lags, &low),
            Series::line(LEFT, "quiet", &own.lags, &own.bands),
            Series::line("correlation", "line-1", &own.lags, &own.correlations),
        ],
        ..Panel::default()
    }
}

/// The 95 % band of autocorrelations of white noise, for the longest run.
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

/// Mean sampling interval \[s\].
fn step(time: &[f64]) -> f64 {
    match time {
        [first, .., last] => (last - first) / (time.len() - 1) as f64,
        _ => 1.0,
    }
}

/// Frequencies [rad/s] and one-sided spectral density [1/(rad/s), times units²], by Welch's method with Hann windows
/// over half-overlapping segments (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967). Its integral is the
/// variance.
pub fn spectrum(values: &[f64], step: f64) -> (Vec<f64>, Vec<f64>) {
    let e = centred(values);
    // The largest power of two that does not exceed the length of the run.
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
    // The Nyquist frequency is its own mirror image: one side has half of it.
    if let Some(last) = density.last_mut() {
        *last *= 0.5;
    }
    let frequency = (1..=n / 2).map(|k| 2.0 * PI * k as f64 / (n as f64 * step));
    (frequency.collect(), density)
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
