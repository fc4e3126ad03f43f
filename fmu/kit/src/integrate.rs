//! Explicit Runge–Kutta integration with error control: the method of Dormand and Prince.
//!
//! Method: J. R. Dormand, P. J. Prince, "A family of embedded Runge–Kutta formulae", Journal of
//! Computational and Applied Mathematics 6(1), 1980: fifth order, the solution carried on at the
//! higher order, with an embedded fourth-order solution for the error.
//!
//! Controller: E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd
//! ed., 1993, section II.4: the error `e = sqrt(mean((δ_i / (a_i + r max(|x_i|, |x_i'|)))²))` must not
//! exceed 1, and the next step is `h · clamp(0.9 e^(-1/5), 0.2, 5)`, not growing right after a
//! rejection. The first trial is the whole interval: a call depends on its arguments alone, so equal
//! calls give equal bits, and there is no memory to save with an FMU state.

/// Nodes `c` of the seven stages.
pub const C: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// Rows of `A`; the last one is also the fifth-order solution (first same as last).
pub const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
        0.0,
        0.0,
    ],
    [
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
        0.0,
    ],
    [
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];

/// Weights of the error: fifth-order minus fourth-order solution.
pub const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

const SAFETY: f64 = 0.9;
const SHRINK_LIMIT: f64 = 0.2;
const GROWTH_LIMIT: f64 = 5.0;
/// An interval that takes more steps than this is given up.
const MAX_STEPS: usize = 1_000_000;
/// A step smaller than this part of the interval is given up.
const MIN_FRACTION: f64 = 1e-13;

/// The work done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Accepted steps.
    pub steps: usize,
    /// Rejected steps.
    pub rejections: usize,
    /// Evaluations of the derivative.
    pub evaluations: usize,
}

/// Why an integration was given up. `time` is how far it came.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum IntegrationError {
    /// The error stays too large however small the step.
    #[error(
        "the step size fell below {smallest:e} s at {time} s of {interval} s; the solution grows \
         without bound or the tolerance is too strict"
    )]
    StepTooSmall {
        /// Where, from the interval's beginning [s].
        time: f64,
        /// Length of the interval [s].
        interval: f64,
        /// Step size at which it was given up [s].
        smallest: f64,
    },
    /// Too many steps.
    #[error(
        "{limit} steps were not enough for {interval} s, only for {time} s; take a shorter step or \
         slower coefficients"
    )]
    TooManySteps {
        /// Where, from the interval's beginning [s].
        time: f64,
        /// Length of the interval [s].
        interval: f64,
        /// The limit.
        limit: usize,
    },
}

impl IntegrationError {
    /// How far it came, from the interval's beginning [s].
    pub fn reached(&self) -> f64 {
        match self {
            Self::StepTooSmall { time, .. } | Self::TooManySteps { time, .. } => *time,
        }
    }
}

/// What is integrated, `ẋ = f(τ, x)`.
pub trait Ode {
    /// Writes `f(τ, x)` into `dx`; `time` is τ, from the interval's beginning [s].
    fn derivative(&mut self, time: f64, x: &[f64], dx: &mut [f64]);

    /// Whether there are events at all.
    fn has_events(&self) -> bool;

    /// Whether an event has happened on the way to `x` at `time`.
    fn crossed(&mut self, time: f64, x: &[f64]) -> bool;
}

/// Where an integration ended well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// At the end of the interval.
    Interval,
    /// Just after an event, so long after the interval's beginning [s].
    Event(f64),
}

/// Where events are looked for within a step besides its end, as parts of the step.
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];
/// How often the step that an event lies in is halved: to 1e-12 of it.
const HALVINGS: usize = 40;

/// The method with its workspace, for systems of one size.
#[derive(Debug, Clone)]
pub struct Integrator {
    slopes: [Vec<f64>; 7],
    next: Vec<f64>,
    stage: Vec<f64>,
    absolute: Vec<f64>,
    /// Work of the last run.
    pub work: Work,
}

