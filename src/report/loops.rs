//! Bode and Nyquist plots of loops.

use super::html::{escape, table, whole};
use super::number;
use super::page::figure;
use super::plot::{Line, Plot};
use crate::linear::{Margins, Response};

/// A loop that is shown.
#[derive(Debug, Clone, Copy)]
pub struct LoopFigure<'a> {
    /// Where it is cut: `instance.output=instance.input`.
    pub connection: &'a str,
    /// Communication step in which it is run [s]; `None` in continuous time.
    pub step: Option<f64>,
    /// `L(jω)`.
    pub response: &'a Response,
    /// Its margins.
    pub margins: &'a Margins,
}

impl LoopFigure<'_> {
    fn label(&self) -> String {
        match self.step {
            None => self.connection.to_owned(),
            Some(step) => format!("{}, in steps of {step} s", self.connection),
        }
    }
}

/// A page with the loops' margins and plots, one file that needs nothing beside it.
pub fn loop_page(loops: &[LoopFigure]) -> String {
    let mut body = String::from("<header>\n<h1>Loops</h1>\n</header>\n");
    body += "<p>The system is cut open at a connection; L is what comes back there, with its sign turned, \
             so that 1 + L = 0 is the closed loop.</p>\n";
    body += &margins(loops);
    body += &figure(
        "Gain",
        "Where it is 0 dB the phase margin is read.",
        &bode(loops, "gain [dB]", |response| {
            (response.value.iter())
                .map(|value| 20.0 * value.norm().log10())
                .collect()
        }),
    );
    body += &figure(
        "Phase",
        "Where it is -180° the gain margin is read.",
        &bode(loops, "phase [deg]", |response| {
            response
                .phase()
                .iter()
                .map(|phase| phase.to_degrees())
                .collect()
        }),
    );
    body += &figure(
        "Nyquist plot",
        "L for frequencies from low to high, as far as it is not larger than 3; the cross is the point -1.",
        &nyquist(loops),
    );
    whole("loops", &body)
}

fn class(number: usize) -> String {
    format!("model-{}", 1 + number % 4)
}

fn bode(loops: &[LoopFigure], label: &str, value: impl Fn(&Response) -> Vec<f64>) -> String {
    let line = |(number, shown): (usize, &LoopFigure)| Line {
        label: shown.label(),
        class: class(number),
        x: (shown.response.frequency.iter())
            .map(|omega| omega.log10())
            .collect(),
        y: value(shown.response),
    };
    let plot = Plot {
        description: format!("{label} of the loops over frequency"),
        x_label: "frequency [rad/s]".to_owned(),
        y_label: label.to_owned(),
        x_in_decades: true,
        height: 340.0,
        lines: loops.iter().enumerate().map(line).collect(),
    };
    plot.to_svg()
}

fn nyquist(loops: &[LoopFigure]) -> String {
    const LARGEST: f64 = 3.0;
    const ARM: f64 = 0.05;
    let line = |(number, shown): (usize, &LoopFigure)| {
        let near = |value: &nalgebra::Complex<f64>| match value.norm() <= LARGEST {
            true => (value.re, value.im),
            false => (f64::NAN, f64::NAN),
        };
        let (x, y) = shown.response.value.iter().map(near).unzip();
        Line {
            label: shown.label(),
            class: class(number),
            x,
            y,
        }
    };
    let cross = Line {
        label: "-1".to_owned(),
        class: "goal".to_owned(),
        x: vec![-1.0 - ARM, -1.0 + ARM, f64::NAN, -1.0, -1.0],
        y: vec![0.0, 0.0, f64::NAN, -ARM, ARM],
    };
    let plot = Plot {
        description: "Nyquist plot of the loops".to_owned(),
        x_label: "real part".to_owned(),
        y_label: "imaginary part".to_owned(),
        x_in_decades: false,
        height: 560.0,
        lines: loops.iter().enumerate().map(line).chain([cross]).collect(),
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
