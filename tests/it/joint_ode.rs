//! Pilot and quadcopter as one system of differential equations, solved by an implicit method to many digits:
//! what every co-simulation of the two is measured by.

use pilotage::models::quadcopter::N_STATES;
use pilotage::models::{Pilot, Quadcopter, Scalar};
use pilotage::ode::{Method, Solver, SolverOptions, System};
use std::convert::Infallible;

/// A pilot and a vehicle.
#[derive(Debug, Clone, Copy)]
pub struct Joint {
    pub vehicle: Quadcopter,
    pub pilot: Pilot,
}

impl Joint {
    pub fn n_states(&self) -> usize {
        N_STATES + self.pilot.order
    }

    /// The joint equations as the paper writes them (its eq. 3), put together by hand.
    pub fn derivative<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T], dx: &mut [T]) {
        let (x_v, x_p) = x.split_at(N_STATES);
        let (dx_v, dx_p) = dx.split_at_mut(N_STATES);
        let error = w[0] - self.vehicle.output(x_v);
        self.vehicle
            .derivative(x_v, self.pilot.output(x_p, theta), dx_v);
        self.pilot.derivative(x_p, error, theta, dx_p);
    }

    pub fn measured(&self, x: &[f64]) -> f64 {
        self.vehicle.output(x)
    }

    pub fn bounded(&self, x: &[f64], theta: &[f64]) -> f64 {
        self.pilot.output(&x[N_STATES..], theta)
    }
}

/// A pilot of any order, how far his stick goes, and his target [m].
pub struct Loop {
    pub theta: Vec<f64>,
    pub limit: f64,
    pub target: f64,
}

/// Position and stick, each with its slope.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub z: [f64; 2],
    pub stick: [f64; 2],
}

/// The states of vehicle and pilot, then the integrals of position and stick.
impl System for Loop {
    type Error = Infallible;

    fn derivatives(&mut self, _t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        let (joint, n) = (self.joint(), self.n_states());
        let (states, w) = (&x[..n], [self.target]);
        let stick = joint.bounded(states, &self.theta);
        let limited = stick.clamp(-self.limit, self.limit);
        joint.derivative(states, &w, &self.theta, &mut dx[..n]);
        if limited != stick {
            let vehicle = n - joint.pilot.order;
            (joint.vehicle).derivative(&states[..vehicle], limited, &mut dx[..vehicle]);
        }
        dx[n] = joint.measured(states);
        dx[n + 1] = limited;
        Ok(true)
    }
}

impl Loop {
    fn joint(&self) -> Joint {
        Joint {
            vehicle: Quadcopter::default(),
            pilot: Pilot {
                order: self.theta.len() / 2,
            },
        }
    }

    fn n_states(&self) -> usize {
        self.joint().n_states()
    }

    /// From rest: at 0 and after each `h` [s] until `stop`.
    pub fn solve(mut self, h: f64, stop: f64) -> Vec<Point> {
        let start = vec![0.0; self.n_states() + 2];
        let mut solver = self.solver(&start);
        let mut points = vec![self.point(&start)];
        for k in 1..=(stop / h).round() as u32 {
            let end = f64::from(k) * h;
            while solver.time() < end {
                solver.advance(&mut self, end).unwrap();
            }
            points.push(self.point(solver.state()));
        }
        points
    }

    /// Means of position and stick over the next `h` [s] from these states of the vehicle and the pilot.
    pub fn means(&mut self, states: &[f64], h: f64) -> [f64; 2] {
        let n = self.n_states();
        let start = [states, &[0.0; 2]].concat();
        let mut solver = self.solver(&start);
        while solver.time() < h {
            solver.advance(self, h).unwrap();
        }
        [n, n + 1].map(|i| solver.state()[i] / h)
    }

    /// At time 0. The pilot's states are as small as its poles are fast.
    fn solver(&self, start: &[f64]) -> Solver {
        let order = self.theta.len() / 2;
        let pole = self.theta[0].powf(1.0 / order as f64).max(1.0);
        let mut absolute = vec![1e-13; start.len()];
        for i in 0..order {
            absolute[self.n_states() - 1 - i] /= pole.powi(i as i32 + 1);
        }
        let options = SolverOptions {
            relative: 1e-11,
            absolute,
            method: Method::Radau,
            longest_step: f64::INFINITY,
        };
        let mut solver = Solver::new(0, options);
        solver.restart(0.0, start, true);
        solver
    }

    /// Both outputs, the stick without its limit, are linear in the states, so that their slopes are the outputs of the
    /// derivatives.
    fn point(&mut self, x: &[f64]) -> Point {
        let mut dx = vec![0.0; x.len()];
        self.derivatives(0.0, x, &mut dx).unwrap();
        let (joint, n) = (self.joint(), self.n_states());
        Point {
            z: [x, &dx].map(|x| joint.measured(&x[..n])),
            stick: [x, &dx].map(|x| joint.bounded(&x[..n], &self.theta)),
        }
    }
}
