//! Starts for problems with free initial states, by variable projection on the linearised model.
//!
//! Free initial states cause many local optima: each run may explain its samples by its own states. For a given θ,
//! however, the linearised model is linear in them, so that the optimal states and the remaining sum of squares are a
//! linear least-squares problem with a few unknowns per run (G. H. Golub and V. Pereyra, "The differentiation of
//! pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal. 10(2), 1973).
//! The result is a function of θ alone that takes some 100 µs per evaluation: cheap enough to evaluate thousands of
//! pilots and to minimise from the best ones. The optima, with their states, are the starts of the nonlinear problem.

use super::constraints::Stability;
use super::linearised::{Linear, dot};
use super::multi_start::{Start, Starts};
use super::problem::Posed;
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{Differentiated, Run};
use pilotage_models::lti::Transition;
use rayon::prelude::*;

/// Maximum number of samples of a run in the search.
const MOST_SAMPLES: usize = 200;
/// Number of drawn pilots that are continued, and of these, the number after [`FIRST`] steps.
const PROMISING: [usize; 2] = [96, 32];
/// Number of Levenberg–Marquardt steps of the promising ones, and of the remaining ones.
const FIRST: usize = 6;
const REST: usize = 40;
/// Number of draws, and of descents, between two checks whether to continue.
const LOOKS: usize = 200;
const DESCENTS: usize = 16;
/// Approximate share of the draws in the work.
const LOOKING: f64 = 0.3;
/// Relative gain of a step below which a descent ends.
const FLAT: f64 = 1e-5;
/// Relative change of a parameter in a finite difference.
const DIFFERENCE: f64 = 1e-6;
/// A column whose remainder is below this part is in the span of the previous ones.
const DEPENDENT: f64 = 1e-9;
/// Relative difference of sums of squares below which two optima are equal.
const SAME: f64 = 1e-3;
/// Magnitude of a correction below which it is ignored, in the state's unit per second.
const NEGLIGIBLE: f64 = 1e-9;
/// Optima within this factor of the best become starts, up to the maximum number below.
const NEAR_BEST: f64 = 1.5;
const STARTS: usize = 6;

/// A model and its runs in the linearised problem.
pub struct Search<'a> {
    model: &'a Differentiated,
    stability: &'a Stability,
    /// States whose equations have a correction; the corrections follow the inputs of each run.
    corrected: Vec<usize>,
    runs: Vec<Run>,
    step: f64,
    sampled: Vec<Sampled>,
}

/// One run on a uniform grid.
struct Sampled {
    inputs: Vec<Vec<f64>>,
    measured: Vec<f64>,
    weight: f64,
    /// Known initial states; zero where free.
    initial: Vec<f64>,
    /// Indices of the free ones.
    free: Vec<usize>,
}

impl<'a> Search<'a> {
    /// The search for a problem.
    pub fn of(posed: &'a Posed) -> Self {
        Self::with(posed, Vec::new(), posed.runs.clone())
    }

    /// The search for a problem with a known solution at another θ, with the states of each run at its samples: the
    /// linearisation error along that solution is kept as a known function of time. It is nearly the same for all
    /// pilots that fit, since they all move the vehicle as recorded.
    pub fn about(posed: &'a Posed, theta: &[f64], states: &[Vec<Vec<f64>>]) -> Self {
        let linear = Linear::of(&posed.model, theta);
        let n = posed.model.n_states();
        let left_out = |x: &Vec<f64>, w: &Vec<f64>| -> Vec<f64> {
            let all = posed.model.evaluate(0.0, x, w, theta);
            let linear = linear.derivative(x, w);
            all.iter().zip(linear).map(|(f, l)| f - l).collect()
        };
        let of_run = |(states, run): (&Vec<Vec<f64>>, &Run)| -> Vec<Vec<f64>> {
            let samples = states.iter().zip(&run.inputs);
            samples.map(|(x, w)| left_out(x, w)).collect()
        };
        let corrections: Vec<Vec<Vec<f64>>> = states.iter().zip(&posed.runs).map(of_run).collect();
        let all = || corrections.iter().flatten();
        let largest = |i: usize| all().fold(0.0, |m: f64, d| m.max(d[i].abs()));
        let corrected: Vec<usize> = (0..n).filter(|&i| largest(i) > NEGLIGIBLE).collect();
        let mut runs = posed.runs.clone();
        for (run, corrections) in runs.iter_mut().zip(&corrections) {
            for (inputs, correction) in run.inputs.iter_mut().zip(corrections) {
                inputs.extend(corrected.iter().map(|&i| correction[i]));
            }
        }
        Self::with(posed, corrected, runs)
    }

