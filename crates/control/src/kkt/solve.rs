//! Solutions of the factored system.

use super::combine::combine;
use super::{Kkt, Step};
use crate::evaluation::{Derivatives, Evaluator, gathered};
use crate::program::Program;
use pilotage_collocation::condensed::dense::cholesky_solve;
use pilotage_collocation::simd::{self, LANES, Lanes, Task, plus, scaled, times};

const ZERO: Lanes = [0.0; LANES];

/// Workspace.
#[derive(Default)]
pub(super) struct Offsets {
    /// Of each group, the offset of the ends.
    end: Vec<Lanes>,
    /// The gradient over `[x u θ | w]` through the midpoint, and that over the end's states.
    local: Vec<Lanes>,
    through: Vec<Lanes>,
    /// Of each interval, offsets of the decisions, and the gradient over the end's states of all that follows; with the
    /// step, the whole of it.
    decisions: Vec<f64>,
    following: Vec<f64>,
    /// Over `[s w ν]`.
    row: Vec<Lanes>,
    other: Vec<Lanes>,
    middle: Vec<Lanes>,
    pulled: Vec<Lanes>,
    of_middle: Vec<Lanes>,
    /// The step's `[x u θ]` at start, midpoint (but for its states) and end.
    points: [Vec<Lanes>; 3],
}

impl Offsets {
    pub fn new(program: &Program) -> Self {
        let (n, m, p) = (program.n(), program.m(), program.p());
        let count = program.intervals();
        let groups = count.div_ceil(LANES);
        Self {
            end: vec![ZERO; groups * n],
            local: vec![ZERO; groups * (n + 2 * m + p)],
            through: vec![ZERO; groups * n],
            decisions: vec![0.0; count * m],
            following: vec![0.0; count * n],
            row: Vec::new(),
            other: Vec::new(),
            middle: vec![ZERO; n],
            pulled: vec![ZERO; n],
            of_middle: vec![ZERO; n + m + p],
            points: [(); 3].map(|()| vec![ZERO; n + m + p]),
        }
    }
}

pub(super) struct Solve<'a, 'p> {
    pub own: &'a mut Kkt<'p>,
    pub evaluator: &'a Evaluator<'p>,
    pub derivatives: &'a Derivatives,
    pub c: &'a [Lanes],
    pub e: &'a [f64],
    pub gradient: &'a [f64],
    pub out: &'a mut Step,
}

impl Task for Solve<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        for group in 0..self.evaluator.lengths.len() {
            self.offset(group);
        }
        self.backward();
        self.begin();
        self.forward();
        for group in 0..self.evaluator.lengths.len() {
            self.complete(group);
        }
    }
}

/// Entries of the Jacobian at starts and midpoints of a group's intervals, and at their ends.
#[inline(always)]
fn entries<'a>(
    own: &'a Kkt<'_>,
    evaluator: &Evaluator<'_>,
    derivatives: &'a Derivatives,
    group: usize,
) -> [&'a [Lanes]; 3] {
    let count = own.program.model.entries.len();
    let of =
        |set: usize| &derivatives.entries[(evaluator.layout.sets[set] + group) * count..][..count];
    let end = &own.eliminated.at_end[group * count..][..count];
    [of(0), of(1), end]
}

