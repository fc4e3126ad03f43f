//! Errors of the export of FMUs.

use crate::models::ValueError;
use std::path::PathBuf;

/// Why an FMU could not be created.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A crate relies on the SDK's sources, which no longer exist.
    #[error(
        "{} asks for pilotage-sdk, whose sources were in {} when this command was built; give it as pilotage-sdk = {{ path = \"...\" }}, or install pilotage again",
        manifest.display(), sdk.display()
    )]
    NoSdk {
        /// The crate's manifest.
        manifest: PathBuf,
        /// Former path of the sources.
        sdk: PathBuf,
    },
    /// An invalid start value of a variable.
    #[error("the model cannot be exported")]
    Value(#[from] ValueError),
    /// A platform without a name in FMI.
    #[error("there is no platform \"{name}\"; known are {known}")]
    UnknownPlatform {
        /// Name as given.
        name: String,
        /// The known names.
        known: String,
    },
    /// A platform for which this program has no library.
    #[error(
        "this command has no library for {platform}, but for {known}; scripts/platforms.py builds commands that have all, \
         or give a library by --binary"
    )]
    NotEmbedded {
        /// The platform.
        platform: &'static str,
        /// Those that it has.
        known: String,
    },
    /// A library that does not fit its platform.
    #[error(
        "the library for {platform} cannot be used: {found}; build it for that platform with the \
         same sources"
    )]
    WrongBinary {
        /// The platform.
        platform: &'static str,
        /// What is wrong.
        found: String,
    },
    /// Two libraries for one platform.
    #[error("two libraries are given for {path}; give one")]
    TwoBinaries {
        /// The path in the archive.
        path: String,
    },
    /// Equations that C cannot express.
    #[error("the equations of {model} cannot be written as C: {reason}; export without --source")]
    NoSource {
        /// Name of the model.
        model: String,
        /// Why.
        reason: String,
    },
    /// The archive cannot be built.
    #[error("the archive cannot be built at {entry}")]
    Archive {
        /// The entry at which it failed.
        entry: String,
        /// Why.
        source: zip::result::ZipError,
    },
    /// A file cannot be read.
    #[error("{} cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{} cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// cargo could not be started.
    #[error("cargo could not be started; install Rust (rustup.rs), or give the built library")]
    NoCargo(#[source] std::io::Error),
    /// The crate cannot be built.
    #[error("{} cannot be built:\n{messages}", folder.display())]
    Build {
        /// The crate's folder.
        folder: PathBuf,
        /// Messages of cargo.
        messages: String,
    },
    /// The crate builds no library of type `cdylib`.
    #[error(
        "{} makes no shared library; its Cargo.toml needs `crate-type = [\"cdylib\"]` below `[lib]`",
        folder.display()
    )]
    NoLibrary {
        /// The crate's folder.
        folder: PathBuf,
    },
    /// The library does not describe its model.
    #[error("{} does not say what its model is: {reason}", library.display())]
    NoInterface {
        /// The library.
        library: PathBuf,
        /// Why.
        reason: String,
    },
}
