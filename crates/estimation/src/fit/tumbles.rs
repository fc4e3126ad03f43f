//! Other initial states of each run at the best parameters.
//!
//! Where states that are not recorded begin anywhere, and the equations are not linear in them, as those of a vehicle that may
//! tumble in its first tenths of a second, each run has local optima of its own, whatever the others do. No start leads to good
//! optima of all runs at once. At known parameters, however, each run is a small problem by itself, and the best of several
//! tumbles is found quickly.

use super::behind::Behind;
use super::race::{NEARLY, Raced, dropped, has_converged};
use super::solve::{once, solve, sqp_options};
use super::watch::Watch;
use crate::posed::Posed;
use crate::posed::followed::{Followed, Recorded};
use crate::search::begin::begin;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_collocation::{Collocation, Differentiated, ParameterConstraints, Quality, Scales};
use pilotage_sqp::{Iteration, Problem, SqpOptions, Status, Work};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Iterations of a start before the best goes on, and of a round.
const HEAT: usize = 60;

/// Maximum number of rounds, each at the parameters of the one before: of two candidates, of the better one after that, and of
/// these without gain.
const BOTH: usize = 2;
const ROUNDS: usize = 4;
const IDLE: usize = 3;

/// Number of kicks of a run in a round.
const KICKS: usize = 8;

/// Size of a kick, relative to the typical magnitude of the state.
const SIZES: [f64; 2] = [0.1, 1.0];

/// Maximum number of iterations of a run by itself, and the scaled KKT residual at which it ends.
const ITERATIONS: usize = 40;
const ROUGH: f64 = 1e-4;

/// Error tolerance of a simulation step from a kick, relative to the states, and the maximum number of steps for each sample.
const GUESS: f64 = 1e-3;
const STEPS: usize = 20;

/// What a kick changes.
pub(super) struct Tumbles {
    /// The free states that are kicked.
    kicked: Vec<usize>,
    /// The states that follow the equations from there; the others keep their paths.
    moved: Vec<usize>,
}

impl Tumbles {
    /// None if no free state acts on itself in a nonlinear way as long as recorded states are as recorded.
    pub fn of(posed: &Posed<'_>) -> Option<Self> {
        let names = &posed.joint.model.states;
        let recorded = posed.followed.as_ref().map_or(&[][..], Followed::states);
        let is_open = |k: usize| k < names.len() && !recorded.contains(&k);
        let are_open = |own: &&(usize, usize)| is_open(own.0) && is_open(own.1);
        let model = &posed.model;
        let entries: Vec<(usize, usize)> =
            model.entries().iter().filter(are_open).copied().collect();
        let pairs = model.pairs().iter().filter(are_open);
        let curved: Vec<usize> = pairs.flat_map(|(a, b)| [*a, *b]).collect();
        let before = reached(&curved, names.len(), entries.iter().copied());
        let after = reached(
            &curved,
            names.len(),
            entries.iter().map(|(row, by)| (*by, *row)),
        );
        let moved: Vec<usize> = (0..names.len())
            .filter(|k| before[*k] && after[*k])
            .collect();
        let free: Vec<&String> = posed.free_states().collect();
        let kicked = moved.iter().copied().filter(|k| free.contains(&&names[*k]));
        let kicked: Vec<usize> = kicked.collect();
        (!kicked.is_empty()).then_some(Self { kicked, moved })
    }

