//! Local errors of a solution and mesh refinement (J. T. Betts, *Practical Methods for Optimal Control and Estimation
//! Using Nonlinear Programming*, 2nd ed. 2010, section 4.7).

use super::mesh::Run;
use super::node::Differentiated;
use super::parallel;
use super::path::Path;
use super::reference::{Reference, Stop};
use super::tableau::Scheme;
use super::{Collocation, solve};
use pilotage_sqp::{Iteration, Solution, SqpOptions, Status};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Relative error of a step of the reference solution: this part of the errors that are asked for, between these limits.
const REFERENCE_PART: f64 = 0.01;
const REFERENCE_TOLERANCES: [f64; 2] = [1e-10, 1e-8];
/// Fraction of a state's scale below which its magnitude does not matter.
const SMALL: f64 = 1e-3;
/// Maximum number of steps of the reference solution in a part of an interval; if it needs more, the interval is far
/// too long for any scheme.
const MOST_STEPS: usize = 2000;
/// Maximum number of parts into which an interval is divided at a time.
const MOST_PARTS: f64 = 16.0;
/// Part of the tolerance at which a refinement aims: errors follow the order of the scheme only nearly, and one interval that exceeds
/// it means another solve.
const AIM: f64 = 0.5;

impl Collocation {
    /// Relative local errors of the states of every run, for each interval of its mesh.
    ///
    /// From the states at the start of an interval, the equations are solved with error control to the samples inside
    /// it and to its end, with an L-stable method if they are stiff. The error is the largest difference of a state
    /// there, divided by the largest magnitude of that state on the mesh of the run plus 10⁻³ of its scale. It is
    /// known to about a hundredth of `tolerance`, but not below 10⁻⁹, nor worse than 10⁻⁷; without a solution, or if stopped, the error is infinite.
    pub fn mesh_errors(&self, z: &[f64], tolerance: f64, stop: &Stop<'_>) -> Vec<Vec<f64>> {
        let mut errors = vec![Vec::new(); self.runs.len()];
        parallel::each(&mut errors, |j, out| {
            *out = self.run_errors(z, j, tolerance, stop)
        });
        errors
    }

    /// Typical magnitudes of the states of a run: the largest on its mesh, plus a fraction of the scale of the state.
    pub fn magnitudes(&self, z: &[f64], j: usize) -> Vec<f64> {
        let path = Path::new(self, z, j);
        let nodes: Vec<Vec<f64>> = self.runs[j].mesh.iter().map(|t| path.at(*t)).collect();
        self.sizes(&nodes)
    }

    fn sizes(&self, nodes: &[Vec<f64>]) -> Vec<f64> {
        let scales = self.model.scales.states.iter().enumerate();
        scales
            .map(|(i, s)| nodes.iter().fold(0.0_f64, |m, x| m.max(x[i].abs())) + SMALL * s)
            .collect()
    }

    fn run_errors(&self, z: &[f64], j: usize, tolerance: f64, stop: &Stop<'_>) -> Vec<f64> {
        let (run, path) = (&self.runs[j], Path::new(self, z, j));
        let theta = self.physical_theta(z);
        let nodes: Vec<Vec<f64>> = run.mesh.iter().map(|t| path.at(*t)).collect();
        let magnitudes = self.sizes(&nodes);
        let of = (&*self.model.tapes, run);
        let [least, most] = REFERENCE_TOLERANCES;
        let tolerance = (REFERENCE_PART * tolerance).clamp(least, most);
        let mut reference = Reference::new(of, &theta, &magnitudes, tolerance);
        reference.patience = MOST_STEPS;
        let error = |(ends, first): (&[f64], &Vec<f64>)| {
            let (mut time, mut x, mut worst) = (ends[0], first.clone(), 0.0_f64);
            for to in inside(run, ends).chain([ends[1]]) {
                let Some(next) = reference.between((time, to), &x, stop) else {
                    return f64::INFINITY;
                };
                let pairs = next.iter().zip(path.at(to)).zip(&magnitudes);
                worst = pairs.fold(worst, |m, ((x, own), s)| m.max((x - own).abs() / s));
                (time, x) = (to, next);
            }
            worst
        };
        run.mesh.windows(2).zip(&nodes).map(error).collect()
    }

