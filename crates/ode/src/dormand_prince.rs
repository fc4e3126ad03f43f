//! The explicit Runge–Kutta method of order 5(4) of Dormand and Prince ("A family of embedded Runge–Kutta formulae", J.
//! Comput. Appl. Math. 6(1), 1980), continued at the higher order. Its dense output of order 4 and the stiffness
//! detection follow Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, section II.6, and volume II,
//! section IV.2.

use super::System;
use super::scheme::{Scale, Scheme, Step};

const STAGES: usize = 7;

/// Nodes `c` of the seven stages.
const C: [f64; STAGES] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// Rows of `A`; the last one is also the fifth-order solution (first same as last).
const A: [[f64; STAGES - 1]; STAGES] = [
    [0.0; STAGES - 1],
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
const E: [f64; STAGES] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Weights of the last term of the dense output.
const D: [f64; STAGES] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// The method and its data of the last step.
#[derive(Debug)]
pub struct DormandPrince {
    /// Slopes of the inner stages; the first and the last are the derivatives at the ends of the step.
    inner: [Vec<f64>; STAGES - 2],
    /// Number of recent steps that looked stiff, and number of steps since then that did not.
    stiff: u32,
    relaxed: u32,
    /// Number of steps that must have looked stiff for the problem to count as such.
    patience: u32,
}

/// As in the code DOPRI5 of Hairer & Wanner.
const PATIENCE: u32 = 15;

impl DormandPrince {
    /// The method for `n` states.
    pub fn new(n: usize) -> Self {
        Self {
            inner: std::array::from_fn(|_| vec![0.0; n]),
            stiff: 0,
            relaxed: 0,
            patience: PATIENCE,
        }
    }

    /// Forgets which steps looked stiff. This many must do so before the problem counts as stiff, and 15 at least.
    pub(super) fn forget(&mut self, patience: u32) {
        (self.stiff, self.relaxed) = (0, 0);
        self.patience = patience.max(PATIENCE);
    }

    /// The slopes of all stages.
    #[inline(always)]
    fn slopes<'a>(&'a self, step: &'a Step, n: usize) -> [&'a [f64]; STAGES] {
        let [k1, k2, k3, k4, k5] = &self.inner;
        let (first, last) = (&step.f[..n], &step.f_end[..n]);
        // Written out, so that the compiler knows each slice.
        [
            first,
            &k1[..n],
            &k2[..n],
            &k3[..n],
            &k4[..n],
            &k5[..n],
            last,
        ]
    }

    /// An attempt for `n` states; see [`Scheme::attempt`].
    #[inline(always)]
    fn attempt_of<M: System>(
        &mut self,
        n: usize,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error> {
        let (t, h) = (step.t, step.h);
        let (x, k0, end) = (&step.x[..n], &step.f[..n], &mut step.x_end[..n]);
        let [k1, k2, k3, k4, k5] = &mut self.inner;
        let (k1, k2, k3) = (&mut k1[..n], &mut k2[..n], &mut k3[..n]);
        let (k4, k5, k6) = (&mut k4[..n], &mut k5[..n], &mut step.f_end[..n]);
        // A macro, since the compiler must also know the number of slopes at each stage.
        macro_rules! stage {
            ($stage:literal, $slope:ident, $($known:ident)*) => {
                combine([$(&*$known),*], &A[$stage], h, x, end);
                if !system.derivatives(t + C[$stage] * h, end, $slope)? {
                    return Ok(f64::INFINITY);
                }
            };
        }
        stage!(1, k1, k0);
        stage!(2, k2, k0 k1);
        stage!(3, k3, k0 k1 k2);
        stage!(4, k4, k0 k1 k2 k3);
        stage!(5, k5, k0 k1 k2 k3 k4);
        stage!(6, k6, k0 k1 k2 k3 k4 k5);
        let slopes: [&[f64]; STAGES] = [k0, k1, k2, k3, k4, k5, k6];
        let error = scale.norm(|i| h * weighted(&E, &slopes, i), x, end);
        // Otherwise an overflow in the solution alone would count as no error.
        Ok(
            match end.iter().all(|v| v.is_finite()) && error.is_finite() {
                true => error,
                false => f64::INFINITY,
            },
        )
    }

    /// True if the last steps were limited by the stability of the method and not by its accuracy: `h·|λ|` is at its
    /// stability limit of about 3.3.
    pub(super) fn looks_stiff(&mut self, step: &Step) -> bool {
        const BORDER: f64 = 3.25;
        let slopes = self.slopes(step, step.x.len());
        let (mut change, mut shift) = (0.0, 0.0);
        for i in 0..step.x.len() {
            change += (slopes[6][i] - slopes[5][i]).powi(2);
            // From the argument of the sixth stage to that of the seventh, which is the end.
            let rows = A[6].iter().zip(A[5]).zip(slopes);
            let moved: f64 = rows
                .map(|((seventh, sixth), k)| (seventh - sixth) * k[i])
                .sum();
            shift += moved.powi(2);
        }
        // `h·|λ|` is `h |f(a) - f(b)| / |a - b|`, and the distance of the arguments also has the factor `h`.
        if shift > 0.0 && (change / shift).sqrt() > BORDER {
            self.relaxed = 0;
            self.stiff += 1;
        } else {
            self.relaxed += 1;
            if self.relaxed == 6 {
                self.stiff = 0;
            }
        }
        self.stiff >= self.patience
    }
}

impl Scheme for DormandPrince {
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error> {
        // With a number of states known to the compiler, the sums become straight-line code.
        match step.x.len() {
            2 => self.attempt_of(2, system, step, scale),
            3 => self.attempt_of(3, system, step, scale),
            4 => self.attempt_of(4, system, step, scale),
            6 => self.attempt_of(6, system, step, scale),
            8 => self.attempt_of(8, system, step, scale),
            n => self.attempt_of(n, system, step, scale),
        }
    }

    /// The last stage is at the end of the step, so its slope is known.
    fn accept<M: System>(&mut self, _: &mut M, _: &mut Step) -> Result<bool, M::Error> {
        Ok(true)
    }

    fn interpolate(&self, step: &Step, theta: f64, x: &mut [f64]) {
        let (h, rest) = (step.h, 1.0 - theta);
        let slopes = self.slopes(step, x.len());
        for (i, x) in x.iter_mut().enumerate() {
            let difference = step.x_end[i] - step.x[i];
            let begin = h * step.f[i] - difference;
            let end = difference - h * step.f_end[i] - begin;
            let last = h * weighted(&D, &slopes, i);
            *x = step.x[i] + theta * (difference + rest * (begin + theta * (end + rest * last)));
        }
    }

    /// Proportional-integral step size control.
    fn factor(&self, error: f64, last: Option<f64>) -> f64 {
        0.9 * error.powf(-0.17) * last.unwrap_or(1e-4).powf(0.04)
    }
}

/// `Σ weights_j slopes_j` of state `i`.
#[inline(always)]
fn weighted(weights: &[f64; STAGES], slopes: &[&[f64]; STAGES], i: usize) -> f64 {
    (0..STAGES).fold(0.0, |sum, j| sum + weights[j] * slopes[j][i])
}

/// The argument of a stage: `x + h Σ weights_j slopes_j` over the previous slopes.
#[inline(always)]
fn combine<const S: usize>(
    slopes: [&[f64]; S],
    weights: &[f64; STAGES - 1],
    h: f64,
    x: &[f64],
    argument: &mut [f64],
) {
    for (i, (argument, x)) in argument.iter_mut().zip(x).enumerate() {
        let sum = (0..S).fold(0.0, |sum, j| sum + weights[j] * slopes[j][i]);
        *argument = x + h * sum;
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
        // Order conditions of quadrature: Σ b_i c_i^k = 1/(k+1); the fifth-order weights satisfy them up to k = 4.
        for k in 0..5 {
            let sum: f64 = A[6].iter().zip(C).map(|(b, c)| b * c.powi(k)).sum();
            assert!((sum - 1.0 / f64::from(k + 1)).abs() < 1e-14, "k = {k}");
        }
    }
}
