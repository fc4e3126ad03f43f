//! The result of a fit.

pub mod beforehand;
mod begun;
pub(crate) mod changed;
pub mod courses;
pub mod delays;
pub mod describing;
pub mod diagnostic;
pub(crate) mod diagnostics;
pub mod events;
pub(crate) mod explained;
pub mod left_over;
pub mod loops;
mod opened;
pub(crate) mod other;
pub(crate) mod outliers;
pub mod paths;
pub mod recordings;
pub mod saturated;
pub mod through;
pub mod uncertainty;

use crate::innovations::{Ahead, Optimum, ahead};
use crate::posed::{Posed, Stands, poles, variables};
use crate::problem::file::{Noise, Per};
use crate::result::changed::Changed;
use crate::result::delays::DelayOrder;
use crate::result::diagnostic::Diagnostic;
use crate::result::events::Events;
use crate::result::saturated::{Saturated, saturated};
use crate::result::uncertainty::found::{Uncertainty, Unsure};
use crate::search::solved::{MET, Refinement, SAME, Solved};
use crate::system::part::About;
use pilotage_collocation::Collocation;
use pilotage_expression::Node;
use pilotage_inference::crossed::Crossed;
use pilotage_inference::residuals::Explained;
use pilotage_inference::spectrum::Describing;
use pilotage_sqp::{Kkt, Status};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Mean square of the residuals that counts as zero, relative to the variance of the samples or the noise.
const EXACT: f64 = 1e-6;
/// Negligible fraction of the variance of each value.
const NEGLIGIBLE: f64 = 1e-4;

/// Multiple of an objective from which on that of a simulation is of another motion.
pub(crate) const MUCH: f64 = 2.0;

/// Wall time of a fit \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seconds {
    /// Of reading the files and posing the problem.
    pub reading: f64,
    /// Of the search from all starts.
    pub search: f64,
    /// Of the solves on finer meshes.
    pub solve: f64,
    /// Of intervals, bands and tests.
    pub uncertainty: f64,
    /// Of simulations and all that is checked, before the search and after it.
    pub diagnostics: f64,
}

impl Seconds {
    /// Their sum.
    pub fn total(&self) -> f64 {
        self.reading + self.search + self.solve + self.uncertainty + self.diagnostics
    }
}