    /// Solves these starts for some iterations: each as it is, and the first also from where it leads if no run tumbles. The best
    /// of both kinds are improved by other initial states, the better one to the end.
    pub fn race(&self, posed: &Posed<'_>, starts: &[Start], watch: &Watch<'_, '_>) -> Raced {
        let heats = starts
            .par_iter()
            .chain(starts.first())
            .enumerate()
            .map(|(k, start)| {
                let is_upright = k == starts.len();
                let number = if is_upright { 0 } else { k };
                let see = |iteration: &_| watch.see(number, 0, iteration);
                let (problem, mut z) = begin(posed, start, &|| watch.is_over());
                let mut work = Work::default();
                if is_upright {
                    let own = once(posed, (self.at_rest(posed, &problem), z), HEAT, &see);
                    (z, work) = (own.solution.iterate.z, own.solution.work);
                }
                let mut own = once(posed, (problem, z), HEAT, &see);
                own.solution.work += work;
                (number, own)
            });
        let mut heats: Vec<(usize, Solved)> = heats.collect();
        let upright = heats.pop();
        heats.sort_by(|(_, a), (_, b)| a.within(NEARLY).total_cmp(&b.within(NEARLY)));
        let mut solved: Vec<Option<Solved>> = starts.iter().map(|_| None).collect();
        let mut heats = heats.into_iter();
        let both: Vec<(usize, Solved)> = heats.next().into_iter().chain(upright).collect();
        for (number, own) in heats {
            solved[number] = Some(dropped(own));
        }
        let both = both.into_par_iter().map(|(number, own)| {
            let mut own = Tumbling::new(self, number, own);
            (0..BOTH).for_each(|_| own.advance(posed, watch));
            own
        });
        let mut both: Vec<Tumbling<'_>> = both.collect();
        both.sort_by(|a, b| a.own.within(NEARLY).total_cmp(&b.own.within(NEARLY)));
        let mut both = both.into_iter().map(|mut own| {
            (0..ROUNDS).for_each(|_| own.advance(posed, watch));
            (own.number, own.finished(posed, watch))
        });
        let found = both.next().map(|first| match has_converged(&first.1) {
            true => first,
            false => both
                .next()
                .filter(|(_, other)| has_converged(other))
                .unwrap_or(first),
        });
        if let Some((number, own)) = found {
            solved[number] = Some(own);
        }
        Raced {
            same: (0..starts.len()).collect(),
            solved,
        }
    }

    /// The same problem with the initial states that kicks change as the models have them.
    fn at_rest(&self, posed: &Posed<'_>, problem: &Collocation) -> Collocation {
        let mut runs = problem.runs.clone();
        for (j, run) in runs.iter_mut().enumerate() {
            for k in &self.kicked {
                run.initial[*k] = run.initial[*k].or(Some(posed.states[*k].guesses[j]));
            }
        }
        problem.with_runs(runs)
    }

    /// Improves a solution by other initial states of its runs. `number` is that of its start.
    pub fn improved(
        &self,
        posed: &Posed<'_>,
        own: Solved,
        number: usize,
        watch: &Watch<'_, '_>,
    ) -> Solved {
        let mut own = Tumbling::new(self, number, own);
        (0..ROUNDS).for_each(|_| own.advance(posed, watch));
        own.finished(posed, watch)
    }

    /// The variables of a solution with the best of several tumbles of each run at the same parameters. None if no run gains.
    fn better(
        &self,
        posed: &Posed<'_>,
        best: &Solved,
        round: usize,
        work: &mut Work,
        watch: &Watch<'_, '_>,
    ) -> Option<Vec<f64>> {
        let (problem, z) = (&best.problem, &best.solution.iterate.z);
        let theta = problem.physical_theta(z);
        let paths = paths(problem, z);
        let kept = (0..problem.n_states()).filter(|k| !self.moved.contains(k));
        let of_state = |k: usize| -> Vec<Vec<f64>> {
            let runs = paths.iter();
            runs.map(|run| run.iter().map(|x| x[k]).collect()).collect()
        };
        let kept: Vec<(usize, Vec<Vec<f64>>)> = kept.map(|k| (k, of_state(k))).collect();
        let kept: Vec<Recorded<'_>> = kept.iter().map(|(k, own)| (*k, &own[..])).collect();
        let at = Kept {
            tumbles: self,
            followed: Followed::new(&posed.model.system, &problem.runs, &kept),
            sizes: sizes(&paths),
            theta: &theta,
            posed,
        };
        let model = Arc::new(problem.model.tapes.at(&theta));
        let runs = (0..problem.runs.len()).into_par_iter().map(|j| {
            let seed = (round * problem.runs.len() + j) as u64;
            let run = OneRun::of(problem, model.clone(), z, j);
            run.best(&at, (j, &paths[j][0]), seed, watch)
        });
        let found: Vec<(Option<Vec<f64>>, Work)> = runs.collect();
        let mut moved = z.clone();
        let mut gains = false;
        for (j, (states, own)) in found.into_iter().enumerate() {
            *work += own;
            if let Some(states) = states {
                moved[problem.layout.runs[j].variables()].copy_from_slice(&states);
                gains = true;
            }
        }
        (gains && !watch.is_over()).then_some(moved)
    }
}

/// A solution that is improved by other initial states, round by round.
struct Tumbling<'t> {
    tumbles: &'t Tumbles,
    /// Number of its start.
    number: usize,
    round: usize,
    /// Rounds without gain.
    idle: usize,
    own: Solved,
    /// The last solution that had converged.
    converged: Option<Solved>,
}

