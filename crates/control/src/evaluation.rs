//! The functions of a program and their derivatives at a point, several intervals at once.
//!
//! Points stand in sets: starts of the intervals, midpoints, ends; member `k` of each belongs to interval `k`. Without jumps
//! an end is the start of the next interval, and the first set has the last node too. A group of [`LANES`] consecutive
//! members is evaluated at once. Two groups follow: the start, and the end.

use crate::program::{Place, Program, Shape};
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd::{self, LANES, Lanes, Task, plus, scaled, times};

/// Where the points stand.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// First group of each set, and the number of groups of all.
    pub sets: [usize; 3],
    pub groups: usize,
    /// Whether an end is the start of the next interval.
    pub is_shared: bool,
    pub intervals: usize,
}

impl Layout {
    fn new(program: &Program) -> Self {
        let intervals = program.intervals();
        let is_shared = program
            .controls
            .iter()
            .all(|own| own.shape == Shape::Linear);
        let all = intervals.div_ceil(LANES);
        let first = if is_shared {
            (intervals + 1).div_ceil(LANES)
        } else {
            all
        };
        let sets = match is_shared {
            true => [0, first, 0],
            false => [0, first, first + all],
        };
        Self {
            sets,
            groups: first + all + if is_shared { 0 } else { all },
            is_shared,
            intervals,
        }
    }

    /// Group and lane of a point (0 start, 1 middle, 2 end) of an interval.
    pub fn point(&self, k: usize, at: usize) -> (usize, usize) {
        let (set, member) = match at {
            2 if self.is_shared => (0, k + 1),
            at => (at, k),
        };
        (self.sets[set] + member / LANES, member % LANES)
    }

    /// Value `i` of `width` at the ends of a group of intervals.
    #[inline(always)]
    pub fn at_end(&self, values: &[Lanes], width: usize, group: usize, i: usize) -> Lanes {
        if !self.is_shared {
            return values[(self.sets[2] + group) * width + i];
        }
        let own = values[group * width + i];
        let next = if LANES * (group + 1) <= self.intervals {
            values[(group + 1) * width + i][0]
        } else {
            own[LANES - 1]
        };
        std::array::from_fn(|lane| {
            if lane + 1 < LANES {
                own[lane + 1]
            } else {
                next
            }
        })
    }
}

/// Values at a point, interval after interval in groups.
#[derive(Debug, Clone, Default)]
pub(crate) struct Values {
    /// The objective, with the weighted steps of the controls, and these alone.
    pub f: f64,
    pub steps: f64,
    /// Defects of each group: of midpoints, then of ends.
    pub c: Vec<Lanes>,
    /// Scaled rates, and all outputs: of the path, the start and the end.
    rates: Vec<Lanes>,
    pub outputs: Vec<Lanes>,
}

/// Derivatives at a point: entries of the Jacobian of the rates, gradients of all outputs, second derivatives.
#[derive(Debug, Clone, Default)]
pub(crate) struct Derivatives {
    pub entries: Vec<Lanes>,
    pub gradients: Vec<Lanes>,
    pub pairs: Vec<Lanes>,
}

/// Weights of rates and outputs in the Lagrangian.
#[derive(Debug, Clone, Default)]
pub(crate) struct Weights {
    rates: Vec<Lanes>,
    pub outputs: Vec<Lanes>,
}

/// Evaluates a program; allocated once for a mesh.
#[derive(Debug)]
pub(crate) struct Evaluator<'p> {
    program: &'p Program,
    pub layout: Layout,
    /// Lengths of the intervals, in groups; the last is repeated.
    pub lengths: Vec<Lanes>,
    /// `[x u]` of all points; their inputs and times.
    x: Vec<f64>,
    given: Vec<f64>,
}

impl<'p> Evaluator<'p> {
    pub fn new(program: &'p Program) -> Self {
        let (n, m) = (program.n(), program.m());
        let layout = Layout::new(program);
        let points = LANES * (layout.groups + 2);
        let mut given = vec![0.0; points * (m + 1)];
        for k in 0..layout.intervals {
            for at in 0..3 {
                let (group, lane) = layout.point(k, at);
                let [a, b] = [program.mesh[k], program.mesh[k + 1]];
                given[(LANES * group + lane) * (m + 1) + m] = [a, 0.5 * (a + b), b][at];
            }
        }
        given[(points - LANES) * (m + 1)..].fill(0.0);
        for lane in 0..LANES {
            given[(points - LANES + lane) * (m + 1) + m] = 1.0;
        }
        let lengths = (0..layout.intervals.div_ceil(LANES))
            .map(|g| {
                let (members, _) = simd::group(LANES * g, LANES, layout.intervals);
                members.map(|k| program.h(k))
            })
            .collect();
        Self {
            x: vec![0.0; points * (n + m)],
            given,
            lengths,
            layout,
            program,
        }
    }

