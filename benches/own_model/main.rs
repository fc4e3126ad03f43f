//! Whether the speed of a fit depends on the profile of the user's workspace: the same problem with a user-defined
//! model, compiled here and in a separate crate with cargo's default release profile. On one core:
//!
//! ```text
//! cargo bench --bench own_model
//! ```

mod problem;

use problem::Figures;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Measurements of each besides the first.
const ROUNDS: usize = 3;

/// Main program of the other crate.
const MAIN: &str = r#"mod problem;

fn main() {
    let found = problem::measure();
    println!("{} {} {} {}", found.unknowns, found.iterations, found.milliseconds, found.error);
}
"#;

fn main() -> Result<(), Box<dyn Error>> {
    // One core, and no thread starts during a measurement.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own-model");
    let program = build(&folder)?;
    // Alternating, and the best of each: other load on the machine affects both alike.
    let (mut here, mut there) = (problem::measure(), measured(&program)?);
    for _ in 0..ROUNDS {
        here = fastest(here, problem::measure());
        there = fastest(there, measured(&program)?);
    }
    println!(
        "{:<22} {:>8} {:>10} {:>12} {:>14}",
        "compiled", "unknowns", "iterations", "ms/iteration", "error of θ"
    );
    for (place, found) in [("here", &here), ("with default profile", &there)] {
        let Figures {
            unknowns,
            iterations,
            milliseconds,
            error,
        } = found;
        println!("{place:<22} {unknowns:>8} {iterations:>10} {milliseconds:>12.2} {error:>14.1e}");
    }
    println!("ratio {:.2}", there.milliseconds / here.milliseconds);
    Ok(())
}

fn fastest(a: Figures, b: Figures) -> Figures {
    if b.milliseconds < a.milliseconds {
        b
    } else {
        a
    }
}

/// Results of the other program.
fn measured(program: &Path) -> Result<Figures, Box<dyn Error>> {
    let output = Command::new(program)
        .env("RAYON_NUM_THREADS", "1")
        .output()?;
    let text = String::from_utf8(output.stdout)?;
    let words: Vec<&str> = text.split_whitespace().collect();
    let [unknowns, iterations, milliseconds, error] = words[..] else {
        return Err(format!("the other program says {text:?}").into());
    };
    Ok(Figures {
        unknowns: unknowns.parse()?,
        iterations: iterations.parse()?,
        milliseconds: milliseconds.parse()?,
        error: error.parse()?,
    })
}

/// Builds a separate workspace that depends on the crates here.
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
