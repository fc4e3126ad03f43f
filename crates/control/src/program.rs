//! The nonlinear program of an optimal control problem: Hermite–Simpson collocation with the midpoints as unknowns (Betts,
//! *Practical Methods for Optimal Control and Estimation Using Nonlinear Programming*, 2nd ed. 2010, section 4.5.4).
//!
//! Time is τ from 0 to 1; the equations are multiplied by the duration, which is a number or one of the parameters θ. In
//! the equations the controls u are states whose rates are inputs, so that the same tapes serve the program, where only the
//! rates of the first states matter, and its simulation.
//!
//! ```text
//! z = [x₀ u₀ | x̄₀ | x₁ u₁ | x̄₁ | ... | x_N u_N | θ]           x̄: midpoints
//! c = x̄ - (x₀ + x₁)/2 - h/8 (f₀ - f₁),   x₁ - x₀ - h/6 (f₀ + 4 f̄ + f₁)       of each interval
//! ```

use crate::evaluation::{Points, values_at};
use pilotage_collocation::node::NodeModel;

/// How a control goes from node to node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Linear, without jumps.
    Linear,
    /// Constant in each interval, with jumps.
    Constant,
}

/// A control, in scaled variables.
#[derive(Debug, Clone)]
pub struct Control {
    /// Between nodes.
    pub shape: Shape,
    /// Limits at the nodes.
    pub limits: (f64, f64),
    /// Largest magnitude of its rate, in scaled units per second; infinite if there is none.
    pub rate: f64,
    /// Value at the start, if it is known.
    pub first: Option<f64>,
}

/// The duration \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Duration {
    /// Known.
    Number(f64),
    /// The parameter of this index.
    Sought(usize),
}

/// By how much limits are relaxed, relative to them (IPOPT's `bound_relax_factor`).
const ROOM: f64 = 1e-8;

/// Limits of an output.
pub type Limits = (f64, f64);

/// A program. Its variables, limits and initial states are scaled.
#[derive(Debug, Clone)]
pub struct Program {
    /// `[x; u]` as states, the controls' slopes as inputs; the outputs are bounded along the path. Time is τ.
    pub model: NodeModel,
    /// What is bounded at the start, over `[x; u]` and θ.
    pub start: NodeModel,
    /// The objective, then what is bounded at the end.
    pub end: NodeModel,
    /// Limits of the outputs of `model`, of `start`, and of those of `end` after the objective.
    pub limits: [Vec<Limits>; 3],
    /// The controls, which are the last states.
    pub controls: Vec<Control>,
    /// Known initial states.
    pub initial: Vec<Option<f64>>,
    /// Limits of the parameters.
    pub parameters: Vec<Limits>,
    /// The duration.
    pub duration: Duration,
    /// Weight of the squared steps of the scaled controls.
    pub regularise: f64,
    /// Nodes in τ, from 0 to 1.
    pub mesh: Vec<f64>,
}

/// Where a limit holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// An output at a point: three of each interval.
    Path {
        /// The point.
        point: usize,
        /// The output.
        output: usize,
    },
    /// A control at a node.
    Control {
        /// The node.
        node: usize,
        /// The control.
        control: usize,
    },
    /// The change of a control in an interval, minus (or plus, for a fall) what its rate allows.
    Rate {
        /// The interval.
        interval: usize,
        /// The control.
        control: usize,
        /// Whether it is the fall that is limited.
        falls: bool,
    },
    /// A parameter.
    Parameter(usize),
    /// An output at the start.
    Start(usize),
    /// An output at the end; the first is the objective.
    End(usize),
}

/// A limited quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Where.
    pub place: Place,
    /// Lower limit; equal to the upper one in an equation.
    pub lower: f64,
    /// Upper limit.
    pub upper: f64,
}

/// Values of a program at a point.
#[derive(Debug, Clone, Default)]
pub struct Values {
    /// The objective, with the weighted steps of the controls.
    pub f: f64,
    /// These alone.
    pub steps: f64,
    /// Defects.
    pub c: Vec<f64>,
    /// Equations at the ends.
    pub e: Vec<f64>,
    /// Limited quantities.
    pub g: Vec<f64>,
}