impl Solve<'_, '_> {
    /// Offsets of midpoint and end from the residuals, and the midpoint's gradient.
    #[inline(always)]
    fn offset(&mut self, group: usize) {
        let (n, size, all) = (self.own.n, self.own.size, self.own.all);
        let program = self.own.program;
        let mut of = std::mem::take(&mut self.own.offsets);
        let h = self.evaluator.lengths[group];
        let (eighth, sixth) = (scaled(1.0 / 8.0, h), scaled(1.0 / 6.0, h));
        let third = scaled(4.0, sixth);
        let [start, middle, end] = entries(self.own, self.evaluator, self.derivatives, group);
        let (first, second) = self.c[2 * n * group..2 * n * (group + 1)].split_at(n);
        // The end's equation, with the midpoint that the first residual gives.
        for (own, second) in of.pulled.iter_mut().zip(second) {
            *own = scaled(-1.0, *second);
        }
        for &(row, q, e) in self.own.entries.iter().filter(|own| own.1 < n) {
            let factor = scaled(-1.0, times(third, middle[e]));
            of.pulled[row] = plus(of.pulled[row], factor, first[q]);
        }
        let inverse = &self.own.eliminated.inverse[group * n * n..(group + 1) * n * n];
        let offset = &mut of.end[group * n..(group + 1) * n];
        for (i, own) in offset.iter_mut().enumerate() {
            *own = ZERO;
            for j in 0..n {
                *own = plus(*own, inverse[i * n + j], of.pulled[j]);
            }
        }
        for i in 0..n {
            of.middle[i] = plus(scaled(-1.0, first[i]), [0.5; LANES], offset[i]);
        }
        for &(row, q, e) in self.own.entries.iter().filter(|own| own.1 < n) {
            let factor = scaled(-1.0, times(eighth, end[e]));
            of.middle[row] = plus(of.middle[row], factor, offset[q]);
        }
        let (members, _) = simd::group(LANES * group, LANES, program.intervals());
        of.of_middle.fill(ZERO);
        for i in 0..n {
            of.of_middle[i] = gathered(self.gradient, members.map(|k| program.middle(k) + i));
        }
        let curvature = &self.own.eliminated.curvature[group * n * size..(group + 1) * n * size];
        for i in 0..n {
            for q in 0..size {
                of.of_middle[q] = plus(of.of_middle[q], curvature[i * size + q], of.middle[i]);
            }
        }
        // Through the midpoint's equation.
        let local = &mut of.local[group * all..(group + 1) * all];
        let through = &mut of.through[group * n..(group + 1) * n];
        local.fill(ZERO);
        for i in 0..n {
            local[i] = scaled(0.5, of.of_middle[i]);
            through[i] = local[i];
        }
        let spread = |at: usize, q: usize, value: Lanes, local: &mut [Lanes]| {
            for (column, factor) in &self.own.spreads[at][q] {
                local[*column] = plus(local[*column], [*factor; LANES], value);
            }
        };
        for q in n..size {
            spread(1, q, of.of_middle[q], local);
        }
        for &(row, q, e) in &self.own.entries {
            let value = times(eighth, of.of_middle[row]);
            spread(0, q, times(value, start[e]), local);
            let value = scaled(-1.0, times(value, end[e]));
            if q < n {
                through[q] = plus(through[q], [1.0; LANES], value);
            } else {
                spread(2, q, value, local);
            }
        }
        self.own.offsets = of;
    }

    /// Gradients of all that follows, from the last node to the first.
    #[inline(always)]
    fn backward(&mut self) {
        let own = &mut *self.own;
        let (n, m, size, all, wide) = (own.n, own.m, own.size, own.all, own.wide);
        let program = own.program;
        let of = &mut own.offsets;
        for row in [&mut of.row, &mut of.other] {
            row.clear();
            row.resize(wide, ZERO);
        }
        let last = program.node(program.intervals());
        let flat = of.row.as_flattened_mut();
        flat[..n + m].copy_from_slice(&self.gradient[last..last + n + m]);
        flat[all..all + self.e.len()].copy_from_slice(self.e);
        for k in (0..program.intervals()).rev() {
            let (group, lane) = (k / LANES, k % LANES);
            let following = &own.stages.following[k * n * wide..(k + 1) * n * wide];
            let to_end = &own.stages.to_end[k * n * wide..(k + 1) * n * wide];
            let cross = &own.stages.cross[k * m * wide..(k + 1) * m * wide];
            of.following[k * n..(k + 1) * n].copy_from_slice(&of.row.as_flattened()[..n]);
            let offsets = &of.end[group * n..(group + 1) * n];
            combine::<1>(&mut of.row, following, n, |i| offsets[i][lane]);
            let (row, other) = (of.row.as_flattened(), of.other.as_flattened_mut());
            for (i, out) in other[..all].iter_mut().enumerate() {
                *out = of.local[group * all + i][lane];
            }
            other[all..].copy_from_slice(&row[all..]);
            for i in n + m..size {
                other[i] += row[i];
            }
            for c in 0..m {
                other[size + c] += row[n + c];
            }
            let (row, through) = (
                of.row.as_flattened(),
                &of.through[group * n..(group + 1) * n],
            );
            combine::<1>(&mut of.other, to_end, n, |i| row[i] + through[i][lane]);
            let decisions = &mut of.decisions[k * m..(k + 1) * m];
            let other = of.other.as_flattened_mut();
            for (own, value) in decisions.iter_mut().zip(&mut other[size..all]) {
                *own = -std::mem::take(value);
            }
            cholesky_solve(
                &own.stages.decisions[k * m * m..(k + 1) * m * m],
                m,
                decisions,
            );
            combine::<1>(&mut of.other, cross, m, |c| decisions[c]);
            let node = program.node(k);
            let other = of.other.as_flattened_mut();
            for (own, more) in other.iter_mut().zip(&self.gradient[node..node + n + m]) {
                *own += more;
            }
            std::mem::swap(&mut of.row, &mut of.other);
        }
    }

