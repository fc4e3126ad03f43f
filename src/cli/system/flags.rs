//! Command-line arguments that describe the simulated system.

use super::super::Failure;
use super::super::overwrite::{OutputKind, Overwrite};
use super::super::recognise::{self, FileKind};
use super::isolation::Isolation;
use super::{Built, build, file, full_name, only, parameters, save};
use crate::cosim::description::{
    InstanceDescription, InstanceSource, Interface, Setting, Transformation, Wire,
};
use crate::cosim::{System, SystemDescription};
use clap::ValueEnum;
use pilotage_text::is_identifier;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// A system file, or FMUs, models, tables, wires and values.
#[derive(Debug, clap::Args)]
pub struct Wiring {
    /// FMUs, or pilot, vehicle and model files (TOML), which run without export; an instance is named after its file
    /// unless NAME= is given. Or a system file (TOML, docs/systems.md; SSP: .ssp, its folder, .ssd) with instances, wires
    /// and values; arguments add to it and take precedence over it.
    #[arg(required = true, value_name = "[NAME=]FMU")]
    models: Vec<OsString>,
    /// Variant of an SSP with several .ssd, by its name or its file's.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Interface to use of FMUs that have both [default: cs].
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    /// Connect an output to an input; may be repeated. Arrays of the same dimensions are connected element by
    /// element; `NAME[1]` is one element (put it in quotes for shells such as zsh).
    #[arg(long, value_name = "INSTANCE.OUTPUT=INSTANCE.INPUT", value_parser = pair)]
    connect: Vec<(String, String)>,
    /// Table of inputs (CSV: `time [s]`, then columns with units). A column with the name of an input drives it (for
    /// a single FMU also without the instance); connect others by --connect NAME.COLUMN=INSTANCE.INPUT. Values
    /// between samples are interpolated (held for inputs that are not real); a repeated time is a jump. Within a step
    /// inputs are held, unless --algorithm or --extrapolation lets them change.
    #[arg(long, value_name = "[NAME=]CSV")]
    input: Vec<OsString>,
    /// Set a parameter or an unconnected input (of a single FMU also without the instance); an enumeration by number or
    /// by name; may be repeated.
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// File with such values: TOML (`[instance]`, then `variable = value`) or CSV (columns `name`, `value` and
    /// optionally `unit`). --set takes precedence.
    #[arg(long, value_name = "FILE")]
    parameters: Vec<PathBuf>,
    /// Order of the models, as `pilotage model` has it.
    #[arg(skip)]
    pub order: Option<u32>,
    #[command(flatten)]
    isolation: Isolation,
    /// Write the system of arguments and system file as a system file: instances, wires and values. Paths in it are
    /// relative to its folder.
    #[arg(long, value_name = "FILE")]
    save_system: Option<PathBuf>,
}

/// [`Interface`] by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum KindName {
    /// Co-simulation: the FMU brings its own solver.
    Cs,
    /// Model exchange: the FMU's equations are solved here, with error control and events.
    Me,
}

impl From<KindName> for Interface {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Cs => Self::CoSimulation,
            KindName::Me => Self::ModelExchange,
        }
    }
}

/// Parses `a=b`, split at the first `=`.
pub fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((left, right)) if !left.is_empty() => Ok((left.to_owned(), right.to_owned())),
        _ => Err("expected two parts with `=` between them".to_owned()),
    }
}

impl Wiring {
    /// Whether each FMU has a process of its own.
    pub fn isolates_all(&self) -> bool {
        self.isolation.is_all()
    }

    /// Whether any FMU has a process of its own.
    pub fn isolates_any(&self) -> bool {
        self.isolation.is_any()
    }

    /// Opens and connects everything, after checking that no input file is overwritten; saves the system if requested.
    /// `inputs` and `outputs` are the other files that the command reads and writes.
    pub fn build(
        &self,
        overwrite: &Overwrite,
        inputs: &[PathBuf],
        outputs: &[(&Path, OutputKind)],
    ) -> Result<Built, Failure> {
        self.expect()?;
        let mut notes = Vec::new();
        let (description, connections) = self.describe(&mut notes)?;
        let files = (description.instances.iter()).filter_map(|i| i.source.value.file());
        let files = files.map(Path::to_owned).chain(self.system_files());
        let files = files.chain(inputs.iter().cloned());
        let read: Vec<PathBuf> = files.chain(self.parameters.iter().cloned()).collect();
        let saved = self
            .save_system
            .as_deref()
            .map(|path| (path, OutputKind::System));
        let written: Vec<(&Path, OutputKind)> = outputs.iter().copied().chain(saved).collect();
        overwrite.check(&read, &written)?;
        let mut built = build(description, &self.isolation, |system, description| {
            let settings = self.settings(system, &mut notes)?;
            description.override_wiring(connections, settings);
            Ok(())
        })?;
        built.files = read;
        built.notes = notes;
        if let Some(path) = &self.save_system {
            save::write(path, &built.description)?;
        }
        Ok(built)
    }

    /// Refuses files of the wrong kind; model files are checked when they are opened.
    fn expect(&self) -> Result<(), Failure> {
        let tables = self.input.iter().map(|argument| instance(argument).1);
        let tables: Vec<PathBuf> = tables.collect();
        let words = "a table over time (CSV) for --input";
        recognise::expect(&tables, &[FileKind::Trial, FileKind::Table], words)?;
        let values = "start values for --parameters (TOML or CSV)";
        recognise::expect(&self.parameters, &[], values)
    }

