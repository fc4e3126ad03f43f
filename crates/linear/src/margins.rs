//! Stability margins of a loop, from its frequency response.

use super::modes::Mode;
use super::state_space::StateSpace;
use nalgebra::Complex;
use std::f64::consts::PI;

/// Points of the response per decade of frequency.
const POINTS_A_DECADE: f64 = 100.0;
/// A smaller gain is 0 up to rounding, and a greater one than its reciprocal infinite.
const NO_GAIN: f64 = 1e-9;
/// Between two points the phase turns by no more than this \[rad\], and the gain changes by no more than this factor; else
/// there are points between them, as near a zero of little damping.
const TURN: f64 = 0.35;
const FACTOR: f64 = 2.0;
/// Times that an interval is halved at most, and number of points added at most.
const HALVINGS: u32 = 40;
const ADDED: usize = 5000;
/// Sine of the phase where it passes -180°, at most: near a pole on the axis it jumps.
const PASSES: f64 = 0.01;

/// The response of an open loop at ascending frequencies.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Response {
    /// Frequencies [rad/s], ascending.
    pub frequency: Vec<f64>,
    /// `L(jω)`.
    pub value: Vec<Complex<f64>>,
}

/// A frequency at which the gain of the loop is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainCrossing {
    /// Crossover frequency `ω_c` [rad/s].
    pub frequency: f64,
    /// `180° + arg L(jω_c)` \[rad\], between -π and π.
    pub phase_margin: f64,
    /// Delay that would use up that margin \[s\]: the margin, taken from 0 to 2π, divided by `ω_c`.
    pub delay_margin: f64,
    /// `τ_e` of the crossover model `L = ω_c e^(-τ_e s) / s` \[s\] with this crossover and phase:
    /// `(π/2 - phase margin) / ω_c` (D. T. McRuer, E. S. Krendel, "Mathematical Models of Human Pilot Behavior",
    /// AGARDograph 188, 1974). Negative for a loop with less phase lag than an integrator.
    pub effective_delay: f64,
}

/// A frequency at which the phase of the loop is -180°.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseCrossing {
    /// Frequency [rad/s]; 0 for a steady gain below 0.
    pub frequency: f64,
    /// `1 / |L|`: factor by which the gain may change until the loop is at its stability limit; below 1 for a gain that
    /// must not decrease further.
    pub gain_margin: f64,
}

/// The crossings that limit a loop, at ascending frequencies.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Margins {
    /// Frequencies at which the gain is 1.
    pub gain_crossings: Vec<GainCrossing>,
    /// Frequencies at which the phase is -180°.
    pub phase_crossings: Vec<PhaseCrossing>,
}

impl Response {
    /// The response of a loop `L(jω)`, with more points where it changes quickly. `poles` are those of the open and of
    /// the closed loop: the response changes near them, and it is evaluated to about two decades beyond their
    /// frequencies. `highest` is the highest frequency [rad/s], if there is one.
    pub fn of(
        evaluate: impl Fn(f64) -> Complex<f64>,
        poles: &[Complex<f64>],
        highest: Option<f64>,
    ) -> Self {
        let mut response = Self::default();
        let mut left = ADDED;
        for omega in frequencies(poles, highest) {
            response.add((omega, evaluate(omega)), &evaluate, HALVINGS, &mut left);
        }
        for function in [excess_gain, sine_near_180] {
            response.add_turns(function, &evaluate);
        }
        response
    }

    /// Adds the points at which a function turns back just beyond 0: it has two roots between neighbouring points.
    fn add_turns(
        &mut self,
        function: fn(Complex<f64>) -> f64,
        evaluate: &impl Fn(f64) -> Complex<f64>,
    ) {
        let values: Vec<f64> = self.value.iter().map(|&value| function(value)).collect();
        let turn = |i: usize| {
            let sign = values[i].signum();
            let is_least = values[i] != 0.0
                && sign * values[i - 1] >= values[i].abs()
                && sign * values[i + 1] >= values[i].abs();
            let ends = [self.frequency[i - 1], self.frequency[i + 1]];
            let omega = is_least.then(|| least(ends, |omega| sign * function(evaluate(omega))))?;
            (sign * function(evaluate(omega)) < 0.0).then_some((i, omega))
        };
        let turns: Vec<(usize, f64)> = (1..values.len().max(1) - 1).filter_map(turn).collect();
        for (i, omega) in turns.into_iter().rev() {
            let at = if omega < self.frequency[i] { i } else { i + 1 };
            self.frequency.insert(at, omega);
            self.value.insert(at, evaluate(omega));
        }
    }

