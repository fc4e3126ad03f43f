//! Prepares a fit for repeated solves, the profile likelihoods and bootstraps of `pilotage-refits`, and computes its
//! covariance by other methods.

use crate::innovations::Again;
use crate::posed::unknowns::Unknown;
use crate::posed::variables;
use crate::posed::{Posed, Stands};
use crate::problem::file::Noise;
use crate::result::Fit;
use crate::result::loops::Looped;
use crate::result::uncertainty::{Uncertainty, Unsure, linearised, uncertainty};
use crate::search::solved::{Linearised, Solved};
use pilotage_collocation::Run;
use pilotage_inference::{Autoregression, Covariance, Inference, LEVEL, Method, quantile};
use pilotage_refits::study::{self, Derive};
use pilotage_refits::{Collocated, Coordinate, Resample, Study, Threshold};
use pilotage_sqp::Status;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1, StandardNormal, StandardUniform, StudentT};

/// A run determines a parameter if its effect there exceeds this fraction of the largest effect on a run.
const INFORMS: f64 = 1e-6;

/// Names of the sought parameters, with subjects or runs, in the order of [`Study::unknowns`].
pub fn sought(posed: &Posed<'_>) -> Vec<(String, Option<String>)> {
    let all = posed.unknowns.iter();
    let all = all.flat_map(|(unknown, stands)| {
        let labels = coordinates(posed, stands).into_iter();
        labels.map(|(label, _)| (unknown.name.clone(), label))
    });
    all.collect()
}

/// Uncertainty of a fit by another method than that of its problem.
///
/// # Errors
/// When the fit did not converge, or has no covariance by that method.
pub fn uncertainty_by(posed: &Posed<'_>, fit: &Fit, method: Method) -> Result<Uncertainty, Unsure> {
    let solved = converged(fit)?;
    let linear = linear(posed, solved, again(posed, fit).as_ref())?;
    let looped = Looped::of(posed, solved);
    uncertainty(
        posed,
        (solved, fit, &linear),
        None,
        looped.as_ref(),
        Some(method),
    )
}

/// The covariance of the shared parameters alone, by any method.
///
/// # Errors
/// When the fit has none.
pub fn covariance_by(posed: &Posed<'_>, fit: &Fit, method: Method) -> Result<Covariance, Unsure> {
    let linear = linear(posed, converged(fit)?, again(posed, fit).as_ref())?;
    Ok(Inference::new(&linear.data)?.covariance(Some(method))?)
}

fn converged(fit: &Fit) -> Result<&Solved, Unsure> {
    let solved = fit.solved.as_deref();
    let solved = solved.filter(|_| fit.status == Status::Converged);
    solved.ok_or(Unsure::NotConverged)
}

/// The optimum of a prediction-error fit.
fn again<'p>(posed: &'p Posed<'p>, fit: &'p Fit) -> Option<Again<'p>> {
    Again::new(posed, fit.optimum.as_ref()?)
}

/// The solution as a least-squares problem.
fn linear(
    posed: &Posed<'_>,
    solved: &Solved,
    again: Option<&Again<'_>>,
) -> Result<Linearised, Unsure> {
    let (problem, at) = (&solved.problem, &solved.solution.iterate);
    match again {
        Some(again) => Ok(again.linearised()),
        None => linearised(posed, problem, at).ok_or(Unsure::NoDerivatives),
    }
}

