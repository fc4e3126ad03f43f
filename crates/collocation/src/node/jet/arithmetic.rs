//! The operators of a [`Jet`].

use super::Jet;
use crate::lanes::LANES;
use num_traits::{Inv, Num, One, Signed, Zero};
use std::cmp::Ordering;
use std::iter::{Product, Sum};
use std::ops::{
    Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign,
};

/// An operator between two jets, and between a jet and what it refers to or a number.
macro_rules! operator {
    ($name:ident $method:ident, $assign:ident $assign_method:ident, $jets:expr, $number:expr) => {
        impl<const N: usize, const M: usize> $name for Jet<N, M> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $jets(self, other)
            }
        }

        impl<const N: usize, const M: usize> $name<&Self> for Jet<N, M> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: &Self) -> Self {
                $jets(self, *other)
            }
        }

        impl<const N: usize, const M: usize> $name<f64> for Jet<N, M> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                $number(self, other)
            }
        }

        impl<const N: usize, const M: usize> $assign for Jet<N, M> {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = $jets(*self, other);
            }
        }

        impl<const N: usize, const M: usize> $assign<f64> for Jet<N, M> {
            #[inline(always)]
            fn $assign_method(&mut self, other: f64) {
                *self = $number(*self, other);
            }
        }
    };
}

operator!(Add add, AddAssign add_assign, Self::sum, Self::raised);
operator!(Sub sub, SubAssign sub_assign, Self::difference, Self::lowered);
operator!(Mul mul, MulAssign mul_assign, Self::product, Self::multiple);
operator!(Div div, DivAssign div_assign, Self::quotient, Self::fraction);
operator!(Rem rem, RemAssign rem_assign, Self::remainder, Self::remainder_by);

impl<const N: usize, const M: usize> Jet<N, M> {
    #[inline(always)]
    fn sum(self, other: Self) -> Self {
        self.both(other, |a, b| a + b)
    }

    #[inline(always)]
    fn difference(self, other: Self) -> Self {
        self.both(other, |a, b| a - b)
    }

    #[inline(always)]
    fn raised(mut self, by: f64) -> Self {
        self.value.iter_mut().for_each(|v| *v += by);
        self
    }

    #[inline(always)]
    fn lowered(mut self, by: f64) -> Self {
        self.value.iter_mut().for_each(|v| *v -= by);
        self
    }

    #[inline(always)]
    fn multiple(self, factor: f64) -> Self {
        self.each(|v| v * factor)
    }

    #[inline(always)]
    fn fraction(self, divisor: f64) -> Self {
        self.each(|v| v / divisor)
    }

    #[inline(always)]
    fn remainder_by(self, divisor: f64) -> Self {
        self.remainder(Self::from(divisor))
    }

    #[inline(always)]
    fn quotient(self, other: Self) -> Self {
        if N == 0 {
            // One rounding, as numbers have.
            return self.both(other, |a, b| a / b);
        }
        self.product(other.inv())
    }

    /// `a - b trunc(a/b)`.
    #[inline(always)]
    fn remainder(self, other: Self) -> Self {
        let whole = self.both(other, |a, b| (a / b).trunc()).value;
        self - other.product(Self::constant(whole))
    }
}

impl<const N: usize, const M: usize> Neg for Jet<N, M> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|v| -v)
    }
}

impl<const N: usize, const M: usize> From<f64> for Jet<N, M> {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self::constant([value; LANES])
    }
}

impl<const N: usize, const M: usize> Zero for Jet<N, M> {
    #[inline(always)]
    fn zero() -> Self {
        Self::from(0.0)
    }

    fn is_zero(&self) -> bool {
        self.common(|v| v == 0.0)
    }
}

impl<const N: usize, const M: usize> One for Jet<N, M> {
    #[inline(always)]
    fn one() -> Self {
        Self::from(1.0)
    }
}

impl<const N: usize, const M: usize> Inv for Jet<N, M> {
    type Output = Self;
    #[inline(always)]
    fn inv(self) -> Self {
        num_dual::DualNum::recip(&self)
    }
}

impl<const N: usize, const M: usize> Sum for Jet<N, M> {
    #[inline(always)]
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Self::zero(), |sum, term| sum + term)
    }
}

impl<const N: usize, const M: usize> Product for Jet<N, M> {
    #[inline(always)]
    fn product<I: Iterator<Item = Self>>(factors: I) -> Self {
        factors.fold(Self::one(), |product, factor| product * factor)
    }
}

impl<const N: usize, const M: usize> Num for Jet<N, M> {
    type FromStrRadixErr = num_traits::ParseFloatError;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::from)
    }
}

/// Comparisons are made on the values, as those of dual numbers.
impl<const N: usize, const M: usize> PartialEq for Jet<N, M> {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl<const N: usize, const M: usize> PartialEq<f64> for Jet<N, M> {
    fn eq(&self, other: &f64) -> bool {
        self.common(|v| v == *other)
    }
}

impl<const N: usize, const M: usize> PartialOrd for Jet<N, M> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        (*self - *other).common(|v| v.partial_cmp(&0.0))
    }
}

impl<const N: usize, const M: usize> PartialOrd<f64> for Jet<N, M> {
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.common(|v| v.partial_cmp(other))
    }
}

impl<const N: usize, const M: usize> Signed for Jet<N, M> {
    #[inline(always)]
    fn abs(&self) -> Self {
        *self * self.signum()
    }

    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        (difference + difference.abs()) * 0.5
    }

    #[inline(always)]
    fn signum(&self) -> Self {
        let sign = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
        Self::constant(self.value.map(sign))
    }

    fn is_positive(&self) -> bool {
        self.common(|v| v > 0.0)
    }

    fn is_negative(&self) -> bool {
        self.common(|v| v < 0.0)
    }
}
