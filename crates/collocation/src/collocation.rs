//! The collocation NLP of several runs with shared parameters (paper, eq. 5).

use super::bound::Bound;
use super::constraints::ParameterConstraints;
use super::grid::{Grid, PointState, Samples};
use super::layout::Layout;
use super::loss::Loss;
use super::mesh::Run;
use super::node::{Differentiated, NodeModel, Scales};
use super::parallel;
use super::simd::{self, LANES, Lanes, Task};
use super::tableau::Scheme;
use num_dual::{Dual64, HyperDual64};
use pilotage_sqp::Problem;
use std::sync::Arc;

/// Smallest scaled value of a constraint on θ. It is above the tolerance of a solve, so that a converged solution never
/// violates the constraint. Conditions such as Routh's are strict, and each one divides by the previous one.
pub const CLEARANCE: f64 = 1e-7;

/// Collocation of runs of one model with shared parameters θ.
///
/// Variables and defects are scaled by [`Scales`]; the objective is `Σ w ℓ(y_k - h(x(t_k)))` over the
/// runs, their measured outputs and the samples `t_k`, with weight and loss of each [recording](super::Recording).
#[derive(Debug, Clone)]
pub struct Collocation {
    /// The model at a point: the first outputs are measured, the others bounded.
    pub model: NodeModel,
    /// Number of measured outputs.
    pub measured: usize,
    /// Constraints on θ.
    pub constraints: ParameterConstraints,
    /// The collocation scheme.
    pub scheme: Scheme,
    /// The runs.
    pub runs: Vec<Run>,
    /// The discretisation of each run by the scheme.
    pub grids: Vec<Grid>,
    /// Positions of the variables and constraints.
    pub layout: Layout,
    /// Limits of the bounded outputs, which are the last ones.
    pub bounds: Vec<Bound>,
    constraint_scales: Vec<f64>,
    limits: (Vec<f64>, Vec<f64>),
    damping_weights: Vec<f64>,
}

impl Collocation {
    /// The NLP of these runs. The last outputs of the model are bounded; the previous ones are measured.
    ///
    /// # Panics
    /// If a run violates the requirements of [`Run`], or its numbers of inputs, recordings or initial states differ
    /// from those of the model; if lower and upper bounds are not in order, or a size is not above 0; if the scales are not
    /// those of the model's states and parameters.
    pub fn new(
        tapes: Arc<Differentiated>,
        constraints: ParameterConstraints,
        scheme: Scheme,
        runs: Vec<Run>,
        scales: Scales,
        bounds: &[Bound],
    ) -> Self {
        let given = [scales.states.len(), scales.parameters.len()];
        let model = NodeModel::new(tapes, scales);
        let (n, p, inputs) = (model.n_states(), model.n_parameters(), model.n_inputs());
        assert_eq!(given, [n, p], "a scale for each state and each parameter");
        let measured = model.n_outputs().checked_sub(bounds.len());
        let measured = measured.expect("no more bounds than outputs");
        assert!(n > 0, "a model with states: others need no collocation");
        let is_ordered = |bound: &Bound| bound.lower <= bound.upper && bound.size > 0.0;
        assert!(
            bounds.iter().all(is_ordered),
            "lower and upper bounds, and sizes"
        );
        runs.iter().for_each(|run| run.check([n, inputs, measured]));
        let grids: Vec<Grid> = runs
            .iter()
            .map(|run| Grid::new(scheme, run, inputs))
            .collect();
        let layout = Layout::new(&runs, &grids, n, bounds.len());
        let factors: Vec<f64> = bounds.iter().map(|bound| 1.0 / bound.size).collect();
        let model = model.with_factors(measured, &factors);
        let of_run = |run: &Run| {
            let samples = run.time.len();
            let scaled = bounds.iter().zip(&factors);
            scaled.flat_map(move |(own, factor)| {
                let limits = own.limits(samples);
                limits.map(move |(lower, upper)| (factor * lower, factor * upper))
            })
        };
        let (mut lower, mut upper): (Vec<f64>, Vec<f64>) = runs.iter().flat_map(of_run).unzip();
        lower.extend(vec![CLEARANCE; constraints.count()]);
        upper.extend(vec![f64::INFINITY; constraints.count()]);
        let mut damping_weights = vec![0.0; layout.theta];
        for (run, at) in runs.iter().zip(&layout.runs) {
            for (i, known) in run.initial.iter().enumerate() {
                damping_weights[at.z + i] = f64::from(known.is_none());
            }
        }
        damping_weights.extend(vec![1.0; p]);
        Self {
            constraint_scales: magnitudes(&constraints, &model.scales.parameters),
            limits: (lower, upper),
            damping_weights,
            bounds: bounds.to_vec(),
            model,
            measured,
            constraints,
            scheme,
            runs,
            grids,
            layout,
        }
    }

