//! Problems with known solutions. Reference values of SciPy 1.17.1 are given with the call that produced them.

use super::*;
use std::convert::Infallible;

/// A problem given by closures.
struct Problem<F, Z> {
    f: F,
    z: Z,
}

impl<F: Fn(f64, &[f64], &mut [f64]), Z: Fn(f64, &[f64], &mut [f64])> System for Problem<F, Z> {
    type Error = Infallible;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        (self.f)(t, x, dx);
        Ok(true)
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, Infallible> {
        (self.z)(t, x, z);
        Ok(true)
    }
}

fn no_events(_: f64, _: &[f64], _: &mut [f64]) {}

fn solver(x: &[f64], indicators: usize, relative: f64, method: Method) -> Solver {
    let options = SolverOptions {
        relative,
        absolute: vec![relative * 1e-3; x.len()],
        method,
        longest_step: f64::INFINITY,
    };
    let mut solver = Solver::new(indicators, options);
    solver.restart(0.0, x, true);
    solver
}

/// Solves up to `end`, without events.
fn solve(
    f: impl Fn(f64, &[f64], &mut [f64]),
    x: &[f64],
    end: f64,
    relative: f64,
    method: Method,
) -> Solver {
    let mut problem = Problem { f, z: no_events };
    let mut solver = solver(x, 0, relative, method);
    while solver.time() < end {
        let advance = solver.advance(&mut problem, end).unwrap();
        assert_eq!(advance, Advance::Step);
    }
    assert_eq!(solver.time(), end);
    solver
}

fn oscillator(_: f64, x: &[f64], dx: &mut [f64]) {
    (dx[0], dx[1]) = (x[1], -x[0]);
}

fn van_der_pol(mu: f64) -> impl Fn(f64, &[f64], &mut [f64]) {
    move |_, x, dx| (dx[0], dx[1]) = (x[1], mu * (1.0 - x[0] * x[0]) * x[1] - x[0])
}

fn robertson(_: f64, x: &[f64], dx: &mut [f64]) {
    let (slow, fast) = (0.04 * x[0] - 1e4 * x[1] * x[2], 3e7 * x[1] * x[1]);
    (dx[0], dx[1], dx[2]) = (-slow, slow - fast, fast);
}

#[test]
fn errors_follow_the_tolerance() {
    for method in [Method::DormandPrince, Method::Radau] {
        for relative in [1e-4, 1e-6, 1e-8, 1e-10] {
            let solver = solve(oscillator, &[1.0, 0.0], 20.0, relative, method);
            let error = (solver.state()[0] - 20f64.cos()).hypot(solver.state()[1] + 20f64.sin());
            assert!(
                error < 100.0 * relative,
                "{method:?} {relative:e}: {error:e}"
            );
        }
    }
}

#[test]
fn the_clock_enters_and_polynomials_of_the_order_are_exact() {
    for method in [Method::DormandPrince, Method::Radau] {
        let f = |t: f64, _: &[f64], dx: &mut [f64]| dx[0] = 5.0 * t.powi(4);
        let solver = solve(f, &[0.0], 2.0, 1e-3, method);
        assert!((solver.state()[0] - 32.0).abs() < 1e-12, "{method:?}");
    }
}

/// `solve_ivp(vdp(5), (0, 20), [2, 0], method='DOP853', rtol=1e-13, atol=1e-15)`.
/// Stiff: `solve_ivp(vdp(1000), (0, 1500), [2, 0], method='Radau', rtol=1e-10, atol=1e-13, jac=...)`.
#[test]
fn van_der_pol_is_that_of_scipy() {
    let reference = [-1.6012968795428366, 0.19832667633866666];
    for (method, relative) in [(Method::DormandPrince, 1e-9), (Method::Radau, 1e-9)] {
        let solver = solve(van_der_pol(5.0), &[2.0, 0.0], 20.0, relative, method);
        for (x, reference) in solver.state().iter().zip(reference) {
            assert!((x - reference).abs() < 1e-7, "{method:?} {x} {reference}");
        }
    }
    let solver = solve(
        van_der_pol(1e3),
        &[2.0, 0.0],
        1500.0,
        1e-8,
        Method::Automatic,
    );
    assert!(solver.is_implicit());
    for (x, reference) in (solver.state().iter()).zip([-1.354745919486536, 0.001621788727597734]) {
        assert!((x / reference - 1.0).abs() < 1e-5, "{x} {reference}");
    }
}

