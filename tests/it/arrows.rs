//! Who may know whom inside the library: the arrows of README.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// For each module of `src/` (a file's arrows may be wider than its folder's: `cosim/fmu_slave`), the
/// modules and workspace crates that it may name. `abi` and `models` are those crates. The small
/// modules at the end know nothing of ours and may be used by all above the line.
const ARROWS: &[(&str, &[&str])] = &[
    ("series", &[]),
    ("sqp", &[]),
    ("transcription", &["models", "sqp"]),
    ("vehicle", &["models", "linear", "document"]),
    ("synthetic", &["models", "series"]),
    (
        "identification",
        &[
            "models",
            "series",
            "transcription",
            "sqp",
            "vehicle",
            "linear",
            "document",
            "nearest",
            "output",
        ],
    ),
    ("integrate", &["kit"]),
    ("fmi", &["abi", "nearest", "integrate", "causes"]),
    ("export", &["abi", "kit", "models", "fmi", "output"]),
    ("linear", &[]),
    ("cosim", &["series", "linear", "nearest"]),
    ("cosim/fmu_slave", &["series", "linear", "fmi", "nearest"]),
    (
        "cosim/native_slave",
        &["series", "linear", "models", "nearest"],
    ),
    (
        "report",
        &[
            "series",
            "models",
            "vehicle",
            "identification",
            "cosim",
            "linear",
        ],
    ),
    ("document", &["nearest"]),
    ("date", &[]),
    ("nearest", &[]),
    ("causes", &[]),
    ("output", &[]),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|extension| extension == "rs") => {
                found.push(path)
            }
            false => {}
        }
    }
}

/// The code of a source file: without comments, and without its unit tests (they may use anything).
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]").next().unwrap();
    (text.lines())
        .filter(|line| !line.trim_start().starts_with("//"))
        .map(|line| format!("{line}\n"))
        .collect()
}

/// The items of a `use` list up to its closing brace, without what stands in inner braces.
fn top_level(list: &str) -> Vec<String> {
    let mut items = vec![String::new()];
    let mut depth = 0;
    for c in list.chars() {
        match c {
            '}' if depth == 0 => break,
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => items.push(String::new()),
            _ if depth == 0 => items.last_mut().unwrap().push(c),
            _ => {}
        }
    }
    items
}

/// The modules and workspace crates that a file's code names: `crate::x`, `pilotage_x`, and the nested
/// `use crate::{x, y}`.
fn named(code: &str) -> BTreeSet<String> {
    let word = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
            .collect()
    };
    let mut found = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            None => found.extend([word(rest)]),
            Some(list) => found.extend(top_level(list).iter().map(|item| word(item.trim()))),
        }
    }
    for rest in code.split("pilotage_").skip(1) {
        found.insert(word(rest));
    }
    found.remove("");
    found
}

#[test]
fn modules_name_only_whom_they_may_know() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut wrong = Vec::new();
    for file in &files {
        let relative = file.strip_prefix(&root).unwrap().with_extension("");
        let relative = relative.to_str().unwrap().replace('\\', "/");
        let module = relative.split('/').next().unwrap();
        if ["lib", "main", "cli"].contains(&module) {
            continue;
        }
        let allowed = ARROWS
            .iter()
            .find(|(name, _)| relative.starts_with(&format!("{name}/")) && name.contains('/'))
            .or_else(|| ARROWS.iter().find(|(name, _)| *name == relative))
            .or_else(|| ARROWS.iter().find(|(name, _)| *name == module));
        let Some((_, allowed)) = allowed else {
            wrong.push(format!("{relative}: not in the list of arrows"));
            continue;
        };
        for name in named(&code(file)) {
            if name != module && !allowed.contains(&name.as_str()) {
                wrong.push(format!("{relative} names {name}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn only_the_command_line_knows_clap_and_the_terminal() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files
        .iter()
        .filter(|file| !file.starts_with(root.join("cli")))
    {
        let code = code(file);
        for word in [
            "clap::",
            "println!",
            "eprintln!",
            "print!(",
            "io::stdout",
            "io::stderr",
            "dbg!",
        ] {
            assert!(!code.contains(word), "{} uses {word}", file.display());
        }
        if file != &root.join("main.rs") {
            assert!(
                !code.contains("crate::cli") && !code.contains("pilotage::cli"),
                "{}",
                file.display()
            );
        }
    }
}

#[test]
fn the_fmu_drags_in_no_toolkit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let toolkit = [
        "clap",
        "zip",
        "csv",
        "toml",
        "clarabel",
        "pilotage =",
        "pilotage.workspace",
    ];
    for manifest in [
        "fmu/Cargo.toml",
        "fmu/abi/Cargo.toml",
        "fmu/kit/Cargo.toml",
        "fmu/models/Cargo.toml",
    ] {
        let text = fs::read_to_string(root.join(manifest)).unwrap();
        let dependencies = text.split("[dependencies]").nth(1).unwrap_or("");
        let dependencies = dependencies.split("[dev-dependencies]").next().unwrap();
        for name in toolkit {
            let used = dependencies.lines().any(|line| line.starts_with(name));
            assert!(!used, "{manifest} depends on {name}");
        }
    }
}

#[test]
fn names_are_found_in_paths_and_in_nested_lists() {
    let code = "use crate::series::{Column, Series};\nuse crate::{fmi::{a, b}, sqp};\nlet x = pilotage_models::y();";
    let expected = ["fmi", "models", "series", "sqp"].map(str::to_owned);
    assert_eq!(named(code), BTreeSet::from(expected));
}
