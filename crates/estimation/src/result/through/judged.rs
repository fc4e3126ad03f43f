//! Factor and delay of a response to recorded inputs, and what they leave.

use super::windows::{Left, Window, spreads, windows};
use crate::posed::Posed;
use nalgebra::{DMatrix, DVector};
use pilotage_inference::outliers::median;
use pilotage_inference::sampling::median_step;
use rayon::prelude::*;

/// Number of delays on either side.
const DELAYS: i32 = 20;
/// Factors by which a column may be another unit or sign, which a model that is not linear tells only near them; looked at where
/// less than this part is explained.
const OTHERS: [f64; 3] = [-1.0, 0.01, -0.01];
const ENOUGH: f64 = 0.9;
/// Ratio of the standard deviation of a normal distribution to its median magnitude.
const ROBUST: f64 = 1.4826;

/// How recorded responses answer recorded inputs, beside how the model does.
pub struct Response {
    /// For each driven input, how many times as far as the model's the response is.
    pub factors: Vec<f64>,
    /// Time by which it is later \[s\].
    pub later: f64,
    /// Part of the variance due to the inputs that the model explains: as it is, and with factors and delay; without the noise
    /// of the recording.
    pub explained: [f64; 2],
    /// Squares left with factors and delay over those left without.
    pub ratio: f64,
    /// Median time between samples \[s\].
    pub step: f64,
}

impl Response {
    /// The driven input with the factor that is farthest from 1.
    pub fn worst(&self) -> usize {
        let far = |k: &usize| (self.factors[*k] - 1.0).abs();
        let all = 0..self.factors.len();
        all.max_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0)
    }
}

/// Sums over all pieces at a delay.
struct Sums {
    squares: f64,
    slopes: DVector<f64>,
    curvature: DMatrix<f64>,
    rows: usize,
}

/// None if the model explains all, or the runs do not tell: the inputs move the response by no more than its noise, or the runs are too short.
pub fn judged(posed: &Posed<'_>, drivers: usize) -> Option<Response> {
    let spreads = spreads(posed);
    if spreads.iter().any(|own| *own <= 0.0 || !own.is_finite()) {
        return None;
    }
    let at = |factor: f64| windows(posed, (drivers, factor), &spreads);
    let left = |sums: &Sums| Some(sums.with(&vec![Some(0.0); drivers])?.0);
    let as_it_is = at(1.0)?;
    let sums = Sums::of(&as_it_is, drivers, 0.0);
    let now = left(&sums)?;
    let noise = sums.rows as f64 * noise(posed, &spreads);
    // Without the inputs.
    let (still, _) = sums.with(&vec![Some(-1.0); drivers])?;
    let moved = still - noise;
    if moved < noise {
        return None;
    }
    let explained = |squares: f64| 1.0 - (squares - noise).max(0.0) / moved;
    let mut best = (1.0, now, as_it_is);
    for factor in OTHERS.into_iter().filter(|_| explained(now) < ENOUGH) {
        let other =
            at(factor).and_then(|all| Some((factor, left(&Sums::of(&all, drivers, 0.0))?, all)));
        best = other.filter(|other| other.1 < best.1).unwrap_or(best);
    }
    let (base, _, all) = best;
    if 1.0 - explained(now) <= super::SEEN {
        return None;
    }
    let (later, squares, changes) = best_delay(&all, drivers)?;
    Some(Response {
        factors: (0..drivers).map(|k| base + changes[2 * k]).collect(),
        later,
        explained: [explained(now), explained(squares)],
        ratio: squares / now,
        step: median_step(&posed.runs[0].time)?,
    })
}

/// The delay that leaves the least squares with free factors and biases, these squares, and the changes of factors and biases.
fn best_delay(all: &[Window], drivers: usize) -> Option<(f64, f64, DVector<f64>)> {
    let longest = all.iter().map(|own| own.longest);
    let longest = longest.fold(f64::INFINITY, f64::min);
    let free = |later: f64| Sums::of(all, drivers, later).with(&vec![None; drivers]);
    let delay = |k: i32| longest * f64::from(k) / f64::from(DELAYS);
    let tried = (-DELAYS..=DELAYS).map(|k| Some((delay(k), free(delay(k))?.0)));
    let tried: Vec<(f64, f64)> = tried.collect::<Option<_>>()?;
    let best = (0..tried.len()).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))?;
    let later = vertex(&tried, best);
    let (squares, changes) = free(later)?;
    Some((later, squares, changes))
}

