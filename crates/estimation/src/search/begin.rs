//! The beginning of a search: the nonlinear program of a start, its mesh, scheme and scales.

use crate::posed::followed::Followed;
use crate::posed::{MOST_INTERVALS, Posed, Stands, poles_at, variables};
use crate::problem::file::{Mesh, Options};
use crate::search::diverged::tame;
use crate::search::solved::STIFF_SCHEME;
use crate::search::starts::{Start, starts};
use pilotage_collocation::{Bound, Collocation, Course, Quality, Run, Scales, Scheme, Stop};
use rayon::prelude::*;
use std::collections::HashMap;

/// Approximate maximum number of nodes added to the samples on initial meshes.
const MOST_NODES: usize = 4000;

/// Maximum number of steps of a simulation, as a multiple of its samples and of the nodes that its mesh may have. Parameters
/// with which a run needs more are far from any answer, such as those of a loop that diverges: with the time that these
/// steps take, many other starts can be tried.
const STEPS_PER_NODE: usize = 20;

/// Samples of a run that are a mesh by themselves.
const DENSE: usize = 200;

/// Error tolerance of a simulation step, relative to the states.
const TOLERANCE: f64 = 1e-6;

/// The same where a simulation only provides states, and no mesh.
const GUESS: f64 = 1e-3;

/// Smallest scale of a state, relative to the largest of its instance in its unit.
const NEGLIGIBLE: f64 = 1e-6;

/// A state that stays below this fraction of its assumed size is simulated again with its actual size.
const TINY: f64 = 0.1;

/// Point from which a search begins or continues.
pub(crate) struct Point<'p> {
    /// The shared parameters.
    pub theta: &'p [f64],
    /// The runs.
    pub runs: Vec<usize>,
    /// Initial states of each of them.
    pub initial: Vec<Vec<f64>>,
    /// Whether measured states follow their recordings.
    pub follows: bool,
    /// Whether the parameters are those of a fit, so that they tell their own magnitudes.
    pub is_fitted: bool,
    /// Whether they are those of a fit of the order below.
    pub is_raised: bool,
    /// Whether states are kept that diverge: they are the answer, and no beginning of a search.
    pub is_kept: bool,
}

/// The nonlinear program of a start on a mesh that suits a simulation from there, and its variables. If stopped, the
/// states remain constant.
pub fn begin(posed: &Posed<'_>, start: &Start, stop: &Stop<'_>) -> (Collocation, Vec<f64>) {
    begin_some(posed, start, (0..posed.runs.len()).collect(), stop)
}

/// The same with some of the runs.
pub(crate) fn begin_some(
    posed: &Posed<'_>,
    start: &Start,
    runs: Vec<usize>,
    stop: &Stop<'_>,
) -> (Collocation, Vec<f64>) {
    let point = point(posed, start, runs);
    at_point(posed, &point, posed.file.options.scheme, stop)
}

/// The same if the states follow the equations everywhere: no simulation ends early or diverges.
pub(crate) fn begin_whole(
    posed: &Posed<'_>,
    start: &Start,
    stop: &Stop<'_>,
) -> Option<(Collocation, Vec<f64>)> {
    let point = point(posed, start, (0..posed.runs.len()).collect());
    let (problem, z, is_whole) = along(posed, &point, posed.file.options.scheme, stop);
    is_whole.then_some((problem, z))
}

/// A nonlinear program, and its variables along a simulation.
pub type Flown = (Collocation, Vec<f64>);

/// The same along a simulation that is an answer by itself, so that nothing in it is replaced, and the run and the time \[s\]
/// at which it ends early, if it does.
pub fn flown(posed: &Posed<'_>, start: &Start) -> (Flown, Option<(usize, f64)>) {
    let mut point = point(posed, start, (0..posed.runs.len()).collect());
    point.is_kept = true;
    let scheme = posed.file.options.scheme;
    let (problem, z, is_whole) = along(posed, &point, scheme, &|| false);
    let end = (!is_whole).then(|| early_end(posed, start, &|| false));
    ((problem, z), end.flatten())
}

/// The run whose simulation from a start ends early, and the time that it reaches \[s\]: it diverges, or takes more steps
/// than any mesh has room for.
pub(crate) fn early_end(posed: &Posed<'_>, start: &Start, stop: &Stop<'_>) -> Option<(usize, f64)> {
    let point = point(posed, start, (0..posed.runs.len()).collect());
    let courses = courses(posed, &point, stop);
    let mut ends = courses.iter().map(Course::early_end).enumerate();
    ends.find_map(|(j, end)| Some((j, end?)))
}

