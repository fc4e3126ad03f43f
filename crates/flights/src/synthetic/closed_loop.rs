//! Step-by-step simulation of human and vehicle.

use super::{Hands, Human, Signal, Vehicle};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Number of states of a hand: command after its lag, arm, arm's rate.
const PER_HAND: usize = 3;

/// Remnant at the moment when a constant target appears [stick]. The shipped flights were generated with it.
const STARTLE: f64 = 0.04;

/// Human and vehicle in closed loop, integrated by the classical Runge–Kutta method with a fixed step.
pub struct Loop<'a> {
    hands: &'a Hands,
    vehicle: &'a dyn Vehicle,
    targets: &'a [Signal],
    step: f64,
    /// Steps so far.
    steps: usize,
    /// The vehicle's states, then those of the hands.
    state: Vec<f64>,
    /// Number of the vehicle's states.
    n: usize,
    /// Error and its rate in each axis at every step so far.
    seen: Vec<Vec<(f64, f64)>>,
    /// Remnant of each hand [stick].
    remnants: Vec<f64>,
}

impl<'a> Loop<'a> {
    /// Starts at rest, at the moment when the target appears.
    pub fn new(
        hands: &'a Hands,
        vehicle: &'a dyn Vehicle,
        targets: &'a [Signal],
        step: f64,
        random: &mut ChaCha8Rng,
    ) -> Self {
        let mut state = vehicle.start();
        let n = state.len();
        state.resize(n + PER_HAND * targets.len(), 0.0);
        let remnants = hands
            .axes
            .iter()
            .zip(targets)
            .map(|(human, target)| match target {
                Signal::Constant(_) => STARTLE,
                moving => deviation(human, moving) * normal(random),
            });
        let mut own = Self {
            remnants: remnants.collect(),
            seen: vec![Vec::new(); targets.len()],
            steps: 0,
            hands,
            vehicle,
            targets,
            step,
            state,
            n,
        };
        own.look();
        own
    }

    /// Advances by one step, with the remnant constant over it.
    pub fn advance(&mut self, random: &mut ChaCha8Rng) {
        let h = self.step;
        let k1 = self.derivative(&self.state, 0.0);
        let k2 = self.derivative(&along(&self.state, &k1, h / 2.0), 0.5);
        let k3 = self.derivative(&along(&self.state, &k2, h / 2.0), 0.5);
        let k4 = self.derivative(&along(&self.state, &k3, h), 1.0);
        for i in 0..self.state.len() {
            self.state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        self.steps += 1;
        self.look();
        for axis in 0..self.targets.len() {
            self.remnants[axis] = self.next_remnant(axis, random);
        }
    }

    /// Time of a point within the current step \[s\].
    fn time(&self, fraction: f64) -> f64 {
        (self.steps as f64 + fraction) * self.step
    }

    /// The vehicle's states.
    pub fn vehicle_states(&self) -> &[f64] {
        &self.state[..self.n]
    }

    /// The sticks, within their stops.
    pub fn sticks(&self) -> Vec<f64> {
        self.held(&self.state)
    }

    fn held(&self, state: &[f64]) -> Vec<f64> {
        let hands = state[self.n..].chunks(PER_HAND).enumerate();
        let held = hands.map(|(axis, hand)| {
            let (low, high) = self.vehicle.stops(axis);
            hand[1].clamp(low, high)
        });
        held.collect()
    }

    /// The current positions.
    pub fn positions(&self) -> Vec<f64> {
        self.observed()
            .iter()
            .map(|(position, _)| *position)
            .collect()
    }

    /// The vehicle's other recorded quantities.
    pub fn others(&self) -> Vec<f64> {
        self.vehicle
            .record(self.time(0.0), self.vehicle_states(), &self.sticks())
    }

    /// Current positions and rates; a stick at its stop does not move.
    fn observed(&self) -> Vec<(f64, f64)> {
        let sticks = self.sticks();
        let hands = self.state[self.n..].chunks(PER_HAND).zip(&self.hands.axes);
        let rates = hands
            .zip(&sticks)
            .map(|((hand, human), stick)| match hand[1] == *stick {
                true => human.limited(hand[2]),
                false => 0.0,
            });
        let rates: Vec<f64> = rates.collect();
        let (x, time) = (self.vehicle_states(), self.time(0.0));
        let mut dx = vec![0.0; self.n];
        self.vehicle.derivative(time, x, &sticks, &mut dx);
        self.vehicle.observe(time, [x, &dx], [&sticks, &rates])
    }

    /// Stores the current errors for the delayed perception.
    fn look(&mut self) {
        let time = self.time(0.0);
        for (axis, (position, rate)) in self.observed().into_iter().enumerate() {
            let (target, target_rate) = self.targets[axis].at(time);
            self.seen[axis].push((target - position, target_rate - rate));
        }
    }

    /// The remnant after one step: exact discretisation of an Ornstein–Uhlenbeck process.
    fn next_remnant(&self, axis: usize, random: &mut ChaCha8Rng) -> f64 {
        let human = &self.hands.axes[axis];
        let decay = (-self.step / human.remnant_time).exp();
        let deviate = normal(random);
        let deviation = deviation(human, &self.targets[axis]);
        decay * self.remnants[axis] + deviation * (1.0 - decay * decay).sqrt() * deviate
    }

    /// Error and rate as perceived at `fraction` of the current step, after the delay; zero before the target appears.
    /// Linear interpolation between steps.
    fn seen(&self, axis: usize, fraction: f64) -> (f64, f64) {
        let seen = &self.seen[axis];
        let now = (seen.len() - 1) as f64 + fraction;
        let at = now - self.hands.axes[axis].delay / self.step;
        if at < 0.0 {
            return (0.0, 0.0);
        }
        let (k, part) = (at.floor() as usize, at.fract());
        // Without a delay, what is seen at the end of a step is what was seen at its beginning.
        let last = seen.len() - 1;
        let (a, b) = (seen[k.min(last)], seen[(k + 1).min(last)]);
        (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1))
    }