    /// Adds a point, and those that are wanted between the last one and it.
    fn add(
        &mut self,
        (omega, value): (f64, Complex<f64>),
        evaluate: &impl Fn(f64) -> Complex<f64>,
        halvings: u32,
        left: &mut usize,
    ) {
        if let (Some(&last), Some(before)) = (self.frequency.last(), self.value.last()) {
            let middle = 0.5 * (last + omega);
            let is_between = last < middle && middle < omega;
            if is_between && halvings > 0 && *left > 0 && is_abrupt(*before, value) {
                *left -= 1;
                self.add((middle, evaluate(middle)), evaluate, halvings - 1, left);
                return self.add((omega, value), evaluate, halvings - 1, left);
            }
        }
        self.frequency.push(omega);
        self.value.push(value);
    }

    /// Behaviour at the lowest frequencies: the gain (signed if it is a steady gain), and the power of the frequency
    /// with which it changes: 0 for a loop with a steady gain, -1 for one that integrates once.
    pub fn low(&self) -> (f64, i32) {
        let (Some(first), Some(second)) = (self.value.first(), self.value.get(1)) else {
            return (0.0, 0);
        };
        let slope =
            (second.norm() / first.norm()).ln() / (self.frequency[1] / self.frequency[0]).ln();
        match slope.round() as i32 {
            0 => (first.norm().copysign(first.re), 0),
            power => (first.norm(), power),
        }
    }

    /// Unwrapped phase \[rad\].
    pub fn phase(&self) -> Vec<f64> {
        let mut last = 0.0;
        let unwrapped = self.value.iter().enumerate().map(|(i, value)| {
            let phase = value.arg();
            last = match i {
                0 => phase,
                _ => phase + 2.0 * PI * ((last - phase) / (2.0 * PI)).round(),
            };
            last
        });
        unwrapped.collect()
    }
}

/// Whether a response changes much between two points.
fn is_abrupt(a: Complex<f64>, b: Complex<f64>) -> bool {
    let ratio = b / a;
    let gain = ratio.norm().ln().abs();
    gain.is_finite() && (gain > FACTOR.ln() || ratio.arg().abs() > TURN)
}

/// Logarithmic spacing, refined around each resonance.
fn frequencies(poles: &[Complex<f64>], highest: Option<f64>) -> Vec<f64> {
    let modes = Mode::of_poles(poles);
    // Poles that differ from 0 only by rounding give no relevant frequencies, nor do unknown ones.
    let known = || modes.iter().filter(|m| m.frequency.is_finite());
    let fastest = known().map(|m| m.frequency).fold(0.0, f64::max);
    let modes: Vec<Mode> = known()
        .filter(|m| m.frequency > 1e-9 * fastest)
        .copied()
        .collect();
    let slowest = modes
        .iter()
        .map(|m| m.frequency)
        .fold(f64::INFINITY, f64::min);
    let (mut low, mut high) = match modes.is_empty() {
        true => (1e-2, 1e2),
        false => (slowest * 1e-2, fastest * 1e2),
    };
    if let Some(highest) = highest {
        high = highest;
        low = low.min(1e-3 * high);
    }
    // Frequencies beyond these are irrelevant, and their ratio would not be finite.
    (low, high) = (low.clamp(1e-150, 1e150), high.clamp(1e-150, 1e150));
    let steps = ((high / low).log10() * POINTS_A_DECADE).ceil().max(2.0);
    let mut points: Vec<f64> = (0..=steps as usize)
        .map(|i| low * (high / low).powf(i as f64 / steps))
        .collect();
    for mode in &modes {
        // A resonance is about |damping| wide.
        let width = mode.damping.abs().clamp(1e-6, 1.0);
        for i in -40..=40 {
            points.push(mode.frequency * (1.0 + 0.1 * f64::from(i) * width));
        }
    }
    points.retain(|&point| point >= low && point <= high);
    points.sort_by(f64::total_cmp);
    points.dedup();
    points
}

