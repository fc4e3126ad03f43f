//! What is computed with vector instructions.

use super::Derivatives;
use super::Evaluator;
use super::Values;
use super::Weights;
use super::gathered;
use pilotage_collocation::simd;
use pilotage_collocation::simd::LANES;
use pilotage_collocation::simd::Lanes;
use pilotage_collocation::simd::Task;
use pilotage_collocation::simd::plus;
use pilotage_collocation::simd::scaled;
use pilotage_collocation::simd::times;

pub(super) struct Evaluate<'a, 'p> {
    pub(super) own: &'a Evaluator<'p>,
    pub(super) z: &'a [f64],
    pub(super) out: &'a mut Values,
}

impl Task for Evaluate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { own, z, out } = self;
        let program = own.program;
        let (n, m) = (program.n(), program.m());
        let theta = &z[program.theta()..];
        let mut first = 0;
        for (model, groups) in own.models() {
            let mut values = model.values(theta);
            let count = model.n_outputs();
            for group in groups {
                let [x, given] = own.points(group);
                let rates = &mut out.rates[group * (n + m)..(group + 1) * (n + m)];
                values.evaluate(x, given, rates, &mut out.outputs[first..first + count]);
                first += count;
            }
        }
        out.f = out.outputs[first - program.end.n_outputs()][0];
        let layout = &own.layout;
        for (group, h) in own.lengths.iter().enumerate() {
            let (members, count) = simd::group(LANES * group, LANES, layout.intervals);
            let c = &mut out.c[2 * n * group..2 * n * (group + 1)];
            let h = *h;
            for i in 0..n {
                let [a, middle, b] = [
                    gathered(z, members.map(|k| program.node(k) + i)),
                    gathered(z, members.map(|k| program.middle(k) + i)),
                    gathered(z, members.map(|k| program.node(k + 1) + i)),
                ];
                let fa = out.rates[(layout.sets[0] + group) * (n + m) + i];
                let fm = out.rates[(layout.sets[1] + group) * (n + m) + i];
                let fb = layout.at_end(&out.rates, n + m, group, i);
                for lane in 0..LANES {
                    let (fa, fm, fb) = (fa[lane], fm[lane], fb[lane]);
                    let (a, middle, b) = (a[lane], middle[lane], b[lane]);
                    c[i][lane] = middle - 0.5 * (a + b) - h[lane] / 8.0 * (fa - fb);
                    c[n + i][lane] = b - a - h[lane] / 6.0 * (fa + 4.0 * fm + fb);
                }
                c[i][count..].fill(0.0);
                c[n + i][count..].fill(0.0);
            }
        }
        out.steps = 0.0;
        if program.regularise > 0.0 {
            for k in 0..layout.intervals {
                let [a, b] = [k, k + 1].map(|k| &z[program.node(k) + n..][..m]);
                let steps = a.iter().zip(b).map(|(a, b)| (b - a) * (b - a));
                out.steps += program.regularise * steps.sum::<f64>();
            }
            out.f += out.steps;
        }
    }
}

pub(super) struct Differentiate<'a, 'p> {
    pub(super) own: &'a Evaluator<'p>,
    pub(super) z: &'a [f64],
    pub(super) weights: &'a Weights,
    pub(super) out: &'a mut Derivatives,
}

impl Task for Differentiate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            own,
            z,
            weights,
            out,
        } = self;
        let program = own.program;
        let theta = &z[program.theta()..];
        let size = program.n() + program.m();
        let still = vec![[0.0; LANES]; size];
        let mut outputs = vec![[0.0; LANES]; 0];
        let (mut first, mut of_gradients, mut of_pairs) = (0, 0, 0);
        let entries = program.model.entries.len();
        for (part, (model, groups)) in own.models().into_iter().enumerate() {
            let mut derivatives = model.derivatives(theta);
            let count = model.n_outputs();
            outputs.resize(count, [0.0; LANES]);
            for group in groups {
                let [x, given] = own.points(group);
                derivatives.evaluate(x, given, &mut outputs);
                let mut rates = &still[..];
                if part == 0 {
                    derivatives.jacobian(&mut out.entries[group * entries..][..entries]);
                    rates = &weights.rates[group * size..(group + 1) * size];
                }
                for k in 0..count {
                    let width = model.columns(k).len();
                    derivatives.gradient(k, &mut out.gradients[of_gradients..][..width]);
                    of_gradients += width;
                }
                let pairs = model.pairs.len();
                let own = &mut out.pairs[of_pairs..of_pairs + pairs];
                derivatives.second_order(rates, &weights.outputs[first..first + count], own);
                first += count;
                of_pairs += pairs;
            }
        }
    }
}

struct Pull<'a, 'p> {
    pub(super) own: &'a Evaluator<'p>,
    pub(super) derivatives: &'a Derivatives,
    pub(super) multipliers: &'a [Lanes],
    pub(super) out: &'a mut [f64],
}

impl Task for Pull<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            own,
            derivatives,
            multipliers,
            out,
        } = self;
        let (program, layout) = (own.program, &own.layout);
        let (n, m, p) = (program.n(), program.m(), program.p());
        let size = n + m + p;
        let entries = &program.model.entries;
        let mut sums = vec![[0.0; LANES]; 3 * size];
        for (group, h) in own.lengths.iter().enumerate() {
            let c = &multipliers[2 * n * group..2 * n * (group + 1)];
            let (eighth, sixth) = (scaled(1.0 / 8.0, *h), scaled(1.0 / 6.0, *h));
            sums.fill([0.0; LANES]);
            for (e, &(row, q)) in entries.iter().enumerate().filter(|(_, at)| at.0 < n) {
                let values = [
                    derivatives.entries[(layout.sets[0] + group) * entries.len() + e],
                    derivatives.entries[(layout.sets[1] + group) * entries.len() + e],
                    layout.at_end(&derivatives.entries, entries.len(), group, e),
                ];
                let (first, second) = (times(eighth, c[row]), times(sixth, c[n + row]));
                let weights: [Lanes; 3] = [
                    std::array::from_fn(|l| -first[l] - second[l]),
                    scaled(-4.0, second),
                    std::array::from_fn(|l| first[l] - second[l]),
                ];
                for (at, (value, weight)) in values.into_iter().zip(weights).enumerate() {
                    sums[at * size + q] = plus(sums[at * size + q], value, weight);
                }
            }
            let count = LANES.min(layout.intervals - LANES * group);
            for lane in 0..count {
                let k = LANES * group + lane;
                let (a, b, middle) = (program.node(k), program.node(k + 1), program.middle(k));
                for i in 0..n {
                    let (first, second) = (c[i][lane], c[n + i][lane]);
                    out[a + i] += sums[i][lane] - 0.5 * first - second;
                    out[middle + i] += sums[size + i][lane] + first;
                    out[b + i] += sums[2 * size + i][lane] + second - 0.5 * first;
                }
                for at in 0..3 {
                    for i in 0..m {
                        let (first, second) = program.weights(i, at);
                        let value = sums[at * size + n + i][lane];
                        out[a + n + i] += first * value;
                        out[b + n + i] += second * value;
                    }
                    for i in 0..p {
                        out[program.theta() + i] += sums[at * size + n + m + i][lane];
                    }
                }
            }
        }
    }
}

/// Adds `Jᵀ λ` of the defects to `out`, with the multipliers of each group.
pub(crate) fn add_pulled(
    own: &Evaluator<'_>,
    derivatives: &Derivatives,
    multipliers: &[Lanes],
    out: &mut [f64],
) {
    simd::vectorised(Pull {
        own,
        derivatives,
        multipliers,
        out,
    });
}
