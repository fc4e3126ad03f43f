//! Output folders of commands.

use super::Failure;
use std::path::Path;

/// Creates an output folder; an existing one must be empty unless `force` is set.
pub fn create_new(folder: &Path, force: bool) -> Result<(), Failure> {
    let shown = folder.display();
    let failed = |error| Failure::new(format!("cannot create the folder {shown}: {error}"));
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::new(format!(
            "{shown} is a file; expected a folder to fill"
        )));
    }
    std::fs::create_dir_all(folder).map_err(failed)?;
    let used = std::fs::read_dir(folder).map_err(failed)?.next().is_some();
    match used && !force {
        true => Err(Failure::new(format!("the folder {shown} is not empty"))
            .hint("name another folder with -o, or overwrite with --force")),
        false => Ok(()),
    }
}
