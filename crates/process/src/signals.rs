//! Signals, heard by a thread.
//!
//! The handler counts and nothing else, and the thread looks at the count: there is no pipe between them that foreign code
//! in this process could close.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

/// Between two looks.
const BETWEEN: Duration = Duration::from_millis(10);

/// From now on `heard` is called in a separate thread with each of these signals that arrives, and before that, in the
/// handler itself, `at_once`. One that is ignored, as `nohup` does, stays ignored.
///
/// # Safety
/// `at_once` does nothing that a handler may not, such as allocate or lock.
///
/// # Errors
/// When the system does not let it listen.
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
        // SAFETY: the handler does nothing but add to an atomic and what the caller vouches for.
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

/// From now on `heard` is called in a separate thread with each of these signals that arrives. One that is ignored, as
/// `nohup` does, stays ignored.
///
/// # Errors
/// When the system does not let it listen.
pub fn listen(signals: &[i32], heard: impl FnMut(i32) + Send + 'static) -> io::Result<()> {
    // SAFETY: nothing is done.
    unsafe { listen_at_once(signals, |_| {}, heard) }
}

/// Which signals are ignored, a bit for each from 1 on; none where the system does not tell.
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
        let (tell, told) = mpsc::channel();
        listen(&[SIGUSR1, SIGUSR2], move |signal| {
            let _ = tell.send(signal);
        })
        .unwrap();
        for signal in [SIGUSR2, SIGUSR1, SIGUSR2] {
            signal_hook::low_level::raise(signal).unwrap();
            assert_eq!(told.recv_timeout(Duration::from_secs(60)), Ok(signal));
        }
    }
}
