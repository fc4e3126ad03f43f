//! The page of a linearised system: poles, and Bode and Nyquist plots of its loops.

use super::figure::{Axis, Figure, Look, Panel, Series};
use super::html::{Html, Made, figure, header, html, paragraph, section, table, whole};
use super::number;
use super::overlay;
use super::palette::colour;
use super::tables;
use crate::linear::{Margins, Mode, Response};
use nalgebra::Complex;
use pilotage_text::number::significant;
use std::f64::consts::PI;

/// Contents of the page of a linearised system.
#[derive(Debug, Clone, Copy)]
pub struct LoopPage<'a> {
    /// Time of the linearisation \[s\].
    pub time: f64,
    /// The poles, in continuous time and optionally in steps.
    pub stability: &'a [Stability<'a>],
    /// The open loops.
    pub loops: &'a [LoopFigure<'a>],
    /// Notes.
    pub notes: &'a [String],
    /// Input files with their SHA-256.
    pub files: &'a [(String, String)],
    /// Origin of the page.
    pub made: &'a Made,
}

/// The poles of the coupled system, and the verdict.
#[derive(Debug, Clone)]
pub struct Stability<'a> {
    /// Communication step \[s\]; `None` in continuous time.
    pub step: Option<f64>,
    /// The modes of the poles.
    pub modes: &'a [Mode],
    /// The verdict in one word, for the title: `stable`.
    pub word: &'a str,
    /// The verdict in a sentence.
    pub words: String,
    /// CSS class of the verdict: `good`, `doubtful` or `bad`.
    pub class: &'a str,
}

/// A displayed loop.
#[derive(Debug, Clone, Copy)]
pub struct LoopFigure<'a> {
    /// Connection at which the loop is cut: `instance.output=instance.input`.
    pub connection: &'a str,
    /// Communication step \[s\]; `None` in continuous time.
    pub step: Option<f64>,
    /// `L(jω)`.
    pub response: &'a Response,
    /// Its margins.
    pub margins: &'a Margins,
}

fn in_steps(step: Option<f64>) -> String {
    step.map_or_else(String::new, |step| format!(", in steps of {step} s"))
}

impl LoopFigure<'_> {
    fn label(&self) -> String {
        format!("{}{}", self.connection, in_steps(self.step))
    }

    /// Frequencies at which the gain is 1, or if there are none, at which the phase is -180° [rad/s].
    fn crossings(&self) -> Vec<f64> {
        let gain = self.margins.gain_crossings.iter().map(|c| c.frequency);
        let phase = phase_crossings(self.margins);
        match self.margins.gain_crossings.is_empty() {
            false => gain.collect(),
            true => phase.collect(),
        }
    }
}

/// Frequencies at which the phase is -180° [rad/s], as far as a logarithmic axis has them.
fn phase_crossings(margins: &Margins) -> impl Iterator<Item = f64> {
    let all = margins.phase_crossings.iter().map(|c| c.frequency);
    all.filter(|frequency| *frequency > 0.0)
}

/// The page as a self-contained HTML file.
pub fn loop_page(page: &LoopPage) -> String {
    // The title shows the worst verdict.
    let rank = |class: &str| ["good", "doubtful", "bad"].iter().position(|c| *c == class);
    let worst = page.stability.iter().max_by_key(|s| rank(s.class));
    let (class, word) = worst.map_or(("doubtful", "no poles"), |s| (s.class, s.word));
    let files = page.files.iter().map(|(name, sum)| (&**name, &**sum));
    let body = html! {
        (header("Linearised system", class, word))
        p { "The coupled system, linear at " (page.time) " s." }
        @for stability in page.stability { (verdict(stability)) }
        @for note in page.notes { (paragraph(Some("caution"), note)) }
        @if !page.loops.is_empty() { (loops(page.loops)) }
        @for stability in page.stability {
            (section(&format!("Poles of the closed loop{}", in_steps(stability.step)), &overlay::table(&tables::modes(stability.modes))))
        }
        (section("Files", &tables::files(files)))
    };
    whole("linearised system", &body, page.made)
}

fn verdict(stability: &Stability) -> Html {
    let class = match stability.class {
        "bad" => Some("warning"),
        "doubtful" => Some("caution"),
        _ => None,
    };
    paragraph(class, &stability.words)
}

const CUT: &str = "The system is cut open at a connection; L is what comes back there, with its sign turned, so that \
                   1 + L = 0 is the closed loop.";

fn loops(loops: &[LoopFigure]) -> Html {
    let margins = html! { (paragraph(None, CUT)) (margins(loops)) };
    html! { (section("Margins", &margins)) (figure(&bode(loops))) (figure(&nyquist(loops))) }
}

fn words(frequency: f64) -> String {
    format!("{} rad/s", significant(frequency, 3))
}

/// The relevant range of frequencies [rad/s]: around the crossovers, or all if there are none.
fn range(loops: &[LoopFigure]) -> (f64, f64) {
    const AROUND: f64 = 30.0;
    let crossings = || loops.iter().flat_map(LoopFigure::crossings);
    let low = crossings().fold(f64::INFINITY, f64::min);
    let high = crossings().fold(0.0, f64::max);
    match low <= high {
        true => (low / AROUND, high * AROUND),
        false => (0.0, f64::INFINITY),
    }
}

