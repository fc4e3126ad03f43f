//! The implicit Runge–Kutta method Radau IIA of order 5 for stiff problems (Hairer & Wanner, *Solving Ordinary
//! Differential Equations II*, section IV.8). A simplified Newton iteration solves for the three stages, in coordinates
//! in which the inverse of the Runge–Kutta matrix consists of a real and a complex number.

use super::System;
use super::scheme::{Scale, Scheme, Step};
use super::solver::Work;
use nalgebra::{Complex, DMatrix, DVector, Dyn, LU};

const STAGES: usize = 3;
const SQRT6: f64 = 2.449_489_742_783_178;

/// Nodes: zeros of a shifted Legendre–Radau polynomial.
const C: [f64; STAGES] = [(4.0 - SQRT6) / 10.0, (4.0 + SQRT6) / 10.0, 1.0];

/// Weights of the error estimate (section IV.8, formula 8.20, divided by γ0).
const E: [f64; STAGES] = [
    (-13.0 - 7.0 * SQRT6) / 3.0,
    (-13.0 + 7.0 * SQRT6) / 3.0,
    -1.0 / 3.0,
];

/// Eigenvectors of the inverse of the Runge–Kutta matrix, and the inverse of their matrix.
const T: [[f64; STAGES]; STAGES] = [
    [
        0.094_438_762_488_975_24,
        -0.141_255_295_020_954_2,
        0.030_029_194_105_147_42,
    ],
    [
        0.250_213_122_965_333_3,
        0.204_129_352_293_799_94,
        -0.382_942_112_757_261_9,
    ],
    [1.0, 1.0, 0.0],
];
const T_INVERSE: [[f64; STAGES]; STAGES] = [
    [
        4.178_718_591_551_904,
        0.327_682_820_761_062_37,
        0.523_376_445_499_449_5,
    ],
    [
        -4.178_718_591_551_904,
        -0.327_682_820_761_062_37,
        0.476_623_554_500_550_5,
    ],
    [
        0.502_872_634_945_786_8,
        -2.571_926_949_855_605,
        0.596_039_204_828_224_9,
    ],
];

/// The eigenvalues: `3 + ∛9 - ∛3` and `3 + (∛3 - ∛9)/2 ∓ i (3^(5/6) + 3^(7/6))/2`.
const REAL: f64 = 3.637_834_252_744_496;
const COMPLEX: Complex<f64> = Complex::new(2.681_082_873_627_752, -3.050_430_199_247_410_5);