/// Least value of a parabola through a point and its neighbours.
fn vertex(all: &[(f64, f64)], best: usize) -> f64 {
    if best == 0 || best + 1 == all.len() {
        return all[best].0;
    }
    let (before, least, after) = (all[best - 1].1, all[best].1, all[best + 1].1);
    let bend = before - 2.0 * least + after;
    match bend > 0.0 {
        true => all[best].0 + 0.5 * (before - after) / bend * (all[best + 1].0 - all[best].0),
        false => all[best].0,
    }
}

impl Sums {
    fn of(all: &[Window], drivers: usize, later: f64) -> Self {
        let count = 2 * drivers;
        let mut sums = Self {
            squares: 0.0,
            slopes: DVector::zeros(count),
            curvature: DMatrix::zeros(count, count),
            rows: 0,
        };
        let left = all.par_iter().map(|own| own.left(later));
        for Left { residuals, inputs } in left.collect::<Vec<Left>>() {
            sums.squares += residuals.norm_squared();
            sums.slopes += inputs.transpose() * &residuals;
            sums.curvature += inputs.transpose() * &inputs;
            sums.rows += residuals.len();
        }
        sums
    }

    /// Least squares with the given changes of the factors, and the changes of factors and biases. The biases, and factors without
    /// a given change, are free.
    fn with(&self, factors: &[Option<f64>]) -> Option<(f64, DVector<f64>)> {
        let is_free = |k: &usize| k % 2 == 1 || factors[k / 2].is_none();
        let free: Vec<usize> = (0..self.slopes.len()).filter(is_free).collect();
        let mut changes = DVector::zeros(self.slopes.len());
        for (k, given) in factors.iter().enumerate() {
            changes[2 * k] = given.unwrap_or(0.0);
        }
        let slopes = &self.slopes - &self.curvature * &changes;
        let of_free = DVector::from_iterator(free.len(), free.iter().map(|k| slopes[*k]));
        // In units in which each has the same effect; one without any does not change.
        let size = |k: usize| self.curvature[(k, k)].sqrt().max(f64::MIN_POSITIVE);
        let curvature = DMatrix::from_fn(free.len(), free.len(), |a, b| {
            self.curvature[(free[a], free[b])] / size(free[a]) / size(free[b])
        });
        let scaled = DVector::from_fn(free.len(), |a, _| of_free[a] / size(free[a]));
        let found = curvature.svd(true, true).solve(&scaled, 1e-10).ok()?;
        for (a, k) in free.iter().enumerate() {
            changes[*k] = found[a] / size(*k);
        }
        let squares = self.squares - 2.0 * self.slopes.dot(&changes)
            + changes.dot(&(&self.curvature * &changes));
        squares.is_finite().then_some((squares.max(0.0), changes))
    }
}

/// Variance of the white noise of the signals, over their spreads, from third differences of successive samples: those of a smooth
/// motion are small.
fn noise(posed: &Posed<'_>, spreads: &[f64]) -> f64 {
    let recorded = posed.quantities.recorded.iter().zip(spreads);
    let of_signal = |(all, spread): (&Vec<Vec<f64>>, &f64)| {
        let known = all.iter().map(|own| {
            let known = own.iter().copied().filter(|y| y.is_finite());
            known.collect::<Vec<f64>>()
        });
        let known: Vec<Vec<f64>> = known.collect();
        let four = known.iter().flat_map(|own| own.windows(4));
        let third = four.map(|y| (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]).abs());
        // Their variance is 1 + 9 + 9 + 1 times that of the noise.
        (ROBUST * median(third).unwrap_or(0.0) / spread).powi(2) / 20.0
    };
    let all: Vec<f64> = recorded.map(of_signal).collect();
    all.iter().sum::<f64>() / all.len() as f64
}
