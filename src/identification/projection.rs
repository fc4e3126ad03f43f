//! Starts for problems with free initial states, by variable projection on the linearised model.
//!
//! Free initial states make many optima: each run may explain its samples by states of its own. But for a
//! given θ the linearised model is linear in them, so that the best ones, and the sum of squares that is left,
//! are a linear least squares problem of a few unknowns for each run (G. H. Golub and V. Pereyra, "The
//! differentiation of pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J.
//! Numer. Anal. 10(2), 1973). What remains is a function of θ alone, some 100 µs each: cheap enough to look at
//! thousands of pilots and to follow the best down to their optima. These are then the starts of the
//! nonlinear problem, with their states.

use super::constraints::Stability;
use super::linearised::{Linear, dot};
use super::multi_start::{Start, Starts};
use super::problem::Posed;
use crate::transcription::Run;
use nalgebra::{DMatrix, DVector};
use pilotage_models::Dynamics;
use pilotage_models::lti::Transition;
use rayon::prelude::*;

/// Most samples of a run that the search looks at.
const MOST_SAMPLES: usize = 200;
/// Of the drawn pilots so many go on; of these, so many after [`FIRST`] steps.
const PROMISING: [usize; 2] = [96, 32];
/// Levenberg–Marquardt steps of the promising ones, and of those that are left.
const FIRST: usize = 6;
const REST: usize = 60;
/// Relative gain of a step below which a descent has ended.
const FLAT: f64 = 1e-7;
/// Relative change of a parameter for a difference quotient.
const DIFFERENCE: f64 = 1e-6;
/// A column of which less than this part is new lies in the span of those before.
const DEPENDENT: f64 = 1e-9;
/// Optima whose sums of squares differ by less, relatively, are one.
const SAME: f64 = 1e-3;
/// A correction of a smaller magnitude is none, in the state's unit per second.
const NEGLIGIBLE: f64 = 1e-9;
/// Optima within this factor of the best are starts, and so many at most.
const NEAR_BEST: f64 = 1.5;
const STARTS: usize = 6;

/// A model and its runs, as the linearised problem sees them.
pub struct Search<'a, D> {
    dynamics: &'a D,
    constraints: &'a Stability,
    /// States whose equations have a correction, which stands behind the inputs of each run.
    corrected: Vec<usize>,
    runs: Vec<Run>,
    step: f64,
    sampled: Vec<Sampled>,
}

/// One run on an even grid.
struct Sampled {
    inputs: Vec<Vec<f64>>,
    measured: Vec<f64>,
    weight: f64,
    initial: Vec<Option<f64>>,
}

impl<'a, D: Dynamics> Search<'a, D> {
    /// Of a problem.
    pub fn of(posed: &'a Posed<D>) -> Self {
        Self::with(posed, Vec::new(), posed.runs.clone())
    }

    /// Of a problem of which the solution at some other θ is known, with the states of each run at its
    /// samples: what the linearisation leaves out along them is kept as a known function of time. Since all
    /// pilots that fit move the vehicle as it was recorded, it is nearly the same for all of them.
    pub fn about(posed: &'a Posed<D>, theta: &[f64], states: &[Vec<Vec<f64>>]) -> Self {
        let linear = Linear::of(&posed.dynamics, theta);
        let n = posed.dynamics.n_states();
        let mut dx = vec![0.0; n];
        let mut left_out = |x: &Vec<f64>, w: &Vec<f64>| -> Vec<f64> {
            posed.dynamics.derivative(x, w, theta, &mut dx);
            let linear = linear.derivative(x, w);
            dx.iter().zip(linear).map(|(f, l)| f - l).collect()
        };
        let corrections: Vec<Vec<Vec<f64>>> = (states.iter().zip(&posed.runs))
            .map(|(states, run)| {
                states
                    .iter()
                    .zip(&run.inputs)
                    .map(|(x, w)| left_out(x, w))
                    .collect()
            })
            .collect();
        let largest = |i: usize| {
            corrections
                .iter()
                .flatten()
                .fold(0.0, |m: f64, d| m.max(d[i].abs()))
        };
        let corrected: Vec<usize> = (0..n).filter(|&i| largest(i) > NEGLIGIBLE).collect();
        let mut runs = posed.runs.clone();
        for (run, corrections) in runs.iter_mut().zip(&corrections) {
            for (inputs, correction) in run.inputs.iter_mut().zip(corrections) {
                inputs.extend(corrected.iter().map(|&i| correction[i]));
            }
        }
        Self::with(posed, corrected, runs)
    }

