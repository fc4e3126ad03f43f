//! The page of a fitted problem: what was recorded over what the model says.

use super::html::{self, Made};
use super::plot::{Axes, Line, Plot, colour};

/// A measured signal of a run.
#[derive(Debug, Clone)]
pub struct Overlay<'a> {
    /// Run and signal.
    pub title: String,
    /// Unit of the signal; empty where it has none.
    pub unit: &'a str,
    /// Times \[s\].
    pub time: &'a [f64],
    /// What was recorded at each; NaN where nothing was.
    pub recorded: &'a [f64],
    /// What the model says.
    pub model: &'a [f64],
}

/// A page with a table of the parameters (name, value, unit) and a figure for each signal.
pub fn overlay_page(
    title: &str,
    verdict: &str,
    parameters: &[[String; 3]],
    figures: &[Overlay<'_>],
    made: &Made,
) -> String {
    let class = match verdict {
        "converged" => "good",
        _ => "bad",
    };
    let rows: Vec<Vec<String>> = parameters.iter().map(|row| row.to_vec()).collect();
    let table = html::table(&["parameter", "value", "unit"], &[1], &rows);
    let drawn: String = figures.iter().map(figure).collect();
    let body = html::header(title, class, verdict) + &html::section("Parameters", &table) + &drawn;
    html::whole(title, &body, made)
}

fn figure(of: &Overlay<'_>) -> String {
    let line = |label: &str, k: usize, x: Vec<f64>, y: Vec<f64>| Line {
        label: label.to_owned(),
        name: format!("{} {label}", of.title),
        class: colour(k),
        x,
        y,
    };
    let there = of
        .time
        .iter()
        .zip(of.recorded)
        .filter(|(_, y)| y.is_finite());
    let (x, y): (Vec<f64>, Vec<f64>) = there.unzip();
    let plot = Plot {
        description: format!("Recorded and modelled: {}", of.title),
        x_label: "time [s]".to_owned(),
        y_label: match of.unit {
            "" | "1" => String::new(),
            unit => format!("[{}]", pilotage_units::pretty(unit)),
        },
        axes: Axes::Linear,
        height: 260.0,
        lines: vec![
            line("recorded", 0, x, y),
            line("model", 1, of.time.to_vec(), of.model.to_vec()),
        ],
        marks: Vec::new(),
    };
    html::figure(
        &of.title,
        "What was recorded, and what the fitted model says.",
        &plot.to_svg(),
    )
}
