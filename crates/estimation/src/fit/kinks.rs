//! Equations with kinks: derivatives that jump where states move, as at the ends of a dead zone or of a rate limit.
//!
//! At an optimum the KKT residual need not vanish on a mesh, since nodes change sides: an SQP then stalls with an objective
//! that no longer changes. Whether that is an optimum is judged by the relative offset ([`Inference::offset`]).

use crate::posed::Posed;
use crate::result::uncertainty::linearised;
use crate::search::solved::Solved;
use pilotage_inference::{Data, Inference};
use pilotage_sqp::Status;

/// Relative offset up to which a stalled solve has found an optimum of its mesh: a standard deviation. Bates & Watts
/// (Technometrics 23, 1981) take 1e-3 for smooth models; at kinks of a mesh it is 1e-2 to 1, since the derivatives there are
/// those of one side. A fit whose offset is not small says so.
const OFFSET: f64 = 1.0;

/// Violation of the scaled equations with which an objective is that of a run.
const FEASIBLE: f64 = 1e-6;

/// The relative offset of a least-squares problem; None if it cannot be told.
pub(crate) fn offset(data: &Data) -> Option<f64> {
    let inference = Inference::new(data).ok()?;
    // Where a parameter has no effect, nothing leads away.
    let is_seen = !inference.flat.contains(&true);
    Some(inference.offset()).filter(|offset| is_seen && offset.is_finite())
}

/// Whether a solve has stalled at an optimum with kinks.
pub(crate) fn is_optimum(posed: &Posed<'_>, solved: &Solved) -> bool {
    let solution = &solved.solution;
    let has_stalled = solution.status == Status::NoProgress && solution.kkt.primal <= FEASIBLE;
    if !has_stalled || !posed.may_have_kinks() {
        return false;
    }
    let linear = linearised(posed, &solved.problem, &solution.iterate);
    let offset = linear.and_then(|own| offset(&own.data));
    offset.is_some_and(|offset| offset <= OFFSET)
}
