//! Threads that let slaves step at the same time.

use super::Ending;
use super::wired::Wired;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};
use std::thread::{JoinHandle, available_parallelism};

/// How often a thread looks for work before it lets others run, and before it sleeps: waking it costs as much
/// as some ten thousand looks.
const LOOKS: u32 = 2_000;
const LOOKS_IN_ALL: u32 = 10_000;

/// Threads that wait for steps by looking, and sleep only when none comes for long.
pub(super) struct ThreadPool {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// A round is one step of all slaves; who is free takes the next one.
struct Shared {
    round: AtomicUsize,
    slaves: AtomicPtr<Wired>,
    count: usize,
    /// Begin and length of the step, as bits.
    time: AtomicU64,
    step: AtomicU64,
    /// The next slave that nobody has taken, and how many are done.
    next: AtomicUsize,
    done: AtomicUsize,
    sleeping: AtomicUsize,
    is_over: AtomicBool,
    has_panicked: AtomicBool,
}

impl ThreadPool {
    /// For so many slaves: as many threads, this one included, as rayon would use (`RAYON_NUM_THREADS`), but
    /// no more than there are slaves or processors.
    pub(super) fn new(slaves: usize) -> Self {
        let processors = available_parallelism().map_or(1, usize::from);
        let threads = rayon::current_num_threads().min(processors).min(slaves);
        let shared = Arc::new(Shared {
            round: AtomicUsize::new(0),
            slaves: AtomicPtr::default(),
            count: slaves,
            time: AtomicU64::new(0),
            step: AtomicU64::new(0),
            next: AtomicUsize::new(slaves),
            done: AtomicUsize::new(0),
            sleeping: AtomicUsize::new(0),
            is_over: AtomicBool::new(false),
            has_panicked: AtomicBool::new(false),
        });
        let spawn = |_| {
            let shared = shared.clone();
            std::thread::spawn(move || shared.wait_and_work())
        };
        Self {
            threads: (1..threads).map(spawn).collect(),
            shared,
        }
    }

    /// Lets all slaves step from `t` by `h` [s]. Of several failures the first slave's is told, whichever
    /// came first.
    pub(super) fn step(&mut self, slaves: &mut [Wired], t: f64, h: f64) -> Result<(), Ending> {
        let shared = &*self.shared;
        assert_eq!(slaves.len(), shared.count, "the slaves of this pool");
        shared.slaves.store(slaves.as_mut_ptr(), Ordering::Relaxed);
        shared.time.store(t.to_bits(), Ordering::Relaxed);
        shared.step.store(h.to_bits(), Ordering::Relaxed);
        shared.done.store(0, Ordering::Relaxed);
        // Who takes a slave from here on sees all that was stored before.
        shared.next.store(0, Ordering::Release);
        shared.round.fetch_add(1, Ordering::SeqCst);
        if shared.sleeping.load(Ordering::SeqCst) > 0 {
            self.threads
                .iter()
                .for_each(|thread| thread.thread().unpark());
        }
        shared.work();
        let mut looks = 0;
        while shared.done.load(Ordering::Acquire) < shared.count {
            look_again(&mut looks);
        }
        assert!(
            !shared.has_panicked.load(Ordering::Relaxed),
            "a slave's step has panicked"
        );
        let mut ended = slaves.iter_mut().filter_map(|wired| wired.ended.take());
        ended.next().map_or(Ok(()), Err)
    }
}

impl Drop for ThreadPool {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::SeqCst);
        self.shared.round.fetch_add(1, Ordering::SeqCst);
        for thread in self.threads.drain(..) {
            thread.thread().unpark();
            // A panic has been told where it was waited for.
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Takes slaves that nobody has taken, until there are none.
    fn work(&self) {
        loop {
            let i = self.next.fetch_add(1, Ordering::AcqRel);
            if i >= self.count {
                return;
            }
            // SAFETY: `i` was given out once in this round, and the slaves are borrowed mutably by
            // `ThreadPool::step`, which waits until all `count` of them are done.
            let wired = unsafe { &mut *self.slaves.load(Ordering::Relaxed).add(i) };
            let t = f64::from_bits(self.time.load(Ordering::Relaxed));
            let h = f64::from_bits(self.step.load(Ordering::Relaxed));
            let step = AssertUnwindSafe(|| wired.ended = wired.step(t, h, false).err());
            if catch_unwind(step).is_err() {
                self.has_panicked.store(true, Ordering::Relaxed);
            }
            self.done.fetch_add(1, Ordering::Release);
        }
    }

    fn wait_and_work(&self) {
        let mut seen = 0;
        while !self.is_over.load(Ordering::SeqCst) {
            let mut looks = 0;
            while self.round.load(Ordering::SeqCst) == seen {
                if looks < LOOKS_IN_ALL {
                    look_again(&mut looks);
                    continue;
                }
                self.sleeping.fetch_add(1, Ordering::SeqCst);
                // A round that began before this was counted is seen here, one that begins later wakes.
                if self.round.load(Ordering::SeqCst) == seen {
                    std::thread::park();
                }
                self.sleeping.fetch_sub(1, Ordering::SeqCst);
            }
            seen = self.round.load(Ordering::SeqCst);
            self.work();
        }
    }
}

fn look_again(looks: &mut u32) {
    *looks += 1;
    match *looks < LOOKS {
        true => std::hint::spin_loop(),
        false => std::thread::yield_now(),
    }
}
