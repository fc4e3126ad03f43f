//! The workspace of one run, and its rows over the reduced variables.

use super::dense::axpy;
use super::sparse_lu::Symbolic;
use super::sweep::Span;
use crate::Collocation;
use crate::grid::{Grid, PointState};
use crate::simd::{self, Grouped, Kernel, LANES, Lanes, Task, width};
use pilotage_sqp::Iterate;
use std::collections::BTreeMap;

/// Workspace of one run, allocated once.
///
/// The reduced variables of a run are `ρ = [δθ; its free initial states]`; their number is `r`. The sweeps
/// ([`super::sweep`]) express the step of every unknown and point as `S ρ + e`.
#[derive(Debug, Clone)]
pub struct RunSweep {
    pub(super) n: usize,
    pub(super) p: usize,
    /// Width of the rows of `S`: `r + 1`, padded. Column `r` holds the offsets at the iterate.
    pub(super) w: usize,
    /// Indices of the free initial states.
    pub free: Vec<usize>,
    /// Jacobian entries at all points.
    pub(super) jacobian: Grouped,
    /// Gradients of the outputs at all points, stored at their columns.
    pub(super) gradients: Vec<Grouped>,
    /// Recorded minus modelled outputs at the points, and the weights of the squares that approximate their losses,
    /// `2 w` for a square loss; both zero if nothing is recorded.
    pub(super) residual: Grouped,
    pub(super) weight: Grouped,
    /// Slope and curvature of each loss minus those of its square; None if all losses are squares.
    pub(super) beyond: Option<Grouped>,
    /// Second derivatives at all points.
    pub(super) second: Grouped,
    /// Rows of `S` and steps, for the unknowns and for the points that are combinations.
    pub(super) nodes: Rows,
    pub(super) combined: Rows,
    /// Rows of the bounded outputs at the samples.
    pub(super) bounded: Rows,
    /// Groups of elements; their factors, `K_0` and `B`; and the elements with special elimination orders.
    pub(super) spans: Vec<Span>,
    pub(super) lu: Vec<Lanes>,
    pub(super) k0: Vec<Lanes>,
    pub(super) b: Vec<Lanes>,
    pub(super) special: BTreeMap<usize, (Symbolic, Vec<Lanes>)>,
    pub(super) work: Work,
    /// Largest sensitivity of an unknown to a reduced variable.
    pub(super) growth: f64,
    /// Whether all sensitivities are finite.
    pub(super) is_finite: bool,
    /// Contribution of this run to the gradient of the Lagrangian with respect to θ.
    pub theta_lagrangian: Vec<f64>,
    /// Scratch space: weights of the derivatives at the points, and derivatives with respect to the unknowns.
    pub(super) omega: Vec<f64>,
    pub(super) right: Vec<f64>,
}

/// Sensitivities and steps of a list of quantities.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// `[S e]`, with `w` columns, of which the first `r + 1` are used.
    pub s: Vec<f64>,
    /// `S ρ + e`.
    pub dx: Vec<f64>,
}

/// Scratch space of the sweeps, large enough for the largest element.
#[derive(Debug, Clone, Default)]
pub struct Work {
    pub lanes: Vec<Lanes>,
    pub points: Vec<[usize; LANES]>,
}

impl Rows {
    fn new(count: usize, w: usize) -> Self {
        Self {
            s: vec![0.0; count * w],
            dx: vec![0.0; count],
        }
    }
}

/// A run of a problem, as an argument of its linearisation.
#[derive(Debug)]
pub struct Place<'a> {
    /// The problem.
    pub problem: &'a Collocation,
    /// Index of the run.
    pub j: usize,
}

impl Clone for Place<'_> {
    fn clone(&self) -> Self {
        *self
    }
}

impl Copy for Place<'_> {}

impl RunSweep {
    /// Workspace for run `j`.
    pub fn new(problem: &Collocation, j: usize) -> Self {
        let (n, p, model) = (problem.n_states(), problem.n_parameters(), &problem.model);
        let (run, grid) = (&problem.runs[j], &problem.grids[j]);
        let (rows, points) = (
            problem.layout.runs[j].inequalities().len(),
            grid.points.len(),
        );
        let free: Vec<usize> = (0..n).filter(|&i| run.initial[i].is_none()).collect();
        let w = width(p + free.len() + 1).expect("checked by `Condensed::takes`");
        let largest = grid.elements.iter().map(|e| e.tableau.unknowns()).max();
        let size = n * largest.unwrap_or(0).max(1);
        Self {
            n,
            p,
            w,
            jacobian: Grouped::zeros(points, model.entries.len()),
            gradients: (0..model.n_outputs())
                .map(|k| Grouped::zeros(points, model.columns(k).len()))
                .collect(),
            residual: Grouped::zeros(points, problem.measured),
            weight: Grouped::zeros(points, problem.measured),
            beyond: (!problem.is_least_squares())
                .then(|| Grouped::zeros(points, 2 * problem.measured)),
            second: Grouped::zeros(points, model.pairs.len()),
            nodes: Rows::new(grid.nodes() * n, w),
            combined: Rows::new(grid.combinations * n, w),
            bounded: Rows::new(rows, w),
            spans: Vec::new(),
            lu: Vec::new(),
            k0: Vec::new(),
            b: Vec::new(),
            special: BTreeMap::new(),
            work: Work {
                lanes: vec![[0.0; LANES]; size],
                ..Work::default()
            },
            growth: 0.0,
            is_finite: true,
            theta_lagrangian: vec![0.0; p],
            omega: vec![0.0; points * n],
            right: vec![0.0; grid.nodes() * n],
            free,
        }
    }