    /// Number of states of the model.
    pub fn n_states(&self) -> usize {
        self.model.n_states()
    }

    /// Number of parameters of the model.
    pub fn n_parameters(&self) -> usize {
        self.model.n_parameters()
    }

    /// The scaled coefficient vectors of run `j`.
    pub fn coefficients<'z>(&self, z: &'z [f64], j: usize) -> &'z [f64] {
        &z[self.layout.runs[j].variables()]
    }

    /// The scaled parameters.
    pub fn theta<'z>(&self, z: &'z [f64]) -> &'z [f64] {
        &z[self.layout.theta..]
    }

    /// Parameters in their units.
    pub fn physical_theta(&self, z: &[f64]) -> Vec<f64> {
        let theta = self.theta(z).iter().zip(&self.model.scales.parameters);
        theta.map(|(t, s)| t * s).collect()
    }

    /// States of run `j` at its samples, in their units, from the interpolant of the scheme.
    pub fn states_at_samples(&self, z: &[f64], j: usize) -> Vec<Vec<f64>> {
        let values = self.evaluate_points(z, j, |_, _| {});
        let grid = &self.grids[j];
        let v = self.coefficients(z, j);
        let state = |&i: &usize| {
            let scaled = values.states(grid, v, i, self.n_states());
            let units = scaled.iter().zip(&self.model.scales.states);
            units.map(|(x, s)| x * s).collect()
        };
        grid.observed.iter().map(state).collect()
    }

    /// The trajectory of run `j` at the evaluation points of the scheme and at its samples, sorted by time: time \[s\],
    /// states in their units, inputs.
    pub fn along(&self, z: &[f64], j: usize) -> Vec<(f64, Vec<f64>, Vec<f64>)> {
        let values = self.evaluate_points(z, j, |_, _| {});
        let grid = &self.grids[j];
        let v = self.coefficients(z, j);
        let inputs = grid.inputs.len() / grid.points.len().max(1) - 1;
        let point = |(i, given): (usize, &[f64])| {
            let scaled = values.states(grid, v, i, self.n_states());
            let units = scaled.iter().zip(&self.model.scales.states);
            let states = units.map(|(x, s)| x * s).collect();
            (given[inputs], states, given[..inputs].to_vec())
        };
        let given = grid.inputs.chunks_exact(inputs + 1).enumerate();
        let mut all: Vec<_> = given.map(point).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all
    }

    /// Outputs of run `j` at its samples, one vector per output, in their units.
    pub fn outputs_at_samples(&self, z: &[f64], j: usize) -> Vec<Vec<f64>> {
        let count = self.runs[j].time.len();
        let mut all = vec![vec![f64::NAN; count]; self.model.n_outputs()];
        self.evaluate_points(z, j, |samples, outputs| {
            for (own, output) in all.iter_mut().zip(outputs) {
                write_samples(samples, *output, own);
            }
        });
        for (k, own) in all.iter_mut().enumerate() {
            let factor = self.model.output_factor(k);
            own.iter_mut().for_each(|value| *value /= factor);
        }
        all
    }

    /// The recorded value of a measured output at a sample of run `j`; None if it is missing.
    pub fn recorded(&self, j: usize, output: usize, sample: u32) -> Option<f64> {
        let value = self.runs[j].measured[output].values[sample as usize];
        value.is_finite().then_some(value)
    }

    /// True if the loss of every recording is the square.
    pub(super) fn is_least_squares(&self) -> bool {
        let mut recordings = self.runs.iter().flat_map(|run| &run.measured);
        recordings.all(|own| own.loss == Loss::Square)
    }

    /// Evaluates the model at every point of run `j` and calls `observe` with the samples of each group of points and
    /// its outputs.
    pub(super) fn evaluate_points(
        &self,
        z: &[f64],
        j: usize,
        observe: impl FnMut(Samples, &[Lanes]),
    ) -> PointValues {
        simd::vectorised(Evaluate {
            problem: self,
            z,
            j,
            observe,
        })
    }

    /// Inputs at a point of run `j`, followed by the time.
    pub(super) fn inputs_at(&self, j: usize, point: usize) -> &[f64] {
        let size = self.model.n_inputs() + 1;
        &self.grids[j].inputs[point * size..(point + 1) * size]
    }

    /// States at the points of run `j`; the model is evaluated only if some point is a combination.
    pub(super) fn point_states(&self, z: &[f64], j: usize) -> PointValues {
        match self.grids[j].combinations {
            0 => PointValues::default(),
            _ => self.evaluate_points(z, j, |_, _| {}),
        }
    }

    /// The part of run `j` in the objective.
    pub fn run_objective(&self, z: &[f64], j: usize) -> f64 {
        let layout = &self.layout.runs[j];
        let [mut c, mut g] =
            [layout.equalities(), layout.inequalities()].map(|own| vec![0.0; own.len()]);
        self.evaluate_run(z, j, &mut c, &mut g)
    }

    /// Objective, equalities and bounded signals of one run; `c` and `g` are those of this run.
    fn evaluate_run(&self, z: &[f64], j: usize, c: &mut [f64], g: &mut [f64]) -> f64 {
        let n = self.n_states();
        let (run, grid, v) = (&self.runs[j], &self.grids[j], self.coefficients(z, j));
        let (first, c) = c.split_at_mut(self.layout.runs[j].known);
        let known = run.initial.iter().enumerate();
        let known = known.filter_map(|(i, value)| Some((i, (*value)?)));
        for ((i, value), c) in known.zip(first) {
            *c = v[i] - value / self.model.scales.states[i];
        }
        let count = run.time.len();
        let mut costs = Sum::default();
        let values = self.evaluate_points(z, j, |samples, outputs| {
            for (own, output) in run.measured.iter().zip(outputs) {
                costs.add(own.costs(samples, *output));
            }
            let bounded = g.chunks_exact_mut(count);
            for (g, output) in bounded.zip(&outputs[self.measured..]) {
                write_samples(samples, *output, g);
            }
        });
        simd::vectorised(Defects {
            grid,
            n,
            v,
            f: &values.f,
            c,
        });
        costs.value()
    }

    /// Scaled values of the constraints on θ.
    pub(super) fn constraint_values(&self, theta: &[f64], out: &mut [f64]) {
        let theta = theta.iter().zip(&self.model.scales.parameters);
        let physical: Vec<f64> = theta.map(|(t, s)| t * s).collect();
        let values = self.constraints.values(&physical);
        let scaled = values.iter().zip(&self.constraint_scales);
        out.iter_mut()
            .zip(scaled)
            .for_each(|(out, (v, s))| *out = v / s);
    }

    /// Scaled first and second derivatives of the constraints on θ with respect to θ̄_i and θ̄_j.
    pub(super) fn constraint_derivatives(
        &self,
        theta: &[f64],
        i: usize,
        j: usize,
    ) -> Vec<HyperDual64> {
        let scales = &self.model.scales.parameters;
        let mut physical: Vec<HyperDual64> = theta
            .iter()
            .zip(scales)
            .map(|(t, s)| HyperDual64::from(t * s))
            .collect();
        physical[i].eps1 = scales[i];
        physical[j].eps2 = scales[j];
        let values = self.constraints.values(&physical);
        values
            .iter()
            .zip(&self.constraint_scales)
            .map(|(v, s)| *v / *s)
            .collect()
    }
}