/// Seconds since the last call.
pub(crate) fn lap(clock: &mut Instant) -> f64 {
    let now = Instant::now();
    let lap = now.duration_since(*clock).as_secs_f64();
    *clock = now;
    lap
}

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// How the solve ended.
    pub status: Status,
    /// `Σ w ((y - h)/sd)²`, plus `Σ 2 ln sd` if noise levels are estimated, plus the priors.
    pub objective: f64,
    /// The objective of a simulation of the runs with the estimates. None if it failed.
    pub simulated_objective: Option<f64>,
    /// `Σ w ((y - h)/sd)²` alone.
    pub chi2: f64,
    /// Negative log-likelihood, including its constants.
    pub nllh: f64,
    /// Number of measured values.
    pub samples: usize,
    /// Estimated parameters, and those tied to them.
    pub parameters: Vec<Found>,
    /// Derived quantities of the file. If the instances form a loop, its figures at the end of the first run follow
    /// ([`pilotage_linear::LoopFigures::named`]).
    pub derived: Vec<Found>,
    /// The runs.
    pub runs: Vec<RunFit>,
    /// Number of solver iterations.
    pub iterations: usize,
    /// Last KKT residual of the solver.
    pub kkt: Kkt,
    /// Smallest scaled curvature of the objective at the solution. None if the solver did not compute it.
    pub curvature: Option<f64>,
    /// If the solve stalled at an optimum with kinks, with a larger KKT residual than its tolerance: the length of a
    /// Gauss–Newton step from there, in standard deviations over the square root of the number of unknowns.
    pub offset: Option<f64>,
    /// Poles of the system, linearised at the end of the first run \[1/s\].
    pub poles: Vec<[f64; 2]>,
    /// How the mesh was refined.
    pub refinement: Refinement,
    /// The order of delays without one, if there are any that are not exact.
    pub delays: Option<DelayOrder>,
    /// An objective that is zero up to the solver's tolerance.
    pub resolution: f64,
    /// How each start ended.
    pub starts: Vec<StartEnd>,
    /// Starts at other optima, with objectives of which the data do not tell which is better; one for each optimum.
    pub others: Vec<usize>,
    /// The outputs at whose wires the loops are opened for crossover and margins. Empty if there is no loop.
    pub cuts: Vec<String>,
    /// A change of a parameter along the runs, if it is significant.
    pub change: Option<Changed>,
    /// What ended the fit before all starts and refinements were completed.
    pub cut: Option<Status>,
    /// Events of FMUs in its runs.
    pub events: Events,
    /// Correlations of the residuals with the inputs. Empty if the equations are not satisfied.
    pub beside: Vec<Beside>,
    /// Reasons to doubt the result.
    pub diagnostics: Vec<Diagnostic>,
    /// Negligible difference of objectives.
    pub negligible: f64,
    /// Its wall time.
    pub seconds: Seconds,
    /// Uncertainty of the estimates.
    pub uncertainty: Result<Uncertainty, Unsure>,
    /// Outputs that saturate in the runs.
    pub saturated: Vec<Saturated>,
    /// Model-free estimates of pilot and loop from the runs.
    pub describing: Describing,
    /// The solution itself.
    pub solved: Option<Arc<Solved>>,
    /// The solution of the prediction-error fit, if noise drives the system.
    pub optimum: Option<Arc<Optimum>>,
    /// The expression that is not finite where the search begins, for a solve that ended with
    /// [`Status::UndefinedStart`].
    pub trouble: Option<String>,
}

/// How a start ended.
#[derive(Debug, Clone, PartialEq)]
pub struct StartEnd {
    /// Its status.
    pub status: Status,
    /// Its objective; NaN if its states are far from satisfying the equations.
    pub objective: f64,
    /// Iterations of its last solve.
    pub iterations: usize,
    /// Its scaled KKT residual. None if the fit was ended before it began.
    pub kkt: Option<f64>,
    /// Whether it ended at another optimum than the fit, of which the data do not tell which is better.
    pub is_elsewhere: bool,
    /// Its shared parameters with their names, in their units. Empty if it did not begin.
    pub parameters: Vec<(String, f64)>,
}

/// An estimated or derived parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its name.
    pub name: String,
    /// Name of its unit, if it has one.
    pub unit: Option<String>,
    /// Its value, or its values for each run or subject with their names.
    pub values: Vec<(Option<String>, f64)>,
    /// What it was sought separately for.
    pub per: Per,
    /// Whether it follows from other parameters.
    pub is_tied: bool,
    /// The bound of its range on which it lies.
    pub bound: Option<f64>,
}

impl Found {
    /// Its values with the parameter's name and, in brackets, the name of the run or subject.
    pub fn named(&self) -> impl Iterator<Item = (String, f64)> {
        let named = |(label, value): &(Option<String>, f64)| match label {
            Some(label) => (format!("{} ({label})", self.name), *value),
            None => (self.name.clone(), *value),
        };
        self.values.iter().map(named)
    }

    /// The mean of its values.
    pub fn mean(&self) -> f64 {
        let sum: f64 = self.values.iter().map(|(_, value)| value).sum();
        sum / self.values.len() as f64
    }

    /// Mean of its values for these runs or subjects, or of all values if it has none for them.
    pub fn mean_of(&self, labels: &[&String]) -> f64 {
        let is_own =
            |label: &Option<String>| label.as_ref().is_some_and(|own| labels.contains(&own));
        let own = self.values.iter().filter(|(label, _)| is_own(label));
        let own: Vec<f64> = own.map(|(_, value)| *value).collect();
        match own.len() {
            0 => self.mean(),
            count => own.iter().sum::<f64>() / count as f64,
        }
    }
}

