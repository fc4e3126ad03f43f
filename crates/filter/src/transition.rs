//! Exact transition of a linear system with white noise over a time.

use crate::matrix::Matrix;

/// Norm of `F τ` up to which the series is used.
const SMALL: f64 = 0.25;
/// Number of terms of the series: the remainder is below 10⁻¹⁷ if twice the norm is at most a half.
const TERMS: usize = 15;
/// Relative difference up to which two times are equal: times from files have rounding errors.
const SAME: f64 = 1e-10;
/// Maximum number of doublings; beyond it the result has no correct digits.
const MOST: i32 = 60;

/// Transition of `ẋ = F x + b + c t + w`, with `w` white of density `Q`, over a time `h`: the state is
/// `Φ x + Ψ₁ b + Ψ₂ c`, and its covariance `Φ P Φᵀ + D`.
#[derive(Debug, Clone)]
pub struct Transition<const N: usize> {
    f: Matrix<N>,
    q: Matrix<N>,
    h: f64,
    /// `Φ = e^{Fh}`.
    pub phi: Matrix<N>,
    /// `Ψ₁ = ∫₀ʰ e^{Fs} ds`.
    pub constant: Matrix<N>,
    /// `Ψ₂ = ∫₀ʰ e^{F(h-s)} s ds`.
    pub slope: Matrix<N>,
    /// `D = ∫₀ʰ e^{Fs} Q e^{Fᵀs} ds`.
    pub noise: Matrix<N>,
}

impl<const N: usize> Transition<N> {
    /// The transition over a time `h`, by the series over a part of it, which is doubled until it is `h` (scaling and
    /// squaring). Unlike Van Loan's block matrix (IEEE Trans. Automat. Contr. 23, 1978) it does not contain `e^{-Fh}`,
    /// which overflows for fast poles.
    pub fn over(f: Matrix<N>, q: Matrix<N>, h: f64) -> Self {
        let ratio = f.norm() * h / SMALL;
        let doublings = match ratio > 1.0 {
            true => ratio.log2().ceil().min(f64::from(MOST)) as i32,
            false => 0,
        };
        let mut own = Self::series(f, q, h / f64::from(doublings).exp2());
        (0..doublings).for_each(|_| own.double());
        own.h = h;
        own
    }

    /// Whether it is the transition of this system over this time.
    pub fn is_of(&self, f: &Matrix<N>, q: &Matrix<N>, h: f64) -> bool {
        (self.h - h).abs() <= SAME * h && self.f == *f && self.q == *q
    }

    fn series(f: Matrix<N>, q: Matrix<N>, h: f64) -> Self {
        let size = f.rows();
        // F^k h^k / k!, and the k-th derivative of D times h^k / k!.
        let (mut term, mut noise) = (Matrix::identity(size), q.scaled(h));
        let mut own = Self {
            phi: term.clone(),
            constant: term.scaled(h),
            slope: term.scaled(0.5 * h * h),
            noise: noise.clone(),
            f,
            q,
            h,
        };
        for k in 1..=TERMS {
            let n = k as f64;
            term = own.f.times(&term).scaled(h / n);
            own.phi.add(&term);
            own.constant.add(&term.scaled(h / (n + 1.0)));
            let second = h * h / ((n + 1.0) * (n + 2.0));
            own.slope.add(&term.scaled(second));
            let moved = own.f.times(&noise);
            noise = moved.transposed();
            noise.add(&moved);
            noise = noise.scaled(h / (n + 1.0));
            own.noise.add(&noise);
        }
        own
    }

    /// Doubles the time.
    fn double(&mut self) {
        let h = self.h;
        let around = self.phi.around(&self.noise);
        self.noise.add(&around);
        let slope = self.phi.times(&self.slope);
        self.slope.add(&slope);
        self.slope.add(&self.constant.scaled(h));
        let constant = self.phi.times(&self.constant);
        self.constant.add(&constant);
        self.phi = self.phi.times(&self.phi);
        self.h = 2.0 * h;
    }
}
