//! `pilotage plot`: writes figures and tables to files.

use super::number::positive;
use super::overwrite::{self, OutputKind, Overwrite};
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, fit, terminal};
use crate::file;
use crate::flights::pilot::PilotFile;
use crate::report::figure::Figure;
use crate::report::frequency::{Fitted, bode_figures};
use crate::report::png::to_png;
use crate::report::poles::pole_figure;
use crate::report::read::{self, Table};
use crate::report::result_figures;
use crate::report::svg::to_svg;
use crate::series::Series;
use crate::suggestion::suggestion;
use pilotage_units::Unit;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  # List all figures and tables, and write some of them.
  pilotage fit run*.csv --vehicle vehicle.toml -o pilot.toml --report fit.html
  pilotage plot fit.html
  pilotage plot fit.html --figure open-loop -o open-loop.svg
  pilotage plot fit.html --figure parameters -o parameters.csv

  # A signal of two co-simulations in one figure, one column wide.
  pilotage plot jacobi.csv strong.csv --figure quadcopter.z --width 85 -o z.png

The figures of a report page are read from it, without a fit. A problem file is fitted first. Figures of a pilot file
or of a fitted linear pilot have the bands of its [uncertainty].
Exit codes: 0 done, 1 the fit of a problem file has not converged (the file is written), 2 bad use or input.";

/// Arguments of `pilotage plot`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A report page, a fitted pilot, a problem file, or results of co-simulations (CSV), which share their figures.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Name of the figure or table; `list` lists all.
    #[arg(long, value_name = "NAME", default_value = "list")]
    figure: String,
    /// File to write: .svg, .png, or .csv with the numbers [default: NAME.svg, NAME.csv for a table].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Draw this run only.
    #[arg(long)]
    run: Option<String>,
    /// Width of the drawing [mm], from 40 to 2000.
    #[arg(long, default_value_t = 120.0, value_parser = width, allow_hyphen_values = true)]
    width: f64,
    /// Resolution of a PNG [pixels per inch].
    #[arg(long, default_value_t = 300.0, value_parser = positive, allow_hyphen_values = true)]
    dpi: f64,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Figures and tables of the inputs.
#[derive(Default)]
struct Content {
    figures: Vec<Figure>,
    tables: Vec<Table>,
    /// Whether they are of a fit without an answer.
    is_doubtful: bool,
}

/// Writes a figure or table, or lists all.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let content = content(&args.inputs)?;
    if args.figure == "list" {
        if let Some(output) = &args.output {
            let message = format!("{} needs a figure or table", output.display());
            return Err(Failure::new(message)
                .hint("--figure NAME, one of")
                .below(&content.list()));
        }
        terminal::print(&content.list())?;
        return Ok(Outcome::Done);
    }
    let figure = content.figures.iter().find(|own| own.name == args.figure);
    let table = content.tables.iter().find(|own| own.name == args.figure);
    // Several signals of a unit share a figure, which is named after the first.
    let shows = || content.showing(&args.figure).filter(|_| table.is_none());
    let figure = figure.or_else(shows);
    let extension = if figure.is_some() { "svg" } else { "csv" };
    let output = args.output.clone();
    let name = args.figure.replace(['/', '\\'], "-");
    let output = output.unwrap_or_else(|| PathBuf::from(format!("{name}.{extension}")));
    (args.overwrite).check(&args.inputs, &[(output.as_path(), OutputKind::Figure)])?;
    let bytes = match (figure, table) {
        (Some(figure), _) => args.drawn(figure, &output)?,
        (None, Some(table)) => match extension_of(&output) {
            "csv" => table.to_csv().into_bytes(),
            _ => {
                return Err(
                    Failure::new(format!("`{}` is a table", table.name)).hint("write it as .csv")
                );
            }
        },
        (None, None) => return Err(content.unknown(&args.figure)),
    };
    overwrite::save(&output, bytes)?;
    terminal::print(&format!("wrote {}\n", terminal::shown(&output)))?;
    Ok(match content.is_doubtful {
        true => Outcome::No,
        false => Outcome::Done,
    })
}

