//! Checks of an FMU against the standard: archive, description, files, binaries of all platforms, and behaviour.
//!
//! ```
//! let reading = pilotage_fmi::description::read(b"<fmiModelDescription fmiVersion=\"2.0\"/>").expect("it is XML");
//! let findings = pilotage_fmi_check::validate(&reading);
//! assert!(findings.iter().any(|finding| finding.to_string().contains("modelName")));
//! ```
//!
//! Checks do not stop at the first finding. Checks that run the binary are separate ([`behaviour`]): the caller should
//! run them in a separate process, since a faulty FMU may end it.
//!
//! | module | what it checks |
//! | --- | --- |
//! | `directory` | the zip directory as stored in the file, entry by entry |
//! | `validate` | the description: rules that the schema does not contain |
//! | `layout` | the files: existence, agreement with the description, terminalsAndIcons.xml, buildDescription.xml |
//! | `binaries` | the library of each platform: format, architecture, functions, dependencies |
//! | [`behaviour`] | execution of this machine's binary |
//! | `finding` | a finding about any part of an FMU |

pub mod behaviour;
mod binaries;
mod directory;
mod finding;
mod layout;
mod validate;

pub use finding::{Finding, Rule};
pub use validate::{is_date_and_time, validate};

use pilotage_fmi::archive::{Archive, ArchiveError, DESCRIPTION, Limits, folder};
use pilotage_fmi::description::{self, FmiVersion, ModelDescription, Severity};
use pilotage_text::error_chain::error_chain;
use pilotage_text::file::Input;
use std::io::Read;
use std::path::Path;

/// Results of the static checks.
#[derive(Debug)]
pub struct Checked {
    /// The findings about the archive, then the description, then the other files.
    pub findings: Vec<Finding>,
    /// The description, if it could be read well enough to use the FMU.
    pub description: Option<ModelDescription>,
}

/// Checks an FMU without running any of its code.
///
/// # Errors
/// If the file cannot be opened: this is not a finding about an FMU.
pub fn check(path: &Path) -> Result<Checked, ArchiveError> {
    let mut bytes = Vec::new();
    let file = folder::open(path, Limits::default())?;
    Input::of(file)
        .read_to_end(&mut bytes)
        .map_err(|source| ArchiveError::Open {
            path: path.to_owned(),
            source,
        })?;
    let mut archive = match Archive::open(path, Limits::default()) {
        Err(error @ ArchiveError::Open { .. }) => return Err(error),
        Err(error) => return Ok(unopened(&bytes, error)),
        Ok(archive) => archive,
    };
    let mut checked = described(&mut archive);
    let version = checked.description.as_ref().map(|d| d.fmi_version);
    let mut findings = directory::check(&bytes, version);
    findings.append(&mut checked.findings);
    findings.extend(unreadable_entries(&mut archive, version));
    if let Some(description) = &checked.description {
        findings.extend(layout::check(&mut archive, description));
        findings.extend(binaries::check(&mut archive, description));
    }
    checked.findings = findings;
    Ok(checked)
}

/// The findings about a rejected archive: those of its directory, else the reason for the rejection.
fn unopened(bytes: &[u8], error: ArchiveError) -> Checked {
    let mut findings = directory::check(bytes, None);
    if !findings.iter().any(|f| f.severity == Severity::Error) {
        findings.push(Finding::archive(
            None,
            Rule::Refused {
                why: error_chain(&error),
            },
        ));
    }
    Checked {
        findings,
        description: None,
    }
}

/// The findings about the description only.
fn described(archive: &mut Archive) -> Checked {
    let refused = |why: String| Checked {
        findings: vec![Finding::file(None, DESCRIPTION, Rule::Refused { why })],
        description: None,
    };
    let bytes = match archive.read(DESCRIPTION) {
        Ok(bytes) => bytes,
        Err(error) => return refused(error_chain(&error)),
    };
    match description::read(&bytes) {
        Err(error) => refused(error_chain(&error)),
        Ok(reading) => Checked {
            findings: (validate(&reading).iter())
                .map(|f| Finding::description(reading.description.fmi_version, f))
                .collect(),
            description: reading.into_usable().ok(),
        },
    }
}

/// Entries that cannot be unpacked: damaged, encrypted, or compressed by a method that FMI does not allow.
fn unreadable_entries(archive: &mut Archive, version: Option<FmiVersion>) -> Vec<Finding> {
    let refused = |(name, error): (String, ArchiveError)| {
        let why = error_chain(&error);
        Finding::file(version, &name, Rule::Refused { why })
    };
    archive.damaged().into_iter().map(refused).collect()
}