    /// Whether a system file is given.
    pub fn has_system_file(&self) -> bool {
        self.system_files().next().is_some()
    }

    fn system_files(&self) -> impl Iterator<Item = PathBuf> {
        let files = self.models.iter().map(|argument| instance(argument).1);
        files.filter(|file| recognise::is_system(file))
    }

    /// The system file merged with the instances of the arguments, and the connections of the arguments.
    fn describe(&self, notes: &mut Vec<String>) -> Result<(SystemDescription, Vec<Wire>), Failure> {
        let files: Vec<PathBuf> = self.system_files().collect();
        let mut description = match files.as_slice() {
            [] if self.variant.is_some() => return Err(file::no_variants()),
            [] => SystemDescription::default(),
            [file] => self.read(file, notes)?,
            [first, second, ..] => {
                let (first, second) = (first.display(), second.display());
                let message = format!("{first} and {second} are system files; expected one");
                return Err(Failure::new(message).hint("copy the tables of one into the other"));
            }
        };
        let models = self.models.iter().map(|argument| instance(argument));
        let models = models.filter(|(_, file)| !files.contains(file));
        let models = models.map(|(name, file)| InstanceDescription {
            order: self.order.map(Into::into),
            ..described(name, model_source(file))
        });
        let tables = self.input.iter().map(|argument| instance(argument));
        let tables = tables.map(|(name, file)| described(name, InstanceSource::Table(file)));
        description.override_instances(models.chain(tables).collect())?;
        if let Some(kind) = self.kind {
            let is_model =
                |i: &&mut InstanceDescription| matches!(i.source.value, InstanceSource::Model(_));
            for instance in description.instances.iter_mut().filter(is_model) {
                instance.interface = Some(kind.into());
            }
        }
        let wire = |(from, to): &(String, String)| Wire {
            from: from.clone().into(),
            to: to.clone().into(),
            transformation: Transformation::default(),
        };
        Ok((description, self.connect.iter().map(wire).collect()))
    }

    fn read(&self, file: &Path, notes: &mut Vec<String>) -> Result<SystemDescription, Failure> {
        let mut named = self.models.iter().map(Path::new);
        if !named.any(|argument| argument == file) {
            let message = format!("{} is a system file, which has no name", file.display());
            return Err(Failure::new(message).hint("leave what stands before the `=` out"));
        }
        let read = file::read(file, self.variant.as_deref())?;
        notes.extend(read.notes);
        Ok(read.description)
    }

    /// The values given by arguments; how their files were taken becomes notes.
    fn settings(&self, system: &System, notes: &mut Vec<String>) -> Result<Vec<Setting>, Failure> {
        let given = self.set.iter().map(|(name, value)| Setting {
            name: full_name(system, name, only(system)).into(),
            value: value.clone(),
        });
        let given: Vec<Setting> = given.collect();
        let mut settings = given.clone();
        for file in &self.parameters {
            let is_new = |own: &Setting| !given.iter().any(|set| set.name.value == own.name.value);
            let (read, note) = parameters::read(system, file)?;
            notes.extend(note);
            settings.extend(read.into_iter().filter(is_new));
        }
        Ok(settings)
    }
}

/// An instance described by an argument.
pub fn described(name: String, source: InstanceSource) -> InstanceDescription {
    InstanceDescription {
        name,
        source: source.into(),
        order: None,
        interface: None,
        at_once: false,
    }
}

/// A file, or a built-in model if no file has that name.
pub fn model_source(file: PathBuf) -> InstanceSource {
    match file.to_str() {
        Some(name) if is_identifier(name) && !file.exists() => {
            InstanceSource::BuiltIn(name.to_owned())
        }
        _ => InstanceSource::Model(file),
    }
}

/// Splits `NAME=FILE` or `FILE`; if a file of the whole name exists, it is the file.
pub fn instance(argument: &OsStr) -> (String, PathBuf) {
    let path = Path::new(argument);
    match split(argument) {
        Some((name, file)) if !path.exists() => (name, file),
        _ => {
            // For `.` and `..`, the name of the folder.
            let full = match path.file_stem() {
                Some(_) => path.to_owned(),
                None => path.canonicalize().unwrap_or_default(),
            };
            (named_after(&full), path.to_owned())
        }
    }
}

/// The name of an instance of a file: no dot is in it, since dots separate instances from variables. `vdp.model.toml` is
/// `vdp`; names of other files, such as those of Modelica's FMUs, are whole.
fn named_after(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    match stem.split_once('.') {
        Some((name, _)) if recognise::is_toml(file) && !name.is_empty() => name.to_owned(),
        _ => stem.replace('.', "_"),
    }
}

/// Splits at the first `=`; file names need not be UTF-8.
#[cfg(unix)]
fn split(argument: &OsStr) -> Option<(String, PathBuf)> {
    use std::os::unix::ffi::OsStrExt;
    let bytes = argument.as_bytes();
    let at = bytes.iter().position(|&byte| byte == b'=')?;
    let name = std::str::from_utf8(&bytes[..at]).ok()?.to_owned();
    Some((name, OsStr::from_bytes(&bytes[at + 1..]).into()))
}

#[cfg(not(unix))]
fn split(argument: &OsStr) -> Option<(String, PathBuf)> {
    let (name, file) = argument.to_str()?.split_once('=')?;
    Some((name.to_owned(), file.into()))
}