    fn with(posed: &'a Posed, corrected: Vec<usize>, runs: Vec<Run>) -> Self {
        let even = |run: &Run| duration(run) / (run.time.len() - 1).min(MOST_SAMPLES) as f64;
        let step = runs.iter().map(even).fold(0.0, f64::max);
        Self {
            model: &posed.model,
            stability: &posed.stability,
            corrected,
            step,
            sampled: runs.iter().map(|run| Sampled::of(run, step)).collect(),
            runs,
        }
    }

    /// The linearised model, with an additional input for each correction.
    fn linear(&self, theta: &[f64]) -> Linear {
        Linear::of(self.model, theta).driven(&self.corrected)
    }

    /// Results of descents from the most promising of `draws`, best first; `watch` receives the completed share of the
    /// work and returns whether to stop.
    pub fn descents(
        &self,
        draws: Vec<Vec<f64>>,
        watch: &mut dyn FnMut(f64) -> bool,
    ) -> Vec<Descent> {
        let look = |theta: &Vec<f64>| Descent::at(self, theta.clone());
        let mut descents: Vec<Descent> = Vec::new();
        for (i, some) in draws.chunks(LOOKS).enumerate() {
            if watch(LOOKING * (i * LOOKS) as f64 / draws.len() as f64) {
                break;
            }
            descents.par_extend(some.par_iter().filter_map(look));
        }
        for (phase, (keep, steps)) in PROMISING.into_iter().zip([FIRST, REST]).enumerate() {
            sort(&mut descents);
            descents.truncate(keep);
            for (i, some) in descents.chunks_mut(DESCENTS).enumerate() {
                let part = (phase as f64 + (i * DESCENTS) as f64 / keep as f64) / 2.0;
                if watch(LOOKING + (1.0 - LOOKING) * part) {
                    break;
                }
                (some.par_iter_mut()).for_each(|descent| descent.go_down(self, steps));
            }
        }
        sort(&mut descents);
        descents
    }

    /// The best optima of these descents, best first, with their states.
    pub fn starts(&self, descents: Vec<Descent>) -> Starts {
        let all = descents.len();
        let optima = distinct(descents);
        Starts {
            lost: all - optima.iter().map(|(_, count)| count).sum::<usize>(),
            all: (optima.into_iter())
                .map(|(descent, count)| self.start(descent.theta, count))
                .collect(),
            ..Starts::default()
        }
    }

    fn start(&self, theta: Vec<f64>, descents: usize) -> Start {
        let runs = 0..self.runs.len();
        Start {
            states: runs.map(|j| self.states(&theta, j)).collect(),
            theta,
            descents,
        }
    }

    /// The states of run `j` at its samples, in the solution of the linearised problem.
    fn states(&self, theta: &[f64], j: usize) -> Option<Vec<Vec<f64>>> {
        let (linear, run, sampled) = (self.linear(theta), &self.runs[j], &self.sampled[j]);
        let transition = linear.transition(self.step)?;
        let responses = linear.responses(&transition, sampled.measured.len());
        let projection = Projection::new(&responses, &sampled.free);
        let mut residual = sampled.unexplained(&linear, &transition, self.step);
        let mut x = sampled.initial.clone();
        for (state, value) in projection.remove(&mut residual) {
            x[state] = value;
        }
        let mut states = vec![x.clone()];
        let mut last: Option<(f64, Transition)> = None;
        for k in 1..run.time.len() {
            let h = run.time[k] - run.time[k - 1];
            let known = last.take_if(|(step, _)| (*step - h).abs() < 1e-9 * h);
            let (_, transition) = last.insert(known.or_else(|| Some((h, linear.transition(h)?)))?);
            let slopes: Vec<f64> = (run.inputs[k].iter().zip(&run.inputs[k - 1]))
                .map(|(next, now)| (next - now) / h)
                .collect();
            let mut next = vec![0.0; x.len()];
            transition.apply(&x, &run.inputs[k - 1], &slopes, &mut next);
            x = next;
            states.push(x.clone());
        }
        let finite = states.iter().flatten().all(|x| x.is_finite());
        finite.then_some(states)
    }

