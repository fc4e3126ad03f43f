//! The linearised defects of an element as sparse matrices. Their patterns are determined once for all elements with
//! the same tableau.
//!
//! With `δY_i = Σ_j P_ij δV_j` the defects of an element of length `h` are
//!
//! ```text
//! K_0 δV_0 + M [δV_1; ..; δV_s] + B δθ = -c
//! K_0 = E_0 ⊗ I - h Σ_i A_i P_i0 J_i,   M likewise,   B = -h Σ_i A_i ∂f/∂θ(Y_i)
//! ```
//!
//! Every entry is a constant minus `h` times a sum of entries of the Jacobians at the points.

use super::sparse_lu::{Symbolic, gathered, take};
use crate::grid::{Element, Grid};
use crate::simd::{Grouped, LANES, Lanes, less, plus};
use crate::tableau::{Tableau, Value};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Size of a model and the pattern of its Jacobian.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Number of states.
    pub n: usize,
    /// Entries `(row, column)` of `J`, then of `∂f/∂θ` with columns starting at `n`.
    pub entries: &'a [(usize, usize)],
    /// True for entries with the same value at all points.
    pub shared: &'a [bool],
}

/// The matrices of a tableau's elements.
#[derive(Debug, Clone)]
pub struct ElementJacobian {
    /// The tableau.
    pub tableau: Arc<Tableau>,
    n: usize,
    m: Pattern,
    k0: Pattern,
    b: Pattern,
    /// Assembly of `K_0` and `B`.
    pub start: Assembly,
    pub parameters: Assembly,
}

/// Structurally nonzero positions of a matrix, row by row, and the terms of their values.
#[derive(Debug, Clone, Default)]
struct Pattern {
    places: Vec<Place>,
    constant: Vec<f64>,
    stamps: Vec<Stamp>,
}

/// Row and column.
type Place = (u32, u32);

/// Position, and the point, Jacobian entry and factor of its term.
type Stamped = (Place, (usize, usize, f64));

/// The term `-h · factor · J(point)` of one Jacobian entry at a position.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    target: u32,
    point: u32,
    entry: u32,
    factor: f64,
}

/// Assembly of a matrix for a group of elements: `constant + h · slope` for the entries that all points share, and
/// stamps for the others.
#[derive(Debug, Clone, Default)]
pub struct Assembly {
    constant: Vec<f64>,
    slope: Vec<f64>,
    shared: Vec<Stamp>,
    own: Vec<Stamp>,
}

/// Elimination order for the `M` of an [`ElementJacobian`].
#[derive(Debug, Clone, Default)]
pub struct Order {
    /// Elimination order and pattern of the factors.
    pub symbolic: Symbolic,
    /// Positions of the pattern of `M` in the factors.
    places: Vec<u32>,
    assembly: Assembly,
}

impl Pattern {
    /// From constants and Jacobian entries (point, entry, factor), each with its position.
    fn new(constants: &[(Place, f64)], stamps: &[Stamped]) -> Self {
        let all = constants.iter().map(|c| c.0);
        let mut places: Vec<Place> = all.chain(stamps.iter().map(|s| s.0)).collect();
        places.sort_unstable();
        places.dedup();
        let find = |at: &Place| places.partition_point(|p| p < at);
        let mut constant = vec![0.0; places.len()];
        constants.iter().for_each(|(at, v)| constant[find(at)] += v);
        let stamp = |(at, (point, entry, factor)): &Stamped| Stamp {
            target: find(at) as u32,
            point: *point as u32,
            entry: *entry as u32,
            factor: *factor,
        };
        Self {
            stamps: stamps.iter().map(stamp).collect(),
            constant,
            places,
        }
    }