    /// The same problem with other meshes of its runs.
    ///
    /// # Panics
    /// As [`Self::new`].
    pub fn with_meshes(&self, meshes: Vec<Vec<f64>>) -> Self {
        let mut runs = self.runs.clone();
        let pairs = runs.iter_mut().zip(meshes);
        pairs.for_each(|(run, mesh)| run.mesh = mesh);
        self.with_runs(runs)
    }

    /// The same problem with other runs.
    ///
    /// # Panics
    /// As [`Self::new`].
    pub fn with_runs(&self, runs: Vec<Run>) -> Self {
        self.with_equations(self.model.tapes.clone(), runs)
    }

    /// The same problem with other equations of the same variables and outputs, and other runs.
    ///
    /// # Panics
    /// As [`Self::new`].
    pub fn with_equations(&self, equations: Arc<Differentiated>, runs: Vec<Run>) -> Self {
        let (constraints, scales) = (self.constraints.clone(), self.model.scales.clone());
        Self::new(
            equations,
            constraints,
            self.scheme,
            runs,
            scales,
            &self.bounds,
        )
    }
}

/// Distinct times of the samples within an interval.
fn inside(run: &Run, ends: &[f64]) -> impl Iterator<Item = f64> {
    let first = run.time.partition_point(|t| *t <= ends[0]);
    let last = run.time.partition_point(|t| *t < ends[1]).max(first);
    let mut before = ends[0];
    let times = run.time[first..last].iter().copied();
    times.filter(move |t| *t > std::mem::replace(&mut before, *t))
}

/// Boundaries of a mesh on which the [local errors](Collocation::mesh_errors) of a run are expected to be below a
/// tolerance.
///
/// An interval with too large an error is divided into equal parts, according to the order of the scheme, but at most
/// eight. All boundaries are kept, since inputs may jump there.
pub fn refined(run: &Run, errors: &[f64], scheme: Scheme, tolerance: f64) -> Vec<f64> {
    let mut mesh = vec![run.mesh[0]];
    for (ends, error) in run.mesh.windows(2).zip(errors) {
        // At samples inside the interval the error is that of the interpolant.
        let power = match inside(run, ends).next() {
            Some(_) => scheme.degree() + 1,
            None => scheme.order() + 1,
        };
        let parts = match *error > tolerance {
            true => (error / (AIM * tolerance)).powf(1.0 / power as f64).ceil(),
            false => 1.0,
        };
        let parts = parts.min(MOST_PARTS) as usize;
        let part = |k: usize| ends[0] + (ends[1] - ends[0]) * (k as f64 / parts as f64);
        mesh.extend((1..parts).map(part));
        mesh.push(ends[1]);
    }
    mesh
}

/// A solution on refined meshes.
#[derive(Debug)]
pub struct Refined {
    /// The problem with the last meshes.
    pub problem: Collocation,
    /// Its solution.
    pub solution: Solution,
    /// Its [local errors](Collocation::mesh_errors).
    pub errors: Vec<Vec<f64>>,
    /// Number of refinements of the meshes.
    pub rounds: usize,
}

/// Solves a problem from these variables on meshes that are refined until every [local error](Collocation::mesh_errors)
/// is below `tolerance`, at most `rounds` times, each time from the previous solution. It ends with the first solve
/// that does not converge.
pub fn solve_refined(
    mut problem: Collocation,
    mut z: Vec<f64>,
    options: &SqpOptions,
    (tolerance, rounds): (f64, usize),
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>,
) -> Refined {
    let mut round = 0;
    loop {
        let solution = solve(&problem, z, options, observer);
        let errors = problem.mesh_errors(&solution.iterate.z, tolerance, &|| false);
        let is_exact = errors.iter().flatten().all(|error| *error <= tolerance);
        if is_exact || round == rounds || solution.status != Status::Converged {
            return Refined {
                problem,
                solution,
                errors,
                rounds: round,
            };
        }
        let pairs = problem.runs.iter().zip(&errors);
        let meshes = pairs.map(|(run, own)| refined(run, own, problem.scheme, tolerance));
        let finer = problem.with_meshes(meshes.collect());
        z = problem.carried(&solution.iterate.z, &finer);
        problem = finer;
        round += 1;
    }
}
