//! An FMU as a whole: opened, looked into, loaded, instantiated.

use super::archive::{Archive, ArchiveError, DESCRIPTION, Limits};
use super::binary::{self, BinaryError};
use super::binding::{Binding, BindingError};
use super::description::{self, ModelDescription, ReadError};
use super::instance::{CallError, Instance, Loaded};
use super::platform;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Why an FMU cannot be used.
#[derive(Debug, Error)]
pub enum FmuError {
    /// The archive is bad.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The description is bad.
    #[error("{}", path.display())]
    Description {
        /// The FMU.
        path: PathBuf,
        /// Why.
        source: ReadError,
    },
    /// It is for Model Exchange only.
    #[error("{} is an FMU for Model Exchange only; co-simulation needs <CoSimulation>", path.display())]
    NotCoSimulation {
        /// The FMU.
        path: PathBuf,
    },
    /// No binary for this machine.
    #[error("{} has no binary for this machine (looked in {}); it has {}", path.display(), wanted.join(", "), all_of(present))]
    NoPlatform {
        /// The FMU.
        path: PathBuf,
        /// Folders under `binaries/` that would do.
        wanted: Vec<String>,
        /// Folders that are there.
        present: Vec<String>,
    },
    /// The folder is there, but not the file that the modelIdentifier names.
    #[error("{} has no `{expected}`, which modelIdentifier=\"{identifier}\" names; beside it are {}", path.display(), all_of(found))]
    NoLibrary {
        /// The FMU.
        path: PathBuf,
        /// Name of the file that should be there.
        expected: String,
        /// The modelIdentifier.
        identifier: String,
        /// What is there.
        found: Vec<String>,
    },
    /// The binary is damaged or for another machine.
    #[error("{}: `{entry}` cannot be loaded", path.display())]
    Binary {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// Why.
        source: BinaryError,
    },
    /// The unpacked binary cannot be read.
    #[error("{}: `{entry}` cannot be read", path.display())]
    Read {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// Why.
        source: io::Error,
    },
    /// The binary is not what the standard asks for.
    #[error("{}: `{entry}` cannot be used", path.display())]
    Binding {
        /// The FMU.
        path: PathBuf,
        /// Name of the binary in the archive.
        entry: String,
        /// Why.
        source: BindingError,
    },
    /// It does not instantiate.
    #[error("{}", path.display())]
    Instantiate {
        /// The FMU.
        path: PathBuf,
        /// Why.
        source: CallError,
    },
}

fn all_of(names: &[String]) -> String {
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join(", "),
    }
}

/// An FMU: its archive, checked, and its description.
#[derive(Debug)]
pub struct Fmu {
    archive: Archive,
    description: Arc<ModelDescription>,
}

impl Fmu {
    /// Opens an FMU and reads its description; nothing is unpacked.
    ///
    /// # Errors
    /// If the archive or the description is bad.
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

    /// Folders under `binaries/`.
    pub fn platforms(&self) -> Vec<String> {
        let present = platform::present(self.archive.files());
        present.into_iter().map(str::to_owned).collect()
    }

    /// Unpacks the FMU, looks into its binary and loads it. Each call loads a copy of its own.
    ///
    /// # Errors
    /// If there is no binary for this machine, or it is damaged, or not what the standard asks for.
    pub fn load(&mut self) -> Result<Library, FmuError> {
        let entry = self.find_library()?;
        let folder = self.archive.unpack()?;
        let library = folder.path().join(&entry);
        let path = || self.path().to_owned();
        let bytes = fs::read(&library).map_err(|source| FmuError::Read {
            path: path(),
            entry: entry.clone(),
            source,
        })?;
        binary::check(&bytes).map_err(|source| FmuError::Binary {
            path: path(),
            entry: entry.clone(),
            source,
        })?;
        // SAFETY: whoever asks to load an FMU trusts its code; the file's structure was checked.
        let binding = unsafe { Binding::load(&library) };
        let binding = binding.map_err(|source| FmuError::Binding {
            path: path(),
            entry,
            source,
        })?;
        Ok(Library {
            path: path(),
            loaded: Arc::new(Loaded { binding, folder }),
            description: self.description.clone(),
        })
    }

    /// Name of the binary for this machine in the archive.
    fn find_library(&self) -> Result<String, FmuError> {
        let path = || self.path().to_owned();
        let Some(cs) = &self.description.co_simulation else {
            return Err(FmuError::NotCoSimulation { path: path() });
        };
        let present = self.platforms();
        let wanted = platform::folders();
        let Some(folder) = wanted.iter().find(|folder| present.contains(folder)) else {
            return Err(FmuError::NoPlatform {
                path: path(),
                wanted,
                present,
            });
        };
        let name = platform::library_name(&cs.model_identifier);
        let entry = format!("binaries/{folder}/{name}");
        if self.archive.files().any(|file| file == entry) {
            return Ok(entry);
        }
        let prefix = format!("binaries/{folder}/");
        let beside = self.archive.files().filter_map(|f| f.strip_prefix(&prefix));
        Err(FmuError::NoLibrary {
            path: path(),
            expected: entry,
            identifier: cs.model_identifier.clone(),
            found: beside.map(str::to_owned).collect(),
        })
    }
}

/// An FMU's binary, loaded. Its instances keep it loaded.
#[derive(Debug, Clone)]
pub struct Library {
    path: PathBuf,
    loaded: Arc<Loaded>,
    description: Arc<ModelDescription>,
}

impl Library {
    /// Makes an instance for co-simulation.
    ///
    /// # Errors
    /// If the FMU refuses.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        let instance = Instance::new(self.loaded.clone(), &self.description, name);
        instance.map_err(|source| FmuError::Instantiate {
            path: self.path.clone(),
            source,
        })
    }

    /// Whether the FMU makes an instance though the GUID is another one, which it should refuse.
    pub fn accepts_wrong_guid(&self) -> bool {
        let mut other = ModelDescription::clone(&self.description);
        other.guid.push('!');
        Instance::new(self.loaded.clone(), &other, "wrong guid").is_ok()
    }

    /// The description.
    pub fn description(&self) -> &Arc<ModelDescription> {
        &self.description
    }

    /// The loaded library.
    pub fn binding(&self) -> &Binding {
        &self.loaded.binding
    }
}
