//! Pieces of runs, simulated from the initial states that fit them best: noise and disturbances of a long run add up in a vehicle
//! that integrates, and more so in an unstable one.

use crate::posed::{Posed, poles_at};
use crate::search::begin::initial;
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{Quality, Run};
use rayon::prelude::*;

/// Number of pieces of a run, and growth of an unstable vehicle within one (the exponent).
const PIECES: f64 = 4.0;
const GROWTH: f64 = 3.0;
/// Delays up to this part of a piece are looked for.
const DELAYS: f64 = 0.125;
/// Least number of samples of a piece for each initial state and factor.
const FEWEST: usize = 4;
/// About the largest number of samples of all pieces, which are spread over the runs: more tell little more.
const MOST: usize = 6000;
/// Error tolerance of the simulations, and step of the differences, relative to the sizes of states.
const TOLERANCE: f64 = 1e-7;
const STEP: f64 = 1e-3;
/// Initial states, relative to their sizes, that have less than this part of the largest effect keep their values.
const RANK: f64 = 1e-3;
/// Steps towards the best initial states, and the size relative to that of the states at which there is none; one is enough for a
/// linear vehicle.
const STEPS: usize = 3;
const SMALL: f64 = 1e-3;

/// A piece of a run.
pub struct Window {
    run: Run,
    /// Recorded values of each measured signal at the samples, over its spread.
    recorded: Vec<Vec<f64>>,
    /// Response of each signal from the best initial states, and its derivatives with respect to these, over their sizes, and to factor and
    /// bias of each driven input.
    response: Vec<Vec<f64>>,
    states: Vec<Vec<Vec<f64>>>,
    inputs: Vec<Vec<Vec<f64>>>,
    /// Longest delay \[s\].
    pub longest: f64,
}

/// What is left of a piece at a delay after its initial states have been fitted: residuals, and their derivatives with respect to
/// factors and biases.
pub struct Left {
    pub residuals: DVector<f64>,
    pub inputs: DMatrix<f64>,
}

/// The pieces of all runs, with the driven inputs multiplied by a factor. None if they are too short, or a simulation fails.
pub fn windows(
    posed: &Posed<'_>,
    (drivers, factor): (usize, f64),
    spreads: &[f64],
) -> Option<Vec<Window>> {
    let poles = poles_at(posed, 0, &initial(posed, &[], 0), &[]);
    let growth = poles.iter().map(|pole| pole.re).fold(0.0, f64::max);
    let least = FEWEST * (posed.states.len() + 2 * drivers + 1);
    let mut all: Vec<(usize, Window)> = Vec::new();
    let samples: usize = posed.runs.iter().map(|run| run.time.len()).sum();
    let (every, mut pieces) = (samples.div_ceil(MOST), 0..);
    for (j, run) in posed.runs.iter().enumerate() {
        let (first, last) = (run.time[0], run.time[run.time.len() - 1]);
        let length = ((last - first) / PIECES).min(GROWTH / growth);
        let count = ((last - first) / length).ceil() as usize;
        for piece in 0..count.min(samples) {
            let begin = first + piece as f64 * length;
            let from = run.time.partition_point(|t| *t < begin);
            let to = run.time.partition_point(|t| *t <= begin + length);
            if to - from < least
                || !pieces
                    .next()
                    .is_some_and(|k: usize| k.is_multiple_of(every))
            {
                continue;
            }
            let mut own = Window::new(posed, j, from..to, spreads);
            own.longest = DELAYS * length;
            if own.seen().count() >= least {
                all.push((j, own));
            }
        }
    }
    let lines = vec![[factor, 0.0]; drivers];
    let simulated = all.into_par_iter().map(|(j, mut own)| {
        own.simulate(posed, (j, spreads), &lines)?;
        Some(own)
    });
    let all: Vec<Window> = simulated.collect::<Option<_>>()?;
    (!all.is_empty()).then_some(all)
}

