//! `pilotage pack`: packs a user's own model as an FMU.

use super::export::FmuArgs;
use super::made::{program, quoted};
use super::{Failure, Outcome, recognise, terminal};
use crate::export::{ExportError, Provenance, pack};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// Arguments of `pilotage pack`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage pack my-vehicle                 builds the crate in this folder\n  \
    pilotage pack libmy_vehicle.so --fmi 3   uses a library that is built\n\n\
    docs/fmu-models.md shows how to write a model.")]
pub struct Args {
    /// Folder of a crate, or shared library, made with `pilotage_sdk::export!`.
    model: PathBuf,
    /// FMU to write [default: the model's name].
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[command(flatten)]
    fmu: FmuArgs,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let check = |output: &Path| {
        // Of a crate's folder, cargo reads no FMUs: they may be made where its author is.
        let is_apart = args.model.is_dir() && output.extension().is_some_and(|own| own == "fmu");
        let input = (!is_apart).then_some(args.model.as_path());
        args.fmu.check_output(input, output)
    };
    args.output.as_deref().map_or(Ok(()), check)?;
    let what = "the folder of a crate, or a shared library";
    recognise::expect(
        [&args.model],
        &[recognise::FileKind::Library, recognise::FileKind::Folder],
        what,
    )?;
    let options = args.fmu.options()?;
    if options.has_sources {
        let message = "a model in Rust cannot be written as C; --source is for model files, pilots and quadcopters";
        return Err(Failure::new(message).hint("`pilotage export` writes those"));
    }
    let (library, license) = match args.model.is_dir() {
        // A first build takes a minute: on a terminal, cargo's progress is shown.
        true => pack::build(&args.model, std::io::stderr().is_terminal()).map_err(not_built)?,
        false => (args.model.clone(), None),
    };
    let mut provenance = Provenance {
        license,
        ..Provenance::default()
    };
    args.fmu.sign(&mut provenance)?;
    let path = pack::pack(&library, &provenance, &options, |interface| {
        let named = || PathBuf::from(format!("{}.fmu", interface.name));
        let path = args.output.clone().unwrap_or_else(named);
        check(&path).map(|()| path)
    })?;
    terminal::print(&format!(
        "wrote {}\nnext: {} validate {}\n",
        terminal::shown(&path),
        program(),
        quoted(&path.to_string_lossy())
    ))?;
    Ok(Outcome::Done)
}

/// Cargo's messages are lines below ours.
fn not_built(error: ExportError) -> Failure {
    match error {
        ExportError::Build { folder, messages } => {
            Failure::new(format!("{} cannot be built:", folder.display())).below(&messages)
        }
        other => other.into(),
    }
}
