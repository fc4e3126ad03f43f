// Included by the crate page: the folder of an unpacked FMU, of the library that cargo builds beside the tests.

pub fn decay_fmu() -> std::io::Result<tempfile::TempDir> {
    use pilotage_fmi::platform;
    let folder = tempfile::tempdir()?;
    let binaries = folder.path().join("binaries").join(&platform::folders()[0]);
    std::fs::create_dir_all(&binaries)?;
    std::fs::copy(built(), binaries.join(platform::library_name("decay")))?;
    let description = include_str!("modelDescription.xml");
    std::fs::write(folder.path().join("modelDescription.xml"), description)?;
    Ok(folder)
}

/// Cargo lets tests find the libraries of their profile: `<target>/<profile>` and its `deps`.
fn built() -> std::path::PathBuf {
    use std::env::{consts, split_paths, var_os};
    let name = format!("examples/{}decay{}", consts::DLL_PREFIX, consts::DLL_SUFFIX);
    ["LD_LIBRARY_PATH", "DYLD_FALLBACK_LIBRARY_PATH", "PATH"]
        .iter()
        .filter_map(var_os)
        .flat_map(|paths| split_paths(&paths).collect::<Vec<_>>())
        .flat_map(|folder| [folder.join(&name), folder.join("..").join(&name)])
        .find(|path| path.exists())
        .expect("the example `decay` is not built; run `cargo build -p pilotage-fmi --examples` in this profile")
}
