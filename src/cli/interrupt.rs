//! Ctrl-C: the first requests a stop with the results so far, the second kills the process.

use super::{Failure, call, terminal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

static ASKED: AtomicBool = AtomicBool::new(false);

/// A supervised process receives one Ctrl-C twice: from the terminal, and forwarded by its parent.
const TWICE: Duration = Duration::from_millis(200);

/// Exit code of a process killed by Ctrl-C, as in shells: 128 + SIGINT.
const KILLED: u8 = 130;

/// The signal's number, the same on all systems.
#[cfg(unix)]
const SIGINT: i32 = 2;

/// Installs the handler, which announces its effect on the first Ctrl-C. At most once per process.
pub fn listen(stopping: &'static str) -> Result<(), Failure> {
    // Who calls it listens.
    if call::is_on() {
        return Ok(());
    }
    let mut last: Option<Instant> = None;
    let mut handler = move || {
        if last
            .replace(Instant::now())
            .is_some_and(|last| last.elapsed() < TWICE)
        {
            return;
        }
        if ASKED.swap(true, Ordering::SeqCst) {
            pilotage_process::finished(KILLED);
            pilotage_process::leftovers::remove();
            std::process::exit(i32::from(KILLED));
        }
        terminal::note(&format!("{stopping}; Ctrl-C again kills"));
    };
    pilotage_process::leftovers::leave_interrupts();
    #[cfg(unix)]
    let listens = pilotage_process::signals::listen(&[SIGINT], move |_| handler());
    #[cfg(not(unix))]
    let listens = ctrlc::set_handler(handler);
    listens.map_err(|error| Failure::new(format!("cannot listen to Ctrl-C: {error}")))
}

/// What tells whether this thread's command is to stop, also in other threads.
pub fn flag() -> &'static AtomicBool {
    call::stop().unwrap_or(&ASKED)
}

/// Whether Ctrl-C has been pressed: to be asked in the thread of the command.
pub fn is_asked() -> bool {
    flag().load(Ordering::SeqCst)
}