impl Program {
    /// Number of states.
    pub fn n(&self) -> usize {
        self.initial.len()
    }

    /// Number of controls.
    pub fn m(&self) -> usize {
        self.controls.len()
    }

    /// Number of parameters.
    pub fn p(&self) -> usize {
        self.parameters.len()
    }

    /// Number of intervals.
    pub fn intervals(&self) -> usize {
        self.mesh.len() - 1
    }

    /// First variable of a node.
    pub fn node(&self, k: usize) -> usize {
        k * (2 * self.n() + self.m())
    }

    /// First variable of a midpoint.
    pub fn middle(&self, k: usize) -> usize {
        self.node(k) + self.n() + self.m()
    }

    /// First parameter.
    pub fn theta(&self) -> usize {
        self.node(self.intervals()) + self.n() + self.m()
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        self.theta() + self.p()
    }

    /// Length of an interval in τ.
    pub fn h(&self, k: usize) -> f64 {
        self.mesh[k + 1] - self.mesh[k]
    }

    /// The duration, as a factor of the scaled parameter and a number.
    fn seconds(&self, z: &[f64]) -> f64 {
        match self.duration {
            Duration::Number(seconds) => seconds,
            Duration::Sought(k) => z[self.theta() + k] * self.model.scales.parameters[k],
        }
    }

    /// The limits that are inequalities, and the equations at the ends.
    pub fn rows(&self) -> (Vec<Row>, Vec<Row>) {
        let mut all = Vec::new();
        let mut add = |place: Place, (lower, upper): Limits| {
            // A range with nothing inside, as of a state that begins at its limit, would leave no room for a slack.
            let slack = |limit: f64| {
                if lower < upper {
                    ROOM * limit.abs().max(1.0)
                } else {
                    0.0
                }
            };
            all.push(Row {
                place,
                lower: lower - slack(lower),
                upper: upper + slack(upper),
            });
        };
        let last = 3 * self.intervals() - 1;
        for point in (0..=last).filter(|point| point % 3 < 2 || *point == last) {
            for (output, limits) in self.limits[0].iter().enumerate() {
                add(Place::Path { point, output }, *limits);
            }
        }
        for (control, own) in self.controls.iter().enumerate() {
            let from = match own.shape {
                Shape::Linear => usize::from(own.first.is_some()),
                Shape::Constant => 1,
            };
            for node in from..=self.intervals() {
                add(Place::Control { node, control }, own.limits);
            }
            let free = own.first.is_none() && own.shape == Shape::Constant;
            let from = if own.rate.is_finite() {
                usize::from(free)
            } else {
                usize::MAX
            };
            for interval in from..self.intervals() {
                for falls in [false, true] {
                    let limits = match falls {
                        false => (f64::NEG_INFINITY, 0.0),
                        true => (0.0, f64::INFINITY),
                    };
                    let place = Place::Rate {
                        interval,
                        control,
                        falls,
                    };
                    add(place, limits);
                }
            }
        }
        for (k, limits) in self.parameters.iter().enumerate() {
            add(Place::Parameter(k), *limits);
        }
        for (k, limits) in self.limits[1].iter().enumerate() {
            add(Place::Start(k), *limits);
        }
        for (k, limits) in self.limits[2].iter().enumerate() {
            add(Place::End(k + 1), *limits);
        }
        all.retain(|row| row.lower.is_finite() || row.upper.is_finite());
        all.into_iter().partition(|row| row.lower < row.upper)
    }

    /// How much of the rate limit an interval has: the limited quantity is `u₁ - u₀ ∓ allowance · duration`.
    pub(crate) fn allowance(&self, interval: usize, control: usize, falls: bool) -> f64 {
        let size = self.controls[control].rate * self.h(interval);
        if falls { -size } else { size }
    }

