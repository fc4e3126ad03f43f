//! The command line program under test, in a folder of its own.

use pilotage::export::{Platform, binary};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// Pilot and quadcopter in closed loop.
pub const CONNECTIONS: [&str; 4] = [
    "--connect",
    "pilot.stick=quadcopter.stick",
    "--connect",
    "quadcopter.z=pilot.position",
];

/// What a run of the program left.
#[derive(Debug)]
pub struct Ended {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// The one JSON object on stdout.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// An empty folder in which the program runs, removed at the end.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file, with its folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Names of all files in the folder, hidden ones too.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Runs `pilotage` here.
    pub fn pilotage(&self, arguments: &[&str]) -> Ended {
        self.pilotage_with(arguments, &[])
    }

    /// A `pilotage` here that Ctrl-C reaches, also where the tests themselves were started without (`nohup`, `&` of a script).
    pub fn listening(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new("env");
        command
            .arg("--default-signal=INT")
            .arg(env!("CARGO_BIN_EXE_pilotage"))
            .args(arguments)
            .current_dir(self.0.path());
        command
    }

    /// Starts one, with variables in the environment; what it says on stderr can be read.
    pub fn start(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Child {
        self.listening(arguments)
            .envs(variables.iter().copied())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// The same with variables in the environment.
    pub fn pilotage_with(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Ended {
        let output = Command::new(env!("CARGO_BIN_EXE_pilotage"))
            .args(arguments)
            .env("PATH", path_with_program())
            .envs(variables.iter().copied())
            .current_dir(self.0.path())
            .output()
            .unwrap();
        Ended {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

/// The search path with the program on it, so that it calls itself `pilotage`.
pub fn path_with_program() -> OsString {
    let folder = Path::new(env!("CARGO_BIN_EXE_pilotage")).parent();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let folders = folder
        .map(PathBuf::from)
        .into_iter()
        .chain(std::env::split_paths(&others));
    std::env::join_paths(folders).unwrap()
}

/// A file of the repository's `examples/`.
pub fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("examples")
        .join(name)
}

/// A folder with the FMUs of pilot and quadcopter.
pub fn exported() -> Folder {
    let folder = Folder::new();
    let export = ["export", "pilot", "--preset", "paper", "-o", "pilot.fmu"];
    assert_eq!(folder.pilotage(&export).code, 0);
    assert_eq!(folder.pilotage(&["export", "quadcopter"]).code, 0);
    folder
}

/// Runs what waits for processes, which would keep the threads from those that compute.
pub fn waiting<R: Send>(run: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4);
    pool.build().expect("four threads").install(run)
}

/// The embedded library for this machine.
pub fn own_library() -> Vec<u8> {
    let host = Platform::host().unwrap();
    binary::MODELS.of(&host).unwrap().unwrap()
}

/// Name and size of an FMU for this machine alone, as commands tell them.
pub fn written(folder: &Folder, name: &str) -> String {
    let size = std::fs::metadata(folder.path(name)).unwrap().len() as f64 / 1e6;
    let platform = pilotage::fmi::Fmu::open(&folder.path(name)).unwrap();
    let platform = platform.platforms().join(", ");
    format!("wrote {name} ({platform}; {size:.2} MB)\n")
}
