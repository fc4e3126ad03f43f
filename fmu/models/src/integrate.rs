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
const C: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// Rows of `A`; the last one is also the fifth-order solution (first same as last).
const A: [[f64; 6]; 7] = [
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
const E: [f64; 7] = [
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

/// How accurately to integrate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance<const N: usize> {
    /// Relative tolerance `r` of each component.
    pub relative: f64,
    /// Absolute tolerance `a` of each component, in its unit.
    pub absolute: [f64; N],
}

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

/// Why an integration was given up.
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

/// Integrates `ẋ = f(τ, x)` from `x` at τ = 0 to τ = `interval` > 0.
///
/// # Errors
/// When the step size falls below what the tolerance allows, or the step limit is reached.
pub fn integrate<const N: usize>(
    f: impl Fn(f64, &[f64; N]) -> [f64; N],
    mut x: [f64; N],
    interval: f64,
    tolerance: &Tolerance<N>,
) -> Result<([f64; N], Work), IntegrationError> {
    let mut work = Work {
        evaluations: 1,
        ..Work::default()
    };
    let mut slope = f(0.0, &x);
    let (mut time, mut step, mut growth_limit) = (0.0, interval, GROWTH_LIMIT);
    loop {
        let (next, slopes, error) = trial(&f, time, &x, slope, step, tolerance);
        work.evaluations += 6;
        if error <= 1.0 {
            work.steps += 1;
            // The last step ends on the interval's end by construction, whatever the sum's rounding.
            if step >= interval - time {
                return Ok((next, work));
            }
            (time, x, slope) = (time + step, next, slopes[6]);
        } else {
            work.rejections += 1;
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
        if work.steps + work.rejections >= MAX_STEPS {
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

/// One trial step: the solution after it, the slopes of its stages, and its error (1 is allowed).
fn trial<const N: usize>(
    f: &impl Fn(f64, &[f64; N]) -> [f64; N],
    time: f64,
    x: &[f64; N],
    slope: [f64; N],
    step: f64,
    tolerance: &Tolerance<N>,
) -> ([f64; N], [[f64; N]; 7], f64) {
    let mut slopes = [slope; 7];
    let mut next = *x;
    for stage in 1..7 {
        next = std::array::from_fn(|i| {
            let increment: f64 = (0..stage).map(|j| A[stage][j] * slopes[j][i]).sum();
            x[i] + step * increment
        });
        slopes[stage] = f(time + C[stage] * step, &next);
    }
    let sum: f64 = (0..N)
        .map(|i| {
            let delta: f64 = (0..7).map(|j| E[j] * slopes[j][i]).sum();
            let scale = tolerance.absolute[i] + tolerance.relative * x[i].abs().max(next[i].abs());
            (step * delta / scale).powi(2)
        })
        .sum();
    let error = (sum / N as f64).sqrt();
    // An overflow in the solution alone would else pass for no error.
    let finite = next.iter().all(|v| v.is_finite());
    (next, slopes, if finite { error } else { f64::INFINITY })
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
