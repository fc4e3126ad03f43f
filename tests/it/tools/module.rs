//! The Python module: pip makes its wheel ([`dist`]), which is installed into fresh environments and tried there by
//! `tests/python/module`.

use super::dist;
use super::library::asks_for_no_new_glibc;
use super::python::{compiled_elsewhere, interpreter};
use crate::foreign;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs a command, and gives what it printed.
fn done(command: &mut Command) -> String {
    let output = command.output().expect("it can be started");
    let [stdout, stderr] = [output.stdout, output.stderr];
    let stdout = String::from_utf8_lossy(&stdout).into_owned();
    assert!(
        output.status.success(),
        "{command:?} failed ({})\n{stdout}\n{}",
        output.status,
        String::from_utf8_lossy(&stderr)
    );
    stdout
}

/// The environments with the wheel, made once in each run: one with the packages of the tests, and one into which pip has put the
/// wheel and what it asks for.
struct Installed {
    _folder: tempfile::TempDir,
    whole: PathBuf,
    bare: PathBuf,
    wheel: PathBuf,
}

fn installed() -> &'static Installed {
    static INSTALLED: OnceLock<Installed> = OnceLock::new();
    INSTALLED.get_or_init(|| {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        let wheel = dist::file(".whl");
        let [whole, bare] = ["whole", "bare"].map(|name| {
            let home = folder.path().join(name);
            done(Command::new(interpreter()).args(["-m", "venv"]).arg(&home));
            home.join("bin/python")
        });
        let pip = |python: &Path, flags: &[&str]| {
            let install = ["-m", "pip", "install", "--quiet", "--no-compile"];
            done(Command::new(python).args(install).args(flags).arg(&wheel));
        };
        pip(&bare, &[]);
        pip(&whole, &["--no-deps"]);
        let site = "import sysconfig; print(sysconfig.get_path('purelib'))";
        let sites = [interpreter(), &whole].map(|own| done(Command::new(own).args(["-c", site])));
        let path = Path::new(sites[1].trim()).join("packages-of-the-tests.pth");
        std::fs::write(path, &sites[0]).unwrap();
        Installed {
            _folder: folder,
            whole,
            bare,
            wheel,
        }
    })
}

/// A Python with the module, and with the packages of the tests.
pub fn whole() -> &'static Path {
    &installed().whole
}

/// A Python that Ctrl-C reaches, with what the scripts ask for.
pub fn python(python: &Path, script: &str) -> Command {
    let mut command = Command::new("env");
    command
        .arg("--default-signal=INT")
        .arg(python)
        .args(compiled_elsewhere())
        .arg(root().join("tests/python/module").join(script))
        .env("PILOTAGE", env!("CARGO_BIN_EXE_pilotage"))
        .env("MPLBACKEND", "agg")
        .env_remove("PYTHONPATH");
    command
}

fn run(script: &str) -> String {
    done(&mut python(whole(), script))
}

#[test]
fn fits() {
    run("test_fit.py");
}

#[test]
fn simulations() {
    let folder = tempfile::tempdir().unwrap();
    let fmus = [
        ("CRASHING_FMU", "crash@0.5"),
        ("FORGETTING_FMU", "reset-forgets"),
        ("REMEMBERING_FMU", "shared"),
    ];
    let fmus = fmus.map(|(name, fault)| {
        let file = folder.path().join(name).with_extension("fmu");
        let fmu = match fault.starts_with("crash") {
            true => foreign::fmu(fault),
            false => foreign::faulty_fmu(fault),
        };
        std::fs::write(&file, fmu).unwrap();
        (name, file)
    });
    for script in ["test_simulate.py", "test_command.py"] {
        done(python(whole(), script).envs(fmus.clone()));
    }
}

#[test]
fn clusters() {
    run("test_cluster.py");
}

#[test]
fn other_commands() {
    run("test_tools.py");
}

/// What docs/python.md says of the module, and the code of README and the notebooks.
#[test]
fn guide_and_notebook() {
    run("guide.py");
}

#[test]
fn numpy_is_all_that_it_needs() {
    let packages =
        "import importlib.metadata as m; print(*sorted(d.name for d in m.distributions()))";
    let all = done(Command::new(&installed().bare).args(["-c", packages]));
    let own = all
        .split_whitespace()
        .filter(|name| !["pip", "setuptools"].contains(name));
    assert_eq!(own.collect::<Vec<_>>(), ["numpy", "pilotage"]);
    done(&mut python(&installed().bare, "numpy_alone.py"));
}

/// The types of the package, by its own rules, and its stubs beside the native part.
#[test]
fn types_are_what_they_say() {
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mypy");
    let mypy = |module: &str, arguments: &[OsString]| {
        let mut command = Command::new(&installed().whole);
        command
            .args(["-m", module])
            .args(arguments)
            .current_dir(root())
            .env("MYPY_CACHE_DIR", &cache);
        done(&mut command);
    };
    let config: [OsString; 2] = ["--config-file".into(), "pyproject.toml".into()];
    mypy("mypy", &config);
    let stubs = ["pilotage._pilotage", "--mypy-config-file", "pyproject.toml"];
    mypy("mypy.stubtest", &stubs.map(OsString::from));
}

/// One wheel serves every Python from 3.11 on; the sources of types and the licences are in it.
#[test]
fn the_wheel_is_whole() {
    let wheel = &installed().wheel;
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.contains("-cp311-abi3-"), "{name}");
    let mut archive = zip::ZipArchive::new(std::fs::File::open(wheel).unwrap()).unwrap();
    let names = archive.file_names().map(|name| name.unwrap().into_owned());
    let names: Vec<String> = names.collect();
    for part in [
        "pilotage/__init__.py",
        "pilotage/_pilotage.pyi",
        "pilotage/_pilotage.abi3.so",
        "pilotage/py.typed",
        ".dist-info/entry_points.txt",
        "licenses/LICENSE-MIT",
    ] {
        assert!(
            names.iter().any(|own| own.ends_with(part)),
            "{part}: {names:?}"
        );
    }
    let place = names.iter().position(|own| own.ends_with(".abi3.so"));
    let mut module = archive.by_index(place.unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let unpacked = folder.path().join("_pilotage.abi3.so");
    std::io::copy(&mut module, &mut std::fs::File::create(&unpacked).unwrap()).unwrap();
    asks_for_no_new_glibc(&unpacked);
}
