//! Where the tail of a distribution of changes ends, and what is none of it begins.
//!
//! Of n independent magnitudes with the tail x^-α, the k-th largest exceeds r times the next one with probability r^-kα (A. Rényi,
//! "On the theory of order statistics", Acta Math. Acad. Sci. Hung. 4, 1953), and α is estimated from those below (B. M. Hill, "A
//! simple general approach to inference about the tail of a distribution", Ann. Stat. 3, 1975). So a large change among people's
//! own is none, if these have long tails.

use super::Values;

/// Probability of a gap.
const CHANCE: f64 = 0.001;
/// Smallest gap, however many changes are above it.
const LEAST: f64 = 1.5;
/// Part of the changes, and least number of them, below a gap that tell how long the tail is.
const TAIL: f64 = 0.05;
const FEWEST: usize = 10;
/// Above it is at most one change in this number.
const FEWER: usize = 2;

/// The size from which on changes between samples are beyond the tail of the others; infinite if none is.
pub fn end(runs: &[Values]) -> f64 {
    let of_run = |own: &Values| {
        let known: Vec<f64> = own
            .values
            .iter()
            .copied()
            .filter(|own| own.is_finite())
            .collect();
        known
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .collect::<Vec<_>>()
    };
    let mut all: Vec<f64> = runs.iter().flat_map(of_run).collect();
    all.sort_by(|a, b| b.total_cmp(a));
    let tail = FEWEST.max((TAIL * all.len() as f64) as usize);
    let mut sums = vec![0.0];
    for change in &all {
        sums.push(sums[sums.len() - 1] + change.ln());
    }
    let is_gap = |&k: &usize| {
        let last = all[k + tail];
        // Changes that are mostly 0 have no tail.
        let long = match last > 0.0 {
            true => (sums[k + tail] - sums[k]) / tail as f64 - last.ln(),
            false => 0.0,
        };
        // An outlier makes two changes.
        let ratio = CHANCE.powf(-long / k.div_ceil(2) as f64);
        all[k - 1] > ratio.max(LEAST) * all[k]
    };
    let most = (all.len() / FEWER).min(all.len().saturating_sub(tail + 1));
    let beyond = (1..=most).rev().find(is_gap);
    beyond.map_or(f64::INFINITY, |k| 0.5 * (all[k - 1] + all[k]))
}
