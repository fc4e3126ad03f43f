//! The recursion over the nodes, from the last to the first.

use super::Kkt;
use super::Linearised;
use super::PENALTY;
use super::combine::combine;
use crate::evaluation::Evaluator;
use crate::program::Duration;
use crate::program::Place;
use crate::program::Program;
use pilotage_collocation::condensed::dense::cholesky;
use pilotage_collocation::simd::LANES;
use pilotage_collocation::simd::Lanes;
use pilotage_collocation::simd::Task;

const ZERO: Lanes = [0.0; LANES];

/// The factored intervals. Rows are over `[x u θ | w | ν]`.
pub(super) struct Stages {
    /// Rows of the states of the Hessian of all that follows an interval, over `[x₁ w θ]`.
    pub following: Vec<Lanes>,
    /// Map to the states at the end.
    pub to_end: Vec<Lanes>,
    /// The decisions `w = gain [s ν] + ...`, second derivatives with `[s ν]`, and Cholesky factors.
    pub gain: Vec<Lanes>,
    pub cross: Vec<Lanes>,
    pub decisions: Vec<f64>,
    /// Barrier weights of the controls at the nodes, and of rates: control, whether it falls, and the weight.
    bounds: Vec<f64>,
    rates: Vec<Vec<(usize, bool, f64)>>,
    /// Workspace: of all that follows, its product with the map, and the interval's model.
    value: Vec<Lanes>,
    product: Vec<Lanes>,
    model: Vec<Lanes>,
    /// Second derivatives with ν alone.
    pub schur: Vec<f64>,
}

impl Stages {
    pub fn new(program: &Program, wide: usize) -> Self {
        let (n, m) = (program.n(), program.m());
        let (size, count) = (n + m + program.p(), program.intervals());
        let rows = |rows: usize| vec![ZERO; rows * wide];
        Self {
            following: rows(count * n),
            to_end: rows(count * n),
            gain: rows(count * m),
            cross: rows(count * m),
            decisions: vec![0.0; count * m * m],
            bounds: vec![0.0; (count + 1) * m],
            rates: vec![Vec::new(); count],
            value: rows(size),
            product: rows(size),
            model: rows(size + m),
            schur: Vec::new(),
        }
    }
}

/// The factorisation, with rows of `W` [`Lanes`] that are one block, or of many blocks of `B`.
pub(super) struct Factor<'a, 'p, const B: usize, const W: usize> {
    pub own: &'a mut Kkt<'p>,
    pub evaluator: &'a Evaluator<'p>,
    pub of: &'a Linearised,
}

impl<const B: usize, const W: usize> Task for Factor<'_, '_, B, W> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self { own, evaluator, of } = self;
        own.begin(evaluator, of);
        let count = own.program.intervals();
        for group in (0..count.div_ceil(LANES)).rev() {
            own.eliminate(evaluator, of, group);
            for k in (LANES * group..count.min(LANES * (group + 1))).rev() {
                own.at_node(of, k + 1);
                if !evaluator.layout.is_shared {
                    own.add_end(k % LANES);
                }
                if !own.reduce::<B, W>(of, k) {
                    return false;
                }
            }
        }
        own.at_node(of, 0);
        own.finish(evaluator, of)
    }
}

