//! `pilotage init`: writes a problem file for existing runs and models.

mod accepted;
mod instance;

use super::overwrite::{self, OutputKind, Overwrite};
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, made, terminal};
use crate::document::quoted;
use crate::estimation::file::Options;
use crate::flights::problem::{Draft, ESTIMATED, Instance, Recorded};
use crate::flights::trials::ColumnNames;
use crate::flights::{Trial, TrialSet};
use crate::series::Series;
use instance::opened;
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
    /// Recorded runs (CSV), or lists of flights (TOML) with their weights and validation runs.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Pilot: a built-in model, a model or pilot file, or an FMU.
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = "linear",
        conflicts_with = "model"
    )]
    pilot: String,
    /// Vehicle: a built-in model, a model or vehicle file, or an FMU.
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

/// A run of the problem.
struct Listed {
    file: PathBuf,
    weight: f64,
    fits: bool,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let instances = args.instances()?;
    recognise::expect(
        &args.runs,
        &[FileKind::Trial, FileKind::Table, FileKind::Manifest],
        "recorded runs (CSV) or lists of them (TOML)",
    )?;
    let listed = args.listed()?;
    let runs: Vec<Series> = (listed.iter())
        .map(|own| Series::read_table(&own.file))
        .collect::<Result<_, _>>()?;
    for (own, series) in listed.iter().zip(&runs) {
        if let Some(note) = &series.note {
            terminal::note(&format!("{}: {note}", own.file.display()));
        }
    }
    let text = args.text(&instances, &listed, &runs)?;
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
    let files = listed.into_iter().map(|own| own.file);
    let inputs = args.runs.iter().cloned().chain(files);
    let inputs: Vec<PathBuf> = inputs.chain(models).collect();
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
            Some(model) => Ok(vec![opened("model", model, &self.model(model))?]),
            None => Ok(vec![
                opened("pilot", &self.pilot, &self.model(&self.pilot))?,
                opened("vehicle", &self.vehicle, &self.model(&self.vehicle))?,
            ]),
        }
    }

    /// The runs, those of lists one by one, validation runs of a list last.
    fn listed(&self) -> Result<Vec<Listed>, Failure> {
        let mut all = Vec::new();
        for file in &self.runs {
            if recognise::of(file) != Some(FileKind::Manifest) {
                all.push(Listed {
                    file: file.clone(),
                    weight: 1.0,
                    fits: true,
                });
                continue;
            }
            let set = TrialSet::read(std::slice::from_ref(file))?;
            let listed = |(k, own): (usize, &Trial)| Listed {
                file: PathBuf::from(&own.origin),
                weight: own.weight,
                fits: k < set.fit.len(),
            };
            all.extend(set.all().enumerate().map(listed));
        }
        Ok(all)
    }

    /// The text of the problem file.
    fn text(
        &self,
        instances: &[Instance],
        listed: &[Listed],
        runs: &[Series],
    ) -> Result<String, Failure> {
        let run = |(own, series): (&Listed, _)| Recorded {
            file: self.beside(&own.file),
            series,
            weight: own.weight,
            fits: own.fits,
            set: Vec::new(),
        };
        let runs: Vec<Recorded<'_>> = listed.iter().zip(runs).map(run).collect();
        let is_loop = instances.len() > 1;
        let draft = Draft {
            instances,
            names: &ColumnNames::default(),
            runs: &runs,
            measured: None,
            initial: initial(instances),
            own: Vec::new(),
            stable: if is_loop { vec!["pilot"] } else { Vec::new() },
            stable_loop: is_loop,
            options: Options::default(),
        };
        draft.text().map_err(|error| {
            Failure::from(error).hint(
                "rename a column or write the file by hand: docs/problems.md, examples/problems",
            )
        })
    }

    /// The model of an instance, as the problem names it.
    fn model(&self, given: &str) -> String {
        let path = Path::new(given);
        match path.is_file() || path.join("modelDescription.xml").is_file() {
            true => self.beside(path),
            false => given.to_owned(),
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

/// What is sought of the initial states: the positions of a vehicle.
fn initial(instances: &[Instance]) -> Vec<(String, &'static str)> {
    let [_, vehicle] = instances else {
        return vec![(format!("# \"{}.*\" = \"free\"", instances[0].name), "")];
    };
    let state = |axis: &str| {
        let position = vehicle.position(axis)?;
        let is_state = vehicle.states.iter().any(|own| own == position);
        is_state.then(|| format!("{} = \"free\"", quoted(&format!("vehicle.{position}"))))
    };
    let first = state("").map(|line| (line, ESTIMATED));
    let has_second = vehicle.inputs.iter().any(|own| own == "stick2");
    let second = state("2").filter(|_| has_second).map(|line| (line, ""));
    first.into_iter().chain(second).collect()
}
