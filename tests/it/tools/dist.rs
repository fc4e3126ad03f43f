//! What is released (`scripts/dist.py`): made once, in the profile of the tests and with their command; installed and tried in fresh
//! folders, where the command finds neither this repository nor the environment of the tests.

use super::library::asks_for_no_new_glibc;
use super::python::interpreter;
use crate::times;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir, tempdir_in};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder with the wheel and all else, made anew in each run.
pub fn made() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("dist");
        if folder.exists() {
            std::fs::remove_dir_all(&folder).expect("that of an earlier run can be removed");
        }
        make(&folder);
        folder
    })
}

/// Runs the script.
fn make(out: &Path) {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let cargo = Path::new(env!("CARGO")).parent().unwrap().to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let search = [cargo].into_iter().chain(std::env::split_paths(&others));
    succeeded(
        Command::new(interpreter())
            .arg(root().join("scripts/dist.py"))
            .args(["--profile", "quick", "--command"])
            .arg(env!("CARGO_BIN_EXE_pilotage"))
            .arg("--out")
            .arg(out)
            .env("PATH", std::env::join_paths(search).unwrap())
            .env("CARGO_TARGET_DIR", target),
    );
}

/// The file whose name ends so.
pub fn file(end: &str) -> PathBuf {
    let mut files = std::fs::read_dir(made()).unwrap();
    let found = files.find_map(|entry| {
        let path = entry.unwrap().path();
        path.to_string_lossy().ends_with(end).then_some(path)
    });
    found.unwrap_or_else(|| panic!("no file *{end} in {}", made().display()))
}

/// What a command printed, on stdout and on stderr.
fn succeeded(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = [stdout, stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(status.success(), "{command:?}: {status}\n{}", text.concat());
    text.concat()
}

/// Whether a program can be started; if not, it is noted.
fn is_here(program: &str, what: &str) -> bool {
    let is_here = Command::new(program).arg("--version").output().is_ok();
    if !is_here {
        times::missing(program, what);
    }
    is_here
}

/// A command that knows nothing but itself: it exports, validates and flies.
fn assert_works(command: &Path) {
    let folder = tempdir().unwrap();
    let run = |arguments: &str| {
        let mut alone = Command::new(command);
        alone.env_clear().current_dir(folder.path());
        succeeded(alone.args(arguments.split_whitespace()))
    };
    let version = concat!("pilotage ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(run("--version"), version);
    run("export pilot --preset paper");
    run("export quadcopter");
    run("validate --strict pilot.fmu quadcopter.fmu");
    run(
        "cosim pilot.fmu quadcopter.fmu --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \
        --set pilot.target=10 --stop-time 15 --step 0.05 --algorithm strong -o result.csv",
    );
    let rows = std::fs::read_to_string(folder.path().join("result.csv")).unwrap();
    assert_eq!(rows.lines().count(), 302, "{rows}");
}

fn unpacked() -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let mut tar = Command::new("tar");
    succeeded(
        tar.arg("-xzf")
            .arg(file(".tar.gz"))
            .current_dir(folder.path()),
    );
    let name = file(".tar.gz").file_name().unwrap().to_owned();
    let name = name.to_str().unwrap().strip_suffix(".tar.gz").unwrap();
    let start = concat!("pilotage-", env!("CARGO_PKG_VERSION"), "-");
    assert!(name.starts_with(start), "{name}");
    let path = folder.path().join(name);
    (folder, path)
}

#[test]
fn a_tarball_has_all_that_the_command_needs() {
    let (_folder, tree) = unpacked();
    assert_works(&tree.join("bin/pilotage"));
    asks_for_no_new_glibc(&tree.join("bin/pilotage"));
    for text in ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"] {
        let own = std::fs::read(root().join(text)).unwrap();
        assert!(own == std::fs::read(tree.join(text)).unwrap(), "{text}");
    }
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_package_of_debian_has_the_same() {
    let package = file("_amd64.deb");
    if !is_here("dpkg-deb", "the Debian package is not unpacked") {
        return;
    }
    let ask = |what: &[&str]| succeeded(Command::new("dpkg-deb").args(what).arg(&package));
    let fields = ask(&["--field"]);
    for field in [
        "Package: pilotage",
        concat!("Version: ", env!("CARGO_PKG_VERSION")),
        "Architecture: amd64",
        "Depends: libc6 (>= 2.17)",
    ] {
        assert!(fields.lines().any(|own| own == field), "{field}: {fields}");
    }
    let contents = ask(&["--contents"]);
    for part in [
        "-rwxr-xr-x root/root",
        " ./usr/bin/\n",
        "./usr/bin/pilotage\n",
        "./usr/share/man/man1/pilotage-fit.1.gz\n",
        "./usr/share/zsh/vendor-completions/_pilotage\n",
        "./usr/share/doc/pilotage/copyright\n",
    ] {
        assert!(contents.contains(part), "{part}: {contents}");
    }
    // dpkg makes no folder by itself, other than `dpkg-deb -x`.
    let place = |name: &str| contents.find(name);
    assert!(place("./usr/bin/\n") < place("./usr/bin/pilotage\n"));
    let folder = tempdir().unwrap();
    succeeded(
        Command::new("dpkg-deb")
            .arg("-x")
            .arg(&package)
            .arg(folder.path()),
    );
    assert_works(&folder.path().join("usr/bin/pilotage"));
    let control = tempdir().unwrap();
    succeeded(
        Command::new("dpkg-deb")
            .arg("-e")
            .arg(&package)
            .arg(control.path()),
    );
    let mut sums = Command::new("md5sum");
    let sums = sums
        .args(["--check", "--strict", "--quiet"])
        .arg(control.path().join("md5sums"));
    succeeded(sums.current_dir(folder.path()));
}

/// Not only are the scripts read: bash is asked for what it completes.
#[test]
fn shells_complete() {
    let (_folder, tree) = unpacked();
    let bash = tree.join("share/bash-completion/completions/pilotage");
    let script = r#"
        source "$1"
        complete -p pilotage
        words() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _pilotage pilotage "${@: -1}" "${@: -2:1}"; echo "${COMPREPLY[@]}"; }
        words pilotage co
        words pilotage cosim --alg
        words pilotage cosim --algorithm ""
    "#;
    let said = succeeded(
        Command::new("bash")
            .args(["-uc", script, "bash"])
            .arg(&bash),
    );
    let lines: Vec<_> = said.lines().collect();
    assert!(lines[0].contains("-F _pilotage"), "{said}");
    assert_eq!(
        lines[1..3],
        [
            "compare compile container convert cosim completions",
            "--algorithm"
        ],
        "{said}"
    );
    assert!(lines[3].contains("strong"), "{said}");
    for (shell, flag, place) in [
        ("zsh", "-n", "share/zsh/site-functions/_pilotage"),
        (
            "fish",
            "--no-execute",
            "share/fish/vendor_completions.d/pilotage.fish",
        ),
    ] {
        let text = std::fs::read_to_string(tree.join(place)).unwrap();
        assert!(
            text.contains("cosim") && !text.contains("Test one FMU"),
            "{text}"
        );
        if is_here(shell, "its completions are not read") {
            succeeded(Command::new(shell).arg(flag).arg(tree.join(place)));
        }
    }
}

