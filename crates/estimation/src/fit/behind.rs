//! Whether a solve may still beat the best objective so far.

use crate::search::solved::SAME;
use pilotage_sqp::Iteration;

/// Number of iterations within which a solve must gain half of its distance from the best.
const WINDOW: usize = 10;

/// Number of iterations within which a solve that equals the best must gain something, and the least relative gain.
const TIE_WINDOW: usize = 2;
const TIE: f64 = 1e-5;

/// Scaled violation up to which the objective of states is that of a run, or nearly so.
const NEAR: f64 = 1e-2;
const MET: f64 = 1e-4;

/// Relative difference below which objectives are equal.
const ROUNDING: f64 = 1e-8;

/// A solve that is compared with the best objective so far.
pub(super) struct Behind {
    best: f64,
    objectives: Vec<f64>,
}

impl Behind {
    /// Compared with this objective, if there is one.
    pub fn new(best: Option<f64>) -> Self {
        Self {
            best: best.unwrap_or(f64::INFINITY),
            objectives: Vec::new(),
        }
    }

    /// Whether the states nearly satisfy the equations, and the objective hardly changes: it is behind and approaches the best
    /// too slowly, or is the same.
    pub fn is_lost(&mut self, iteration: &Iteration) -> bool {
        let (f, violation) = (iteration.objective, iteration.kkt.primal);
        self.objectives.push(f);
        let gained = |window: usize| {
            let earlier = self.objectives.len().checked_sub(window + 1);
            earlier.map_or(f64::INFINITY, |k| (self.objectives[k] - f).abs())
        };
        let (behind, size) = (f - self.best, self.best.abs());
        match behind > SAME * size {
            _ if self.best.is_infinite() => false,
            true => violation < NEAR && gained(WINDOW) < 0.5 * behind,
            false => {
                violation < MET && behind > -ROUNDING * size && gained(TIE_WINDOW) < TIE * size
            }
        }
    }
}