impl Kkt<'_> {
    pub(super) fn value(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.stages.value.as_flattened_mut()[i * LANES * self.wide + j]
    }

    /// The last node, and the barriers of controls and their rates.
    fn begin(&mut self, evaluator: &Evaluator<'_>, of: &Linearised) {
        let m = self.m;
        let stages = &mut self.stages;
        stages.value.fill(ZERO);
        stages.bounds.fill(0.0);
        stages.rates.iter_mut().for_each(Vec::clear);
        stages.schur.clear();
        stages.schur.resize(self.rows.1.len().pow(2), 0.0);
        for (row, sigma) in self.rows.0.iter().zip(&of.sigma) {
            match row.place {
                Place::Control { node, control } => stages.bounds[node * m + control] += sigma,
                Place::Rate {
                    interval,
                    control,
                    falls,
                } => stages.rates[interval].push((control, falls, *sigma)),
                _ => {}
            }
        }
        let last = self.program.intervals();
        self.add_pairs(evaluator, of, 1);
        for (r, row) in self.rows.0.iter().enumerate() {
            if matches!(row.place, Place::End(_)) {
                self.add_square(of.sigma[r], of.limited.row(r), last);
            }
        }
        if evaluator.layout.is_shared {
            self.add_last(evaluator, of);
        }
        for r in 0..self.rows.1.len() {
            if self.is_last[r] {
                self.add_square(PENALTY, of.equations.row(r), last);
                for (column, value) in of.equations.row(r) {
                    let (i, all) = (self.entry(column, last), self.all);
                    *self.value(i, all + r) = value;
                }
            }
        }
    }

    /// Second derivatives of what stands at the start (0) or the end (1) alone.
    pub(super) fn add_pairs(&mut self, evaluator: &Evaluator<'_>, of: &Linearised, side: usize) {
        let program = self.program;
        let model = [&program.start, &program.end][side];
        let own = &of.derivatives.pairs[evaluator.end_pairs()[side]..];
        for (&(i, j), value) in model.pairs.iter().zip(own).filter(|_| of.is_exact) {
            *self.value(i, j) += value[0];
            if i != j {
                *self.value(j, i) += value[0];
            }
        }
    }

    /// Limits of the path at the last node, which is no start of an interval.
    fn add_last(&mut self, evaluator: &Evaluator<'_>, of: &Linearised) {
        let (group, lane) = evaluator.layout.point(self.program.intervals() - 1, 2);
        let model = &self.program.model;
        let (pairs, outputs) = (model.pairs.len(), model.n_outputs());
        if of.is_exact {
            for (k, &(i, j)) in model.pairs.iter().enumerate() {
                let value = of.derivatives.pairs[group * pairs + k][lane];
                *self.value(i, j) += value;
                if i != j {
                    *self.value(j, i) += value;
                }
            }
        }
        let width: usize = (0..outputs).map(|k| model.columns(k).len()).sum();
        let mut first = group * width;
        for k in 0..outputs {
            let sigma = of.of_outputs[group * outputs + k][lane];
            for (a, i) in model.columns(k).iter().enumerate() {
                for (b, j) in model.columns(k).iter().enumerate() {
                    let [a, b] = [a, b].map(|a| of.derivatives.gradients[first + a][lane]);
                    *self.value(*i, *j) += sigma * a * b;
                }
            }
            first += model.columns(k).len();
        }
    }

    pub(super) fn add_square(
        &mut self,
        weight: f64,
        row: impl Iterator<Item = (usize, f64)> + Clone,
        node: usize,
    ) {
        for (i, a) in row.clone() {
            for (j, b) in row.clone() {
                let [i, j] = [i, j].map(|i| self.entry(i, node));
                *self.value(i, j) += weight * a * b;
            }
        }
    }

    /// Second derivatives at the end of an interval whose controls jump.
    #[inline(always)]
    fn add_end(&mut self, lane: usize) {
        for k in 0..self.pattern.len() {
            let (i, j) = self.pattern[k];
            let value = self.eliminated.scratch.of_end[k][lane];
            *self.value(i, j) += value;
            if i != j {
                *self.value(j, i) += value;
            }
        }
    }

    /// Damping and the limits of the controls at a node.
    #[inline(always)]
    fn at_node(&mut self, of: &Linearised, k: usize) {
        let (n, m) = (self.n, self.m);
        for i in 0..n + m {
            *self.value(i, i) += of.damping;
        }
        for c in 0..m {
            let bound = self.stages.bounds[k * m + c];
            *self.value(n + c, n + c) += bound;
        }
    }

    /// From all that follows an interval to all that follows its start.
    #[inline(always)]
    fn reduce<const B: usize, const W: usize>(&mut self, of: &Linearised, k: usize) -> bool {
        let (n, m, size, all) = (self.n, self.m, self.size, self.all);
        let wide = if W == 0 { self.wide } else { W };
        let equations = self.rows.1.len();
        let own = &mut self.stages;
        let lane = k % LANES;
        let scratch = &self.eliminated.scratch;
        let to_end = &mut own.to_end[k * n * wide..(k + 1) * n * wide];
        let flat = to_end.as_flattened_mut();
        for i in 0..n {
            let from = &scratch.to_end[i * all..(i + 1) * all];
            let to = &mut flat[i * LANES * wide..][..all];
            to.iter_mut()
                .zip(from)
                .for_each(|(to, from)| *to = from[lane]);
        }
        own.following[k * n * wide..(k + 1) * n * wide].copy_from_slice(&own.value[..n * wide]);
        // Columns of `[x₁ w θ ν]` as those of `[s w ν]`.
        let columns = LANES * wide;
        for i in 0..size {
            let product = &mut own.product[i * wide..(i + 1) * wide];
            let value = &own.value.as_flattened()[i * columns..(i + 1) * columns];
            product.fill(ZERO);
            let flat = product.as_flattened_mut();
            flat[n + m..size].copy_from_slice(&value[n + m..size]);
            flat[size..all].copy_from_slice(&value[n..n + m]);
            flat[all..].copy_from_slice(&value[all..]);
            combine::<B>(product, to_end, n, |j| value[j]);
        }
        for i in 0..all {
            let model = &mut own.model[i * wide..(i + 1) * wide];
            let flat = model.as_flattened_mut();
            for (j, value) in flat[..i].iter_mut().enumerate() {
                *value = scratch.local[j * all + i][lane];
            }
            let local = &scratch.local[i * all + i..(i + 1) * all];
            for (value, local) in flat[i..all].iter_mut().zip(local) {
                *value = local[lane];
            }
            flat[all..].fill(0.0);
            let direct = match i {
                i if i >= size => Some(i - size + n),
                i if i >= n + m => Some(i),
                _ => None,
            };
            if let Some(row) = direct {
                let row = &own.product[row * wide..(row + 1) * wide];
                combine::<B>(model, row, 1, |_| 1.0);
            }
            let factors = to_end.as_flattened();
            combine::<B>(model, &own.product, n, |j| factors[j * columns + i]);
        }
        self.add_steps(of, k);
        let own = &mut self.stages;
        let cross = &mut own.cross[k * m * wide..(k + 1) * m * wide];
        cross.copy_from_slice(&own.model[size * wide..]);
        let factor = &mut own.decisions[k * m * m..(k + 1) * m * m];
        let flat = cross.as_flattened_mut();
        for c in 0..m {
            let row = &mut flat[c * columns + size..c * columns + all];
            factor[c * m..(c + 1) * m].copy_from_slice(row);
            row.fill(0.0);
        }
        if !cholesky(factor, m) {
            return false;
        }
        let gain = &mut own.gain[k * m * wide..(k + 1) * m * wide];
        for c in 0..m {
            let (before, row) = gain.split_at_mut(c * wide);
            let row = &mut row[..wide];
            row.fill(ZERO);
            combine::<B>(row, &cross[c * wide..(c + 1) * wide], 1, |_| -1.0);
            combine::<B>(row, before, c, |b| -factor[c * m + b]);
            scale(1.0 / factor[c * m + c], row);
        }
        for c in (0..m).rev() {
            let (row, after) = gain[c * wide..].split_at_mut(wide);
            let factors = |b: usize| -factor[(c + 1 + b) * m + c];
            combine::<B>(row, after, m - c - 1, factors);
            scale(1.0 / factor[c * m + c], row);
        }
        for i in 0..size {
            let value = &mut own.value[i * wide..(i + 1) * wide];
            value.copy_from_slice(&own.model[i * wide..(i + 1) * wide]);
            let factors = cross.as_flattened();
            combine::<B>(value, gain, m, |c| factors[c * columns + i]);
            value.as_flattened_mut()[size..all].fill(0.0);
        }
        for r in 0..equations {
            for c in 0..m {
                let factor = cross.as_flattened()[c * columns + all + r];
                let gain = &gain.as_flattened()[c * columns + all..][..equations];
                let schur = &mut own.schur[r * equations..(r + 1) * equations];
                schur
                    .iter_mut()
                    .zip(gain)
                    .for_each(|(own, gain)| *own += factor * gain);
            }
        }
        // Rounding leaves it not quite symmetric, and grows from interval to interval.
        let flat = own.value.as_flattened_mut();
        for i in 0..size {
            for j in 0..i {
                let mean = 0.5 * (flat[i * columns + j] + flat[j * columns + i]);
                (flat[i * columns + j], flat[j * columns + i]) = (mean, mean);
            }
        }
        true
    }

    /// Adds what depends on the change of the controls in the interval.
    #[inline(always)]
    fn add_steps(&mut self, of: &Linearised, k: usize) {
        let (n, m, size) = (self.n, self.m, self.size);
        let columns = LANES * self.wide;
        let model = self.stages.model.as_flattened_mut();
        let mut square = |weight: f64, row: [(usize, f64); 3]| {
            for (i, a) in row {
                for (j, b) in row {
                    model[i * columns + j] += weight * a * b;
                }
            }
        };
        for c in (0..m).filter(|_| of.smooth > 0.0) {
            square(2.0 * of.smooth, [(size + c, 1.0), (n + c, -1.0), (0, 0.0)]);
        }
        for &(c, falls, sigma) in &self.stages.rates[k] {
            let more = match self.program.duration {
                Duration::Sought(t) => {
                    let scale = self.program.model.scales.parameters[t];
                    (n + m + t, -self.program.allowance(k, c, falls) * scale)
                }
                Duration::Number(_) => (0, 0.0),
            };
            square(sigma, [(size + c, 1.0), (n + c, -1.0), more]);
        }
    }
}

#[inline(always)]
fn scale(factor: f64, row: &mut [Lanes]) {
    for own in row {
        own.iter_mut().for_each(|own| *own *= factor);
    }
}
