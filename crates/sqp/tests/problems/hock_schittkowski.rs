//! HS n: W. Hock and K. Schittkowski, *Test Examples for Nonlinear Programming Codes*, Lecture Notes in
//! Economics and Mathematical Systems 187, Springer 1981, with their starts and their optima.

use super::library::{Answer, Example, INF, POSITIVE, square};
use num_dual::DualNum;
use num_dual::HyperDual64 as H;

fn rosenbrock(z: &[H]) -> H {
    square(z[1] - square(z[0])) * 100.0 + square(-z[0] + 1.0)
}

/// All of them that are here.
pub fn examples() -> Vec<Example> {
    use Answer::{NotKkt, Optimum};
    vec![
        Example {
            name: "HS1",
            source: "HS 1: Rosenbrock's valley, bound not active",
            functions: |z, _, g| {
                g.push(z[1]);
                rosenbrock(z)
            },
            limits: &[(-1.5, INF)],
            start: &[-2.0, 1.0],
            answer: Optimum {
                f: 0.0,
                z: &[1.0, 1.0],
            },
        },
        Example {
            name: "HS2",
            source: "HS 2: Rosenbrock's valley, bound active; the local optimum on the start's side of \
                     x = 0 (the other is 0.0504)",
            functions: |z, _, g| {
                g.push(z[1]);
                rosenbrock(z)
            },
            limits: &[(1.5, INF)],
            start: &[-2.0, 1.0],
            answer: Optimum {
                f: 4.941_229_3,
                z: &[-1.221_026_2, 1.5],
            },
        },
        Example {
            name: "HS6",
            source: "HS 6: least squares, one nonlinear equality",
            functions: |z, c, _| {
                c.push((z[1] - square(z[0])) * 10.0);
                square(-z[0] + 1.0)
            },
            limits: &[],
            start: &[-1.2, 1.0],
            answer: Optimum {
                f: 0.0,
                z: &[1.0, 1.0],
            },
        },
        Example {
            name: "HS7",
            source: "HS 7",
            functions: |z, c, _| {
                c.push(square(square(z[0]) + 1.0) + square(z[1]) - 4.0);
                (square(z[0]) + 1.0).ln() - z[1]
            },
            limits: &[],
            start: &[2.0, 2.0],
            answer: Optimum {
                f: -1.732_050_807_568_877_2,
                z: &[0.0, 1.732_050_807_568_877_2],
            },
        },
        Example {
            name: "HS10",
            source: "HS 10: linear objective, one nonlinear inequality",
            functions: |z, _, g| {
                g.push(square(z[0]) * -3.0 + z[0] * z[1] * 2.0 - square(z[1]) + 1.0);
                z[0] - z[1]
            },
            limits: &[POSITIVE],
            start: &[-10.0, 10.0],
            answer: Optimum {
                f: -1.0,
                z: &[0.0, 1.0],
            },
        },
        Example {
            name: "HS12",
            source: "HS 12",
            functions: |z, _, g| {
                g.push(-square(z[0]) * 4.0 - square(z[1]) + 25.0);
                square(z[0]) * 0.5 + square(z[1]) - z[0] * z[1] - z[0] * 7.0 - z[1] * 7.0
            },
            limits: &[POSITIVE],
            start: &[0.0, 0.0],
            answer: Optimum {
                f: -30.0,
                z: &[2.0, 3.0],
            },
        },
        Example {
            name: "HS12 twice",
            source: "HS 12 with its constraint given twice: degenerate, multipliers not unique",
            functions: |z, _, g| {
                g.push(-square(z[0]) * 4.0 - square(z[1]) + 25.0);
                g.push(-square(z[0]) * 4.0 - square(z[1]) + 25.0);
                square(z[0]) * 0.5 + square(z[1]) - z[0] * z[1] - z[0] * 7.0 - z[1] * 7.0
            },
            limits: &[POSITIVE, POSITIVE],
            start: &[0.0, 0.0],
            answer: Optimum {
                f: -30.0,
                z: &[2.0, 3.0],
            },
        },
        Example {
            name: "HS13",
            source: "HS 13: a cusp; the constraint qualification fails at the optimum",
            functions: |z, _, g| {
                let side = -z[0] + 1.0;
                g.extend([side * side * side - z[1], z[0], z[1]]);
                square(z[0] - 2.0) + square(z[1])
            },
            limits: &[POSITIVE, POSITIVE, POSITIVE],
            start: &[-2.0, -2.0],
            answer: NotKkt {
                f: 1.0,
                z: &[1.0, 0.0],
            },
        },
        Example {
            name: "HS14",
            source: "HS 14: one equality, one inequality",
            functions: |z, c, g| {
                c.push(z[0] - z[1] * 2.0 + 1.0);
                g.push(-square(z[0]) * 0.25 - square(z[1]) + 1.0);
                square(z[0] - 2.0) + square(z[1] - 1.0)
            },
            limits: &[POSITIVE],
            start: &[2.0, 2.0],
            answer: Optimum {
                f: 1.393_464_979,
                z: &[0.822_875_656, 0.911_437_828],
            },
        },
        Example {
            name: "HS22",
            source: "HS 22: as many active inequalities as variables, a vertex",
            functions: |z, _, g| {
                g.push(-z[0] - z[1] + 2.0);
                g.push(-square(z[0]) + z[1]);
                square(z[0] - 2.0) + square(z[1] - 1.0)
            },
            limits: &[POSITIVE, POSITIVE],
            start: &[2.0, 2.0],
            answer: Optimum {
                f: 1.0,
                z: &[1.0, 1.0],
            },
        },
        Example {
            name: "HS26",
            source: "HS 26: singular Hessian at the optimum",
            functions: |z, c, _| {
                c.push((square(z[1]) + 1.0) * z[0] + square(square(z[2])) - 3.0);
                square(z[0] - z[1]) + square(square(z[1] - z[2]))
            },
            limits: &[],
            start: &[-2.6, 2.0, 2.0],
            answer: Optimum { f: 0.0, z: &[] },
        },
        Example {
            name: "HS28",
            source: "HS 28: quadratic, linear equality",
            functions: |z, c, _| {
                c.push(z[0] + z[1] * 2.0 + z[2] * 3.0 - 1.0);
                square(z[0] + z[1]) + square(z[1] + z[2])
            },
            limits: &[],
            start: &[-4.0, 1.0, 1.0],
            answer: Optimum {
                f: 0.0,
                z: &[0.5, -0.5, 0.5],
            },
        },
        Example {
            name: "HS35",
            source: "HS 35: Beale's convex QP",
            functions: |z, _, g| {
                g.extend([-z[0] - z[1] - z[2] * 2.0 + 3.0, z[0], z[1], z[2]]);
                -z[0] * 8.0 - z[1] * 6.0 - z[2] * 4.0
                    + square(z[0]) * 2.0
                    + square(z[1]) * 2.0
                    + square(z[2])
                    + z[0] * z[1] * 2.0
                    + z[0] * z[2] * 2.0
                    + 9.0
            },
            limits: &[POSITIVE, POSITIVE, POSITIVE, POSITIVE],
            start: &[0.5, 0.5, 0.5],
            answer: Optimum {
                f: 1.0 / 9.0,
                z: &[4.0 / 3.0, 7.0 / 9.0, 4.0 / 9.0],
            },
        },
        Example {
            name: "HS39",
            source: "HS 39: linear objective, two nonlinear equalities",
            functions: |z, c, _| {
                c.push(z[1] - z[0] * z[0] * z[0] - square(z[2]));
                c.push(square(z[0]) - z[1] - square(z[3]));
                -z[0]
            },
            limits: &[],
            start: &[2.0, 2.0, 2.0, 2.0],
            answer: Optimum {
                f: -1.0,
                z: &[1.0, 1.0, 0.0, 0.0],
            },
        },
        Example {
            name: "HS40",
            source: "HS 40: indefinite Hessian",
            functions: |z, c, _| {
                c.push(z[0] * z[0] * z[0] + square(z[1]) - 1.0);
                c.push(square(z[0]) * z[3] - z[2]);
                c.push(square(z[3]) - z[1]);
                -z[0] * z[1] * z[2] * z[3]
            },
            limits: &[],
            start: &[0.8, 0.8, 0.8, 0.8],
            answer: Optimum { f: -0.25, z: &[] },
        },
        Example {
            name: "HS43",
            source: "HS 43: Rosen and Suzuki",
            functions: |z, _, g| {
                let (a, b, c, d) = (square(z[0]), square(z[1]), square(z[2]), square(z[3]));
                g.push(-a - b - c - d - z[0] + z[1] - z[2] + z[3] + 8.0);
                g.push(-a - b * 2.0 - c - d * 2.0 + z[0] + z[3] + 10.0);
                g.push(-a * 2.0 - b - c - z[0] * 2.0 + z[1] + z[3] + 5.0);
                a + b + c * 2.0 + d - z[0] * 5.0 - z[1] * 5.0 - z[2] * 21.0 + z[3] * 7.0
            },
            limits: &[POSITIVE, POSITIVE, POSITIVE],
            start: &[0.0, 0.0, 0.0, 0.0],
            answer: Optimum {
                f: -44.0,
                z: &[0.0, 1.0, 2.0, -1.0],
            },
        },
        Example {
            name: "HS65",
            source: "HS 65: a ball and bounds on all variables",
            functions: |z, _, g| {
                g.push(-square(z[0]) - square(z[1]) - square(z[2]) + 48.0);
                g.extend_from_slice(z);
                square(z[0] - z[1]) + square(z[0] + z[1] - 10.0) / 9.0 + square(z[2] - 5.0)
            },
            limits: &[POSITIVE, (-4.5, 4.5), (-4.5, 4.5), (-5.0, 5.0)],
            start: &[-5.0, 5.0, 0.0],
            answer: Optimum {
                f: 0.953_528_856_7,
                z: &[3.650_461_821, 3.650_461_68, 4.620_417_050_7],
            },
        },
        Example {
            name: "HS71",
            source: "HS 71: equality, inequality and bounds",
            functions: |z, c, g| {
                c.push(square(z[0]) + square(z[1]) + square(z[2]) + square(z[3]) - 40.0);
                g.push(z[0] * z[1] * z[2] * z[3]);
                g.extend_from_slice(z);
                z[0] * z[3] * (z[0] + z[1] + z[2]) + z[2]
            },
            limits: &[(25.0, INF), (1.0, 5.0), (1.0, 5.0), (1.0, 5.0), (1.0, 5.0)],
            start: &[1.0, 5.0, 5.0, 1.0],
            answer: Optimum {
                f: 17.014_017_3,
                z: &[1.0, 4.742_999_4, 3.821_150_3, 1.379_408_2],
            },
        },
        Example {
            name: "HS76",
            source: "HS 76: convex QP, bounds active",
            functions: |z, _, g| {
                g.push(-z[0] - z[1] * 2.0 - z[2] - z[3] + 5.0);
                g.push(-z[0] * 3.0 - z[1] - z[2] * 2.0 + z[3] + 4.0);
                g.push(z[1] + z[2] * 4.0 - 1.5);
                g.extend_from_slice(z);
                square(z[0]) + square(z[1]) * 0.5 + square(z[2]) + square(z[3]) * 0.5 - z[0] * z[2]
                    + z[2] * z[3]
                    - z[0]
                    - z[1] * 3.0
                    + z[2]
                    - z[3]
            },
            limits: &[POSITIVE; 7],
            start: &[0.5, 0.5, 0.5, 0.5],
            answer: Optimum {
                f: -103.0 / 22.0,
                z: &[3.0 / 11.0, 23.0 / 11.0, 0.0, 6.0 / 11.0],
            },
        },
        Example {
            name: "HS78",
            source: "HS 78: three nonlinear equalities, indefinite Hessian",
            functions: |z, c, _| {
                c.push(z.iter().fold(H::from(-10.0), |sum, v| sum + *v * *v));
                c.push(z[1] * z[2] - z[3] * z[4] * 5.0);
                c.push(z[0] * z[0] * z[0] + z[1] * z[1] * z[1] + 1.0);
                z[0] * z[1] * z[2] * z[3] * z[4]
            },
            limits: &[],
            start: &[-2.0, 1.5, 2.0, -1.0, -1.0],
            answer: Optimum {
                f: -2.919_700_41,
                z: &[],
            },
        },
        Example {
            name: "HS100",
            source: "HS 100: seven variables, badly scaled polynomials",
            functions: |z, _, g| {
                let fourth = |x: H| square(square(x));
                g.push(
                    -square(z[0]) * 2.0
                        - fourth(z[1]) * 3.0
                        - z[2]
                        - square(z[3]) * 4.0
                        - z[4] * 5.0
                        + 127.0,
                );
                g.push(-z[0] * 7.0 - z[1] * 3.0 - square(z[2]) * 10.0 - z[3] + z[4] + 282.0);
                g.push(-z[0] * 23.0 - square(z[1]) - square(z[5]) * 6.0 + z[6] * 8.0 + 196.0);
                g.push(
                    -square(z[0]) * 4.0 - square(z[1]) + z[0] * z[1] * 3.0
                        - square(z[2]) * 2.0
                        - z[5] * 5.0
                        + z[6] * 11.0,
                );
                square(z[0] - 10.0)
                    + square(z[1] - 12.0) * 5.0
                    + fourth(z[2])
                    + square(z[3] - 11.0) * 3.0
                    + fourth(z[4]) * square(z[4]) * 10.0
                    + square(z[5]) * 7.0
                    + fourth(z[6])
                    - z[5] * z[6] * 4.0
                    - z[5] * 10.0
                    - z[6] * 8.0
            },
            limits: &[POSITIVE; 4],
            start: &[1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0],
            answer: Optimum {
                f: 680.630_057_3,
                z: &[],
            },
        },
        Example {
            name: "HS113",
            source: "HS 113: ten variables, eight inequalities of which six are active",
            functions: |z, _, g| {
                let x = |i: usize| z[i - 1];
                let s = |i: usize, from: f64| square(z[i - 1] - from);
                g.push(-x(1) * 4.0 - x(2) * 5.0 + x(7) * 3.0 - x(8) * 9.0 + 105.0);
                g.push(-x(1) * 10.0 + x(2) * 8.0 + x(7) * 17.0 - x(8) * 2.0);
                g.push(x(1) * 8.0 - x(2) * 2.0 - x(9) * 5.0 + x(10) * 2.0 + 12.0);
                g.push(-s(1, 2.0) * 3.0 - s(2, 3.0) * 4.0 - s(3, 0.0) * 2.0 + x(4) * 7.0 + 120.0);
                g.push(-s(1, 0.0) * 5.0 - x(2) * 8.0 - s(3, 6.0) + x(4) * 2.0 + 40.0);
                g.push(-s(1, 8.0) * 0.5 - s(2, 4.0) * 2.0 - s(5, 0.0) * 3.0 + x(6) + 30.0);
                g.push(-s(1, 0.0) - s(2, 2.0) * 2.0 + x(1) * x(2) * 2.0 - x(5) * 14.0 + x(6) * 6.0);
                g.push(x(1) * 3.0 - x(2) * 6.0 - s(9, 8.0) * 12.0 + x(10) * 7.0);
                s(1, 0.0) + s(2, 0.0) + x(1) * x(2) - x(1) * 14.0 - x(2) * 16.0
                    + s(3, 10.0)
                    + s(4, 5.0) * 4.0
                    + s(5, 3.0)
                    + s(6, 1.0) * 2.0
                    + s(7, 0.0) * 5.0
                    + s(8, 11.0) * 7.0
                    + s(9, 10.0) * 2.0
                    + s(10, 7.0)
                    + 45.0
            },
            limits: &[POSITIVE; 8],
            start: &[2.0, 3.0, 5.0, 5.0, 1.0, 2.0, 7.0, 3.0, 6.0, 10.0],
            answer: Optimum {
                f: 24.306_209_1,
                z: &[],
            },
        },
    ]
}
