//! The page of a co-simulation: signals over time, and the report of the master.

use super::figure::{Axis, Figure, Panel, Series};
use super::html::{Made, choice, escape, facts, figure, header, section, table, whole};
use super::number;
use super::palette::{N_COLOURS, colour};
use super::tables;
use crate::cosim::{ConnectionReport, InstanceReport, Report};
use crate::series;
use crate::series::Column;

/// Maximum number of figures on a page.
const FIGURES: usize = 16;

/// Contents of the page of a co-simulation.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a> {
    /// CSS class (`good`, `doubtful` or `bad`) and text of the outcome.
    pub ending: (&'a str, &'a str),
    /// Warnings as sentences.
    pub warnings: &'a [String],
    /// Notes.
    pub notes: &'a [String],
    /// Names and values of the main figures.
    pub facts: &'a [(&'a str, String)],
    /// The recorded signals.
    pub series: &'a series::Series,
    /// Report of the master.
    pub report: &'a Report,
    /// Input files with their SHA-256.
    pub files: &'a [(String, String)],
    /// Origin of the page.
    pub made: &'a Made,
}

/// The page as a self-contained HTML file.
pub fn simulation_page(page: &Simulation) -> String {
    let (class, word) = page.ending;
    let mut body = header("Co-simulation", class, word);
    for warning in page.warnings {
        body += &format!("<p class=\"warning\">{}</p>\n", escape(warning));
    }
    for note in page.notes {
        body += &format!("<p class=\"caution\">{}</p>\n", escape(note));
    }
    body += &facts(page.facts);
    body += choice();
    body += &signals(page.series);
    body += &section("Connections", &connections(&page.report.connections));
    body += &section("Instances", &instances(page.report));
    let files = page.files.iter().map(|(name, sum)| (&**name, &**sum));
    body += &section("Files", &tables::files(files));
    whole("co-simulation", &body, page.made)
}

/// The figures, and the number of signals that are left out.
fn signals(series: &series::Series) -> String {
    let all = result_figures(&[("", series)]);
    let drawn: String = all.iter().take(FIGURES).map(figure).collect();
    let left = all.iter().skip(FIGURES).flat_map(|figure| &figure.panels);
    let left: usize = left.map(|panel| panel.series.len()).sum();
    match left {
        0 => drawn,
        left => format!(
            "{drawn}<p>{left} more signals are in the result; <code>--record</code> chooses what is drawn.</p>\n"
        ),
    }
}

/// Figures of named results over time: signals of the same unit share a figure, up to the number of colours.
pub fn result_figures(results: &[(&str, &series::Series)]) -> Vec<Figure> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for column in results.iter().flat_map(|(_, series)| &series.columns) {
        let is_known = |(unit, names): &(&str, Vec<&str>)| {
            *unit == column.unit && names.contains(&column.name.as_str())
        };
        let has_room = |(unit, names): &&mut (&str, Vec<&str>)| {
            *unit == column.unit && (names.len() + 1) * results.len() <= N_COLOURS
        };
        if groups.iter().any(is_known) {
            continue;
        }
        match groups.iter_mut().rev().find(has_room) {
            Some((_, names)) => names.push(&column.name),
            None => groups.push((&column.unit, vec![&column.name])),
        }
    }
    (groups
        .iter()
        .map(|(unit, names)| result_figure(results, unit, names)))
    .collect()
}

/// The signals with these names and this unit, of all results.
fn result_figure(results: &[(&str, &series::Series)], unit: &str, names: &[&str]) -> Figure {
    let mut lines = Vec::new();
    for (number, name) in names.iter().enumerate() {
        for (result, (run, series)) in results.iter().enumerate() {
            let is_it = |column: &&Column| column.name == *name && column.unit == unit;
            if let Some(column) = series.columns.iter().find(is_it) {
                // With several results, each has its own colour and its name in the legend.
                let (label, colour) = match results.len() {
                    1 => ((*name).to_owned(), colour(number)),
                    count => (format!("{name}, {run}"), colour(number * count + result)),
                };
                let line = Series::line(&label, colour, &series.time, &column.values);
                lines.push(if results.len() == 1 {
                    line.of(run)
                } else {
                    line
                });
            }
        }
    }
    let title = match names {
        [name] => (*name).to_owned(),
        _ if unit.is_empty() => "Signals without a unit".into(),
        _ => format!("Signals in {unit}"),
    };
    let what = if names.len() == 1 { names[0] } else { "value" };
    let panel = Panel {
        x: Axis::time(),
        y: Axis::of(what, unit),
        height: 280.0,
        series: lines,
        ..Panel::default()
    };
    Figure::of(names[0], &title, "", panel)
}

fn connections(connections: &[ConnectionReport]) -> String {
    let row = |c: &ConnectionReport| {
        let error = |of: fn(crate::cosim::CouplingError) -> f64| {
            c.error
                .map_or("–".into(), |error| number::html(of(error), 3))
        };
        vec![
            escape(&c.from),
            escape(&c.to),
            c.transfer.to_string(),
            number::html(c.lag, 3),
            error(|e| e.mean),
            error(|e| e.max),
            escape(&c.unit),
            c.divergence.map_or("–".into(), |d| d.to_string()),
        ]
    };
    let header = [
        "output",
        "input",
        "within a step",
        "lag [s]",
        "mean error",
        "largest error",
        "unit",
        "runs away",
    ];
    let rows: Vec<_> = connections.iter().map(row).collect();
    table(&header, &[3, 4, 5], &rows)
}

fn instances(report: &Report) -> String {
    let row = |instance: &InstanceReport| {
        let calls = &instance.calls;
        let counts = [
            calls.sets,
            calls.steps,
            calls.gets,
            calls.saves,
            calls.restores,
        ];
        let counts = counts.map(|count| count.to_string());
        let mut row = vec![escape(&instance.name)];
        row.extend(counts);
        row.push(number::html(instance.seconds, 3));
        row
    };
    let mut rows: Vec<_> = report.instances.iter().map(row).collect();
    let mut master = vec!["master and result".to_owned()];
    master.extend(std::iter::repeat_n(String::new(), 5));
    master.push(number::html(report.master_seconds, 3));
    rows.push(master);
    let header = [
        "instance", "set", "step", "get", "save", "restore", "time [s]",
    ];
    table(&header, &[1, 2, 3, 4, 5, 6], &rows)
}