/// The problem of a solution with scales of its typical sizes, and its variables.
fn sized(own: &Solved) -> (Collocation, Vec<f64>) {
    let (problem, z) = (&own.problem, &own.solution.iterate.z);
    let paths = paths(problem, z);
    let pairs = sizes(&paths).into_iter().zip(&problem.model.scales.states);
    let states = pairs.map(|(own, before)| if own > 0.0 { own } else { *before });
    let scales = Scales {
        states: states.collect(),
        ..Scales::of(&paths, &problem.physical_theta(z))
    };
    let again = Collocation::new(
        problem.model.tapes.clone(),
        problem.constraints.clone(),
        problem.scheme,
        problem.runs.clone(),
        scales,
        &problem.bounds,
    );
    let z = problem.carried(z, &again);
    (again, z)
}

/// States of each run at its samples.
fn paths(problem: &Collocation, z: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let runs = 0..problem.runs.len();
    runs.map(|j| problem.states_at_samples(z, j)).collect()
}

impl<'t> Tumbling<'t> {
    fn new(tumbles: &'t Tumbles, number: usize, mut own: Solved) -> Self {
        if own.within(NEARLY).is_finite() {
            (own.problem, own.solution.iterate.z) = sized(&own);
        }
        Self {
            tumbles,
            number,
            round: 0,
            idle: 0,
            own,
            converged: None,
        }
    }

    /// One more round, unless the last ones gained nothing.
    fn advance(&mut self, posed: &Posed<'_>, watch: &Watch<'_, '_>) {
        if self.idle >= IDLE || watch.is_over() {
            return;
        }
        let own = &mut self.own;
        let mut work = own.solution.work;
        let better = match own.within(NEARLY).is_finite() {
            true => self
                .tumbles
                .better(posed, own, self.round, &mut work, watch),
            false => None,
        };
        self.round += 1;
        if better.is_none() && own.solution.status != Status::IterationLimit {
            own.solution.work = work;
            self.idle += 1;
            return;
        }
        let see = |iteration: &_| watch.see(self.number, 0, iteration);
        let limit = HEAT.min(posed.most_iterations);
        let z = better.unwrap_or_else(|| own.solution.iterate.z.clone());
        let mut next = once(posed, (own.problem.clone(), z), limit, &see);
        next.solution.work += work;
        if next.within(NEARLY) < own.within(NEARLY) {
            self.idle = 0;
            let before = std::mem::replace(own, next);
            if has_converged(&before) {
                self.converged = Some(before);
            }
        } else {
            own.solution.work = next.solution.work;
            self.idle += 1;
        }
    }

    /// Continues to the end. If that does not converge, the last solution that did.
    fn finished(self, posed: &Posed<'_>, watch: &Watch<'_, '_>) -> Solved {
        let mut own = self.own;
        if !has_converged(&own) && !watch.is_over() {
            let see = |iteration: &_| watch.see(self.number, 0, iteration);
            let work = own.solution.work;
            let limit = posed.most_iterations;
            own = solve(posed, (own.problem, own.solution.iterate.z), limit, &see);
            own.solution.work += work;
        }
        match self.converged {
            Some(converged) if !has_converged(&own) => converged,
            _ => own,
        }
    }
}

