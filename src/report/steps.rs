//! The page of step responses.

use super::html::{self, Made};
use super::plot::{Axes, Line, Plot, colour};

/// The answer of an output to a step of an input.
#[derive(Debug, Clone, Copy)]
pub struct StepFigure<'a> {
    /// Name of the input.
    pub input: &'a str,
    /// Name of the output.
    pub output: &'a str,
    /// Its unit; empty where it has none.
    pub unit: &'a str,
    /// Times \[s\].
    pub time: &'a [f64],
    /// Deviation from the run without a step, at each time.
    pub values: &'a [f64],
}

/// A page with a figure for each input and output.
pub fn step_page(title: &str, figures: &[StepFigure<'_>], made: &Made) -> String {
    let drawn: String = figures.iter().map(figure).collect();
    let heading = format!("<header>\n<h1>{}</h1>\n</header>\n", html::escape(title));
    html::whole(title, &(heading + &drawn), made)
}

fn figure(of: &StepFigure<'_>) -> String {
    let title = format!("{} → {}", of.input, of.output);
    let label = match of.unit {
        "" | "1" => of.output.to_owned(),
        unit => format!("{} [{}]", of.output, pilotage_units::pretty(unit)),
    };
    let plot = Plot {
        description: format!("Step response from {} to {}", of.input, of.output),
        x_label: "time [s]".to_owned(),
        y_label: label,
        axes: Axes::Linear,
        height: 260.0,
        lines: vec![Line {
            label: of.output.to_owned(),
            name: title.clone(),
            class: colour(0),
            x: of.time.to_vec(),
            y: of.values.to_vec(),
        }],
        marks: Vec::new(),
    };
    let caption = "Deviation from the run without a step.";
    html::figure(&title, caption, &plot.to_svg())
}