/// `solve_ivp(robertson, (0, 400), [1, 0, 0], method='Radau', rtol=1e-10, atol=1e-16)`.
#[test]
fn robertson_is_that_of_scipy() {
    let reference = [
        0.4505186684711011,
        3.2229014416745967e-06,
        0.5494781086274569,
    ];
    let solver = solve(robertson, &[1.0, 0.0, 0.0], 400.0, 1e-7, Method::Radau);
    for (x, reference) in solver.state().iter().zip(reference) {
        assert!((x / reference - 1.0).abs() < 1e-5, "{x} {reference}");
    }
    let work = solver.work();
    let counts = (work.steps, work.rejections, work.evaluations);
    insta::assert_snapshot!(format!("{counts:?}"), @"(155, 3, 1280)");
}

#[test]
fn stiff_problems_come_to_the_implicit_method_by_themselves() {
    let f = |t: f64, x: &[f64], dx: &mut [f64]| dx[0] = -1e6 * (x[0] - t.cos());
    let solver = solve(f, &[0.0], 10.0, 1e-6, Method::Automatic);
    assert!(solver.is_implicit());
    assert!((solver.state()[0] - 10f64.cos()).abs() < 1e-5);
    // 10 s of steps of 3.3e-6 s would be 3 million.
    assert!(solver.work().steps < 1000, "{:?}", solver.work());
    assert!(!solve(oscillator, &[1.0, 0.0], 20.0, 1e-6, Method::Automatic).is_implicit());
}

/// Times at which an indicator changes.
fn events(
    f: impl Fn(f64, &[f64], &mut [f64]),
    z: impl Fn(f64, &[f64], &mut [f64]),
    x: &[f64],
    indicators: usize,
    end: f64,
    method: Method,
) -> Vec<f64> {
    let mut problem = Problem { f, z };
    let mut solver = solver(x, indicators, 1e-9, method);
    let mut times = Vec::new();
    while solver.time() < end {
        if solver.advance(&mut problem, end).unwrap() == Advance::Event {
            times.push(solver.time());
        }
    }
    times
}

#[test]
fn indicators_are_found_where_they_change() {
    use std::f64::consts::PI;
    for method in [Method::DormandPrince, Method::Radau] {
        // Two indicators of an oscillation: cos t and sin t - 1/2.
        let z = |_: f64, x: &[f64], z: &mut [f64]| (z[0], z[1]) = (x[0], -x[1] - 0.5);
        let found = events(oscillator, z, &[1.0, 0.0], 2, 8.0, method);
        let expected = [1.0 / 6.0, 0.5, 5.0 / 6.0, 1.5, 13.0 / 6.0, 2.5].map(|x| x * PI);
        assert_eq!(found.len(), expected.len(), "{method:?} {found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-8,
                "{method:?} {found} {expected}"
            );
        }
    }
}

#[test]
fn indicators_of_time_alone_are_found_to_the_last_bits_and_just_behind() {
    let f = |_: f64, _: &[f64], _: &mut [f64]| {};
    let z = |t: f64, _: &[f64], z: &mut [f64]| z[0] = (t - 0.3) * (t - 0.7);
    let found = events(f, z, &[], 1, 1.0, Method::DormandPrince);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[0] - 0.3).abs() < 1e-15 && found[0] > 0.3 - 1e-15);
    assert!((found[1] - 0.7).abs() < 1e-15);
    assert!((found[0] - 0.3) * (found[0] - 0.7) <= 0.0);
    assert!((found[1] - 0.3) * (found[1] - 0.7) > 0.0);
}

