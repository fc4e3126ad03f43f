//! Steps of the running models against analytic and independent solutions.

use pilotage_models::lti::{Transition, TransitionError};
use pilotage_models::pilot::PAPER_THETA;
use pilotage_models::simulation::{SetError, StepFault};
use pilotage_models::{Model, Pilot, Quadcopter, Simulation, TextModel};
use pilotage_ode::{DormandPrince, IntegrationError, Solver, System, Work};
use proptest::prelude::*;
use std::convert::Infallible;

/// Classical Runge–Kutta with many small steps: slow, simple, and independent of the library.
fn rk4(f: impl Fn(f64, &[f64]) -> Vec<f64>, x: &[f64], h: f64, steps: usize) -> Vec<f64> {
    let d = h / steps as f64;
    let shifted = |x: &[f64], k: &[f64], a: f64| -> Vec<f64> {
        x.iter().zip(k).map(|(x, k)| x + a * k).collect()
    };
    let mut x = x.to_vec();
    for i in 0..steps {
        let t = i as f64 * d;
        let k1 = f(t, &x);
        let k2 = f(t + d / 2.0, &shifted(&x, &k1, d / 2.0));
        let k3 = f(t + d / 2.0, &shifted(&x, &k2, d / 2.0));
        let k4 = f(t + d, &shifted(&x, &k3, d));
        for j in 0..x.len() {
            x[j] += d / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
        }
    }
    x
}

/// An equation without events.
struct Flow<F>(F);

impl<F: FnMut(f64, &[f64], &mut [f64])> System for Flow<F> {
    type Error = Infallible;

    fn derivatives(&mut self, time: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        self.0(time, x, dx);
        Ok(true)
    }
}

/// Integrates with states of these magnitudes as an FMU does: the first trial step is the whole interval.
fn integrate<const N: usize>(
    f: impl FnMut(f64, &[f64], &mut [f64]),
    x: [f64; N],
    nominals: [f64; N],
    interval: f64,
    relative: f64,
) -> Result<([f64; N], Work), IntegrationError<Infallible>> {
    let absolute = nominals.map(|nominal| relative * nominal);
    let mut solver = Solver::with(DormandPrince::new(N), 0, relative, &absolute);
    solver.restart(0.0, &x, true);
    solver.try_first(interval);
    let mut flow = Flow(f);
    while solver.time() < interval {
        solver.advance(&mut flow, interval)?;
    }
    Ok((std::array::from_fn(|i| solver.state()[i]), solver.work()))
}

fn index(model: &Model, name: &str) -> usize {
    model.index(name).expect("the variable exists")
}

fn get(simulation: &Simulation, name: &str) -> f64 {
    simulation.get(index(simulation.model(), name))
}

fn set(simulation: &mut Simulation, name: &str, value: f64) {
    let index = index(simulation.model(), name);
    simulation.set(index, value).expect("the value is allowed");
}

fn slope(simulation: &mut Simulation, name: &str, value: f64) {
    let index = index(simulation.model(), name);
    simulation.set_slope(index, value).expect("an input");
}

#[test]
fn first_order_pilot_follows_its_analytic_solution() {
    // x' = -a x + u, u = u0 + s t  =>  x = e^{-at} x0 + (u0/a - s/a²)(1 - e^{-at}) + s t/a
    let (a, c, x0, u0, s, h) = (2.5, 0.3, 0.7, 1.5, -0.4, 0.8);
    let mut pilot = Simulation::new(Model::pilot(&[a, c], 10.0));
    set(&mut pilot, "x1_start", x0);
    set(&mut pilot, "target", u0);
    slope(&mut pilot, "target", s);
    pilot.step(h).expect("the step is possible");
    let decay = (-a * h).exp();
    let x = decay * x0 + (u0 / a - s / (a * a)) * (1.0 - decay) + s * h / a;
    assert!((get(&pilot, "stick") - c * x).abs() < 1e-15);
    assert_eq!(get(&pilot, "target"), u0 + s * h);
    // The error followed its slope; the next step holds it constant.
    let error = index(pilot.model(), "error");
    assert_eq!(pilot.output_derivative(error), s);
    pilot.step(h).expect("the step is possible");
    assert_eq!(pilot.output_derivative(error), 0.0);
    assert_eq!(get(&pilot, "target"), u0 + s * h);
}

