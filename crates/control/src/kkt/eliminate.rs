//! Midpoints and ends of a group of intervals, eliminated by the linearised defects.

use super::combine::{choose, combine_lanes};
use super::{Kkt, Linearised, Spread};
use crate::evaluation::Evaluator;
use crate::program::Program;
use pilotage_collocation::simd::{LANES, Lanes, plus, scaled, times};

const ZERO: Lanes = [0.0; LANES];

/// What is kept of each group.
pub(super) struct Eliminated {
    /// `∂x₁/∂(residual)`: the inverse of the end's equation, `n × n`.
    pub inverse: Vec<Lanes>,
    /// Rows of the states of the Hessian at the midpoint, `n × [x u θ]`.
    pub curvature: Vec<Lanes>,
    /// Entries of the Jacobian at the ends.
    pub at_end: Vec<Lanes>,
    pub scratch: Scratch,
}

/// Of one group.
pub(super) struct Scratch {
    /// Map from `[x u θ | w]` to the end's states, `n × all`; the quadratic model over `[x u θ | w]`, its upper triangle.
    pub to_end: Vec<Lanes>,
    pub local: Vec<Lanes>,
    /// Second derivatives at the ends where controls jump, at the places of the pattern.
    pub of_end: Vec<Lanes>,
    /// The midpoint's `[x u θ]`, and before the end is known.
    middle: Vec<Lanes>,
    before: Vec<Lanes>,
    /// `∂x̄/∂x₁`; the end's equation.
    half: Vec<Lanes>,
    own: Vec<Lanes>,
    right: Vec<Lanes>,
    product: Vec<Lanes>,
    second: Vec<Lanes>,
    /// Rows that matter.
    rows: Vec<usize>,
    states: Vec<usize>,
    chosen: Vec<usize>,
}

impl Eliminated {
    pub fn new(program: &Program, places: usize) -> Self {
        let (n, m, p) = (program.n(), program.m(), program.p());
        let (size, all) = (n + m + p, n + 2 * m + p);
        let groups = program.intervals().div_ceil(LANES);
        let zeros = |count: usize| vec![ZERO; count];
        Self {
            inverse: zeros(groups * n * n),
            curvature: zeros(groups * n * size),
            at_end: zeros(groups * program.model.entries.len()),
            scratch: Scratch {
                to_end: zeros(n * all),
                local: zeros(all * all),
                of_end: zeros(places),
                middle: zeros(size * all),
                before: zeros(n * all),
                half: zeros(n * n),
                own: zeros(n * n),
                right: zeros(n * all),
                product: zeros(size * all),
                second: zeros(places),
                rows: Vec::with_capacity(size),
                states: (0..n).collect(),
                chosen: Vec::with_capacity(size),
            },
        }
    }
}

/// `out += factor v`, lane by lane.
#[inline(always)]
fn add(factor: Lanes, v: &[Lanes], out: &mut [Lanes]) {
    for (out, v) in out.iter_mut().zip(v) {
        *out = plus(*out, factor, *v);
    }
}

/// Adds an entry of `[x u θ]` at a point as columns of `[x u θ | w]`.
#[inline(always)]
fn spread(to: &Spread, value: Lanes, out: &mut [Lanes]) {
    for (column, factor) in to {
        if *factor != 0.0 {
            out[*column] = plus(out[*column], [*factor; LANES], value);
        }
    }
}

/// The inverse of an `n × n` matrix, which is lost, by elimination with row exchanges where a pivot is small.
#[inline(always)]
fn invert(a: &mut [Lanes], n: usize, inverse: &mut [Lanes]) {
    const SMALL: f64 = 0.1;
    inverse.fill(ZERO);
    (0..n).for_each(|i| inverse[i * n + i] = [1.0; LANES]);
    for k in 0..n {
        for i in k + 1..n {
            for lane in 0..LANES {
                if SMALL * a[i * n + k][lane].abs() <= a[k * n + k][lane].abs() {
                    continue;
                }
                for j in 0..n {
                    let other = a[i * n + j][lane];
                    a[i * n + j][lane] = std::mem::replace(&mut a[k * n + j][lane], other);
                    let other = inverse[i * n + j][lane];
                    inverse[i * n + j][lane] =
                        std::mem::replace(&mut inverse[k * n + j][lane], other);
                }
            }
        }
        let mut pivot = a[k * n + k];
        for lane in &mut pivot {
            *lane = 1.0 / *lane;
        }
        for j in 0..n {
            a[k * n + j] = times(a[k * n + j], pivot);
            inverse[k * n + j] = times(inverse[k * n + j], pivot);
        }
        for i in 0..n {
            let factor = scaled(-1.0, a[i * n + k]);
            if i == k || factor == ZERO {
                continue;
            }
            for j in 0..n {
                if j > k {
                    a[i * n + j] = plus(a[i * n + j], factor, a[k * n + j]);
                }
                inverse[i * n + j] = plus(inverse[i * n + j], factor, inverse[k * n + j]);
            }
        }
    }
}

