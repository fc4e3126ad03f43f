//! The report of a problem: each measured signal as it was recorded and as the model has it.

use super::summary::Outcomes;
use crate::report::{Made, Overlay, overlay_page, significant};

/// The page.
pub fn page(outcomes: &Outcomes<'_>, made: &Made) -> String {
    let Outcomes { posed, fit, .. } = *outcomes;
    let mut figures = Vec::new();
    for (run, usage) in outcomes.runs() {
        for (k, measured) in posed.file.measured.iter().enumerate() {
            let recorded = ("recorded", &run.time[..], &run.recorded[k][..]);
            let model = ("model", &run.time[..], &run.predicted[k][..]);
            let (lines, caption) = match outcomes.has_figures(usage) {
                true => (
                    vec![recorded, model],
                    "What was recorded, and what the fitted model says.",
                ),
                false => (
                    vec![recorded],
                    "What was recorded; what was found does not fulfil the equations.",
                ),
            };
            figures.push(Overlay {
                title: format!("{} ({usage}): {}", run.name, measured.column.value),
                unit: posed.unit_of(k).unwrap_or_default(),
                lines,
                caption,
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
