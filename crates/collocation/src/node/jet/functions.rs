//! The functions of a [`Jet`], by the derivatives that `num_dual` knows, and what else makes it a number of
//! the models.

use super::Jet;
use num_dual::{DualNum, DualStruct, Mappable};
use num_traits::FromPrimitive;
use std::fmt;

/// Functions of one variable.
macro_rules! functions {
    ($($name:ident)*) => {$(
        #[inline(always)]
        fn $name(&self) -> Self {
            self.function(|v| DualNum::$name(&v), |v| v.$name())
        }
    )*};
}

impl<const N: usize, const M: usize> DualNum for Jet<N, M> {
    type Primitive = f64;
    const NDERIV: usize = if N == 0 { 0 } else { 1 + (M > 0) as usize };
    type InnerDual = f64;

    #[inline(always)]
    fn from_re(re: f64) -> Self {
        Self::from(re)
    }

    #[inline(always)]
    fn scale(self, factor: &f64) -> Self {
        self * *factor
    }

    functions! {
        recip sqrt cbrt exp exp2 exp_m1 ln log2 log10 ln_1p sin cos tan asin acos atan sinh cosh tanh
        asinh acosh atanh sph_j0 sph_j1 sph_j2
    }

    #[inline(always)]
    fn powi(&self, n: i32) -> Self {
        self.function(|v| v.powi(n), |v| v.powi(n))
    }

    #[inline(always)]
    fn powf(&self, n: f64) -> Self {
        self.function(|v| v.powf(n), |v| v.powf(n))
    }

    #[inline(always)]
    fn log(&self, base: f64) -> Self {
        self.function(|v| v.log(base), |v| v.log(base))
    }

    #[inline(always)]
    fn sin_cos(&self) -> (Self, Self) {
        (self.sin(), self.cos())
    }

    /// The angle of `(x, y)` has the derivatives of `atan(y/x)`.
    fn atan2(&self, other: Self) -> Self {
        let angles = std::array::from_fn(|l| self.value[l].atan2(other.value[l]));
        let mut angle = (*self / other).atan();
        angle.value = angles;
        angle
    }
}

impl<const N: usize, const M: usize> DualStruct for Jet<N, M> {
    type Real = f64;
    type Inner = f64;

    fn re(&self) -> f64 {
        self.common(|v| v)
    }

    fn from_inner(inner: &f64) -> Self {
        Self::from(*inner)
    }
}

impl<const N: usize, const M: usize> Mappable<Self> for Jet<N, M> {
    type Output<O> = O;

    fn map_dual<G: Fn(Self) -> O, O>(self, g: G) -> O {
        g(self)
    }
}

impl<const N: usize, const M: usize> FromPrimitive for Jet<N, M> {
    fn from_i64(n: i64) -> Option<Self> {
        f64::from_i64(n).map(Self::from)
    }

    fn from_u64(n: u64) -> Option<Self> {
        f64::from_u64(n).map(Self::from)
    }

    fn from_f64(n: f64) -> Option<Self> {
        Some(Self::from(n))
    }
}

impl<const N: usize, const M: usize> fmt::Display for Jet<N, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.value)
    }
}