impl Integrator {
    /// For systems with states of these typical magnitudes: the absolute tolerance of each is the
    /// relative one times that.
    pub fn new(nominals: Vec<f64>) -> Self {
        let zeros = vec![0.0; nominals.len()];
        Self {
            slopes: std::array::from_fn(|_| zeros.clone()),
            next: zeros.clone(),
            stage: zeros,
            absolute: nominals,
            work: Work::default(),
        }
    }

    /// Integrates from `x` at τ = 0 to τ = `interval` > 0, or to the first event. `x` holds the solution
    /// afterwards: where it ended, or, after an error, as far as it came.
    ///
    /// # Errors
    /// When the step size falls below what the tolerance allows, or the step limit is reached.
    pub fn run(
        &mut self,
        ode: &mut impl Ode,
        x: &mut [f64],
        interval: f64,
        relative: f64,
    ) -> Result<End, IntegrationError> {
        self.work = Work {
            evaluations: 1,
            ..Work::default()
        };
        ode.derivative(0.0, x, &mut self.slopes[0]);
        let (mut time, mut step, mut growth_limit) = (0.0, interval, GROWTH_LIMIT);
        loop {
            let error = self.trial(ode, time, x, step, relative);
            if error <= 1.0 {
                self.work.steps += 1;
                if let Some(size) = self.event(ode, time, x, step) {
                    x.copy_from_slice(&self.next);
                    return Ok(End::Event(time + size));
                }
                x.copy_from_slice(&self.next);
                // The last step ends on the interval's end by construction, whatever the sum's rounding.
                if step >= interval - time {
                    return Ok(End::Interval);
                }
                time += step;
                self.slopes.swap(0, 6);
            } else {
                self.work.rejections += 1;
            }
            let factor = match error.is_finite() {
                true => (SAFETY * error.powf(-0.2)).clamp(SHRINK_LIMIT, growth_limit),
                false => SHRINK_LIMIT,
            };
            growth_limit = if error <= 1.0 { GROWTH_LIMIT } else { 1.0 };
            let smallest = step * factor;
            let rest = interval - time;
            if smallest < MIN_FRACTION * interval {
                return Err(IntegrationError::StepTooSmall {
                    time,
                    interval,
                    smallest,
                });
            }
            if self.work.steps + self.work.rejections >= MAX_STEPS {
                return Err(IntegrationError::TooManySteps {
                    time,
                    interval,
                    limit: MAX_STEPS,
                });
            }
            // Never leaves a sliver for the last step.
            step = if smallest * 1.01 >= rest {
                rest
            } else {
                smallest
            };
        }
    }

    /// One step from `x` into `next`, with the slopes of its stages; its error (1 is allowed).
    fn trial(&mut self, ode: &mut impl Ode, time: f64, x: &[f64], step: f64, relative: f64) -> f64 {
        // With a number of states that the compiler knows, the sums below become straight code.
        match x.len() {
            2 => self.trial_of(2, ode, time, x, step, relative),
            3 => self.trial_of(3, ode, time, x, step, relative),
            4 => self.trial_of(4, ode, time, x, step, relative),
            6 => self.trial_of(6, ode, time, x, step, relative),
            8 => self.trial_of(8, ode, time, x, step, relative),
            n => self.trial_of(n, ode, time, x, step, relative),
        }
    }

    #[inline(always)]
    fn trial_of(
        &mut self,
        n: usize,
        ode: &mut impl Ode,
        time: f64,
        x: &[f64],
        step: f64,
        relative: f64,
    ) -> f64 {
        self.work.evaluations += 6;
        let (x, next) = (&x[..n], &mut self.next[..n]);
        // A macro, since the number of slopes known at a stage must be known to the compiler too.
        macro_rules! stages {
            ($($stage:literal)*) => {$({
                let (known, rest) = self.slopes.split_at_mut($stage);
                combine::<$stage>(known, &A[$stage], x, step, next);
                ode.derivative(time + C[$stage] * step, next, &mut rest[0][..n]);
            })*};
        }
        stages!(1 2 3 4 5 6);
        let slopes: [&[f64]; 7] = std::array::from_fn(|j| &self.slopes[j][..n]);
        let absolute = &self.absolute[..n];
        let mut sum = 0.0;
        for i in 0..n {
            let delta = (0..7).fold(0.0, |delta, j| delta + E[j] * slopes[j][i]);
            let size = x[i].abs().max(next[i].abs());
            let scale = relative * (absolute[i] + size);
            sum += (step * delta / scale).powi(2);
        }
        // An overflow in the solution alone would else pass for no error.
        match next.iter().all(|v| v.is_finite()) {
            true if n == 0 => 0.0,
            true => (sum / n as f64).sqrt(),
            false => f64::INFINITY,
        }
    }

