//! A linearised system: its poles, and Bode and Nyquist plots of its loops.

use super::html::{Made, escape, figure, header, section, table, whole};
use super::number::{self, significant};
use super::plot::{Axes, Line, Mark, Plot, colour};
use super::tables;
use crate::linear::{Margins, Mode, Response};
use nalgebra::Complex;
use std::f64::consts::PI;

/// What a page tells of a linearised system.
#[derive(Debug, Clone, Copy)]
pub struct LoopPage<'a> {
    /// Time of the linearisation \[s\].
    pub time: f64,
    /// The poles, in continuous time and perhaps in steps.
    pub stability: &'a [Stability<'a>],
    /// The loops, cut open.
    pub loops: &'a [LoopFigure<'a>],
    /// What else is to be known.
    pub notes: &'a [String],
    /// Files that were read, with their SHA-256.
    pub files: &'a [(String, String)],
    /// What made the page.
    pub made: &'a Made,
}

/// The poles of the coupled system, and what they mean.
#[derive(Debug, Clone)]
pub struct Stability<'a> {
    /// Communication step \[s\]; `None` in continuous time.
    pub step: Option<f64>,
    /// The poles.
    pub modes: &'a [Mode],
    /// The verdict in one word, for the title: `stable`.
    pub word: &'a str,
    /// The verdict in a sentence.
    pub words: String,
    /// Its class: `good`, `doubtful` or `bad`.
    pub class: &'a str,
}

/// A loop that is shown.
#[derive(Debug, Clone, Copy)]
pub struct LoopFigure<'a> {
    /// Where it is cut: `instance.output=instance.input`.
    pub connection: &'a str,
    /// Communication step in which it is run \[s\]; `None` in continuous time.
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

    /// Frequencies at which the gain is 1, or where it never is, at which the phase is -180° [rad/s].
    fn crossings(&self) -> Vec<f64> {
        let gain = self.margins.gain_crossings.iter().map(|c| c.frequency);
        let phase = self.margins.phase_crossings.iter().map(|c| c.frequency);
        match self.margins.gain_crossings.is_empty() {
            false => gain.collect(),
            true => phase.collect(),
        }
    }
}

/// The page, one file that needs nothing beside it.
pub fn loop_page(page: &LoopPage) -> String {
    // The worst verdict is that of the title.
    let rank = |class: &str| ["good", "doubtful", "bad"].iter().position(|c| *c == class);
    let worst = page.stability.iter().max_by_key(|s| rank(s.class));
    let (class, word) = worst.map_or(("doubtful", "no poles"), |s| (s.class, s.word));
    let mut body = header("Linearised system", class, word);
    let time = page.time;
    body += &format!("<p>The coupled system, linear at {time} s.</p>\n");
    for stability in page.stability {
        body += &verdict(stability);
    }
    for note in page.notes {
        body += &format!("<p class=\"caution\">{}</p>\n", escape(note));
    }
    if !page.loops.is_empty() {
        body += &loops(page.loops);
    }
    for stability in page.stability {
        let title = format!("Poles of the closed loop{}", in_steps(stability.step));
        body += &section(&title, &tables::modes(stability.modes));
    }
    let files = page.files.iter().map(|(name, sum)| (&**name, &**sum));
    body += &section("Files", &tables::files(files));
    whole("linearised system", &body, page.made)
}

fn verdict(stability: &Stability) -> String {
    let class = match stability.class {
        "bad" => " class=\"warning\"",
        "doubtful" => " class=\"caution\"",
        _ => "",
    };
    format!("<p{class}>{}</p>\n", escape(&stability.words))
}

fn loops(loops: &[LoopFigure]) -> String {
    let decibels = |value: &Complex<f64>| 20.0 * value.norm().log10();
    let gain = |response: &Response| response.value.iter().map(decibels).collect();
    let phase = |response: &Response| {
        let phase = response.phase().into_iter();
        phase.map(f64::to_degrees).collect()
    };
    section("Margins", &(cut() + &margins(loops)))
        + &figure(
            "Gain",
            "The dots are where it is 0 dB: the crossover, where the phase margin is read.",
            &bode(loops, "gain [dB]", gain, |margins| {
                let crossings = margins.gain_crossings.iter();
                crossings
                    .map(|c| (c.frequency, words(c.frequency)))
                    .collect()
            }),
        )
        + &figure(
            "Phase",
            "The dots are where it is \u{2212}180°, where the gain margin is read.",
            &bode(loops, "phase [deg]", phase, |margins| {
                let crossings = margins.phase_crossings.iter();
                crossings
                    .map(|c| (c.frequency, words(c.frequency)))
                    .collect()
            }),
        )
        + &figure(
            "Nyquist plot",
            "L for frequencies from low to high, as far as it is not larger than 3; the cross is the point \
             \u{2212}1, the dots are the crossovers, on the circle of gain 1.",
            &nyquist(loops),
        )
}

