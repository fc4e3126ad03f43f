//! Contributions of a run to the reduced Hessians and the linear term.

use super::dense::axpy;
use super::points::Points;
use super::run::{Place, RunSweep};
use crate::simd::{self, Kernel, LANES, Lanes};

/// A quadratic model over the reduced variables of a run.
#[derive(Debug, Clone, Default)]
pub struct Reduced {
    /// `Σ Zᵀ W Z`, r × r, row-major.
    pub matrix: Vec<f64>,
    /// `Σ Zᵀ (g + W [e; 0])`.
    pub vector: Vec<f64>,
}

impl RunSweep {
    /// The model with `δ[Y; θ] = Z ρ + [e; 0]`: with Gauss–Newton and, on request, with the exact Hessian. Also
    /// computes the rows of the bounded outputs.
    pub fn reduce(&mut self, at: Place<'_>, exact: bool) -> [Reduced; 2] {
        let w = self.w;
        simd::run(
            w,
            Reduce {
                own: self,
                at,
                exact,
            },
        )
    }

    #[inline(always)]
    fn reduced<const W: usize>(&mut self, at: Place<'_>, exact: bool) -> [Reduced; 2] {
        let (p, r, model) = (self.p, self.r(), &at.problem.model);
        let grid = &at.problem.grids[at.j];
        let (measured, samples) = (at.problem.measured, at.problem.layout.runs[at.j].samples);
        let pairs = Pairs::of(&model.pairs, self.n);
        // Halves of the symmetric sums, over the reduced variables and 1, whose column in `S` holds the offsets. The
        // transposes are added at the end.
        let (mut squares, mut curved) = ([[0.0; W]; W], [[0.0; W]; W]);
        let mut slope = [0.0; W];
        let mut rows = std::mem::take(&mut self.bounded);
        for points in Points::all(grid) {
            let group = points.number;
            let s = points
                .states_of()
                .map(|state| self.s_of(state).as_chunks::<W>().0);
            for (bounded, own) in self.gradients[measured..].iter().enumerate() {
                let (gradient, columns) = (own.group(group), model.columns(measured + bounded));
                for (lane, sample) in points.samples() {
                    let row = project(gradient, lane, columns, s[lane], p);
                    let k = bounded * samples + sample;
                    rows.s[k * W..(k + 1) * W].copy_from_slice(&row);
                }
            }
            for (output, own) in self.gradients[..measured].iter().enumerate() {
                let (gradient, columns) = (own.group(group), model.columns(output));
                let weight = self.weight.group(group)[output];
                let pull = self.pull(group, output);
                let (mut factors, mut along) = ([[0.0; W]; LANES], [[0.0; W]; LANES]);
                for lane in 0..points.count {
                    let row = project(gradient, lane, columns, s[lane], p);
                    add(pull[lane], &row, &mut slope);
                    (factors[lane], along[lane]) = (row, [0.0; W]);
                    add(0.5 * weight[lane], &row, &mut along[lane]);
                }
                add_products(&factors, &along, r, &mut squares);
                if let Some((_, beyond)) = self.beyond(group, output).filter(|_| exact) {
                    for lane in 0..points.count {
                        along[lane] = [0.0; W];
                        add(0.5 * beyond[lane], &factors[lane], &mut along[lane]);
                    }
                    add_products(&factors, &along, r, &mut curved);
                }
            }
            if exact {
                pairs.add(self.second.group(group), &s, points.count, r, &mut curved);
            }
        }
        self.bounded = rows;
        let gauss_newton = symmetric(&squares, &slope, r);
        let mut full = Reduced::default();
        if exact {
            full = symmetric(&curved, &[0.0; W], r);
            axpy(1.0, &gauss_newton.matrix, &mut full.matrix);
            axpy(1.0, &gauss_newton.vector, &mut full.vector);
        }
        [gauss_newton, full]
    }
}

struct Reduce<'a> {
    own: &'a mut RunSweep,
    at: Place<'a>,
    exact: bool,
}

impl Kernel for Reduce<'_> {
    type Output = [Reduced; 2];

    #[inline(always)]
    fn run<const W: usize>(self) -> Self::Output {
        self.own.reduced::<W>(self.at, self.exact)
    }
}

/// `y += a x` with a constant length.
#[inline(always)]
fn add<const W: usize>(a: f64, x: &[f64; W], y: &mut [f64; W]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = a.mul_add(*x, *y);
    }
}

