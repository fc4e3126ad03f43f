//! Who may know whom inside the crates: those arrows of CONTRIBUTING.md that cargo does not hold.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// For each module of the command's crate, and for those that stand beside others in a crate, the modules and
/// workspace crates that it may name; between crates, cargo holds the arrows.
const ARROWS: &[(&str, &[&str])] = &[
    ("src/date", &[]),
    ("src/atomic_file", &["process", "text"]),
    (
        "src/export",
        &[
            "abi",
            "sdk",
            "models",
            "language",
            "fmi",
            "text",
            "atomic_file",
            "file",
            "cosim",
            "expression",
            "process",
        ],
    ),
    (
        "src/report",
        &[
            "series",
            "units",
            "models",
            "vehicle",
            "flights",
            "cosim",
            "linear",
            "inference",
            "sqp",
            "text",
        ],
    ),
    (
        "crates/flights/src/vehicle",
        &["models", "units", "linear", "text"],
    ),
    (
        "crates/flights/src/synthetic",
        &["models", "sdk", "series", "linear", "text"],
    ),
    // An instance knows the callbacks that it gives, and those what they reach; nobody of them knows it.
    ("crates/fmi/src/message", &["abi", "text"]),
    ("crates/fmi/src/misuse", &[]),
    (
        "crates/fmi/src/binding",
        &[
            "abi",
            "text",
            "process",
            "archive",
            "description",
            "misuse",
            "surroundings",
            "version",
        ],
    ),
    (
        "crates/fmi/src/environment",
        &["abi", "binding", "message", "misuse"],
    ),
    (
        "crates/fmi/src/logger",
        &["abi", "binding", "environment", "message", "misuse"],
    ),
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
    without_tests(&text)
        .filter(|line| !line.trim_start().starts_with("//"))
        .map(|line| format!("{line}\n"))
        .collect()
}

/// The lines that are in no item with `#[cfg(test)]`. An item ends with a semicolon in its first line, or with a brace as
/// far from the margin as it is itself.
fn without_tests(text: &str) -> impl Iterator<Item = &str> {
    let mut end = None;
    text.lines().filter(move |line| {
        let margin = line.len() - line.trim_start().len();
        match &end {
            None if line.trim() == "#[cfg(test)]" => end = Some((margin, true)),
            None => return true,
            Some((_, true)) if line.trim_start().starts_with("#[") => {}
            Some((_, true)) if line.ends_with([';', '}']) => end = None,
            Some((own, true)) => end = Some((*own, false)),
            Some((own, false)) if margin == *own && line.trim_start() == "}" => end = None,
            Some(_) => {}
        }
        false
    })
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

fn word(text: &str) -> String {
    text.chars()
        .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
        .collect()
}

/// The names that follow a path such as `crate::`, alone or in a list.
fn after(code: &str, path: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for rest in code.split(path).skip(1) {
        match rest.strip_prefix('{') {
            None => found.extend([word(rest)]),
            Some(list) => found.extend(top_level(list).iter().map(|item| word(item.trim()))),
        }
    }
    found
}

/// The modules and workspace crates that a file's code names: `crate::x`, `pilotage_x`, and the nested
/// `use crate::{x, y}`.
fn named(code: &str) -> BTreeSet<String> {
    let mut found = after(code, "crate::");
    for rest in code.split("pilotage_").skip(1) {
        found.insert(word(rest));
    }
    found.remove("");
    found
}

/// The sources of the library, without those of the exported FMU: paths from the root, and code.
fn library() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    sources(&root.join("crates"), &mut files);
    let relative = |file: &PathBuf| {
        let path = file.strip_prefix(root).unwrap().to_str().unwrap();
        (path.replace('\\', "/"), code(file))
    };
    files.iter().map(relative).collect()
}

/// Whether a file is that module: its own, or one in its folder.
fn is_of(file: &str, module: &str) -> bool {
    (file.strip_prefix(module)).is_some_and(|rest| rest.starts_with(['/', '.']))
}