#[test]
fn integrating_pilot_is_a_polynomial() {
    // θ = 0 in the denominator: three integrators in a row, u = u0 + s t.
    let (u0, s, h) = (2.0, 0.5, 1.5);
    let mut pilot = Simulation::new(Model::pilot(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 1e9));
    set(&mut pilot, "position", -u0);
    slope(&mut pilot, "position", -s);
    pilot.step(h).expect("the step is possible");
    let x1 = u0 * h.powi(3) / 6.0 + s * h.powi(4) / 24.0;
    assert!((get(&pilot, "stick") - x1).abs() < 1e-15 * x1.abs());
}

#[test]
fn stick_is_clipped_and_its_derivative_with_it() {
    let mut pilot = Simulation::new(Model::pilot(&[1.0, 1.0], 0.25));
    set(&mut pilot, "target", 10.0);
    let stick = index(pilot.model(), "stick");
    assert_eq!(pilot.output_derivative(stick), 10.0);
    pilot.step(1.0).expect("the step is possible");
    assert_eq!(get(&pilot, "stick"), 0.25);
    assert_eq!(pilot.output_derivative(stick), 0.0);
    assert_eq!(get(&pilot, "error"), 10.0);
}

#[test]
fn vehicle_follows_an_independent_solution() {
    let vehicle = Quadcopter::default();
    let x0 = [1.0, 0.2, -0.5, 0.3, 0.02, -0.01];
    let (u0, s, h) = (-0.6, 0.9, 1.0);
    let mut simulation = Simulation::new(Model::quadcopter(&vehicle));
    simulation.set_tolerance(1e-12);
    for (i, x) in simulation.model().starts().zip(x0) {
        simulation.set(i, x).expect("a start value");
    }
    set(&mut simulation, "stick", u0);
    slope(&mut simulation, "stick", s);
    simulation.step(h).expect("the step is possible");
    let derivative = |t: f64, x: &[f64]| {
        let mut dx = vec![0.0; 6];
        vehicle.derivative(x, u0 + s * t, &mut dx);
        dx
    };
    let expected = rk4(derivative, &x0, h, 20_000);
    for (i, x) in simulation.model().outputs().zip(expected) {
        let error = (simulation.get(i) - x).abs();
        assert!(error < 1e-11, "state {i}: error {error:e}");
    }
}

#[test]
fn vehicle_hovers_exactly() {
    let mut simulation = Simulation::new(Model::quadcopter(&Quadcopter::default()));
    set(&mut simulation, "z_start", 3.0);
    for _ in 0..100 {
        simulation.step(0.05).expect("the step is possible");
    }
    assert_eq!(get(&simulation, "z"), 3.0);
    assert_eq!(get(&simulation, "phi"), 0.0);
}

#[test]
fn error_falls_with_the_tolerance() {
    // A pendulum over many swings; the tolerance is local, so the global error is several times larger.
    let pendulum = |_: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = x[1];
        dx[1] = -x[0].sin();
    };
    let run =
        |relative| integrate(pendulum, [2.0, 0.0], [1.0; 2], 20.0, relative).expect("it is smooth");
    let exact = rk4(|_, x| vec![x[1], -x[0].sin()], &[2.0, 0.0], 20.0, 200_000);
    let errors = [1e-5, 1e-7, 1e-9, 1e-11].map(|relative| {
        let (x, _) = run(relative);
        (x[0] - exact[0]).abs().max((x[1] - exact[1]).abs())
    });
    for (error, relative) in errors.iter().zip([1e-5, 1e-7, 1e-9, 1e-11]) {
        assert!(*error < 200.0 * relative, "{errors:?}");
    }
    // The amount of work must not grow unnoticed; run time is not tested.
    insta::assert_debug_snapshot!([1e-5, 1e-9].map(|r| run(r).1));
}

#[test]
fn blow_up_is_an_error_and_changes_nothing() {
    let explosion = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = x[0] * x[0];
    let error = integrate(explosion, [1.0], [1.0], 2.0, 1e-9).expect_err("it is infinite at 1 s");
    let IntegrationError::StepTooShort { time, .. } = error else {
        panic!("{error}")
    };
    assert!((time - 1.0).abs() < 1e-3);

    let mut pilot = Simulation::new(Model::pilot(&[-1e3, 1.0], 1.0));
    set(&mut pilot, "target", 1.0);
    let before = pilot.snapshot().clone();
    let error = pilot.step(10.0).expect_err("e^10000");
    assert!(
        matches!(error.fault, StepFault::Linear(TransitionError::Overflow { step }) if step == 10.0),
        "{error}"
    );
    assert_eq!(*pilot.snapshot(), before);
}

