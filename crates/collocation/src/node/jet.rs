//! Values with first and second derivatives by a few variables (Taylor series cut off behind the second
//! order: Griewank & Walther, *Evaluating Derivatives*, 2nd ed. 2008, chapter 13), at several points at
//! once.

use crate::lanes::{LANES, Lanes};
use num_dual::Dual2_64;

mod arithmetic;
mod functions;

/// A number at each of a group of points: its value, its derivatives by `N` variables and the `M` second
/// ones by pairs `i ≤ j` of them, row by row. `M` is `N (N + 1) / 2`, or 0 where no second derivatives
/// are wanted.
#[derive(Debug, Clone, Copy)]
pub struct Jet<const N: usize, const M: usize> {
    /// The values.
    pub value: Lanes,
    /// First derivatives.
    pub first: [Lanes; N],
    /// Second derivatives.
    pub second: [Lanes; M],
}

impl<const N: usize, const M: usize> Jet<N, M> {
    /// The variables of each second derivative.
    pub const PAIRS: [(usize, usize); M] = {
        assert!(M == 0 || M == N * (N + 1) / 2);
        let mut pairs = [(0, 0); M];
        let (mut i, mut j, mut k) = (0, 0, 0);
        while k < M {
            pairs[k] = (i, j);
            j += 1;
            if j == N {
                i += 1;
                j = i;
            }
            k += 1;
        }
        pairs
    };

    /// Numbers that depend on none of the variables.
    #[inline(always)]
    pub fn constant(value: Lanes) -> Self {
        Self {
            value,
            first: [[0.0; LANES]; N],
            second: [[0.0; LANES]; M],
        }
    }

    /// Every part by itself.
    #[inline(always)]
    fn each(mut self, of: impl Fn(f64) -> f64) -> Self {
        let apply = |lanes: &mut Lanes| lanes.iter_mut().for_each(|v| *v = of(*v));
        apply(&mut self.value);
        self.first.iter_mut().for_each(apply);
        self.second.iter_mut().for_each(apply);
        self
    }

    /// Pairs of parts by themselves.
    #[inline(always)]
    fn both(mut self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let apply = |(own, other): (&mut Lanes, &Lanes)| {
            let pairs = own.iter_mut().zip(other);
            pairs.for_each(|(own, other)| *own = of(*own, *other));
        };
        apply((&mut self.value, &other.value));
        self.first.iter_mut().zip(&other.first).for_each(apply);
        self.second.iter_mut().zip(&other.second).for_each(apply);
        self
    }

    /// The product rule.
    #[inline(always)]
    fn product(self, other: Self) -> Self {
        let (a, b, mut out) = (self.value, other.value, self);
        for l in 0..LANES {
            out.value[l] = a[l] * b[l];
        }
        for i in 0..N {
            let (da, db) = (self.first[i], other.first[i]);
            for l in 0..LANES {
                out.first[i][l] = da[l].mul_add(b[l], a[l] * db[l]);
            }
        }
        for (k, (i, j)) in Self::PAIRS.into_iter().enumerate() {
            let (ai, aj, aij) = (self.first[i], self.first[j], self.second[k]);
            let (bi, bj, bij) = (other.first[i], other.first[j], other.second[k]);
            for l in 0..LANES {
                let twice = ai[l].mul_add(bj[l], aj[l] * bi[l]);
                out.second[k][l] = aij[l].mul_add(b[l], a[l].mul_add(bij[l], twice));
            }
        }
        out
    }

    /// The chain rule for a function with these values and derivatives.
    #[inline(always)]
    fn chain(self, value: Lanes, by: Lanes, twice: Lanes) -> Self {
        let mut out = self;
        out.value = value;
        for first in &mut out.first {
            for l in 0..LANES {
                first[l] *= by[l];
            }
        }
        for (k, (i, j)) in Self::PAIRS.into_iter().enumerate() {
            let (di, dj) = (self.first[i], self.first[j]);
            for l in 0..LANES {
                out.second[k][l] = by[l].mul_add(out.second[k][l], twice[l] * (di[l] * dj[l]));
            }
        }
        out
    }