#[test]
fn modules_name_only_whom_they_may_know() {
    let mut wrong = Vec::new();
    let mut seen = BTreeSet::new();
    for (file, code) in library() {
        let Some((module, allowed)) = ARROWS.iter().find(|(module, _)| is_of(&file, module)) else {
            let free = ["src/lib", "src/main", "src/cli"];
            if file.starts_with("src/") && !free.iter().any(|module| is_of(&file, module)) {
                wrong.push(format!("{file}: not in the list of arrows"));
            }
            continue;
        };
        seen.insert(*module);
        let own = module.rsplit('/').next().unwrap();
        for name in named(&code) {
            if name != own && !allowed.contains(&name.as_str()) {
                wrong.push(format!("{file} names {name}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(seen.len(), ARROWS.len(), "some modules are gone: {seen:?}");
}

/// The master knows components; what they are made of, only two modules know.
#[test]
fn of_co_simulation_only_the_components_know_fmus_and_models() {
    for (file, code) in library() {
        for (name, module) in [
            ("fmi", "fmu_component"),
            ("models", "native_component"),
            ("sdk", "native_component"),
        ] {
            let is_component = is_of(&file, &format!("crates/cosim/src/{module}"));
            let knows = file.starts_with("crates/cosim/") && named(&code).contains(name);
            assert!(is_component || !knows, "{file} names {name}");
        }
    }
}

/// A fit takes of co-simulation what a system file says, and nothing that runs.
#[test]
fn of_co_simulation_estimation_knows_descriptions_alone() {
    for (file, code) in library() {
        if !file.starts_with("crates/estimation/") {
            continue;
        }
        let known = ["description", "SystemDescription", "DescriptionError"];
        for name in after(&code, "pilotage_cosim::") {
            assert!(known.contains(&name.as_str()), "{file} names {name}");
        }
    }
}

/// The modules of a fit lie one above the other.
#[test]
fn of_estimation_each_module_names_those_beneath_it() {
    let layers = [
        "problem",
        "system",
        "posed",
        "search",
        "innovations",
        "result",
        "fit",
        "studies",
    ];
    let mut seen = BTreeSet::new();
    for (file, code) in library() {
        let Some(rest) = file.strip_prefix("crates/estimation/src/") else {
            continue;
        };
        let own = layers.iter().position(|layer| is_of(rest, layer));
        let Some(own) = own else {
            assert_eq!(rest, "lib.rs", "a module that is in no layer");
            continue;
        };
        seen.insert(own);
        let named = after(&code, "crate::");
        for layer in &layers[own + 1..] {
            assert!(!named.contains(*layer), "{file} names {layer}");
        }
    }
    assert_eq!(seen.len(), layers.len());
}

#[test]
fn only_the_command_line_knows_clap_and_the_terminal() {
    let library = library();
    // A build script prints what it tells cargo, and an example is a program.
    let is_program = |file: &str| file == "crates/python/build.rs" || file.contains("/examples/");
    let rest = (library.iter()).filter(|(file, _)| !is_of(file, "src/cli") && !is_program(file));
    for (file, code) in rest {
        for word in [
            "clap::",
            "println!",
            "eprintln!",
            "print!(",
            "io::stdout",
            "io::stderr",
            "dbg!",
        ] {
            // Where memory has run out, nothing else can be called to say so.
            let may = word == "io::stderr" && file == "crates/process/src/memory.rs";
            assert!(may || !code.contains(word), "{file} uses {word}");
        }
        let streams = after(code, "std::io::");
        let streams = ["stdout", "stderr"].map(|name| streams.contains(name));
        assert_eq!(streams, [false; 2], "{file} imports stdout or stderr");
        let knows = code.contains("crate::cli") || code.contains("pilotage::cli");
        let may_know = file == "src/main.rs" || is_of(file, "crates/python");
        assert!(!knows || may_know, "{file}");
    }
}

/// HTML is escaped by the type that holds it; strings are made of that type, as they are, where they are files of ours.
#[test]
fn strings_become_html_unescaped_in_two_files_alone() {
    let mut files = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    sources(&root.join("src"), &mut files);
    sources(&root.join("crates"), &mut files);
    let is_raw = |path: &&PathBuf| code(path).contains("PreEscaped");
    let mut found: Vec<&Path> = (files.iter().filter(is_raw))
        .map(|path| path.strip_prefix(root).unwrap())
        .collect();
    found.sort();
    let own = ["src/export/documentation.rs", "src/report/html.rs"];
    assert_eq!(found, own.map(Path::new));
}

/// What is printed is made visible in one place, which cannot be passed by.
#[test]
fn all_that_the_command_prints_passes_the_terminal() {
    let printers = ["src/cli/terminal.rs"];
    for (file, code) in library() {
        if !is_of(&file, "src/cli") || printers.contains(&file.as_str()) {
            continue;
        }
        let code = code.replace("stderr().is_terminal()", "");
        for word in ["println!", "print!(", "io::stdout", "io::stderr", "dbg!"] {
            assert!(!code.contains(word), "{file} uses {word}");
        }
        let is_drawn = code.contains("set_message(") || code.contains("suspend(");
        assert!(
            !is_drawn || file == "src/cli/progress.rs",
            "{file} draws a bar with words"
        );
    }
}

/// The arrows are read from paths that begin at the crate. The command line and tests may know everything.
#[test]
fn no_path_climbs_out_of_its_module() {
    for (file, code) in library() {
        let is_test = file.contains("/tests/") || file.ends_with("/tests.rs");
        let is_free = is_test || is_of(&file, "src/cli");
        assert!(
            is_free || !code.contains("super::super"),
            "{file}: say `crate::`"
        );
    }
}

#[test]
fn the_fmu_drags_in_no_toolkit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let toolkit = ["clap", "zip", "csv", "toml", "clarabel"];
    let own = [
        "pilotage-abi.",
        "pilotage-expression.",
        // Model files are TOML, their tables CSV: what reads them is part of every exported FMU.
        "pilotage-language.",
        "pilotage-sdk.",
        "pilotage-models.",
        "pilotage-ode.",
        "pilotage-units.",
    ];
    for manifest in [
        "fmu/Cargo.toml",
        "fmu/abi/Cargo.toml",
        "fmu/sdk/Cargo.toml",
        "fmu/models/Cargo.toml",
        "crates/expression/Cargo.toml",
        "crates/ode/Cargo.toml",
        "crates/units/Cargo.toml",
    ] {
        let text = fs::read_to_string(root.join(manifest)).unwrap();
        let dependencies = text.split("[dependencies]").nth(1).unwrap_or("");
        let dependencies = dependencies.split("[dev-dependencies]").next().unwrap();
        for name in toolkit {
            let used = dependencies.lines().any(|line| line.starts_with(name));
            assert!(!used, "{manifest} depends on {name}");
        }
        for line in dependencies
            .lines()
            .filter(|line| line.starts_with("pilotage"))
        {
            let is_own = own.iter().any(|name| line.starts_with(name));
            assert!(is_own, "{manifest} depends on {line}");
        }
    }
}

/// The rows of CONTRIBUTING.md's table of dependencies: names on the left, words on the right.
fn written_table() -> Vec<(BTreeSet<String>, BTreeSet<String>)> {
    let words = |text: &str| -> BTreeSet<String> {
        let is_between = |c: char| !(c.is_ascii_alphanumeric() || "_-".contains(c));
        let words = text.split(is_between).filter(|word| !word.is_empty());
        words.map(str::to_owned).collect()
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("CONTRIBUTING.md")).unwrap();
    let (_, table) = text.split_once("Allowed dependencies").unwrap();
    let (table, _) = table.split_once("\n## ").unwrap();
    let mut rows: Vec<(BTreeSet<String>, BTreeSet<String>)> = Vec::new();
    for line in table.lines().filter_map(|line| line.strip_prefix("    ")) {
        if line.starts_with(' ') {
            rows.last_mut().unwrap().1.extend(words(line));
        } else {
            let (names, known) = line.split_once("  ").unwrap_or((line, ""));
            rows.push((words(names), words(known)));
        }
    }
    rows
}

/// What a crate may import is what its manifest lists; CONTRIBUTING.md says no more and no less.
#[test]
fn the_table_of_dependencies_is_that_of_the_manifests() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("crates")).unwrap();
    let crates = crates.map(|entry| entry.unwrap().path());
    let folders: Vec<PathBuf> = (["abi", "sdk", "models", "container"]
        .map(|name| root.join("fmu").join(name)))
    .into_iter()
    .chain(crates.filter(|path| path.is_dir()))
    .collect();
    let name = |folder: &PathBuf| folder.file_name().unwrap().to_str().unwrap().to_owned();
    let names: BTreeSet<String> = folders.iter().map(name).collect();
    let table = written_table();
    for folder in &folders {
        let own = name(folder);
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let (_, dependencies) = manifest.split_once("[dependencies]").unwrap_or_default();
        let dependencies = dependencies.split("\n[").next().unwrap();
        let listed = dependencies.lines().filter_map(|line| {
            let name = line
                .strip_prefix("pilotage-")?
                .split(['.', ' ', '='])
                .next()?;
            Some(name.to_owned())
        });
        let listed: BTreeSet<String> = listed.collect();
        let mut rows = table.iter().filter(|(left, _)| left.contains(&own));
        let (_, right) = rows
            .next()
            .unwrap_or_else(|| panic!("CONTRIBUTING.md lacks {own}"));
        let said: BTreeSet<String> = right.intersection(&names).cloned().collect();
        assert_eq!(
            said, listed,
            "of {own}: CONTRIBUTING.md, then its Cargo.toml"
        );
    }
}

/// The page of each crate says what its modules are for.
#[test]
fn each_module_stands_in_the_table_of_its_crate() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut libraries = Vec::new();
    for folder in ["crates", "fmu"] {
        let mut found = Vec::new();
        sources(&root.join(folder), &mut found);
        libraries.extend(
            found
                .into_iter()
                .filter(|path| path.ends_with("src/lib.rs")),
        );
    }
    assert!(libraries.len() > 20, "{libraries:?}");
    for library in libraries {
        let text = fs::read_to_string(&library).unwrap();
        let table = text.lines().filter(|line| line.starts_with("//! | "));
        let table: String = table.collect();
        for line in without_tests(&text) {
            let line = line.strip_prefix("pub ").unwrap_or(line);
            let name = line
                .strip_prefix("mod ")
                .and_then(|line| line.strip_suffix(';'));
            if let Some(name) = name {
                let path = library.display();
                assert!(
                    table.contains(&format!("`{name}`")),
                    "{path} has no row for {name}"
                );
            }
        }
    }
}

#[test]
fn names_are_found_in_paths_and_in_nested_lists() {
    let code = "use crate::series::{Column, Series};\nuse crate::{fmi::{a, b}, sqp};\nlet x = pilotage_models::y();";
    let expected = ["fmi", "models", "series", "sqp"].map(str::to_owned);
    assert_eq!(named(code), BTreeSet::from(expected));
}

#[test]
fn unit_tests_are_left_out_and_what_follows_them_is_not() {
    let code = "use a;\n#[cfg(test)]\nmod tests;\nuse b;\nmod m {\n    #[cfg(test)]\n    #[path = \"x\"]\n    mod t {\n        \
                use c;\n        fn f() {\n        }\n    }\n    use d;\n}\n#[cfg(test)]\nmod tests {\n    use e;\n}\nuse f;";
    let left: Vec<&str> = without_tests(code).map(str::trim).collect();
    assert_eq!(
        left,
        ["use a;", "use b;", "mod m {", "use d;", "}", "use f;"]
    );
}

/// Files that may be read without the limit of `pilotage_text::file`, and why: what is in them is the system's or ours.
const UNLIMITED: &[(&str, &str)] = &[
    ("crates/text/src/file.rs", "has the limit"),
    ("crates/process/src/lock.rs", "/proc"),
    ("crates/process/src/signals.rs", "/proc"),
    ("crates/process/src/child.rs", "/proc"),
    ("crates/fmi/src/surroundings.rs", "/proc"),
    ("crates/fmi/src/fmu.rs", "unpacked, which has limits"),
    ("crates/fly/src/joystick.rs", "a device, event by event"),
    ("crates/fly/src/server.rs", "a page just written"),
    ("src/cli/fly/jobs.rs", "a problem file just written"),
    ("src/export/old_glibc.rs", "a library just linked"),
];

#[test]
fn files_are_read_to_a_limit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    for entry in fs::read_dir(root.join("crates")).unwrap() {
        sources(&entry.unwrap().path().join("src"), &mut files);
    }
    let is_listed = |path: &Path| UNLIMITED.iter().any(|(own, _)| root.join(own) == path);
    let readers: Vec<_> = (files.iter())
        .filter(|path| path.file_name().is_none_or(|name| name != "tests.rs"))
        .filter(|path| !is_listed(path))
        .filter(|path| {
            // Also tests that are for one system only.
            let code = code(path);
            let code = code.split("mod tests {").next().unwrap_or_default();
            ["fs::read(", "fs::read_to_string(", "File::open("]
                .iter()
                .any(|call| code.contains(call))
        })
        .collect();
    assert!(
        readers.is_empty(),
        "read by pilotage_text::file, or listed with a reason: {readers:?}"
    );
}