/// The magnitudes of the constraints: their values for parameters of the magnitudes of the scales. Where these may be near zero by
/// chance, those of linear constraints, such as ranges, are a part of how much they change with such parameters.
fn magnitudes(constraints: &ParameterConstraints, scales: &[f64]) -> Vec<f64> {
    const PART: f64 = 1e-3;
    let changes = |part: f64| {
        let mut all = vec![0.0; constraints.count()];
        for (k, scale) in scales.iter().enumerate() {
            let mut theta: Vec<Dual64> = scales.iter().map(|s| Dual64::from(part * s)).collect();
            theta[k].eps = *scale;
            let own = all.iter_mut().zip(constraints.values(&theta));
            own.for_each(|(change, value)| *change += value.eps.abs());
        }
        all
    };
    let changes = changes(1.0).into_iter().zip(changes(0.5));
    let magnitude = |(value, (change, elsewhere)): (f64, (f64, f64))| {
        let is_linear = change > 0.0 && (change - elsewhere).abs() <= 1e-9 * change;
        match is_linear {
            true => value.abs().max(PART * change),
            false => value.abs().max(PART),
        }
    };
    constraints
        .values(scales)
        .into_iter()
        .zip(changes)
        .map(magnitude)
        .collect()
}

/// Writes the values of a group of points to the positions of their samples.
#[inline(always)]
fn write_samples(samples: Samples, values: Lanes, out: &mut [f64]) {
    for (sample, value) in samples.into_iter().zip(values) {
        if let Some(sample) = sample {
            out[sample as usize] = value;
        }
    }
}

