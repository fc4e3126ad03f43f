//! Path of the SDK for a user's crate.

use super::ExportError;
use std::path::{Path, PathBuf};

/// The SDK's sources at the time this command was built.
const SDK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fmu/sdk");

/// A setting of cargo with the path of the SDK, for crates that refer to it by name and version only, since the SDK is
/// in no registry. `None` for crates that specify a path, such as those in its own workspace.
///
/// # Errors
/// If the SDK's sources are no longer there.
pub fn setting(manifest: &Path, workspace: Option<&Path>) -> Result<Option<String>, ExportError> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
    if !is_by_name(manifest) || workspace.is_some_and(|root| same(root, own)) {
        return Ok(None);
    }
    match Path::new(SDK).is_dir() {
        true => {
            let sdk = toml::Value::from(SDK);
            Ok(Some(format!("patch.crates-io.pilotage-sdk.path={sdk}")))
        }
        false => Err(ExportError::NoSdk {
            manifest: manifest.to_owned(),
            sdk: PathBuf::from(SDK),
        }),
    }
}

/// Whether a manifest refers to the SDK by version only.
fn is_by_name(manifest: &Path) -> bool {
    let sdk = || {
        let text = pilotage_text::file::peek(manifest).ok()?;
        let document: toml::Table = text.parse().ok()?;
        document.get("dependencies")?.get("pilotage-sdk").cloned()
    };
    sdk().is_some_and(|sdk| match sdk {
        toml::Value::String(_) => true,
        sdk => ["path", "git", "workspace", "registry"]
            .iter()
            .all(|place| sdk.get(place).is_none()),
    })
}
