//! Equations with kinks: derivatives that jump where states move, as at the ends of a dead zone or of a rate limit.
//!
//! At an optimum the KKT residual need not vanish on a mesh, since nodes change sides: an SQP then stalls with an objective
//! that no longer changes. Whether that is an optimum is judged by the relative offset ([`Inference::offset`]).

use crate::posed::Posed;
use crate::result::uncertainty::linearised;
use crate::search::solved::Solved;
use pilotage_inference::Inference;
use pilotage_sqp::{Iteration, Status};

/// Relative offset up to which a stalled solve has found an optimum of its mesh: a standard deviation. Bates & Watts
/// (Technometrics 23, 1981) take 1e-3 for smooth models; at kinks of a mesh it is 1e-2 to 1, since the derivatives there are
/// those of one side. A fit whose offset is not small says so.
const OFFSET: f64 = 1.0;

/// Violation of the scaled equations with which an objective is that of a run.
const FEASIBLE: f64 = 1e-6;

/// A solve stalls if its objective changes by less than this part in as many iterations.
const STALLED: f64 = 1e-8;
const ITERATIONS: usize = 15;

/// Watches for a solve that stalls.
#[derive(Debug, Default)]
pub(crate) struct Stall {
    objective: f64,
    iterations: usize,
}

impl Stall {
    /// Whether the solve has stalled with this iterate.
    pub fn is_seen(&mut self, at: &Iteration) -> bool {
        let change = (at.objective - self.objective).abs();
        let is_still = at.kkt.primal <= FEASIBLE && change <= STALLED * at.objective.abs();
        match is_still {
            true => self.iterations += 1,
            false => (self.objective, self.iterations) = (at.objective, 0),
        }
        self.iterations >= ITERATIONS
    }
}

/// The relative offset of a solve that ended without convergence at kinks; None if its states do not satisfy the equations, or
/// it cannot be told.
pub(crate) fn offset(posed: &Posed<'_>, solved: &Solved) -> Option<f64> {
    let is_met = solved.solution.kkt.primal <= FEASIBLE;
    let linear = linearised(posed, &solved.problem, &solved.solution.iterate).filter(|_| is_met)?;
    let inference = Inference::new(&linear.data).ok()?;
    Some(inference.offset()).filter(|offset| offset.is_finite())
}

/// Whether a solve without convergence has stalled at an optimum with kinks.
pub(crate) fn is_optimum(posed: &Posed<'_>, solved: &Solved) -> bool {
    let has_stalled = matches!(
        solved.solution.status,
        Status::NoProgress | Status::IterationLimit
    );
    has_stalled && posed.has_kinks() && offset(posed, solved).is_some_and(|offset| offset <= OFFSET)
}