impl Kkt<'_> {
    /// Eliminates midpoints and ends of a group.
    #[inline(always)]
    pub(super) fn eliminate(&mut self, evaluator: &Evaluator<'_>, of: &Linearised, group: usize) {
        self.map(evaluator, of, group);
        self.curve(evaluator, of, group);
    }

    /// The maps to midpoint and end.
    #[inline(always)]
    fn map(&mut self, evaluator: &Evaluator<'_>, of: &Linearised, group: usize) {
        let (n, all) = (self.n, self.all);
        let count = self.program.model.entries.len();
        let layout = &evaluator.layout;
        let values = &of.derivatives.entries;
        let at_end = &mut self.eliminated.at_end[group * count..(group + 1) * count];
        for (e, out) in at_end.iter_mut().enumerate() {
            *out = layout.at_end(values, count, group, e);
        }
        let start = &values[(layout.sets[0] + group) * count..][..count];
        let middle = &values[(layout.sets[1] + group) * count..][..count];
        let h = evaluator.lengths[group];
        let (eighth, sixth) = (scaled(1.0 / 8.0, h), scaled(1.0 / 6.0, h));
        let third = scaled(4.0, sixth);
        let own = &mut self.eliminated.scratch;
        let (to_middle, right) = (&mut own.before, &mut own.right);
        for matrix in [&mut *to_middle, right, &mut own.half, &mut own.own] {
            matrix.fill(ZERO);
        }
        for i in 0..n {
            to_middle[i * all + i] = [0.5; LANES];
            right[i * all + i] = [1.0; LANES];
            own.half[i * n + i] = [0.5; LANES];
            own.own[i * n + i] = [1.0; LANES];
        }
        for &(row, q, e) in &self.entries {
            let to = row * all..(row + 1) * all;
            let [begin, mid, end] = [
                &self.spreads[0][q],
                &self.spreads[1][q],
                &self.spreads[2][q],
            ];
            spread(begin, times(eighth, start[e]), &mut to_middle[to.clone()]);
            spread(begin, times(sixth, start[e]), &mut right[to.clone()]);
            if q < n {
                let at = row * n + q;
                own.half[at] = plus(own.half[at], scaled(-1.0, eighth), at_end[e]);
                own.own[at] = plus(own.own[at], scaled(-1.0, sixth), at_end[e]);
            } else {
                spread(
                    end,
                    scaled(-1.0, times(eighth, at_end[e])),
                    &mut to_middle[to.clone()],
                );
                spread(end, times(sixth, at_end[e]), &mut right[to.clone()]);
                spread(mid, times(third, middle[e]), &mut right[to]);
            }
        }
        for &(row, q, e) in self.entries.iter().filter(|own| own.1 < n) {
            let factor = times(third, middle[e]);
            add(
                factor,
                &to_middle[q * all..(q + 1) * all],
                &mut right[row * all..(row + 1) * all],
            );
            let half = &own.half[q * n..(q + 1) * n];
            add(
                scaled(-1.0, factor),
                half,
                &mut own.own[row * n..(row + 1) * n],
            );
        }
        let inverse = &mut self.eliminated.inverse[group * n * n..(group + 1) * n * n];
        invert(&mut own.own, n, inverse);
        own.to_end.fill(ZERO);
        own.middle[..n * all].copy_from_slice(to_middle);
        for i in 0..n {
            let factors = (&inverse[i * n..(i + 1) * n], 1);
            choose(&own.states, factors, &mut own.chosen);
            let out = &mut own.to_end[i * all..(i + 1) * all];
            combine_lanes(out, (right, all, 0), factors, &own.chosen);
        }
        for i in 0..n {
            let factors = (&own.half[i * n..(i + 1) * n], 1);
            choose(&own.states, factors, &mut own.chosen);
            let out = &mut own.middle[i * all..(i + 1) * all];
            combine_lanes(out, (&own.to_end, all, 0), factors, &own.chosen);
        }
        for q in n..self.size {
            own.middle[q * all..(q + 1) * all].fill(ZERO);
            spread(
                &self.spreads[1][q],
                [1.0; LANES],
                &mut own.middle[q * all..(q + 1) * all],
            );
        }
    }

    /// Second derivatives at a group of points, at the places of the pattern.
    #[inline(always)]
    fn second(&self, of: &Linearised, group: usize, out: &mut [Lanes]) {
        let model = &self.program.model;
        out.fill(ZERO);
        if of.is_exact {
            let own = &of.derivatives.pairs[group * model.pairs.len()..];
            self.pairs
                .iter()
                .zip(own)
                .for_each(|(place, value)| out[*place] = *value);
        }
        let outputs = model.n_outputs();
        if outputs == 0 {
            return;
        }
        let width: usize = (0..outputs).map(|k| model.columns(k).len()).sum();
        let gradients = &of.derivatives.gradients[group * width..(group + 1) * width];
        let sigma = &of.of_outputs[group * outputs..(group + 1) * outputs];
        for [k, a, b, place] in &self.products {
            out[*place] = plus(out[*place], times(sigma[*k], gradients[*a]), gradients[*b]);
        }
    }

    /// The quadratic model.
    #[inline(always)]
    fn curve(&mut self, evaluator: &Evaluator<'_>, of: &Linearised, group: usize) {
        let (n, all, size) = (self.n, self.all, self.size);
        let layout = &evaluator.layout;
        let mut second = std::mem::take(&mut self.eliminated.scratch.second);
        let mut local = std::mem::take(&mut self.eliminated.scratch.local);
        local.fill(ZERO);
        self.second(of, layout.sets[0] + group, &mut second);
        for (&(i, j), value) in self.pattern.iter().zip(&second) {
            // At the start each entry is one of the interval's.
            let [a, b] = [i, j].map(|q| self.spreads[0][q][0].0);
            let at = a.min(b) * all + a.max(b);
            local[at] = plus(local[at], [1.0; LANES], *value);
        }
        if !layout.is_shared {
            let mut of_end = std::mem::take(&mut self.eliminated.scratch.of_end);
            self.second(of, layout.sets[2] + group, &mut of_end);
            self.eliminated.scratch.of_end = of_end;
        }
        self.second(of, layout.sets[1] + group, &mut second);
        let is_damped = of.damping > 0.0;
        let own = &mut self.eliminated.scratch;
        let curvature = &mut self.eliminated.curvature[group * n * size..(group + 1) * n * size];
        own.product.fill(ZERO);
        for (&(i, j), value) in self.pattern.iter().zip(&mut second) {
            if is_damped && i == j && i < n {
                value.iter_mut().for_each(|value| *value += of.damping);
            }
            if i < n {
                curvature[i * size + j] = *value;
            }
            if j < n {
                curvature[j * size + i] = *value;
            }
            if *value == ZERO {
                continue;
            }
            let [row, other] = [i, j].map(|i| &own.middle[i * all..(i + 1) * all]);
            add(*value, other, &mut own.product[i * all..(i + 1) * all]);
            if i != j {
                add(*value, row, &mut own.product[j * all..(j + 1) * all]);
            }
        }
        own.rows.clear();
        for i in 0..size {
            let mut is_used = false;
            for own in &own.product[i * all..(i + 1) * all] {
                is_used |= *own != ZERO;
            }
            if is_used {
                own.rows.push(i);
            }
        }
        for a in 0..all {
            let factors = (&own.middle[a..], all);
            choose(&own.rows, factors, &mut own.chosen);
            let out = &mut local[a * all + a..(a + 1) * all];
            combine_lanes(out, (&own.product, all, a), factors, &own.chosen);
        }
        own.second = second;
        own.local = local;
    }
}
