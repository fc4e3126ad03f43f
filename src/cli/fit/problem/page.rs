//! The report of a problem: each measured signal as it was recorded and as the model has it.

use super::summary::Outcomes;
use crate::report::{Made, Overlay, overlay_page, significant};

/// The page.
pub fn page(outcomes: &Outcomes<'_>, made: &Made) -> String {
    let Outcomes { posed, fit, .. } = *outcomes;
    let mut figures = Vec::new();
    for (run, usage) in outcomes.runs() {
        for (k, measured) in posed.file.measured.iter().enumerate() {
            figures.push(Overlay {
                title: format!("{} ({usage}): {}", run.name, measured.column.value),
                unit: posed.unit_of(k).unwrap_or_default(),
                lines: vec![
                    ("recorded", &run.time, &run.recorded[k]),
                    ("model", &run.time, &run.predicted[k]),
                ],
                caption: "What was recorded, and what the fitted model says.",
            });
        }
    }
    let title = format!("fit of {}", posed.file.file);
    let mut rows = Vec::new();
    for found in &fit.parameters {
        for (name, value) in found.named() {
            let unit = found.unit.clone().unwrap_or_default();
            rows.push([name, significant(value, 7), unit]);
        }
    }
    overlay_page(&title, &fit.verdict(), &rows, &figures, made)
}
