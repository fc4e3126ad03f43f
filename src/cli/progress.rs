//! Progress of long work, on a terminal only.

use crate::identification;
use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Work that is done sooner shows nothing.
const PATIENCE: Duration = Duration::from_secs(2);

/// One line on stderr that is overwritten as the work goes on.
pub struct Progress {
    begin: Instant,
    on_terminal: bool,
    shown: bool,
}

impl Progress {
    /// Starts the clock.
    pub fn new() -> Self {
        Self {
            begin: Instant::now(),
            on_terminal: std::io::stderr().is_terminal(),
            shown: false,
        }
    }

    /// Shows an iteration; never asks to stop.
    pub fn show(&mut self, progress: &identification::Progress) -> ControlFlow<()> {
        if self.on_terminal && self.begin.elapsed() > PATIENCE {
            let mut stderr = std::io::stderr().lock();
            // A terminal that cannot be written to is no reason to stop the work.
            let _ = write!(
                stderr,
                "\r\x1b[Kstart {} of {}, iteration {}: objective {:.6e}, KKT residual {:.1e}",
                progress.start + 1,
                progress.starts,
                progress.iteration.number,
                progress.iteration.objective,
                progress.iteration.kkt.residual()
            );
            let _ = stderr.flush();
            self.shown = true;
        }
        ControlFlow::Continue(())
    }

    /// Wipes the line.
    pub fn clear(&mut self) {
        if self.shown {
            let _ = write!(std::io::stderr().lock(), "\r\x1b[K");
        }
    }
}
