//! Timing of component calls, sampled from a few steps, so that the overhead is negligible.

use super::wired::Wired;
use std::time::{Duration, Instant};

/// Maximum part of the run time spent on reading the clock.
const PART: f64 = 0.01;

/// Maximum distance between timed steps.
const FURTHEST: u64 = 1024;

/// Time that a component spends in calls in the timed steps.
#[derive(Debug, Default)]
pub(super) struct Stopwatch {
    is_running: bool,
    calls: u32,
    step: Duration,
    /// Estimated time in all calls so far [s].
    pub(super) seconds: f64,
}

impl Stopwatch {
    /// Makes a call, timed if the stopwatch is running.
    #[inline(always)]
    pub(super) fn time<T>(&mut self, call: impl FnOnce() -> T) -> T {
        let started = self.is_running.then(now);
        let result = call();
        if let Some(started) = started {
            self.add(started);
        }
        result
    }

    #[cold]
    #[inline(never)]
    fn add(&mut self, started: Instant) {
        self.step += started.elapsed();
        self.calls += 1;
    }
}

/// Not inlined, like `add`, to keep untimed calls fast.
#[cold]
#[inline(never)]
fn now() -> Instant {
    Instant::now()
}

/// Chooses the timed steps: all steps while timing is cheap, otherwise few enough that it remains cheap.
#[derive(Debug)]
pub(super) struct Sampler {
    /// Times every step, at any cost.
    is_complete: bool,
    stride: u64,
    wait: u64,
    /// Time to read the clock twice, contained in each timed call.
    reading: Duration,
    started: Instant,
    /// Number of timed steps, and of steps that they represent.
    pub(super) timed: u64,
    covered: u64,
}

impl Sampler {
    pub(super) fn new(is_complete: bool) -> Self {
        let reading = || {
            let started = Instant::now();
            started.elapsed()
        };
        Self {
            is_complete,
            stride: 1,
            wait: 1,
            reading: (0..16).map(|_| reading()).min().unwrap_or_default(),
            started: Instant::now(),
            timed: 0,
            covered: 0,
        }
    }

    /// Whether the next step is timed; called before each step.
    #[inline]
    pub(super) fn is_due(&mut self) -> bool {
        self.wait -= 1;
        self.wait == 0
    }

    /// Starts timing a step.
    #[cold]
    pub(super) fn begin(&mut self, wired: &mut [Wired]) -> Instant {
        wired.iter_mut().for_each(|w| w.watch.is_running = true);
        Instant::now()
    }

    /// Ends timing; the calls' times represent all steps since the last timed one.
    #[cold]
    pub(super) fn end(&mut self, begun: Instant, wired: &mut [Wired]) {
        let step = begun.elapsed();
        let mut looking = self.reading;
        for watch in wired.iter_mut().map(|w| &mut w.watch) {
            let reading = self.reading * watch.calls;
            let own = watch.step.saturating_sub(reading);
            watch.seconds += own.as_secs_f64() * self.stride as f64;
            looking += 2 * reading;
            *watch = Stopwatch {
                seconds: watch.seconds,
                ..Stopwatch::default()
            };
        }
        self.timed += 1;
        self.covered += self.stride;
        if !self.is_complete {
            let rest = step.saturating_sub(looking).as_secs_f64();
            let stride = looking.as_secs_f64() / (PART * rest);
            self.stride = (stride.ceil() as u64).clamp(1, FURTHEST);
        }
        self.wait = self.stride;
    }

    /// Factor for the components' times after this many steps of the clock.
    pub(super) fn scale(&self, steps: u64) -> f64 {
        match self.covered {
            0 => 0.0,
            covered => steps as f64 / covered as f64,
        }
    }

    /// Time since the start of the stepping loop [s].
    pub(super) fn elapsed(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}
