//! The program that runs: its arguments, and how it is started again for work in a process of its own.
//!
//! Usually that is the file of this process. Where the program is part of another one, such as a Python interpreter that has
//! loaded it, that one [says](is_within) how.

use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

struct Host {
    path: PathBuf,
    before: Vec<OsString>,
    arguments: Vec<OsString>,
}

static HOST: OnceLock<Host> = OnceLock::new();

/// This process is that of another program, which starts this one as `path` with the arguments `before` in front of its
/// own. `arguments` are those of this process, with the name of the program first. The first call counts.
pub fn is_within(path: PathBuf, before: Vec<OsString>, arguments: Vec<OsString>) {
    let _ = HOST.set(Host {
        path,
        before,
        arguments,
    });
}

/// Name and arguments of the program in this process.
pub fn arguments() -> Vec<OsString> {
    match HOST.get() {
        Some(host) => host.arguments.clone(),
        None => std::env::args_os().collect(),
    }
}

/// The file that a user starts, if it is known.
pub fn file() -> Option<PathBuf> {
    match HOST.get() {
        Some(host) => host.arguments.first().map(PathBuf::from),
        None => std::env::current_exe().ok(),
    }
}

/// What starts the program: a file, and the arguments before its own.
///
/// # Errors
/// If the system does not tell the file of this process.
pub fn start() -> io::Result<(PathBuf, Vec<OsString>)> {
    match HOST.get() {
        Some(host) => Ok((host.path.clone(), host.before.clone())),
        None => Ok((std::env::current_exe()?, Vec::new())),
    }
}

/// The program, to be started with other arguments.
///
/// # Errors
/// As [`start`].
pub fn command() -> io::Result<Command> {
    let (path, before) = start()?;
    let mut command = Command::new(path);
    command.args(before);
    Ok(command)
}

/// The program, to be started with the name and the arguments of this process.
///
/// # Errors
/// As [`start`].
pub fn again() -> io::Result<Command> {
    let mut command = command()?;
    let mut arguments = arguments().into_iter();
    let name = arguments.next();
    #[cfg(unix)]
    if let (None, Some(name)) = (HOST.get(), name) {
        std::os::unix::process::CommandExt::arg0(&mut command, name);
    }
    #[cfg(not(unix))]
    drop(name);
    command.args(arguments);
    Ok(command)
}
