//! Nonlinear programs with known answers, each of which shows one thing.

use num_dual::HyperDual64 as H;

/// What is known of a problem.
pub enum Answer {
    /// The optimal value, and the point where it is unique.
    Optimum { f: f64, z: &'static [f64] },
    /// An optimum where no multipliers exist, so that the KKT residual cannot vanish.
    NotKkt { f: f64, z: &'static [f64] },
    /// The constraints have no common point near: a local minimum of their ℓ1 violation.
    Infeasible { violation: f64 },
    /// The objective has no lower bound.
    Unbounded,
    /// A saddle that cannot be left: beside it the problem is not defined.
    Saddle { z: &'static [f64] },
}

/// One problem: `f(z)` is returned, `c` and `g` are pushed.
pub struct Example {
    pub name: &'static str,
    pub source: &'static str,
    pub functions: fn(&[H], &mut Vec<H>, &mut Vec<H>) -> H,
    pub limits: &'static [(f64, f64)],
    pub start: &'static [f64],
    pub answer: Answer,
}

pub const INF: f64 = f64::INFINITY;
pub const POSITIVE: (f64, f64) = (0.0, INF);

pub fn square(x: H) -> H {
    x * x
}

/// All of them.
pub fn examples() -> Vec<Example> {
    use Answer::{Infeasible, Optimum, Saddle, Unbounded};
    vec![
        Example {
            name: "Maratos",
            source: "Nocedal and Wright, Numerical Optimization, 2nd ed. 2006, example 15.4: a merit \
                     function forbids the full step without a second-order correction",
            functions: |z, c, _| {
                let outside = square(z[0]) + square(z[1]) - 1.0;
                c.push(outside);
                outside * 2.0 - z[0]
            },
            limits: &[],
            start: &[0.8, 0.6],
            answer: Optimum {
                f: -1.0,
                z: &[1.0, 0.0],
            },
        },
        Example {
            name: "Wächter-Biegler",
            source: "Wächter and Biegler, Failure of global convergence for a class of interior point \
                     methods, Math. Program. 88, 2000: the optimum \
 is x₁ = 1, but the start lies by the local minimum 3/2 of the violation at x₁ = -1",
            functions: |z, c, g| {
                c.push(square(z[0]) - z[1] - 1.0);
                c.push(z[0] - z[2] - 0.5);
                g.extend([z[1], z[2]]);
                z[0]
            },
            limits: &[POSITIVE, POSITIVE],
            start: &[-2.0, 3.0, 1.0],
            answer: Infeasible { violation: 1.5 },
        },
        Example {
            name: "linear program",
            source: "max x + 2y, x + y ≤ 4, x + 3y ≤ 6, x, y ≥ 0, by its vertices: (3, 1)",
            functions: |z, _, g| {
                g.extend([z[0] + z[1], z[0] + z[1] * 3.0, z[0], z[1]]);
                -z[0] - z[1] * 2.0
            },
            limits: &[(-INF, 4.0), (-INF, 6.0), POSITIVE, POSITIVE],
            start: &[0.0, 0.0],
            answer: Optimum {
                f: -5.0,
                z: &[3.0, 1.0],
            },
        },
        Example {
            name: "equality as g",
            source: "min x² + y², 1 ≤ x + y ≤ 1: an equality among the inequalities; (1/2, 1/2)",
            functions: |z, _, g| {
                g.push(z[0] + z[1]);
                square(z[0]) + square(z[1])
            },
            limits: &[(1.0, 1.0)],
            start: &[3.0, -4.0],
            answer: Optimum {
                f: 0.5,
                z: &[0.5, 0.5],
            },
        },
        Example {
            name: "equality twice",
            source: "min (x - 2)² + y², x² + y² = 1 given twice: dependent equalities; (1, 0)",
            functions: |z, c, _| {
                let outside = square(z[0]) + square(z[1]) - 1.0;
                c.extend([outside, outside * 2.0]);
                square(z[0] - 2.0) + square(z[1])
            },
            limits: &[],
            start: &[0.5, 0.5],
            answer: Optimum {
                f: 1.0,
                z: &[1.0, 0.0],
            },
        },
        Example {
            name: "idle bounds",
            source: "min x² + (y - 1)², x ≥ 0, y ≤ 1: strict complementarity fails, both bounds are active \
                     without a multiplier",
            functions: |z, _, g| {
                g.extend([z[0], z[1]]);
                square(z[0]) + square(z[1] - 1.0)
            },
            limits: &[POSITIVE, (-INF, 1.0)],
            start: &[2.0, -1.0],
            answer: Optimum {
                f: 0.0,
                z: &[0.0, 1.0],
            },
        },
        Example {
            name: "gap",
            source: "x ≤ 0 and x ≥ 1: inconsistent bounds",
            functions: |z, _, g| {
                g.extend([z[0], z[0]]);
                square(z[0] - 3.0)
            },
            limits: &[(-INF, 0.0), (1.0, INF)],
            start: &[5.0],
            answer: Infeasible { violation: 1.0 },
        },
        Example {
            name: "parallel lines",
            source: "x = 0 and x = 1",
            functions: |z, c, _| {
                c.extend([z[0], z[0] - 1.0]);
                square(z[0]) + square(z[1])
            },
            limits: &[],
            start: &[3.0, 1.0],
            answer: Infeasible { violation: 1.0 },
        },
        Example {
            name: "line and disc",
            source: "x² + y² ≤ 1 and x + y = 3 have no common point",
            functions: |z, c, g| {
                c.push(z[0] + z[1] - 3.0);
                g.push(square(z[0]) + square(z[1]));
                z[0]
            },
            limits: &[(-INF, 1.0)],
            start: &[0.0, 0.0],
            answer: Infeasible {
                violation: 3.0 - std::f64::consts::SQRT_2,
            },
        },
        Example {
            name: "isolated",
            source: "Byrd, Curtis and Nocedal, Infeasibility detection and SQP methods, SIAM J. Optim. \
                     20, 2010, section 5: infeasible stationary point (0, 0)",
            functions: |z, _, g| {
                g.push(-square(z[0]) + z[1] - 1.0);
                g.push(-square(z[0]) - z[1] - 1.0);
                g.push(z[0] - square(z[1]) - 1.0);
                g.push(-z[0] - square(z[1]) - 1.0);
                z[0] + z[1]
            },
            limits: &[POSITIVE; 4],
            start: &[3.0, 2.0],
            answer: Infeasible { violation: 4.0 },
        },
        Example {
            name: "half line",
            source: "min -x - y, x = y: linear, unbounded",
            functions: |z, c, _| {
                c.push(z[0] - z[1]);
                -z[0] - z[1]
            },
            limits: &[],
            start: &[0.0, 0.0],
            answer: Unbounded,
        },
        Example {
            name: "saddle",
            source: "min x² - y² from beside the ridge: unbounded along y",
            functions: |z, _, g| {
                g.push(z[0]);
                square(z[0]) - square(z[1])
            },
            limits: &[(-1.0, 1.0)],
            start: &[0.5, 0.1],
            answer: Unbounded,
        },
        Example {
            name: "ridge",
            source: "min x² - y² + y⁴ from its ridge y = 0, whose KKT point is a saddle: y = ±1/√2",
            functions: |z, _, _| square(z[0]) - square(z[1]) + square(square(z[1])),
            limits: &[],
            start: &[1.0, 0.0],
            answer: Optimum { f: -0.25, z: &[] },
        },
        Example {
            name: "start on saddle",
            source: "min x² - y² + y⁴ from the saddle itself",
            functions: |z, _, _| square(z[0]) - square(z[1]) + square(square(z[1])),
            limits: &[],
            start: &[0.0, 0.0],
            answer: Optimum { f: -0.25, z: &[] },
        },
        Example {
            name: "half ridge",
            source: "as ridge, with y ≥ 0, which is weakly active at the saddle: y = 1/√2",
            functions: |z, _, g| {
                g.push(z[1]);
                square(z[0]) - square(z[1]) + square(square(z[1]))
            },
            limits: &[POSITIVE],
            start: &[1.0, 0.0],
            answer: Optimum {
                f: -0.25,
                z: &[0.0, std::f64::consts::FRAC_1_SQRT_2],
            },
        },
        Example {
            name: "corner",
            source: "min -xy + x⁴ + y⁴, x, y ≥ 0, from (0, 0), where both bounds are weakly active and only \
                     directions inside both have negative curvature: x = y = 1/2",
            functions: |z, _, g| {
                g.extend([z[0], z[1]]);
                square(square(z[0])) + square(square(z[1])) - z[0] * z[1]
            },
            limits: &[POSITIVE, POSITIVE],
            start: &[0.0, 0.0],
            answer: Optimum {
                f: -0.125,
                z: &[0.5, 0.5],
            },
        },
        Example {
            name: "copositive",
            source: "min x² + y² + 3xy + x⁴, x, y ≥ 0, from (1, 1): the Hessian at (0, 0) is indefinite, but \
                     positive in the quadrant",
            functions: |z, _, g| {
                g.extend([z[0], z[1]]);
                square(z[0]) + square(z[1]) + z[0] * z[1] * 3.0 + square(square(z[0]))
            },
            limits: &[POSITIVE, POSITIVE],
            start: &[1.0, 1.0],
            answer: Optimum {
                f: 0.0,
                z: &[0.0, 0.0],
            },
        },
        Example {
            name: "pole of circle",
            source: "min x² + 2y² on the unit circle from its pole (0, 1), which is the maximum: (±1, 0)",
            functions: |z, c, _| {
                c.push(square(z[0]) + square(z[1]) - 1.0);
                square(z[0]) + square(z[1]) * 2.0
            },
            limits: &[],
            start: &[0.0, 1.0],
            answer: Optimum { f: 1.0, z: &[] },
        },
        Example {
            name: "pole of disc",
            source: "min x² + 2y² outside of the unit disc, from above its pole (0, 1), a saddle where the \
                     strongly active disc is curved: (±1, 0)",
            functions: |z, _, g| {
                g.push(square(z[0]) + square(z[1]));
                square(z[0]) + square(z[1]) * 2.0
            },
            limits: &[(1.0, INF)],
            start: &[0.0, 2.0],
            answer: Optimum { f: 1.0, z: &[] },
        },
        Example {
            name: "bounded ridge",
            source: "min x² - y², |y| ≤ 2, from the ridge: y = ±2",
            functions: |z, _, g| {
                g.push(z[1]);
                square(z[0]) - square(z[1])
            },
            limits: &[(-2.0, 2.0)],
            start: &[1.0, 0.0],
            answer: Optimum { f: -4.0, z: &[] },
        },
        Example {
            name: "knife edge",
            source: "min x² - y² where y = 0, not defined elsewhere",
            functions: |z, _, _| {
                let beside = if z[1].re == 0.0 { 0.0 } else { f64::NAN };
                square(z[0]) - square(z[1]) + beside
            },
            limits: &[],
            start: &[1.0, 0.0],
            answer: Saddle { z: &[0.0, 0.0] },
        },
    ]
}