#[test]
fn matrices_that_the_exponential_cannot_take_are_refused() {
    let decay = |rate: f64| move |x: &[f64], u: &[f64], dx: &mut [f64]| dx[0] = u[0] - rate * x[0];
    for rate in [1e300, f64::INFINITY, f64::NAN] {
        let error = Transition::new([1, 1], 1.0, decay(rate)).expect_err("too large");
        let is_number = rate.is_finite();
        let is_large = matches!(error, TransitionError::TooLarge { .. });
        assert!(is_large == is_number, "{error}");
        assert!(is_number || error == TransitionError::NotFinite, "{error}");
    }
    assert!(Transition::new([1, 1], 1.0, decay(1e7)).is_ok());
}

/// A step `u` into `n` equal poles at `-a`: with `τ = a t`, `x_1 = u (1 - e^{-τ} Σ_{k<n} τ^k/k!) / aⁿ`, and the other
/// states are its derivatives. The norm of the matrix is about `aⁿ`, that of the balanced one `n a`.
#[test]
fn equal_poles_however_fast_are_exact() {
    for (a, h) in [
        (1e3, 1e-3),
        (1e5, 3e-5),
        (1e6, 2e-6),
        (1e6, 0.05),
        (1e6, 1.0),
    ] {
        let tau: f64 = a * h;
        let decay = (-tau).exp();
        // In units of u / a^(n + 1 - i).
        let cases = [
            vec![1.0 - decay],
            vec![1.0 - decay * (1.0 + tau), decay * tau],
            vec![
                1.0 - decay * (1.0 + tau + 0.5 * tau * tau),
                decay * 0.5 * tau * tau,
                decay * (tau - 0.5 * tau * tau),
            ],
        ];
        let denominators = [
            vec![a],
            vec![a * a, 2.0 * a],
            vec![a.powi(3), 3.0 * a * a, 3.0 * a],
        ];
        for (expected, mut theta) in cases.into_iter().zip(denominators) {
            let n = theta.len();
            theta.resize(2 * n, 0.0);
            let mut pilot = Simulation::new(Model::pilot(&theta, 1.0));
            set(&mut pilot, "target", 7.0);
            pilot.step(h).expect("the step is possible");
            for (i, expected) in expected.iter().enumerate() {
                let unit = 7.0 / a.powi((n - i) as i32);
                let found = get(&pilot, &format!("x{}", i + 1)) / unit;
                let error = (found - expected).abs();
                assert!(
                    error < 1e-14 * tau.max(10.0),
                    "{n} poles, -{a}, {h} s, x{}: {error}",
                    i + 1
                );
            }
        }
    }
}

#[test]
fn values_are_checked_at_the_door() {
    let mut quadcopter = Simulation::new(Model::quadcopter(&Quadcopter::default()));
    let index = |name| index(&Model::quadcopter(&Quadcopter::default()), name);
    let mut message = |name, value| {
        let result: Result<(), SetError> = quadcopter.set(index(name), value);
        result.expect_err("not allowed").to_string()
    };
    assert_eq!(
        message("mass", -1.0),
        "mass [kg] = -1 is out of its range 0.001 to 10000; set a value within it"
    );
    assert_eq!(
        message("stick", f64::NAN),
        "stick = NaN is not a finite number; check what computes it"
    );
    assert_eq!(message("z", 1.0), "z [m] is an output and cannot be set");
    assert_eq!(
        quadcopter.set(99, 1.0).expect_err("no such").to_string(),
        "there is no variable 99; the last one is 29"
    );
    assert_eq!(
        quadcopter.set_slope(7, 1.0).expect_err("none").to_string(),
        "mass [kg] is no input and has no derivative to set"
    );
}

