//! What speaks against taking a result at its word.

use crate::file::Mesh;
use crate::fit::{Refinement, Solved};
use crate::posed::Posed;
use crate::result::{Fit, Found};
use pilotage_sqp::Status;
use std::fmt;

/// What speaks against a result.
#[derive(Debug, Clone, PartialEq)]
pub enum Diagnostic {
    /// The solver did not converge.
    NotConverged(Status),
    /// A parameter lies on an end of its range.
    AtBound {
        /// Its name.
        name: String,
        /// The end.
        bound: f64,
    },
    /// The wired system grows \[1/s\].
    UnstableLoop(f64),
    /// The mesh could not be refined until its error is as small as was asked for.
    MeshError {
        /// The estimated relative error of the states.
        error: f64,
        /// What was asked for.
        tolerance: f64,
    },
    /// A simulation with what was found has another objective.
    Simulated {
        /// The objective of the collocation.
        objective: f64,
        /// That of the simulation; none where it does not come to an end.
        simulated: Option<f64>,
    },
    /// A limit or the user ended the fit before all starts and refinements were done.
    Cut {
        /// What ended it.
        status: Status,
        /// Starts that were not done.
        starts: usize,
        /// Whether the mesh was still to be refined.
        refinement: bool,
    },
    /// A start was better than what was found, and did not converge.
    LowerStart {
        /// Which, from 1.
        start: usize,
        /// How it ended.
        status: Status,
        /// Its objective.
        objective: f64,
    },
    /// The last refinement of the mesh still moved the parameters, by this part of their size.
    MeshMoves(f64),
    /// Of the starts that converged, one alone led here.
    Alone {
        /// How many converged.
        converged: usize,
    },
    /// Along some direction the objective is flat: the data do not tell all parameters apart.
    Flat(f64),
}

/// A pole that grows faster is unstable \[1/s\].
const GROWTH: f64 = 1e-6;
/// A change of parameters by a refinement that matters, relative to their size.
const MOVES: f64 = 1e-3;
/// Smallest scaled curvature that counts as one.
const FLAT: f64 = 1e-9;
/// Objectives that differ by less than this part are of one optimum.
pub const SAME: f64 = 1e-3;

impl Diagnostic {
    /// Its code, for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NotConverged(_) => "not-converged",
            Self::AtBound { .. } => "at-bound",
            Self::UnstableLoop(_) => "unstable-loop",
            Self::MeshError { .. } => "mesh-error",
            Self::MeshMoves(_) => "mesh-moves",
            Self::Simulated { .. } => "simulation",
            Self::Cut { .. } => "cut",
            Self::LowerStart { .. } => "lower-start",
            Self::Alone { .. } => "alone",
            Self::Flat(_) => "flat",
        }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConverged(status) => write!(
                f,
                "the solver ended with \"{status}\": this is its best iterate, not a result; try other start values, ranges \
                 (min, max) or more `starts`"
            ),
            Self::AtBound { name, bound } => write!(
                f,
                "`{name}` lies on the end {bound} of its range: widen the range, or fix the parameter"
            ),
            Self::UnstableLoop(pole) => write!(
                f,
                "the wired system, linearised where the first run ends, grows by {pole:.3} 1/s: if the recorded one did \
                 not, add [stability] with closed_loop = true"
            ),
            Self::MeshError { error, tolerance } => write!(
                f,
                "the states have an estimated relative error of {error:.1e} where {tolerance:.1e} was asked for"
            ),
            Self::MeshMoves(change) => write!(
                f,
                "the last refinement of the mesh still moved a parameter by {change:.1e} of its size: lower \
                 mesh_tolerance and compare"
            ),
            Self::Simulated {
                objective,
                simulated: Some(simulated),
            } => write!(
                f,
                "a simulation from the initial states that were found, with the parameters that were found, has the \
                 objective {simulated:.6e}, not {objective:.6e}: the mesh is too coarse, or the system is so unstable \
                 that small errors grow"
            ),
            Self::Simulated {
                simulated: None, ..
            } => write!(
                f,
                "a simulation with what was found does not come to an end: the mesh is too coarse, or the system is \
                 unstable"
            ),
            Self::Cut {
                status,
                starts,
                refinement,
            } => {
                let mesh = if *refinement {
                    " and the refinement of the mesh"
                } else {
                    ""
                };
                write!(
                    f,
                    "{status} ended the fit before {starts} starts{mesh} were done: what stands here is the best so far"
                )
            }
            Self::LowerStart {
                start,
                status,
                objective,
            } => write!(
                f,
                "start {start} came to the lower objective {objective:.6e} and did not converge ({status}): raise \
                 max_iterations, or begin near it"
            ),
            Self::Alone { converged } => write!(
                f,
                "of {converged} starts that converged, one alone led to this optimum: there may be better ones; raise \
                 `starts`"
            ),
            Self::Flat(curvature) => write!(
                f,
                "in some direction the objective is flat (scaled curvature {curvature:.1e}): the data do not tell all \
                 parameters apart; fix one, or give it a prior"
            ),
        }
    }
}