    /// Number of reduced variables.
    #[inline]
    pub fn r(&self) -> usize {
        self.p + self.free.len()
    }

    /// Computes the derivatives at every point, and writes the run's contribution to `∇L` over its own variables into
    /// `lagrangian`.
    pub fn linearise(
        &mut self,
        at: Place<'_>,
        iterate: &Iterate,
        exact: bool,
        lagrangian: &mut [f64],
    ) {
        let place = &at.problem.layout.runs[at.j];
        let lambda = &iterate.lambda[place.equalities()];
        let eta = &iterate.eta[place.inequalities()];
        self.defects_transposed(at, lambda, lagrangian);
        self.differentiate(at, &iterate.z, eta, exact, lagrangian);
    }

    /// Writes `Eᵀ λ` and the multipliers of the known states into `out`, and the weights `-h Σ_r A_ri λ_r` of the
    /// derivatives at the points into `omega`.
    fn defects_transposed(&mut self, at: Place<'_>, lambda: &[f64], out: &mut [f64]) {
        let (n, grid) = (self.n, &at.problem.grids[at.j]);
        out.fill(0.0);
        self.omega.fill(0.0);
        let known = self.known();
        let count = n - self.free.len();
        known
            .zip(&lambda[..count])
            .for_each(|(i, lambda)| out[i] += lambda);
        simd::vectorised(DefectsTransposed {
            grid,
            n,
            lambda: &lambda[count..],
            out,
            omega: &mut self.omega,
        });
    }

    /// Rows of `S` for a point.
    #[inline]
    pub(super) fn s_of(&self, state: &PointState) -> &[f64] {
        state.of(&self.nodes.s, &self.combined.s, self.n * self.w)
    }

    /// Row of an inequality: its coefficients over the reduced variables, and its change due to the offsets.
    #[inline]
    pub fn bounded_row(&self, row: usize) -> (&[f64], f64) {
        let row = &self.bounded.s[row * self.w..][..=self.r()];
        (&row[..self.r()], row[self.r()])
    }

    /// Writes the linear changes of the bounded outputs at all samples for these reduced variables into `bounded.dx`,
    /// and returns them.
    pub fn bounded_changes(&mut self, rho: &[f64]) -> &[f64] {
        let padded = self.padded(rho, 1.0);
        simd::run(self.w, Expand(&mut self.bounded, &padded));
        &self.bounded.dx
    }

    /// Computes all steps from the reduced variables, with this multiple of the offsets, and stores them in `dx`.
    pub fn expand(&mut self, rho: &[f64], offsets: f64) {
        let padded = self.padded(rho, offsets);
        simd::run(self.w, Expand(&mut self.nodes, &padded));
        simd::run(self.w, Expand(&mut self.combined, &padded));
    }

    /// The reduced variables and the multiple of the offsets, padded to the width of a row.
    fn padded(&self, rho: &[f64], offsets: f64) -> Vec<f64> {
        let mut padded = [rho, &[offsets]].concat();
        padded.resize(self.w, 0.0);
        padded
    }
}

/// Contribution of the elements to `Eᵀ λ`, added to `out`, and the weights `omega` of the derivatives at the points.
struct DefectsTransposed<'a> {
    grid: &'a Grid,
    n: usize,
    lambda: &'a [f64],
    out: &'a mut [f64],
    omega: &'a mut [f64],
}

impl Task for DefectsTransposed<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            grid,
            n,
            lambda,
            out,
            omega,
        } = self;
        for element in &grid.elements {
            let points = grid.points_of(element);
            let rows = lambda[element.first * n..].chunks_exact(n);
            for (defect, lambda) in element.tableau.defects.iter().zip(rows) {
                for &(j, e) in &defect.e {
                    let k = element.first + j;
                    axpy(e, lambda, &mut out[k * n..(k + 1) * n]);
                }
                for &(i, a) in &defect.a {
                    let i = points[i] as usize;
                    axpy(-element.h * a, lambda, &mut omega[i * n..(i + 1) * n]);
                }
            }
        }
    }
}

/// `dx = [S e] ρ` of these rows, for padded reduced variables.
struct Expand<'a>(&'a mut Rows, &'a [f64]);

impl Kernel for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const W: usize>(self) {
        let Self(rows, rho) = self;
        let rho = rho.first_chunk::<W>().expect("padded");
        let (s, _) = rows.s.as_chunks::<W>();
        for (dx, s) in rows.dx.iter_mut().zip(s) {
            // Four sums at once: otherwise a product of rows is a single chain of additions.
            let mut sums = [0.0; LANES];
            for (s, rho) in s.chunks_exact(LANES).zip(rho.chunks_exact(LANES)) {
                for ((sum, s), rho) in sums.iter_mut().zip(s).zip(rho) {
                    *sum = s.mul_add(*rho, *sum);
                }
            }
            *dx = (sums[0] + sums[1]) + (sums[2] + sums[3]);
        }
    }
}
