//! `pilotage export`: exports models as FMUs.

use super::made::{program, quoted};
use super::model::open::ModelArgs;
use super::overwrite::{OutputKind, Overwrite};
use super::{Failure, Outcome, recognise, terminal};
use crate::date;
use crate::document;
use crate::export::{Export, ExportOptions, Platform, Provenance, binary, platform};
use crate::file;
use crate::flights::pilot::PilotFile;
use crate::fmi::Fmu;
use crate::fmi::description::FmiVersion;
use crate::fmi_check::is_date_and_time;
use crate::models::Quadcopter;
use crate::models::model::Model;
use crate::models::pilot::PAPER_THETA;
use crate::vehicle::PitchLoop;
use clap::{Subcommand, ValueEnum};
use std::path::{Path, PathBuf};

/// Arguments of `pilotage export`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:\n  \
        pilotage export model.toml -o model.fmu            a model file (docs/models.md)\n  \
        pilotage export crossover --fmi 3                  a built-in model (`pilotage models`)\n  \
        pilotage export pilot pilot.toml -o pilot.fmu      the pilot that `pilotage fit` found\n  \
        pilotage export model.toml --source                with its C99 sources, for any target"
)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    model: Option<ModelArgs>,
    /// FMU to write [default: the model's name].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Export the best iterate of a fit that did not converge, marked as such.
    #[arg(long)]
    allow_unconverged: bool,
    #[command(flatten)]
    fmu: ExportArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a pilot as an FMU.
    #[command(after_help = "Examples:\n  \
        pilotage export pilot pilot.toml -o pilot.fmu      the pilot that `pilotage fit` found\n  \
        pilotage export pilot --preset paper -o paper.fmu  the published pilot")]
    Pilot {
        /// File of the pilot that `pilotage fit` wrote.
        #[arg(required_unless_present = "preset", conflicts_with = "preset")]
        pilot: Option<PathBuf>,
        /// A published pilot.
        #[arg(long)]
        preset: Option<Preset>,
        /// FMU to write.
        #[arg(short, long, default_value = "pilot.fmu")]
        output: PathBuf,
        /// Export the best iterate of a fit that did not converge, marked as such.
        #[arg(long)]
        allow_unconverged: bool,
        #[command(flatten)]
        fmu: ExportArgs,
    },
    /// Write a quadcopter as an FMU.
    #[command(after_help = "Examples:\n  \
        pilotage export quadcopter -o quadcopter.fmu               the default vehicle\n  \
        pilotage export quadcopter vehicle.toml -o quadcopter.fmu  a vehicle of your own")]
    Quadcopter {
        /// A vehicle file (TOML); the default vehicle where none is given.
        vehicle: Option<PathBuf>,
        /// FMU to write.
        #[arg(short, long, default_value = "quadcopter.fmu")]
        output: PathBuf,
        #[command(flatten)]
        fmu: ExportArgs,
    },
}

/// Which FMU to make of a model that needs no compiler.
#[derive(Debug, clap::Args)]
struct ExportArgs {
    #[command(flatten)]
    fmu: FmuArgs,
    #[command(flatten)]
    platforms: PlatformArgs,
    /// Add the model as C99 sources, beside the binary: for targets that no binary is for.
    #[arg(long)]
    source: bool,
}

impl ExportArgs {
    /// The requested options, with the libraries read.
    fn options(&self) -> Result<ExportOptions, Failure> {
        Ok(ExportOptions {
            platforms: self.platforms.of(binary::MODELS)?,
            has_sources: self.source,
            ..self.fmu.options()?
        })
    }
}

/// For which platforms to make an FMU.
#[derive(Debug, clap::Args)]
pub struct PlatformArgs {
    /// Platforms on which it runs, such as linux64,win64 [default: all for which this command has a library].
    #[arg(long, value_name = "PLATFORM", value_delimiter = ',')]
    platforms: Vec<String>,
}

impl PlatformArgs {
    /// The chosen ones, if any are, of those that have a library.
    pub fn of(&self, library: binary::Libraries) -> Result<Option<Vec<Platform>>, Failure> {
        if self.platforms.is_empty() {
            return Ok(None);
        }
        let embedded = library.platforms()?;
        let mut wanted: Vec<Platform> = Vec::new();
        for name in &self.platforms {
            // FMI 2.0 has one name for all Macs.
            let of_name = embedded.iter().filter(|own| own.has_name(name));
            let before = wanted.len();
            wanted.extend(of_name);
            if wanted.len() == before {
                wanted.push(platform::named(name)?);
            }
        }
        wanted.sort_by_key(|platform| platform.tuple);
        wanted.dedup();
        Ok(Some(wanted))
    }
}

