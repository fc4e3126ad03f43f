//! Profile likelihoods: the objective with one coordinate fixed and all others optimised again.
//!
//! With the minimum f̂ of the objective and the variance s² of the residuals, ζ = ± √((f - f̂)/s²) of a linear model is
//! `(p - p̂)/sd` (the profile t of Bates & Watts, *Nonlinear Regression Analysis and Its Applications*, 1988, section
//! 6.1). The interval is where |ζ| is below a threshold: √χ²₁ if the noise is known, Student's t if s² is estimated
//! (Venzon & Moolgavkar, J. R. Stat. Soc. C 37, 1988).

use crate::refit::{self, Coordinate, Fixed, Refit};
use crate::solved::Watch;
use rayon::prelude::*;

/// Approximate number of steps to the threshold on each side.
const STEPS: f64 = 4.0;
/// Maximum number of refits on each side.
const MOST: usize = 40;
/// Maximum length of a side, in multiples of the expected distance of the threshold.
const FARTHEST: f64 = 1e3;
/// Maximum number of step halvings after refits that do not converge.
const HALVINGS: usize = 5;
/// Relative distance from the threshold at which a refit counts as on it.
const CLOSE: f64 = 1e-4;
/// Maximum number of refits to locate the threshold.
const CLOSING: usize = 8;
/// Decrease of the objective, per s² and squared threshold, from which on a refit is a better optimum.
const LOWER: f64 = 1e-5;

/// Rise of ζ, relative to the threshold, below which a side is flat, and the number of points required to decide so.
const FLAT: f64 = 1e-3;
const LOOKED: usize = 4;

/// A coordinate whose profile is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sought {
    /// The coordinate.
    pub at: Coordinate,
    /// Expected distance of the threshold from the estimate, above 0.
    pub step: f64,
    /// Its range: lower and upper end, with the estimate between them. A side whose end is not beyond the estimate has no
    /// points.
    pub range: [f64; 2],
}

/// Threshold of ζ at which an interval ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Variance s² of the residuals, in units of the objective.
    pub noise: f64,
    /// Largest |ζ| within the interval.
    pub root: f64,
}

/// A refit of a profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Value of the coordinate.
    pub value: f64,
    /// Minimum of the objective at that value.
    pub objective: f64,
    /// ζ.
    pub root: f64,
    /// Indices of active constraints on parameters.
    pub constraints: Vec<usize>,
    /// Indices of active bounds at the start of a run.
    pub bounds: Vec<usize>,
}

impl Point {
    /// The point of a refit with that value and ζ.
    fn of(value: f64, root: f64, found: &refit::Point) -> Self {
        Self {
            value,
            objective: found.objective,
            root,
            constraints: found.constraints.clone(),
            bounds: found.bounds.clone(),
        }
    }
}

/// How a side of a profile ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// The threshold is crossed at this value.
    Crossed(f64),
    /// The end of the range is reached: the data do not exclude it.
    Range(f64),
    /// The threshold is not reached up to this value.
    Open(f64),
    /// No refit beyond this value converged.
    Failed(f64),
    /// The computation was stopped at this value.
    Stopped(f64),
}

/// The profile of a coordinate.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The refits and the estimate itself, sorted by value.
    pub points: Vec<Point>,
    /// Lower and upper end.
    pub ends: [End; 2],
    /// Index of the point with the lowest objective if that is below the estimate's: there is a better optimum.
    pub lower: Option<usize>,
}

impl Profile {
    /// Whether it was stopped before both ends were found.
    pub fn is_stopped(&self) -> bool {
        self.ends.iter().any(|end| matches!(end, End::Stopped(_)))
    }
}

