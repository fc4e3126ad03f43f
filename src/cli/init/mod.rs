//! `pilotage init`: writes a problem file for existing runs and models.

mod accepted;
mod instance;

use super::overwrite::{self, OutputKind, Overwrite};
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, made, terminal};
use crate::document::quoted;
use crate::inference::are_stepped;
use crate::series::Series;
use instance::Instance;
use pilotage_text::printable::comment;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  # The problem that `pilotage fit run*.csv` solves, with all keys of problem files.
  pilotage init run*.csv -o problem.toml

  # Another pilot and another vehicle, built in (`pilotage models`) or from files.
  pilotage init run*.csv --pilot lead_lag --vehicle double_integrator -o problem.toml
  pilotage init run*.csv --pilot my_pilot.toml --vehicle my_aircraft.toml -o problem.toml

  # Parameters of one model: columns with the names of its inputs drive it, those with the names of
  # its outputs or states are measured.
  pilotage init day*.csv --model tank.toml -o problem.toml

Without -o the file is printed. Comments in it mark what had to be guessed.";

/// Arguments of `pilotage init`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recorded runs (CSV).
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Pilot: a built-in model, a model file or an FMU.
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = "linear",
        conflicts_with = "model"
    )]
    pilot: String,
    /// Vehicle: a built-in model, a model file or an FMU.
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = "quadcopter",
        conflicts_with = "model"
    )]
    vehicle: String,
    /// A single model instead of pilot and vehicle.
    #[arg(long, value_name = "NAME|FILE")]
    model: Option<String>,
    /// Problem file to write [default: print it].
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let instances = args.instances()?;
    recognise::expect(
        &args.runs,
        &[FileKind::Trial, FileKind::Table],
        "recorded runs (CSV)",
    )?;
    let runs: Vec<Series> = (args.runs.iter())
        .map(|file| Series::read_table(file))
        .collect::<Result<_, _>>()?;
    let text = args.text(&instances, &runs)?;
    let path = args.output.as_deref().unwrap_or(Path::new("problem.toml"));
    let (text, reasons) = accepted::accepted(text, path)?;
    for reason in reasons {
        terminal::note(&format!("commented out: {reason}"));
    }
    let Some(output) = &args.output else {
        terminal::print(&text)?;
        return Ok(Outcome::Done);
    };
    let outputs: &[_] = match overwrite::holds(output, &text) {
        true => &[],
        false => &[(output.as_path(), OutputKind::Problem)],
    };
    let models = [Some(&args.pilot), Some(&args.vehicle), args.model.as_ref()];
    let models = models.into_iter().flatten().map(PathBuf::from);
    let models = models.filter(|path| path.exists());
    let inputs: Vec<PathBuf> = args.runs.iter().cloned().chain(models).collect();
    args.overwrite.check(&inputs, outputs)?;
    overwrite::save(output, text)?;
    let typed = made::quoted(&output.to_string_lossy());
    terminal::print(&format!(
        "wrote {}\nnext: {} fit {typed}\n",
        terminal::shown(output),
        made::program()
    ))?;
    Ok(Outcome::Done)
}

impl Args {
    fn instances(&self) -> Result<Vec<Instance>, Failure> {
        match &self.model {
            Some(model) => Ok(vec![Instance::open("model", model)?]),
            None => Ok(vec![
                Instance::open("pilot", &self.pilot)?,
                Instance::open("vehicle", &self.vehicle)?,
            ]),
        }
    }

    /// The text of the problem file.
    fn text(&self, instances: &[Instance], runs: &[Series]) -> Result<String, Failure> {
        let shared = |name: &str| runs.iter().all(|run| run.column(name).is_some());
        let columns: Vec<&str> = (runs[0].columns.iter())
            .map(|column| column.name.as_str())
            .filter(|name| shared(name))
            .collect();
        let mut text = format!("{HEAD}\n");
        self.write_system(&mut text, instances);
        let wires = wires(instances);
        if !wires.is_empty() {
            text += "\n[connect]                                # from = to\n";
            for (from, to) in &wires {
                let _ = writeln!(text, "{} = {}", quoted(from), quoted(to));
            }
        }
        write_inputs(&mut text, instances, &wires, runs);
        write_measured(&mut text, instances, &columns)?;
        write_parameters(&mut text, instances);
        write_rest(&mut text, instances);
        for file in &self.runs {
            let _ = writeln!(text, "\n[[run]]\nfile = {}", quoted(&self.beside(file)));
        }
        Ok(text + OPTIONS)
    }

