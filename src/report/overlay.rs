//! The page of a fitted problem: what was recorded over what the model says.

use super::html::{self, Made};
use super::plot::{Axes, Line, Plot, colour};

/// A signal of a run, as it was recorded and as models have it.
#[derive(Debug, Clone)]
pub struct Overlay<'a> {
    /// Run and signal.
    pub title: String,
    /// Unit of the signal; empty where it has none.
    pub unit: &'a str,
    /// Each line: its name, times \[s\] and values; NaN where there is none.
    pub lines: Vec<(&'a str, &'a [f64], &'a [f64])>,
    /// A sentence about it.
    pub caption: &'a str,
}

/// The parameters of a page.
#[derive(Debug, Clone)]
pub struct Parameters {
    /// What the columns are.
    pub header: Vec<&'static str>,
    /// Which of them are numbers.
    pub numeric: Vec<usize>,
    /// Their cells.
    pub rows: Vec<Vec<String>>,
    /// What is said below.
    pub notes: Vec<String>,
}

/// The section of a fit that was solved again; nothing where it was not.
pub(super) fn refits(table: Option<&Parameters>) -> String {
    table.map_or(String::new(), |own| {
        html::section("Profiles and bootstrap", &own.html())
    })
}

impl Parameters {
    /// The table, and what is said below.
    fn html(&self) -> String {
        let notes = self.notes.iter();
        let notes = notes.map(|note| format!("<p>{}</p>", html::escape(note)));
        html::table(&self.header, &self.numeric, &self.rows) + &notes.collect::<String>()
    }
}

/// A page with a table of the parameters, one of refits where there are any, and a figure for each signal.
pub fn overlay_page(
    title: &str,
    verdict: &str,
    (parameters, refits): (&Parameters, Option<&Parameters>),
    figures: &[Overlay<'_>],
    made: &Made,
) -> String {
    let class = match verdict {
        "converged" => "good",
        _ => "bad",
    };
    let drawn: String = figures.iter().map(figure).collect();
    let body = html::header(title, class, verdict)
        + &html::section("Parameters", &parameters.html())
        + &self::refits(refits)
        + &drawn;
    html::whole(title, &body, made)
}

fn figure(of: &Overlay<'_>) -> String {
    let line = |(k, (label, time, values)): (usize, &(&str, &[f64], &[f64]))| {
        let there = time.iter().zip(*values).filter(|(_, y)| y.is_finite());
        let (x, y): (Vec<f64>, Vec<f64>) = there.unzip();
        Line {
            label: (*label).to_owned(),
            name: format!("{} {label}", of.title),
            class: colour(k),
            x,
            y,
        }
    };
    let plot = Plot {
        description: format!("Recorded and modelled: {}", of.title),
        x_label: "time [s]".to_owned(),
        y_label: match of.unit {
            "" | "1" => String::new(),
            unit => format!("[{}]", pilotage_units::pretty(unit)),
        },
        axes: Axes::Linear,
        height: 260.0,
        lines: of.lines.iter().enumerate().map(line).collect(),
        marks: Vec::new(),
    };
    html::figure(&of.title, of.caption, &plot.to_svg())
}