/// Which FMU to make.
#[derive(Debug, clap::Args)]
pub struct FmuArgs {
    /// FMI version.
    #[arg(long, default_value = "2")]
    fmi: Version,
    /// Add a library built for another platform (win64, aarch64-darwin, ...); may be repeated.
    #[arg(long, value_name = "PLATFORM=FILE")]
    binary: Vec<String>,
    /// Author of the model.
    #[arg(long, value_name = "NAME")]
    author: Option<String>,
    /// Date of the FMU, such as 2026-01-31T12:00:00Z [default: SOURCE_DATE_EPOCH from the environment, else none, so
    /// that the same model gives the same file].
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
}

/// Parses a date in the format of FMI.
fn date(text: &str) -> Result<String, String> {
    match is_date_and_time(text) {
        true => Ok(text.to_owned()),
        false => Err("expected YYYY-MM-DDThh:mm:ssZ".to_owned()),
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Version {
    /// FMI 2.0.
    #[value(name = "2")]
    V2,
    /// FMI 3.0.
    #[value(name = "3")]
    V3,
}

impl FmuArgs {
    /// Refuses to overwrite the exported model, a library, or a file that is no FMU of pilotage.
    pub fn check_output(&self, model: Option<&Path>, output: &Path) -> Result<(), Failure> {
        let libraries =
            (self.binary.iter()).filter_map(|argument| Some(argument.split_once('=')?.1));
        let inputs = libraries.map(PathBuf::from);
        let inputs: Vec<PathBuf> = inputs.chain(model.map(Path::to_owned)).collect();
        self.overwrite.check(&inputs, &[(output, OutputKind::Fmu)])
    }

    /// Sets author and date.
    pub fn sign(&self, provenance: &mut Provenance) -> Result<(), Failure> {
        const VARIABLE: &str = "SOURCE_DATE_EPOCH";
        provenance.author.clone_from(&self.author);
        provenance.date = match (&self.date, std::env::var(VARIABLE)) {
            (Some(date), _) => Some(date.clone()),
            (None, Err(_)) => None,
            (None, Ok(text)) => {
                let date = text.parse().ok().and_then(date::of_fmi);
                let wrong = || {
                    Failure::new(format!(
                        "{VARIABLE} is `{text}`; expected seconds since 1970"
                    ))
                };
                Some(date.ok_or_else(wrong)?)
            }
        };
        Ok(())
    }

    /// The requested options, with the libraries read.
    pub fn options(&self) -> Result<ExportOptions, Failure> {
        let read = |argument: &String| {
            let Some((platform, file)) = argument.split_once('=') else {
                let message = format!("--binary {argument} has no file");
                return Err(Failure::new(message).hint("write --binary win64=model.dll"));
            };
            let bytes = file::bytes(Path::new(file))
                .map_err(|error| Failure::new(format!("cannot read {file}: {error}")))?;
            Ok((platform::named(platform)?, bytes))
        };
        Ok(ExportOptions {
            version: match self.fmi {
                Version::V2 => FmiVersion::V2,
                Version::V3 => FmiVersion::V3,
            },
            binaries: self.binary.iter().map(read).collect::<Result<_, _>>()?,
            ..ExportOptions::default()
        })
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Preset {
    /// The θ printed in the paper; see the note in the FMU.
    Paper,
}

/// Caveat for a vehicle that cannot be flown.
const UNSTABLE: &str =
    "The pitch loop of this vehicle is unstable; `pilotage vehicle check` says why.";

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let command = match (args.command, args.model) {
        (Some(command), _) => command,
        (None, Some(model)) => {
            return text(&model, args.output, args.allow_unconverged, &args.fmu);
        }
        (None, None) => {
            return Err(Failure::new("no model is named")
                .hint("name a model file, or `pilot` or `quadcopter`; `pilotage export --help` has examples"));
        }
    };
    match command {
        Command::Pilot {
            pilot,
            preset,
            output,
            allow_unconverged,
            fmu,
        } => {
            let is_model = |file: &PathBuf| recognise::of(file) == Some(recognise::FileKind::Model);
            if let Some(file) = pilot.as_ref().filter(|file| is_model(file)) {
                let model = ModelArgs {
                    model: file.display().to_string(),
                    order: None,
                };
                return text(&model, Some(output), allow_unconverged, &fmu);
            }
            fmu.fmu.check_output(pilot.as_deref(), &output)?;
            let (model, mut provenance) = match (pilot, preset) {
                (Some(file), _) => fitted(&file, allow_unconverged)?,
                (None, _) => (Model::pilot(&PAPER_THETA, 1.0), Provenance::paper()),
            };
            fmu.fmu.sign(&mut provenance)?;
            write(&model, &provenance, fmu.options()?, &output)
        }
        Command::Quadcopter {
            vehicle,
            output,
            fmu,
        } => {
            fmu.fmu.check_output(vehicle.as_deref(), &output)?;
            let (vehicle, source) = match &vehicle {
                Some(file) => (super::vehicle::read(file)?, Some(document::read(file)?)),
                None => (Quadcopter::default(), None),
            };
            let mut provenance = Provenance::vehicle(source);
            if !PitchLoop::of(&vehicle).is_stable() {
                provenance.caveat = Some(UNSTABLE.into());
            }
            fmu.fmu.sign(&mut provenance)?;
            let model = Model::quadcopter(&vehicle);
            write(&model, &provenance, fmu.options()?, &output)
        }
    }
}

/// Refuses the best iterate of a fit that has no answer, unless it is allowed.
fn unconverged(file: &Path, objection: &str) -> Failure {
    let message = format!("{}: the fit {objection}", file.display());
    Failure::new(message).hint(
        "fit again (more iterations, another --start), or pass --allow-unconverged to export \
         its best iterate",
    )
}

/// Exports a model file.
fn text(
    args: &ModelArgs,
    output: Option<PathBuf>,
    allow_unconverged: bool,
    args_of_fmu: &ExportArgs,
) -> Result<Outcome, Failure> {
    let fmu = &args_of_fmu.fmu;
    let file = args.file();
    let model = args.open()?;
    let own = &model.compiled().file;
    let is_answer = own.fit.as_ref().is_none_or(|fit| fit.converged);
    if !is_answer && !allow_unconverged {
        return Err(unconverged(Path::new(&own.file), "did not converge"));
    }
    let output = output.unwrap_or_else(|| PathBuf::from(format!("{}.fmu", own.name)));
    fmu.check_output(file.as_deref(), &output)?;
    let shown = file.as_deref().and_then(Path::file_name);
    let shown = shown.map_or(own.file.clone(), |name| name.to_string_lossy().into());
    let mut provenance = Provenance::model_file(&shown, &own.source);
    provenance.caveat = own.fit.as_ref().and_then(|fit| fit.caveat());
    fmu.sign(&mut provenance)?;
    Export::text(&model, &provenance)
        .options(args_of_fmu.options()?)
        .write(&output)?;
    print_written(&provenance, &output)
}

/// The pilot of a pilot file, which fits of flights wrote before they wrote model files.
fn fitted(file: &Path, allow_unconverged: bool) -> Result<(Model, Provenance), Failure> {
    recognise::expect(
        [&file.to_owned()],
        &[recognise::FileKind::Pilot],
        "a pilot file (TOML)",
    )?;
    let fitted = PilotFile::read(file)?;
    if let Some(objection) = fitted.objection().filter(|_| !allow_unconverged) {
        return Err(unconverged(file, &objection));
    }
    let pilot = &fitted.pilot;
    let order = pilot.structure().order;
    if order > Model::MAX_ORDER {
        let message = format!(
            "{}: a pilot of order {order} cannot be exported; the highest order is {}",
            file.display(),
            Model::MAX_ORDER
        );
        return Err(Failure::new(message));
    }
    let model = Model::pilot(&pilot.theta, pilot.stick_limit);
    Ok((
        model,
        Provenance::fit(
            document::read(file)?,
            fitted.is_stable_loop(),
            fitted.caveat(),
        ),
    ))
}

fn write(
    model: &Model,
    provenance: &Provenance,
    options: ExportOptions,
    output: &Path,
) -> Result<Outcome, Failure> {
    Export::new(model, provenance)
        .options(options)
        .write(output)?;
    print_written(provenance, output)
}

pub(super) fn print_written(provenance: &Provenance, output: &Path) -> Result<Outcome, Failure> {
    let mut text = written(output);
    if let Some(caveat) = &provenance.caveat {
        text += &terminal::labelled("note", caveat);
    }
    let (program, fmu) = (program(), quoted(&output.to_string_lossy()));
    text += &format!("next: {program} validate {fmu}\n");
    terminal::print(&text)?;
    Ok(Outcome::Done)
}

/// That an FMU was written, for which platforms, and how large it is.
pub fn written(output: &Path) -> String {
    let name = terminal::shown(output);
    let has = || {
        let size = output.metadata().ok()?.len();
        let platforms = Fmu::open(output).ok()?.platforms();
        Some((platforms.join(", "), size as f64 / 1e6))
    };
    match has() {
        Some((platforms, size)) => format!("wrote {name} ({platforms}; {size:.2} MB)\n"),
        None => format!("wrote {name}\n"),
    }
}