    /// Groups of all points, with their model, and the groups' first outputs and gradients.
    fn models(&self) -> [(&'p NodeModel, std::ops::Range<usize>); 3] {
        let all = self.layout.groups;
        [
            (&self.program.model, 0..all),
            (&self.program.start, all..all + 1),
            (&self.program.end, all + 1..all + 2),
        ]
    }

    /// Index of an output among all, in lanes.
    pub fn output(&self, place: Place) -> Option<usize> {
        let [path, start, _] = self.models().map(|(model, _)| model.n_outputs());
        let before = self.layout.groups * path;
        match place {
            Place::Path { point, output } => {
                let (group, lane) = self.layout.point(point / 3, point % 3);
                Some((group * path + output) * LANES + lane)
            }
            Place::Start(k) => Some((before + k) * LANES),
            Place::End(k) => Some((before + start + k) * LANES),
            Place::Control { .. } | Place::Rate { .. } | Place::Parameter(_) => None,
        }
    }

    /// Columns of an output's gradient, and the index of its first value among all gradients, in lanes.
    pub fn gradient(&self, place: Place) -> Option<(&'p [usize], usize)> {
        let widths = self.models().map(|(model, _)| width(model));
        let before = self.layout.groups * widths[0];
        let of = |model: &'p NodeModel, k: usize, first: usize, lane: usize| {
            let own: usize = (0..k).map(|k| model.columns(k).len()).sum();
            (model.columns(k), (first + own) * LANES + lane)
        };
        match place {
            Place::Path { point, output } => {
                let (group, lane) = self.layout.point(point / 3, point % 3);
                Some(of(&self.program.model, output, group * widths[0], lane))
            }
            Place::Start(k) => Some(of(&self.program.start, k, before, 0)),
            Place::End(k) => Some(of(&self.program.end, k, before + widths[1], 0)),
            Place::Control { .. } | Place::Rate { .. } | Place::Parameter(_) => None,
        }
    }

    /// First second derivative of the start and of the end.
    pub fn end_pairs(&self) -> [usize; 2] {
        let first = self.layout.groups * self.program.model.pairs.len();
        [first, first + self.program.start.pairs.len()]
    }

    fn set(&mut self, z: &[f64]) {
        let program = self.program;
        let (n, m) = (program.n(), program.m());
        let size = n + m;
        let layout = &self.layout;
        let x = &mut self.x;
        let place = |(group, lane): (usize, usize)| (LANES * group + lane) * size;
        for k in 0..layout.intervals {
            let (a, b, middle) = (program.node(k), program.node(k + 1), program.middle(k));
            // A shared end is written as the start of the next interval.
            let points = if layout.is_shared && k + 1 < layout.intervals {
                2
            } else {
                3
            };
            for (at, first) in [a, middle, b].into_iter().enumerate().take(points) {
                let own = &mut x[place(layout.point(k, at))..][..size];
                for (own, z) in own.iter_mut().zip(&z[first..first + n]) {
                    *own = *z;
                }
                for (c, own) in own[n..].iter_mut().enumerate() {
                    let (first, second) = program.weights(c, at);
                    *own = first * z[a + n + c] + second * z[b + n + c];
                }
            }
        }
        // Lanes without a point repeat the last.
        for at in 0..if layout.is_shared { 2 } else { 3 } {
            let last = match at {
                0 if layout.is_shared => layout.point(layout.intervals - 1, 2),
                at => layout.point(layout.intervals - 1, at),
            };
            for lane in last.1 + 1..LANES {
                let from = place(last);
                x.copy_within(from..from + size, place((last.0, lane)));
            }
        }
        for (group, node) in [
            (layout.groups, 0),
            (layout.groups + 1, program.node(layout.intervals)),
        ] {
            for lane in 0..LANES {
                x[place((group, lane))..][..size].copy_from_slice(&z[node..node + size]);
            }
        }
    }