/// All that speaks against a result, the heaviest first.
pub(crate) fn diagnostics(posed: &Posed<'_>, solved: &Solved, fit: &Fit) -> Vec<Diagnostic> {
    let mut all = Vec::new();
    if let Some(status) = fit.cut {
        all.push(Diagnostic::Cut {
            status,
            starts: fit.starts.iter().filter(|own| own.0 == status).count(),
            refinement: !fit.refinement.is_done,
        });
    } else if fit.status != Status::Converged {
        all.push(Diagnostic::NotConverged(fit.status));
    }
    let growth = fit
        .poles
        .iter()
        .map(|pole| pole[0])
        .fold(f64::NEG_INFINITY, f64::max);
    if growth > GROWTH && !posed.file.system.connections.is_empty() {
        all.push(Diagnostic::UnstableLoop(growth));
    }
    let at_bound = |found: &Found| {
        found.bound.map(|bound| Diagnostic::AtBound {
            name: found.name.clone(),
            bound,
        })
    };
    all.extend(fit.parameters.iter().filter_map(at_bound));
    let curvature = solved.solution.curvature;
    all.extend(
        curvature
            .filter(|own| fit.status == Status::Converged && *own < FLAT)
            .map(Diagnostic::Flat),
    );
    all.extend(of_lower(fit));
    all.extend(of_starts(fit));
    all.extend(of_mesh(posed, &fit.refinement));
    let simulated = Diagnostic::Simulated {
        objective: fit.objective,
        simulated: fit.simulated_objective,
    };
    let is_known = fit.status == Status::Converged && fit.cut.is_none();
    all.extend((is_known && !fit.agrees()).then_some(simulated));
    all
}

fn of_lower(fit: &Fit) -> Option<Diagnostic> {
    let start = fit.lower?;
    let (status, objective) = fit.starts[start];
    Some(Diagnostic::LowerStart {
        start: start + 1,
        status,
        objective,
    })
}

fn of_starts(fit: &Fit) -> Option<Diagnostic> {
    let converged = || {
        fit.starts
            .iter()
            .filter(|(status, _)| *status == Status::Converged)
    };
    let best = converged()
        .map(|(_, own)| *own)
        .fold(f64::INFINITY, f64::min);
    let near =
        converged().filter(|(_, own)| own - best <= SAME * best.abs().max(f64::MIN_POSITIVE));
    let converged = converged().count();
    (near.count() == 1 && converged > 2).then_some(Diagnostic::Alone { converged })
}

fn of_mesh(posed: &Posed<'_>, refinement: &Refinement) -> Option<Diagnostic> {
    let Mesh::Tolerance(tolerance) = posed.file.options.mesh else {
        return None;
    };
    let error = refinement.error;
    let change = refinement.changes.iter().copied().fold(0.0, f64::max);
    if error > tolerance {
        return Some(Diagnostic::MeshError { error, tolerance });
    }
    (change > MOVES).then_some(Diagnostic::MeshMoves(change))
}
