//! Uncertainty of a fit: standard deviations, intervals, correlations, and what the data leave undetermined.
//!
//! Everything is linearised at the solution, in the coordinates of the search: for a parameter with `scale = "log"` the
//! interval is that of the logarithm. A run's own parameters, which only that run determines, use the modelled noise
//! for every method ([`pilotage_inference::Inference::joint`]).

mod derived;
pub(crate) mod found;
mod linearised;
pub(crate) mod words;

pub use found::{Uncertainty, Unsure};

use crate::posed::unknowns::Unknown;
use crate::posed::variables;
use crate::posed::{Posed, Stands};
use crate::result::loops::Looped;
use crate::result::{Fit, Found};
use crate::search::solved::{Linearised, Solved};
use linearised::residuals;
pub(crate) use linearised::{linearised, signal_of};
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{Collocation, Sensitivities};
use pilotage_expression::Node;
use pilotage_inference::{Covariance, Data, Inference, Interval, Joint, Method, Run};

use std::cell::OnceCell;

/// Other entries of a constraint's gradient count as zero below this fraction of one entry.
const ALONE: f64 = 1e-9;
/// Relative distance from a bound within which a parameter lies on it.
const NEAR: f64 = 1e-4;

/// Uncertainty of a solution, by a given method if any. `simulated` is the same point, simulated.
pub(crate) fn uncertainty(
    posed: &Posed<'_>,
    (solved, fit, linear): (&Solved, &Fit, &Linearised),
    simulated: Option<&(Collocation, Vec<f64>)>,
    looped: Option<&Looped<'_>>,
    method: Option<Method>,
) -> Result<Uncertainty, Unsure> {
    let (problem, at) = (&solved.problem, &solved.solution.iterate);
    let Linearised {
        data,
        sensitivities,
        ..
    } = linear;
    let inference = Inference::new(data)?;
    let mut covariance = inference.covariance(method)?;
    hold(&mut covariance.matrix, &data.active);
    let names = names(posed);
    let theta = problem.physical_theta(&at.z);
    let percent = |(k, value): (usize, f64)| match names[k].starts_with("ln ") {
        true => 100.0 * value,
        false => 100.0 * value / theta[k].abs(),
    };
    let percents = |all: Vec<f64>| all.into_iter().enumerate().map(percent).collect();
    let mesh_errors = simulated.map(|(other, z)| {
        let pairs = residuals(posed, other, z).into_iter().zip(&data.runs);
        let change = |(own, run): (DVector<f64>, &Run)| {
            let (count, all) = (own.len(), run.residuals.len());
            (own - run.residuals.rows(0, count)).resize_vertically(all, 0.0)
        };
        let changes: Vec<DVector<f64>> = pairs.map(change).collect();
        inference
            .moved(&changes)
            .iter()
            .map(|own| own.abs())
            .collect()
    });
    let sure = Sure {
        posed,
        sensitivities,
        data,
        inference: &inference,
        covariance: &covariance,
        joint: vec![OnceCell::new(); data.runs.len()],
        theta: theta.clone(),
        states: (0..data.runs.len())
            .map(|j| problem.states_at_samples(&at.z, j)[0].clone())
            .collect(),
    };
    let has_prior = |(unknown, _): &(Unknown, Stands)| unknown.prior.is_some();
    let mut found = Uncertainty {
        intervals: sure.intervals(&fit.parameters),
        derived: sure.derived(&fit.derived, looped),
        initial: sure.initial(),
        notes: (inference.directions.iter())
            .map(|own| words::direction_here(posed, own, &names))
            .collect(),
        method: covariance.method,
        correlated_by: covariance.correlated_by,
        correlations: covariance.correlations(),
        cramer_rao: percents(inference.cramer_rao()),
        insensitivity: percents(inference.insensitivity()),
        is_penalised: posed.unknowns.iter().any(has_prior),
        noise: inference.noise().sqrt(),
        is_even: data.is_even(),
        mesh_errors,
        open: inference.open.clone(),
        covariance,
        names,
    };
    let wandering = found.covariance.wandering();
    let measured = (0..posed.file.measured.len()).filter(|k| {
        let own = signal_of(posed, *k);
        own.is_some_and(|own| wandering.contains(&own))
    });
    found
        .notes
        .extend(measured.map(|k| words::wanders(posed, k)));
    found.notes.extend(words::held(posed, sensitivities));
    found.notes.extend(words::beyond(posed, fit));
    let more = words::notes(&found, fit);
    found.notes.extend(more);
    Ok(found)
}

/// A shared parameter that is fixed by a constraint on it alone has no variance, not even rounding errors.
fn hold(covariance: &mut DMatrix<f64>, active: &DMatrix<f64>) {
    for k in 0..covariance.ncols() {
        if active.row_iter().any(|row| is_alone(row.iter(), k)) {
            covariance.row_mut(k).fill(0.0);
            covariance.column_mut(k).fill(0.0);
        }
    }
}

