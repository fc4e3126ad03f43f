//! Numbers with derivatives with respect to `N` variables, cheap enough for matrix products.

use nalgebra::{Const, SVector};
use num_dual::{Derivative, DualNum, DualSVec64};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A value and its derivatives with respect to `N` variables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<const N: usize> {
    /// The value.
    pub value: f64,
    /// Its derivatives.
    pub slopes: [f64; N],
}

impl<const N: usize> Jet<N> {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self {
            value,
            slopes: [0.0; N],
        }
    }

    /// The product with a number.
    #[inline]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: factor * self.value,
            slopes: self.slopes.map(|own| factor * own),
        }
    }

    #[inline]
    fn with(self, other: Self, value: f64, slope: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            value,
            slopes: std::array::from_fn(|k| slope(self.slopes[k], other.slopes[k])),
        }
    }
}

/// The product rule contains a sum.
#[inline]
fn sum(a: f64, b: f64) -> f64 {
    a + b
}

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.with(other, self.value + other.value, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.with(other, self.value - other.value, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Jet<N> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        self.with(other, self.value * other.value, |a, b| {
            sum(a * other.value, self.value * b)
        })
    }
}

impl<const N: usize> Div for Jet<N> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let (ratio, inverse) = (self.value / other.value, 1.0 / other.value);
        self.with(other, ratio, |a, b| (a - ratio * b) * inverse)
    }
}

impl<const N: usize> Neg for Jet<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.scaled(-1.0)
    }
}

impl<const N: usize> AddAssign for Jet<N> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Jet<N> {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// Number types for the evaluation of tapes, convertible to and from jets with `N` derivatives.
pub(crate) trait Number<const N: usize>: DualNum<Primitive = f64> + Copy {
    /// The number of a jet.
    fn of(jet: Jet<N>) -> Self;
    /// The jet of a number.
    fn jet(self) -> Jet<N>;
}

impl Number<0> for f64 {
    fn of(jet: Jet<0>) -> Self {
        jet.value
    }

    fn jet(self) -> Jet<0> {
        Jet::constant(self)
    }
}

impl<const N: usize> Number<N> for DualSVec64<N> {
    fn of(jet: Jet<N>) -> Self {
        Self::new(jet.value, Derivative::some(SVector::from(jet.slopes)))
    }

    fn jet(self) -> Jet<N> {
        Jet {
            value: self.re,
            slopes: self.eps.unwrap_generic(Const::<N>, Const::<1>).into(),
        }
    }
}