/// Whether the loop whose stability is asked for is open with some parameters where it is linearised, at the start of the first
/// run: it has kinks, and a pole at zero from one of several starts, as beside a vehicle that integrates if the pilot's dead zone
/// hides the error there. That condition would keep the dead zone smaller than the error.
pub fn is_resting(posed: &Posed<'_>) -> bool {
    const STARTS: usize = 8;
    const ZERO: f64 = 1e-9;
    let has_pole_at_zero = |start: &Start| {
        let (theta, own) = start.parameters.split_at(posed.shared);
        let poles = poles_at(posed, 0, &initial(posed, own, 0), theta);
        poles.iter().any(|pole| pole.norm() < ZERO)
    };
    posed.file.stability.closed_loop.is_some()
        && posed.has_kinks()
        && starts(posed, STARTS).iter().any(has_pole_at_zero)
}

fn point<'p>(posed: &Posed<'_>, start: &'p Start, runs: Vec<usize>) -> Point<'p> {
    let (theta, own) = start.parameters.split_at(posed.shared);
    Point {
        theta,
        initial: runs.iter().map(|j| initial(posed, own, *j)).collect(),
        runs,
        follows: start.follows,
        is_fitted: start.is_fitted,
        is_raised: start.is_raised,
        is_kept: false,
    }
}

/// The same from a point reached by a search. Without a scheme, one that suits the equations there is selected.
pub(crate) fn at_point(
    posed: &Posed<'_>,
    point: &Point<'_>,
    scheme: Option<Scheme>,
    stop: &Stop<'_>,
) -> (Collocation, Vec<f64>) {
    let (problem, z, _) = along(posed, point, scheme, stop);
    (problem, z)
}

/// The same, and whether the states follow the equations everywhere.
fn along(
    posed: &Posed<'_>,
    point: &Point<'_>,
    scheme: Option<Scheme>,
    stop: &Stop<'_>,
) -> (Collocation, Vec<f64>, bool) {
    let followed = posed.followed.as_ref().filter(|_| point.follows);
    // Dense samples are a mesh by themselves, so that recorded paths tell it as well as those of a loop with wrong parameters.
    let is_dense = posed.runs.iter().all(|run| run.time.len() >= DENSE);
    let follow = |followed: &Followed| -> Vec<Course> {
        let runs = point.runs.par_iter().zip(&point.initial);
        let simulated = runs.map(|(j, initial)| {
            let samples = posed.runs[*j].time.len();
            let quality = Quality {
                tolerance: if is_dense { GUESS } else { TOLERANCE },
                magnitudes: sizes(posed, initial),
                most_steps: STEPS_PER_NODE * (samples + most_nodes(posed)),
            };
            let mut course = followed.simulate(posed, (*j, initial), point.theta, &quality, stop);
            course.thin(MOST_NODES);
            course
        });
        simulated.collect()
    };
    let (courses, mut paths) = match followed {
        Some(followed) if is_dense => (None, follow(followed)),
        Some(followed) => (Some(courses(posed, point, stop)), follow(followed)),
        None => (None, courses(posed, point, stop)),
    };
    let seen = courses.as_ref().unwrap_or(&paths);
    let scheme = scheme.unwrap_or_else(|| suited(seen));
    let pairs = point.runs.iter().zip(&point.initial).zip(seen);
    let runs = pairs.map(|((j, initial), own)| {
        let run = posed.run_at(*j, point.theta, initial).into_owned();
        meshed(run, own, &posed.file.options)
    });
    let runs: Vec<Run> = runs.collect();
    let mut is_whole = true;
    for ((j, initial), own) in point.runs.iter().zip(&point.initial).zip(&mut paths) {
        let sizes = sizes(posed, initial);
        let is_wild = !point.is_kept && tame(posed, (*j, own), &sizes, point.theta);
        is_whole &= own.is_whole && !is_wild;
    }
    let mut scales = scales(posed, &paths, point.theta);
    if point.is_fitted {
        scales.parameters = fitted_scales(posed, point, &scales.parameters);
    }
    let bounds = bounds(posed, &paths, point);
    let problem = discretised(posed, runs, scales, &bounds, scheme);
    let paths = paths.iter().map(|own| (&own.time[..], &own.states[..]));
    let z = problem.variables_along(paths, point.theta);
    (problem, z, is_whole)
}

/// The scheme for equations with these simulations, if the user selected none.
fn suited(courses: &[Course]) -> Scheme {
    match courses.iter().any(|course| course.is_stiff) {
        true => STIFF_SCHEME,
        false => Scheme::HermiteSimpson,
    }
}

/// Simulations of the runs from a point, with as many steps as their meshes need.
fn courses(posed: &Posed<'_>, point: &Point<'_>, stop: &Stop<'_>) -> Vec<Course> {
    let most = most_nodes(posed);
    let simulated = |(j, initial): (&usize, &Vec<f64>)| {
        let run = &*posed.run_at(*j, point.theta, initial);
        let steps = match point.is_kept {
            true => usize::MAX,
            false => STEPS_PER_NODE * (run.time.len() + most),
        };
        let mut course = course(posed, (run, initial), point.theta, steps, stop);
        course.thin(most);
        course
    };
    let runs = point.runs.par_iter().zip(&point.initial);
    runs.map(simulated).collect()
}

