//! FMUs of user-written models: crates or libraries that use `pilotage_sdk::export!`.

use super::package::{BLOCK, Contents, archive};
use super::{
    ExportError, Platform, Provenance, documentation, interface, old_glibc, platform, sdk, write,
};
use crate::fmi::description::FmiVersion;
use libloading::Library;
use pilotage_sdk::Interface;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The function that `pilotage_sdk::export!` adds to the functions of FMI.
const INTERFACE: &CStr = c"pilotageInterface";
/// Time within which a model answers.
const PATIENCE: Duration = Duration::from_secs(20);

/// Builds the crate in a folder and returns its library and its licence.
///
/// The release profile is changed as required for an FMU: panics unwind, since they become a status; symbols are
/// stripped, and folders of this machine are not included. With `show`, cargo's output goes directly to stderr,
/// otherwise into the error.
///
/// # Foreign code
/// The crate's build scripts and macros run, with the rights of this process.
///
/// # Errors
/// If cargo is missing, or the crate cannot be built or builds no library of type `cdylib`.
pub fn build(folder: &Path, show: bool) -> Result<(PathBuf, Option<String>), ExportError> {
    let read = |source| ExportError::Read {
        path: folder.join("Cargo.toml"),
        source,
    };
    let manifest = std::fs::canonicalize(folder.join("Cargo.toml")).map_err(read)?;
    let [workspace, target] = folders(&manifest);
    let sdk = sdk::setting(&manifest, workspace.as_deref())?;
    let mut build = cargo();
    build
        .args(["build", "--release"])
        .args(["--message-format", "json-render-diagnostics"])
        .args(["--config", "profile.release.panic=\"unwind\""])
        .args(["--config", "profile.release.strip=\"symbols\""])
        .args(["--config", "profile.release.lto=\"fat\""])
        .args(["--config", "profile.release.codegen-units=1"])
        .args(["--config", &flags(workspace, target)])
        .args(sdk.iter().flat_map(|setting| ["--config", setting]));
    if old_glibc::IS_HERE {
        // With an explicit target, the flags do not apply to build scripts.
        build.args(["--target", old_glibc::TARGET]);
    }
    let output = build
        .arg("--manifest-path")
        .arg(&manifest)
        .stderr(match show {
            true => Stdio::inherit(),
            false => Stdio::piped(),
        })
        .output()
        .map_err(ExportError::NoCargo)?;
    if !output.status.success() {
        return Err(ExportError::Build {
            folder: folder.to_owned(),
            messages: String::from_utf8_lossy(&output.stderr).into_owned(),
        });
    }
    let built = String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .find_map(|message| library(&message, &manifest));
    match built {
        Some(library) => Ok((library, license(&manifest))),
        None => Err(ExportError::NoLibrary {
            folder: folder.to_owned(),
        }),
    }
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Flags of rustc as a setting of cargo: panic messages contain neither the workspace's folder nor cargo's, and the
/// library runs on old systems if possible. Flags in the environment variable RUSTFLAGS replace them.
fn flags(workspace: Option<PathBuf>, target: Option<PathBuf>) -> String {
    let home = std::env::home_dir().map(|home| home.join(".cargo"));
    let cargo = std::env::var_os("CARGO_HOME").map(PathBuf::from).or(home);
    let renamed = [(cargo, "cargo"), (workspace, "model")]
        .into_iter()
        .filter_map(|(folder, name)| {
            Some(format!("--remap-path-prefix={}={name}", folder?.display()))
        });
    // The folder is kept, so that the flags do not change and cargo need not rebuild everything.
    let for_old_systems = target
        .filter(|_| old_glibc::IS_HERE)
        .and_then(|folder| old_glibc::stand_ins(&folder).ok())
        .map(|folder| format!("-Lnative={}", folder.display()));
    let flags: Vec<String> = renamed
        .chain(for_old_systems)
        .map(|flag| toml::Value::String(flag).to_string())
        .collect();
    format!("build.rustflags=[{}]", flags.join(", "))
}

/// The folder of a crate's workspace, and its target folder.
fn folders(manifest: &Path) -> [Option<PathBuf>; 2] {
    let metadata = cargo()
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .arg("--manifest-path")
        .arg(manifest)
        .output()
        .ok()
        .and_then(|output| serde_json::from_slice::<Value>(&output.stdout).ok())
        .unwrap_or_default();
    ["workspace_root", "target_directory"].map(|key| metadata[key].as_str().map(PathBuf::from))
}

/// The shared library in a message of cargo, if it belongs to this crate.
fn library(message: &Value, manifest: &Path) -> Option<PathBuf> {
    let is_ours = Path::new(message["manifest_path"].as_str()?) == manifest;
    let kinds = message["target"]["crate_types"].as_array()?;
    if !is_ours || !kinds.iter().any(|kind| kind == "cdylib") {
        return None;
    }
    let extension = std::env::consts::DLL_EXTENSION;
    let files = message["filenames"].as_array()?.iter();
    files
        .filter_map(|file| file.as_str().map(PathBuf::from))
        .find(|file| file.extension().is_some_and(|e| e == extension))
}

/// The licence in the manifest, if it is given there directly.
fn license(manifest: &Path) -> Option<String> {
    let text = pilotage_text::file::peek(manifest).ok()?;
    let document: toml::Table = text.parse().ok()?;
    let license = document.get("package")?.get("license")?;
    license.as_str().map(str::to_owned)
}

/// Reads the interface of a model from a library for this platform.
///
/// This is for the user's own libraries. They are checked first, and have some seconds to answer.
///
/// # Foreign code
/// The library's code runs in this process, with its rights.
///
/// # Errors
/// If it is no library of an FMU of that version for this platform, or provides no interface.
pub fn ask(library: &Path, bytes: &[u8], version: FmiVersion) -> Result<Interface, ExportError> {
    let refuse = |reason: String| ExportError::NoInterface {
        library: library.to_owned(),
        reason,
    };
    let host = Platform::host().ok_or_else(|| refuse("this platform is not known".into()))?;
    platform::check(&host, bytes, version)?;
    // A bare file name would be searched among the system's libraries.
    let path = std::fs::canonicalize(library).map_err(|error| refuse(error.to_string()))?;
    let (answer, answered) = std::sync::mpsc::channel();
    // Its model may not return, and then neither does the thread.
    let asked = std::thread::Builder::new().spawn(move || answer.send(described(&path)));
    asked.map_err(|error| refuse(error.to_string()))?;
    let text = match answered.recv_timeout(PATIENCE) {
        Ok(text) => text.map_err(refuse)?,
        Err(_) => {
            let seconds = PATIENCE.as_secs();
            return Err(refuse(format!(
                "its model does not return within {seconds} s where it is asked for its start values: does a loop not end?"
            )));
        }
    };
    interface::read(&text).map_err(refuse)
}

/// What the library says of its model, or why it does not.
fn described(path: &Path) -> Result<String, String> {
    // SAFETY: a library made with `export!` initialises nothing when it is loaded; the user requested it.
    let loaded = unsafe { Library::new(path) }.map_err(|error| {
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        cause.unwrap_or_else(|| error.to_string())
    })?;
    // SAFETY: `export!` defines the function of that name with this type.
    let function = unsafe { loaded.get::<unsafe extern "C" fn() -> *const c_char>(INTERFACE) };
    let function = function.map_err(|_| {
        "it was not made by pilotage_sdk::export!, or reads its model from resources".to_owned()
    })?;
    // SAFETY: it takes no arguments and returns a C string that lives as long as the library.
    let text = unsafe { CStr::from_ptr(function()) };
    Ok(text.to_string_lossy().into_owned())
}

/// Writes the FMU of a user's library to the path that `path` returns for its interface; `path` may also refuse.
///
/// # Foreign code
/// As [`ask`].
///
/// # Errors
/// If the library cannot be used or has no interface, another library does not fit its platform, or the file cannot be
/// written; also the errors of `path`.
pub fn pack<E: From<ExportError>>(
    library: &Path,
    provenance: &Provenance,
    options: &super::ExportOptions,
    path: impl FnOnce(&Interface) -> Result<PathBuf, E>,
) -> Result<PathBuf, E> {
    let bytes = pilotage_text::file::bytes(library).map_err(|source| ExportError::Read {
        path: library.to_owned(),
        source,
    })?;
    let interface = ask(library, &bytes, options.version)?;
    let path = path(&interface)?;
    let own = Platform::host().map(|platform| (platform, bytes));
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    let archive = archive(&Contents {
        name: stem.as_deref().unwrap_or(&interface.name),
        interface: &interface,
        provenance,
        version: options.version,
        binaries: options.binaries.iter().cloned().chain(own).collect(),
        about: documentation::written(""),
        picture: BLOCK,
        resources: BTreeMap::new(),
        sources: BTreeMap::new(),
    })?;
    write(&path, &archive)?;
    Ok(path)
}
