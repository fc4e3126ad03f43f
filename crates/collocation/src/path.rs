//! The states of a run as functions of time, and the transfer of variables to another mesh.

use super::Collocation;
use super::collocation::PointValues;
use super::grid::{Grid, place};
use super::tableau::dot;

/// The states of a run by the interpolant of the scheme.
pub(super) struct Path<'a> {
    grid: &'a Grid,
    v: &'a [f64],
    values: PointValues,
    scales: &'a [f64],
    /// Start times of the elements \[s\].
    starts: Vec<f64>,
}

impl<'a> Path<'a> {
    /// The path of run `j`.
    pub fn new(problem: &'a Collocation, z: &'a [f64], j: usize) -> Self {
        let grid = &problem.grids[j];
        Self {
            grid,
            v: problem.coefficients(z, j),
            values: problem.evaluate_points(z, j, |_, _| {}),
            scales: &problem.model.scales.states,
            starts: grid.elements.iter().map(|e| grid.times[e.first]).collect(),
        }
    }

    /// The states at a time, in their units.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let element = self.starts.partition_point(|s| *s <= time).max(1) - 1;
        let (start, element) = (self.starts[element], &self.grid.elements[element]);
        let (p, q) = place(element, time, start);
        let (n, points) = (self.scales.len(), self.grid.points_of(element));
        let state = |i: usize| {
            let nodes = dot(&p, |j| self.v[(element.first + j) * n + i]);
            let rates = dot(&q, |l| self.values.f[points[l] as usize * n + i]);
            self.scales[i] * (nodes + element.h * rates)
        };
        (0..n).map(state).collect()
    }
}

impl Collocation {
    /// Variables of another problem with the same runs, but for example other meshes, scales or another scheme. They
    /// are a warm start with the states of this problem, from the interpolant of its scheme, and its θ.
    ///
    /// # Panics
    /// If the numbers of runs, states or parameters differ.
    pub fn carried(&self, z: &[f64], onto: &Self) -> Vec<f64> {
        assert_eq!(self.runs.len(), onto.runs.len(), "the same runs");
        assert_eq!(self.n_states(), onto.n_states(), "the same states");
        assert_eq!(self.n_parameters(), onto.n_parameters(), "the same θ");
        let mut out = Vec::with_capacity(onto.layout.theta + onto.n_parameters());
        for (j, grid) in onto.grids.iter().enumerate() {
            let path = Path::new(self, z, j);
            for (k, element) in grid.elements.iter().enumerate() {
                let end = element.first + element.tableau.unknowns();
                let times = &grid.times[element.first..=end];
                let states: Vec<Vec<f64>> = times.iter().map(|t| path.at(*t)).collect();
                let coefficients = element.tableau.through(states);
                // The first coefficient belongs to the previous element.
                let new = coefficients.iter().skip(usize::from(k > 0)).flatten();
                let scales = onto.model.scales.states.iter().cycle();
                out.extend(new.zip(scales).map(|(x, s)| x / s));
            }
        }
        let theta = self.physical_theta(z);
        let theta = theta.iter().zip(&onto.model.scales.parameters);
        out.extend(theta.map(|(t, s)| t / s));
        onto.set_known(&mut out);
        out
    }
}
