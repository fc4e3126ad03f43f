//! The report of a problem: each measured signal as it was recorded and as the model has it.

use super::summary::Outcomes;
use super::sure;
use crate::cli::fit::refits::Refitted;
use crate::estimation::Fit;
use crate::report::{Made, Overlay, Parameters, overlay_page, significant};

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
    let refits = outcomes.refitted.map(Refitted::table);
    let tables = (&parameters(fit), refits.as_ref());
    overlay_page(&title, &fit.verdict(), tables, &figures, made)
}

fn parameters(fit: &Fit) -> Parameters {
    let mut rows = Vec::new();
    for (found, intervals) in sure::of(fit).chain(sure::derived(fit)) {
        for (k, (name, value)) in found.named().enumerate() {
            let unit = found.unit.clone().unwrap_or_default();
            let [sd, low, high, meaning] = sure::cells(intervals.and_then(|all| all.get(k)));
            let [bound, insensitivity] = sure::percents(fit, &name);
            let value = significant(value, 7);
            rows.push(vec![
                name,
                value,
                sd,
                low,
                high,
                unit,
                bound,
                insensitivity,
                meaning,
            ]);
        }
    }
    let header = [
        "parameter",
        "value",
        "sd",
        "low",
        "high",
        "unit",
        "Cramér–Rao [%]",
        "insensitivity [%]",
        "",
    ];
    Parameters {
        header: header.to_vec(),
        numeric: vec![1, 2, 3, 4, 6, 7],
        rows,
        notes: sure::to_text(fit).lines().map(str::to_owned).collect(),
    }
}
