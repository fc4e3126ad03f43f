//! The functions of a program and their derivatives at a point, several intervals at once.
//!
//! Points stand in sets: starts of the intervals, midpoints, ends; member `k` of each belongs to interval `k`. Without jumps
//! an end is the start of the next interval, and the first set has the last node too. A group of [`LANES`] consecutive
//! members is evaluated at once. Two groups follow: the start, and the end.

mod tasks;

use crate::program::Place;
use crate::program::Program;
use crate::program::Shape;
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd;
use pilotage_collocation::simd::LANES;
use pilotage_collocation::simd::Lanes;
use tasks::Differentiate;
use tasks::Evaluate;
pub(crate) use tasks::add_pulled;

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