fn extension_of(path: &Path) -> &str {
    path.extension()
        .and_then(|own| own.to_str())
        .unwrap_or_default()
}

/// Maximum width of a drawing \[px\]: more takes minutes and gigabytes.
const WIDEST: f64 = 16_000.0;

/// Parses a width that leaves room for the axes \[mm\].
fn width(text: &str) -> Result<f64, String> {
    let width = positive(text)?;
    match (40.0..=2000.0).contains(&width) {
        true => Ok(width),
        false => Err("expected a width from 40 to 2000 mm".to_owned()),
    }
}

impl Args {
    /// A figure as file content, in the format of the output's extension.
    fn drawn(&self, figure: &Figure, output: &Path) -> Result<Vec<u8>, Failure> {
        let mut figure = figure.thinned();
        if let Some(run) = &self.run {
            let runs = figure.runs();
            // Flights are named without the ending of their file, runs of a problem with it.
            let is_named = |own: &&str| own == run || own.strip_suffix(".csv") == Some(run);
            let Some(found) = runs.iter().copied().find(is_named) else {
                let message = format!("`{}` has no run `{run}`", figure.name);
                let hint = match runs.is_empty() {
                    true => "it is not divided into runs".to_owned(),
                    false => format!("it has: {}", runs.join(", ")),
                };
                return Err(Failure::new(message).hint(hint));
            };
            let found = found.to_owned();
            figure = figure.of_run(&found);
        }
        match extension_of(output) {
            "svg" => Ok(to_svg(&figure, self.width).into_bytes()),
            "csv" => Ok(figure.to_csv().into_bytes()),
            "png" => {
                let across = self.width / 25.4 * self.dpi;
                if across > WIDEST {
                    let message = format!("a drawing {across:.0} pixels wide");
                    let hint = format!("take a smaller --dpi or --width: up to {WIDEST} pixels");
                    return Err(Failure::new(message).hint(hint));
                }
                let png = to_png(&to_svg(&figure, self.width), self.dpi as f32);
                png.map_err(|error| Failure::from(error).hint("write it as .svg"))
            }
            _ => {
                let message = format!("{} is no kind of file that is written", output.display());
                Err(Failure::new(message).hint("end its name in .svg, .png or .csv"))
            }
        }
    }
}

impl Content {
    fn list(&self) -> String {
        let figures = self
            .figures
            .iter()
            .map(|own| [own.name.clone(), own.title.clone(), "figure".to_owned()]);
        let tables = self
            .tables
            .iter()
            .map(|own| [own.name.clone(), String::new(), "table".to_owned()]);
        let rows: Vec<[String; 3]> = figures
            .chain(tables)
            .map(|[name, title, kind]| [name, kind, title])
            .collect();
        super::format::aligned(&rows)
    }

    /// The first figure with this signal or quantity.
    fn showing(&self, name: &str) -> Option<&Figure> {
        let is_named = |label: &str, end: &str| label.split(end).next() == Some(name);
        let shows = |own: &&Figure| {
            let mut quantities = own.panels.iter().map(|panel| &panel.y.label);
            let mut lines = own.panels.iter().flat_map(|panel| &panel.series);
            quantities.any(|label| is_named(label, " ["))
                || lines.any(|line| line.label == name || is_named(&line.label, ", "))
        };
        self.figures.iter().find(shows).filter(|_| !name.is_empty())
    }

    fn unknown(&self, name: &str) -> Failure {
        let figures = self.figures.iter().map(|own| own.name.as_str());
        let names: Vec<&str> = figures
            .chain(self.tables.iter().map(|own| own.name.as_str()))
            .collect();
        let hint = match suggestion(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`--figure list` lists them".to_owned(),
        };
        Failure::new(format!("there is no figure or table `{name}`")).hint(hint)
    }
}

