//! Bernstein polynomials: the unknowns are coefficients, not states.
//!
//! Cichella, Kaminer, Walton, Hovakimyan & Pascoal require the derivative of the polynomial of degree `d` to satisfy
//! the ODE at the equidistant times `k/d`, `k = 0..=d`, up to a tolerance that decreases with `d`: `d + 1` conditions
//! for `d` unknown coefficients. Here the conditions hold exactly, and the one at the start is omitted. The polynomial
//! is then the collocation polynomial of the implicit Runge–Kutta method with stages at `1/d .. 1`, of order `d`, which
//! is backward Euler for `d = 1`. The Bernstein basis changes which numbers are unknown, not the result.
//!
//! Stiff modes are fully damped for every degree, but only `d` = 1 and 2 are stable in the whole left half-plane. From
//! `d` = 3 on, weakly damped oscillations that are too fast for the element may grow: by 2.7 % per element at
//! `λh = ±2i` for `d` = 3, by 180 % at `±6.3i` for `d` = 5. Gauss and Radau have no such region.

use super::{Defect, Interpolant, Point, Tableau, Value, row};

/// The tableau for degree `d`.
pub(super) fn bernstein(d: usize) -> Tableau {
    let place = |k: usize| k as f64 / d as f64;
    let point = |k: usize| Point {
        c: place(k),
        value: match k {
            k if k == d => Value::Unknown(d),
            k => Value::Combination(row(basis(d, place(k)))),
        },
    };
    let defect = |k: usize| Defect {
        e: row(derivative(d, place(k))),
        a: vec![(k - 1, 1.0)],
    };
    Tableau {
        abscissae: (0..=d).map(place).collect(),
        points: (1..=d).map(point).collect(),
        defects: (1..=d).map(defect).collect(),
        interpolant: Interpolant::Bernstein,
    }
}

/// The `d + 1` Bernstein polynomials of degree `d` at `c`, by successive degree elevation.
pub(super) fn basis(d: usize, c: f64) -> Vec<f64> {
    let mut b = vec![1.0];
    for _ in 0..d {
        let left = b.iter().map(|v| v * (1.0 - c)).chain([0.0]);
        let right = [0.0].into_iter().chain(b.iter().map(|v| v * c));
        b = left.zip(right).map(|(l, r)| l + r).collect();
    }
    b
}

/// Their derivatives `d (B_(j-1) - B_j)`, from the polynomials of degree `d - 1` (Farouki, *The Bernstein polynomial
/// basis: a centennial retrospective*, CAGD 29, 2012).
fn derivative(d: usize, c: f64) -> Vec<f64> {
    let lower = basis(d - 1, c);
    let before = [0.0].into_iter().chain(lower.iter().copied());
    let here = lower.iter().copied().chain([0.0]);
    before.zip(here).map(|(b, h)| d as f64 * (b - h)).collect()
}