/// A compensated sum, separate for each lane: its rounding does not grow with the number of terms, so that a line
/// search can resolve the decrease of a step (Ogita, Rump & Oishi, *Accurate sum and dot product*, SIAM J. Sci. Comput.
/// 26, 2005).
#[derive(Default)]
struct Sum {
    sum: Lanes,
    lost: Lanes,
}

impl Sum {
    #[inline(always)]
    fn add(&mut self, terms: Lanes) {
        for (lane, term) in terms.into_iter().enumerate() {
            let (before, lost) = (self.sum[lane], &mut self.lost[lane]);
            let sum = before + term;
            let added = sum - before;
            *lost += (before - (sum - added)) + (term - added);
            self.sum[lane] = sum;
        }
    }

    /// After an infinite term, the compensation is not a number.
    fn value(&self) -> f64 {
        let sum: f64 = self.sum.iter().sum();
        match sum.is_finite() {
            true => sum + self.lost.iter().sum::<f64>(),
            false => sum,
        }
    }
}

/// Writes the defects `c` of the elements of a run, from its coefficient vectors `v` and the derivatives `f` at its
/// points.
struct Defects<'a> {
    grid: &'a Grid,
    n: usize,
    v: &'a [f64],
    f: &'a [f64],
    c: &'a mut [f64],
}

impl Task for Defects<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { grid, n, v, f, c } = self;
        for element in &grid.elements {
            let points = grid.points_of(element);
            let own = c[element.first * n..].chunks_exact_mut(n);
            for (defect, out) in element.tableau.defects.iter().zip(own) {
                let of_node = |j: usize| &v[(element.first + j) * n..][..n];
                let of_point = |i: usize| &f[points[i] as usize * n..][..n];
                match (defect.e.as_slice(), defect.a.as_slice()) {
                    // Two nodes and two points, as in the trapezoidal scheme, in one pass.
                    (&[(j, e), (k, d)], &[(i, a), (l, b)]) => {
                        let (a, b) = (element.h * a, element.h * b);
                        let (v, w) = (of_node(j), of_node(k));
                        let (f, g) = (of_point(i), of_point(l));
                        for (m, out) in out.iter_mut().enumerate() {
                            *out = e * v[m] + d * w[m] - a * f[m] - b * g[m];
                        }
                    }
                    _ => {
                        out.fill(0.0);
                        for &(j, e) in &defect.e {
                            let v = of_node(j);
                            out.iter_mut().zip(v).for_each(|(out, v)| *out += e * v);
                        }
                        for &(i, a) in &defect.a {
                            let (f, a) = (of_point(i), element.h * a);
                            out.iter_mut().zip(f).for_each(|(out, f)| *out -= a * f);
                        }
                    }
                }
            }
        }
    }
}

