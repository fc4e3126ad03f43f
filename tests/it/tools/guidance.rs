//! Tables and figures of docs/guidance.md are what its experiments find.

use super::python;
use std::process::Command;

/// One seed of the short experiments flies and is fitted again.
#[test]
fn guidance_is_what_its_experiments_find() {
    let output = Command::new(python::interpreter())
        .args(python::compiled_elsewhere())
        .args(["docs/guidance/remake.py", "--quick"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("PILOTAGE", env!("CARGO_BIN_EXE_pilotage"))
        .output()
        .expect("Python can be started");
    assert!(output.status.success(), "{output:?}");
}