    /// The same pattern with the positions of a row separated, so that consecutive operations do not depend on each
    /// other.
    fn spread(mut self) -> Self {
        let mut met = BTreeMap::new();
        let mut turn = |row: u32| {
            let count = met.entry(row).or_insert(0_u32);
            *count += 1;
            *count
        };
        let mut order: Vec<(u32, usize)> = (self.places.iter().enumerate())
            .map(|(k, at)| (turn(at.0), k))
            .collect();
        order.sort_unstable();
        let mut new_place = vec![0; order.len()];
        (order.iter().enumerate()).for_each(|(new, (_, old))| new_place[*old] = new as u32);
        self.places = order.iter().map(|(_, k)| self.places[*k]).collect();
        self.constant = order.iter().map(|(_, k)| self.constant[*k]).collect();
        for stamp in &mut self.stamps {
            stamp.target = new_place[stamp.target as usize];
        }
        self
    }

    /// The assembly with the positions of the pattern mapped to `order` among `size`; None keeps their own.
    fn assembly(&self, shared: &[bool], order: Option<(&[u32], usize)>) -> Assembly {
        let at = |k: usize| order.map_or(k, |(places, _)| places[k] as usize);
        let size = order.map_or(self.places.len(), |(_, size)| size);
        let mut constant = vec![0.0; size];
        let values = self.constant.iter().enumerate();
        values.for_each(|(k, v)| constant[at(k)] = *v);
        let moved = self.stamps.iter().map(|stamp| Stamp {
            target: at(stamp.target as usize) as u32,
            ..*stamp
        });
        let (shared, own) = moved.partition(|stamp| shared[stamp.entry as usize]);
        Assembly {
            slope: vec![0.0; size],
            constant,
            shared,
            own,
        }
    }
}

impl Assembly {
    /// Updates the shared entries from the Jacobian at any point.
    fn refresh(&mut self, jacobian: &[f64]) {
        self.slope.fill(0.0);
        for stamp in &self.shared {
            self.slope[stamp.target as usize] -= stamp.factor * jacobian[stamp.entry as usize];
        }
    }

    /// Number of entries.
    #[inline]
    pub fn len(&self) -> usize {
        self.constant.len()
    }

    /// Computes the entries for a group of elements.
    #[inline(always)]
    fn fill(&self, at: &Group<'_>, out: &mut [Lanes]) {
        let values = self.constant.iter().zip(&self.slope);
        for (out, (constant, slope)) in out.iter_mut().zip(values) {
            *out = std::array::from_fn(|l| at.h[l].mul_add(*slope, *constant));
        }
        let jacobians = at.jacobians.flat();
        for stamp in &self.own {
            let points = &at.points[stamp.point as usize];
            let entry = LANES * stamp.entry as usize;
            let values = points.map(|first| jacobians[first + entry]);
            let factors = at.h.map(|h| h * stamp.factor);
            let out = &mut out[stamp.target as usize];
            *out = less(*out, factors, values);
        }
    }
}

impl ElementJacobian {
    /// The matrices for a model of this shape.
    pub fn new(tableau: Arc<Tableau>, shape: Shape<'_>) -> Self {
        let [m, k0, b] = patterns(&tableau, shape);
        let k0 = k0.spread();
        Self {
            start: k0.assembly(shape.shared, None),
            parameters: b.assembly(shape.shared, None),
            n: shape.n,
            tableau,
            m,
            k0,
            b,
        }
    }

    /// Number of rows of `M`.
    #[inline]
    pub fn size(&self) -> usize {
        self.n * self.tableau.unknowns()
    }

    /// Updates the entries that all points share, for the matrices and for `order`.
    pub fn refresh(&mut self, order: &mut Order, jacobian: &[f64]) {
        self.start.refresh(jacobian);
        self.parameters.refresh(jacobian);
        order.assembly.refresh(jacobian);
    }

