//! Links the module for old Linux systems, as the command is.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Of the build script of `pilotage`; not set where it made none.
    if let Some(folder) = std::env::var_os("DEP_PILOTAGE_FMU_STAND_INS") {
        println!("cargo::rustc-link-arg-cdylib=-L{}", folder.display());
    }
}
