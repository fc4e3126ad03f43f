//! Whether a solve that makes no progress has found an optimum, judged by the relative offset ([`Inference::offset`]).
//!
//! Where derivatives jump as states move, as at the ends of a dead zone or of a rate limit, the KKT residual need not vanish at an
//! optimum of a mesh, since nodes change sides. Without kinks a solve stalls where a parameter grows without end, such as a pole
//! that is faster than any sample shows: the rest of the model no longer changes.

use crate::posed::Posed;
use crate::result::uncertainty::linearised;
use crate::search::solved::Solved;
use pilotage_inference::{Data, Inference};
use pilotage_sqp::{ACCEPTABLE, Status};

/// Relative offset up to which a stalled solve of a smooth model has found an optimum (Bates & Watts, Technometrics 23, 1981).
const OFFSET: f64 = 1e-3;

/// The same with kinks, a standard deviation: it is 1e-2 to 1 there, since derivatives are those of one side. A fit whose offset
/// is not small says so.
const OFFSET_AT_KINKS: f64 = 1.0;

/// Violation of the scaled equations with which an objective is that of a run.
const FEASIBLE: f64 = 1e-6;

/// The relative offset of a least-squares problem with kinks; None if it cannot be told.
pub(crate) fn offset(data: &Data) -> Option<f64> {
    let inference = Inference::new(data).ok()?;
    // Where a parameter has no effect, nothing leads away.
    let is_seen = !inference.flat.contains(&true);
    Some(inference.offset()).filter(|offset| is_seen && offset.is_finite())
}

/// Whether a solve has stalled at an optimum.
pub(crate) fn is_optimum(posed: &Posed<'_>, solved: &Solved) -> bool {
    let solution = &solved.solution;
    if solution.status != Status::NoProgress || solution.kkt.primal > FEASIBLE {
        return false;
    }
    if solution.kkt.residual() <= ACCEPTABLE * posed.file.options.tolerance {
        return true;
    }
    let Some(linear) = linearised(posed, &solved.problem, &solution.iterate) else {
        return false;
    };
    match posed.may_have_kinks() {
        true => offset(&linear.data).is_some_and(|own| own <= OFFSET_AT_KINKS),
        false => Inference::new(&linear.data).is_ok_and(|own| own.offset() <= OFFSET),
    }
}