    /// A function of one variable, given for numbers and for those with two derivatives.
    #[inline(always)]
    fn function(
        self,
        plain: impl Fn(f64) -> f64,
        with_derivatives: impl Fn(Dual2_64) -> Dual2_64,
    ) -> Self {
        let (mut value, mut by, mut twice) = (self.value, self.value, self.value);
        let parts = value.iter_mut().zip(&mut by).zip(&mut twice);
        for ((value, by), twice) in parts {
            if N == 0 {
                *value = plain(*value);
            } else {
                let at = with_derivatives(Dual2_64::new(*value, 1.0, 0.0));
                (*value, *by, *twice) = (at.re, at.v1, at.v2);
            }
        }
        self.chain(value, by, twice)
    }

    /// A property that all points share.
    ///
    /// # Panics
    /// If they do not: equations at several points at once cannot take different ways.
    fn common<T: PartialEq>(self, of: impl Fn(f64) -> T) -> T {
        let [first, rest @ ..] = self.value.map(of);
        assert!(
            rest.iter().all(|own| *own == first),
            "the model's equations compare numbers, and several points are evaluated at once"
        );
        first
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{DualNum, HyperDual64};

    /// Any expression of x and y, generic as the models are.
    fn expression<T: DualNum<Primitive = f64> + Copy>(x: T, y: T) -> T {
        let angle = (x * y + 0.3).sin() - y.exp() / (x * x + 2.0);
        let power = (x + 3.0).powi(3) * y.atan2(x + 4.0) - y.tanh() * 0.7;
        angle * power.cos() + (x + 5.0).sqrt().recip() + (-x).powf(2.0) * (y + 2.0).ln()
    }

    #[test]
    fn derivatives_are_those_of_hyper_dual_numbers() {
        let points = [(-0.7, 0.2), (-0.1, 1.1), (-1.3, -0.4), (-0.5, 0.0)];
        let unit = |own: usize| -> [Lanes; 2] {
            std::array::from_fn(|i| [f64::from(u8::from(i == own)); LANES])
        };
        let variable = |own: usize| {
            let at = |l: usize| [points[l % 4].0, points[l % 4].1][own];
            Jet::<2, 3> {
                value: std::array::from_fn(at),
                first: unit(own),
                second: [[0.0; LANES]; 3],
            }
        };
        let jet = expression(variable(0), variable(1));
        let plain = expression(
            Jet::<0, 0>::constant(variable(0).value),
            Jet::<0, 0>::constant(variable(1).value),
        );
        // Functions of numbers may round otherwise where the compiler evaluates them.
        for (plain, full) in plain.value.iter().zip(jet.value) {
            assert!((plain - full).abs() <= 2.0 * f64::EPSILON * full.abs());
        }
        for lane in 0..LANES {
            let (x, y) = points[lane % 4];
            for (k, &(i, j)) in Jet::<2, 3>::PAIRS.iter().enumerate() {
                let part = |own: usize, of: usize| f64::from(u8::from(own == of));
                let exact = expression(
                    HyperDual64::new(x, part(0, i), part(0, j), 0.0),
                    HyperDual64::new(y, part(1, i), part(1, j), 0.0),
                );
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-13 * (1.0 + b.abs());
                assert!(near(jet.value[lane], exact.re));
                assert!(near(jet.first[i][lane], exact.eps1));
                assert!(near(jet.first[j][lane], exact.eps2));
                assert!(near(jet.second[k][lane], exact.eps1eps2), "{i} {j}");
            }
        }
    }

    #[test]
    fn points_that_agree_may_be_compared() {
        let jet = |value: Lanes| Jet::<0, 0>::constant(value);
        let mut value = [2.0; LANES];
        assert!(jet(value) > 1.5 && jet(value) < jet([3.0; LANES]));
        value[LANES - 1] = 1.0;
        let differing = std::panic::catch_unwind(|| jet(value) > 1.5);
        assert!(differing.is_err());
    }
}