    /// Command of each hand, before lag and arm: that of its own axis plus the cross-coupling from the other axis.
    fn commands(&self, fraction: f64) -> Vec<f64> {
        let own = self.hands.axes.iter().enumerate().map(|(axis, human)| {
            let (error, rate) = self.seen(axis, fraction);
            self.vehicle.sign(axis) * human.gain * (error + human.lead * rate)
        });
        let own: Vec<f64> = own.collect();
        let total: f64 = own.iter().sum();
        let commands = own.iter().zip(&self.remnants).map(|(own, remnant)| {
            let leak = match self.hands.coupling {
                0.0 => 0.0,
                coupling => coupling * (total - own),
            };
            own + leak + remnant
        });
        commands.collect()
    }

    fn derivative(&self, x: &[f64], fraction: f64) -> Vec<f64> {
        let mut dx = vec![0.0; x.len()];
        let (vehicle, hands) = dx.split_at_mut(self.n);
        self.vehicle
            .derivative(self.time(fraction), &x[..self.n], &self.held(x), vehicle);
        let hands = hands.chunks_mut(PER_HAND).zip(x[self.n..].chunks(PER_HAND));
        for ((hand, command), human) in hands.zip(self.commands(fraction)).zip(&self.hands.axes) {
            human.derivative(hand.1, command, hand.0);
        }
        dx
    }
}

impl Human {
    /// Limits a rate to the hand's maximum speed.
    fn limited(&self, rate: f64) -> f64 {
        rate.clamp(-self.stick_rate, self.stick_rate)
    }

    /// Derivatives `[ẇ, ṡ, r̈]` of the command after the lag, the arm and the arm's rate.
    fn derivative(&self, hand: &[f64], command: f64, dx: &mut [f64]) {
        let wish = match self.lag {
            0.0 => command,
            lag => {
                dx[0] = (command - hand[0]) / lag;
                hand[0]
            }
        };
        dx[1] = self.limited(hand[2]);
        dx[2] = self.frequency * (self.frequency * (wish - hand[1]) - 2.0 * self.damping * hand[2]);
    }
}

/// Standard deviation of the remnant [stick].
fn deviation(human: &Human, target: &Signal) -> f64 {
    human.remnant * human.gain * target.size()
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// `x + h dx`.
fn along(x: &[f64], dx: &[f64], h: f64) -> Vec<f64> {
    x.iter().zip(dx).map(|(x, dx)| x + h * dx).collect()
}
