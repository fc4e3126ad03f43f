//! Criterion for a solve to lose against another.

use super::multi_start::NEAR;
use super::result::AGREE;
use pilotage_sqp::Iteration;

/// Number of iterations within which a start must gain half of its distance from the best.
const RACE_WINDOW: usize = 10;
/// Number of iterations within which a start equal to the best must gain something, and the minimum relative gain.
const TIE_WINDOW: usize = 2;
pub(super) const TIE: f64 = 1e-5;
/// Relative difference below which two objectives are equal.
const ROUNDING: f64 = 1e-8;

/// Decides whether a start may still beat the best objective so far.
pub(super) struct Race {
    best: f64,
    window: Vec<f64>,
}

impl Race {
    /// A race against the best objective so far.
    pub(super) fn against(best: f64) -> Self {
        Self {
            best,
            window: Vec::new(),
        }
    }

    /// Whether the states are consistent and the objective is behind the best and hardly changes: it gained less than
    /// half of its distance over [`RACE_WINDOW`] iterations, or it reaches the best objective and gained nothing
    /// significant over [`TIE_WINDOW`].
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