/// Simulation of a run. If the problem does not state the size of a state, it is assumed to be of the order of one
/// unless it turns out to be smaller.
fn course(
    posed: &Posed<'_>,
    (run, initial): (&Run, &[f64]),
    theta: &[f64],
    most_steps: usize,
    stop: &Stop<'_>,
) -> Course {
    let simulated = |magnitudes: &[f64]| {
        let quality = Quality {
            tolerance: TOLERANCE,
            magnitudes: magnitudes.to_vec(),
            most_steps,
        };
        posed.model.course(run, theta, initial, &quality, stop)
    };
    let assumed = sizes(posed, initial);
    let course = simulated(&assumed);
    let seen = course.sizes();
    let is_tiny = |k: usize| {
        posed.states[k].nominal.is_none() && seen[k] > 0.0 && seen[k] < TINY * assumed[k]
    };
    let own: Vec<f64> = (0..assumed.len())
        .map(|k| if is_tiny(k) { seen[k] } else { assumed[k] })
        .collect();
    match own == assumed {
        true => course,
        false => simulated(&own),
    }
}

/// Maximum number of nodes added to the samples of a run.
fn most_nodes(posed: &Posed<'_>) -> usize {
    MOST_NODES.div_ceil(posed.runs.len().max(1))
}

/// Initial states of a run with these own parameters.
pub(crate) fn initial(posed: &Posed<'_>, own: &[f64], j: usize) -> Vec<f64> {
    let joint = posed.states.len() - own.len();
    (posed.states.iter().zip(&posed.runs[j].initial).enumerate())
        .map(|(k, (state, known))| match k.checked_sub(joint) {
            Some(k) => own[k],
            None => known.unwrap_or(state.guesses[j]),
        })
        .collect()
}

/// Sizes of the states, as far as known at the start.
fn sizes(posed: &Posed<'_>, initial: &[f64]) -> Vec<f64> {
    let pairs = posed.states.iter().zip(initial);
    pairs
        .map(|(state, x)| state.nominal.unwrap_or(1.0).max(x.abs()))
        .collect()
}

/// What a state's magnitude can be compared with: states of its instance in its unit.
fn kind<'p>(posed: &'p Posed<'_>, name: &'p str) -> (&'p str, Option<&'p str>) {
    let instance = name.split_once('.').map_or("", |(instance, _)| instance);
    let about = posed.joint.variables.get(name);
    (instance, about.and_then(|own| own.unit.as_deref()))
}

/// Magnitudes of states and parameters.
pub(crate) fn scales(posed: &Posed<'_>, courses: &[Course], theta: &[f64]) -> Scales {
    let sizes: Vec<Vec<f64>> = courses.iter().map(Course::sizes).collect();
    let largest = |k: usize| sizes.iter().map(|own| own[k]).fold(0.0, f64::max);
    // Of a chain the far end may hardly move with these parameters, and move with others.
    let states = &posed.joint.model.states;
    let kinds: Vec<_> = states.iter().map(|name| kind(posed, name)).collect();
    let mut most: HashMap<(&str, Option<&str>), f64> = HashMap::new();
    for (k, kind) in kinds.iter().enumerate() {
        let most = most.entry(*kind).or_default();
        *most = most.max(largest(k));
    }
    let state = |k: usize| {
        let negligible = kinds.get(k).map_or(0.0, |kind| NEGLIGIBLE * most[kind]);
        let seen = Some(largest(k)).filter(|size| *size > 0.0);
        let seen = seen.map(|size| size.max(negligible));
        posed.states[k].nominal.or(seen).unwrap_or(1.0)
    };
    let mut parameters: Vec<f64> = theta.iter().map(|value| value.abs()).collect();
    for (unknown, stands) in &posed.unknowns {
        let size = unknown.searched_nominal();
        let range = unknown.max.zip(unknown.min);
        let half = range.map(|(max, min)| 0.5 * (max - min));
        let size = size.or(half).unwrap_or(1.0);
        match stands {
            Stands::Shared(k) => parameters[*k] = size,
            Stands::Subjects(all) => all.iter().for_each(|(_, k)| parameters[*k] = size),
            Stands::State(_) => {}
        }
    }
    Scales {
        states: (0..posed.states.len()).map(state).collect(),
        parameters,
    }
}

