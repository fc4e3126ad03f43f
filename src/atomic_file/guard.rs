//! Protection against overwriting files that a command must not overwrite.

use std::fs::Metadata;
use std::path::{Path, PathBuf};

/// A file that a command is about to write.
#[derive(Debug, Clone, Copy)]
pub struct Planned<'a> {
    /// Path of the file.
    pub path: &'a Path,
    /// What it is, in words: `a pilot file`.
    pub what: &'static str,
    /// Whether an existing file at the path is one that the command itself would write.
    pub is_own: fn(&Path) -> bool,
    /// Whether it is a [`GrowingFile`](super::GrowingFile), which occupies the path of its part until it is complete.
    pub grows: bool,
}

/// Why an output must not be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It is an input, or lies in a folder that is an input.
    #[error("{} is an input of this command{}, and would be overwritten", output.display(), by_name(output, other))]
    Input {
        /// The output.
        output: PathBuf,
        /// The input.
        other: PathBuf,
    },
    /// Its part is an input or another output.
    #[error("{} is written into {} until it is complete, and that is {} of this command", output.display(), part.display(), if *is_input { "an input" } else { "another output" })]
    Part {
        /// The output.
        output: PathBuf,
        /// Its part.
        part: PathBuf,
        /// Whether the part is an input.
        is_input: bool,
    },
    /// The same file is also another output.
    #[error("two outputs go to {}{}", output.display(), by_name(output, other))]
    Twice {
        /// One output.
        output: PathBuf,
        /// The other.
        other: PathBuf,
    },
    /// A file of another kind exists at the path.
    #[error("{} exists and is not {what} of pilotage", output.display())]
    Foreign {
        /// The output.
        output: PathBuf,
        /// What the output would be.
        what: &'static str,
    },
}

/// The second name of a file that is given by two names.
fn by_name(path: &Path, other: &Path) -> String {
    match path == other {
        true => String::new(),
        false => format!(" (as {})", other.display()),
    }
}

/// Checks that the outputs may be written: none is an input or another output, links resolved, and each existing file
/// at their paths is one that the command may replace, or `force` is set. Devices and pipes may always be written.
///
/// # Errors
/// The first output that may not be written.
pub fn check(inputs: &[PathBuf], outputs: &[Planned], force: bool) -> Result<(), Refusal> {
    let is_device = |planned: &&Planned| metadata(planned.path).is_some_and(|is| !is.is_file());
    let outputs: Vec<&Planned> = outputs
        .iter()
        .filter(|planned| !is_device(planned))
        .collect();
    for (k, planned) in outputs.iter().enumerate() {
        let output = || planned.path.to_owned();
        let is_same = |other: &&Path| {
            let inside = other.is_dir() && resolved(planned.path).starts_with(resolved(other));
            inside || is_same_file(planned.path, other)
        };
        if let Some(other) = inputs.iter().map(PathBuf::as_path).find(is_same) {
            let (output, other) = (output(), other.to_owned());
            return Err(Refusal::Input { output, other });
        }
        if let Some(other) = outputs[..k].iter().map(|other| other.path).find(is_same) {
            let (output, other) = (output(), other.to_owned());
            return Err(Refusal::Twice { output, other });
        }
        if planned.grows {
            check_part(planned.path, inputs, &outputs)?;
        }
        let stands = metadata(planned.path).filter(|file| file.len() > 0);
        if stands.is_some() && !force && !(planned.is_own)(planned.path) {
            return Err(Refusal::Foreign {
                output: output(),
                what: planned.what,
            });
        }
    }
    Ok(())
}

/// Checks that the part of a growing file is neither an input nor another output.
fn check_part(output: &Path, inputs: &[PathBuf], outputs: &[&Planned]) -> Result<(), Refusal> {
    let part = super::part::part_of(output);
    let is_part = |other: &Path| is_same_file(&part, other);
    let is_input = inputs.iter().any(|input| is_part(input));
    match is_input || outputs.iter().any(|planned| is_part(planned.path)) {
        false => Ok(()),
        true => Err(Refusal::Part {
            output: output.to_owned(),
            part,
            is_input,
        }),
    }
}

fn metadata(path: &Path) -> Option<Metadata> {
    std::fs::metadata(path).ok()
}

/// Whether two paths refer to the same file, or would if it existed.
fn is_same_file(a: &Path, b: &Path) -> bool {
    match (metadata(a), metadata(b)) {
        (Some(of_a), Some(of_b)) => resolved(a) == resolved(b) || is_hard_link(&of_a, &of_b),
        (None, None) => resolved(a) == resolved(b),
        _ => false,
    }
}