/// The task of [`Collocation::evaluate_points`].
struct Evaluate<'a, F> {
    problem: &'a Collocation,
    z: &'a [f64],
    j: usize,
    observe: F,
}

impl<F: FnMut(Samples, &[Lanes])> Task for Evaluate<'_, F> {
    type Output = PointValues;

    #[inline(always)]
    fn run(self) -> PointValues {
        let Self {
            problem,
            z,
            j,
            mut observe,
        } = self;
        let mut values = PointValues::new(problem, j);
        let (grid, n) = (&problem.grids[j], problem.n_states());
        let v = problem.coefficients(z, j);
        let mut model = problem.model.values(problem.theta(z));
        // If points use derivatives of previous ones, they are evaluated one by one.
        let step = if grid.has_nested() { 1 } else { LANES };
        let mut f = vec![[0.0; LANES]; n];
        let mut outputs = vec![[0.0; LANES]; problem.model.n_outputs()];
        for first in (0..grid.points.len()).step_by(step) {
            let (members, count) = simd::group(first, step, grid.points.len());
            for i in &members[..count] {
                values.combine(grid, v, *i, n);
            }
            let x = members.map(|i| values.states(grid, v, i, n));
            let input = members.map(|i| problem.inputs_at(j, i));
            model.evaluate(x, input, &mut f, &mut outputs);
            let own = values.f[first * n..].chunks_exact_mut(n);
            for (lane, own) in own.take(count).enumerate() {
                own.iter_mut().zip(&f).for_each(|(own, f)| *own = f[lane]);
            }
            observe(grid.samples(members, count), &outputs);
        }
        values
    }
}

/// Derivatives at all points of a run, and the states of the points that are combinations.
#[derive(Debug, Default)]
pub(super) struct PointValues {
    /// Scaled derivatives, `n` per point.
    pub f: Vec<f64>,
    combined: Vec<f64>,
}

impl PointValues {
    fn new(problem: &Collocation, j: usize) -> Self {
        let (grid, n) = (&problem.grids[j], problem.n_states());
        Self {
            f: vec![0.0; grid.points.len() * n],
            combined: vec![0.0; grid.combinations * n],
        }
    }

    /// Computes the states of point `i` if it is a combination.
    #[inline]
    fn combine(&mut self, grid: &Grid, v: &[f64], i: usize, n: usize) {
        let PointState::Combination(c) = &grid.points[i].state else {
            return;
        };
        let out = &mut self.combined[c.index * n..(c.index + 1) * n];
        out.fill(0.0);
        for &(k, p) in &c.p {
            out.iter_mut()
                .zip(&v[k * n..])
                .for_each(|(o, v)| *o += p * v);
        }
        for &(l, q) in &c.q {
            out.iter_mut()
                .zip(&self.f[l * n..])
                .for_each(|(o, f)| *o += q * f);
        }
    }

    /// The states of point `i`, given the coefficient vectors of the run.
    #[inline]
    pub fn states<'a>(&'a self, grid: &Grid, v: &'a [f64], i: usize, n: usize) -> &'a [f64] {
        grid.points[i].state.of(v, &self.combined, n)
    }
}

impl Problem for Collocation {
    fn n_variables(&self) -> usize {
        self.layout.theta + self.n_parameters()
    }

    fn n_equalities(&self) -> usize {
        self.layout.n_equalities
    }

    fn limits(&self) -> (&[f64], &[f64]) {
        (&self.limits.0, &self.limits.1)
    }

    fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64 {
        let (path, on_theta) = g.split_at_mut(self.layout.parameter_constraints);
        self.constraint_values(self.theta(z), on_theta);
        let runs = &self.layout.runs;
        let mut work: Vec<_> = parallel::parts(c, runs.iter().map(|r| r.equalities()))
            .zip(parallel::parts(path, runs.iter().map(|r| r.inequalities())))
            .map(|(c, g)| (c, g, 0.0))
            .collect();
        parallel::each(&mut work, |j, (c, g, objective)| {
            *objective = self.evaluate_run(z, j, c, g);
        });
        work.iter().map(|(_, _, objective)| objective).sum()
    }

    fn damping_weights(&self) -> &[f64] {
        &self.damping_weights
    }
}