fn theta(order: usize) -> impl Strategy<Value = Vec<f64>> {
    // Coefficients of a product of stable first- and second-order factors, then any numerator.
    let poles = prop::collection::vec(0.05..6.0_f64, order);
    let numerator = prop::collection::vec(-0.5..0.5_f64, order);
    (poles, numerator).prop_map(|(poles, numerator)| {
        let mut c = vec![1.0];
        for p in poles {
            let mut next = vec![0.0; c.len() + 1];
            for (i, v) in c.iter().enumerate() {
                next[i] += p * v;
                next[i + 1] += v;
            }
            c = next;
        }
        c.pop();
        c.into_iter().chain(numerator).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        cases: 64,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn pilots_of_any_order_follow_an_independent_solution(
        theta in (1_usize..=5).prop_flat_map(theta),
        x0 in prop::collection::vec(-1.0..1.0_f64, 5),
        (u0, s) in (-2.0..2.0_f64, -1.0..1.0_f64),
        h in 0.01..0.5_f64,
    ) {
        let pilot = Pilot { order: theta.len() / 2 };
        let x0 = &x0[..pilot.order];
        let mut simulation = Simulation::new(Model::pilot(&theta, 1e9));
        for (i, x) in simulation.model().starts().zip(x0) {
            simulation.set(i, *x).expect("a start value");
        }
        set(&mut simulation, "target", u0);
        slope(&mut simulation, "target", s);
        simulation.step(h).expect("the step is possible");
        let expected = rk4(|t, x| {
            let mut dx = vec![0.0; x.len()];
            pilot.derivative(x, u0 + s * t, &theta, &mut dx);
            dx
        }, x0, h, 4000);
        for (x, expected) in simulation.snapshot().states.iter().zip(&expected) {
            let scale = expected.abs().max(1.0);
            prop_assert!((x - expected).abs() < 1e-10 * scale, "{x} {expected}");
        }
    }

    #[test]
    fn exact_steps_compose(theta in theta(3), h in 0.001..1.0_f64) {
        let run = |parts: usize| {
            let mut pilot = Simulation::new(Model::pilot(&theta, 1e9));
            set(&mut pilot, "target", 10.0);
            for _ in 0..parts {
                pilot.step(h / parts as f64).expect("the step is possible");
            }
            pilot.snapshot().states.clone()
        };
        for (one, many) in run(1).iter().zip(run(7)) {
            prop_assert!((one - many).abs() < 1e-12 * one.abs().max(1.0));
        }
    }

    #[test]
    fn vehicle_steps_may_be_cut(
        stick in -1.0..1.0_f64,
        phi in -0.5..0.5_f64,
        h in 0.01..0.4_f64,
    ) {
        let run = |parts: usize| {
            let mut vehicle = Simulation::new(Model::quadcopter(&Quadcopter::default()));
            set(&mut vehicle, "stick", stick);
            set(&mut vehicle, "phi_start", phi);
            for _ in 0..parts {
                vehicle.step(h / parts as f64).expect("the step is possible");
            }
            vehicle.snapshot().states.clone()
        };
        for (one, many) in run(1).iter().zip(run(7)) {
            prop_assert!((one - many).abs() < 1e-8, "{one} {many}");
        }
    }

    #[test]
    fn output_derivatives_agree_with_differences(
        x in prop::collection::vec(-0.3..0.3_f64, 6),
        input in -0.5..0.5_f64,
    ) {
        let models = [
            Model::quadcopter(&Quadcopter::default()),
            Model::pilot(&PAPER_THETA, 1.0),
        ];
        for model in models {
            let mut simulation = Simulation::new(model.clone());
            for (i, x) in model.starts().zip(&x) {
                simulation.set(i, *x).expect("a start value");
            }
            simulation.set(model.inputs().start, input).expect("an input");
            let before: Vec<f64> = model.outputs().map(|i| simulation.get(i)).collect();
            let slopes: Vec<f64> = model.outputs().map(|i| simulation.output_derivative(i)).collect();
            let h = 1e-6;
            simulation.step(h).expect("the step is possible");
            for ((i, before), slope) in model.outputs().zip(before).zip(slopes) {
                let difference = (simulation.get(i) - before) / h;
                prop_assert!((difference - slope).abs() < 1e-4 * (1.0 + slope.abs()), "{i}: {difference} {slope}");
            }
        }
    }

    #[test]
    fn directional_derivatives_agree_with_differences(
        x in prop::collection::vec(-0.3..0.3_f64, 6),
        limit in 0.001..0.05_f64,
        seed in prop::collection::vec(-1.0..1.0_f64, 23),
    ) {
        let models = [
            Model::quadcopter(&Quadcopter::default()),
            Model::pilot(&PAPER_THETA, limit),
        ];
        for model in models {
            let mut here = Simulation::new(model.clone());
            for (i, x) in model.starts().zip(&x) {
                here.set(i, *x).expect("a start value");
            }
            let knowns: Vec<usize> = (0..model.starts().end)
                .filter(|i| !model.variables()[*i].is_output())
                .collect();
            let seeds: Vec<_> = knowns.iter().map(|&i| (i, seed[i])).collect();
            let moved = |h: f64| {
                let mut there = here.clone();
                for (i, part) in &seeds {
                    // Small enough to leave no variable's range.
                    there.set(*i, here.get(*i) + h * part).expect("it is within its range");
                }
                model.outputs().map(|i| there.get(i)).collect::<Vec<_>>()
            };
            let outputs: Vec<usize> = model.outputs().collect();
            let exact = here.directional_derivative(&outputs, &seeds);
            let h = 1e-5;
            for ((plus, minus), exact) in moved(h).iter().zip(moved(-h)).zip(exact) {
                let difference = (plus - minus) / (2.0 * h);
                prop_assert!((difference - exact).abs() < 1e-8, "{difference} {exact}");
            }
        }
    }

    #[test]
    fn model_files_read_back_as_they_were_written(
        theta in (1_usize..=5).prop_flat_map(theta),
        limit in 0.0..2.0_f64,
    ) {
        let model = Model::pilot(&theta, limit);
        prop_assert_eq!(Model::from_file(&model.to_file()), Ok(model));
    }
}

#[test]
fn model_files_are_checked() {
    let good = Model::pilot(&PAPER_THETA, 1.0).to_file();
    let message = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        Model::from_file(&good.replace(from, to))
            .expect_err("it is broken")
            .to_string()
    };
    let messages = [
        message("format = 1", "format = 2"),
        message("\"pilot\"", "\"glider\""),
        message("order = 3", "order = 0"),
        message("order = 3", "order = 4"),
        message("order = 3", "order 3"),
        message("theta1 = 0.2454", "theta1 = fast"),
        message("theta1 = 0.2454", "theta1 = inf"),
        message("theta1 = 0.2454\n", ""),
        message("theta1 = ", "theta2 = "),
        message("theta6 = ", "theta9 = "),
        message("stick_limit = 1.0", "stick_limit = -1.0"),
    ];
    insta::assert_snapshot!(messages.join("\n"));
}

#[test]
fn work_of_a_communication_step() {
    let vehicle = Quadcopter::default();
    let work = |h: f64| -> Work {
        let f = |_: f64, x: &[f64], dx: &mut [f64]| vehicle.derivative(x, -0.3, dx);
        let nominals = [1.0, 0.1, 1.0, 0.1, 0.01, 0.01];
        integrate(f, [0.0; 6], nominals, h, 1e-9)
            .expect("it is smooth")
            .1
    };
    insta::assert_debug_snapshot!([0.001, 0.05, 1.0].map(work));
}

/// A parameter moves a start value that depends on it before the simulation starts, and no state afterwards, in a copy
/// and after a restore too.
#[test]
fn copies_have_started_when_the_original_has() {
    let text = "[model]\nname = \"decay\"\n[parameters]\nx0 = { start = 1 }\ntau = { start = 1, unit = \"s\" }\n[states]\nx = { start = \"x0\", der = \"-x / tau\" }\n";
    let model = TextModel::parse(text, "decay.toml").expect("a model");
    let mut original = pilotage_sdk::Simulation::new(model.clone());
    let start = original.snapshot().clone();
    let x0 = original.table().parameters().start;
    let state = |of: &pilotage_sdk::Simulation<TextModel>| of.snapshot().states[0];
    original.set(x0, 3.0).expect("allowed");
    assert_eq!(state(&original), 3.0);
    original.step(1.0).expect("a step");
    let reached = state(&original);
    assert!((reached - 3.0 * (-1.0_f64).exp()).abs() < 1e-4);
    let mut copy = original.clone();
    let mut restored = pilotage_sdk::Simulation::new(model);
    restored.restore(original.snapshot());
    for own in [&mut original, &mut copy, &mut restored] {
        own.set(x0, 5.0).expect("allowed");
        assert_eq!(state(own), reached);
    }
    original.restore(&start);
    original.set(x0, 7.0).expect("allowed");
    assert_eq!(state(&original), 7.0);
}