/// One page for each command, of which groff has nothing to say.
#[test]
fn manual_pages_are_sound() {
    let (_folder, tree) = unpacked();
    let pages = std::fs::read_dir(tree.join("share/man/man1")).unwrap();
    let mut pages: Vec<_> = pages.map(|entry| entry.unwrap().path()).collect();
    pages.sort();
    let names = pages.iter().map(|page| page.file_name().unwrap());
    let names: Vec<_> = names.map(|name| name.to_str().unwrap()).collect();
    for name in ["pilotage.1", "pilotage-fit.1", "pilotage-model-check.1"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    assert!(!names.contains(&"pilotage-probe.1"), "hidden: {names:?}");
    if !is_here("groff", "manual pages are not set") {
        return;
    }
    let mut groff = Command::new("groff");
    let groff = groff
        .args(["-ww", "-man", "-Kutf8", "-Tutf8", "-z"])
        .args(&pages);
    assert_eq!(succeeded(groff), "");
    let mut groff = Command::new("groff");
    let fit = tree.join("share/man/man1/pilotage-fit.1");
    let set = succeeded(
        groff
            .args(["-man", "-Kutf8", "-Tascii", "-P-cbou"])
            .arg(fit),
    );
    for part in [
        "NAME",
        "SYNOPSIS",
        "OPTIONS",
        "Examples:",
        "--initial-state",
    ] {
        assert!(set.contains(part), "{part}: {set}");
    }
}

#[test]
fn sums_are_right_and_a_second_run_gives_the_same_bytes() {
    let mut check = Command::new("sha256sum");
    let check = check.args(["--check", "--strict", "SHA256SUMS"]);
    let checked = succeeded(check.current_dir(made()));
    assert_eq!(checked.matches(": OK\n").count(), 3, "{checked}");
    let folder = tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let again = folder.path().join("dist");
    make(&again);
    let sums = [made(), &again].map(|own| std::fs::read_to_string(own.join("SHA256SUMS")).unwrap());
    assert_eq!(sums[0], sums[1]);
}

/// Whoever hands the command on hands these licences on.
#[test]
fn licences_of_all_crates_are_there() {
    let (_folder, tree) = unpacked();
    let listed = std::fs::read_to_string(tree.join("LICENSES-OF-OTHERS")).unwrap();
    let mut cargo = Command::new(env!("CARGO"));
    let cargo = cargo
        .args(["tree", "--package=pilotage", "--edges=normal,no-proc-macro"])
        .args(["--prefix=none", "--format={p}|{l}", "--locked", "--offline"])
        .current_dir(root());
    let tree = succeeded(cargo);
    let mut count = 0;
    for line in tree.lines().filter(|line| !line.contains("(/")) {
        let (package, licence) = line.split_once('|').unwrap();
        let package = package.replacen(" v", " ", 1).replace(" (*)", "");
        let line = format!("\n{package}: {}\n", licence.trim_end_matches(" (*)"));
        assert!(listed.contains(&line), "{line}");
        count += 1;
    }
    assert!(count > 100, "{tree}");
}

/// What tools that check wheels say of ours: which systems it runs on, and that it keeps to Python's stable interface.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_wheel_is_for_old_systems_and_every_python() {
    let wheel = file(".whl");
    let tool = |arguments: &[&str]| {
        let mut python = Command::new(interpreter());
        succeeded(python.arg("-m").args(arguments).arg(&wheel))
    };
    let shown = tool(&["auditwheel", "show"]);
    let shown = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    let tag = "is consistent with the following platform tag: \"manylinux_2_17_x86_64\"";
    assert!(shown.contains(tag), "{shown}");
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    for tag in [
        "-cp311-abi3-",
        "manylinux2014_x86_64",
        "manylinux_2_17_x86_64",
    ] {
        assert!(name.contains(tag), "{name}");
    }
    let report = tool(&["abi3audit", "--strict", "--report"]);
    assert!(
        report.contains("\"name\": \"_pilotage.abi3.so\""),
        "{report}"
    );
    assert!(report.contains("\"computed\": \"3.11\""), "{report}");
}
