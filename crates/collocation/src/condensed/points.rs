//! The points of a run, in groups that are processed together.

use super::run::RunSweep;
use crate::grid::{Combination, Grid, PointState, Samples};
use crate::simd::{self, LANES, Lanes, plus, side_by_side};
use std::ops::Range;

/// Gradients over `[x̄; θ̄]`, or steps, at a group of points.
pub(super) type Gradients = Vec<Lanes>;

/// Zero gradients over `[x̄; θ̄]`.
pub(super) fn zeros(own: &RunSweep) -> Gradients {
    vec![[0.0; LANES]; own.n + own.p]
}

/// A group of points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points<'a> {
    grid: &'a Grid,
    /// Index of the group.
    pub number: usize,
    /// Indices of the points; those beyond `count` repeat the last one.
    pub members: [usize; LANES],
    pub count: usize,
}

impl<'a> Points<'a> {
    /// All groups of a run, in time order.
    #[inline]
    pub fn all(grid: &'a Grid) -> impl DoubleEndedIterator<Item = Self> {
        let points = grid.points.len();
        (0..points.div_ceil(LANES)).map(move |number| {
            let (members, count) = simd::group(number * LANES, LANES, points);
            Self {
                grid,
                number,
                members,
                count,
            }
        })
    }

    /// The states of the points.
    #[inline(always)]
    pub fn states_of(&self) -> [&'a PointState; LANES] {
        let grid = self.grid;
        self.members.map(|i| &grid.points[i].state)
    }

    /// The sample of each point.
    #[inline(always)]
    pub fn samples_of(&self) -> Samples {
        self.grid.samples(self.members, self.count)
    }

    /// The sample of each point, with its lane.
    #[inline(always)]
    pub fn samples(&self) -> impl Iterator<Item = (usize, usize)> {
        let own = self.members[..self.count].iter().enumerate();
        own.filter_map(|(lane, i)| Some((lane, self.grid.points[*i].sample? as usize)))
    }

    /// The values at the points' samples, from a list with one value per sample; zero if a point has no sample.
    #[inline(always)]
    pub fn of_samples(&self, values: &[f64]) -> Lanes {
        let mut out = [0.0; LANES];
        self.samples().for_each(|(lane, k)| out[lane] = values[k]);
        out
    }

    /// States of the points, from those of the unknowns and of the combinations.
    #[inline(always)]
    pub fn states(&self, nodes: &[f64], combined: &[f64], n: usize, out: &mut [Lanes]) {
        let rows = self
            .members
            .map(|i| self.grid.points[i].state.of(nodes, combined, n));
        side_by_side(rows, &mut out[..n]);
    }

    /// Ranges of lanes that can be processed together, in reverse order: all at once, or one by one if points use
    /// derivatives of previous points.
    #[inline(always)]
    pub fn turns(&self, nested: bool) -> impl Iterator<Item = Range<usize>> + use<> {
        let (count, step) = (self.count, if nested { 1 } else { LANES });
        let starts = (0..count).step_by(step).rev();
        starts.map(move |lane| lane..count.min(lane + step))
    }

    /// Adds derivatives with respect to the points' states to those with respect to the unknowns and, for combinations,
    /// to the weights `omega` of the derivatives at other points.
    #[inline(always)]
    pub fn distribute(
        &self,
        lanes: Range<usize>,
        gradients: &[Lanes],
        nodes: &mut [f64],
        omega: &mut [f64],
    ) {
        let n = gradients.len();
        for lane in lanes {
            match &self.grid.points[self.members[lane]].state {
                PointState::Node(k) => add(1.0, gradients, lane, &mut nodes[k * n..(k + 1) * n]),
                PointState::Combination(c) => combination(c, gradients, lane, nodes, omega),
            }
        }
    }

    /// Adds the derivatives with respect to θ at the points in these lanes.
    #[inline(always)]
    pub fn add_parameters(&self, lanes: Range<usize>, gradients: &[Lanes], out: &mut [f64]) {
        for (out, gradients) in out.iter_mut().zip(gradients) {
            *out += gradients[lanes.clone()].iter().sum::<f64>();
        }
    }
}

/// Adds the derivative with respect to a combination to those with respect to its terms.
#[inline(never)]
fn combination(
    of: &Combination,
    gradients: &[Lanes],
    lane: usize,
    nodes: &mut [f64],
    omega: &mut [f64],
) {
    let n = gradients.len();
    for &(k, p) in &of.p {
        add(p, gradients, lane, &mut nodes[k * n..(k + 1) * n]);
    }
    for &(l, q) in &of.q {
        add(q, gradients, lane, &mut omega[l * n..(l + 1) * n]);
    }
}

/// `out += factor gradients` of one lane.
#[inline(always)]
fn add(factor: f64, gradients: &[Lanes], lane: usize, out: &mut [f64]) {
    for (out, gradient) in out.iter_mut().zip(gradients) {
        *out += factor * gradient[lane];
    }
}

/// `out += factor gradient` for the gradient of an output, stored at these columns.
#[inline(always)]
pub(super) fn add_at(columns: &[usize], factor: Lanes, gradient: &[Lanes], out: &mut [Lanes]) {
    for (value, &c) in gradient.iter().zip(columns) {
        out[c] = plus(out[c], factor, *value);
    }
}

/// Scalar product of a step and the gradient of an output, stored at these columns.
#[inline(always)]
pub(super) fn along(columns: &[usize], gradient: &[Lanes], step: &[Lanes]) -> Lanes {
    let own = gradient.iter().zip(columns);
    own.fold([0.0; LANES], |sum, (value, &c)| plus(sum, *value, step[c]))
}