    fn write_system(&self, text: &mut String, instances: &[Instance]) {
        for own in instances {
            let path = Path::new(&own.given);
            let is_file = path.is_file() || path.join("modelDescription.xml").is_file();
            let model = match is_file {
                true => self.beside(Path::new(&own.given)),
                false => own.given.clone(),
            };
            let _ = writeln!(text, "\n[system.{}]\nmodel = {}", own.name, quoted(&model));
            if own.given == "linear" {
                *text += "order = 3                                # of the transfer function\n";
            }
        }
    }

    /// A file relative to the folder of the problem file.
    fn beside(&self, file: &Path) -> String {
        let folder = self.output.as_deref().and_then(Path::parent);
        let folder = folder.filter(|folder| !folder.as_os_str().is_empty());
        let named = match folder {
            None => file.to_owned(),
            Some(folder) => match file.strip_prefix(folder) {
                Ok(inside) => inside.to_owned(),
                Err(_) => std::path::absolute(file).unwrap_or_else(|_| file.to_owned()),
            },
        };
        let text = named.to_string_lossy().into_owned();
        // A bare name would be taken for a built-in model.
        match pilotage_text::is_identifier(&text) {
            true => format!("./{text}"),
            false => text,
        }
    }
}

/// Name of the vehicle's position along an axis, as seen by the pilot.
fn position(vehicle: &Instance, axis: &str) -> Option<String> {
    let own = &vehicle.outputs;
    let candidates = [
        format!("position{axis}"),
        format!("z{axis}"),
        format!("x{axis}"),
    ];
    let found = candidates.into_iter().find(|name| own.contains(name));
    found.or_else(|| own.first().filter(|_| axis.is_empty()).cloned())
}

/// Connections of pilot and vehicle: stick forward, position back, and whatever else has one name in both.
fn wires(instances: &[Instance]) -> Vec<(String, String)> {
    let [pilot, vehicle] = instances else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let common = |from: &Instance, to: &Instance| -> Vec<(String, String)> {
        let both = from.outputs.iter().filter(|name| to.inputs.contains(name));
        let wire = |name: &String| {
            (
                format!("{}.{name}", from.name),
                format!("{}.{name}", to.name),
            )
        };
        both.map(wire).collect()
    };
    // What both have by one name, and the position by the names that vehicles have for it.
    all.extend(common(pilot, vehicle));
    all.extend(common(vehicle, pilot));
    for axis in ["", "2"] {
        let seen = format!("pilot.position{axis}");
        let is_open = all.iter().all(|(_, to)| *to != seen);
        let is_seen = pilot.inputs.contains(&format!("position{axis}"));
        if let (true, Some(position)) = (is_open && is_seen, position(vehicle, axis)) {
            all.push((format!("vehicle.{position}"), seen));
        }
    }
    all
}

fn write_inputs(
    text: &mut String,
    instances: &[Instance],
    wires: &[(String, String)],
    runs: &[Series],
) {
    let is_column = |name: &str| runs.iter().all(|run| run.column(name).is_some());
    *text +=
        "\n[inputs]                                 # columns of the runs that drive the system\n";
    for own in instances {
        for input in &own.inputs {
            let full = format!("{}.{input}", own.name);
            let is_wired = wires.iter().any(|(_, to)| *to == full);
            match is_column(input) {
                _ if is_wired => {}
                true if jumps(input, runs) => {
                    let _ = writeln!(
                        text,
                        "{} = {{ column = {}, hold = \"zero-order\" }}   # it jumps at samples, and keeps its values between",
                        quoted(&full),
                        quoted(input)
                    );
                }
                true => {
                    let _ = writeln!(text, "{} = {}", quoted(&full), quoted(input));
                }
                false => {
                    let _ = writeln!(
                        text,
                        "# {} = \"COLUMN\"                # no column is called so: it keeps its start value",
                        quoted(&full)
                    );
                }
            }
        }
    }
}