/// Prepares a fit for repeated solves.
///
/// # Errors
/// When the uncertainty of the fit is not available.
pub fn study<'p>(posed: &'p Posed<'p>, fit: &'p Fit) -> Result<Study<'p>, Unsure> {
    let sure = fit.uncertainty.as_ref().map_err(|reason| *reason)?;
    let solved = fit.solved.as_ref().ok_or(Unsure::NotConverged)?;
    let again = again(posed, fit);
    let (factor, is_predicted) = match &again {
        Some(again) => (again.factor(), true),
        None => (posed.factor, false),
    };
    let Linearised { data, signals, .. } = linear(posed, solved, again.as_ref())?;
    let inference = Inference::new(&data)?;
    let degrees = (!data.is_scaled).then(|| inference.degrees());
    let refit: Box<dyn Resample + Send + 'p> = match again {
        Some(again) => Box::new(again),
        None => Box::new(collocated((posed, fit, solved), &inference, signals)),
    };
    let mut unknowns = Vec::new();
    for ((unknown, stands), intervals) in posed.unknowns.iter().zip(&sure.intervals) {
        for ((label, at), interval) in coordinates(posed, stands).into_iter().zip(intervals) {
            let value = refit.value(at);
            let slope = if unknown.log {
                unknown.found(value)
            } else {
                1.0
            };
            let effects = data.runs.iter().enumerate().map(|(j, run)| match at {
                Coordinate::Shared(k) => run.shared.column(k).norm(),
                Coordinate::Initial { run, .. } => f64::from(u8::from(run == j)),
            });
            let effects: Vec<f64> = effects.collect();
            let most = effects.iter().copied().fold(0.0, f64::max);
            unknowns.push(study::Unknown {
                name: unknown.name.clone(),
                label,
                at,
                is_log: unknown.log,
                half: quantile(LEVEL, f64::INFINITY) * interval.sd / slope,
                range: ends(unknown),
                informed_by: effects.iter().map(|own| *own > INFORMS * most).collect(),
            });
        }
    }
    Ok(Study {
        solved: refit,
        is_predicted,
        unknowns,
        factor,
        threshold: Threshold {
            // A prior is weighed against the stated noise, and so is its part of the objective. An estimated level is
            // part of the objective.
            noise: match sure.is_penalised || data.is_scaled {
                true => factor,
                false => inference.noise() * factor,
            },
            root: match sure.is_penalised {
                true => quantile(LEVEL, f64::INFINITY),
                false => quantile(LEVEL, degrees.unwrap_or(f64::INFINITY)),
            },
        },
        degrees,
        constraints: posed.names.parameters.clone(),
        bounds: posed.names.bounds.clone(),
        derived: fit.derived.iter().map(|own| own.name.clone()).collect(),
        derive: derive(posed, fit, solved),
    })
}

/// The solution of the response, and the simulation of data around it.
fn collocated<'p>(
    (posed, fit, solved): (&'p Posed<'p>, &'p Fit, &'p Solved),
    inference: &Inference<'_>,
    signals: usize,
) -> Collocated<'p> {
    let drawn = Drawn {
        posed,
        fit,
        solved,
        processes: inference.coloured(),
        noise: inference.noise().sqrt(),
    };
    Collocated {
        solved: pilotage_refits::Solved {
            problem: solved.problem.clone(),
            at: solved.solution.iterate.clone(),
            options: crate::fit::sqp_options(posed, posed.file.options.max_iterations),
        },
        signals,
        simulate: Box::new(move |random| drawn.runs(random)),
    }
}

/// Derived quantities as functions of the shared parameters, with fixed states. NaN if runs have their own parameters,
/// which are not passed to the function.
fn derive<'p>(posed: &'p Posed<'p>, fit: &'p Fit, solved: &Solved) -> Box<Derive<'p>> {
    if posed.joint.model.states.len() < posed.states.len() {
        return Box::new(|_| vec![f64::NAN; fit.derived.len()]);
    }
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let states = problem.states_at_samples(z, 0);
    let [begin, last] = [0, states.len() - 1].map(|sample| states[sample].clone());
    let looped = Looped::new(posed, &last, &problem.physical_theta(z));
    Box::new(move |theta| {
        let graph = &posed.model.system.graph;
        let values = graph.values(&variables(posed, 0, 0, &begin, theta));
        let derived = posed
            .quantities
            .derived
            .iter()
            .map(|(_, node)| values[node.index()]);
        let figures = looped.iter().flat_map(|own| own.again(theta));
        derived.chain(figures).collect()
    })
}

fn ends(unknown: &Unknown) -> [f64; 2] {
    [
        unknown.min.unwrap_or(f64::NEG_INFINITY),
        unknown.max.unwrap_or(f64::INFINITY),
    ]
}

/// Coordinates of the values of an unknown, with their runs or subjects.
fn coordinates(posed: &Posed<'_>, stands: &Stands) -> Vec<(Option<String>, Coordinate)> {
    match stands {
        Stands::Shared(k) => vec![(None, Coordinate::Shared(*k))],
        Stands::Subjects(all) => (all.iter())
            .map(|(subject, k)| (Some(subject.clone()), Coordinate::Shared(*k)))
            .collect(),
        Stands::State(state) => (posed.seeking(*state))
            .map(|run| {
                let at = Coordinate::Initial { run, state: *state };
                (Some(posed.data[run].name()), at)
            })
            .collect(),
    }
}

/// Data with randomly drawn residuals.
struct Drawn<'p> {
    posed: &'p Posed<'p>,
    fit: &'p Fit,
    solved: &'p Solved,
    /// Processes of each signal's residuals, and of its level if that is sought.
    processes: Vec<Autoregression>,
    /// Standard deviation of the residuals, relative to the stated ones.
    noise: f64,
}