#[cfg(unix)]
fn is_hard_link(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// The standard library cannot detect hard links on other systems.
#[cfg(not(unix))]
fn is_hard_link(_: &Metadata, _: &Metadata) -> bool {
    false
}

/// Maximum number of links followed, as in operating systems.
const MOST_LINKS: usize = 40;

/// The path with all links resolved, including links to files that do not exist yet.
pub(super) fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(whole) = path.canonicalize() {
            return whole;
        }
        match std::fs::read_link(&path) {
            Ok(target) => path = parent(&path).join(target),
            Err(_) => break,
        }
    }
    match (parent(&path).canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path,
    }
}

/// The folder of a file; `.` for a bare file name.
pub(super) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs::{create_dir, hard_link, write};
    use std::os::unix::fs::symlink;

    #[test]
    fn one_file_is_known_by_all_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(at("a"), "1").unwrap();
        write(at("b"), "1").unwrap();
        create_dir(at("sub")).unwrap();
        symlink(at("a"), at("link")).unwrap();
        symlink("link", at("link-of-link")).unwrap();
        hard_link(at("a"), at("hard")).unwrap();
        symlink(folder.path(), at("sub/up")).unwrap();
        symlink("new", at("dangling")).unwrap();
        symlink("loop", at("loop")).unwrap();
        let same = [
            ("a", "sub/../a"),
            ("a", "link"),
            ("link-of-link", "hard"),
            ("a", "sub/up/a"),
            ("new", "sub/up/./new"),
            ("new", "dangling"),
            ("sub/up/dangling", "new"),
        ];
        for (one, other) in same {
            assert!(is_same_file(&at(one), &at(other)), "{one} {other}");
        }
        for (one, other) in [("a", "b"), ("a", "new"), ("new", "newer"), ("loop", "a")] {
            assert!(!is_same_file(&at(one), &at(other)), "{one} {other}");
        }
    }

    /// The part of an output lies next to the output, links resolved.
    #[test]
    fn the_part_of_an_output_is_nobody_elses() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(at("x.csv.part"), "rows").unwrap();
        symlink("x.csv", at("link")).unwrap();
        let planned = |path, grows| Planned {
            path,
            what: "a result",
            is_own: |_| true,
            grows,
        };
        let (file, link, part) = (at("x.csv"), at("link"), at("x.csv.part"));
        for output in [&file, &link] {
            let inputs = std::slice::from_ref(&part);
            let input = check(inputs, &[planned(output, true)], true);
            let message = input.unwrap_err().to_string();
            assert!(
                message.ends_with(
                    "x.csv.part until it is complete, and that is an input of this command"
                ),
                "{message}"
            );
            assert_eq!(check(inputs, &[planned(output, false)], true), Ok(()));
            let other = check(&[], &[planned(output, true), planned(&part, false)], true);
            assert!(
                matches!(
                    other,
                    Err(Refusal::Part {
                        is_input: false,
                        ..
                    })
                ),
                "{other:?}"
            );
            assert_eq!(check(&[], &[planned(output, true)], true), Ok(()));
        }
    }

    #[test]
    fn inputs_and_outputs_are_kept_apart_and_what_stands_there_is_looked_at() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [
            ("in", "own"),
            ("old", "own"),
            ("other", "mine"),
            ("empty", ""),
        ] {
            write(at(name), text).unwrap();
        }
        let is_own: fn(&Path) -> bool = |path| std::fs::read(path).unwrap() == b"own";
        let asked = |names: &[&str], force| {
            let paths: Vec<PathBuf> = names.iter().map(|name| at(name)).collect();
            let planned = |path| Planned {
                path,
                what: "a result",
                is_own,
                grows: false,
            };
            let outputs: Vec<Planned> = paths.iter().map(|path| planned(path)).collect();
            check(&[at("in")], &outputs, force)
        };
        for (names, force) in [
            (&["old", "new", "empty"][..], false),
            (&["other"], true),
            (&["/dev/null", "/dev/null"], false),
        ] {
            assert_eq!(asked(names, force), Ok(()), "{names:?}");
        }
        for force in [false, true] {
            let input = asked(&["new", "in"], force);
            assert!(matches!(input, Err(Refusal::Input { .. })), "{input:?}");
            let twice = asked(&["new", "./new"], force);
            assert!(matches!(twice, Err(Refusal::Twice { .. })), "{twice:?}");
        }
        let foreign = asked(&["other"], false);
        assert!(
            matches!(foreign, Err(Refusal::Foreign { .. })),
            "{foreign:?}"
        );
    }
}
