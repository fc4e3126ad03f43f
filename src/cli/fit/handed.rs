//! A fit for the program that calls the command: what its page draws, as numbers.

use super::summary::{Outcomes, Used, to_text};
use crate::cli::call;
use crate::estimation::{OpenLoops, PilotPaths};
use crate::report::frequency::crossover;
use crate::series::{Column, Series};
use nalgebra::Complex;

/// Frequencies of a response: their number, and the factor between crossover and the first and the last.
const POINTS: u32 = 241;
const RANGE: f64 = 100.0;

/// Hands over the summary, and tables: `run NAME` for each run, `path FROM -> TO` and `loop CUT` for each frequency
/// response, whose time is the frequency \[rad/s\].
pub fn over(outcomes: &Outcomes<'_>) {
    if !call::takes_tables() {
        return;
    }
    call::keep_text("summary", to_text(outcomes));
    call::keep_text("verdict", outcomes.fit.verdict());
    for own in outcomes.runs() {
        call::keep(&format!("run {}", own.name()), run(outcomes, own));
    }
    for (name, series) in responses(outcomes) {
        call::keep(&name, series);
    }
}

/// Recorded and predicted values and residuals \[sd\] of each measured signal, and the states.
fn run(outcomes: &Outcomes<'_>, own: Used<'_>) -> Series {
    let (posed, run) = (outcomes.posed, own.run);
    let mut columns = Vec::new();
    let mut push = |name: String, unit: &str, values: Vec<f64>| {
        columns.push(Column {
            name,
            unit: unit.to_owned(),
            values,
        });
    };
    for (k, measured) in posed.file.measured.iter().enumerate() {
        let (name, unit) = (&measured.column.value, posed.unit_of(k).unwrap_or_default());
        push(format!("recorded {name}"), unit, run.recorded[k].clone());
        push(format!("model {name}"), unit, run.predicted[k].clone());
        let residuals = run.residuals(k, measured.noise);
        push(format!("residual {name}"), "1", residuals);
    }
    let names = posed.joint.model.states.iter();
    for (name, values) in names.zip(&run.states) {
        let about = posed.joint.variables.get(name);
        let unit = about.and_then(|own| own.unit.as_deref());
        push(
            format!("state {name}"),
            unit.unwrap_or_default(),
            values.clone(),
        );
    }
    // A validation run without an answer may lack some.
    columns.retain(|column| column.values.len() == run.time.len());
    Series {
        time: run.time.clone(),
        columns,
        ..Series::default()
    }
}

/// Frequency responses of the paths through the pilot, and of the open loops.
fn responses(outcomes: &Outcomes<'_>) -> Vec<(String, Series)> {
    let (posed, fit) = (outcomes.posed, outcomes.fit);
    let Some(solved) = fit.solved.as_deref() else {
        return Vec::new();
    };
    let theta = solved.theta();
    let paths = PilotPaths::new(posed, solved);
    let loops = OpenLoops::new(posed, solved).and_then(|own| own.with(&theta));
    let first = loops.as_ref().and_then(|own| own.first());
    let middle = first.and_then(|own| crossover(&|_, omega| own(omega), &theta));
    let middle = middle.unwrap_or(1.0);
    let mut all = Vec::new();
    if let Some(own) = &paths {
        let names = own
            .ends()
            .iter()
            .map(|[from, to]| format!("path {from} -> {to}"));
        all.extend(names.zip(own.with(&theta).into_iter().flatten()));
    }
    let names = fit.cuts.iter().map(|cut| format!("loop {cut}"));
    all.extend(names.zip(loops.into_iter().flatten()));
    (all.into_iter())
        .map(|(name, own)| (name, table(&own, middle)))
        .collect()
}

fn table(of: &dyn Fn(f64) -> Complex<f64>, middle: f64) -> Series {
    let place = |k| 2.0 * f64::from(k) / f64::from(POINTS - 1) - 1.0;
    let time: Vec<f64> = (0..POINTS).map(|k| middle * RANGE.powf(place(k))).collect();
    let values: Vec<Complex<f64>> = time.iter().map(|omega| of(*omega)).collect();
    let column = |name: &str, part: fn(&Complex<f64>) -> f64| Column {
        name: name.to_owned(),
        unit: String::new(),
        values: values.iter().map(part).collect(),
    };
    Series {
        columns: vec![
            column("real", |value| value.re),
            column("imaginary", |value| value.im),
        ],
        time,
        ..Series::default()
    }
}