impl Drawn<'_> {
    /// The runs with simulated recordings, assuming that the fit is true. The noise is coloured like the residuals if
    /// it is normal, and otherwise white with the given distribution.
    fn runs(&self, random: &mut ChaCha8Rng) -> Vec<Run> {
        let mut runs = self.solved.problem.runs.clone();
        for (j, run) in runs.iter_mut().enumerate() {
            let (mut term, mut process) = (0, 0);
            for (k, measured) in self.posed.file.measured.iter().enumerate() {
                let residuals = self.residuals(j, term, process, measured.noise, random);
                self.record(run, (j, k, term), &residuals);
                let has_level = self.has_level(term);
                term += 1 + usize::from(has_level);
                process += 1 + usize::from(has_level);
            }
            self.draw_priors(run, (j, term), random);
        }
        runs
    }

    /// Whether the next term is the noise level of a term.
    fn has_level(&self, term: usize) -> bool {
        let terms = &self.posed.runs[0].measured;
        terms
            .get(term + 1)
            .is_some_and(|own| own.loss == pilotage_collocation::Loss::Linear)
    }

    /// A residual for each recorded sample, in stated standard deviations or, for an unscaled signal, in its unit.
    fn residuals(
        &self,
        j: usize,
        term: usize,
        process: usize,
        noise: Noise,
        random: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        let own = &self.posed.runs[j].measured[term];
        let samples = own.values.iter().zip(&self.posed.runs[j].time);
        let there = samples.filter(|(y, _)| y.is_finite());
        let time: Vec<f64> = there.map(|(_, time)| *time).collect();
        let count = time.len();
        let root = own.weight.sqrt();
        let mut one = |of: fn(&mut ChaCha8Rng, f64) -> f64, shape: f64| {
            (0..count)
                .map(|_| self.noise / root * of(random, shape))
                .collect()
        };
        match noise {
            Noise::Laplace => one(|random, _| laplace(random), 0.0),
            Noise::Student(dof) => one(student, dof),
            Noise::Huber(threshold) => one(huber, threshold),
            Noise::Normal | Noise::LogNormal => {
                let gauss = || StandardNormal.sample(random);
                let drawn = self.processes[process].simulated(&time, gauss);
                drawn.into_iter().map(|value| value / root).collect()
            }
        }
    }

    /// Replaces the recorded values of a signal by simulated ones.
    fn record(&self, run: &mut Run, (j, k, term): (usize, usize, usize), residuals: &[f64]) {
        let fitted = &self.fit.runs[j];
        let is_there: Vec<bool> = self.posed.runs[j].measured[term]
            .values
            .iter()
            .map(|y| y.is_finite())
            .collect();
        let samples = (0..is_there.len()).filter(|sample| is_there[*sample]);
        for (sample, residual) in samples.zip(residuals) {
            let (h, sd) = (fitted.predicted[k][sample], fitted.deviations[k][sample]);
            match (
                self.posed.quantities.seen[k],
                self.posed.file.measured[k].noise,
            ) {
                (None, _) => run.measured[term].values[sample] = h + residual,
                (Some(input), Noise::LogNormal) => {
                    run.inputs[sample][input] = h * (sd * residual).exp();
                }
                (Some(input), _) => run.inputs[sample][input] = h + sd * residual,
            }
        }
    }

    /// Draws the means of priors like data, around the values of the fit.
    fn draw_priors(&self, run: &mut Run, (j, first): (usize, usize), random: &mut ChaCha8Rng) {
        let outputs = self
            .solved
            .problem
            .outputs_at_samples(&self.solved.solution.iterate.z, j);
        for (term, prior) in self.posed.runs[j].measured.iter().enumerate().skip(first) {
            if prior.values[0].is_finite() {
                let gauss: f64 = StandardNormal.sample(random);
                run.measured[term].values[0] = outputs[term][0] + gauss / prior.weight.sqrt();
            }
        }
    }
}

/// Draws from the Laplace distribution with unit standard deviation.
fn laplace(random: &mut ChaCha8Rng) -> f64 {
    let [a, b]: [f64; 2] = [Exp1.sample(random), Exp1.sample(random)];
    (a - b) / std::f64::consts::SQRT_2
}

/// Draws from Student's t distribution with unit scale.
fn student(random: &mut ChaCha8Rng, dof: f64) -> f64 {
    StudentT::new(dof).map_or(f64::NAN, |own| own.sample(random))
}

/// Draws from Huber's distribution with unit scale and density exp(-ℓ/2), by rejection from its exponential tails,
/// extended to 0.
fn huber(random: &mut ChaCha8Rng, threshold: f64) -> f64 {
    loop {
        let [size, spare]: [f64; 2] = [Exp1.sample(random), Exp1.sample(random)];
        let size = size / threshold;
        if spare >= 0.5 * (threshold - size).max(0.0).powi(2) {
            let is_above: bool = StandardUniform.sample(random);
            return if is_above { size } else { -size };
        }
    }
}