    fn with(posed: &'a Posed<D>, corrected: Vec<usize>, runs: Vec<Run>) -> Self {
        let even = |run: &Run| duration(run) / (run.time.len() - 1).min(MOST_SAMPLES) as f64;
        let step = runs.iter().map(even).fold(0.0, f64::max);
        Self {
            dynamics: &posed.dynamics,
            constraints: &posed.constraints,
            corrected,
            step,
            sampled: runs.iter().map(|run| Sampled::of(run, step)).collect(),
            runs,
        }
    }

    /// The linearised model, with an input for each correction.
    fn linear(&self, theta: &[f64]) -> Linear {
        Linear::of(self.dynamics, theta).driven(&self.corrected)
    }

    /// The best optima to which descents from `draws` lead, best first, with their states.
    pub fn starts(&self, draws: Vec<Vec<f64>>) -> Starts {
        let look = |theta: Vec<f64>| Descent::at(self, theta);
        let mut descents: Vec<Descent> = draws.into_par_iter().filter_map(look).collect();
        for (keep, steps) in PROMISING.into_iter().zip([FIRST, REST]) {
            sort(&mut descents);
            descents.truncate(keep);
            (descents.par_iter_mut()).for_each(|descent| descent.go_down(self, steps));
        }
        sort(&mut descents);
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
        let mut projection = Projection::new(&responses, &sampled.initial);
        let mut residual = sampled.unexplained(&linear, &transition, self.step);
        let free = projection.remove(&mut residual);
        let mut x: Vec<f64> = (sampled.initial.iter().zip(free))
            .map(|(known, free)| known.unwrap_or(free))
            .collect();
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

    /// The residuals that no initial states remove, all runs after each other; none outside the constraints.
    fn residuals(&self, theta: &[f64]) -> Option<Vec<f64>> {
        if !self.constraints.holds(theta) {
            return None;
        }
        let linear = self.linear(theta);
        let transition = linear.transition(self.step)?;
        let longest = self.sampled.iter().map(|run| run.measured.len()).max()?;
        let responses = linear.responses(&transition, longest);
        let mut projections: Vec<(usize, &[Option<f64>], Projection)> = Vec::new();
        let mut all = Vec::new();
        for run in &self.sampled {
            let samples = run.measured.len();
            let same = |(n, initial, _): &&(usize, &[Option<f64>], Projection)| {
                *n == samples
                    && initial
                        .iter()
                        .zip(&run.initial)
                        .all(|(a, b)| a.is_some() == b.is_some())
            };
            if projections.iter().find(same).is_none() {
                let projection = Projection::new(&responses[..samples], &run.initial);
                projections.push((samples, &run.initial, projection));
            }
            let (_, _, projection) = projections.iter_mut().find(|p| same(&&**p))?;
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

/// The first of each group of sorted descents that ended within [`SAME`] of each other, with how many they are;
/// of those near the best, some.
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
    /// Linear between samples; missing measurements are bridged.
    fn of(run: &Run, step: f64) -> Self {
        let count = (duration(run) / step + 1e-6).floor() as usize + 1;
        let known: Vec<usize> = (0..run.time.len())
            .filter(|&k| run.measured[k].is_finite())
            .collect();
        let times: Vec<f64> = known.iter().map(|&k| run.time[k]).collect();
        let values: Vec<f64> = known.iter().map(|&k| run.measured[k]).collect();
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
            weight: run.weight,
            initial: run.initial.clone(),
        }
    }
}

impl Sampled {
    /// What the inputs and the known initial states leave of the measurements.
    fn unexplained(&self, linear: &Linear, transition: &Transition, step: f64) -> Vec<f64> {
        let mut x: Vec<f64> = self
            .initial
            .iter()
            .map(|known| known.unwrap_or(0.0))
            .collect();
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

/// The value at `t` on the straight line between its neighbours; the nearest beyond the ends.
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

/// An orthonormal basis of the outputs that the free initial states make, by Gram and Schmidt's method, each
/// column twice.
struct Projection {
    /// Free states that add a direction, and that direction.
    basis: Vec<(usize, Vec<f64>)>,
    /// Coefficients of each basis vector's own column over the vectors up to it.
    triangle: Vec<Vec<f64>>,
    states: usize,
}

impl Projection {
    fn new(responses: &[Vec<f64>], initial: &[Option<f64>]) -> Self {
        let mut out = Self {
            basis: Vec::new(),
            triangle: Vec::new(),
            states: initial.len(),
        };
        for state in (0..initial.len()).filter(|&i| initial[i].is_none()) {
            let mut column: Vec<f64> = responses.iter().map(|row| row[state]).collect();
            let before = dot(&column, &column).sqrt();
            let mut coefficients = vec![0.0; out.basis.len() + 1];
            for _ in 0..2 {
                for ((_, q), coefficient) in out.basis.iter().zip(&mut coefficients) {
                    let along = dot(q, &column);
                    column.iter_mut().zip(q).for_each(|(v, q)| *v -= along * q);
                    *coefficient += along;
                }
            }
            let left = dot(&column, &column).sqrt();
            if left > DEPENDENT * before {
                column.iter_mut().for_each(|v| *v /= left);
                coefficients[out.basis.len()] = left;
                out.triangle.push(coefficients);
                out.basis.push((state, column));
            }
        }
        out
    }

    /// Takes out of the residuals what initial states explain, and tells these; zero for those that add nothing.
    fn remove(&mut self, residual: &mut [f64]) -> Vec<f64> {
        let mut along = Vec::with_capacity(self.basis.len());
        for (_, q) in &self.basis {
            let part = dot(q, residual);
            residual.iter_mut().zip(q).for_each(|(r, q)| *r -= part * q);
            along.push(part);
        }
        let mut states = vec![0.0; self.states];
        for k in (0..along.len()).rev() {
            let value = along[k] / self.triangle[k][k];
            for (i, along) in along[..k].iter_mut().enumerate() {
                *along -= value * self.triangle[k][i];
            }
            states[self.basis[k].0] = value;
        }
        states
    }
}

/// A descent of the projected sum of squares by Levenberg's and Marquardt's method, inside the constraints.
struct Descent {
    theta: Vec<f64>,
    residuals: Vec<f64>,
    objective: f64,
    damping: f64,
}

impl Descent {
    fn at<D: Dynamics>(search: &Search<D>, theta: Vec<f64>) -> Option<Self> {
        let residuals = search.residuals(&theta)?;
        Some(Self {
            objective: dot(&residuals, &residuals),
            theta,
            residuals,
            damping: 1e-2,
        })
    }

    fn go_down<D: Dynamics>(&mut self, search: &Search<D>, steps: usize) {
        for _ in 0..steps {
            let before = self.objective;
            if !self.step(search) || before - self.objective <= FLAT * before {
                return;
            }
        }
    }

    /// One step; false where none goes down.
    fn step<D: Dynamics>(&mut self, search: &Search<D>) -> bool {
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

    /// Derivatives of the residuals by the scaled parameters; a quotient goes the other way at a constraint.
    fn jacobian<D: Dynamics>(&self, search: &Search<D>) -> Option<DMatrix<f64>> {
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

/// What counts as a change of a parameter: its size, or a small part of the largest.
fn scale(value: f64, all: &[f64]) -> f64 {
    let largest = all.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
    value.abs().max(1e-6 * largest)
}