/// Gain and phase with the crossings.
fn bode(loops: &[LoopFigure]) -> Figure {
    let gain = |response: &Response| {
        let decibels = |value: &Complex<f64>| 20.0 * value.norm().log10();
        response.value.iter().map(decibels).collect()
    };
    let phase = |response: &Response| response.phase().into_iter().map(f64::to_degrees).collect();
    let gains = |own: &Margins| own.gain_crossings.iter().map(|c| c.frequency).collect();
    let phases = |own: &Margins| phase_crossings(own).collect();
    let mut figure = Figure::of(
        "bode",
        "Bode plot",
        "The dots are where the gain is 0 dB (the crossover, where the phase margin is read) and where the phase is \
         \u{2212}180° (where the gain margin is read).",
        curves(loops, "gain [dB]", gain, gains),
    );
    figure
        .panels
        .push(curves(loops, "phase [deg]", phase, phases));
    figure
}

fn curves(
    loops: &[LoopFigure],
    label: &str,
    values: impl Fn(&Response) -> Vec<f64>,
    crossings: impl Fn(&Margins) -> Vec<f64>,
) -> Panel {
    let (low, high) = range(loops);
    let (mut lines, mut marks) = (Vec::new(), Vec::new());
    for (number, shown) in loops.iter().enumerate() {
        let frequency = &shown.response.frequency;
        let values = values(shown.response);
        let is_drawn = |omega: &f64| (low..=high).contains(omega);
        let x: Vec<f64> = crossings(shown.margins)
            .into_iter()
            .filter(is_drawn)
            .collect();
        let y: Vec<f64> = x
            .iter()
            .map(|omega| between(frequency, &values, *omega))
            .collect();
        marks.push(Series {
            words: x.iter().copied().map(words).collect(),
            ..Series::line("", colour(number), &x, &y).looks(Look::Dots)
        });
        let points = frequency.iter().zip(&values);
        let (x, y): (Vec<f64>, Vec<f64>) = points.filter(|(omega, _)| is_drawn(omega)).unzip();
        lines.push(Series::line(&shown.label(), colour(number), &x, &y));
    }
    lines.extend(marks);
    Panel {
        x: Axis::frequency(),
        y: Axis::linear(label),
        height: 240.0,
        series: lines,
        ..Panel::default()
    }
}

/// Linear interpolation between points with ascending abscissae.
fn between(x: &[f64], y: &[f64], at: f64) -> f64 {
    let right = x.partition_point(|&x| x < at).clamp(1, x.len() - 1);
    let (from, to) = (right - 1, right);
    y[from] + (y[to] - y[from]) * (at - x[from]) / (x[to] - x[from])
}

fn nyquist(loops: &[LoopFigure]) -> Figure {
    const LARGEST: f64 = 3.0;
    let curve = |(number, shown): (usize, &LoopFigure)| {
        let near = |value: &Complex<f64>| match value.norm() <= LARGEST {
            true => (value.re, value.im),
            false => (f64::NAN, f64::NAN),
        };
        let (x, y): (Vec<f64>, Vec<f64>) = shown.response.value.iter().map(near).unzip();
        Series::line(&shown.label(), colour(number), &x, &y)
    };
    let angles = (0..=180).map(|k| f64::from(k) * PI / 90.0);
    let (x, y): (Vec<f64>, Vec<f64>) = angles.map(|angle| (angle.cos(), angle.sin())).unzip();
    let mut series = vec![Series::line("gain 1", "aid", &x, &y)];
    series.extend(loops.iter().enumerate().map(curve));
    series.push(Series::line("\u{2212}1", "ink", &[-1.0], &[0.0]).looks(Look::Crosses));
    for (number, shown) in loops.iter().enumerate() {
        let crossings = &shown.margins.gain_crossings;
        // The phase margin is the angle from the point -1.
        let places = crossings
            .iter()
            .map(|c| -Complex::from_polar(1.0, c.phase_margin));
        let (x, y): (Vec<f64>, Vec<f64>) = places.map(|value| (value.re, value.im)).unzip();
        series.push(Series {
            words: crossings.iter().map(|c| words(c.frequency)).collect(),
            ..Series::line("", colour(number), &x, &y).looks(Look::Dots)
        });
    }
    let panel = Panel {
        x: Axis::linear("real part"),
        y: Axis::linear("imaginary part"),
        equal: true,
        height: 540.0,
        series,
    };
    Figure::of(
        "nyquist",
        "Nyquist plot",
        "L for frequencies from low to high, as far as it is not larger than 3; the cross is the point \u{2212}1, the \
         dots are the crossovers, on the circle of gain 1.",
        panel,
    )
}

fn margins(loops: &[LoopFigure]) -> Html {
    let mut rows = Vec::new();
    for shown in loops {
        let label = html! { (shown.label()) };
        for crossing in &shown.margins.gain_crossings {
            rows.push(vec![
                label.clone(),
                number::html(crossing.frequency, 4),
                html! { (format_args!("phase {:.1}°", crossing.phase_margin.to_degrees())) },
                number::html(crossing.delay_margin, 3),
                number::html(crossing.effective_delay, 3),
            ]);
        }
        for crossing in &shown.margins.phase_crossings {
            rows.push(vec![
                label.clone(),
                number::html(crossing.frequency, 4),
                html! { "gain " (number::html(crossing.gain_margin, 4)) },
                html! {},
                html! {},
            ]);
        }
    }
    let header = [
        "loop",
        "frequency [rad/s]",
        "margin",
        "delay margin [s]",
        "effective delay [s]",
    ];
    table(&header, &[1, 2, 3, 4], &rows)
}
