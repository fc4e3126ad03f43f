//! Parallel work on all runs. Each run writes only to its own data, and sums over runs are computed afterwards in their
//! order, so results are bitwise identical for any number of threads.

use rayon::prelude::*;
use std::io;
use std::ops::Range;

/// Starts the threads for parallel work, of which there are as many as `RAYON_NUM_THREADS` says. Otherwise the first
/// parallel work starts them, and panics where it cannot.
///
/// # Errors
/// If the system gives no thread.
pub fn start_threads() -> io::Result<()> {
    let started = rayon::ThreadPoolBuilder::new().build_global();
    started.map_err(io::Error::other)
}

/// Number of threads that the user wants work to be done on (RAYON_NUM_THREADS).
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Calls `work(index, item)` for every item, in parallel if there is more than one thread.
pub fn each<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    if items.len() > 1 && rayon::current_num_threads() > 1 {
        items
            .par_iter_mut()
            .enumerate()
            .for_each(|(i, item)| work(i, item));
    } else {
        items
            .iter_mut()
            .enumerate()
            .for_each(|(i, item)| work(i, item));
    }
}

/// Splits a slice at consecutive ranges.
pub fn parts<'a>(
    mut rest: &'a mut [f64],
    ranges: impl Iterator<Item = Range<usize>> + 'a,
) -> impl Iterator<Item = &'a mut [f64]> {
    ranges.map(move |range| {
        let (part, tail) = std::mem::take(&mut rest).split_at_mut(range.len());
        rest = tail;
        part
    })
}
