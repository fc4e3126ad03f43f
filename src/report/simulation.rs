//! A co-simulation: its signals over time, and what the master tells of it.

use super::html::{Made, escape, facts, figure, header, section, table, whole};
use super::number;
use super::plot::{Axes, Line, N_COLOURS, Plot, colour};
use super::tables;
use crate::cosim::{ConnectionReport, InstanceReport, Report};
use crate::series::{Column, Series};

/// Most figures of a page.
const FIGURES: usize = 16;

/// What a page tells of a co-simulation.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a> {
    /// How it ended, and the class of that: `good`, `doubtful` or `bad`.
    pub ending: (&'a str, &'a str),
    /// What is to be warned of, in sentences.
    pub warnings: &'a [String],
    /// What else is to be known.
    pub notes: &'a [String],
    /// A few numbers with their names.
    pub facts: &'a [(&'a str, String)],
    /// What was recorded.
    pub series: &'a Series,
    /// What the master tells.
    pub report: &'a Report,
    /// Files that were read, with their SHA-256.
    pub files: &'a [(String, String)],
    /// What made the page.
    pub made: &'a Made,
}

/// The page, one file that needs nothing beside it.
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
    body += &signals(page.series);
    body += &section("Connections", &connections(&page.report.connections));
    body += &section("Instances", &instances(page.report));
    let files = page.files.iter().map(|(name, sum)| (&**name, &**sum));
    body += &section("Files", &tables::files(files));
    whole("co-simulation", &body, page.made)
}

/// Signals of one unit share a figure, as many as there are colours.
fn signals(series: &Series) -> String {
    let mut groups: Vec<(&str, Vec<&Column>)> = Vec::new();
    for column in &series.columns {
        let group = groups.iter_mut();
        let room = |(unit, group): &&mut (&str, Vec<&Column>)| {
            *unit == column.unit && group.len() < N_COLOURS
        };
        match group.rev().find(room) {
            Some((_, group)) => group.push(column),
            None => groups.push((&column.unit, vec![column])),
        }
    }
    let drawn = groups.iter().take(FIGURES);
    let mut html: String = drawn
        .map(|(unit, group)| drawing(series, unit, group))
        .collect();
    let left: usize = groups
        .iter()
        .skip(FIGURES)
        .map(|(_, group)| group.len())
        .sum();
    if left > 0 {
        html += &format!(
            "<p>{left} more signals are in the result; <code>--record</code> chooses what is drawn.</p>\n"
        );
    }
    html
}

fn drawing(series: &Series, unit: &str, columns: &[&Column]) -> String {
    let line = |(number, column): (usize, &&Column)| Line {
        label: column.name.clone(),
        name: column.name.clone(),
        class: colour(number),
        x: series.time.clone(),
        y: column.values.clone(),
    };
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let y_label = match unit {
        "" => "value".to_owned(),
        unit => format!("value [{unit}]"),
    };
    let plot = Plot {
        description: format!("{} over time", names.join(", ")),
        x_label: "time [s]".into(),
        y_label,
        axes: Axes::Linear,
        height: 280.0,
        lines: columns.iter().enumerate().map(line).collect(),
        marks: Vec::new(),
    };
    let title = match columns {
        [column] => column.name.clone(),
        _ if unit.is_empty() => "Signals without a unit".into(),
        _ => format!("Signals in {unit}"),
    };
    figure(&title, "", &plot.to_svg())
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