/// A run of the fit.
#[derive(Debug, Clone)]
pub struct RunFit {
    /// Its name.
    pub name: String,
    /// Times of the samples \[s\].
    pub time: Vec<f64>,
    /// States, inputs and parameters of the joint model at the start of the run.
    pub begin: Vec<f64>,
    /// Trajectory of each state at the samples, in the coordinates of the models.
    pub states: Vec<Vec<f64>>,
    /// Model output for each sensor, in the unit of its signal.
    pub predicted: Vec<Vec<f64>>,
    /// Recorded values, in the same units.
    pub recorded: Vec<Vec<f64>>,
    /// Standard deviations of the noise.
    pub deviations: Vec<Vec<f64>>,
    /// One-step predictions, if noise drives the system. The fields above are then simulated without noise.
    pub ahead: Option<Ahead>,
}

impl RunFit {
    /// Residuals of a measured signal at each sample, in standard deviations. NaN where nothing was measured. If noise
    /// drives the system, they are the innovations.
    pub fn residuals(&self, k: usize, noise: Noise) -> Vec<f64> {
        if let Some(ahead) = &self.ahead {
            return ahead.innovations[k].clone();
        }
        let samples = self.recorded[k]
            .iter()
            .zip(&self.predicted[k])
            .zip(&self.deviations[k]);
        samples
            .map(|((y, h), sd)| noise.residual(*y, *h, *sd))
            .collect()
    }
}