    /// The first node, the parameters and the multipliers of the equations at the ends.
    fn begin(&mut self) {
        let own = &mut *self.own;
        let (n, m, size, all, program) = (own.n, own.m, own.size, own.all, own.program);
        let (of, first) = (&mut own.offsets, &own.first);
        let row = of.row.as_flattened_mut();
        for (own, more) in row[n + m..size]
            .iter_mut()
            .zip(&self.gradient[program.theta()..])
        {
            *own += more;
        }
        let mut begin: Vec<f64> = first.free.iter().map(|i| -row[*i]).collect();
        cholesky_solve(&first.factor, begin.len(), &mut begin);
        let residual = |r: &usize| {
            let own = first.coupling[*r].iter().zip(&begin);
            row[all + r] + own.map(|(a, b)| a * b).sum::<f64>()
        };
        let mut nu: Vec<f64> = first.independent.iter().map(residual).collect();
        cholesky_solve(&first.schur, nu.len(), &mut nu);
        row.fill(0.0);
        self.out.e.fill(0.0);
        for (r, nu) in first.independent.iter().zip(&nu) {
            self.out.e[*r] = *nu;
            row[all + r] = *nu;
            let pairs = begin.iter_mut().zip(&first.responses[*r]);
            pairs.for_each(|(own, response)| *own -= nu * response);
        }
        for (i, value) in first.free.iter().zip(&begin) {
            row[*i] = *value;
        }
        self.out.z.fill(0.0);
        self.out.z[..n + m].copy_from_slice(&row[..n + m]);
        self.out.z[program.theta()..].copy_from_slice(&row[n + m..size]);
    }

    /// The nodes, one after the other.
    #[inline(always)]
    fn forward(&mut self) {
        let own = &mut *self.own;
        let (n, m, size, wide) = (own.n, own.m, own.size, own.wide);
        let program = own.program;
        let of = &mut own.offsets;
        for k in 0..program.intervals() {
            let (group, lane) = (k / LANES, k % LANES);
            let product = |matrix: &[Lanes], i: usize, row: &[Lanes]| -> f64 {
                let mut sum = ZERO;
                for (a, b) in matrix[i * wide..(i + 1) * wide].iter().zip(row) {
                    sum = plus(sum, *a, *b);
                }
                (sum[0] + sum[1]) + (sum[2] + sum[3])
            };
            let gain = &own.stages.gain[k * m * wide..(k + 1) * m * wide];
            for c in 0..m {
                of.decisions[k * m + c] += product(gain, c, &of.row);
            }
            let decisions = &of.decisions[k * m..(k + 1) * m];
            of.row.as_flattened_mut()[size..size + m].copy_from_slice(decisions);
            let to_end = &own.stages.to_end[k * n * wide..(k + 1) * n * wide];
            let node = program.node(k + 1);
            for i in 0..n {
                self.out.z[node + i] = of.end[group * n + i][lane] + product(to_end, i, &of.row);
            }
            self.out.z[node + n..node + n + m].copy_from_slice(decisions);
            let flat = of.row.as_flattened_mut();
            flat[..n + m].copy_from_slice(&self.out.z[node..node + n + m]);
            flat[size..size + m].fill(0.0);
            let following = &own.stages.following[k * n * wide..(k + 1) * n * wide];
            for i in 0..n {
                of.following[k * n + i] += product(following, i, &of.row);
            }
        }
    }