    #[inline(always)]
    fn points(&self, group: usize) -> [[&[f64]; LANES]; 2] {
        let (size, m) = (self.program.n() + self.program.m(), self.program.m());
        let members: [usize; LANES] = std::array::from_fn(|lane| LANES * group + lane);
        [
            members.map(|i| &self.x[i * size..(i + 1) * size]),
            members.map(|i| &self.given[i * (m + 1)..(i + 1) * (m + 1)]),
        ]
    }

    /// Values at `z`.
    pub fn values(&mut self, z: &[f64], out: &mut Values) {
        self.set(z);
        let size = self.program.n() + self.program.m();
        let count = |own: &(&NodeModel, std::ops::Range<usize>)| own.1.len() * own.0.n_outputs();
        let all = self.models().iter().map(count).sum();
        out.outputs.resize(all, [0.0; LANES]);
        out.rates
            .resize((self.layout.groups + 2) * size, [0.0; LANES]);
        let count = self.lengths.len() * 2 * self.program.n();
        out.c.resize(count, [0.0; LANES]);
        simd::vectorised(Evaluate { own: self, z, out });
    }

    /// Derivatives at the point that was evaluated last, with these weights.
    pub fn derivatives(&self, z: &[f64], weights: &Weights, out: &mut Derivatives) {
        let all = self.layout.groups;
        let entries = self.program.model.entries.len();
        out.entries.resize(all * entries, [0.0; LANES]);
        let count = |of: &dyn Fn(&NodeModel) -> usize| -> usize {
            let own = self.models();
            own.iter()
                .map(|(model, groups)| groups.len() * of(model))
                .sum()
        };
        out.gradients.resize(count(&width), [0.0; LANES]);
        out.pairs
            .resize(count(&|model| model.pairs.len()), [0.0; LANES]);
        simd::vectorised(Differentiate {
            own: self,
            z,
            weights,
            out,
        });
    }

    /// Weights of the Lagrangian, from multipliers of the defects; those of the outputs are 0.
    pub fn weigh(&self, c: &[Lanes], out: &mut Weights) {
        let (n, layout) = (self.program.n(), &self.layout);
        let size = n + self.program.m();
        out.rates.resize(layout.groups * size, [0.0; LANES]);
        out.rates.fill([0.0; LANES]);
        let [path, start, end] = self.models().map(|(model, _)| model.n_outputs());
        let all = layout.groups * path + start + end;
        out.outputs.resize(all, [0.0; LANES]);
        out.outputs.fill([0.0; LANES]);
        let flat = out.rates.as_flattened_mut();
        for k in 0..layout.intervals {
            let (group, lane) = (k / LANES, k % LANES);
            let h = self.program.h(k);
            let places = [0, 1, 2].map(|at| layout.point(k, at));
            for i in 0..n {
                let own = 2 * n * group + i;
                let (first, second) = (h / 8.0 * c[own][lane], h / 6.0 * c[own + n][lane]);
                let weights = [-first - second, -4.0 * second, first - second];
                for ((group, lane), weight) in places.into_iter().zip(weights) {
                    flat[(group * size + i) * LANES + lane] += weight;
                }
            }
        }
    }
}

/// Number of gradient values of a model.
fn width(model: &NodeModel) -> usize {
    (0..model.n_outputs()).map(|k| model.columns(k).len()).sum()
}

/// Values of variables of a group of intervals: `first` of each.
#[inline(always)]
pub(crate) fn gathered(z: &[f64], first: [usize; LANES]) -> Lanes {
    first.map(|first| z[first])
}

struct Evaluate<'a, 'p> {
    own: &'a Evaluator<'p>,
    z: &'a [f64],
    out: &'a mut Values,
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
                for lane in count..LANES {
                    (c[i][lane], c[n + i][lane]) = (0.0, 0.0);
                }
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

struct Differentiate<'a, 'p> {
    own: &'a Evaluator<'p>,
    z: &'a [f64],
    weights: &'a Weights,
    out: &'a mut Derivatives,
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

struct Pull<'a, 'p> {
    own: &'a Evaluator<'p>,
    derivatives: &'a Derivatives,
    multipliers: &'a [Lanes],
    out: &'a mut [f64],
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
