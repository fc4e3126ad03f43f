//! An FMU as a whole: opened, checked, loaded, instantiated.

use super::archive::{Archive, ArchiveError, DESCRIPTION, Limits, Unpacked};
use super::binary::{self, BinaryError};
use super::binding::{Binding, BindingError, Loaded};
use super::description::FmiVersion;
use super::description::{self, ModelDescription, ReadError};
use super::instance::{CallError, Instance, InstanceOptions};
use super::platform;
use super::sources;
use super::version::InterfaceType;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Why an FMU cannot be used.
#[derive(Debug, Error)]
pub enum FmuError {
    /// The archive is invalid.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The description is invalid.
    #[error("{}", path.display())]
    Description {
        /// The FMU.
        path: PathBuf,
        /// The cause.
        source: ReadError,
    },
    /// It supports neither co-simulation nor model exchange nor scheduled execution.
    #[error("{} has neither <CoSimulation> nor <ModelExchange> nor <ScheduledExecution>", path.display())]
    NoKind {
        /// The FMU.
        path: PathBuf,
    },
    /// It does not support this kind of instance.
    #[error("{} is no FMU for {kind}: it has no <{}>", path.display(), kind.element())]
    OtherKind {
        /// The FMU.
        path: PathBuf,
        /// The requested kind.
        kind: InterfaceType,
    },
    /// It has no binary for this machine.
    #[error("{} has no binary for this machine (looked in {}); it has {}{}", path.display(), wanted.join(", "), all_of(present), if *has_sources { "; it has sources, of which `pilotage compile` makes one" } else { "" })]
    NoPlatform {
        /// The FMU.
        path: PathBuf,
        /// Folders under `binaries/` that would be suitable.
        wanted: Vec<String>,
        /// Folders that exist.
        present: Vec<String>,
        /// Whether it has sources.
        has_sources: bool,
    },
    /// The folder exists, but not the file named by the modelIdentifier.
    #[error("{} has no `{expected}`, which modelIdentifier=\"{identifier}\" names; beside it are {}", path.display(), all_of(found))]
    NoLibrary {
        /// The FMU.
        path: PathBuf,
        /// Name of the missing file.
        expected: String,
        /// The modelIdentifier.
        identifier: String,
        /// Files in the folder.
        found: Vec<String>,
    },
    /// The binary is damaged or for another machine.
    #[error("{}: `{entry}` cannot be loaded", path.display())]
    Binary {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// The cause.
        source: BinaryError,
    },
    /// The unpacked binary cannot be read.
    #[error("{}: `{entry}` cannot be read", path.display())]
    Read {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// The cause.
        source: io::Error,
    },
    /// The binary does not conform to the standard.
    #[error("{}: `{entry}` cannot be used", path.display())]
    Binding {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// The cause.
        source: BindingError,
    },
    /// It cannot be instantiated.
    #[error("{}", path.display())]
    Instantiate {
        /// The FMU.
        path: PathBuf,
        /// The cause.
        source: CallError,
    },
}

fn all_of(names: &[String]) -> String {
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join(", "),
    }
}

/// An FMU: its checked archive and its description.
#[derive(Debug)]
pub struct Fmu {
    archive: Archive,
    description: Arc<ModelDescription>,
}

impl Fmu {
    /// Opens an FMU and reads its description, without unpacking.
    ///
    /// # Errors
    /// If the archive or the description is invalid.
    pub fn open(path: &Path) -> Result<Self, FmuError> {
        let mut archive = Archive::open(path, Limits::default())?;
        let bytes = archive.read(DESCRIPTION)?;
        let description = description::read(&bytes).and_then(description::Reading::into_usable);
        let description = description.map_err(|source| FmuError::Description {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            archive,
            description: Arc::new(description),
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.archive.path()
    }

    /// The description.
    pub fn description(&self) -> &Arc<ModelDescription> {
        &self.description
    }

    /// Names of all files in the archive.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.archive.files()
    }

    /// Content of a file in the archive.
    ///
    /// # Errors
    /// If there is none, or it is damaged.
    pub fn read(&mut self, name: &str) -> Result<Vec<u8>, FmuError> {
        Ok(self.archive.read(name)?)
    }

    /// Whether it has sources in C.
    pub fn has_sources(&self) -> bool {
        has_sources(self.archive.files())
    }

    /// Number of files and folders in the archive.
    pub fn entries(&self) -> usize {
        self.archive.entries()
    }

    /// Folders under `binaries/`.
    pub fn platforms(&self) -> Vec<String> {
        let present = platform::present(self.archive.files());
        present.into_iter().map(str::to_owned).collect()
    }

    /// The FMI version of the description.
    pub fn version(&self) -> FmiVersion {
        self.description.fmi_version
    }

    /// The supported kinds, each with its modelIdentifier.
    pub fn kinds(&self) -> Vec<(InterfaceType, &str)> {
        kinds(&self.description)
    }

    /// Unpacks the FMU, checks its binaries (usually one for all kinds) and loads them. Each call loads separate
    /// copies.
    ///
    /// # Foreign code
    /// The initialization of its libraries runs; see the [crate's page](crate#foreign-code).
    ///
    /// # Errors
    /// If there is no binary for this machine, or it is damaged or does not conform to the standard.
    pub fn load(&mut self) -> Result<Library, FmuError> {
        self.load_from(None)
    }

    /// Unpacks the FMU into a temporary folder.
    ///
    /// # Errors
    /// If an entry is damaged, or the folder cannot be written.
    pub fn unpack(&mut self) -> Result<Unpacked, FmuError> {
        Ok(self.archive.unpack()?)
    }

    /// As [`load`](Self::load), from a folder into which it is already unpacked, if given.
    ///
    /// # Foreign code
    /// As [`load`](Self::load).
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_from(&mut self, unpacked: Option<Unpacked>) -> Result<Library, FmuError> {
        let path = self.path().to_owned();
        let files: Vec<&str> = self.archive.files().collect();
        let groups = libraries(&path, &self.description, &files)?;
        let folder = match unpacked {
            Some(folder) => folder,
            None => self.archive.unpack()?,
        };
        Library::loaded(path, self.description.clone(), groups, folder)
    }
}

/// Whether there are sources in C among the files of an FMU.
fn has_sources<'a>(mut files: impl Iterator<Item = &'a str>) -> bool {
    files.any(|file| file.starts_with(sources::FOLDER) && file.to_ascii_lowercase().ends_with(".c"))
}