/// Magnitudes of fitted parameters: their own, but at least a millionth of the largest, or those that are assumed: of parameters from
/// the order below only those that the models or the problem state, since values of another order say nothing of their size.
fn fitted_scales(posed: &Posed<'_>, point: &Point<'_>, assumed: &[f64]) -> Vec<f64> {
    const LEAST: f64 = 1e-6;
    let all = point.theta.iter().map(|own| own.abs());
    let largest = all.clone().fold(0.0, f64::max);
    let own = all.map(|own| own.max(LEAST * largest));
    let mut scales: Vec<f64> = own.map(|own| if own > 0.0 { own } else { 1.0 }).collect();
    for (unknown, stands) in &posed.unknowns {
        let is_assumed = match point.is_raised {
            true => unknown.log || unknown.nominal.is_some(),
            false => unknown.searched_nominal().is_some(),
        };
        if is_assumed && matches!(stands, Stands::Shared(_) | Stands::Subjects(_)) {
            let places = stands.variables(0).into_iter();
            places.for_each(|k| scales[k] = assumed[k]);
        }
    }
    scales
}

/// The bounds with the sizes of their outputs: the largest magnitudes along these courses, but not below all limits nor far above
/// them, since a start may say little.
fn bounds(posed: &Posed<'_>, courses: &[Course], point: &Point<'_>) -> Vec<Bound> {
    const FAR: f64 = 1e3;
    const MOST: usize = 64;
    let system = &posed.model.system;
    let first = system.outputs.len() - posed.bounds.len();
    let mut largest = vec![0.0_f64; posed.bounds.len()];
    let courses = if largest.is_empty() { &[] } else { courses };
    for (j, course) in point.runs.iter().zip(courses) {
        let step = course.samples.len().div_ceil(MOST).max(1);
        for (sample, at) in course.samples.iter().enumerate().step_by(step) {
            let at = variables(posed, *j, sample, &course.states[*at], point.theta);
            let values = system.graph.values(&at);
            for (most, output) in largest.iter_mut().zip(&system.outputs[first..]) {
                let value = values[output.index()].abs();
                *most = if value.is_finite() {
                    most.max(value)
                } else {
                    *most
                };
            }
        }
    }
    let sized = |(bound, most): (&Bound, f64)| {
        let limits = [bound.lower, bound.upper].map(f64::abs);
        let limits = || {
            limits
                .into_iter()
                .filter(|end| *end > 0.0 && end.is_finite())
        };
        let (least, far) = (
            limits().fold(f64::INFINITY, f64::min),
            limits().fold(0.0, f64::max),
        );
        let size = match (least.is_finite(), most > 0.0) {
            (true, _) => most.clamp(least, FAR * far),
            (false, true) => most,
            (false, false) => 1.0,
        };
        // Powers of two round nothing.
        let size = size.log2().round().exp2();
        Bound { size, ..*bound }
    };
    posed.bounds.iter().zip(largest).map(sized).collect()
}

/// A run on the requested mesh. If the mesh is adaptive, nodes are added to the samples where the simulation needs
/// them.
fn meshed(mut run: Run, course: &Course, options: &Options) -> Run {
    match options.mesh {
        Mesh::Step(step) => run.mesh = spread(&run, step),
        Mesh::Tolerance(_) => run.mesh = course.mesh(),
        Mesh::Samples => {}
    }
    run.mesh = run.steps.on(&run.mesh);
    run
}

/// Nodes approximately this far apart, and wherever inputs jump.
fn spread(run: &Run, step: f64) -> Vec<f64> {
    let jumps = run.time.windows(2).zip(run.inputs.windows(2));
    let jumps = jumps.filter(|(time, inputs)| time[0] == time[1] && inputs[0] != inputs[1]);
    let mut hard: Vec<f64> = vec![run.time[0]];
    hard.extend(jumps.map(|(time, _)| time[0]));
    hard.push(run.time[run.time.len() - 1]);
    hard.dedup();
    let mut mesh = vec![hard[0]];
    for ends in hard.windows(2) {
        let intervals = ((ends[1] - ends[0]) / step).round().max(1.0);
        let intervals = intervals.min(MOST_INTERVALS as f64) as usize;
        let inner =
            (1..intervals).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / intervals as f64);
        mesh.extend(inner);
        mesh.push(ends[1]);
    }
    mesh
}

/// The nonlinear program of these runs, its objective multiplied by [`Posed::factor`].
pub(crate) fn discretised(
    posed: &Posed<'_>,
    mut runs: Vec<Run>,
    scales: Scales,
    bounds: &[Bound],
    scheme: Scheme,
) -> Collocation {
    for recording in runs.iter_mut().flat_map(|run| &mut run.measured) {
        recording.weight *= posed.factor;
    }
    Collocation::new(
        posed.model.clone(),
        posed.constraints.clone(),
        scheme,
        runs,
        scales,
        bounds,
    )
}