    /// Residuals that no initial states remove, of all runs in sequence; `None` if the constraints are violated.
    fn residuals(&self, theta: &[f64]) -> Option<Vec<f64>> {
        if !self.stability.holds(theta) {
            return None;
        }
        let linear = self.linear(theta);
        let transition = linear.transition(self.step)?;
        let longest = self.sampled.iter().map(|run| run.measured.len()).max()?;
        let responses = linear.responses(&transition, longest);
        // Runs of equal length with the same free states share a projection.
        let mut projections: Vec<((usize, &[usize]), Projection)> = Vec::new();
        let mut all = Vec::new();
        for run in &self.sampled {
            let key = (run.measured.len(), run.free.as_slice());
            if !projections.iter().any(|(known, _)| *known == key) {
                projections.push((key, Projection::new(&responses[..key.0], key.1)));
            }
            let (_, projection) = projections.iter().find(|(known, _)| *known == key)?;
            let mut residual = run.unexplained(&linear, &transition, self.step);
            projection.remove(&mut residual);
            let weight = run.weight.sqrt();
            all.extend(residual.into_iter().map(|r| weight * r));
        }
        all.iter().all(|r| r.is_finite()).then_some(all)
    }
}

fn duration(run: &Run) -> f64 {
    run.time[run.time.len() - 1] - run.time[0]
}

/// The first of each group of sorted descents within [`SAME`] of each other, with the size of the group; only the best
/// groups near the optimum.
fn distinct(descents: Vec<Descent>) -> Vec<(Descent, usize)> {
    let best = descents.first().map_or(0.0, |d| d.objective);
    let mut optima: Vec<(Descent, usize)> = Vec::new();
    for descent in descents {
        let same = |(first, _): &&mut (Descent, usize)| {
            descent.objective <= first.objective * (1.0 + SAME)
        };
        match optima.last_mut().filter(same) {
            Some((_, count)) => *count += 1,
            None => optima.push((descent, 1)),
        }
    }
    optima.retain(|(descent, _)| descent.objective <= NEAR_BEST * best);
    optima.truncate(STARTS);
    optima
}

fn sort(descents: &mut [Descent]) {
    descents.sort_by(|a, b| a.objective.total_cmp(&b.objective));
}

impl Sampled {
    /// Linear interpolation between samples, also across missing measurements.
    fn of(run: &Run, step: f64) -> Self {
        let count = (duration(run) / step + 1e-6).floor() as usize + 1;
        let known: Vec<usize> = (0..run.time.len())
            .filter(|&k| run.measured[0].values[k].is_finite())
            .collect();
        let times: Vec<f64> = known.iter().map(|&k| run.time[k]).collect();
        let values: Vec<f64> = known.iter().map(|&k| run.measured[0].values[k]).collect();
        let at = |k: usize| run.time[0] + k as f64 * step;
        let input = |i: usize| -> Vec<f64> { run.inputs.iter().map(|w| w[i]).collect() };
        let inputs: Vec<Vec<f64>> = (0..run.inputs[0].len()).map(input).collect();
        Self {
            inputs: (0..count)
                .map(|k| {
                    inputs
                        .iter()
                        .map(|w| between(&run.time, w, at(k)))
                        .collect()
                })
                .collect(),
            measured: (0..count)
                .map(|k| between(&times, &values, at(k)))
                .collect(),
            weight: run.measured[0].weight,
            initial: run
                .initial
                .iter()
                .map(|known| known.unwrap_or(0.0))
                .collect(),
            free: (0..run.initial.len())
                .filter(|&i| run.initial[i].is_none())
                .collect(),
        }
    }

    /// Measurements minus the response to the inputs and the known initial states.
    fn unexplained(&self, linear: &Linear, transition: &Transition, step: f64) -> Vec<f64> {
        let mut x = self.initial.clone();
        let mut next = x.clone();
        let mut slopes = vec![0.0; linear.b.ncols()];
        let mut out = Vec::with_capacity(self.measured.len());
        for (k, measured) in self.measured.iter().enumerate() {
            out.push(measured - dot(&linear.c, &x));
            if let Some(ahead) = self.inputs.get(k + 1) {
                for (slope, (to, from)) in slopes.iter_mut().zip(ahead.iter().zip(&self.inputs[k]))
                {
                    *slope = (to - from) / step;
                }
                transition.apply(&x, &self.inputs[k], &slopes, &mut next);
                std::mem::swap(&mut x, &mut next);
            }
        }
        out
    }
}

/// Linear interpolation at `t`; the nearest value beyond the ends.
fn between(time: &[f64], values: &[f64], t: f64) -> f64 {
    let to = time.partition_point(|s| *s < t);
    match (to.checked_sub(1), values.get(to)) {
        (Some(from), Some(&next)) => {
            let c = (t - time[from]) / (time[to] - time[from]);
            values[from] + c * (next - values[from])
        }
        (Some(from), None) => values[from],
        (None, _) => values.first().copied().unwrap_or(0.0),
    }
}

