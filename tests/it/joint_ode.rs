//! Pilot and quadcopter as one system of differential equations, solved by an implicit method to many digits:
//! what every co-simulation of the two is measured by.

use pilotage::integrate::{Dynamics as _, Method, Options, Solver};
use pilotage::models::{Dynamics, Joint, Pilot, Quadcopter};
use std::convert::Infallible;

/// A pilot and his target [m].
pub struct Loop {
    pub theta: [f64; 6],
    pub target: f64,
}

/// Position and stick, each with its slope.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub z: [f64; 2],
    pub stick: [f64; 2],
}

fn joint() -> Joint {
    Joint {
        vehicle: Quadcopter::default(),
        pilot: Pilot::default(),
    }
}

impl pilotage::integrate::Dynamics for Loop {
    type Error = Infallible;

    fn derivatives(&mut self, _t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        joint().derivative(x, &[self.target], &self.theta, dx);
        Ok(true)
    }

    fn indicators(&mut self, _t: f64, _x: &[f64], _z: &mut [f64]) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl Loop {
    /// From rest: at 0 and after each `h` [s] until `stop`.
    pub fn solve(mut self, h: f64, stop: f64) -> Vec<Point> {
        let n = joint().n_states();
        let options = Options {
            relative: 1e-11,
            absolute: vec![1e-13; n],
            method: Method::Radau,
            longest_step: f64::INFINITY,
        };
        let mut solver = Solver::new(0, options);
        solver.restart(0.0, &vec![0.0; n], true);
        let mut points = vec![self.point(&vec![0.0; n])];
        for k in 1..=(stop / h).round() as u32 {
            let end = f64::from(k) * h;
            while solver.time() < end {
                solver.advance(&mut self, end).unwrap();
            }
            points.push(self.point(solver.state()));
        }
        points
    }

    /// Both outputs are linear in the states, so that their slopes are the outputs of the derivatives.
    fn point(&mut self, x: &[f64]) -> Point {
        let (joint, w, theta) = (joint(), [self.target], self.theta);
        let mut dx = vec![0.0; x.len()];
        self.derivatives(0.0, x, &mut dx).unwrap();
        Point {
            z: [x, &dx].map(|x| joint.measured(x, &w, &theta)),
            stick: [x, &dx].map(|x| joint.bounded(x, &w, &theta)),
        }
    }
}
