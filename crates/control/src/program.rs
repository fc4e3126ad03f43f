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

use crate::evaluation::{self, Evaluator};
use crate::rows::Jacobian;
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd::{LANES, Lanes};

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
    /// Defects: of midpoint and end of each interval.
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

    /// Everything at `z`, by the functions of the solver.
    pub fn values(&self, z: &[f64]) -> Values {
        let rows = self.rows();
        let mut evaluator = Evaluator::new(self);
        let mut found = evaluation::Values::default();
        evaluator.values(z, &mut found);
        let outputs = found.outputs.as_flattened();
        let of = |rows: &[Row]| -> Vec<f64> {
            let all = Jacobian::new(&evaluator, self, rows);
            (0..rows.len()).map(|r| all.value(r, outputs, z)).collect()
        };
        let e = of(&rows.1).into_iter().zip(&rows.1);
        Values {
            f: found.f,
            c: self.in_order(&found.c),
            e: e.map(|(value, row)| value - row.lower).collect(),
            g: of(&rows.0),
        }
    }

    /// What belongs to the defects, interval after interval.
    pub(crate) fn in_order(&self, groups: &[Lanes]) -> Vec<f64> {
        let count = 2 * self.n();
        let of = |k: usize| {
            let own = &groups[k / LANES * count..][..count];
            own.iter().map(move |own| own[k % LANES])
        };
        (0..self.intervals()).flat_map(of).collect()
    }
}
