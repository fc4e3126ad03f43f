//! Frequency responses of a fitted pilot and of its loop with the vehicle, with confidence bands.

use super::figure::{Axis, Figure, Look, Panel, Series};
use crate::inference::Spread;
use crate::linear::{Margins, Response};
use crate::models::{Pilot, Quadcopter};
use crate::vehicle::{LinearVehicle, pilot_response};
use nalgebra::Complex;
use pilotage_text::number::significant;

/// Number of frequency intervals.
const POINTS: u32 = 160;
/// Number of decades on each side of the crossover.
const DECADES: f64 = 1.3;

/// A frequency response as a function of θ and frequency [rad/s].
pub type Curve<'a> = &'a dyn Fn(&[f64], f64) -> Complex<f64>;

/// A fitted pilot.
#[derive(Debug, Clone, Copy)]
pub struct Fitted<'a> {
    /// Structure of the pilot.
    pub pilot: Pilot,
    /// θ.
    pub theta: &'a [f64],
    /// The vehicle in its closed loop; `None` if no vehicle was given.
    pub vehicle: Option<&'a Quadcopter>,
    /// Covariance of θ, if known.
    pub sure: Option<&'a Spread>,
}

/// Gain and phase of the pilot, and of the open loop if the vehicle is known.
pub fn bode_figures(fitted: &Fitted<'_>) -> Vec<Figure> {
    let Fitted {
        pilot: order,
        theta,
        vehicle,
        sure,
    } = *fitted;
    let of_pilot = |theta: &[f64], omega: f64| pilot_response(order, theta, omega);
    let mut figures = Vec::new();
    let mut middle = None;
    if let Some(vehicle) = vehicle {
        let vehicle = LinearVehicle::of(vehicle);
        let of_loop = |theta: &[f64], omega: f64| vehicle.loop_at(order, theta, omega);
        middle = crossover(&of_loop, theta);
        let bode = Bode {
            of: &of_loop,
            theta,
            sure,
            middle: middle.unwrap_or(1.0),
        };
        figures.push(bode.figure(
            "open-loop",
            "Open loop: Bode plot",
            &format!(
                "Pilot and vehicle, cut open at the stick.{}",
                bode.margins()
            ),
            true,
        ));
    }
    let bode = Bode {
        of: &of_pilot,
        theta,
        sure,
        middle: middle.unwrap_or(1.0),
    };
    let caption = "From the error [m] to the stick.";
    figures.insert(0, bode.figure("bode", "Pilot: Bode plot", caption, false));
    figures
}

/// The open loop at a cut, as a function of θ.
pub fn loop_figure(
    name: &str,
    cut: &str,
    of: Curve<'_>,
    theta: &[f64],
    sure: Option<&Spread>,
) -> Figure {
    let bode = Bode {
        of,
        theta,
        sure,
        middle: crossover(of, theta).unwrap_or(1.0),
    };
    let caption = format!(
        "Cut open at {cut}, other loops closed; linear where the first run ends.{}",
        bode.margins()
    );
    bode.figure(
        name,
        &format!("Open loop at {cut}: Bode plot"),
        &caption,
        true,
    )
}

/// A path through the pilot from an input to an output, around the frequency `middle` \[rad/s\].
pub fn path_figure(
    name: &str,
    [input, output]: &[String; 2],
    of: Curve<'_>,
    theta: &[f64],
    sure: Option<&Spread>,
    middle: f64,
) -> Figure {
    let bode = Bode {
        of,
        theta,
        sure,
        middle,
    };
    let title = format!("Pilot, {input} to {output}: Bode plot");
    bode.figure(name, &title, "Linear where the first run ends.", false)
}

/// Bode plots of pilot and open loop as functions of θ, around their crossover, or `middle` [rad/s] if there is none.
pub fn response_figures(
    [pilot, open_loop]: [Curve<'_>; 2],
    theta: &[f64],
    sure: Option<&Spread>,
    middle: f64,
) -> Vec<Figure> {
    let middle = crossover(open_loop, theta).unwrap_or(middle);
    let bode = |of| Bode {
        of,
        theta,
        sure,
        middle,
    };
    let (first, second): (Bode<'_>, Bode<'_>) = (bode(pilot), bode(open_loop));
    let caption = format!("From the error to the position.{}", second.margins());
    vec![
        first.figure(
            "bode",
            "Pilot: Bode plot",
            "From the error to the stick.",
            false,
        ),
        second.figure("open-loop", "Open loop: Bode plot", &caption, true),
    ]
}

/// The first gain-crossover frequency of a loop [rad/s].
pub fn crossover(of: Curve<'_>, theta: &[f64]) -> Option<f64> {
    let evaluate = |omega: f64| of(theta, omega);
    let response = Response::of(evaluate, &[], None);
    let margins = Margins::of(&response, evaluate);
    margins.phase_margin().map(|crossing| crossing.frequency)
}

struct Bode<'a> {
    of: Curve<'a>,
    theta: &'a [f64],
    sure: Option<&'a Spread>,
    /// Centre frequency [rad/s].
    middle: f64,
}