    /// Midpoints of a group, and multipliers of its defects from the stationarity of midpoints and ends.
    #[inline(always)]
    fn complete(&mut self, group: usize) {
        let (n, m, size) = (self.own.n, self.own.m, self.own.size);
        let program = self.own.program;
        let mut of = std::mem::take(&mut self.own.offsets);
        let h = self.evaluator.lengths[group];
        let (eighth, sixth) = (scaled(1.0 / 8.0, h), scaled(1.0 / 6.0, h));
        let third = scaled(4.0, sixth);
        let [start, middle, end] = entries(self.own, self.evaluator, self.derivatives, group);
        let (members, count) = simd::group(LANES * group, LANES, program.intervals());
        let z = &self.out.z;
        for q in 0..size {
            let [a, b] = match q >= n + m {
                true => [[z[program.theta() + q - n - m]; LANES]; 2],
                false => {
                    [0, 1].map(|next| gathered(z, members.map(|k| program.node(k + next) + q)))
                }
            };
            for (point, own) in of.points.iter_mut().enumerate() {
                own[q] = match q.checked_sub(n) {
                    Some(c) if c < m => {
                        let (first, second) = program.weights(c, point);
                        plus(scaled(first, a), [second; LANES], b)
                    }
                    _ => [a, a, b][point],
                };
            }
        }
        let at = |q: usize, point: usize| of.points[point][q];
        let first = &self.c[2 * n * group..2 * n * group + n];
        for (i, first) in first.iter().enumerate() {
            let sum = plus(at(i, 0), [1.0; LANES], at(i, 2));
            of.of_middle[i] = plus(scaled(-1.0, *first), [0.5; LANES], sum);
        }
        for &(row, q, e) in &self.own.entries {
            let both = plus(times(start[e], at(q, 0)), scaled(-1.0, end[e]), at(q, 2));
            of.of_middle[row] = plus(of.of_middle[row], eighth, both);
        }
        for q in n..size {
            of.of_middle[q] = at(q, 1);
        }
        let curvature = &self.own.eliminated.curvature[group * n * size..(group + 1) * n * size];
        for i in 0..n {
            of.middle[i] = gathered(self.gradient, members.map(|k| program.middle(k) + i));
            for q in 0..size {
                of.middle[i] = plus(of.middle[i], curvature[i * size + q], of.of_middle[q]);
            }
            let following = gathered(&of.following, members.map(|k| k * n + i));
            of.pulled[i] = plus(scaled(-1.0, following), [-0.5; LANES], of.middle[i]);
        }
        for &(row, q, e) in self.own.entries.iter().filter(|own| own.1 < n) {
            of.pulled[q] = plus(of.pulled[q], times(eighth, end[e]), of.middle[row]);
        }
        let inverse = &self.own.eliminated.inverse[group * n * n..(group + 1) * n * n];
        let (first, second) = self.out.c[2 * n * group..2 * n * (group + 1)].split_at_mut(n);
        second.fill(ZERO);
        for (i, first) in first.iter_mut().enumerate() {
            for (j, own) in second.iter_mut().enumerate() {
                *own = plus(*own, inverse[i * n + j], of.pulled[i]);
            }
            *first = scaled(-1.0, of.middle[i]);
        }
        for &(row, q, e) in self.own.entries.iter().filter(|own| own.1 < n) {
            first[q] = plus(first[q], times(third, middle[e]), second[row]);
        }
        for own in first.iter_mut().chain(second) {
            own[count..].fill(0.0);
        }
        for (lane, k) in members.into_iter().enumerate().take(count) {
            let to = &mut self.out.z[program.middle(k)..][..n];
            to.iter_mut()
                .zip(&of.of_middle)
                .for_each(|(to, own)| *to = own[lane]);
        }
        self.own.offsets = of;
    }
}
