//! What a fit has found.

pub mod beforehand;
mod begun;
pub mod describing;
pub mod diagnostic;
pub(crate) mod diagnostics;
pub mod events;
pub mod left_over;
pub mod loops;
mod opened;
pub(crate) mod outliers;
pub mod paths;
pub mod uncertainty;

use crate::innovations::{Ahead, Optimum, ahead};
use crate::posed::{Posed, Stands, poles, variables};
use crate::problem::file::Noise;
use crate::result::diagnostic::Diagnostic;
use crate::result::events::Events;
use crate::result::uncertainty::found::{Uncertainty, Unsure};
use crate::search::solved::{MET, Refinement, SAME, Solved};
use crate::system::part::About;
use pilotage_collocation::Collocation;
use pilotage_expression::Node;
use pilotage_inference::crossed::Crossed;
use pilotage_inference::residuals::Explained;
use pilotage_inference::spectrum::Describing;
use pilotage_sqp::{Kkt, Status};
use std::sync::Arc;

/// A mean square of the residuals that is none, per variance of the samples or the noise.
const EXACT: f64 = 1e-6;
/// A part of the variance of each value that is of no importance.
const NEGLIGIBLE: f64 = 1e-4;

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// How the solve ended.
    pub status: Status,
    /// `Σ w ((y - h)/sd)²`, with `Σ 2 ln sd` where noise levels are estimated, and what is known beforehand.
    pub objective: f64,
    /// The same where the runs are simulated with what was found; none where that was not possible.
    pub simulated_objective: Option<f64>,
    /// `Σ w ((y - h)/sd)²` alone.
    pub chi2: f64,
    /// Negative logarithm of the likelihood, with its constants.
    pub nllh: f64,
    /// Measured values.
    pub samples: usize,
    /// What was sought, and what is tied to it.
    pub parameters: Vec<Found>,
    /// What the file derives from parameters; then, where the instances close one loop, its figures at the end of the first
    /// run ([`pilotage_linear::LoopFigures::named`]).
    pub derived: Vec<Found>,
    /// The runs.
    pub runs: Vec<RunFit>,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Its last KKT residual.
    pub kkt: Kkt,
    /// Poles of the system, linearised at the end of the first run \[1/s\].
    pub poles: Vec<[f64; 2]>,
    /// How the mesh was refined.
    pub refinement: Refinement,
    /// An objective that is zero but for the solver's tolerance.
    pub resolution: f64,
    /// For each start how it ended, and its objective.
    pub starts: Vec<(Status, f64)>,
    /// A start that did not converge, and was better all the same.
    pub lower: Option<usize>,
    /// The outputs at whose wires the loops of crossover and margins are cut; none where no loop is.
    pub cuts: Vec<String>,
    /// What ended the fit before all starts and refinements were done.
    pub cut: Option<Status>,
    /// Events of FMUs in its runs.
    pub events: Events,
    /// Residuals beside what drove the system; none where the equations are not met.
    pub beside: Vec<Beside>,
    /// What speaks against it.
    pub diagnostics: Vec<Diagnostic>,
    /// Difference of objectives that is of no importance.
    pub negligible: f64,
    /// How long it took \[s\].
    pub seconds: f64,
    /// How sure it is.
    pub uncertainty: Result<Uncertainty, Unsure>,
    /// What the runs say of pilot and loop without a model.
    pub describing: Describing,
    /// The solution itself.
    pub solved: Option<Arc<Solved>>,
    /// The solution of predictions, where noise drives the system.
    pub optimum: Option<Arc<Optimum>>,
    /// Which expression is no finite number where the search begins, where a solve ended with
    /// [`Status::UndefinedStart`].
    pub trouble: Option<String>,
}

/// A parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its name.
    pub name: String,
    /// Name of its unit, where it has one.
    pub unit: Option<String>,
    /// Its value, or that for each run or subject, by their names.
    pub values: Vec<(Option<String>, f64)>,
    /// True where it follows from others.
    pub is_tied: bool,
    /// The end of its range on which it lies.
    pub bound: Option<f64>,
}

impl Found {
    /// Its values, each with the parameter's name and, in brackets, whose it is.
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