    /// The values of `M` on its pattern, for one element of a group.
    fn matrix(&self, at: &Group<'_>, lane: usize, shared: &[bool]) -> Vec<f64> {
        let mut assembly = self.m.assembly(shared, None);
        assembly.refresh(&at.jacobian(lane));
        let mut out = vec![[0.0; LANES]; assembly.len()];
        assembly.fill(at, &mut out);
        out.iter().map(|v| v[lane]).collect()
    }

    /// The elimination order for an element of a group; None if its `M` is singular.
    pub fn order(&self, at: &Group<'_>, lane: usize, shared: &[bool]) -> Option<Order> {
        let values = self.matrix(at, lane, shared);
        let entries = self.m.places.iter().zip(&values);
        let entries: Vec<_> = entries
            .map(|(&(i, j), v)| (i as usize, j as usize, *v))
            .collect();
        let symbolic = Symbolic::new(self.size(), &entries)?;
        let places = self.m.places.iter();
        let places = symbolic.places(places.map(|&(i, j)| (i as usize, j as usize)));
        Some(Order {
            assembly: self.m.assembly(shared, Some((&places, symbolic.entries()))),
            places,
            symbolic,
        })
    }

    /// Factors the `M` of one element with a separate elimination order; the factors are in the first lane. None if it
    /// is singular.
    pub fn factor_alone(
        &self,
        at: &Group<'_>,
        lane: usize,
        shared: &[bool],
    ) -> Option<(Symbolic, Vec<Lanes>)> {
        let order = self.order(at, lane, shared)?;
        let mut lu = vec![[0.0; LANES]; order.symbolic.entries()];
        let values = self.matrix(at, lane, shared);
        let places = order.places.iter().zip(values);
        places.for_each(|(at, v)| lu[*at as usize][0] = v);
        let mut work = vec![[0.0; LANES]; self.size()];
        let regular = order.symbolic.factor(&mut lu, &mut work);
        regular[0].then_some((order.symbolic, lu))
    }

    /// Computes `M` in the positions of the order, `K_0` and `B` for a group of elements.
    #[inline(always)]
    pub fn fill(
        &self,
        order: &Order,
        at: &Group<'_>,
        (m, k0, b): (&mut [Lanes], &mut [Lanes], &mut [Lanes]),
    ) {
        order.assembly.fill(at, m);
        self.start.fill(at, k0);
        self.parameters.fill(at, b);
    }

    /// Adds `-K_0 from` to right-hand sides of `B` runs, whose rows are at these slots, using one lane of their `K_0`.
    #[inline(always)]
    pub fn start<const B: usize, const W: usize>(
        &self,
        (k0, lane): ([&[Lanes]; B], usize),
        from: &[[[f64; W]; B]],
        (slots, to): (&[u32], &mut [[[f64; W]; B]]),
    ) {
        let k0 = k0.map(|k0| &k0[..self.k0.places.len()]);
        for (k, (row, column)) in self.k0.places.iter().enumerate() {
            let from = &from[*column as usize];
            let to = &mut to[slots[*row as usize] as usize];
            for (member, k0) in k0.iter().enumerate() {
                let by = from[member];
                take(k0[k][lane % LANES], &by, &mut to[member]);
            }
        }
    }

    /// The same for one right-hand side of several runs.
    #[inline(always)]
    pub fn start_together(
        &self,
        (k0, lane): ([&[Lanes]; LANES], usize),
        from: &[Lanes],
        (slots, to): (&[u32], &mut [Lanes]),
    ) {
        for (value, (row, column)) in gathered(k0, lane).zip(&self.k0.places) {
            let to = &mut to[slots[*row as usize] as usize];
            *to = less(*to, value, from[*column as usize]);
        }
    }

    /// `out += K_0ᵀ λ` for several runs.
    #[inline(always)]
    pub fn start_transposed(
        &self,
        (k0, lane): ([&[Lanes]; LANES], usize),
        lambda: &[Lanes],
        out: &mut [Lanes],
    ) {
        for (value, (row, column)) in gathered(k0, lane).zip(&self.k0.places) {
            let out = &mut out[*column as usize];
            *out = plus(*out, value, lambda[*row as usize]);
        }
    }