fn cut() -> String {
    "<p>The system is cut open at a connection; L is what comes back there, with its sign turned, so that \
     1 + L = 0 is the closed loop.</p>\n"
        .into()
}

fn words(frequency: f64) -> String {
    format!("{} rad/s", significant(frequency, 3))
}

/// The frequencies worth looking at [rad/s]: about the crossovers; all where there are none.
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

fn bode(
    loops: &[LoopFigure],
    label: &str,
    values: impl Fn(&Response) -> Vec<f64>,
    crossings: impl Fn(&Margins) -> Vec<(f64, String)>,
) -> String {
    let (low, high) = range(loops);
    let (mut lines, mut marks) = (Vec::new(), Vec::new());
    for (number, shown) in loops.iter().enumerate() {
        let frequency = &shown.response.frequency;
        let values = values(shown.response);
        let is_drawn = |(omega, _): &(f64, String)| (low..=high).contains(omega);
        for (omega, text) in crossings(shown.margins).into_iter().filter(is_drawn) {
            let y = between(frequency, &values, omega);
            let x = omega.log10();
            marks.push(Mark { x, y, text });
        }
        let points = frequency.iter().zip(&values);
        let (x, y) = points
            .filter(|(omega, _)| (low..=high).contains(*omega))
            .map(|(omega, value)| (omega.log10(), value))
            .unzip();
        lines.push(line(shown.label(), colour(number), x, y));
    }
    let plot = Plot {
        description: format!("{label} of the loops over frequency"),
        x_label: "frequency [rad/s]".to_owned(),
        y_label: label.to_owned(),
        axes: Axes::Decades,
        height: 300.0,
        lines,
        marks,
    };
    plot.to_svg()
}

/// The value at an abscissa between those of the points, which ascend.
fn between(x: &[f64], y: &[f64], at: f64) -> f64 {
    let right = x.partition_point(|&x| x < at).clamp(1, x.len() - 1);
    let (from, to) = (right - 1, right);
    y[from] + (y[to] - y[from]) * (at - x[from]) / (x[to] - x[from])
}

fn line(label: String, class: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Line {
    Line {
        name: label.clone(),
        label,
        class: class.into(),
        x,
        y,
    }
}

fn nyquist(loops: &[LoopFigure]) -> String {
    const LARGEST: f64 = 3.0;
    const ARM: f64 = 0.05;
    let curve = |(number, shown): (usize, &LoopFigure)| {
        let near = |value: &Complex<f64>| match value.norm() <= LARGEST {
            true => (value.re, value.im),
            false => (f64::NAN, f64::NAN),
        };
        let (x, y) = shown.response.value.iter().map(near).unzip();
        line(shown.label(), colour(number), x, y)
    };
    let angles = (0..=180).map(|k| f64::from(k) * PI / 90.0);
    let (x, y) = angles.map(|angle| (angle.cos(), angle.sin())).unzip();
    let circle = line("gain 1".into(), "aid", x, y);
    let cross = line(
        "\u{2212}1".into(),
        "goal",
        vec![-1.0 - ARM, -1.0 + ARM, f64::NAN, -1.0, -1.0],
        vec![0.0, 0.0, f64::NAN, -ARM, ARM],
    );
    let crossovers = loops.iter().flat_map(|shown| &shown.margins.gain_crossings);
    let marks = crossovers.map(|crossing| {
        // The margin is the angle from the point -1.
        let value = -Complex::from_polar(1.0, crossing.phase_margin);
        Mark {
            x: value.re,
            y: value.im,
            text: words(crossing.frequency),
        }
    });
    let plot = Plot {
        description: "Nyquist plot of the loops".to_owned(),
        x_label: "real part".to_owned(),
        y_label: "imaginary part".to_owned(),
        axes: Axes::Equal,
        height: 540.0,
        lines: [circle]
            .into_iter()
            .chain(loops.iter().enumerate().map(curve))
            .chain([cross])
            .collect(),
        marks: marks.collect(),
    };
    plot.to_svg()
}

fn margins(loops: &[LoopFigure]) -> String {
    let mut rows = Vec::new();
    for shown in loops {
        let label = escape(&shown.label());
        for crossing in &shown.margins.gain_crossings {
            rows.push(vec![
                label.clone(),
                number::html(crossing.frequency, 4),
                format!("phase {:.1}°", crossing.phase_margin.to_degrees()),
                number::html(crossing.delay_margin, 3),
                number::html(crossing.effective_delay, 3),
            ]);
        }
        for crossing in &shown.margins.phase_crossings {
            rows.push(vec![
                label.clone(),
                number::html(crossing.frequency, 4),
                format!("gain {}", number::html(crossing.gain_margin, 4)),
                String::new(),
                String::new(),
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