    /// The mean of its values for these runs or subjects; of all where it has none for them.
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

/// A run.
#[derive(Debug, Clone)]
pub struct RunFit {
    /// Its file.
    pub name: String,
    /// Times of the samples \[s\].
    pub time: Vec<f64>,
    /// The states, inputs and parameters of the joint model where it begins.
    pub begin: Vec<f64>,
    /// The states at the samples, each by itself, as the models have them.
    pub states: Vec<Vec<f64>>,
    /// What each sensor should show, in the unit of its signal.
    pub predicted: Vec<Vec<f64>>,
    /// What was recorded, in the same.
    pub recorded: Vec<Vec<f64>>,
    /// The noise levels.
    pub deviations: Vec<Vec<f64>>,
    /// What is predicted from sample to sample, where noise drives the system; what stands above is simulated without.
    pub ahead: Option<Ahead>,
}

impl RunFit {
    /// The residuals of a measured signal at each sample, in standard deviations; NaN where nothing was measured. Where
    /// noise drives the system they are the innovations.
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
    /// Root mean square of what a prediction by all earlier samples misses of a measured signal, in its unit; none where no
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

    /// How much of a measured signal the model explains.
    pub fn explained(&self, k: usize) -> Option<Explained> {
        Explained::of(&self.recorded[k], &self.predicted[k])
    }

    /// −2 log likelihood of all that was recorded; not a number where the model gives none.
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
        (0..posed.runs.len()).map(run).collect()
    }