/// Whether a column keeps its values and jumps in some of the runs, and does nothing else in the others.
fn jumps(column: &str, runs: &[Series]) -> bool {
    are_stepped(
        runs.iter()
            .filter_map(|run| Some((run.time.as_slice(), run.column(column)?.values.as_slice()))),
    )
}

/// Measured signals: outputs with the names of columns, and the position.
fn write_measured(
    text: &mut String,
    instances: &[Instance],
    columns: &[&str],
) -> Result<(), Failure> {
    let mut measured: Vec<(String, &str)> = Vec::new();
    for own in instances.iter().filter(|own| own.name != "pilot") {
        for signal in &own.outputs {
            if let Some(column) = columns.iter().find(|column| *column == signal) {
                measured.push((format!("{}.{signal}", own.name), column));
            }
        }
        for axis in ["", "2"] {
            let column = format!("position{axis}");
            let column = columns.iter().find(|own| **own == column);
            let is_new = |column: &&&str| measured.iter().all(|(_, own)| own != *column);
            if let (Some(column), Some(position)) = (column.filter(is_new), position(own, axis)) {
                measured.push((format!("{}.{position}", own.name), column));
            }
        }
    }
    if measured.is_empty() {
        let message = format!(
            "no column is called as an output of the models; the runs have {}",
            columns.join(", ")
        );
        return Err(Failure::new(message).hint(
            "rename a column or write the file by hand: docs/problems.md, examples/problems",
        ));
    }
    for (signal, column) in measured {
        let _ = write!(
            text,
            "\n[[measured]]\nsignal = {}\ncolumn = {}\n# sd = 0.05                              # of the noise, in the unit of the signal; 1 unless given\n",
            quoted(&signal),
            quoted(column)
        );
    }
    Ok(())
}

fn write_parameters(text: &mut String, instances: &[Instance]) {
    *text += "\n[parameters]                             # what is sought; each starts at its model's value unless given\n";
    let sought = &instances[0];
    if !sought.is_known {
        *text += "# What of the FMU is sought is yours to say: take the `#` away.\n";
    }
    for own in &sought.parameters {
        let start = crate::document::number(own.start);
        let unit = match own.unit.as_str() {
            "" => String::new(),
            unit => format!("[{unit}]"),
        };
        let about = [own.description.as_str(), &unit];
        let about: Vec<&str> = about.into_iter().filter(|own| !own.is_empty()).collect();
        let fixed = match own.name.ends_with("_limit") {
            true => ", fixed = true",
            false => "",
        };
        let idle = if sought.is_known { "" } else { "# " };
        let name = format!("{}.{}", sought.name, own.name);
        let line = format!("{idle}{} = {{ start = {start}{fixed} }}", quoted(&name));
        let _ = match about.is_empty() {
            true => writeln!(text, "{line}"),
            false => write!(text, "{line:<40} {}", comment(&about.join(" "))),
        };
    }
}

fn write_rest(text: &mut String, instances: &[Instance]) {
    *text += "\n[initial]                                # else what the models start with\n";
    if let [_, vehicle] = instances {
        let is_state = |name: &String| vehicle.states.contains(name);
        if let Some(position) = position(vehicle, "").filter(is_state) {
            let line = format!("{} = \"free\"", quoted(&format!("vehicle.{position}")));
            let _ = writeln!(
                text,
                "{line:<40} # the first sample is a measurement like the others"
            );
        }
        if let (Some(position), true) = (
            position(vehicle, "2").filter(is_state),
            vehicle.inputs.contains(&"stick2".to_owned()),
        ) {
            let own = quoted(&format!("vehicle.{position}"));
            let _ = writeln!(text, "{own} = \"free\"");
        }
        *text += "\n[stability]\nmodels = [\"pilot\"]\nclosed_loop = true\n";
    } else {
        let _ = writeln!(text, "# \"{}.*\" = \"free\"", instances[0].name);
    }
}

const HEAD: &str = "# A problem of pilotage: what was measured, what is sought.
#
#     pilotage fit THIS-FILE
#
# Every key is in docs/problems.md, other problems are in examples/problems.";

const OPTIONS: &str = "
[fit]
# mesh = \"samples\"                       # nodes at the samples alone
mesh_tolerance = 1e-6                    # nodes between them until the states' relative error is below
# starts = 1                             # from the given start values alone, in less time; 8 unless given
";
