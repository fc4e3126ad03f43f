//! `pilotage convert`: system files of pilotage as SSP, and systems of other tools as system files.

use super::overwrite::{self, OutputKind, Overwrite};
use super::recognise::{self, FileKind};
use super::system::file;
use super::{Failure, Outcome, terminal};
use crate::cosim::SystemDescription;
use crate::cosim::description::{InstanceSource, Spanned};
use pilotage_systems::{WriteError, to_ssd, to_ssp};
use std::fs;
use std::path::{Path, PathBuf};

/// Arguments of `pilotage convert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage convert flight.toml flight.ssp            an archive with all FMUs\n  \
    pilotage convert flight.toml shared/flight.ssd     FMUs go to shared/resources\n  \
    pilotage convert other.ssp other.toml              FMUs go to the folder other\n  \
    pilotage convert other.ssp heavy.toml --variant heavy\n\n\
    docs/systems.md says what each of them can hold.")]
pub struct Args {
    /// System file: TOML, SSP (.ssp, its folder, .ssd), OspSystemStructure.xml, or mm.json of maestro.
    input: PathBuf,
    /// File to write: .toml, .ssp or .ssd.
    output: PathBuf,
    /// Variant of an SSP with several .ssd, by its name or its file's.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    recognise::expect([&args.input], &[FileKind::System], "a system file")?;
    let read = file::read(&args.input, args.variant.as_deref())?;
    for note in &read.notes {
        terminal::note(note);
    }
    let output = args.output.as_path();
    let extension = output.extension().unwrap_or_default().to_ascii_lowercase();
    let name = output.file_stem().unwrap_or_default().to_string_lossy();
    let mut description = read.description;
    let mut copies = Copies::default();
    let (content, kind) = match extension.to_str() {
        Some("ssp") => (
            to_ssp(&description, &name).map_err(unwritten)?,
            OutputKind::Ssp,
        ),
        Some("ssd") => {
            let folder = folder_of(output);
            copies.of(&mut description, &folder.join("resources"), &folder)?;
            let sources = copies.sources(&description, &folder)?;
            let text = to_ssd(&description, &name, &sources).map_err(unwritten)?;
            (text.into_bytes(), OutputKind::Ssp)
        }
        Some("toml") => {
            if !description.kept.is_empty() {
                copies.of(&mut description, &output.with_extension(""), Path::new(""))?;
            }
            // A first time to see whether it can be said.
            copies.named(&description).to_toml(&folder_of(output))?;
            (Vec::new(), OutputKind::System)
        }
        _ => {
            let message = format!("{} is no kind of system", output.display());
            return Err(Failure::new(message).hint("end its name with .toml, .ssp or .ssd"));
        }
    };
    let mut outputs = vec![(output, kind)];
    outputs.extend(
        copies
            .0
            .iter()
            .map(|(_, to)| (to.as_path(), OutputKind::Fmu)),
    );
    args.overwrite
        .check(std::slice::from_ref(&args.input), &outputs)?;
    for (from, to) in &copies.0 {
        let folder = folder_of(to);
        let made = fs::create_dir_all(&folder);
        made.map_err(|error| Failure::cannot_write(&folder, &error))?;
        overwrite::save(to, pilotage_systems::fmu(from).map_err(unwritten)?)?;
    }
    let content = match kind {
        // Of files that are there, the paths are relative.
        OutputKind::System => {
            let text = copies.named(&description).to_toml(&folder_of(output))?;
            text.into_bytes()
        }
        _ => content,
    };
    overwrite::save(output, content)?;
    terminal::print(&format!("wrote {}\n", terminal::shown(output)))?;
    Ok(Outcome::Done)
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

fn unwritten(error: WriteError) -> Failure {
    let hint = match &error {
        WriteError::NotAnFmu { .. } => Some(
            "`pilotage export` makes FMUs of models, pilots and vehicles; tables stay beside: `cosim --input`",
        ),
        _ => None,
    };
    let failure = Failure::from(error);
    match hint {
        Some(hint) => failure.hint(hint),
        None => failure,
    }
}

/// FMUs that are copied: from where, and to where.
#[derive(Default)]
struct Copies(Vec<(PathBuf, PathBuf)>);

impl Copies {
    /// Copies the FMUs of a system into a folder, but for those that lie in another and will stay there.
    fn of(
        &mut self,
        description: &mut SystemDescription,
        into: &Path,
        stays: &Path,
    ) -> Result<(), Failure> {
        let is_temporary = !description.kept.is_empty();
        for own in &description.instances {
            let InstanceSource::Model(from) = &own.source.value else {
                continue;
            };
            let is_known = self.0.iter().any(|(known, _)| known == from);
            if is_known || (!is_temporary && inside(from, stays).is_some()) {
                continue;
            }
            let stem = from.file_stem().unwrap_or_default().to_string_lossy();
            // Functions of OSP are model files.
            let is_model = from.extension().is_some_and(|own| own == "toml");
            let ending = if is_model { "toml" } else { "fmu" };
            let mut k = 1;
            let to = loop {
                let end = if k == 1 {
                    String::new()
                } else {
                    format!("-{k}")
                };
                let to = into.join(format!("{stem}{end}.{ending}"));
                if self.0.iter().all(|(_, taken)| *taken != to) {
                    break to;
                }
                k += 1;
            };
            self.0.push((from.clone(), to));
        }
        Ok(())
    }

    /// Paths of the FMUs from a folder, as they will be.
    fn sources(
        &self,
        description: &SystemDescription,
        folder: &Path,
    ) -> Result<Vec<String>, Failure> {
        let source = |own: &crate::cosim::description::InstanceDescription| {
            let Some(file) = own.source.value.file() else {
                return Ok(String::new());
            };
            let copied = self.0.iter().find(|(from, _)| from == file);
            let path = match copied {
                Some((_, to)) => to.strip_prefix(folder).ok().map(Path::to_owned),
                None => inside(file, folder),
            };
            let path = path.as_deref().and_then(Path::to_str);
            let named = path.map(|path| path.replace('\\', "/"));
            named
                .ok_or_else(|| Failure::new(format!("the name of {} is not UTF-8", file.display())))
        };
        description.instances.iter().map(source).collect()
    }

    /// The description with the copies in place of the FMUs.
    fn named(&self, description: &SystemDescription) -> SystemDescription {
        let mut description = description.clone();
        for own in &mut description.instances {
            let copied = |file: &Path| self.0.iter().find(|(from, _)| from == file);
            if let Some((_, to)) = own.source.value.file().and_then(copied) {
                own.source = Spanned::from(InstanceSource::Model(to.clone()));
            }
        }
        description
    }
}

/// The path of a file from a folder, if it lies in it.
fn inside(file: &Path, folder: &Path) -> Option<PathBuf> {
    let (file, folder) = (file.canonicalize().ok()?, folder.canonicalize().ok()?);
    file.strip_prefix(folder).ok().map(Path::to_owned)
}
