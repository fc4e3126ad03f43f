//! When a solve loses against another.

use super::multi_start::NEAR;
use super::result::AGREE;
use pilotage_sqp::Iteration;

/// Iterations over which a start must gain half of what it lies behind.
const RACE_WINDOW: usize = 10;
/// Iterations over which a start beside the best must gain something, and the relative gain that counts.
const TIE_WINDOW: usize = 2;
pub(super) const TIE: f64 = 1e-5;
/// Relative difference below which two objectives are equal.
const ROUNDING: f64 = 1e-8;

/// Whether a start still may beat the best so far.
pub(super) struct Race {
    best: f64,
    window: Vec<f64>,
}

impl Race {
    /// Against the best objective so far.
    pub(super) fn against(best: f64) -> Self {
        Self {
            best,
            window: Vec::new(),
        }
    }

    /// True when the states are consistent and the objective is behind the best and hardly moves: it
    /// gained less than half of what is left over [`RACE_WINDOW`] iterations, or nothing that counts
    /// over [`TIE_WINDOW`] and ends where the best is.
    pub(super) fn is_lost(&mut self, iteration: &Iteration) -> bool {
        let f = iteration.objective;
        self.window.push(f);
        let gained = |window: usize| {
            let earlier = self.window.len().checked_sub(window + 1);
            earlier.map_or(f64::INFINITY, |k| (self.window[k] - f).abs())
        };
        let behind = f - self.best;
        match behind > AGREE * self.best {
            true => iteration.kkt.primal < NEAR && gained(RACE_WINDOW) < 0.5 * behind,
            false => {
                iteration.kkt.primal < 1e-4
                    && behind > -ROUNDING * self.best
                    && gained(TIE_WINDOW) < TIE * self.best
            }
        }
    }
}
