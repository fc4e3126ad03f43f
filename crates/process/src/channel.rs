//! Requests and replies between two processes over shared memory.
//!
//! Each direction has room for one part of a message; longer messages are sent in parts. The waiting side first polls
//! the memory, since most replies arrive within a microsecond, and then sleeps until the other side wakes it (`futex`;
//! on systems without it, it keeps polling). Everything in the memory is an atomic, and no length in it is trusted: the
//! code on the other side may be hostile.

use crate::shared::{self, Name};
use memmap2::MmapRaw;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Capacity for one part [words of 8 bytes].
const WORDS: usize = 8192;
/// Maximum length of a message \[bytes\]: a serialized state of the largest size that `pilotage-fmi` accepts, 2 GiB,
/// and what is said of it.
const LONGEST: usize = (1 << 31) + (1 << 20);
/// How long the memory is polled before sleeping.
const LOOKING: Duration = Duration::from_micros(200);
/// Maximum sleep: after it the other side is checked.
const SLEEP: Duration = Duration::from_millis(2);

const EMPTY: u32 = 0;
const FULL: u32 = 1;

/// One direction.
#[repr(C, align(64))]
struct Way {
    /// [`EMPTY`] or [`FULL`].
    state: AtomicU32,
    /// Whether a process waits for the state to change.
    sleeper: AtomicU32,
    /// Remaining bytes of the message, including those of this part.
    left: AtomicU64,
    words: [AtomicU64; WORDS],
}

#[repr(C)]
struct Layout {
    ways: [Way; 2],
}

/// The memory has been overwritten and no longer holds a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spoiled;

/// One end of a channel.
#[derive(Debug)]
pub struct Channel {
    map: MmapRaw,
    /// The direction in which this end sends.
    own: usize,
}

impl Channel {
    /// Creates a channel: the end of the process that sends first, and the name by which the other process
    /// [opens](Self::open) its end.
    ///
    /// # Errors
    /// If there is no space for it.
    pub fn create() -> io::Result<(Self, Name)> {
        let (map, name) = shared::create(size_of::<Layout>())?;
        Ok((Self { map, own: 0 }, name))
    }

    /// Opens the other end.
    ///
    /// # Errors
    /// If there is no channel.
    pub fn open(path: &Path) -> io::Result<Self> {
        let map = shared::open(path, size_of::<Layout>())?;
        Ok(Self { map, own: 1 })
    }

    fn way(&self, number: usize) -> &Way {
        // SAFETY: the map has the length of a `Layout` and is aligned to a memory page, any bytes are valid atomics,
        // and it is shared only through atomics.
        unsafe { &(*self.map.as_ptr().cast::<Layout>()).ways[number] }
    }

    /// Sends a message. `watch` is called from time to time while this waits for the other side.
    ///
    /// # Errors
    /// Errors of `watch`, and [`Spoiled`].
    pub fn send<E: From<Spoiled>>(
        &self,
        message: &[u8],
        mut watch: impl FnMut() -> Result<(), E>,
    ) -> Result<(), E> {
        let way = self.way(self.own);
        let mut rest = message;
        loop {
            way.wait_until(EMPTY, &mut watch)?;
            let (part, next) = rest.split_at(rest.len().min(8 * WORDS));
            way.left.store(rest.len() as u64, Ordering::Relaxed);
            for (word, bytes) in way.words.iter().zip(part.chunks(8)) {
                let mut own = [0; 8];
                own[..bytes.len()].copy_from_slice(bytes);
                word.store(u64::from_le_bytes(own), Ordering::Relaxed);
            }
            way.set(FULL);
            rest = next;
            if rest.is_empty() {
                return Ok(());
            }
        }
    }

    /// Waits for a message, which replaces the contents of `message`. `watch` is called from time to time.
    ///
    /// # Errors
    /// Errors of `watch`, and [`Spoiled`].
    pub fn receive<E: From<Spoiled>>(
        &self,
        message: &mut Vec<u8>,
        mut watch: impl FnMut() -> Result<(), E>,
    ) -> Result<(), E> {
        let way = self.way(1 - self.own);
        message.clear();
        let mut expected = None;
        loop {
            way.wait_until(FULL, &mut watch)?;
            let left = usize::try_from(way.left.load(Ordering::Relaxed)).unwrap_or(usize::MAX);
            let part = left.min(8 * WORDS);
            let until = message.len() + part;
            for word in &way.words[..part.div_ceil(8)] {
                message.extend_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
            }
            message.truncate(until);
            way.set(EMPTY);
            let is_next = expected.is_none_or(|expected| left == expected);
            if left > LONGEST || !is_next {
                return Err(Spoiled.into());
            }
            if left == part {
                return Ok(());
            }
            expected = Some(left - part);
        }
    }
}

impl Way {
    fn set(&self, state: u32) {
        self.state.store(state, Ordering::SeqCst);
        if self.sleeper.load(Ordering::SeqCst) != 0 {
            wake(&self.state);
        }
    }