/// The profiles of these coordinates, in parallel over coordinates and sides. The results do not depend on the number
/// of threads. [`Watch::done`] is called twice for each profile.
///
/// # Panics
/// If a step or the threshold is not above 0.
pub fn profile(
    solved: &dyn Refit,
    sought: &[Sought],
    threshold: Threshold,
    watch: &Watch<'_>,
) -> Vec<Profile> {
    assert!(threshold.noise > 0.0 && threshold.root > 0.0, "a threshold");
    assert!(sought.iter().all(|own| own.step > 0.0), "steps");
    let estimate = solved.solution();
    let fixed: Vec<Box<dyn Fixed + '_>> = (sought.par_iter())
        .map(|own| solved.fixed(own.at))
        .collect();
    let tasks: Vec<(usize, f64)> = (0..sought.len())
        .flat_map(|k| [(k, -1.0), (k, 1.0)])
        .collect();
    let side = |(k, sign): &(usize, f64)| {
        let begin = (solved.value(sought[*k].at), estimate.objective);
        let side = Side::new(begin, &*fixed[*k], sought[*k], threshold, *sign, *watch);
        let found = side.walked();
        (watch.done)();
        found
    };
    let sides: Vec<(Vec<Point>, End)> = tasks.par_iter().map(side).collect();
    let pairs = sides.chunks_exact(2).zip(sought);
    pairs
        .map(|(sides, own)| {
            let estimate = Point::of(solved.value(own.at), 0.0, &estimate);
            joined(estimate, sides, threshold)
        })
        .collect()
}

/// Joins both sides with the estimate between them.
fn joined(estimate: Point, sides: &[(Vec<Point>, End)], threshold: Threshold) -> Profile {
    let best = estimate.objective;
    let mut points = vec![estimate];
    sides
        .iter()
        .for_each(|(own, _)| points.extend_from_slice(own));
    points.sort_by(|a, b| a.value.total_cmp(&b.value));
    let least =
        (0..points.len()).min_by(|a, b| points[*a].objective.total_cmp(&points[*b].objective));
    let margin = LOWER * threshold.noise * threshold.root.powi(2);
    Profile {
        lower: least.filter(|k| points[*k].objective < best - margin),
        ends: [sides[0].1, sides[1].1],
        points,
    }
}

/// One side of a profile while it is computed.
struct Side<'a> {
    /// Objective of the estimate.
    best: f64,
    fixed: &'a dyn Fixed,
    sought: Sought,
    threshold: Threshold,
    sign: f64,
    watch: Watch<'a>,
    points: Vec<Point>,
    /// Value, ζ along the side, and variables of the estimate and of all points, in order along the side.
    path: Vec<(f64, f64, Vec<f64>)>,
}

impl<'a> Side<'a> {
    fn new(
        (value, best): (f64, f64),
        fixed: &'a dyn Fixed,
        sought: Sought,
        threshold: Threshold,
        sign: f64,
        watch: Watch<'a>,
    ) -> Self {
        Self {
            path: vec![(value, 0.0, fixed.begin())],
            points: Vec::new(),
            best,
            fixed,
            sought,
            threshold,
            sign,
            watch,
        }
    }

    /// Steps away from the estimate until the threshold is crossed, then locates the crossing.
    fn walked(mut self) -> (Vec<Point>, End) {
        let end = self.sought.range[usize::from(self.sign > 0.0)];
        let begin = self.path[0].0;
        let (mut step, mut halvings) = (self.sought.step / STEPS, 0);
        loop {
            let last = self.path[self.path.len() - 1].0;
            if (end - last) * self.sign <= 1e-9 * self.sought.step {
                return (self.points, End::Range(end));
            }
            let is_far = (last - begin).abs() > FARTHEST * self.sought.step;
            if is_far || self.points.len() >= MOST {
                return (self.points, End::Open(last));
            }
            let next = last + self.sign * step;
            let next = if (end - next) * self.sign < 0.0 {
                end
            } else {
                next
            };
            if !self.add(next) {
                if (self.watch.stops)() {
                    return (self.points, End::Stopped(last));
                }
                halvings += 1;
                // If ζ has not risen so far, the side is open, whatever stops the refits.
                let is_flat = self.path[self.path.len() - 1].1 < FLAT * self.threshold.root;
                if is_flat && self.points.len() >= LOOKED {
                    return (self.points, End::Open(last));
                }
                if halvings > HALVINGS {
                    return (self.points, End::Failed(last));
                }
                step *= 0.5;
                continue;
            }
            if self.path[self.path.len() - 1].1 >= self.threshold.root {
                let end = self.close_in();
                return (self.points, end);
            }
            step = self.next_step();
        }
    }