/// The states from which others lead to these, by pairs `(to, from)`, and these.
fn reached(ends: &[usize], count: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Vec<bool> {
    let pairs: Vec<(usize, usize)> = pairs.collect();
    let mut all = vec![false; count];
    ends.iter().for_each(|k| all[*k] = true);
    while let Some((_, from)) = pairs.iter().find(|(to, from)| all[*to] && !all[*from]) {
        all[*from] = true;
    }
    all
}

/// A typical magnitude of each state: the largest in the run in which it is least, since other runs may tumble wildly.
fn sizes(paths: &[Vec<Vec<f64>>]) -> Vec<f64> {
    let largest =
        |path: &Vec<Vec<f64>>, k: usize| path.iter().fold(0.0, |most: f64, x| most.max(x[k].abs()));
    let calmest = |k: usize| {
        paths
            .iter()
            .map(|path| largest(path, k))
            .fold(f64::INFINITY, f64::min)
    };
    (0..paths[0][0].len()).map(calmest).collect()
}

/// The system in which what no kick moves keeps its path.
struct Kept<'k, 'f> {
    tumbles: &'k Tumbles,
    /// None if everything moves.
    followed: Option<Followed>,
    sizes: Vec<f64>,
    theta: &'k [f64],
    posed: &'k Posed<'f>,
}

/// One run of a problem at known parameters.
struct OneRun {
    problem: Collocation,
    /// Its variables at the solution of the whole problem.
    z: Vec<f64>,
    objective: f64,
}

impl OneRun {
    /// Extracts run `j`; `model` is that of the whole problem at its parameters.
    fn of(whole: &Collocation, model: Arc<Differentiated>, z: &[f64], j: usize) -> Self {
        let problem = Collocation::new(
            model,
            ParameterConstraints::default(),
            whole.scheme,
            vec![whole.runs[j].clone()],
            Scales {
                states: whole.model.scales.states.clone(),
                parameters: Vec::new(),
            },
            &whole.bounds,
        );
        let z = whole.coefficients(z, j).to_vec();
        let mut c = vec![0.0; problem.n_equalities()];
        let mut g = vec![0.0; problem.limits().0.len()];
        Self {
            objective: problem.evaluate(&z, &mut c, &mut g),
            problem,
            z,
        }
    }

    /// The variables of the best of several tumbles, if it is better than the solution, and the work that it took.
    fn best(
        mut self,
        kept: &Kept<'_, '_>,
        (j, initial): (usize, &[f64]),
        seed: u64,
        watch: &Watch<'_, '_>,
    ) -> (Option<Vec<f64>>, Work) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut work, mut gains) = (Work::default(), false);
        for _ in 0..KICKS {
            let kick = kick(kept.tumbles.kicked.len(), &mut random);
            if watch.is_over() {
                break;
            }
            let mut initial = initial.to_vec();
            for (k, own) in kept.tumbles.kicked.iter().zip(kick) {
                if self.problem.runs[0].initial[*k].is_none() {
                    initial[*k] += own * kept.sizes[*k];
                }
            }
            let Some(z) = self.from(kept, (j, &initial), watch) else {
                continue;
            };
            let solution = self.solved(kept.posed, z, watch);
            work += solution.1;
            if let Some((objective, z)) = solution.0 {
                (self.objective, self.z, gains) = (objective, z, true);
            }
        }
        (gains.then_some(self.z), work)
    }

    /// The variables with these initial states. None if the simulation from there ends early.
    fn from(
        &self,
        kept: &Kept<'_, '_>,
        (j, initial): (usize, &[f64]),
        watch: &Watch<'_, '_>,
    ) -> Option<Vec<f64>> {
        let run = &self.problem.runs[0];
        let quality = Quality {
            tolerance: GUESS,
            magnitudes: kept.sizes.clone(),
            most_steps: STEPS * run.time.len(),
        };
        let stop = || watch.is_over();
        let course = match &kept.followed {
            Some(followed) => {
                followed.simulate(kept.posed, (j, initial), kept.theta, &quality, &stop)
            }
            None => (kept.posed.model).course(run, kept.theta, initial, &quality, &stop),
        };
        let path = (&course.time[..], &course.states[..]);
        let is_whole = course.is_whole && !watch.is_over();
        is_whole.then(|| self.problem.variables_along([path].into_iter(), &[]))
    }

    /// Objective and variables of the optimum reached from these variables, if it is below that of this run, and the work.
    fn solved(
        &self,
        posed: &Posed<'_>,
        z: Vec<f64>,
        watch: &Watch<'_, '_>,
    ) -> (Option<(f64, Vec<f64>)>, Work) {
        let options = SqpOptions {
            tolerance: ROUGH,
            ..sqp_options(posed, ITERATIONS)
        };
        let mut race = Behind::new(Some(self.objective));
        let mut see = |iteration: &Iteration| match race.is_lost(iteration) || watch.is_over() {
            true => ControlFlow::Break(Status::Stopped),
            false => ControlFlow::Continue(()),
        };
        let solution = pilotage_collocation::solve(&self.problem, z, &options, &mut see);
        let gains =
            solution.iterate.f < self.objective * (1.0 - GAIN) && solution.kkt.primal < ROUGH;
        let found = gains.then_some((solution.iterate.f, solution.iterate.z));
        (found, solution.work)
    }
}

/// Relative gain of a run that counts.
const GAIN: f64 = 1e-4;

/// Changes of states, relative to their sizes: of either sign, log-uniform.
fn kick(count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let unit = Uniform::new(0.0, 1.0).expect("0 is less than 1");
    let [least, most] = SIZES;
    let mut own = || {
        let sign = if unit.sample(random) < 0.5 { -1.0 } else { 1.0 };
        sign * least * f64::powf(most / least, unit.sample(random))
    };
    (0..count).map(|_| own()).collect()
}

#[cfg(test)]
mod tests;