    /// Control values at a point of an interval (0 start, 1 middle, 2 end): weights of the values at its two nodes.
    pub(crate) fn weights(&self, control: usize, at: usize) -> (f64, f64) {
        match (self.controls[control].shape, at) {
            (Shape::Linear, 0) => (1.0, 0.0),
            (Shape::Linear, 1) => (0.5, 0.5),
            _ => (0.0, 1.0),
        }
    }

    /// The points of all intervals.
    pub(crate) fn points(&self, z: &[f64]) -> Points {
        let (n, m) = (self.n(), self.m());
        let mut points = Points::new(n + m, m);
        for k in 0..self.intervals() {
            let (a, b) = (self.node(k), self.node(k + 1));
            let middle = 0.5 * (self.mesh[k] + self.mesh[k + 1]);
            let of = [
                (a, self.mesh[k]),
                (self.middle(k), middle),
                (b, self.mesh[k + 1]),
            ];
            for (at, (x, time)) in of.into_iter().enumerate() {
                let control = |c: usize| {
                    let (first, second) = self.weights(c, at);
                    first * z[a + n + c] + second * z[b + n + c]
                };
                points.push(&z[x..x + n], (0..m).map(control), time);
            }
        }
        points
    }

    /// The end (or the start) as a point.
    pub(crate) fn end_point(&self, z: &[f64], is_end: bool) -> Points {
        let (n, m) = (self.n(), self.m());
        let (node, time) = if is_end {
            (self.intervals(), 1.0)
        } else {
            (0, 0.0)
        };
        let mut points = Points::new(n + m, m);
        let x = &z[self.node(node)..][..n + m];
        points.push(&x[..n], x[n..].iter().copied(), time);
        points
    }

    /// Evaluates everything at `z`.
    pub fn evaluate(&self, z: &[f64], rows: &(Vec<Row>, Vec<Row>), out: &mut Values) {
        let (n, m, outputs) = (self.n(), self.m(), self.limits[0].len());
        let theta = &z[self.theta()..];
        let (f, path) = values_at(&self.model, theta, &self.points(z));
        let (_, start) = values_at(&self.start, theta, &self.end_point(z, false));
        let (_, end) = values_at(&self.end, theta, &self.end_point(z, true));
        (out.f, out.steps) = (end[0], 0.0);
        out.c.clear();
        for k in 0..self.intervals() {
            let (a, b, middle, h) = (self.node(k), self.node(k + 1), self.middle(k), self.h(k));
            let rate = |at: usize, i: usize| f[(3 * k + at) * (n + m) + i];
            let first = |i: usize| {
                z[middle + i] - 0.5 * (z[a + i] + z[b + i]) - h / 8.0 * (rate(0, i) - rate(2, i))
            };
            let second = |i: usize| {
                let sum = rate(0, i) + 4.0 * rate(1, i) + rate(2, i);
                z[b + i] - z[a + i] - h / 6.0 * sum
            };
            out.c.extend((0..n).map(first));
            out.c.extend((0..n).map(second));
            let steps = (0..m).map(|c| z[b + n + c] - z[a + n + c]);
            out.steps += self.regularise * steps.map(|step| step * step).sum::<f64>();
        }
        out.f += out.steps;
        let seconds = self.seconds(z);
        let value = |row: &Row| match row.place {
            Place::Path { point, output } => path[point * outputs + output],
            Place::Control { node, control } => z[self.node(node) + n + control],
            Place::Rate {
                interval,
                control,
                falls,
            } => {
                let [a, b] = [interval, interval + 1].map(|k| z[self.node(k) + n + control]);
                b - a - self.allowance(interval, control, falls) * seconds
            }
            Place::Parameter(k) => theta[k],
            Place::Start(k) => start[k],
            Place::End(k) => end[k],
        };
        out.g.clear();
        out.g.extend(rows.0.iter().map(value));
        out.e.clear();
        out.e
            .extend(rows.1.iter().map(|row| value(row) - row.lower));
    }
}