    /// Adds `-B`, which occupies the first `p` columns, to right-hand sides whose rows are at these slots.
    #[inline(always)]
    pub fn parameters<const B: usize, const W: usize>(
        &self,
        (b, lane): ([&[Lanes]; B], usize),
        (slots, to): (&[u32], &mut [[[f64; W]; B]]),
    ) {
        let b = b.map(|b| &b[..self.b.places.len()]);
        for (k, (row, column)) in self.b.places.iter().enumerate() {
            let to = &mut to[slots[*row as usize] as usize];
            for (to, b) in to.iter_mut().zip(b) {
                to[*column as usize] -= b[k][lane % LANES];
            }
        }
    }
}

fn place(row: usize, column: usize) -> Place {
    (row as u32, column as u32)
}

/// Patterns of `M`, `K_0` and `B` of a tableau.
fn patterns(tableau: &Tableau, shape: Shape<'_>) -> [Pattern; 3] {
    let n = shape.n;
    let mut constants: [Vec<(Place, f64)>; 2] = Default::default();
    let mut stamps: [Vec<Stamped>; 3] = Default::default();
    for (defect, row) in tableau.defects.iter().enumerate() {
        for &(j, e) in &row.e {
            let (which, first) = block(j, n);
            let places = (0..n).map(|l| (place(defect * n + l, first + l), e));
            constants[which].extend(places);
        }
        for &(point, a) in &row.a {
            for (entry, &(l, c)) in shape.entries.iter().enumerate() {
                if c >= n {
                    stamps[2].push((place(defect * n + l, c - n), (point, entry, a)));
                    continue;
                }
                for (j, weight) in weights(&tableau.points[point].value) {
                    let (which, first) = block(j, n);
                    let at = place(defect * n + l, first + c);
                    stamps[which].push((at, (point, entry, a * weight)));
                }
            }
        }
    }
    [
        Pattern::new(&constants[0], &stamps[0]),
        Pattern::new(&constants[1], &stamps[1]),
        Pattern::new(&[], &stamps[2]),
    ]
}

/// The matrix to which an element's unknown belongs (0: `M`, 1: `K_0`), and its first column there.
fn block(unknown: usize, n: usize) -> (usize, usize) {
    match unknown.checked_sub(1) {
        Some(k) => (0, k * n),
        None => (1, 0),
    }
}

/// Weights of the element's unknowns at a point.
fn weights(value: &Value) -> Vec<(usize, f64)> {
    match value {
        Value::Unknown(j) => vec![(*j, 1.0)],
        Value::Combination(p) => p.clone(),
    }
}

/// A group of elements of one run: their lengths, and the positions of the Jacobians at their points.
#[derive(Debug)]
pub struct Group<'a> {
    h: Lanes,
    /// Start of the Jacobian at each point of the tableau.
    points: &'a [[usize; LANES]],
    jacobians: &'a Grouped,
}

impl<'a> Group<'a> {
    /// The group of these elements, with the Jacobians at all points of the run; `points` is scratch space.
    pub fn new(
        grid: &Grid,
        elements: [&Element; LANES],
        jacobians: &'a Grouped,
        points: &'a mut Vec<[usize; LANES]>,
    ) -> Self {
        let lists = elements.map(|element| grid.points_of(element));
        let starts = |k: usize| lists.map(|list| jacobians.first(list[k] as usize));
        points.clear();
        points.extend((0..lists[0].len()).map(starts));
        Self {
            h: elements.map(|element| element.h),
            points,
            jacobians,
        }
    }

    /// The Jacobian at the first point of one of the elements.
    fn jacobian(&self, lane: usize) -> Vec<f64> {
        let own = self.jacobians.flat()[self.points[0][lane]..].iter();
        own.step_by(LANES).copied().collect()
    }
}
