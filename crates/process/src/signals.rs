//! Signals, handled by a thread.
//!
//! The signal handler only increments a counter, which the thread polls: there is no pipe between them that foreign
//! code in this process could close.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

/// Polling interval.
const BETWEEN: Duration = Duration::from_millis(10);

/// From now on `heard` is called in a separate thread for each of these signals that arrives, and before that, in the
/// handler itself, `at_once`. A signal that is ignored, e.g. by `nohup`, stays ignored.
///
/// # Safety
/// `at_once` must be async-signal-safe: no allocation, no locks.
///
/// # Errors
/// If the signal handlers cannot be registered.
pub(crate) unsafe fn listen_at_once(
    signals: &[i32],
    at_once: fn(i32),
    mut heard: impl FnMut(i32) + Send + 'static,
) -> io::Result<()> {
    let ignored = ignored();
    let mut counts = Vec::new();
    for &signal in signals {
        if ignored & (1 << (signal - 1)) != 0 {
            continue;
        }
        let count = Arc::new(AtomicU32::new(0));
        let counter = Arc::clone(&count);
        let came = move || {
            at_once(signal);
            counter.fetch_add(1, Ordering::Relaxed);
        };
        // SAFETY: the handler only increments an atomic and calls `at_once`, for which the caller vouches.
        unsafe { signal_hook::low_level::register(signal, came) }?;
        counts.push((signal, count));
    }
    if counts.is_empty() {
        return Ok(());
    }
    let listens = move || {
        loop {
            for (signal, count) in &counts {
                for _ in 0..count.swap(0, Ordering::Relaxed) {
                    heard(*signal);
                }
            }
            thread::sleep(BETWEEN);
        }
    };
    let name = "signals".to_owned();
    thread::Builder::new().name(name).spawn(listens).map(drop)
}

/// From now on `heard` is called in a separate thread for each of these signals that arrives. A signal that is ignored,
/// e.g. by `nohup`, stays ignored.
///
/// # Errors
/// If the signal handlers cannot be registered.
pub fn listen(signals: &[i32], heard: impl FnMut(i32) + Send + 'static) -> io::Result<()> {
    // SAFETY: `at_once` does nothing.
    unsafe { listen_at_once(signals, |_| {}, heard) }
}

/// Ignored signals as a bit mask, bit 0 for signal 1; 0 if the system does not report them.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    line.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn each_signal_is_heard_with_its_number() {
        use signal_hook::consts::{SIGUSR1, SIGUSR2};
        let (sender, receiver) = mpsc::channel();
        listen(&[SIGUSR1, SIGUSR2], move |signal| {
            let _ = sender.send(signal);
        })
        .unwrap();
        for signal in [SIGUSR2, SIGUSR1, SIGUSR2] {
            signal_hook::low_level::raise(signal).unwrap();
            assert_eq!(receiver.recv_timeout(Duration::from_secs(60)), Ok(signal));
        }
    }
}
