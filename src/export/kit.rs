//! Where a user's crate finds the kit.

use super::ExportError;
use std::path::{Path, PathBuf};

/// The kit's sources, as they were when this command was built.
const KIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fmu/kit");

/// A setting of cargo for a crate that asks for the kit by its name and version alone, wherever it is: the kit is
/// in no registry. `None` for one that says where it is, as those in its own workspace do.
///
/// # Errors
/// When the kit's sources are no longer where they were.
pub fn setting(manifest: &Path, workspace: Option<&Path>) -> Result<Option<String>, ExportError> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
    if !is_by_name(manifest) || workspace.is_some_and(|root| same(root, own)) {
        return Ok(None);
    }
    match Path::new(KIT).is_dir() {
        true => {
            let kit = toml::Value::from(KIT);
            Ok(Some(format!("patch.crates-io.pilotage-kit.path={kit}")))
        }
        false => Err(ExportError::NoKit {
            manifest: manifest.to_owned(),
            kit: PathBuf::from(KIT),
        }),
    }
}

/// Whether a manifest names the kit's version, and not where it is.
fn is_by_name(manifest: &Path) -> bool {
    let kit = || {
        let text = std::fs::read_to_string(manifest).ok()?;
        let document: toml::Table = text.parse().ok()?;
        document.get("dependencies")?.get("pilotage-kit").cloned()
    };
    kit().is_some_and(|kit| match kit {
        toml::Value::String(_) => true,
        kit => ["path", "git", "workspace", "registry"]
            .iter()
            .all(|place| kit.get(place).is_none()),
    })
}