/// `gradientᵀ Z` over the reduced variables, with `Z = [S; I 0]`, for a gradient stored at these columns.
#[inline(always)]
fn project<const W: usize>(
    gradient: &[Lanes],
    lane: usize,
    columns: &[usize],
    s: &[[f64; W]],
    p: usize,
) -> [f64; W] {
    let mut out = [0.0; W];
    for (g, &c) in gradient.iter().zip(columns) {
        match c.checked_sub(s.len()) {
            None => add(g[lane], &s[c], &mut out),
            Some(parameter) => out[..p][parameter] += g[lane],
        }
    }
    out
}

/// Adds `Σ factors alongᵀ` of a group of points to the first `r + 1` rows of a matrix.
#[inline(always)]
fn add_products<const W: usize>(
    factors: &[[f64; W]; LANES],
    along: &[[f64; W]; LANES],
    r: usize,
    matrix: &mut [[f64; W]; W],
) {
    for (i, row) in matrix[..r + 1].iter_mut().enumerate() {
        for (factors, along) in factors.iter().zip(along) {
            add(factors[i], along, row);
        }
    }
}

/// Matrix and vector from halves of the symmetric sums over the reduced variables and 1.
fn symmetric<const W: usize>(halves: &[[f64; W]; W], slope: &[f64; W], r: usize) -> Reduced {
    let entry = |i: usize, l: usize| halves[i][l] + halves[l][i];
    Reduced {
        matrix: (0..r * r).map(|k| entry(k / r, k % r)).collect(),
        vector: (0..r).map(|i| entry(i, r) + slope[i]).collect(),
    }
}

/// The pairs of variables with second derivatives, grouped by their contribution to the reduced Hessian: their indices
/// among all pairs, and their variables.
struct Pairs {
    /// Pairs of states: the first state, and its partners.
    states: Vec<(usize, Vec<OfStates>)>,
    /// Pairs of a state and a parameter.
    mixed: Vec<(usize, usize, usize)>,
    /// Pairs of parameters.
    parameters: Vec<(usize, usize, usize, f64)>,
}

/// Index of the pair, second state, and the factor ½ for a square.
type OfStates = (usize, usize, f64);

impl Pairs {
    fn of(pairs: &[(usize, usize)], n: usize) -> Self {
        let mut out = Self {
            states: Vec::new(),
            mixed: Vec::new(),
            parameters: Vec::new(),
        };
        for (k, &(a, b)) in pairs.iter().enumerate() {
            let half = if a == b { 0.5 } else { 1.0 };
            match (a.checked_sub(n), b.checked_sub(n)) {
                (None, None) => match out.states.last_mut().filter(|own| own.0 == a) {
                    Some((_, others)) => others.push((k, b, half)),
                    None => out.states.push((a, vec![(k, b, half)])),
                },
                (None, Some(parameter)) => out.mixed.push((k, a, parameter)),
                (Some(a), Some(b)) => out.parameters.push((k, a, b, half)),
                (Some(_), None) => unreachable!("pairs are ordered"),
            }
        }
        out
    }

    /// Adds `Σ w z_a z_bᵀ` of a group of points, with `z_a` row `a` of `Z = [S; I]`: half of it for a square, and for a
    /// pair of state and parameter only the term in the row of the parameter.
    #[inline(always)]
    fn add<const W: usize>(
        &self,
        values: &[Lanes],
        s: &[&[[f64; W]]; LANES],
        count: usize,
        r: usize,
        matrix: &mut [[f64; W]; W],
    ) {
        for (a, others) in &self.states {
            let (mut factors, mut along) = ([[0.0; W]; LANES], [[0.0; W]; LANES]);
            for lane in 0..count {
                factors[lane] = s[lane][*a];
                for &(k, b, half) in others {
                    add(half * values[k][lane], &s[lane][b], &mut along[lane]);
                }
            }
            add_products(&factors, &along, r, matrix);
        }
        for &(k, a, parameter) in &self.mixed {
            for lane in 0..count {
                add(values[k][lane], &s[lane][a], &mut matrix[parameter]);
            }
        }
        for &(k, a, b, half) in &self.parameters {
            let sum: f64 = values[k][..count].iter().sum();
            matrix[a][b] += half * sum;
        }
    }
}
