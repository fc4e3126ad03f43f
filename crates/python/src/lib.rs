//! The native part of the Python package `pilotage`: converts words and arrays, and nothing else. What it computes is
//! what the command computes ([`pilotage::cli::call`]); `python/pilotage` says it in Python's words.
//!
//! | module | content |
//! | --- | --- |
//! | `convert` | series to arrays and back |
//! | `worker` | long calls: without the interpreter's lock, ended by Ctrl-C |

mod convert;
mod worker;

use convert::{Left, left};
use pilotage::cli;
use pilotage::cli::call::{Done, Stop};
use pilotage::cli::cosim::prepared;
use pilotage_process::program;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// How the command is started in a process of its own: an interpreter, its arguments, and the name under which the
/// command was called.
#[pyfunction]
fn hosted(python: PathBuf, before: Vec<OsString>, name: OsString) {
    program::is_within(python, before, vec![name]);
}

/// Runs the command in this process, which it ends with its exit code. The words are those of the command line, with the
/// name of the program first.
#[pyfunction]
fn main(py: Python<'_>, python: PathBuf, before: Vec<OsString>, words: Vec<OsString>) {
    program::is_within(python, before, words);
    py.detach(|| std::process::exit(cli::main().into()));
}

/// Runs the command in a thread of its own, and gives its exit code, what it would print on stdout and stderr, and its
/// tables and texts. Meanwhile it calls `progress` with what is done and what there is. With a folder, the command runs
/// there, in a process of its own, with one thread.
#[pyfunction]
#[pyo3(signature = (words, progress=None, folder=None))]
fn call<'py>(
    py: Python<'py>,
    words: Vec<OsString>,
    progress: Option<Bound<'py, PyAny>>,
    folder: Option<PathBuf>,
) -> PyResult<Left<'py>> {
    let work = move |stop: &Stop| match folder {
        Some(folder) => cli::call::call_within(&folder, words, stop),
        None => cli::call::call(words, stop),
    };
    left(py, worker::run(py, progress, work)?)
}

/// The version of pilotage.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// A system that is opened once and simulated any number of times.
#[pyclass(frozen)]
struct Prepared(Arc<Mutex<prepared::Prepared>>);

#[pymethods]
impl Prepared {
    /// Of the words of `pilotage cosim`.
    #[new]
    fn new(words: Vec<OsString>) -> PyResult<Self> {
        let made = prepared::Prepared::new(words);
        let made = made.map_err(|done: Done| worker::refused(&done))?;
        Ok(Self(Arc::new(Mutex::new(made))))
    }

    /// Simulates with these values, each a name and a text, and gives what `call` gives.
    #[pyo3(signature = (settings, progress=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        settings: Vec<(String, String)>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Left<'py>> {
        let own = Arc::clone(&self.0);
        let done = worker::run(py, progress, move |stop| {
            let mut own = own.lock().unwrap_or_else(PoisonError::into_inner);
            own.run(&settings, stop)
        })?;
        left(py, done)
    }
}

/// The native part of the package.
#[pymodule]
fn _pilotage(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(hosted, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(call, module)?)?;
    module.add_function(wrap_pyfunction!(version, module)?)?;
    module.add_function(wrap_pyfunction!(convert::write_table, module)?)?;
    module.add_function(wrap_pyfunction!(convert::read_table, module)?)?;
    module.add_class::<Prepared>()
}
