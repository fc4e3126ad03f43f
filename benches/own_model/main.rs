//! Whether the speed of a fit hangs on the profile that a user's workspace has: the same problem with a model
//! of one's own, compiled here and in a crate beside, with cargo's default release profile. On one core:
//!
//! ```text
//! cargo bench --bench own_model
//! ```

mod problem;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the other crate's program does.
const MAIN: &str = r#"mod problem;

fn main() {
    let found = problem::measure();
    println!("{} {} {} {}", found.unknowns, found.iterations, found.milliseconds, found.error);
}
"#;

fn main() -> Result<(), Box<dyn Error>> {
    // One core, and nothing measured while threads begin.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own-model");
    let program = build(&folder)?;
    let here = problem::measure();
    let output = Command::new(program)
        .env("RAYON_NUM_THREADS", "1")
        .output()?;
    let text = String::from_utf8(output.stdout)?;
    let there: Vec<f64> = text
        .split_whitespace()
        .map(str::parse)
        .collect::<Result<_, _>>()?;
    let [unknowns, iterations, milliseconds, error] = there[..] else {
        return Err(format!("the other program says {text:?}").into());
    };
    println!(
        "{:<22} {:>8} {:>10} {:>12} {:>14}",
        "compiled", "unknowns", "iterations", "ms/iteration", "error of θ"
    );
    println!(
        "{:<22} {:>8} {:>10} {:>12.2} {:>14.1e}",
        "here", here.unknowns, here.iterations, here.milliseconds, here.error
    );
    println!(
        "{:<22} {unknowns:>8} {iterations:>10} {milliseconds:>12.2} {error:>14.1e}",
        "with default profile"
    );
    println!("ratio {:.2}", milliseconds / here.milliseconds);
    Ok(())
}

/// A workspace of its own that depends on the crates here, built.
fn build(folder: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::create_dir_all(folder.join("src"))?;
    let dependency = |name: &str| {
        let path = root.join("crates").join(name);
        format!("pilotage-{name} = {{ path = '{}' }}\n", path.display())
    };
    let dependencies: String = ["collocation", "expression", "sqp"]
        .map(dependency)
        .concat();
    let manifest = format!(
        "[workspace]\n[package]\nname = \"own-model\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\
         [dependencies]\n{dependencies}num-dual = \"0.15\"\n"
    );
    std::fs::write(folder.join("Cargo.toml"), manifest)?;
    std::fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock"))?;
    std::fs::write(folder.join("src/main.rs"), MAIN)?;
    std::fs::copy(
        root.join("benches/own_model/problem.rs"),
        folder.join("src/problem.rs"),
    )?;
    let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
    let target = folder.join("target");
    let status = Command::new(cargo)
        .args(["build", "--release", "--quiet", "--target-dir"])
        .arg(&target)
        .current_dir(folder)
        .status()?;
    match status.success() {
        true => Ok(target.join("release/own-model")),
        false => Err("the other crate does not build; the messages above say why".into()),
    }
}