/// The method requested by the problem. If the model is correct, innovations are white, and only the scatter between
/// runs can contradict the plain covariance.
pub(crate) fn method(posed: &Posed<'_>) -> Option<Method> {
    const ENOUGH: usize = 4;
    let is_white = posed.filter.is_some() && posed.runs.len() < ENOUGH;
    let asked = posed.file.options.covariance;
    asked.or(is_white.then_some(Method::Plain))
}

/// Names of the shared parameters in the coordinates of the search.
pub(crate) fn names(posed: &Posed<'_>) -> Vec<String> {
    let mut names = vec![String::new(); posed.shared];
    for (unknown, stands) in &posed.unknowns {
        let prefix = if unknown.log { "ln " } else { "" };
        let name = format!("{prefix}{}", unknown.name);
        match stands {
            Stands::Shared(k) => names[*k] = name,
            Stands::Subjects(all) => {
                (all.iter()).for_each(|(subject, k)| names[*k] = format!("{name} ({subject})"))
            }
            Stands::State(_) => {}
        }
    }
    names
}

/// A coordinate of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coordinate {
    Shared(usize),
    /// Run, and index among its own unknowns.
    Own(usize, usize),
}

/// A solution with its covariance.
struct Sure<'a> {
    posed: &'a Posed<'a>,
    sensitivities: &'a Sensitivities,
    data: &'a Data,
    inference: &'a Inference<'a>,
    covariance: &'a Covariance,
    /// For each run, the joint covariance of shared parameters and its own unknowns.
    joint: Vec<OnceCell<Joint>>,
    theta: Vec<f64>,
    /// Initial states of each run.
    states: Vec<Vec<f64>>,
}

impl Sure<'_> {
    fn joint(&self, run: usize) -> &Joint {
        self.joint[run].get_or_init(|| self.inference.joint(self.covariance, run))
    }

    fn intervals(&self, parameters: &[Found]) -> Vec<Vec<Interval>> {
        let mut all: Vec<Vec<Interval>> = Vec::new();
        for (unknown, stands) in &self.posed.unknowns {
            let own = self.coordinates(stands).into_iter();
            all.push(own.map(|at| self.of_unknown(unknown, at)).collect());
        }
        let tied = parameters.iter().filter(|found| found.is_tied);
        let tied = tied.zip(&self.posed.quantities.tied);
        all.extend(tied.map(|(found, (_, node))| self.of_expression(found, *node)));
        all
    }

    /// Intervals of an expression of parameters, for each of its values.
    fn of_expression(&self, found: &Found, node: Node) -> Vec<Interval> {
        let of_run = |(j, (_, value)): (usize, &(Option<String>, f64))| {
            open_interval(*value, self.deviation_of(node, j))
        };
        found.values.iter().enumerate().map(of_run).collect()
    }

    fn coordinates(&self, stands: &Stands) -> Vec<Coordinate> {
        match stands {
            Stands::Shared(k) => vec![Coordinate::Shared(*k)],
            Stands::Subjects(all) => all.iter().map(|(_, k)| Coordinate::Shared(*k)).collect(),
            Stands::State(k) => {
                let place = |own: &pilotage_collocation::Sensitivity| {
                    own.free.iter().position(|state| state == k)
                };
                let runs = self.sensitivities.runs.iter().enumerate();
                runs.filter_map(|(j, own)| Some(Coordinate::Own(j, place(own)?)))
                    .collect()
            }
        }
    }

    fn value(&self, at: Coordinate) -> f64 {
        match at {
            Coordinate::Shared(k) => self.theta[k],
            Coordinate::Own(j, k) => self.states[j][self.sensitivities.runs[j].free[k]],
        }
    }

    fn of_unknown(&self, unknown: &Unknown, at: Coordinate) -> Interval {
        let value = self.value(at);
        let searched = |end: Option<f64>, open: f64| end.map_or(open, |end| unknown.searched(end));
        let mut range = [
            searched(unknown.min, f64::NEG_INFINITY),
            searched(unknown.max, f64::INFINITY),
        ];
        let bound = self.inward(at).map(|inward| {
            let end = &mut range[usize::from(inward < 0.0)];
            // Held by a constraint if not by its range.
            if (*end - value).abs() > NEAR * (1.0 + value.abs()) {
                *end = value;
            }
            *end
        });
        let (sd, degrees) = match bound {
            Some(_) => self.released(at),
            None => self.deviation(at),
        };
        let own = Interval::new(value, sd, degrees, range, bound).or_held(value);
        let slope = if unknown.log {
            unknown.found(value)
        } else {
            1.0
        };
        Interval {
            sd: own.sd * slope,
            low: unknown.found(own.low),
            high: unknown.found(own.high),
            class: own.class,
        }
    }

    /// Standard deviation and degrees of freedom.
    fn deviation(&self, at: Coordinate) -> (f64, f64) {
        deviation(self.inference, self.covariance, at, |j| self.joint(j))
    }

    /// The sign of the changes allowed by an active constraint on this coordinate alone, if there is one.
    fn inward(&self, at: Coordinate) -> Option<f64> {
        let (rows, place) = match at {
            Coordinate::Shared(k) => (&self.data.active, k),
            Coordinate::Own(j, k) => (&self.data.runs[j].active, self.posed.shared + k),
        };
        let mut alone = rows.row_iter().filter(|row| is_alone(row.iter(), place));
        alone.next().map(|row| row[place].signum())
    }

    /// The standard deviation if the constraints on this coordinate alone are released and the others kept.
    fn released(&self, at: Coordinate) -> (f64, f64) {
        let mut data = self.data.clone();
        match at {
            Coordinate::Shared(k) => data.active = without(&data.active, k),
            Coordinate::Own(j, k) => {
                data.runs[j].active = without(&data.runs[j].active, self.posed.shared + k);
            }
        }
        let Ok(inference) = Inference::new(&data) else {
            return (f64::INFINITY, f64::INFINITY);
        };
        match inference.covariance(Some(self.covariance.method)) {
            Ok(own) => {
                let joint = |j: usize| inference.joint(&own, j);
                deviation(&inference, &own, at, joint)
            }
            Err(_) => (f64::INFINITY, f64::INFINITY),
        }
    }

    /// For an expression of parameters at the start of a run (delta method).
    fn deviation_of(&self, node: Node, j: usize) -> (f64, f64) {
        let (posed, system) = (self.posed, &self.posed.model.system);
        let mut graph = system.graph.clone();
        let free = &self.sensitivities.runs[j].free;
        let places = (0..posed.shared).map(|k| system.parameter(k));
        let places: Vec<usize> = places
            .chain(free.iter().map(|k| system.state(*k)))
            .collect();
        let nodes: Vec<_> = places.iter().map(|place| graph.variable(*place)).collect();
        let slopes = graph.gradient(node, &nodes);
        let values = graph.values(&variables(posed, j, 0, &self.states[j], &self.theta));
        let slope = |k: usize| values[slopes[k].index()];
        self.along(&DVector::from_fn(places.len(), |k, _| slope(k)), j)
    }

    /// For a quantity with this gradient with respect to the shared parameters and a run's own unknowns (delta method).
    fn along(&self, gradient: &DVector<f64>, j: usize) -> (f64, f64) {
        let shared = gradient.rows(0, self.posed.shared).into_owned();
        let is_shared = gradient.rows_range(shared.len()..).amax() == 0.0;
        let (variance, degrees) = match is_shared {
            true => self.covariance.along(&shared),
            false => self.joint(j).along(gradient),
        };
        let sd = variance.sqrt();
        match self.inference.open_with(j).moves(gradient, sd) {
            true => (f64::INFINITY, f64::INFINITY),
            false => (sd, degrees),
        }
    }
}

