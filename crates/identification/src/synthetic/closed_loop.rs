//! Human and vehicle, step by step.

use super::{Human, clip};
use pilotage_models::{Quadcopter, quadcopter::N_STATES};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// States of human and vehicle: `[x_v, s, ṡ]`.
const N: usize = N_STATES + 2;

/// Human and vehicle in closed loop, integrated by the classical Runge–Kutta method with a fixed step.
pub struct Loop<'a> {
    human: &'a Human,
    vehicle: &'a Quadcopter,
    target: f64,
    step: f64,
    /// `[x_v, s, ṡ]`.
    pub state: [f64; N],
    /// Error [m] and its rate [m/s] at every step so far.
    seen: Vec<(f64, f64)>,
    /// Remnant [stick].
    remnant: f64,
}

impl<'a> Loop<'a> {
    /// At rest at position 0, the target just appearing.
    pub fn new(human: &'a Human, vehicle: &'a Quadcopter, target: f64, step: f64) -> Self {
        Self {
            human,
            vehicle,
            target,
            step,
            state: [0.0; N],
            seen: vec![(target, 0.0)],
            remnant: 0.04,
        }
    }

    /// Advances by one step; the remnant is held over it.
    pub fn advance(&mut self, random: &mut ChaCha8Rng) {
        let h = self.step;
        let k1 = self.derivative(&self.state, 0.0);
        let k2 = self.derivative(&along(&self.state, &k1, h / 2.0), 0.5);
        let k3 = self.derivative(&along(&self.state, &k2, h / 2.0), 0.5);
        let k4 = self.derivative(&along(&self.state, &k3, h), 1.0);
        for i in 0..N {
            self.state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        self.seen
            .push((self.target - self.state[0], -self.state[2]));
        self.remnant = self.next_remnant(random);
    }

    /// The remnant one step on: exact discretisation of an Ornstein–Uhlenbeck process.
    fn next_remnant(&self, random: &mut ChaCha8Rng) -> f64 {
        let deviation = self.human.remnant * self.human.gain * self.target.abs();
        let decay = (-self.step / self.human.remnant_time).exp();
        let deviate: f64 = StandardNormal.sample(random);
        decay * self.remnant + deviation * (1.0 - decay * decay).sqrt() * deviate
    }

    /// Error and rate as seen at `fraction` of the present step, a delay ago; nothing before the target
    /// appears. Between steps it is interpolated linearly.
    fn seen(&self, fraction: f64) -> (f64, f64) {
        let now = (self.seen.len() - 1) as f64 + fraction;
        let at = now - self.human.delay / self.step;
        if at < 0.0 {
            return (0.0, 0.0);
        }
        let (k, part) = (at.floor() as usize, at.fract());
        let (a, b) = (self.seen[k], self.seen[(k + 1).min(self.seen.len() - 1)]);
        (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1))
    }

    fn derivative(&self, x: &[f64; N], fraction: f64) -> [f64; N] {
        let human = self.human;
        let (error, rate) = self.seen(fraction);
        let command = -human.gain * (error + human.lead * rate) + self.remnant;
        let (arm, arm_rate) = (x[N_STATES], x[N_STATES + 1]);
        let mut dx = [0.0; N];
        self.vehicle
            .derivative(&x[..N_STATES], clip(arm), &mut dx[..N_STATES]);
        dx[N_STATES] = arm_rate;
        dx[N_STATES + 1] =
            human.frequency * (human.frequency * (command - arm) - 2.0 * human.damping * arm_rate);
        dx
    }
}

/// `x + h dx`.
fn along(x: &[f64; N], dx: &[f64; N], h: f64) -> [f64; N] {
    std::array::from_fn(|i| x[i] + h * dx[i])
}