    /// The step that changes ζ by a fixed part of the threshold, or crosses it.
    fn next_step(&self) -> f64 {
        let [a, b] = [2, 1].map(|back| &self.path[self.path.len() - back]);
        let (run, rise) = ((b.0 - a.0).abs(), b.1 - a.1);
        let (part, left) = (self.threshold.root / STEPS, self.threshold.root - b.1);
        let wanted = if left < 1.5 * part { 1.05 * left } else { part };
        match rise > 0.0 {
            true => run * (wanted / rise).clamp(0.25, 4.0),
            false => 4.0 * run,
        }
    }

    /// Locates the threshold between the last two points by the Illinois variant of false position, until a point lies
    /// on it.
    fn close_in(&mut self) -> End {
        let root = self.threshold.root;
        let (mut weights, mut kept) = ([1.0, 1.0], None);
        for _ in 0..CLOSING {
            let k = self.path.partition_point(|own| own.1 < root).max(1);
            let [below, above] = [k - 1, k].map(|k| (self.path[k].0, self.path[k].1 - root));
            if above.1.min(-below.1) < CLOSE * root {
                break;
            }
            let [a, b] = [below.1 * weights[0], above.1 * weights[1]];
            let next = (below.0 * b - above.0 * a) / (b - a);
            if !self.add(next) {
                break;
            }
            let is_above = self.path.iter().any(|own| own.0 == next && own.1 >= root);
            let stays = usize::from(!is_above);
            weights = [1.0, 1.0];
            if kept == Some(stays) {
                weights[stays] = 0.5;
            }
            kept = Some(stays);
        }
        let k = self.path.partition_point(|own| own.1 < root).max(1);
        let [(a, f, _), (b, g, _)] = [&self.path[k - 1], &self.path[k]];
        End::Crossed(a + (b - a) * (root - f) / (g - f))
    }

    /// Adds the point with that value; false if the refit does not converge.
    fn add(&mut self, value: f64) -> bool {
        let solved = |z| self.fixed.solved(value, z, &self.watch);
        // Far from the estimate, linear extrapolation may leave the domain of the model.
        let found = solved(self.predicted(value)).or_else(|| solved(self.nearest(value)));
        let Some(found) = found else {
            return false;
        };
        let excess = (found.objective - self.best) / self.threshold.noise;
        let root = excess.max(0.0).sqrt();
        self.points.push(Point::of(value, self.sign * root, &found));
        let place = self
            .path
            .partition_point(|own| (own.0 - value) * self.sign < 0.0);
        self.path.insert(place, (value, root, found.z));
        true
    }

    /// The variables of the nearest point on the estimate's side, with that value.
    fn nearest(&self, value: f64) -> Vec<f64> {
        let place = self
            .path
            .partition_point(|own| (own.0 - value) * self.sign < 0.0);
        let mut z = self.path[place.max(1) - 1].2.clone();
        self.fixed.put(&mut z, value);
        z
    }

    /// The variables at that value, on the straight line through its neighbours.
    fn predicted(&self, value: f64) -> Vec<f64> {
        let place = self
            .path
            .partition_point(|own| (own.0 - value) * self.sign < 0.0);
        let near = place.max(1).min(self.path.len() - 1);
        let mut z = self.path[near].2.clone();
        if near > 0 {
            let [a, b] = [&self.path[near - 1], &self.path[near]];
            let part = (value - b.0) / (b.0 - a.0);
            let pairs = z.iter_mut().zip(&a.2);
            pairs.for_each(|(own, before)| *own += part * (*own - before));
        }
        self.fixed.put(&mut z, value);
        z
    }
}
