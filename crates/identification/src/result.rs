//! Results of a fit.

use super::{Diagnostic, Uncertainty};
use pilotage_flights::vehicle::ClosedLoop;
use pilotage_sqp::Status;

/// One run as the identified pilot flies it in the optimiser's solution.
#[derive(Debug, Clone, PartialEq)]
pub struct RunFit {
    /// Name of the trial.
    pub name: String,
    /// Node times \[s\].
    pub time: Vec<f64>,
    /// Target at the nodes \[m\].
    pub target: Vec<f64>,
    /// Model position at the nodes \[m\].
    pub position: Vec<f64>,
    /// Model stick at the nodes.
    pub stick: Vec<f64>,
    /// Recorded minus modelled, at the nodes; NaN where there is no sample.
    pub residual: Vec<f64>,
    /// States at the nodes: the vehicle's, then the pilot's; only the pilot's in a stick fit.
    pub states: Vec<Vec<f64>>,
}

impl RunFit {
    /// Time from the first node to the last \[s\].
    pub fn duration(&self) -> f64 {
        self.time[self.time.len() - 1] - self.time[0]
    }
}

/// Result of one start.
#[derive(Debug, Clone, PartialEq)]
pub struct StartReport {
    /// Number of the start, from 1, in order of execution.
    pub number: usize,
    /// How its solve ended.
    pub status: Status,
    /// Its objective.
    pub objective: f64,
    /// Lowest objective of its feasible iterates; `None` if there was none.
    pub feasible: Option<f64>,
    /// Its scaled KKT residual.
    pub kkt: f64,
    /// Its smallest scaled curvature: see [`Fit::curvature`].
    pub curvature: Option<f64>,
    /// Its SQP iterations.
    pub iterations: usize,
    /// Wall time \[s\].
    pub seconds: f64,
    /// Number of descents of the linearised problem that ended at this start; 1 if it has another origin.
    pub descents: usize,
}

/// Result of a fit, converged or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// θ, in the units of [`pilotage_models::pilot`].
    pub theta: Vec<f64>,
    /// Sum of squared residuals: \[m²\] for the response, \[1\] for the stick.
    pub objective: f64,
    /// Whether the scaled KKT residual reached the tolerance and the second-order condition holds.
    pub converged: bool,
    /// How the solve ended.
    pub status: Status,
    /// Scaled KKT residual of the returned iterate.
    pub kkt: f64,
    /// Its scaled constraint violation: above [`FEASIBLE`], its runs are not simulations of its pilot.
    pub violation: f64,
    /// Smallest eigenvalue of the reduced Hessian of the Lagrangian over the critical cone, scaled by that matrix's
    /// norm ([`pilotage_sqp::Curvature::smallest`]): nonnegative, up to rounding, at a local optimum. `None` if not
    /// computed, since the iterate is no KKT point.
    pub curvature: Option<f64>,
    /// Number of SQP iterations over all starts.
    pub iterations: usize,
    /// Number of unknowns of the NLP: the states of all nodes and θ.
    pub unknowns: usize,
    /// Wall time of the fit \[s\].
    pub seconds: f64,
    /// Result of each start, best first.
    pub starts: Vec<StartReport>,
    /// Number of all starts: those of [`Self::starts`], each with its descents, and the discarded descents.
    pub tried: usize,
    /// Number of starts that were not tried, since the observer stopped the fit.
    pub skipped: usize,
    /// The runs.
    pub runs: Vec<RunFit>,
    /// The linearised closed loop with the vehicle of the fit; `None` if the vehicle is not known.
    pub closed_loop: Option<ClosedLoop>,
    /// The objective without the bound on the closed loop, if the solution lies on it.
    pub unbounded: Option<f64>,
    /// Uncertainty; `None` if the fit did not converge, or if the data do not determine it.
    pub uncertainty: Option<Uncertainty>,
    /// Diagnostics, the most severe first.
    pub diagnostics: Vec<Diagnostic>,
}

/// Scaled constraint violation below which an iterate is feasible: its runs follow the equations.
pub const FEASIBLE: f64 = 1e-6;

/// Relative distance to the best objective within which starts agree.
pub const AGREE: f64 = 1e-3;

/// Whether two objectives count as equal.
pub(super) fn agree(objective: f64, best: f64) -> bool {
    (objective - best).abs() <= AGREE * best
}

impl Fit {
    /// Residuals of all runs; NaN where there is no sample.
    pub fn residuals(&self) -> impl Iterator<Item = &f64> {
        self.runs.iter().flat_map(|run| &run.residual)
    }

    /// Whether it converged and no diagnostic makes it meaningless.
    pub fn is_answer(&self) -> bool {
        self.converged && !self.diagnostics.iter().any(Diagnostic::is_fatal)
    }

    /// Whether the runs of the returned iterate fulfil the equations.
    pub fn is_feasible(&self) -> bool {
        self.violation <= FEASIBLE
    }

    /// Number of starts among [`Self::tried`] within 0.1 % of the best objective. If it is only one of several, there
    /// are other optima, and a better one may be missed.
    pub fn agreeing(&self) -> usize {
        let near = |start: &&StartReport| agree(start.objective, self.objective);
        let near = self.starts.iter().filter(near);
        near.map(|start| start.descents).sum()
    }
}