    /// What a solution says.
    pub(crate) fn of(posed: &Posed<'_>, solved: &Solved) -> Self {
        let Solved { problem, solution } = solved;
        let z = &solution.iterate.z;
        let theta = problem.physical_theta(z);
        let states: Vec<Vec<Vec<f64>>> = (0..posed.runs.len())
            .map(|j| problem.states_at_samples(z, j))
            .collect();
        let run = |j: usize| run_fit(posed, problem, j, &states[j], &theta);
        let runs: Vec<RunFit> = (0..posed.runs.len()).map(run).collect();
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
            derived: expressed(posed, &states, &theta, &posed.told.derived),
            iterations: solution.work.iterations,
            kkt: solution.kkt,
            poles: states[0].last().map_or_else(Vec::new, |x| {
                let poles = poles(posed, x, &theta);
                poles.iter().map(|pole| [pole.re, pole.im]).collect()
            }),
            runs,
            refinement: Refinement::new(solved),
            resolution: EXACT * samples as f64 / posed.factor,
            starts: Vec::new(),
            lower: None,
            cut: None,
            cuts: Vec::new(),
            simulated_objective: None,
            events: Events::default(),
            beside: Vec::new(),
            diagnostics: Vec::new(),
            negligible: NEGLIGIBLE * samples as f64 / posed.factor,
            seconds: 0.0,
            uncertainty: Err(Unsure::NotConverged),
            describing: Describing::default(),
            solved: None,
            optimum: None,
            trouble: None,
        }
    }

    /// Whether the states fulfil the equations and the constraints hold. Else objective and residuals are those of no run,
    /// or what is not finite at the start.
    pub fn is_met(&self) -> bool {
        self.status == Status::Converged || self.kkt.primal <= MET
    }

    /// Whether it is done: the solver converged, nothing was cut, no iteration limit ended the refinement of the mesh, and
    /// the mesh is fine enough, or at least a simulation with what was found agrees.
    pub fn is_answer(&self) -> bool {
        let is_rough = |own: &Diagnostic| matches!(own, Diagnostic::MeshError { .. });
        let has_mesh = !self.diagnostics.iter().any(is_rough) || self.agrees();
        let is_limited = self.cut.is_some() || self.refinement.is_limited;
        self.status == Status::Converged && !is_limited && has_mesh
    }

    /// Whether a simulation with what was found has the same objective: up to a thousandth, or up to a hundredth of a
    /// standard deviation in each value.
    pub fn agrees(&self) -> bool {
        self.simulated_objective.is_some_and(|simulated| {
            (simulated - self.objective).abs() <= SAME * self.objective.abs() + self.negligible
        })
    }

    /// How it ended, in a word: that of the solver, or what is worse.
    pub fn ending(&self) -> &'static str {
        match (self.cut, self.status) {
            (Some(cut), _) => cut.as_str(),
            (None, Status::Converged) if self.refinement.is_limited => {
                Status::IterationLimit.as_str()
            }
            (None, Status::Converged) if !self.is_answer() => "mesh-error",
            (None, status) => status.as_str(),
        }
    }

    /// Whether the wired system decays.
    pub fn is_stable(&self) -> bool {
        !self.poles.is_empty() && self.poles.iter().all(|pole| pole[0] < 0.0)
    }

    /// How many starts ended at the best optimum. Each has a mesh of its own, so that objectives may differ by twice of what
    /// the refinement changed the best one.
    pub fn agreeing(&self) -> usize {
        let converged = self
            .starts
            .iter()
            .filter(|(status, _)| *status == Status::Converged);
        let objectives = converged.map(|(_, own)| *own);
        let best = objectives.clone().fold(f64::INFINITY, f64::min);
        let size = best.abs().max(self.resolution);
        let refined = 2.0 * (self.objective - best).abs();
        let near = refined.clamp(SAME * size, 10.0 * SAME * size);
        let is_near = |own: &f64| own - best <= near;
        objectives.filter(is_near).count()
    }

    /// How it ended, in a word or two.
    pub fn verdict(&self) -> String {
        match (self.is_answer(), self.diagnostics.len()) {
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
    let told = &posed.told;
    let graph = &posed.model.system.graph;
    let count = posed.joint.model.states.len();
    let mut run = RunFit {
        name: posed.data[j].name(),
        time: problem.runs[j].time.clone(),
        begin: Vec::new(),
        states: vec![Vec::new(); count],
        predicted: vec![Vec::new(); told.predicted.len()],
        recorded: told.recorded.iter().map(|all| all[j].clone()).collect(),
        deviations: vec![Vec::new(); told.predicted.len()],
        ahead: ahead(posed, j, &states[0], theta),
    };
    for (sample, x) in states.iter().enumerate() {
        let values = graph.values(&variables(posed, j, sample, x, theta));
        if sample == 0 {
            let joint = told.joint.iter().skip(1);
            run.begin = joint.map(|node| values[node.index()]).collect();
        }
        for k in 0..told.predicted.len() {
            run.predicted[k].push(values[told.predicted[k].index()]);
            run.deviations[k].push(values[told.deviations[k].index()]);
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
        // The solver is out of a range by its tolerance.
        let found = |searched: f64| unknown.kept(unknown.found(searched));
        let values: Vec<(Option<String>, f64)> = match stands {
            Stands::Shared(k) => vec![(None, found(theta[*k]))],
            Stands::Subjects(subjects) => (subjects.iter())
                .map(|(subject, k)| (Some(subject.clone()), found(theta[*k])))
                .collect(),
            Stands::State(k) => (posed.data.iter().zip(states))
                .map(|(run, states)| (Some(run.name()), found(states[0][*k])))
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
            is_tied: false,
        });
    }
    all.extend(expressed(posed, states, theta, &posed.told.tied));
    all
}

/// Expressions of parameters, where the runs begin.
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
            is_tied: true,
        }
    };
    all.iter().map(found).collect()
}

/// The end of a range on which one of these values lies, up to the solver's tolerance for a parameter of the size of its
/// start, or of its nominal value where it starts at 0.
fn reached(
    range: [Option<f64>; 2],
    values: &[(Option<String>, f64)],
    [start, nominal]: [f64; 2],
) -> Option<f64> {
    let size = if start == 0.0 { nominal } else { start.abs() };
    let is_near = |value: f64, end: f64| (value - end).abs() <= 1e-6 * (1e-6 + end.abs().max(size));
    let is_reached = |end: &f64| values.iter().any(|(_, value)| is_near(*value, *end));
    range.into_iter().flatten().find(is_reached)
}

/// Residuals of a measured signal beside a column that drives an input.
#[derive(Debug, Clone)]
pub struct Beside {
    /// The measured column.
    pub measured: String,
    /// The column that drives an input.
    pub input: String,
    /// Their correlations.
    pub crossed: Crossed,
}