/// An interval without a range, from a standard deviation and its degrees of freedom.
fn open_interval(value: f64, (sd, degrees): (f64, f64)) -> Interval {
    let open = [f64::NEG_INFINITY, f64::INFINITY];
    Interval::new(value, sd, degrees, open, None).or_held(value)
}

fn deviation<J: std::borrow::Borrow<Joint>>(
    inference: &Inference<'_>,
    covariance: &Covariance,
    at: Coordinate,
    joint: impl Fn(usize) -> J,
) -> (f64, f64) {
    let (is_flat, variance, degrees) = match at {
        Coordinate::Shared(k) => (
            inference.flat[k],
            covariance.matrix[(k, k)],
            covariance.degrees[k],
        ),
        Coordinate::Own(j, k) => {
            let (joint, place) = (joint(j), covariance.matrix.nrows() + k);
            let joint = joint.borrow();
            (
                inference.own_flat(j)[k],
                joint.matrix[(place, place)],
                joint.degrees[place],
            )
        }
    };
    match is_flat {
        true => (f64::INFINITY, degrees),
        false => (variance.max(0.0).sqrt(), degrees),
    }
}

/// Whether this entry is the only nonzero one of a gradient.
fn is_alone<'r>(row: impl Iterator<Item = &'r f64> + Clone, place: usize) -> bool {
    let own = row.clone().nth(place).map_or(0.0, |own| own.abs());
    let others = row.enumerate().filter(|(k, _)| *k != place);
    own > 0.0
        && others
            .into_iter()
            .all(|(_, other)| other.abs() <= ALONE * own)
}

/// The rows that are not on this entry alone.
fn without(rows: &DMatrix<f64>, place: usize) -> DMatrix<f64> {
    let kept = (0..rows.nrows()).filter(|i| !is_alone(rows.row(*i).iter(), place));
    let kept: Vec<usize> = kept.collect();
    rows.select_rows(&kept)
}
