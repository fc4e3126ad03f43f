//! Progress reports during a run, and its end on Ctrl-C.

use super::super::{call, interrupt, terminal};
use crate::cosim::recorder::Signal;
use crate::cosim::{Clock, Recorder};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Format of the progress on stderr.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressFormat {
    /// A bar, for long runs on a terminal.
    #[default]
    Bar,
    /// One JSON object per line, about five times a second.
    Json,
    /// No progress.
    None,
}

/// Minimum time between two progress reports.
const BETWEEN: Duration = Duration::from_millis(200);
/// Runs shorter than this show no bar.
const PATIENCE: Duration = Duration::from_secs(2);

/// A recorder that reports progress and ends the run on Ctrl-C.
pub struct Watch<'r> {
    inner: &'r mut dyn Recorder,
    format: ProgressFormat,
    /// Made when it is shown first.
    bar: Option<ProgressBar>,
    begin: f64,
    duration: f64,
    rows: u64,
    started: Instant,
    last_report: Instant,
    pace: Pace,
    /// Number of rows at the end.
    steps: u64,
    count: call::Count,
    /// Ctrl-C.
    asked: &'static AtomicBool,
}

/// Number of rows between two readings of the clock, adapted so that reading it costs nothing and is yet done often
/// enough, whether a step takes nanoseconds or minutes.
struct Pace {
    stride: u64,
    wait: u64,
    last: Instant,
}

impl Pace {
    fn new(now: Instant) -> Self {
        Self {
            stride: 1,
            wait: 1,
            last: now,
        }
    }

    /// The current time, if the clock is due to be read.
    fn look(&mut self) -> Option<Instant> {
        self.wait -= 1;
        if self.wait > 0 {
            return None;
        }
        let now = Instant::now();
        let passed = now - self.last;
        self.last = now;
        self.stride = match passed < BETWEEN / 10 {
            true => (2 * self.stride).min(4096),
            false => (self.stride / 2).max(1),
        };
        self.wait = self.stride;
        Some(now)
    }
}

impl<'r> Watch<'r> {
    /// Creates the recorder and starts its clock.
    pub fn new(inner: &'r mut dyn Recorder, format: ProgressFormat, clock: &Clock) -> Self {
        let now = Instant::now();
        Self {
            inner,
            format,
            bar: None,
            begin: clock.start(),
            duration: clock.stop() - clock.start(),
            rows: 0,
            started: now,
            last_report: now,
            pace: Pace::new(now),
            steps: clock.steps(),
            count: call::Count::to_caller(),
            asked: interrupt::flag(),
        }
    }

    /// Time since the start.
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Clears the bar, or reports as JSON how the run ended, with the report if the run has begun.
    pub fn end(&mut self, status: &str, time: f64, report: Option<Value>) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
        self.say(time);
        self.print_json(status, time, report);
    }

    fn report_progress(&mut self, time: f64, now: Instant) {
        if now - self.last_report < BETWEEN {
            return;
        }
        self.last_report = now;
        self.say(time);
        self.print_json("running", time, None);
        let is_bar = self.format == ProgressFormat::Bar && !call::is_on();
        if is_bar && now - self.started > PATIENCE {
            self.show_bar(time);
        }
    }

    /// Tells the caller how many steps are done.
    fn say(&self, time: f64) {
        let part = (time - self.begin) / self.duration;
        let done = (part * self.steps as f64).round();
        self.count.say(done as u64, self.steps);
    }

    fn print_json(&self, status: &str, time: f64, report: Option<Value>) {
        if self.format == ProgressFormat::Json {
            let mut line = json!({
                "status": status,
                "time": time,
                "fraction": (time - self.begin) / self.duration,
                "rows": self.rows,
                "seconds": self.elapsed().as_secs_f64(),
            });
            if let Some(report) = report {
                line["report"] = report;
            }
            terminal::eprint(&format!("{line}\n"));
        }
    }

    /// indicatif itself shows nothing if stderr is no terminal.
    fn show_bar(&mut self, time: f64) {
        const LENGTH: f64 = 1000.0;
        let elapsed = self.elapsed();
        let bar = self.bar.get_or_insert_with(|| {
            let target = ProgressDrawTarget::stderr_with_hz(5);
            let style = ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left");
            ProgressBar::with_draw_target(Some(LENGTH as u64), target)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
                .with_elapsed(elapsed)
        });
        let position = LENGTH * (time - self.begin) / self.duration;
        bar.set_position(position as u64);
    }
}

impl Recorder for Watch<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.print_json("begin", self.begin, None);
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.rows += 1;
        if self.format != ProgressFormat::None
            && let Some(now) = self.pace.look()
        {
            self.report_progress(time, now);
        }
        self.inner.row(time, values)
    }

    fn end_rows(&mut self) -> io::Result<()> {
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }
}
