//! The page of a co-simulation: signals over time, and the report of the master.

use super::figure::{Axis, Figure, Panel, Series};
use super::html::{
    Html, Made, choice, facts, figure, header, html, paragraph, section, table, whole,
};
use super::number;
use super::palette::{N_COLOURS, colour};
use super::tables;
use crate::cosim::{ConnectionReport, InstanceReport, Report};
use crate::series;
use crate::series::Column;
use std::collections::HashMap;

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
    let files = page.files.iter().map(|(name, sum)| (&**name, &**sum));
    let body = html! {
        (header("Co-simulation", class, word))
        @for warning in page.warnings { (paragraph(Some("warning"), warning)) }
        @for note in page.notes { (paragraph(Some("caution"), note)) }
        (facts(page.facts))
        (choice())
        (signals(page.series))
        (section("Connections", &connections(&page.report.connections)))
        (section("Instances", &instances(page.report)))
        (section("Files", &tables::files(files)))
    };
    whole("co-simulation", &body, page.made)
}

/// The figures, and the number of signals that are left out.
fn signals(series: &series::Series) -> Html {
    let all = result_figures(&[("", series)]);
    let left = all.iter().skip(FIGURES).flat_map(|figure| &figure.panels);
    let left: usize = left.map(|panel| panel.series.len()).sum();
    html! {
        @for own in all.iter().take(FIGURES) { (figure(own)) }
        @if left > 0 {
            p { (left) " more signals are in the result; " code { "--record" } " chooses what is drawn." }
        }
    }
}

/// Figures of named results over time: signals of the same unit share a figure, up to the number of colours.
pub fn result_figures(results: &[(&str, &series::Series)]) -> Vec<Figure> {
    let mut figures: Vec<(&str, Vec<Signal<'_>>)> = Vec::new();
    // The last figure of each unit, and the place of each signal in its figure.
    let mut last: HashMap<&str, usize> = HashMap::new();
    let mut places: HashMap<(&str, &str), (usize, usize)> = HashMap::new();
    for (result, (_, series)) in results.iter().enumerate() {
        for column in &series.columns {
            let (name, unit) = (column.name.as_str(), column.unit.as_str());
            let (figure, signal) = *places.entry((name, unit)).or_insert_with(|| {
                let has_room =
                    |own: &&usize| (figures[**own].1.len() + 1) * results.len() <= N_COLOURS;
                let figure = last.get(unit).filter(has_room).copied();
                let figure = figure.unwrap_or_else(|| {
                    figures.push((unit, Vec::new()));
                    figures.len() - 1
                });
                last.insert(unit, figure);
                let signals = &mut figures[figure].1;
                signals.push(Signal {
                    name,
                    columns: vec![None; results.len()],
                });
                (figure, signals.len() - 1)
            });
            figures[figure].1[signal].columns[result].get_or_insert(column);
        }
    }
    let all = figures.iter();
    all.map(|(unit, signals)| result_figure(results, unit, signals))
        .collect()
}

/// A signal, and its column in each result that has it.
struct Signal<'a> {
    name: &'a str,
    columns: Vec<Option<&'a Column>>,
}

/// These signals, which have this unit, of all results.
fn result_figure(
    results: &[(&str, &series::Series)],
    unit: &str,
    signals: &[Signal<'_>],
) -> Figure {
    let mut lines = Vec::new();
    for (number, signal) in signals.iter().enumerate() {
        for (result, (run, series)) in results.iter().enumerate() {
            let Some(column) = signal.columns[result] else {
                continue;
            };
            // With several results, each has its own colour and its name in the legend.
            let (label, colour) = match results.len() {
                1 => (signal.name.to_owned(), colour(number)),
                count => (
                    format!("{}, {run}", signal.name),
                    colour(number * count + result),
                ),
            };
            let line = Series::line(&label, colour, &series.time, &column.values);
            lines.push(match results.len() {
                1 => line.of(run),
                _ => line,
            });
        }
    }
    let names: Vec<&str> = signals.iter().map(|own| own.name).collect();
    let title = match names[..] {
        [name] => name.to_owned(),
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

fn connections(connections: &[ConnectionReport]) -> Html {
    let row = |c: &ConnectionReport| {
        let error = |of: fn(crate::cosim::CouplingError) -> f64| {
            c.error
                .map_or(html! { "–" }, |error| number::html(of(error), 3))
        };
        vec![
            html! { (c.from) },
            html! { (c.to) },
            html! { (c.transfer.to_string()) },
            number::html(c.lag, 3),
            error(|e| e.mean),
            error(|e| e.max),
            html! { (c.unit) },
            html! { (c.divergence.map_or("–".into(), |d| d.to_string())) },
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

fn instances(report: &Report) -> Html {
    let row = |instance: &InstanceReport| {
        let calls = &instance.calls;
        let counts = [
            calls.sets,
            calls.steps,
            calls.gets,
            calls.saves,
            calls.restores,
        ];
        let mut row = vec![html! { (instance.name) }];
        row.extend(counts.map(|count| html! { (count) }));
        row.push(number::html(instance.seconds, 3));
        row
    };
    let mut rows: Vec<_> = report.instances.iter().map(row).collect();
    let mut master = vec![html! { "master and result" }];
    master.extend(std::iter::repeat_n(html! {}, 5));
    master.push(number::html(report.master_seconds, 3));
    rows.push(master);
    let header = [
        "instance", "set", "step", "get", "save", "restore", "time [s]",
    ];
    table(&header, &[1, 2, 3, 4, 5, 6], &rows)
}