/// Orthonormal basis of the outputs due to the free initial states, by the Gram–Schmidt method applied twice.
struct Projection {
    directions: Vec<Direction>,
}

/// Contribution of one free state in addition to the previous ones.
struct Direction {
    state: usize,
    /// Unit vector, orthogonal to the previous ones.
    unit: Vec<f64>,
    /// The state's outputs in terms of the directions up to this one.
    coefficients: Vec<f64>,
}

impl Projection {
    /// Built from the outputs at each sample for each unit initial state.
    fn new(responses: &[Vec<f64>], free: &[usize]) -> Self {
        let mut directions: Vec<Direction> = Vec::new();
        for &state in free {
            let mut unit: Vec<f64> = responses.iter().map(|row| row[state]).collect();
            let before = dot(&unit, &unit).sqrt();
            let mut coefficients = vec![0.0; directions.len()];
            for _ in 0..2 {
                for (direction, coefficient) in directions.iter().zip(&mut coefficients) {
                    *coefficient += take_out(&direction.unit, &mut unit);
                }
            }
            let left = dot(&unit, &unit).sqrt();
            if left > DEPENDENT * before {
                unit.iter_mut().for_each(|v| *v /= left);
                coefficients.push(left);
                directions.push(Direction {
                    state,
                    unit,
                    coefficients,
                });
            }
        }
        Self { directions }
    }

    /// Removes from the residuals what initial states explain, and returns these states with their values, last first;
    /// states without a contribution are left out.
    fn remove(&self, residual: &mut [f64]) -> Vec<(usize, f64)> {
        let directions = self.directions.iter();
        let mut along: Vec<f64> = directions.map(|d| take_out(&d.unit, residual)).collect();
        let mut states = Vec::new();
        for (k, direction) in self.directions.iter().enumerate().rev() {
            let value = along[k] / direction.coefficients[k];
            for (along, coefficient) in along.iter_mut().zip(&direction.coefficients) {
                *along -= value * coefficient;
            }
            states.push((direction.state, value));
        }
        states
    }
}

/// Removes the component along a unit vector from `v` and returns its length.
fn take_out(unit: &[f64], v: &mut [f64]) -> f64 {
    let along = dot(unit, v);
    v.iter_mut().zip(unit).for_each(|(v, u)| *v -= along * u);
    along
}

/// Minimisation of the projected sum of squares by the Levenberg–Marquardt method, within the constraints.
pub struct Descent {
    /// Current parameters.
    pub theta: Vec<f64>,
    residuals: Vec<f64>,
    objective: f64,
    damping: f64,
}

impl Descent {
    fn at(search: &Search<'_>, theta: Vec<f64>) -> Option<Self> {
        let residuals = search.residuals(&theta)?;
        Some(Self {
            objective: dot(&residuals, &residuals),
            theta,
            residuals,
            damping: 1e-2,
        })
    }

    fn go_down(&mut self, search: &Search<'_>, steps: usize) {
        for _ in 0..steps {
            let before = self.objective;
            if !self.step(search) || before - self.objective <= FLAT * before {
                return;
            }
        }
    }

    /// Takes one step; false if no step decreases the objective.
    fn step(&mut self, search: &Search<'_>) -> bool {
        let Some(jacobian) = self.jacobian(search) else {
            return false;
        };
        let (normal, gradient) = (jacobian.tr_mul(&jacobian), {
            let residuals = DVector::from_column_slice(&self.residuals);
            jacobian.tr_mul(&residuals)
        });
        for _ in 0..12 {
            let mut damped = normal.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + self.damping);
            let step = damped.cholesky().map(|factor| factor.solve(&gradient));
            let moved = step.map(|step| {
                let change = self.theta.iter().zip(step.iter());
                change
                    .map(|(t, s)| t - s * scale(*t, &self.theta))
                    .collect()
            });
            let trial = moved.and_then(|theta: Vec<f64>| Self::at(search, theta));
            match trial.filter(|trial| trial.objective < self.objective) {
                Some(trial) => {
                    let damping = (self.damping * 0.2).max(1e-12);
                    *self = Self { damping, ..trial };
                    return true;
                }
                None => self.damping = (self.damping * 5.0).max(1e-6),
            }
        }
        false
    }

    /// Derivatives of the residuals with respect to the scaled parameters; at a constraint the difference is taken in
    /// the other direction.
    fn jacobian(&self, search: &Search<'_>) -> Option<DMatrix<f64>> {
        let p = self.theta.len();
        let mut jacobian = DMatrix::zeros(self.residuals.len(), p);
        for i in 0..p {
            let by = DIFFERENCE * scale(self.theta[i], &self.theta);
            let column = [by, -by].into_iter().find_map(|by| {
                let mut theta = self.theta.clone();
                theta[i] += by;
                let moved = search.residuals(&theta)?;
                let sign = by.signum() / DIFFERENCE;
                Some((moved, sign))
            });
            let (moved, factor) = column?;
            for (k, (after, before)) in moved.iter().zip(&self.residuals).enumerate() {
                jacobian[(k, i)] = (after - before) * factor;
            }
        }
        Some(jacobian)
    }
}

