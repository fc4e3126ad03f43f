//! What a fit gives, and the file that hands it on.

use super::{ClosedLoop, Diagnostic, Uncertainty};
use crate::spread::Spread;
use pilotage_models::Quadcopter;
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
    /// Recorded minus modelled, at the nodes; NaN where no sample is.
    pub residual: Vec<f64>,
    /// States at the nodes: the vehicle's, then the pilot's; the pilot's alone in a stick fit.
    pub states: Vec<Vec<f64>>,
}

impl RunFit {
    /// From the first node to the last \[s\].
    pub fn duration(&self) -> f64 {
        self.time[self.time.len() - 1] - self.time[0]
    }
}

/// What became of one start.
#[derive(Debug, Clone, PartialEq)]
pub struct StartReport {
    /// Which start, from 1, in the order in which they began.
    pub number: usize,
    /// How its solve ended.
    pub status: Status,
    /// Its objective.
    pub objective: f64,
    /// The least objective of its iterates that fulfil the constraints; none if there was none.
    pub feasible: Option<f64>,
    /// Its scaled KKT residual.
    pub kkt: f64,
    /// Its smallest scaled curvature: see [`Fit::curvature`].
    pub curvature: Option<f64>,
    /// Its SQP iterations.
    pub iterations: usize,
    /// Wall time that it took \[s\].
    pub seconds: f64,
    /// How many descents of the linearised problem ended where it began; 1 where it began elsewhere.
    pub descents: usize,
}

/// The outcome of a fit, converged or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// θ, in the units of [`pilotage_models::pilot`].
    pub theta: Vec<f64>,
    /// Sum of squared residuals: \[m²\] for the response, \[1\] for the stick.
    pub objective: f64,
    /// True when the scaled KKT residual reached the tolerance and the second-order condition holds.
    pub converged: bool,
    /// How the solve ended.
    pub status: Status,
    /// Scaled KKT residual of the returned iterate.
    pub kkt: f64,
    /// Its scaled violation of the constraints: above [`FEASIBLE`] its runs are no flights of its pilot.
    pub violation: f64,
    /// Smallest eigenvalue of the reduced Hessian of the Lagrangian over the critical cone, scaled by that
    /// matrix's norm ([`pilotage_sqp::Curvature::smallest`]): not negative, beyond rounding, at a local
    /// optimum. None where it was not looked at, since the iterate is no KKT point.
    pub curvature: Option<f64>,
    /// SQP iterations, over all starts.
    pub iterations: usize,
    /// Unknowns of the NLP: the states of all nodes and θ.
    pub unknowns: usize,
    /// Wall time of the fit \[s\].
    pub seconds: f64,
    /// What became of each start, best first.
    pub starts: Vec<StartReport>,
    /// All starts: those of [`Self::starts`], each with its descents, and the descents that were given up.
    pub tried: usize,
    /// Starts that were not tried, since the observer ended the fit.
    pub skipped: usize,
    /// The runs.
    pub runs: Vec<RunFit>,
    /// The linearised closed loop with the vehicle of the fit; none where nobody said which was flown.
    pub closed_loop: Option<ClosedLoop>,
    /// The objective without the bound on the closed loop, where the solution lies on it: what it costs.
    pub unbounded: Option<f64>,
    /// How sure it is; none where it did not converge, or where the data do not tell.
    pub uncertainty: Option<Uncertainty>,
    /// What speaks against taking it at its word, the gravest first.
    pub diagnostics: Vec<Diagnostic>,
}

/// Scaled violation of the constraints below which an iterate is a pilot that flies so.
pub const FEASIBLE: f64 = 1e-6;

/// Relative distance to the best objective within which starts agree.
pub const AGREE: f64 = 1e-3;

/// True when two objectives count as the same.
pub(super) fn agree(objective: f64, best: f64) -> bool {
    (objective - best).abs() <= AGREE * best
}

impl Fit {
    /// The residuals of all runs; NaN where no sample is.
    pub fn residuals(&self) -> impl Iterator<Item = &f64> {
        self.runs.iter().flat_map(|run| &run.residual)
    }

    /// True when it converged and no diagnostic makes it meaningless.
    pub fn is_answer(&self) -> bool {
        self.converged && !self.diagnostics.iter().any(Diagnostic::is_fatal)
    }

    /// True when the runs of the returned iterate fulfil the equations.
    pub fn is_feasible(&self) -> bool {
        self.violation <= FEASIBLE
    }

    /// How many of [`Self::tried`] ended within 0.1 % of the best objective among them. One alone of
    /// several is a warning: there are other optima, and one may be missed.
    pub fn agreeing(&self) -> usize {
        let near = |start: &&StartReport| agree(start.objective, self.objective);
        let near = self.starts.iter().filter(near);
        near.map(|start| start.descents).sum()
    }
}

/// The result file `pilot.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotFile {
    /// θ.
    pub theta: Vec<f64>,
    /// Limit on |y_p| that the fit used.
    pub stick_limit: f64,
    /// False marks the best iterate of a fit that did not converge.
    pub converged: bool,
    /// The vehicle of its closed loop; none where nobody said what was flown.
    pub vehicle: Option<Quadcopter>,
    /// How sure θ is; none where the file does not say it of all components.
    pub spread: Option<Spread>,
    /// What spoke against taking the fit at its word.
    pub diagnostics: Vec<PilotDiagnostic>,
}

/// A [`Diagnostic`] as a pilot file keeps it.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotDiagnostic {
    /// One word for scripts.
    pub code: String,
    /// For people.
    pub words: String,
    /// True when it makes the result meaningless.
    pub fatal: bool,
}