impl Window {
    fn new(posed: &Posed<'_>, j: usize, samples: std::ops::Range<usize>, spreads: &[f64]) -> Self {
        let whole = &posed.runs[j];
        let time = whole.time[samples.clone()].to_vec();
        let recorded = posed.quantities.recorded.iter().zip(spreads);
        let recorded = recorded.map(|(all, spread)| {
            let own = all[j][samples.clone()].iter();
            own.map(|y| y / spread).collect()
        });
        let ends = [time[0], time[time.len() - 1]];
        let steps = whole.steps.cut(ends[0], ends[1]);
        Self {
            recorded: recorded.collect(),
            run: Run {
                mesh: steps.on(&ends),
                steps,
                inputs: whole.inputs[samples].to_vec(),
                measured: Vec::new(),
                initial: whole.initial.clone(),
                time,
            },
            response: Vec::new(),
            states: Vec::new(),
            inputs: Vec::new(),
            longest: 0.0,
        }
    }

    /// Finds the best initial states, and the response from there with its derivatives. Those with respect to the states are those
    /// of the first ones for a linear vehicle.
    fn simulate(
        &mut self,
        posed: &Posed<'_>,
        (j, spreads): (usize, &[f64]),
        lines: &[[f64; 2]],
    ) -> Option<()> {
        let mut x = initial(posed, &[], j);
        let sizes: Vec<f64> = (posed.states.iter().zip(&x))
            .map(|(state, x)| state.nominal.unwrap_or(1.0).max(x.abs()))
            .collect();
        let at = (&sizes[..], spreads);
        for step in 0..=STEPS {
            self.response = self.outputs(posed, &x, lines, at)?;
            let mut better = if step == 0 {
                None
            } else {
                Some(self.better()?)
            };
            if better.as_ref().is_none_or(|own| own.amax() >= SMALL) {
                let slope = |k: usize| {
                    let mut moved = x.clone();
                    moved[k] += STEP * sizes[k];
                    Some(self.slope(&self.outputs(posed, &moved, lines, at)?))
                };
                self.states = (0..x.len()).map(slope).collect::<Option<_>>()?;
                better = Some(self.better()?);
            }
            let better = better?;
            if step == STEPS || better.amax() < SMALL {
                break;
            }
            for (k, by) in better.iter().enumerate() {
                x[k] += by * sizes[k];
            }
        }
        let which = (0..lines.len()).flat_map(|k| [(k, 0), (k, 1)]);
        let slope = |(driver, which): (usize, usize)| {
            let mut moved = lines.to_vec();
            moved[driver][which] += STEP;
            Some(self.slope(&self.outputs(posed, &x, &moved, at)?))
        };
        self.inputs = which.map(slope).collect::<Option<_>>()?;
        Some(())
    }

    /// Difference quotients of a response.
    fn slope(&self, moved: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let pairs = moved.iter().zip(&self.response);
        let of = |(a, b): (&Vec<f64>, &Vec<f64>)| {
            let pairs = a.iter().zip(b);
            pairs.map(|(a, b)| (a - b) / STEP).collect()
        };
        pairs.map(of).collect()
    }

    /// The measured signals at the samples, over their spreads, with lines `a u + b` in place of the driven inputs.
    fn outputs(
        &self,
        posed: &Posed<'_>,
        x: &[f64],
        lines: &[[f64; 2]],
        (sizes, spreads): (&[f64], &[f64]),
    ) -> Option<Vec<Vec<f64>>> {
        let mut run = self.run.clone();
        for inputs in &mut run.inputs {
            let driven = inputs.iter_mut().zip(lines);
            driven.for_each(|(u, [a, b])| *u = a * *u + b);
        }
        let quality = Quality {
            tolerance: TOLERANCE,
            magnitudes: sizes.to_vec(),
            most_steps: usize::MAX,
        };
        let course = posed.model.course(&run, &[], x, &quality, &|| false);
        let graph = &posed.model.system.graph;
        let mut all = vec![Vec::new(); spreads.len()];
        for (sample, at) in course.samples.iter().enumerate() {
            let mut variables = vec![run.time[sample]];
            variables.extend_from_slice(&course.states[*at]);
            variables.extend_from_slice(&run.inputs[sample]);
            let values = graph.values(&variables);
            let signals = posed.quantities.predicted.iter().zip(spreads);
            for ((node, spread), own) in signals.zip(&mut all) {
                own.push(values[node.index()] / spread);
            }
        }
        let is_finite = all.iter().flatten().all(|value| value.is_finite());
        (course.is_whole && is_finite).then_some(all)
    }