impl Margins {
    /// The crossings of a response, located to full precision by bisection.
    pub fn of(response: &Response, evaluate: impl Fn(f64) -> Complex<f64>) -> Self {
        let crossing = |[low, high]: [usize; 2], function: fn(Complex<f64>) -> f64| {
            let ends = [response.frequency[low], response.frequency[high]];
            let omega = root(ends, |omega| function(evaluate(omega)));
            (omega, evaluate(omega))
        };
        let gain_crossings = (sign_changes(&response.value, excess_gain).into_iter())
            .map(|ends| GainCrossing::at(crossing(ends, |value| value.norm().ln())));
        // At the points beside it the phase may be far from that, if a zero or a pole is near.
        let is_passed = |value: Complex<f64>| {
            let gains = NO_GAIN..1.0 / NO_GAIN;
            value.re < 0.0
                && gains.contains(&value.norm())
                && (value.im / value.norm()).abs() < PASSES
        };
        let phase_crossings = (sign_changes(&response.value, clear_sine).into_iter())
            .map(|ends| crossing(ends, |value| value.im))
            .filter(|(_, value)| is_passed(*value))
            .map(PhaseCrossing::at);
        Self {
            gain_crossings: gain_crossings.collect(),
            phase_crossings: phase_crossings.collect(),
        }
    }

    /// The same with the crossing at 0, if the loop has a steady gain.
    pub(super) fn with_steady(
        self,
        response: &Response,
        evaluate: impl Fn(f64) -> Complex<f64>,
    ) -> Self {
        match response.low() {
            (_, 0) => self.with_end(0.0, evaluate(0.0)),
            _ => self,
        }
    }

    /// The same with the crossing at an end of the frequencies, 0 or that of Nyquist, where a response is real: a loop may
    /// have its limit there though its phase only reaches -180°.
    pub(super) fn with_end(mut self, frequency: f64, value: Complex<f64>) -> Self {
        if value.re < -NO_GAIN && value.re.is_finite() && clear_sine(value) == 0.0 {
            self.phase_crossings
                .push(PhaseCrossing::at((frequency, value)));
            let by_frequency =
                |a: &PhaseCrossing, b: &PhaseCrossing| a.frequency.total_cmp(&b.frequency);
            self.phase_crossings.sort_by(by_frequency);
        }
        self
    }

    /// The same with this number of phase crossings at most: those with gain margins nearest to 1. A delay turns the phase without
    /// end.
    #[must_use]
    pub fn limited(mut self, most: usize) -> Self {
        let size = |own: &PhaseCrossing| own.gain_margin.ln().abs();
        let mut sizes: Vec<f64> = self.phase_crossings.iter().map(size).collect();
        sizes.sort_by(f64::total_cmp);
        if let Some(largest) = sizes.get(most.max(1) - 1) {
            self.phase_crossings.retain(|own| size(own) <= *largest);
        }
        self
    }

    /// The crossing with the phase margin of smallest magnitude.
    pub fn phase_margin(&self) -> Option<&GainCrossing> {
        let by_size = |a: &&GainCrossing, b: &&GainCrossing| {
            a.phase_margin.abs().total_cmp(&b.phase_margin.abs())
        };
        self.gain_crossings.iter().min_by(by_size)
    }

    /// The crossing with the gain margin nearest to 1, by its logarithm.
    pub fn gain_margin(&self) -> Option<&PhaseCrossing> {
        let by_size = |a: &&PhaseCrossing, b: &&PhaseCrossing| {
            let size = |crossing: &PhaseCrossing| crossing.gain_margin.ln().abs();
            size(a).total_cmp(&size(b))
        };
        self.phase_crossings.iter().min_by(by_size)
    }
}