impl RunFit {
    /// Root mean square error of the prediction of a measured signal from all earlier samples, in its unit. None if no
    /// noise drives the system.
    pub fn rms_ahead(&self, k: usize) -> Option<f64> {
        let ahead = self.ahead.as_ref()?;
        let pairs = self.recorded[k].iter().zip(&ahead.predicted[k]);
        let squares: Vec<f64> = pairs
            .filter(|(y, _)| y.is_finite())
            .map(|(y, h)| (y - h).powi(2))
            .collect();
        Some((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// Variance of a measured signal that the model explains.
    pub fn explained(&self, k: usize) -> Option<Explained> {
        Explained::of(&self.recorded[k], &self.predicted[k])
    }

    /// −2 log-likelihood of the recording. NaN if the model does not define it.
    pub fn surprise(&self, noises: &[Noise]) -> f64 {
        if let Some(ahead) = &self.ahead {
            return ahead.surprise();
        }
        let of = |k: usize| {
            let samples = self.recorded[k].iter().zip(&self.predicted[k]);
            let samples = samples.zip(&self.deviations[k]);
            let known = samples.filter(|((y, _), _)| y.is_finite());
            known.map(move |((y, h), sd)| noises[k].surprise(*y, *h, *sd))
        };
        (0..noises.len()).flat_map(of).sum()
    }
}

impl Fit {
    /// The runs of a problem at these variables.
    pub(crate) fn runs(posed: &Posed<'_>, problem: &Collocation, z: &[f64]) -> Vec<RunFit> {
        let theta = problem.physical_theta(z);
        let run = |j: usize| run_fit(posed, problem, j, &problem.states_at_samples(z, j), &theta);
        (0..posed.runs.len()).into_par_iter().map(run).collect()
    }

    /// Evaluates a solution.
    pub(crate) fn of(posed: &Posed<'_>, solved: &Solved) -> Self {
        let Solved { problem, solution } = solved;
        let z = &solution.iterate.z;
        let theta = problem.physical_theta(z);
        let states: Vec<Vec<Vec<f64>>> = (0..posed.runs.len())
            .map(|j| problem.states_at_samples(z, j))
            .collect();
        let run = |j: usize| run_fit(posed, problem, j, &states[j], &theta);
        let runs = (0..posed.runs.len()).into_par_iter().map(run);
        let runs: Vec<RunFit> = runs.collect();
        let (mut chi2, mut surprise, mut samples) = (0.0, 0.0, 0);
        for (j, run) in runs.iter().enumerate() {
            let weight = posed.data[j].line.weight;
            for k in 0..run.predicted.len() {
                let noise = posed.file.measured[k].noise;
                for ((y, h), sd) in run.recorded[k]
                    .iter()
                    .zip(&run.predicted[k])
                    .zip(&run.deviations[k])
                {
                    if y.is_finite() {
                        samples += 1;
                        chi2 += weight * noise.residual(*y, *h, *sd).powi(2);
                        surprise += weight * noise.surprise(*y, *h, *sd);
                    }
                }
            }
        }
        let objective = solution.iterate.f / posed.factor;
        Self {
            status: solution.status,
            objective,
            chi2,
            nllh: 0.5 * surprise,
            samples,
            parameters: parameters(posed, &states, &theta),
            derived: expressed(posed, &states, &theta, &posed.quantities.derived),
            iterations: solution.work.iterations,
            kkt: solution.kkt,
            curvature: solution.curvature,
            offset: None,
            poles: states[0].last().map_or_else(Vec::new, |x| {
                let poles = poles(posed, x, &theta);
                poles.iter().map(|pole| [pole.re, pole.im]).collect()
            }),
            runs,
            refinement: Refinement::new(solved),
            delays: None,
            resolution: EXACT * samples as f64 / posed.factor,
            starts: Vec::new(),
            others: Vec::new(),
            change: None,
            cut: None,
            cuts: Vec::new(),
            simulated_objective: None,
            events: Events::default(),
            beside: Vec::new(),
            diagnostics: Vec::new(),
            negligible: NEGLIGIBLE * samples as f64 / posed.factor,
            seconds: Seconds::default(),
            uncertainty: Err(Unsure::NotConverged),
            saturated: saturated(posed, problem, z),
            describing: Describing::default(),
            solved: None,
            optimum: None,
            trouble: None,
        }
    }

    /// The value of a parameter, or its mean over runs or subjects; `None` if nothing of this name was sought.
    pub fn value(&self, name: &str) -> Option<f64> {
        let mut all = self.parameters.iter();
        Some(all.find(|own| own.name == name)?.mean())
    }

    /// Whether the states satisfy the equations and the constraints hold. Otherwise objective and residuals do not
    /// belong to a run, or are not finite at the start.
    pub fn is_met(&self) -> bool {
        self.status == Status::Converged || self.kkt.primal <= MET
    }

    /// Whether the fit is complete: the solver converged, the fit was not ended early, no iteration limit ended the
    /// refinement of the mesh, the mesh is fine enough or a simulation with the estimates agrees, and no diagnostic makes it
    /// meaningless.
    pub fn is_answer(&self) -> bool {
        self.is_found() && self.fatal().is_none()
    }

    /// The first diagnostic that makes the result meaningless.
    fn fatal(&self) -> Option<&Diagnostic> {
        self.diagnostics.iter().find(|own| own.is_fatal())
    }

    fn is_found(&self) -> bool {
        let is_rough = |own: &Diagnostic| match own {
            Diagnostic::MeshError { .. } => true,
            Diagnostic::CoarseMesh(_) => self.is_another_motion(),
            _ => false,
        };
        let has_mesh = !self.diagnostics.iter().any(is_rough) || self.agrees();
        let is_limited = self.cut.is_some() || self.refinement.is_limited;
        self.status == Status::Converged && !is_limited && has_mesh
    }

    /// Whether a simulation with the estimates has the same objective, within a thousandth or within a hundredth of a
    /// standard deviation in each value.
    pub fn agrees(&self) -> bool {
        self.simulated_objective.is_some_and(|simulated| {
            (simulated - self.objective).abs() <= SAME * self.objective.abs() + self.negligible
        })
    }

    /// Whether the states of a given mesh follow another motion than that of the equations: a simulation with the estimates is
    /// farther from what was recorded than this part of its variation, or there is none.
    fn is_another_motion(&self) -> bool {
        const PART: f64 = 0.3;
        let variation = |run: &RunFit, k: usize| {
            let known = run.recorded[k].iter().zip(&run.deviations[k]);
            let known = known.filter(|(y, _)| y.is_finite());
            let scaled: Vec<f64> = known.map(|(y, sd)| y / sd).collect();
            let mean = scaled.iter().sum::<f64>() / scaled.len() as f64;
            scaled.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
        };
        let runs = self.runs.iter();
        let whole = runs.flat_map(|run| (0..run.recorded.len()).map(move |k| variation(run, k)));
        let most = PART * PART * whole.filter(|own| own.is_finite()).sum::<f64>();
        !self
            .simulated_objective
            .is_some_and(|own| own <= self.objective.abs() + most)
    }

    /// How the fit ended, in a word: the solver's status or a more severe one.
    pub fn ending(&self) -> &'static str {
        match (self.cut, self.status) {
            (Some(cut), _) => cut.as_str(),
            (None, Status::Converged) if self.refinement.is_limited => {
                Status::IterationLimit.as_str()
            }
            (None, Status::Converged) if !self.is_found() => "mesh-error",
            (None, status) => self.fatal().map_or(status.as_str(), |own| own.code()),
        }
    }

    /// Number of starts that were not begun when the fit was ended.
    pub fn skipped(&self) -> usize {
        self.starts.iter().filter(|own| own.kkt.is_none()).count()
    }

    /// Whether the connected system is stable.
    pub fn is_stable(&self) -> bool {
        !self.poles.is_empty() && self.poles.iter().all(|pole| pole[0] < 0.0)
    }

    /// Number of starts that ended at the best optimum. Each has its own mesh, so objectives may differ by twice the
    /// change of the best one by refinement.
    pub fn agreeing(&self) -> usize {
        let converged = self
            .starts
            .iter()
            .filter(|own| own.status == Status::Converged && !own.is_elsewhere);
        let objectives = converged.map(|own| own.objective);
        let best = objectives.clone().fold(f64::INFINITY, f64::min);
        let size = best.abs().max(self.resolution);
        let refined = 2.0 * (self.objective - best).abs();
        let near = refined.clamp(SAME * size, 10.0 * SAME * size);
        let is_near = |own: &f64| own - best <= near;
        objectives.filter(is_near).count()
    }

    /// How the fit ended, in a word or two.
    pub fn verdict(&self) -> String {
        match (self.is_answer(), self.diagnostics.len()) {
            (false, _) if self.is_found() || self.fatal().is_some() => {
                format!("NO ANSWER ({})", self.ending())
            }
            (false, _) => format!("NOT CONVERGED ({})", self.ending()),
            (true, 0) => "converged".to_owned(),
            (true, count) => format!("converged, in doubt ({count})"),
        }
    }
}

fn run_fit(
    posed: &Posed<'_>,
    problem: &Collocation,
    j: usize,
    states: &[Vec<f64>],
    theta: &[f64],
) -> RunFit {
    let quantities = &posed.quantities;
    let graph = &posed.model.system.graph;
    let count = posed.joint.model.states.len();
    let mut run = RunFit {
        name: posed.data[j].name(),
        time: (problem.runs[j].time.iter())
            .map(|time| time + posed.origins[j])
            .collect(),
        begin: Vec::new(),
        states: vec![Vec::new(); count],
        predicted: vec![Vec::new(); quantities.predicted.len()],
        recorded: quantities
            .recorded
            .iter()
            .map(|all| all[j].clone())
            .collect(),
        deviations: vec![Vec::new(); quantities.predicted.len()],
        ahead: ahead(posed, j, &states[0], theta),
    };
    for (sample, x) in states.iter().enumerate() {
        let values = graph.values(&variables(posed, j, sample, x, theta));
        if sample == 0 {
            let joint = quantities.joint.iter().skip(1);
            run.begin = joint.map(|node| values[node.index()]).collect();
        }
        for k in 0..quantities.predicted.len() {
            run.predicted[k].push(values[quantities.predicted[k].index()]);
            run.deviations[k].push(values[quantities.deviations[k].index()]);
        }
        for (k, own) in run.states.iter_mut().enumerate() {
            let shift = posed.states[k]
                .shift
                .map_or(0.0, |node| values[node.index()]);
            own.push(x[k] + shift);
        }
    }
    run
}

fn parameters(posed: &Posed<'_>, states: &[Vec<Vec<f64>>], theta: &[f64]) -> Vec<Found> {
    let mut all = Vec::new();
    for (unknown, stands) in &posed.unknowns {
        // The solver may violate a range by its tolerance.
        let found = |searched: f64| unknown.kept(unknown.found(searched));
        let values: Vec<(Option<String>, f64)> = match stands {
            Stands::Shared(k) => vec![(None, found(theta[*k]))],
            Stands::Subjects(subjects) => (subjects.iter())
                .map(|(subject, k)| (Some(subject.clone()), found(theta[*k])))
                .collect(),
            Stands::State(k) => (posed.seeking(*k))
                .map(|j| (Some(posed.data[j].name()), found(states[j][0][*k])))
                .collect(),
        };
        let range = [unknown.min, unknown.max];
        all.push(Found {
            name: unknown.name.clone(),
            unit: unknown.unit.clone(),
            bound: reached(
                range,
                &values,
                [unknown.start, unknown.nominal.unwrap_or(1.0)],
            ),
            values,
            per: unknown.per,
            is_tied: false,
        });
    }
    all.extend(expressed(posed, states, theta, &posed.quantities.tied));
    all
}

/// Values of expressions of parameters at the start of the runs.
fn expressed(
    posed: &Posed<'_>,
    states: &[Vec<Vec<f64>>],
    theta: &[f64],
    all: &[(String, Node)],
) -> Vec<Found> {
    let graph = &posed.model.system.graph;
    let of_runs: Vec<Vec<f64>> = (states.iter().enumerate())
        .map(|(j, states)| graph.values(&variables(posed, j, 0, &states[0], theta)))
        .collect();
    let found = |(name, node): &(String, Node)| {
        let values: Vec<f64> = of_runs.iter().map(|values| values[node.index()]).collect();
        let is_same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan());
        let is_one = values.windows(2).all(|pair| is_same(pair[0], pair[1]));
        let labelled = posed
            .data
            .iter()
            .zip(&values)
            .map(|(run, value)| (Some(run.name()), *value));
        let values = match is_one {
            true => vec![(None, values[0])],
            false => labelled.collect(),
        };
        let about = posed.joint.variables.get(name);
        let none = About::default();
        let about = about.unwrap_or(&none);
        let sizes = [about.start, about.nominal.unwrap_or(1.0)];
        Found {
            name: name.clone(),
            unit: posed.joint.unit(name).map(str::to_owned),
            bound: reached([about.min, about.max], &values, sizes),
            values,
            per: Per::All,
            is_tied: true,
        }
    };
    all.iter().map(found).collect()
}

/// The bound of a range on which one of these values lies, within the solver's tolerance for a parameter of the size of
/// its start value, or of its nominal value if it starts at 0.
fn reached(
    range: [Option<f64>; 2],
    values: &[(Option<String>, f64)],
    [start, nominal]: [f64; 2],
) -> Option<f64> {
    let size = if start == 0.0 { nominal } else { start.abs() };
    let is_near = |value: f64, end: f64| (value - end).abs() <= 1e-6 * end.abs().max(size);
    let is_reached = |end: &f64| values.iter().any(|(_, value)| is_near(*value, *end));
    range.into_iter().flatten().find(is_reached)
}

/// Residuals of a measured signal and a column that drives an input.
#[derive(Debug, Clone)]
pub struct Beside {
    /// The measured column.
    pub measured: String,
    /// The column that drives an input.
    pub input: String,
    /// Their cross-correlations.
    pub crossed: Crossed,
}