/// Coefficients of the collocation polynomial through zero and the stages, for the powers of `theta`.
const P: [[f64; STAGES]; STAGES] = [
    [
        13.0 / 3.0 + 7.0 * SQRT6 / 3.0,
        -23.0 / 3.0 - 22.0 * SQRT6 / 3.0,
        10.0 / 3.0 + 5.0 * SQRT6,
    ],
    [
        13.0 / 3.0 - 7.0 * SQRT6 / 3.0,
        -23.0 / 3.0 + 22.0 * SQRT6 / 3.0,
        10.0 / 3.0 - 5.0 * SQRT6,
    ],
    [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
];

/// Largest remaining correction, relative to the permitted error of a step, at which a stagnating iteration counts as
/// converged: the limit of [`Radau::newton`] for the loosest tolerances.
const STAGNATION: f64 = 0.03;

/// Maximum number of Newton iterations.
const ITERATIONS: i32 = 6;

/// The method and its data of the last step.
#[derive(Debug)]
pub(super) struct Radau {
    jacobian: DMatrix<f64>,
    /// Whether the Jacobian was evaluated at the start of the step.
    is_current: bool,
    factors: Option<Factors>,
    z: [Vec<f64>; STAGES],
    w: [Vec<f64>; STAGES],
    f: [Vec<f64>; STAGES],
    /// Collocation polynomial of the last accepted step: its length and coefficients.
    dense: Option<Dense>,
    begin: Vec<f64>,
    argument: Vec<f64>,
    /// Newton iterations of the last attempt, for the choice of the next step size.
    iterations: i32,
    convergence: f64,
    /// Whether to keep the step size instead of a slightly larger one, which would need a new factorisation.
    keeps_length: bool,
    /// Numbers of Jacobian evaluations and factorisations.
    jacobians: u64,
    factorisations: u64,
}

#[derive(Debug)]
struct Factors {
    h: f64,
    real: LU<f64, Dyn, Dyn>,
    complex: LU<Complex<f64>, Dyn, Dyn>,
}

#[derive(Debug, Clone)]
struct Dense {
    h: f64,
    coefficients: [Vec<f64>; STAGES],
}

impl Radau {
    pub(super) fn new(n: usize) -> Self {
        let stages = || std::array::from_fn(|_| vec![0.0; n]);
        Self {
            jacobian: DMatrix::zeros(n, n),
            is_current: false,
            factors: None,
            z: stages(),
            w: stages(),
            f: stages(),
            dense: None,
            begin: vec![0.0; n],
            argument: vec![0.0; n],
            iterations: 0,
            convergence: 0.0,
            keeps_length: false,
            jacobians: 0,
            factorisations: 0,
        }
    }

    /// An upper bound of the magnitudes of the last Jacobian's eigenvalues: the smaller of two norms.
    pub(super) fn fastest_rate(&self) -> f64 {
        let sum = |own: &mut dyn Iterator<Item = &f64>| own.map(|value| value.abs()).sum::<f64>();
        let columns = self.jacobian.column_iter().map(|own| sum(&mut own.iter()));
        let rows = self.jacobian.row_iter().map(|own| sum(&mut own.iter()));
        let [columns, rows] = [columns.fold(0.0, f64::max), rows.fold(0.0, f64::max)];
        columns.min(rows)
    }

    /// The Jacobian at the start of the step, from the system or by finite differences.
    fn differentiate<M: System>(
        &mut self,
        system: &mut M,
        step: &Step,
        scale: &Scale,
    ) -> Result<bool, M::Error> {
        let &Step { t, x, f, .. } = step;
        self.jacobians += 1;
        self.factors = None;
        self.is_current = true;
        if system.jacobian(t, x, &mut self.jacobian)? {
            return Ok(true);
        }
        self.argument.copy_from_slice(x);
        for (j, &here) in x.iter().enumerate() {
            // Relative to the magnitude or, if that is zero, to a value that counts as small there.
            let size = here.abs().max(scale.absolute[j] / scale.relative);
            let shift = f64::EPSILON.sqrt() * size.max(f64::MIN_POSITIVE.sqrt());
            self.argument[j] = here + shift;
            if !system.derivatives(t, &self.argument, &mut self.f[0])? {
                return Ok(false);
            }
            let shift = self.argument[j] - here;
            self.argument[j] = here;
            for (i, (shifted, f)) in self.f[0].iter().zip(f).enumerate() {
                self.jacobian[(i, j)] = (shifted - f) / shift;
            }
        }
        Ok(self.jacobian.iter().all(|value| value.is_finite()))
    }

    /// Factors the matrices of the Newton iteration for steps of length `h`.
    fn factorise(&mut self, h: f64) -> bool {
        if self.factors.as_ref().is_some_and(|factors| factors.h == h) {
            return true;
        }
        self.factorisations += 1;
        let n = self.begin.len();
        let real = DMatrix::identity(n, n) * (REAL / h) - &self.jacobian;
        let jacobian = self.jacobian.map(|value| Complex::new(value, 0.0));
        let complex = DMatrix::<Complex<f64>>::identity(n, n) * (COMPLEX / h) - jacobian;
        let factors = Factors {
            h,
            real: real.lu(),
            complex: complex.lu(),
        };
        let is_regular = factors.real.is_invertible() && factors.complex.is_invertible();
        self.factors = is_regular.then_some(factors);
        is_regular
    }

    /// Solves for the stages; `false` if the iteration does not converge.
    fn newton<M: System>(
        &mut self,
        system: &mut M,
        step: &Step,
        scale: &Scale,
    ) -> Result<bool, M::Error> {
        let &Step { t, h, x, .. } = step;
        let tolerance = (10.0 * f64::EPSILON / scale.relative).max(scale.relative.sqrt().min(0.03));
        self.predict(h, x);
        let (mut last, mut rate) = (0.0f64, 0.0f64);
        for iteration in 0..ITERATIONS {
            self.iterations = iteration + 1;
            for (stage, node) in C.iter().enumerate() {
                for (argument, (x, z)) in
                    (self.argument.iter_mut()).zip(x.iter().zip(&self.z[stage]))
                {
                    *argument = x + z;
                }
                let at = t + node * h;
                if !system.derivatives(at, &self.argument, &mut self.f[stage])? {
                    return Ok(false);
                }
            }
            let Some(size) = self.correct(h, x, scale).filter(|size| size.is_finite()) else {
                return Ok(false);
            };
            // So small that the rate is dominated by rounding errors, of a correction or of the states.
            let rounding = 4.0 * f64::EPSILON / scale.relative;
            if size <= rounding.max(1e-3 * tolerance) {
                self.convergence = rate;
                return Ok(true);
            }
            if iteration > 0 {
                rate = size / last;
                let left = ITERATIONS - 1 - iteration;
                let hopeless = rate >= 1.0 || rate.powi(left) / (1.0 - rate) * size > tolerance;
                if hopeless {
                    // Corrections that no longer shrink are rounding errors of the derivatives if they are small
                    // compared with the permitted error.
                    let error = (rate / (1.0 - rate)).max(1.0) * size;
                    let is_done = if rate < 1.0 { error } else { size } <= STAGNATION;
                    self.convergence = rate;
                    return Ok(is_done);
                }
                if rate / (1.0 - rate) * size < tolerance {
                    self.convergence = rate;
                    return Ok(true);
                }
            }
            last = size;
        }
        Ok(false)
    }

    /// Initial values of the stages, extrapolated from the polynomial of the last step.
    fn predict(&mut self, h: f64, x: &[f64]) {
        for (z, node) in self.z.iter_mut().zip(C) {
            match &self.dense {
                Some(dense) => {
                    let theta = 1.0 + node * h / dense.h;
                    for (i, (z, x)) in z.iter_mut().zip(x).enumerate() {
                        *z = dense.at(theta, i, &self.begin) - x;
                    }
                }
                None => z.fill(0.0),
            }
        }
        apply(&T_INVERSE, &self.z, &mut self.w);
    }

    /// One Newton correction. Returns its size, or `None` if the matrices are singular.
    fn correct(&mut self, h: f64, x: &[f64], scale: &Scale) -> Option<f64> {
        let n = x.len();
        let factors = self.factors.as_ref()?;
        let row = |row: usize, i: usize| -> f64 {
            (0..STAGES).map(|s| T_INVERSE[row][s] * self.f[s][i]).sum()
        };
        let real = DVector::from_fn(n, |i, _| row(0, i) - REAL / h * self.w[0][i]);
        let complex = DVector::from_fn(n, |i, _| {
            let w = Complex::new(self.w[1][i], self.w[2][i]);
            Complex::new(row(1, i), row(2, i)) - COMPLEX / h * w
        });
        let real = factors.real.solve(&real)?;
        let complex = factors.complex.solve(&complex)?;
        let mut sum = 0.0;
        for i in 0..n {
            let change = [real[i], complex[i].re, complex[i].im];
            for (w, change) in self.w.iter_mut().zip(change) {
                w[i] += change;
                sum += (change / scale.of(i, x[i])).powi(2);
            }
        }
        apply(&T, &self.w, &mut self.z);
        Some((sum / (STAGES * n.max(1)) as f64).sqrt())
    }

    /// The embedded error estimate of order 3, filtered by the real matrix so that it stays bounded for infinitely
    /// stiff components.
    fn error<M: System>(
        &mut self,
        system: &mut M,
        step: &Step,
        scale: &Scale,
    ) -> Result<f64, M::Error> {
        let &Step { t, h, x, f, .. } = step;
        let to = &*step.x_end;
        let n = x.len();
        let weighted = |i: usize| (0..STAGES).map(|s| E[s] * self.z[s][i]).sum::<f64>() / h;
        let weighted = DVector::from_fn(n, |i, _| weighted(i));
        let solve = |f: &[f64]| {
            let factors = self.factors.as_ref()?;
            factors
                .real
                .solve(&(DVector::from_column_slice(f) + &weighted))
        };
        let Some(mut error) = solve(f) else {
            return Ok(f64::INFINITY);
        };
        let mut size = scale.norm(|i| error[i], x, to);
        // After a rejection, and in the first step, the filter is applied twice.
        if size > 1.0 && (step.is_again || self.dense.is_none()) {
            for i in 0..n {
                self.argument[i] = x[i] + error[i];
            }
            if !system.derivatives(t, &self.argument, &mut self.f[0])? {
                return Ok(f64::INFINITY);
            }
            if let Some(filtered) = solve(&self.f[0]) {
                error = filtered;
                size = scale.norm(|i| error[i], x, to);
            }
        }
        Ok(match size.is_finite() {
            true => size,
            false => f64::INFINITY,
        })
    }

    /// Stores the collocation polynomial of the attempted step.
    fn keep(&mut self, step: &Step) {
        let coefficient =
            |power: usize, i: usize| (0..STAGES).map(|s| P[s][power] * self.z[s][i]).sum();
        let coefficients =
            std::array::from_fn(|power| (0..step.x.len()).map(|i| coefficient(power, i)).collect());
        self.dense = Some(Dense {
            h: step.h,
            coefficients,
        });
        self.begin.copy_from_slice(step.x);
        let is_slow = self.iterations > 2 && self.convergence > 1e-3;
        self.is_current = false;
        if is_slow {
            // The next step needs a new Jacobian.
            self.factors = None;
        }
        self.keeps_length = !is_slow;
    }
}

impl Scheme for Radau {
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error> {
        let is_needed = self.factors.is_none() && !self.is_current;
        if is_needed && !self.differentiate(system, step, scale)? {
            return Ok(f64::INFINITY);
        }
        loop {
            if !self.factorise(step.h) {
                return Ok(f64::INFINITY);
            }
            if self.newton(system, step, scale)? {
                break;
            }
            // The Jacobian may be outdated.
            if self.is_current || !self.differentiate(system, step, scale)? {
                return Ok(f64::INFINITY);
            }
        }
        for (i, end) in step.x_end.iter_mut().enumerate() {
            *end = step.x[i] + self.z[STAGES - 1][i];
        }
        self.error(system, step, scale)
    }

    fn accept<M: System>(&mut self, system: &mut M, step: &mut Step) -> Result<bool, M::Error> {
        self.keep(step);
        system.derivatives(step.t + step.h, step.x_end, step.f_end)
    }

    fn interpolate(&self, _: &Step, theta: f64, x: &mut [f64]) {
        if let Some(dense) = &self.dense {
            for (i, x) in x.iter_mut().enumerate() {
                *x = dense.at(theta, i, &self.begin);
            }
        }
    }

    /// With many iterations the step is shortened, since it then converges better.
    fn factor(&self, error: f64, _: Option<f64>) -> f64 {
        let safety = 0.9 * 13.0 / (12.0 + f64::from(self.iterations));
        match safety * error.powf(-0.25) {
            factor if self.keeps_length && (1.0..1.2).contains(&factor) => 1.0,
            factor => factor,
        }
    }

    fn restart(&mut self) {
        self.dense = None;
        self.factors = None;
        self.is_current = false;
    }

    fn count(&self, work: &mut Work) {
        work.jacobians += self.jacobians;
        work.factorisations += self.factorisations;
    }
}

impl Dense {
    fn at(&self, theta: f64, i: usize, begin: &[f64]) -> f64 {
        let [a, b, c] = &self.coefficients;
        begin[i] + theta * (a[i] + theta * (b[i] + theta * c[i]))
    }
}

/// `to = matrix · from`, over the stages.
fn apply(matrix: &[[f64; STAGES]; STAGES], from: &[Vec<f64>; STAGES], to: &mut [Vec<f64>; STAGES]) {
    for (row, to) in matrix.iter().zip(to) {
        for (i, to) in to.iter_mut().enumerate() {
            *to = row.iter().zip(from).map(|(m, from)| m * from[i]).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// Runge–Kutta matrix of the collocation method with nodes `C`: integrals of the Lagrange polynomials.
    fn stages() -> Matrix3<f64> {
        let powers = Matrix3::from_fn(|i, j| C[i].powi(j as i32));
        let integrals = Matrix3::from_fn(|i, j| C[i].powi(j as i32 + 1) / (j + 1) as f64);
        integrals * powers.try_inverse().unwrap()
    }

    #[test]
    fn coefficients_follow_from_the_nodes() {
        let inverse = stages().try_inverse().unwrap();
        let rows = |m: [[f64; 3]; 3]| Matrix3::from_fn(|i, j| m[i][j]);
        let (a, b) = (COMPLEX.re, -COMPLEX.im);
        let blocks = Matrix3::new(REAL, 0.0, 0.0, 0.0, a, b, 0.0, -b, a);
        assert!((rows(T) * blocks * rows(T_INVERSE) - inverse).norm() < 1e-13);
        assert!((rows(T) * rows(T_INVERSE) - Matrix3::identity()).norm() < 1e-14);
        // The collocation polynomial is zero at the start and takes the value of each stage at its node.
        let nodes = Matrix3::from_fn(|i, j| C[i].powi(j as i32 + 1));
        assert!((nodes * rows(P).transpose() - Matrix3::identity()).norm() < 1e-13);
    }
}