/// Logarithm of the gain; a gain of exactly 1 up to rounding gives 0.
fn excess_gain(value: Complex<f64>) -> f64 {
    let excess = value.norm().ln();
    match excess.abs() < 1e-9 {
        true => 0.0,
        false => excess,
    }
}

/// Sine of the phase; a phase of exactly ±180° up to rounding gives 0.
fn clear_sine(value: Complex<f64>) -> f64 {
    let sine = value.im / value.norm();
    match sine.abs() < 1e-9 {
        true => 0.0,
        false => sine,
    }
}

/// The same where the phase is nearer to -180° than to 0, and NaN elsewhere.
fn sine_near_180(value: Complex<f64>) -> f64 {
    match value.re < 0.0 {
        true => clear_sine(value),
        false => f64::NAN,
    }
}

/// Pairs of positions between which a function of the response changes its sign. Zeros are skipped: a phase that
/// reaches -180° and returns to the same side does not cross.
fn sign_changes(values: &[Complex<f64>], function: fn(Complex<f64>) -> f64) -> Vec<[usize; 2]> {
    let signs = values.iter().map(|&value| function(value)).enumerate();
    let signs: Vec<(usize, f64)> = signs.filter(|(_, sign)| *sign != 0.0).collect();
    (signs.windows(2))
        .filter(|pair| pair[0].1 * pair[1].1 < 0.0)
        .map(|pair| [pair[0].0, pair[1].0])
        .collect()
}

/// The place of a minimum of the function between the ends, by golden sections.
fn least(ends: [f64; 2], function: impl Fn(f64) -> f64) -> f64 {
    let part = 0.5 * (5.0_f64.sqrt() - 1.0);
    let [mut low, mut high] = ends;
    // A minimum is no sharper than the root of a double's digits.
    for _ in 0..40 {
        let width = part * (high - low);
        match function(high - width) < function(low + width) {
            true => high = low + width,
            false => low = high - width,
        }
    }
    0.5 * (low + high)
}

/// A root of the function between the ends, where its signs differ.
fn root(ends: [f64; 2], function: impl Fn(f64) -> f64) -> f64 {
    let [mut low, mut high] = ends;
    let is_above = function(low) > 0.0;
    // 60 halvings exhaust the digits of a double.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match (function(middle) > 0.0) == is_above {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

impl GainCrossing {
    /// The crossing at a frequency where `L` has this value.
    pub(super) fn at((frequency, value): (f64, Complex<f64>)) -> Self {
        // arg(-L) is 180° + arg L, wrapped to between -180° and 180°.
        let phase_margin = (-value).arg();
        Self {
            frequency,
            phase_margin,
            delay_margin: phase_margin.rem_euclid(2.0 * PI) / frequency,
            effective_delay: (PI / 2.0 - phase_margin) / frequency,
        }
    }
}

impl PhaseCrossing {
    /// The crossing at a frequency where `L` has this value.
    pub(super) fn at((frequency, value): (f64, Complex<f64>)) -> Self {
        Self {
            frequency,
            gain_margin: 1.0 / value.norm(),
        }
    }
}

impl StateSpace {
    /// Response and margins of an open loop ([`StateSpace::open_loop`]).
    pub fn margins(&self) -> (Response, Margins) {
        self.margins_of(|omega| self.transfer(0, 0, Complex::new(0.0, omega)))
    }

    /// The same of a response of its own, for a loop of which this system is an approximation.
    pub fn margins_of(&self, evaluate: impl Fn(f64) -> Complex<f64>) -> (Response, Margins) {
        let closed = &self.a - &self.b * &self.c / (1.0 + self.d[(0, 0)]);
        let mut poles = self.poles();
        poles.extend(super::modes::eigenvalues(&closed));
        let response = Response::of(&evaluate, &poles, None);
        let margins = Margins::of(&response, &evaluate).with_steady(&response, &evaluate);
        (response, margins)
    }
}