/// The interface types that a description has, each with its modelIdentifier.
fn kinds(description: &ModelDescription) -> Vec<(InterfaceType, &str)> {
    let cs = description.co_simulation.as_ref();
    let me = description.model_exchange.as_ref();
    let se = description.scheduled_execution.as_ref();
    let cs = cs.map(|cs| (InterfaceType::CoSimulation, cs.model_identifier.as_str()));
    let me = me.map(|me| (InterfaceType::ModelExchange, me.model_identifier.as_str()));
    let se = se.map(|se| {
        (
            InterfaceType::ScheduledExecution,
            se.model_identifier.as_str(),
        )
    });
    cs.into_iter().chain(me).chain(se).collect()
}

/// Names of this machine's binaries among the files of an FMU, each with the kinds that it supports.
fn libraries(
    path: &Path,
    description: &ModelDescription,
    files: &[&str],
) -> Result<Vec<(String, Vec<InterfaceType>)>, FmuError> {
    let mut groups: Vec<(String, Vec<InterfaceType>)> = Vec::new();
    for (kind, identifier) in kinds(description) {
        match groups.iter_mut().find(|(name, _)| name == identifier) {
            Some((_, kinds)) => kinds.push(kind),
            None => groups.push((identifier.to_owned(), vec![kind])),
        }
    }
    let found = groups.into_iter();
    let found = found.map(|(name, kinds)| Ok((find_library(path, &name, files)?, kinds)));
    found.collect()
}

/// Name of this machine's binary among the files.
fn find_library(path: &Path, identifier: &str, files: &[&str]) -> Result<String, FmuError> {
    let present = platform::present(files.iter().copied());
    let wanted = platform::folders();
    let Some(folder) = (wanted.iter()).find(|folder| present.contains(&folder.as_str())) else {
        return Err(FmuError::NoPlatform {
            path: path.to_owned(),
            present: present.into_iter().map(str::to_owned).collect(),
            wanted,
            has_sources: has_sources(files.iter().copied()),
        });
    };
    let name = platform::library_name(identifier);
    let entry = format!("binaries/{folder}/{name}");
    if files.contains(&entry.as_str()) {
        return Ok(entry);
    }
    let prefix = format!("binaries/{folder}/");
    let beside = files.iter().filter_map(|f| f.strip_prefix(&prefix));
    Err(FmuError::NoLibrary {
        path: path.to_owned(),
        expected: entry,
        identifier: identifier.to_owned(),
        found: beside.map(str::to_owned).collect(),
    })
}

/// Checks an unpacked binary and loads it.
fn bind(
    path: &Path,
    folder: &Unpacked,
    entry: String,
    version: FmiVersion,
    kinds: &[InterfaceType],
) -> Result<Binding, FmuError> {
    let library = folder.path().join(&entry);
    let bytes = fs::read(&library).map_err(|source| FmuError::Read {
        path: path.to_owned(),
        entry: entry.clone(),
        source,
    })?;
    binary::check(&bytes).map_err(|source| FmuError::Binary {
        path: path.to_owned(),
        entry: entry.clone(),
        source,
    })?;
    // SAFETY: the caller who loads an FMU trusts its code; the structure of the file was checked.
    let binding = unsafe { Binding::load(path, &library, version, kinds) };
    binding.map_err(|source| FmuError::Binding {
        path: path.to_owned(),
        entry,
        source,
    })
}

