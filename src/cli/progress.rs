//! Progress of long work, on a terminal only.

use crate::identification;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::{Duration, Instant};

/// Work that is done sooner shows nothing.
const PATIENCE: Duration = Duration::from_secs(2);

/// A bar over the starts of a fit. indicatif itself shows nothing where stderr is no terminal.
pub struct Progress {
    begin: Instant,
    bar: ProgressBar,
}

impl Progress {
    /// Starts the clock.
    pub fn new() -> Self {
        Self {
            begin: Instant::now(),
            bar: ProgressBar::hidden(),
        }
    }

    /// Shows how far a fit is.
    pub fn show(&mut self, progress: &identification::Progress) {
        if self.begin.elapsed() <= PATIENCE {
            return;
        }
        let (position, length, message) = match progress {
            identification::Progress::Search { order, done } => (
                (100.0 * done) as u64,
                100,
                format!("percent: looking for starts of order {order}"),
            ),
            identification::Progress::Iterate(at) => (
                at.start as u64 + 1,
                at.starts as u64,
                format!(
                    "starts: order {}, iteration {}, objective {:.6e}, KKT residual {:.1e}",
                    at.order,
                    at.iteration.number,
                    at.iteration.objective,
                    at.iteration.kkt.residual()
                ),
            ),
        };
        if self.bar.is_hidden() {
            self.bar = bar();
        }
        self.bar.set_length(length);
        self.bar.set_position(position);
        self.bar.set_message(message);
    }

    /// Wipes it.
    pub fn clear(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn bar() -> ProgressBar {
    let target = ProgressDrawTarget::stderr_with_hz(5);
    let bar = ProgressBar::with_draw_target(None, target);
    let style = ProgressStyle::with_template("{bar:20} {pos} of {len} {msg}");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// What is being done, for work of unknown length.
pub struct Spinner {
    begin: Instant,
    bar: ProgressBar,
}

impl Spinner {
    /// Starts the clock.
    pub fn new() -> Self {
        Self {
            begin: Instant::now(),
            bar: ProgressBar::hidden(),
        }
    }

    /// Says what is being done now.
    pub fn show(&mut self, what: String) {
        if self.begin.elapsed() > PATIENCE {
            if self.bar.is_hidden() {
                let target = ProgressDrawTarget::stderr_with_hz(5);
                self.bar = ProgressBar::with_draw_target(None, target);
                self.bar.enable_steady_tick(Duration::from_millis(200));
            }
            self.bar.set_message(what);
        }
    }

    /// Wipes it.
    pub fn clear(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// How much of countable work is done, from several threads.
pub struct Counter {
    begin: Instant,
    bar: ProgressBar,
    what: &'static str,
}

impl Counter {
    /// Of so much work, called so.
    pub fn new(what: &'static str, count: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::hidden());
        let style = ProgressStyle::with_template("{bar:20} {pos} of {len} {msg}, {eta} left");
        Self {
            begin: Instant::now(),
            bar: bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            what,
        }
    }

    /// Another part is done.
    pub fn count(&self) {
        self.bar.inc(1);
        if self.bar.is_hidden() && self.begin.elapsed() > PATIENCE {
            self.bar
                .set_draw_target(ProgressDrawTarget::stderr_with_hz(5));
            self.bar.set_message(self.what);
        }
    }

    /// Wipes it.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