/// Reads the inputs according to their kind.
fn content(inputs: &[PathBuf]) -> Result<Content, Failure> {
    let drawn = [
        FileKind::Page,
        FileKind::Pilot,
        FileKind::Model,
        FileKind::Problem,
        FileKind::Table,
        FileKind::Trial,
    ];
    let what = "a page of --report, a fitted pilot, a problem file or results";
    recognise::expect(inputs, &drawn, what)?;
    let [path] = inputs else {
        return results(inputs);
    };
    match recognise::of(path) {
        Some(FileKind::Page) => page(path),
        Some(FileKind::Pilot) => Ok(pilot(&PilotFile::read(path)?)),
        Some(FileKind::Model) => match PilotFile::of_model(path)? {
            Some(own) => Ok(pilot(&own)),
            None => {
                let message = format!("{} is no linear pilot", path.display());
                Err(Failure::new(message)
                    .hint("the figures of a fit are on its page, which --report writes"))
            }
        },
        Some(FileKind::Problem) => {
            let (page, is_answer) = fit::page_of_problem(path)?;
            Ok(Content {
                is_doubtful: !is_answer,
                ..of_page(&page)
            })
        }
        _ => results(inputs),
    }
}

fn page(path: &Path) -> Result<Content, Failure> {
    let text = file::text(path);
    let text =
        text.map_err(|error| Failure::new(format!("cannot read {}: {error}", path.display())))?;
    let content = of_page(&text);
    match content.figures.is_empty() && content.tables.is_empty() {
        true => {
            let message = format!("{} holds no figure", path.display());
            Err(Failure::new(message).hint("name a page that --report wrote"))
        }
        false => Ok(content),
    }
}

/// The figures and tables of a page.
fn of_page(text: &str) -> Content {
    Content {
        figures: read::figures(text),
        tables: read::tables(text),
        is_doubtful: false,
    }
}

fn pilot(file: &PilotFile) -> Content {
    let fitted = Fitted {
        pilot: file.pilot.structure(),
        theta: &file.pilot.theta,
        vehicle: file.vehicle.as_ref(),
        sure: file.spread.as_ref(),
    };
    let mut figures = bode_figures(&fitted);
    figures.push(pole_figure(&fitted));
    Content {
        figures,
        ..Content::default()
    }
}

/// Converts columns of the same name to the unit of the first one. One that cannot be converted is another quantity: its
/// file becomes part of its name.
fn convert(all: &mut [(String, Series)]) {
    let mut units: HashMap<String, String> = HashMap::new();
    for (path, series) in all {
        for column in &mut series.columns {
            let Some(unit) = units.get(&column.name) else {
                units.insert(column.name.clone(), column.unit.clone());
                continue;
            };
            if *unit == column.unit {
                continue;
            }
            let [from, to] = [&column.unit, unit].map(|unit| Unit::named(unit));
            let Some(conversion) = from.conversion(&to) else {
                column.name = format!("{} ({path})", column.name);
                continue;
            };
            let values = column.values.iter_mut();
            values.for_each(|value| *value = conversion.apply(*value));
            column.unit = unit.clone();
        }
    }
}

/// Tables over time; columns of the same name share a figure.
fn results(inputs: &[PathBuf]) -> Result<Content, Failure> {
    let alone = |path: &&PathBuf| {
        let kinds = [
            FileKind::Page,
            FileKind::Pilot,
            FileKind::Model,
            FileKind::Problem,
        ];
        recognise::of(path).is_some_and(|kind| kinds.contains(&kind))
    };
    if let Some(path) = inputs.iter().find(alone) {
        let message = format!("{} is drawn alone", path.display());
        return Err(Failure::new(message).hint("several files are results, .csv, in one figure"));
    }
    let all = inputs
        .iter()
        .map(|path| Ok((path.display().to_string(), Series::read_table(path)?)));
    let mut all: Vec<(String, Series)> = all.collect::<Result<_, Failure>>()?;
    convert(&mut all);
    let named = |(name, series): &(String, Series)| match all.len() {
        1 => (String::new(), series.clone()),
        _ => (name.clone(), series.clone()),
    };
    let named: Vec<(String, Series)> = all.iter().map(named).collect();
    let named: Vec<(&str, &Series)> = named
        .iter()
        .map(|(name, series)| (name.as_str(), series))
        .collect();
    let figures = result_figures(&named);
    Ok(Content {
        figures,
        ..Content::default()
    })
}