/// Scale of a parameter: its magnitude, or a small part of the largest one.
fn scale(value: f64, all: &[f64]) -> f64 {
    let largest = all.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
    value.abs().max(1e-6 * largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FitOptions, InitialState, Trial, problem};
    use pilotage_models::{Pilot, lti::Transition};

    /// A stick fit is linear: from flights of a known pilot with known initial states the search recovers both, from
    /// another start, with zero residual.
    #[test]
    fn the_search_finds_a_linear_pilot_and_its_states() {
        let options = FitOptions {
            initial_state: InitialState::Free,
            objective: crate::Objective::Stick,
            pilot: Pilot { order: 2 },
            ..FitOptions::default()
        };
        let truth = [2.0, 3.0, -0.4, -0.9];
        let begin = [0.7, -0.3];
        let trial = |name: &str, target: f64| {
            let time: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
            let error = |t: f64| target * (0.7 * t).cos();
            let derivative = |x: &[f64], u: &[f64], dx: &mut [f64]| {
                options.pilot.derivative(x, u[0], &truth, dx);
            };
            let step = Transition::new([2, 1], 0.05, derivative).unwrap();
            let mut x = begin.to_vec();
            let mut stick = Vec::new();
            for t in &time {
                stick.push(options.pilot.output(&x, &truth));
                let (u, next) = (error(*t), error(t + 0.05));
                let mut after = vec![0.0; 2];
                step.apply(&x, &[u], &[(next - u) / 0.05], &mut after);
                x = after;
            }
            Trial {
                name: name.into(),
                origin: String::new(),
                sha256: String::new(),
                target: time.iter().map(|t| error(*t)).collect(),
                position: vec![0.0; time.len()],
                time,
                stick: Some(stick),
                weight: 1.0,
            }
        };
        let trials = [trial("a", 1.0), trial("b", -2.0)];
        let posed = problem::pose_stick(&trials, &options);
        let search = Search::of(&posed);
        let elsewhere = vec![vec![1.0, 2.0, -0.1, -0.1], vec![5.0, 4.0, -1.0, 0.5]];
        let starts = search.starts(search.descents(elsewhere, &mut |_| false));
        let best = &starts.all[0];
        for (found, expected) in best.theta.iter().zip(truth) {
            assert!((found - expected).abs() < 1e-5, "{:?}", best.theta);
        }
        for states in best.states.as_ref().unwrap() {
            for (found, expected) in states[0].iter().zip(begin) {
                assert!((found - expected).abs() < 1e-4, "{:?}", states[0]);
            }
        }
    }

    /// Comparison with the normal equations of a small problem, with one dependent column.
    #[test]
    fn a_projection_is_the_least_squares_solution() {
        let responses: Vec<Vec<f64>> = (0..6)
            .map(|k| {
                let t = f64::from(k);
                vec![1.0, t, 2.0 - t, t * t]
            })
            .collect();
        let y = [1.0, 0.5, -2.0, 4.0, 0.0, 3.0];
        let projection = Projection::new(&responses, &[0, 1, 2, 3]);
        let mut left = y.to_vec();
        let states = projection.remove(&mut left);
        assert_eq!(
            states.iter().map(|(state, _)| *state).collect::<Vec<_>>(),
            [3, 1, 0]
        );
        let columns = DMatrix::from_fn(6, 3, |k, i| responses[k][[0, 1, 3][i]]);
        let right = columns.tr_mul(&DVector::from_column_slice(&y));
        let expected = (columns.tr_mul(&columns)).cholesky().unwrap().solve(&right);
        for (&(_, found), expected) in states.iter().rev().zip(expected.iter()) {
            assert!((found - expected).abs() < 1e-12, "{states:?} {expected}");
        }
        let remaining = DVector::from_column_slice(&y) - columns * expected;
        for (found, expected) in left.iter().zip(remaining.iter()) {
            assert!((found - expected).abs() < 1e-12);
        }
    }
}
