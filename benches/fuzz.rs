//! Mutated descriptions and archives, for a given time:
//!
//!     cargo bench --bench fuzz -- --seconds 600 [--seed N]
//!
//! An input that panics, or that takes longer than a second, is written to `target/fuzz/` and ends the run with an
//! error. The permanent corpus is `tests/corpus/`.

#[path = "../tests/it/mutation.rs"]
mod mutation;

use mutation::{Depth, Mutator};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

/// Maximum processor time of an input.
const LIMIT: Duration = Duration::from_secs(1);

fn argument(name: &str) -> Option<u64> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.nth(1).map(|value| value.parse().unwrap())
}

fn main() {
    let seconds = argument("--seconds").unwrap_or(10);
    let seed = argument("--seed").unwrap_or(1);
    let corpus = mutation::corpus();
    let folder = tempfile::tempdir().unwrap();
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(seed));
    let mut depths: BTreeMap<(&str, Depth), u64> = BTreeMap::new();
    let (begun, mut slowest) = (Instant::now(), Duration::ZERO);
    for k in 0.. {
        if begun.elapsed() > Duration::from_secs(seconds) {
            break;
        }
        let (_, bytes) = &corpus[k % corpus.len()];
        let (_, other) = &corpus[(k / corpus.len()) % corpus.len()];
        let mut bytes = bytes.clone();
        // Archives are slower, since files are written.
        let kind = if k % 10 == 0 {
            "archive"
        } else {
            "description"
        };
        if kind == "archive" {
            bytes = mutation::archive_of(&bytes);
            match k % 20 {
                0 => mutator.mutate(&mut bytes, &mutation::archive_of(other)),
                _ => mutator.mutate_archive(&mut bytes),
            }
        } else {
            mutator.mutate(&mut bytes, other);
        }
        let started = processor_time();
        let depth = catch_unwind(AssertUnwindSafe(|| match kind {
            "archive" => mutation::try_archive(&bytes, folder.path()),
            _ => mutation::try_description(&bytes),
        }));
        let taken = processor_time() - started;
        slowest = slowest.max(taken);
        let Ok(depth) = depth else {
            keep(&bytes, kind, "panicked");
        };
        if taken > LIMIT {
            keep(&bytes, kind, "took too long");
        }
        *depths.entry((kind, depth)).or_default() += 1;
    }
    for ((kind, depth), count) in depths {
        println!("{count:>10} {kind}s {depth:?}");
    }
    println!("{:.0?} in all, the slowest {slowest:.1?}", begun.elapsed());
}

/// Processor time of this program, which other load does not affect.
#[cfg(unix)]
fn processor_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// On other systems, the wall time.
#[cfg(not(unix))]
fn processor_time() -> Duration {
    static BEGUN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed()
}

/// Writes an input that revealed a fault, and exits.
fn keep(bytes: &[u8], kind: &str, what: &str) -> ! {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/fuzz");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(kind);
    std::fs::write(&path, bytes).unwrap();
    eprintln!("an input {what}: {}", path.display());
    std::process::exit(1);
}