impl Bode<'_> {
    fn figure(&self, name: &str, title: &str, caption: &str, is_loop: bool) -> Figure {
        let omega: Vec<f64> = (0..=POINTS)
            .map(|k| {
                self.middle * 10f64.powf(DECADES * (2.0 * f64::from(k) / f64::from(POINTS) - 1.0))
            })
            .collect();
        let value: Vec<Complex<f64>> = omega
            .iter()
            .map(|omega| (self.of)(self.theta, *omega))
            .collect();
        let gain: Vec<f64> = value.iter().map(|v| decibels(*v)).collect();
        let response = Response {
            frequency: omega.clone(),
            value: value.clone(),
        };
        let phase: Vec<f64> = response.phase().into_iter().map(f64::to_degrees).collect();
        let gains = self.band(&omega, &gain, |own, _| decibels(own));
        let phases = self.band(&omega, &phase, |own, at| (own / at).arg().to_degrees());
        let mut figure = Figure::of(
            name,
            title,
            caption,
            panel("gain [dB]", &omega, &gain, gains),
        );
        figure
            .panels
            .push(panel("phase [deg]", &omega, &phase, phases));
        if is_loop {
            self.mark(&mut figure, &response, &phase);
        }
        figure
    }

    /// Confidence band around `values` of a quantity that depends on the response and on that of the fitted θ (delta
    /// method).
    fn band(
        &self,
        omega: &[f64],
        values: &[f64],
        of: impl Fn(Complex<f64>, Complex<f64>) -> f64,
    ) -> Option<[Vec<f64>; 2]> {
        let fitted: Vec<Complex<f64>> = (omega.iter())
            .map(|omega| (self.of)(self.theta, *omega))
            .collect();
        let own = |theta: &[f64]| {
            let pairs = omega.iter().zip(&fitted);
            pairs
                .map(|(omega, at)| of((self.of)(theta, *omega), *at))
                .collect()
        };
        let ends = self.sure?.derived(self.theta, values, own);
        let (low, high): (Vec<f64>, Vec<f64>) = ends.iter().map(|own| (own.low, own.high)).unzip();
        (low.iter().chain(&high).all(|end| end.is_finite())).then_some([low, high])
    }

    /// Marks the crossover in both panels.
    fn mark(&self, figure: &mut Figure, response: &Response, phase: &[f64]) {
        let Some(omega) = crossover(self.of, self.theta) else {
            return;
        };
        let right = response
            .frequency
            .partition_point(|own| *own < omega)
            .clamp(1, phase.len() - 1);
        let turn = (phase[right] - (self.of)(self.theta, omega).arg().to_degrees()) / 360.0;
        let at = (self.of)(self.theta, omega).arg().to_degrees() + 360.0 * turn.round();
        let words = [
            format!("{} rad/s", significant(omega, 3)),
            format!("{at:.0}°").replace('-', "\u{2212}"),
        ];
        for ((panel, y), words) in figure.panels.iter_mut().zip([0.0, at]).zip(words) {
            let dot = Series::line("crossover", "line-2", &[omega], &[y]).looks(Look::Dots);
            panel.series.push(Series {
                words: vec![words],
                ..dot
            });
        }
    }

    /// Crossover and phase margin with their intervals, for the caption.
    fn margins(&self) -> String {
        let Some(omega) = crossover(self.of, self.theta) else {
            return String::new();
        };
        let margin = |theta: &[f64]| {
            let omega = crossover(self.of, theta).unwrap_or(f64::NAN);
            (-(self.of)(theta, omega)).arg().to_degrees()
        };
        let interval = |of: &dyn Fn(&[f64]) -> f64| {
            let all = self
                .sure?
                .derived(self.theta, &[of(self.theta)], |theta| vec![of(theta)]);
            all.into_iter().next()
        };
        let ends = |of: &dyn Fn(&[f64]) -> f64, digits| match interval(of) {
            Some(own) if own.low.is_finite() => {
                format!(
                    " ({} to {})",
                    significant(own.low, digits),
                    significant(own.high, digits)
                )
            }
            _ => String::new(),
        };
        format!(
            " Crossover at {}{} rad/s, phase margin {}{}°; intervals of 95 % in brackets.",
            significant(omega, 3),
            ends(&|theta| crossover(self.of, theta).unwrap_or(f64::NAN), 3),
            significant(margin(self.theta), 3),
            ends(&margin, 3)
        )
    }
}

fn decibels(value: Complex<f64>) -> f64 {
    20.0 * value.norm().log10()
}

fn panel(label: &str, omega: &[f64], values: &[f64], band: Option<[Vec<f64>; 2]>) -> Panel {
    let band = band.map(|[low, high]| Series::band("95 %", "line-1", omega, [&low, &high]));
    let line = Series::line("fitted", "line-1", omega, values);
    Panel {
        x: Axis::frequency(),
        y: Axis::linear(label),
        height: 230.0,
        series: band.into_iter().chain([line]).collect(),
        ..Panel::default()
    }
}
