//! `--evaluate`: evaluates a problem at its start values.

use crate::cli::fit::SCHEMA;
use crate::cli::fit::summary::notes;
use crate::cli::format::aligned;
use crate::cli::{Failure, Outcome, terminal};
use crate::estimation::Posed;
use crate::estimation::evaluate::{Evaluation, evaluate};
use pilotage_text::number::significant;
use serde_json::{Value, json};

/// Prints objective, gradient and residuals.
pub fn run(posed: &Posed<'_>, json: bool) -> Result<Outcome, Failure> {
    let found = evaluate(posed);
    terminal::print(&match json {
        true => format!("{:#}\n", to_json(posed, &found)),
        false => to_text(posed, &found),
    })?;
    Ok(match found.objective.is_finite() {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

fn to_json(posed: &Posed<'_>, found: &Evaluation) -> Value {
    let gradient = found
        .gradient
        .iter()
        .map(|(name, value)| (name.clone(), json!(value)));
    let residuals = found.runs.iter().map(|run| {
        let all = posed.file.measured.iter().enumerate();
        let all = all.map(|(k, measured)| {
            let values = run.residuals(k, measured.noise);
            (measured.column.value.clone(), json!(values))
        });
        json!({ "name": run.name, "residuals": Value::Object(all.collect()) })
    });
    json!({
        "schema": SCHEMA,
        "objective": found.objective,
        "early_end": early_end(posed, found),
        "gradient": Value::Object(gradient.collect()),
        "left_out": posed.left_out,
        "notes": notes(posed),
        "runs": residuals.collect::<Vec<_>>(),
    })
}

fn to_text(posed: &Posed<'_>, found: &Evaluation) -> String {
    let mut text = match early_end(posed, found) {
        None => format!(
            "objective at the start values: {}\n\n",
            significant(found.objective, 8)
        ),
        Some(why) => format!("no objective at the start values: {why}; start elsewhere\n\n"),
    };
    let mut rows = vec![["parameter", "gradient"].map(str::to_owned)];
    rows.extend(
        found
            .gradient
            .iter()
            .map(|(name, value)| [name.clone(), significant(*value, 6)]),
    );
    text += &aligned(&rows);
    text += "\n";
    text + &aligned(&residual_rows(posed, found))
}

/// Why there is no objective, if a simulation ends early.
fn early_end(posed: &Posed<'_>, found: &Evaluation) -> Option<String> {
    let (run, time) = found.end?;
    let data = &posed.data[run];
    Some(format!(
        "the simulation of {} ends at {}, since it grows without bound or takes too many steps",
        data.name(),
        data.shown(time + posed.origins[run])
    ))
}

/// Number of samples and scaled rms residual for each run and column.
fn residual_rows(posed: &Posed<'_>, found: &Evaluation) -> Vec<[String; 4]> {
    let mut rows = vec![["run", "column", "samples", "rms residual over sd"].map(str::to_owned)];
    for run in &found.runs {
        for (k, measured) in posed.file.measured.iter().enumerate() {
            let mut own = run.residuals(k, measured.noise);
            own.retain(|r| !r.is_nan());
            let squares: f64 = own.iter().map(|r| r * r).sum();
            rows.push([
                run.name.clone(),
                measured.column.value.clone(),
                own.len().to_string(),
                significant((squares / own.len() as f64).sqrt(), 4),
            ]);
        }
    }
    rows
}
