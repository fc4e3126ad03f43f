//! Long calls: a thread of their own does the work without the interpreter's lock, and the caller looks for signals.

use pilotage::cli::call::{Done, Stop};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Interval between two looks for signals.
const BETWEEN: Duration = Duration::from_millis(20);
/// How long after a signal the work may take to stop with what it has.
const PATIENCE: Duration = Duration::from_millis(130);

/// Work for a thread, and who waits for it.
type Work = Box<dyn FnOnce() + Send>;

/// Threads that wait for work, of this process: to start one takes longer than a short simulation.
static IDLE: Mutex<(u32, Vec<Sender<Work>>)> = Mutex::new((0, Vec::new()));

fn idle() -> MutexGuard<'static, (u32, Vec<Sender<Work>>)> {
    let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    // A forked process has none of the threads.
    if idle.0 != process {
        *idle = (process, Vec::new());
    }
    idle
}

fn give(work: Work) -> std::io::Result<()> {
    let gone = |_| std::io::Error::other("a thread has ended before its work");
    let waiting = idle().1.pop();
    if let Some(thread) = waiting {
        return thread.send(work).map_err(gone);
    }
    let (sender, receiver) = channel::<Work>();
    let own = sender.clone();
    let serve = move || {
        while let Ok(work) = receiver.recv() {
            work();
            idle().1.push(own.clone());
        }
    };
    std::thread::Builder::new()
        .name("pilotage".into())
        .spawn(serve)?;
    sender.send(work).map_err(gone)
}

/// Runs the work and waits for it. A signal for which Python raises, such as Ctrl-C, asks it to stop: `Stopped` of
/// Python then has what is there.
///
/// What is done and what there is goes to `progress`, whenever it has changed; if that raises, it is as a signal.
pub fn run<'py>(
    py: Python<'py>,
    progress: Option<Bound<'py, PyAny>>,
    work: impl FnOnce(&Stop) -> Done + Send + 'static,
) -> PyResult<Done> {
    let stop = Stop::default();
    let own = stop.clone();
    let (sender, mut receiver) = channel();
    give(Box::new(move || {
        let work = std::panic::AssertUnwindSafe(|| work(&own));
        let _ = sender.send(std::panic::catch_unwind(work));
    }))?;
    let mut raised: Option<(PyErr, Instant)> = None;
    let mut told = (0, 0);
    let mut tell = || -> PyResult<()> {
        let now = stop.progress();
        if let Some(progress) = progress.as_ref().filter(|_| now != told) {
            told = now;
            progress.call1(now)?;
        }
        Ok(())
    };
    loop {
        let result;
        (result, receiver) = py.detach(move || (receiver.recv_timeout(BETWEEN), receiver));
        match result {
            Ok(Ok(done)) => {
                return match raised {
                    None => tell().map(|()| done),
                    Some((error, _)) => Err(with_what_is_there(py, error, done)),
                };
            }
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => {
                let message =
                    "pilotage has failed (a panic, whose message is on stderr): please report it";
                return Err(PyRuntimeError::new_err(message));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        match &raised {
            None => {
                if let Err(error) = py.check_signals().and_then(|()| tell()) {
                    stop.ask();
                    raised = Some((error, Instant::now()));
                }
            }
            // It ends by itself later, and nobody waits for it.
            Some((_, since)) if since.elapsed() > PATIENCE => {
                return Err(raised.map_or_else(|| PyRuntimeError::new_err("stopped"), |own| own.0));
            }
            Some(_) => {}
        }
    }
}

/// The exception of a signal, with what the work had: as its attribute `left`.
fn with_what_is_there(py: Python<'_>, error: PyErr, done: Done) -> PyErr {
    let left = crate::convert::left(py, done);
    let set = left.and_then(|left| error.value(py).setattr("left", left));
    match set {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// The exception for words that the command refuses; Python's side makes its own of it.
pub fn refused(done: &Done) -> PyErr {
    PyValueError::new_err(done.stderr.clone())
}
