//! The book: docs/ is built without a warning, and what its chapters say to type is run.

use super::{module, python};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the build, `target/` unless cargo is told another.
fn target() -> &'static Path {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent();
    folder.expect("it lies in the target folder")
}

/// Runs a command, and gives what it printed.
fn done(command: &mut Command) -> String {
    let output = command.output().expect("it can be started");
    let [stdout, stderr] =
        [output.stdout, output.stderr].map(|own| String::from_utf8_lossy(&own).into_owned());
    assert!(output.status.success(), "{command:?}\n{stdout}\n{stderr}");
    eprintln!("{stderr}");
    stdout
}

/// Each block of each chapter is run, written to a file that is read, or says why not: `tests/python/module/chapters.py`. The
/// snapshot has those that are not run.
#[test]
fn what_chapters_say_to_type_works() {
    let mut command = module::python(module::whole(), "chapters.py");
    command
        // A crate of a chapter is packed: its dependencies are built once, and nothing of it runs long.
        .env("CARGO_TARGET_DIR", target().join("tmp/chapters"))
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0");
    let said = done(&mut command);
    eprintln!("{said}");
    let chapters = said.lines().filter(|line| line.starts_with("docs/"));
    assert_eq!(chapters.count(), chapters_on_disk().len());
    insta::assert_snapshot!(left_out(&said));
}

/// Chapters with blocks that are not run, and these with their reasons.
fn left_out(said: &str) -> String {
    let mut lines = String::new();
    for line in said.lines() {
        if let Some((chapter, counts)) = line.split_once(": ") {
            if line.starts_with("docs/") && !counts.ends_with(" 0 not run") {
                lines += &format!("{chapter}\n");
            }
            if line.starts_with("    ") {
                lines += &format!("{line}\n");
            }
        }
    }
    lines
}

fn chapters_on_disk() -> Vec<String> {
    let files = std::fs::read_dir(root().join("docs")).unwrap();
    let names = files.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names
        .filter_map(|name| name.strip_suffix(".md").map(str::to_owned))
        .collect()
}

/// MkDocs takes broken links, missing anchors and pages that no list names for errors.
fn built() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(build)
}

fn build() -> PathBuf {
    let folder = target().join("book");
    done(
        Command::new(python::bookbinder())
            .args(python::compiled_elsewhere())
            .args(["-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir"])
            .arg(&folder)
            .current_dir(root())
            .env("PILOTAGE", env!("CARGO_BIN_EXE_pilotage"))
            .env("NO_MKDOCS_2_WARNING", "1")
            .env_remove("PYTHONPATH"),
    );
    folder
}

/// Files below a folder whose names end so, with their text.
fn texts(folder: &Path, ending: &str, into: &mut BTreeMap<PathBuf, String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            texts(&path, ending, into);
        } else if path.to_string_lossy().ends_with(ending) {
            let text = std::fs::read_to_string(&path).unwrap();
            into.insert(path, text);
        }
    }
}

/// Tags of a page that have this attribute: name of the tag and value.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<(&'a str, &'a str)> {
    let attribute = format!(" {name}=");
    let value = |rest: &'a str| match rest.chars().next() {
        Some(quote @ ('"' | '\'')) => rest[1..].split(quote).next(),
        _ => rest.split([' ', '>']).next(),
    };
    page.split('<')
        .filter_map(|tag| {
            let tag = tag.split_once('>').map_or(tag, |(own, _)| own);
            let (begin, rest) = tag.split_once(attribute.as_str())?;
            Some((begin.split(' ').next()?, value(rest)?))
        })
        .collect()
}

#[test]
fn is_whole_and_asks_nothing_of_other_servers() {
    let folder = built();
    let (mut pages, mut styles) = (BTreeMap::new(), BTreeMap::new());
    texts(folder, ".html", &mut pages);
    texts(folder, ".css", &mut styles);
    for (path, text) in &styles {
        assert!(!text.contains("url(http"), "{path:?}");
        assert!(!text.contains("@import"), "{path:?}");
    }
    for chapter in chapters_on_disk().iter().map(String::as_str).chain([
        "options",
        "module",
        "SECURITY",
        "CONTRIBUTING",
        "CHANGELOG",
    ]) {
        let name = if chapter == "README" {
            "index"
        } else {
            chapter
        };
        let page = folder.join(format!("{name}.html"));
        assert!(pages.contains_key(&page), "{name}");
    }
    let ids: BTreeMap<&PathBuf, BTreeSet<&str>> = pages
        .iter()
        .map(|(path, page)| {
            let ids = attributes(page, "id").into_iter().map(|(_, id)| id);
            (path, ids.collect())
        })
        .collect();
    let mut links = 0;
    for (path, page) in &pages {
        for (tag, link) in [attributes(page, "href"), attributes(page, "src")].concat() {
            if link.contains(':') || link.starts_with("//") {
                assert_eq!(tag, "a", "{path:?} asks for {link}");
                continue;
            }
            // The page of errors is shown in any folder.
            if path.ends_with("404.html") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let file = match file.split('?').next().unwrap() {
                "" => path.clone(),
                "." => folder.join("index.html"),
                file => path.parent().unwrap().join(file),
            };
            let file = file.canonicalize();
            let file = file.unwrap_or_else(|error| panic!("{path:?} links to {link}: {error}"));
            if let Some(known) = ids.get(&file)
                && !anchor.is_empty()
            {
                assert!(known.contains(anchor), "{path:?} links to {link}");
            }
            links += 1;
        }
    }
    assert!(links > 1000, "{links}");
}

/// Words of chapters, of the command's help and of docstrings are found by the search.
#[test]
fn can_be_searched() {
    let index = built().join("search/search_index.json");
    let index: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(index).unwrap()).unwrap();
    let entries = index["docs"].as_array().unwrap();
    for (page, word) in [
        ("guidance.html", "crossover"),
        ("options.html", "--step-limit"),
        ("module.html", "allow_unconverged"),
    ] {
        let has = |own: &serde_json::Value, key: &str, word: &str| {
            own[key].as_str().is_some_and(|text| text.contains(word))
        };
        let found = entries
            .iter()
            .any(|own| has(own, "location", page) && has(own, "text", word));
        assert!(found, "{word}");
    }
}