#[test]
fn poles_and_undefined_starts_are_errors() {
    let f = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = x[0] * x[0];
    let mut problem = Problem { f, z: no_events };
    for method in [Method::DormandPrince, Method::Radau] {
        let mut solver = solver(&[1.0], 0, 1e-6, method);
        let error = loop {
            if let Err(error) = solver.advance(&mut problem, 2.0) {
                break error;
            }
        };
        let IntegrationError::StepTooShort { time, .. } = error else {
            panic!("{error:?}");
        };
        assert!((time - 1.0).abs() < 1e-5, "{method:?} {time}");
    }
    let f = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = -x[0].sqrt();
    let mut problem = Problem { f, z: no_events };
    let mut solver = solver(&[-1.0], 0, 1e-6, Method::DormandPrince);
    assert_eq!(
        solver.advance(&mut problem, 2.0),
        Err(IntegrationError::Undefined { time: 0.0 })
    );
}

#[test]
fn what_is_undefined_beyond_is_named() {
    for method in [Method::DormandPrince, Method::Radau] {
        let beyond = |t: f64| if t < 0.3 { 1.0 } else { f64::NAN };
        let f = |t: f64, _: &[f64], dx: &mut [f64]| dx[0] = beyond(t);
        let mut derivatives = Problem { f, z: no_events };
        let f = |_: f64, _: &[f64], dx: &mut [f64]| dx[0] = 1.0;
        let z = |t: f64, _: &[f64], z: &mut [f64]| z[0] = beyond(t);
        let mut indicators = Problem { f, z };
        let mut first = solver(&[0.0], 0, 1e-6, method);
        let mut second = solver(&[0.0], 1, 1e-6, method);
        let errors = [
            loop {
                if let Err(error) = first.advance(&mut derivatives, 1.0) {
                    break error;
                }
            },
            loop {
                if let Err(error) = second.advance(&mut indicators, 1.0) {
                    break error;
                }
            },
        ];
        for (error, expected) in errors.into_iter().zip(["derivatives", "event indicators"]) {
            let IntegrationError::UndefinedBeyond { time, what } = error else {
                panic!("{error:?}");
            };
            assert_eq!(what, expected);
            assert!((time - 0.3).abs() < 1e-9, "{method:?} {time}");
        }
    }
}

#[test]
fn work_of_the_explicit_method() {
    let solver = solve(
        van_der_pol(5.0),
        &[2.0, 0.0],
        20.0,
        1e-6,
        Method::DormandPrince,
    );
    let work = solver.work();
    let counts = (work.steps, work.rejections, work.evaluations);
    insta::assert_snapshot!(format!("{counts:?}"), @"(330, 27, 2144)");
}

/// A solution that begins with a method forgets what was before: it has the bits of a new one.
#[test]
fn a_method_to_begin_with_forgets_the_past() {
    let mut problem = Problem {
        f: van_der_pol(1e3),
        z: no_events,
    };
    let mut advance = |solver: &mut Solver, is_implicit: bool, patience: u32| {
        solver.restart(0.0, &[2.0, 0.0], true);
        solver.begin_with(is_implicit, patience);
        solver.try_first(1.0);
        while solver.time() < 1.0 {
            solver.advance(&mut problem, 1.0).unwrap();
        }
        (solver.is_implicit(), solver.state().to_vec())
    };
    let made = || solver(&[2.0, 0.0], 0, 1e-6, Method::Automatic);
    let mut used = made();
    for (is_implicit, patience) in [
        (false, 15),
        (true, 15),
        (false, 15),
        (false, 100_000),
        (true, 0),
    ] {
        let fresh = advance(&mut made(), is_implicit, patience);
        assert_eq!(advance(&mut used, is_implicit, patience), fresh);
        // It is found to be stiff unless it must have looked so for longer.
        assert_eq!(fresh.0, patience < 100_000);
        let rate = used.fastest_rate();
        // The fast eigenvalue there is 1e3 (1 - x²).
        assert!(
            rate.is_none_or(|rate| (2.9e3..6e3).contains(&rate)),
            "{rate:?}"
        );
    }
}
