//! Describing functions: dots with error bars over the fitted response.

use super::figure::{Figure, Look, Series};
use super::frequency::{Curve, response_figures};
use crate::inference::spectrum::{Checked, Describing};
use crate::inference::{LEVEL, Spread, quantile};
use nalgebra::Complex;

/// Explanation of the dots for captions.
const CAPTION: &str = " Dots are the describing function at the lines of the target, without a model; bars hold 95 %.";

/// Bode plots of pilot and loop as functions of θ, with the dots; none if the runs give no describing function.
pub fn describing_figures(
    describing: &Describing,
    models: [Curve<'_>; 2],
    theta: &[f64],
    sure: Option<&Spread>,
) -> Vec<Figure> {
    let lines = describing.open_loop.points.iter();
    let logs: Vec<f64> = lines.map(|own| own.frequency.ln()).collect();
    if logs.is_empty() {
        return Vec::new();
    }
    let middle = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    let mut figures = response_figures(models, theta, sure, middle);
    if describing.pilot.points.is_empty() {
        figures.retain(|own| own.name != "bode");
    }
    add_to(&mut figures, describing);
    figures
}

/// Adds the dots to the Bode plots among the figures.
pub fn add_to(figures: &mut [Figure], describing: &Describing) {
    for figure in figures {
        match figure.name.as_str() {
            "bode" => add(figure, &describing.pilot),
            "open-loop" => add(figure, &describing.open_loop),
            _ => {}
        }
    }
}

fn add(figure: &mut Figure, checked: &Checked) {
    let [gain, phase] = &mut figure.panels[..] else {
        return;
    };
    if checked.points.is_empty() {
        return;
    }
    let curve = phase
        .series
        .iter()
        .find(|own| own.label == "fitted")
        .cloned();
    let (mut gains, mut phases) = (Vec::new(), Vec::new());
    for own in &checked.points {
        let half = own.sd * quantile(LEVEL, 2.0 * own.degrees);
        let near = curve.as_ref().map_or(0.0, |curve| at(curve, own.frequency));
        let turned = turned(own.response, near);
        gains.push((
            own.frequency,
            20.0 * own.response.norm().log10(),
            20.0 * half / 10f64.ln(),
        ));
        phases.push((own.frequency, turned, half.to_degrees()));
    }
    gain.series.extend(marks(&gains));
    phase.series.extend(marks(&phases));
    figure.caption += CAPTION;
}

/// Dots, and an error bar through each.
fn marks(points: &[(f64, f64, f64)]) -> [Series; 2] {
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|own| (own.0, own.1)).unzip();
    let bar = |(x, y, half): &(f64, f64, f64)| [(*x, y - half), (*x, y + half), (*x, f64::NAN)];
    let (at, ends): (Vec<f64>, Vec<f64>) = points.iter().flat_map(bar).unzip();
    [
        Series::line("", "data", &at, &ends),
        Series::line("describing function", "data", &x, &y).looks(Look::Dots),
    ]
}

/// The phase of `value`, unwrapped to the nearest of `near` [deg].
fn turned(value: Complex<f64>, near: f64) -> f64 {
    let phase = value.arg().to_degrees();
    phase + 360.0 * ((near - phase) / 360.0).round()
}

/// A curve at an abscissa, or its last value beyond its end.
fn at(curve: &Series, x: f64) -> f64 {
    let place = curve.x.partition_point(|own| *own < x);
    curve
        .y
        .get(place)
        .or(curve.y.last())
        .copied()
        .unwrap_or(0.0)
}