    /// Looks for the first event within the step just taken. If there is one, `next` is the solution just
    /// after it, and the size of the step there is returned.
    ///
    /// Between its ends the step is looked at on the cubic Hermite interpolant, so that a crossing there
    /// and back is seen; what is found is located on steps of the method itself.
    fn event(&mut self, ode: &mut impl Ode, time: f64, x: &[f64], step: f64) -> Option<f64> {
        if !ode.has_events() {
            return None;
        }
        let mut before = 0.0;
        for part in LOOKS {
            self.interpolate(x, step, part);
            if ode.crossed(time + part * step, &self.stage) {
                let found = self.locate(ode, time, x, [before * step, part * step]);
                if found.is_some() {
                    return found;
                }
                // The interpolant was wrong: back to the whole step.
                self.trial(ode, time, x, step, 1.0);
            }
            before = part;
        }
        match ode.crossed(time + step, &self.next) {
            true => self.locate(ode, time, x, [before * step, step]),
            false => None,
        }
    }

    /// Halves the bracket of step sizes: no event yet at the first, one at the second.
    fn locate(
        &mut self,
        ode: &mut impl Ode,
        time: f64,
        x: &[f64],
        [mut low, mut high]: [f64; 2],
    ) -> Option<f64> {
        self.trial(ode, time, x, high, 1.0);
        if !ode.crossed(time + high, &self.next) {
            return None;
        }
        let smallest = (high - low) * 0.5_f64.powi(HALVINGS as i32);
        while high - low > smallest {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            self.trial(ode, time, x, middle, 1.0);
            match ode.crossed(time + middle, &self.next) {
                true => high = middle,
                false => low = middle,
            }
        }
        self.trial(ode, time, x, high, 1.0);
        Some(high)
    }

    /// Writes the cubic Hermite interpolant at that part of the step into `stage`.
    fn interpolate(&mut self, x: &[f64], step: f64, part: f64) {
        let s = part;
        let (h01, h10, h11) = (
            s * s * (3.0 - 2.0 * s),
            s * (1.0 - s) * (1.0 - s),
            s * s * (s - 1.0),
        );
        for (i, x) in x.iter().enumerate() {
            let slopes = h10 * self.slopes[0][i] + h11 * self.slopes[6][i];
            self.stage[i] = x + h01 * (self.next[i] - x) + step * slopes;
        }
    }
}

/// `next = x + step · Σ weights_j slopes_j` over the first `S` slopes.
#[inline(always)]
fn combine<const S: usize>(
    slopes: &[Vec<f64>],
    weights: &[f64; 6],
    x: &[f64],
    step: f64,
    next: &mut [f64],
) {
    let slopes: [&[f64]; S] = std::array::from_fn(|j| &slopes[j][..x.len()]);
    for (i, (next, x)) in next.iter_mut().zip(x).enumerate() {
        let sum = (0..S).fold(0.0, |sum, j| sum + weights[j] * slopes[j][i]);
        *next = x + step * sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tableau_is_consistent() {
        for (row, c) in A.iter().zip(C) {
            assert!((row.iter().sum::<f64>() - c).abs() < 1e-14);
        }
        assert!(E.iter().sum::<f64>().abs() < 1e-15);
        // Order conditions of quadrature: Σ b_i c_i^k = 1/(k+1), the fifth-order weights up to k = 4.
        for k in 0..5 {
            let sum: f64 = A[6].iter().zip(C).map(|(b, c)| b * c.powi(k)).sum();
            assert!((sum - 1.0 / f64::from(k + 1)).abs() < 1e-14, "k = {k}");
        }
    }
}