/// The loaded binaries of an FMU. Instances keep them loaded.
///
/// # Foreign code
/// All that makes instances calls the FMU, and so does the drop: see the [crate's page](crate#foreign-code).
#[derive(Debug, Clone)]
pub struct Library {
    path: PathBuf,
    /// Each binary, with the kinds that it supports; never empty.
    loaded: Vec<(Vec<InterfaceType>, Arc<Loaded>)>,
    description: Arc<ModelDescription>,
}

impl Library {
    /// Loads an FMU that lies unpacked in a folder, which stays as it is and must outlive the library. Nothing but its
    /// description and this machine's binaries is read.
    ///
    /// # Foreign code
    /// As [`Fmu::load`].
    ///
    /// # Errors
    /// As [`Fmu::open`] and [`Fmu::load`].
    pub fn in_folder(path: &Path) -> Result<Self, FmuError> {
        let unreadable = |source| FmuError::Read {
            path: path.to_owned(),
            entry: DESCRIPTION.to_owned(),
            source,
        };
        let bytes = fs::read(path.join(DESCRIPTION)).map_err(unreadable)?;
        let description = description::read(&bytes).and_then(description::Reading::into_usable);
        let description = description.map_err(|source| FmuError::Description {
            path: path.to_owned(),
            source,
        })?;
        let mut files = Vec::new();
        for folder in platform::folders() {
            let found = fs::read_dir(path.join("binaries").join(&folder));
            let found = found.into_iter().flatten().flatten();
            let names = found.filter_map(|own| own.file_name().into_string().ok());
            files.extend(names.map(|name| format!("binaries/{folder}/{name}")));
        }
        let files: Vec<&str> = files.iter().map(String::as_str).collect();
        let groups = libraries(path, &description, &files)?;
        let folder = Unpacked::of_others(path.to_owned());
        Self::loaded(path.to_owned(), Arc::new(description), groups, folder)
    }

    /// Checks and loads the binaries in a folder.
    fn loaded(
        path: PathBuf,
        description: Arc<ModelDescription>,
        groups: Vec<(String, Vec<InterfaceType>)>,
        folder: Unpacked,
    ) -> Result<Self, FmuError> {
        let folder = Arc::new(folder);
        let mut loaded = Vec::new();
        for (entry, kinds) in groups {
            let binding = bind(&path, &folder, entry, description.fmi_version, &kinds)?;
            let loaded_one = Loaded {
                binding,
                folder: folder.clone(),
                fmu: path.clone(),
            };
            loaded.push((kinds, Arc::new(loaded_one)));
        }
        match loaded.is_empty() {
            true => Err(FmuError::NoKind { path }),
            false => Ok(Self {
                path,
                loaded,
                description,
            }),
        }
    }

    /// Creates an instance of a kind, without window, event mode or early return.
    ///
    /// # Errors
    /// If the FMU does not support this kind, or refuses.
    pub fn instantiate(&self, name: &str, kind: InterfaceType) -> Result<Instance, FmuError> {
        self.instantiate_with(name, kind, InstanceOptions::default())
    }

    /// Creates an instance of a kind.
    ///
    /// # Errors
    /// If the FMU does not support this kind, or refuses.
    pub fn instantiate_with(
        &self,
        name: &str,
        kind: InterfaceType,
        options: InstanceOptions,
    ) -> Result<Instance, FmuError> {
        let path = || self.path.clone();
        let loaded = self
            .of(kind)
            .ok_or_else(|| FmuError::OtherKind { path: path(), kind })?;
        let instance = Instance::new(loaded.clone(), &self.description, name, kind, options);
        instance.map_err(|source| FmuError::Instantiate {
            path: path(),
            source,
        })
    }

    /// Whether the FMU creates an instance although the GUID (instantiation token) is wrong, which it should refuse.
    pub fn accepts_wrong_guid(&self, kind: InterfaceType) -> bool {
        let mut other = ModelDescription::clone(&self.description);
        other.guid.push('!');
        self.of(kind).is_some_and(|loaded| {
            let options = InstanceOptions::default();
            Instance::new(loaded.clone(), &other, "wrong guid", kind, options).is_ok()
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The description.
    pub fn description(&self) -> &Arc<ModelDescription> {
        &self.description
    }

    /// The loaded binaries: one, unless kinds have different modelIdentifiers.
    pub fn bindings(&self) -> impl Iterator<Item = &Binding> {
        self.loaded.iter().map(|(_, loaded)| &loaded.binding)
    }

    fn of(&self, kind: InterfaceType) -> Option<&Arc<Loaded>> {
        let found = self.loaded.iter().find(|(kinds, _)| kinds.contains(&kind));
        found.map(|(_, loaded)| loaded)
    }
}
