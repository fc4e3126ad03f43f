//! Starts from the data: each first fits equations that are corrected by what was measured ([`Observed`]), with a few runs on a
//! coarse mesh. Those that reach the same objective and parameters go on as one.

use super::apart::are_near;
use super::race::{NEARLY, is_close};
use super::solve::{rescaled, sqp_options};
use super::watch::Watch;
use crate::posed::Posed;
use crate::search::begin::begin_some;
use crate::search::observed::Observed;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_collocation::{Collocation, reduced};
use pilotage_sqp::{SqpOptions, Status};
use rayon::prelude::*;

/// Maximum number of samples of these problems, as long as two runs remain.
const SAMPLES: usize = 3000;

/// Iterations between two looks at the magnitudes of the parameters, which may be far from those of the start, and the number
/// of these.
const LEG: usize = 15;
const LEGS: usize = 3;

/// Scaled KKT residual at which these solves end.
const ROUGH: f64 = 1e-5;

/// Relative difference up to which two objectives are those of one optimum.
const SAME: f64 = 1e-5;

/// Maximum number of optima that enter the race.
const MOST: usize = 4;

/// Starts that enter the race.
pub(super) struct Entrants {
    /// Each with the number of the start from which it comes.
    pub all: Vec<(usize, Start)>,
    /// For each start the number of that which enters in its place: its own, unless another has reached the same optimum.
    pub same: Vec<usize>,
}

impl Entrants {
    /// The starts as they are.
    pub fn new(starts: &[Start]) -> Self {
        Self {
            all: starts.iter().cloned().enumerate().collect(),
            same: (0..starts.len()).collect(),
        }
    }

    /// These, and then the others.
    pub fn and(mut self, others: Self) -> Self {
        let first = self.same.len();
        let entering = others.all.into_iter();
        (self.all).extend(entering.map(|(k, start)| (first + k, start)));
        self.same.extend(others.same.into_iter().map(|k| first + k));
        self
    }
}

/// A start, and the objective of the corrected equations with its parameters.
struct Guided {
    number: usize,
    objective: f64,
    start: Start,
}

/// The starts where the data lead them: those with the best objectives of the corrected equations. The starts as they are if they
/// lead nowhere.
pub(super) fn guided(
    posed: &Posed<'_>,
    observed: &Observed,
    (first, starts): (usize, &[Start]),
    watch: &Watch<'_, '_>,
) -> Entrants {
    let runs = some(posed);
    let led = starts.par_iter().enumerate().filter_map(|(number, start)| {
        let is_over = number > 0 && watch.is_over();
        let own = || {
            let of = |plain: &Collocation| observed.of(plain, &runs);
            let found = led(posed, &of, (first + number, start), &runs, watch)?;
            Some(Guided { number, ..found })
        };
        (!is_over).then(own).flatten()
    });
    let mut led: Vec<Guided> = led.collect();
    led.sort_by(|a, b| a.objective.total_cmp(&b.objective));
    let best = led.first().map_or(0.0, |own| own.objective);
    let mut entrants = Entrants::new(starts);
    let mut apart: Vec<Guided> = Vec::new();
    for own in led {
        let difference = |other: &Guided| (other.objective - own.objective).abs();
        let is_same = |other: &&Guided| {
            difference(other) <= SAME * other.objective.abs()
                && are_near(&other.start.parameters, &own.start.parameters)
        };
        match apart.iter().find(is_same) {
            Some(other) => entrants.same[own.number] = other.number,
            None if apart.len() < MOST && is_close(own.objective, best) => apart.push(own),
            None => {}
        }
    }
    if !apart.is_empty() {
        entrants.all = apart
            .into_iter()
            .map(|own| (own.number, own.start))
            .collect();
    }
    entrants
}

/// The objective of a few runs alone with the parameters that fit these, from a start. None if all runs are few, or that leads nowhere.
pub(super) fn few(
    posed: &Posed<'_>,
    (number, start): (usize, &Start),
    watch: &Watch<'_, '_>,
) -> Option<f64> {
    let runs = some(posed);
    let is_less = runs.len() < posed.runs.len();
    let led = is_less.then(|| led(posed, &Collocation::clone, (number, start), &runs, watch));
    Some(led.flatten()?.objective)
}

/// The objective of the same runs in a solution of all.
pub(super) fn of_few(posed: &Posed<'_>, solved: &Solved) -> f64 {
    let z = &solved.solution.iterate.z;
    let runs = some(posed).into_iter();
    runs.map(|j| solved.problem.run_objective(z, j)).sum()
}

/// Runs that together have few samples, spread over all.
fn some(posed: &Posed<'_>) -> Vec<usize> {
    const FEWEST: usize = 2;
    let count = posed.runs.len();
    let spread = |taken: usize| (0..taken).map(move |k| k * count / taken);
    let samples = |taken: usize| {
        spread(taken)
            .map(|j| posed.runs[j].mesh.len())
            .sum::<usize>()
    };
    let is_small = |taken: &usize| *taken <= FEWEST || samples(*taken) <= SAMPLES;
    let taken = (1..=count).rev().find(is_small);
    spread(taken.unwrap_or(count)).collect()
}

/// A start with the parameters that fit the equations of these runs, such as corrected ones. None if there is no such fit.
fn led(
    posed: &Posed<'_>,
    equations: &dyn Fn(&Collocation) -> Collocation,
    (number, start): (usize, &Start),
    runs: &[usize],
    watch: &Watch<'_, '_>,
) -> Option<Guided> {
    let mut see = |iteration: &_| watch.see(number, 0, iteration);
    let options = SqpOptions {
        tolerance: ROUGH,
        ..sqp_options(posed, LEG)
    };
    let (plain, z) = begin_some(posed, start, runs.to_vec(), &|| watch.is_over());
    let whole = equations(&plain);
    let mut from = reduced(&whole, &z).unwrap_or((whole, z));
    for leg in 1..=LEGS {
        let (problem, z) = from;
        let solution = pilotage_collocation::solve(&problem, z, &options, &mut see);
        let solved = Solved { problem, solution };
        if solved.solution.status == Status::IterationLimit && leg < LEGS {
            from = rescaled(&solved);
            continue;
        }
        let objective = solved.within(NEARLY);
        let theta = solved.theta();
        let has_moved = leg > 1 || solved.solution.work.iterations > 0;
        let is_finite = objective.is_finite() && theta.iter().all(|own| own.is_finite());
        let own = start.parameters[posed.shared..].iter().copied();
        return (has_moved && is_finite).then(|| Guided {
            number,
            objective,
            start: Start {
                parameters: theta.into_iter().chain(own).collect(),
                is_fitted: true,
                ..*start
            },
        });
    }
    None
}
