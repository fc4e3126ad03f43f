//! The page of step responses.

use super::figure::{Axis, Figure, Panel, Series};
use super::html::{self, Html, Made, html};

/// The response of an output to a step of an input.
#[derive(Debug, Clone, Copy)]
pub struct StepFigure<'a> {
    /// Name of the input.
    pub input: &'a str,
    /// Name of the output.
    pub output: &'a str,
    /// Unit of the output; empty if it has none.
    pub unit: &'a str,
    /// Times \[s\].
    pub time: &'a [f64],
    /// Deviation from the run without a step, at each time.
    pub values: &'a [f64],
}

/// A page with a figure for each input and output.
pub fn step_page(title: &str, figures: &[StepFigure<'_>], made: &Made) -> String {
    let body = html! {
        header { h1 { (title) } }
        @for own in figures { (figure(own)) }
    };
    html::whole(title, &body, made)
}

fn figure(of: &StepFigure<'_>) -> Html {
    let title = format!("{} → {}", of.input, of.output);
    let panel = Panel {
        x: Axis::time(),
        y: Axis::of(of.output, of.unit),
        height: 260.0,
        series: vec![Series::line("", "line-1", of.time, of.values)],
        ..Panel::default()
    };
    let caption = "Deviation from the run without a step.";
    html::figure(&Figure::of(&title, &title, caption, panel))
}