    #[inline]
    fn wait_until<E: From<Spoiled>>(
        &self,
        state: u32,
        watch: &mut impl FnMut() -> Result<(), E>,
    ) -> Result<(), E> {
        let other = if state == FULL { EMPTY } else { FULL };
        // An unknown state is final: neither side overwrites it.
        let found = || match self.state.load(Ordering::Acquire) {
            found if found == other => None,
            found if found == state => Some(Ok(())),
            _ => Some(Err(Spoiled.into())),
        };
        if let Some(found) = found() {
            return found;
        }
        let begun = Instant::now();
        loop {
            for _ in 0..64 {
                if let Some(found) = found() {
                    return found;
                }
                std::hint::spin_loop();
            }
            if begun.elapsed() < LOOKING {
                // With fewer processors than processes, the other side may need this one.
                std::thread::yield_now();
                continue;
            }
            if let Err(error) = watch() {
                // The other side may have written its last message and ended in the meantime.
                return found().unwrap_or(Err(error));
            }
            self.sleeper.store(1, Ordering::SeqCst);
            sleep(&self.state, other);
            self.sleeper.store(0, Ordering::SeqCst);
        }
    }
}

/// Sleeps for a limited time while the word has that value.
#[cfg(any(target_os = "linux", target_os = "android"))]
fn sleep(word: &AtomicU32, value: u32) {
    use rustix::thread::futex::{Flags, Timespec, wait};
    let limit = Timespec {
        tv_sec: 0,
        tv_nsec: i64::from(SLEEP.subsec_nanos()),
    };
    // The sleep may end early or not start at all: the caller checks the word again.
    let _ = wait(word, Flags::empty(), value, Some(&limit));
}

#[cfg(any(target_os = "linux", target_os = "android"))]
fn wake(word: &AtomicU32) {
    let _ = rustix::thread::futex::wake(word, rustix::thread::futex::Flags::empty(), 1);
}

#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn sleep(_word: &AtomicU32, _value: u32) {
    std::thread::sleep(SLEEP.min(Duration::from_micros(50)));
}

#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn wake(_word: &AtomicU32) {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    fn pair() -> (Channel, Channel) {
        let (first, name) = Channel::create().unwrap();
        (first, Channel::open(name.path()).unwrap())
    }

    #[derive(Debug, PartialEq)]
    enum Why {
        Spoiled,
        Stopped(&'static str),
    }

    impl From<Spoiled> for Why {
        fn from(_: Spoiled) -> Self {
            Self::Spoiled
        }
    }

    fn never() -> Result<(), Why> {
        Ok(())
    }

    #[test]
    fn messages_of_all_lengths_come_back() {
        let (first, second) = pair();
        let echo = thread::spawn(move || {
            let mut message = Vec::new();
            loop {
                second.receive(&mut message, never).unwrap();
                second.send(&message, never).unwrap();
                if message.is_empty() {
                    return;
                }
            }
        });
        let mut back = Vec::new();
        for length in [1, 7, 8, 9, 65_535, 65_536, 65_537, 300_001, 0] {
            let message: Vec<u8> = (0..length).map(|k| (k * 7 + k / 251) as u8).collect();
            first.send(&message, never).unwrap();
            first.receive(&mut back, never).unwrap();
            assert!(back == message, "{length}");
        }
        echo.join().unwrap();
    }

    #[test]
    fn whoever_waits_is_asked_whether_to_go_on() {
        let (first, _second) = pair();
        let mut asked = 0;
        let mut watch = || {
            asked += 1;
            if asked == 3 {
                Err(Why::Stopped("enough"))
            } else {
                Ok(())
            }
        };
        let received = first.receive(&mut Vec::new(), &mut watch);
        assert_eq!(received, Err(Why::Stopped("enough")));
        // There is room for one message that is not yet received.
        let waited = || Err(Why::Stopped("waited"));
        first.send(b"one", waited).unwrap();
        assert_eq!(first.send(b"two", waited), Err(Why::Stopped("waited")));
    }

    /// An impossible length, part of another message, or unknown state is an error, permanently for this channel.
    #[test]
    fn what_the_other_side_writes_is_not_believed() {
        let mut message = Vec::new();
        let (first, second) = pair();
        first.send(b"short", never).unwrap();
        first.way(0).left.store(u64::MAX, Ordering::Relaxed);
        assert_eq!(second.receive(&mut message, never), Err(Why::Spoiled));
        first.send(b"first", never).unwrap();
        first.way(0).left.store(70_000, Ordering::Relaxed);
        thread::scope(|scope| {
            let sent = scope.spawn(|| first.send(b"other", never));
            assert_eq!(second.receive(&mut message, never), Err(Why::Spoiled));
            sent.join().unwrap().unwrap();
        });
        first.way(0).state.store(u32::MAX, Ordering::Relaxed);
        for _ in 0..2 {
            assert_eq!(second.receive(&mut message, never), Err(Why::Spoiled));
            assert_eq!(first.send(b"more", never), Err(Why::Spoiled));
        }
    }

    #[test]
    fn other_files_are_no_channels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("channel");
        assert!(Channel::open(&path).is_err());
        std::fs::write(&path, "short").unwrap();
        let error = Channel::open(&path).unwrap_err().to_string();
        assert!(error.contains("channel: 5 bytes, expected"), "{error}");
    }
}
