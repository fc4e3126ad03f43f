//! Progress of long computations, shown on a terminal only.

use super::call;
use super::fit::Iterate;
use super::terminal::line;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::borrow::Cow;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// Work that is done sooner shows no progress.
const PATIENCE: Duration = Duration::from_secs(2);

/// A bar over the starts of a fit. indicatif itself shows nothing if stderr is no terminal.
pub struct Progress {
    begin: Instant,
    bar: Option<ProgressBar>,
    count: call::Count,
}

impl Progress {
    /// Creates the bar and starts its clock.
    pub fn new() -> Self {
        Self {
            begin: Instant::now(),
            bar: None,
            count: call::Count::to_caller(),
        }
    }

    /// Shows an iterate.
    pub fn iterate(&mut self, at: &Iterate) {
        let message = || {
            let mesh = (at.refinement > 0).then(|| format!("refinement {}, ", at.refinement));
            format!(
                "starts: {}iteration {}, objective {:.6e}, KKT residual {:.1e}",
                mesh.unwrap_or_default(),
                at.iteration.number,
                at.objective,
                at.iteration.kkt.residual()
            )
        };
        self.count.say(at.start as u64, at.starts as u64);
        self.show(at.start as u64 + 1, at.starts as u64, message);
    }

    fn show(&mut self, position: u64, length: u64, message: impl Fn() -> String) {
        if self.begin.elapsed() <= PATIENCE {
            return;
        }
        let bar = self.bar.get_or_insert_with(bar);
        bar.set_length(length);
        bar.set_position(position);
        bar.set_message(line(&message()));
    }

    /// Clears the bar.
    pub fn clear(&mut self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

/// Stderr; nothing for those who call the command.
fn target() -> ProgressDrawTarget {
    match call::is_on() {
        true => ProgressDrawTarget::hidden(),
        false => ProgressDrawTarget::stderr_with_hz(5),
    }
}

fn bar() -> ProgressBar {
    let target = target();
    let bar = ProgressBar::with_draw_target(None, target);
    let style = ProgressStyle::with_template("{bar:20} {pos} of {len} {msg}");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// A spinner for work of unknown length; it appears by itself when the work has lasted.
pub struct Spinner {
    bar: ProgressBar,
    _end: Sender<()>,
}

impl Spinner {
    /// Creates the spinner and starts its clock, with the first activity.
    pub fn new(what: impl Into<Cow<'static, str>>) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        bar.set_message(line(&what.into()));
        let (end, ended) = channel();
        if call::is_on() {
            return Self { bar, _end: end };
        }
        let own = bar.clone();
        // Without a thread, for which there may be no memory, nothing is shown.
        let _ = std::thread::Builder::new().spawn(move || {
            let is_long = ended.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout);
            if is_long && !own.is_finished() {
                own.set_draw_target(ProgressDrawTarget::stderr_with_hz(5));
                own.enable_steady_tick(Duration::from_millis(200));
            }
        });
        Self { bar, _end: end }
    }

    /// Shows the current activity.
    pub fn show(&self, what: String) {
        self.bar.set_message(line(&what));
    }

    /// Clears the spinner.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.clear();
    }
}

/// A progress bar for countable work, updated from several threads.
pub struct Counter {
    begin: Instant,
    bar: ProgressBar,
    what: &'static str,
    is_quiet: bool,
    count: call::Count,
}

impl Counter {
    /// A bar for `count` items of work named `what`.
    pub fn new(what: &'static str, count: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::hidden());
        let style = ProgressStyle::with_template("{bar:20} {pos} of {len} {msg}, {eta} left");
        Self {
            begin: Instant::now(),
            bar: bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            what,
            is_quiet: call::is_on(),
            count: call::Count::to_caller(),
        }
    }

    /// Adds items of work.
    pub fn expect(&self, count: u64) {
        self.bar.inc_length(count);
    }

    /// Counts a completed item.
    pub fn count(&self) {
        self.bar.inc(1);
        self.count
            .say(self.bar.position(), self.bar.length().unwrap_or(0));
        if !self.is_quiet && self.bar.is_hidden() && self.begin.elapsed() > PATIENCE {
            self.bar
                .set_draw_target(ProgressDrawTarget::stderr_with_hz(5));
            self.bar.set_message(self.what);
        }
    }

    /// Clears the bar.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