    /// The samples that the response covers with all delays, and have a value: signal and sample.
    fn seen(&self) -> impl Iterator<Item = (usize, usize)> {
        let time = &self.run.time;
        let inner = time[0] + self.longest..=time[time.len() - 1] - self.longest;
        let signals = self.recorded.iter().enumerate();
        signals.flat_map(move |(signal, own)| {
            let inner = inner.clone();
            let is_seen = move |k: &usize| own[*k].is_finite() && inner.contains(&time[*k]);
            (0..own.len()).filter(is_seen).map(move |k| (signal, k))
        })
    }

    /// A signal of this window, `later` after its samples, linear between them.
    fn at(&self, values: &[f64], sample: usize, later: f64) -> f64 {
        let (time, t) = (&self.run.time, self.run.time[sample] - later);
        let after = time
            .partition_point(|own| *own <= t)
            .clamp(1, time.len() - 1);
        let (a, b) = (time[after - 1], time[after]);
        let part = if b > a { (t - a) / (b - a) } else { 1.0 };
        values[after - 1] + part * (values[after] - values[after - 1])
    }

    /// Residuals at a delay, and the columns of their derivatives with respect to initial states.
    fn linear(&self, later: f64) -> (DVector<f64>, DMatrix<f64>, Vec<(usize, usize)>) {
        let seen: Vec<(usize, usize)> = self.seen().collect();
        let residual =
            |&(s, k): &(usize, usize)| self.recorded[s][k] - self.at(&self.response[s], k, later);
        let residuals = DVector::from_iterator(seen.len(), seen.iter().map(residual));
        let states = DMatrix::from_fn(seen.len(), self.states.len(), |row, x| {
            let (s, k) = seen[row];
            self.at(&self.states[x][s], k, later)
        });
        (residuals, states, seen)
    }

    /// By how much the initial states fit better.
    fn better(&self) -> Option<DVector<f64>> {
        let (residuals, states, _) = self.linear(0.0);
        let svd = states.svd(true, true);
        let least = RANK * svd.singular_values.max();
        svd.solve(&residuals, least).ok()
    }

    /// What is left at a delay.
    pub fn left(&self, later: f64) -> Left {
        let (mut residuals, states, seen) = self.linear(later);
        let mut inputs = DMatrix::from_fn(seen.len(), self.inputs.len(), |row, u| {
            let (s, k) = seen[row];
            self.at(&self.inputs[u][s], k, later)
        });
        let svd = states.svd(true, false);
        let least = RANK * svd.singular_values.max();
        let all = svd.u.expect("it was asked for");
        for (column, value) in all.column_iter().zip(svd.singular_values.iter()) {
            if *value > least {
                residuals -= column * column.dot(&residuals);
                inputs -= column * (column.transpose() * &inputs);
            }
        }
        Left { residuals, inputs }
    }
}

/// Standard deviation of each measured signal over all runs.
pub fn spreads(posed: &Posed<'_>) -> Vec<f64> {
    let of = |all: &Vec<Vec<f64>>| {
        let known: Vec<f64> = all
            .iter()
            .flatten()
            .copied()
            .filter(|y| y.is_finite())
            .collect();
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        let squares = known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        (squares / known.len() as f64).sqrt()
    };
    posed.quantities.recorded.iter().map(of).collect()
}
