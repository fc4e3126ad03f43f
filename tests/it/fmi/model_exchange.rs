//! Model exchange integrated with a solver: foreign FMUs whose solutions are known.

use crate::foreign;
use pilotage::fmi::{
    Fmu, Instance, InterfaceType, ModelExchangeRun, Reached, RunError, RunOptions,
};
use pilotage::models::Model;
use pilotage::ode::Method;
use tempfile::tempdir;

/// A foreign FMU for model exchange, just instantiated.
fn run_of(model: &str, states: usize, indicators: usize, options: RunOptions) -> ModelExchangeRun {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    std::fs::write(&path, foreign::model_exchange(model, states, indicators)).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    let instance = library
        .instantiate("here", InterfaceType::ModelExchange)
        .unwrap();
    ModelExchangeRun::new(instance, library.description(), options)
}

fn options(tolerance: f64, method: Method) -> RunOptions {
    RunOptions {
        tolerance,
        method,
        ..RunOptions::default()
    }
}

/// At time 0, with parameter and input as they are.
fn begun(model: &str, states: usize, indicators: usize, options: RunOptions) -> ModelExchangeRun {
    let mut run = run_of(model, states, indicators, options);
    initialize(run.instance());
    run.begin(0.0).unwrap();
    run
}

fn initialize(instance: &mut Instance) {
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
}

fn default(model: &str, states: usize, indicators: usize) -> ModelExchangeRun {
    begun(model, states, indicators, RunOptions::default())
}

fn events(run: &mut ModelExchangeRun) -> i32 {
    run.instance().get_integer(0).unwrap()
}

const BOTH: [Method; 2] = [Method::DormandPrince, Method::Radau];

#[test]
fn decay_is_exact_to_the_tolerance_with_either_method_and_jacobian() {
    for model in ["decay@2", "decay-by-differences@2"] {
        for method in BOTH {
            for tolerance in [1e-4, 1e-6, 1e-8] {
                let mut run = begun(model, 1, 0, options(tolerance, method));
                assert_eq!(run.step_to(1.0).unwrap(), Reached::Target);
                let error = (run.states()[0] - (-2f64).exp()).abs();
                assert!(error < 20.0 * tolerance, "{model} {method:?} {error:e}");
                assert_eq!(run.time(), 1.0);
            }
        }
    }
}

#[test]
fn stiff_models_are_solved_in_few_steps_and_jacobians_are_the_models() {
    let work = |model| {
        let mut run = begun(model, 1, 0, RunOptions::default());
        run.set_inputs(&[21], &[0.5], None).unwrap();
        run.step_to(10.0).unwrap();
        assert!((run.states()[0] - 0.5).abs() < 1e-6);
        run.work().solver
    };
    let (exact, differences) = (work("decay@1e6"), work("decay-by-differences@1e6"));
    assert!(exact.jacobians > 0 && exact.steps < 200, "{exact:?}");
    // Each Jacobian by differences is one evaluation more, there being one state.
    assert_eq!(exact.steps, differences.steps);
    assert_eq!(
        exact.evaluations + differences.jacobians,
        differences.evaluations
    );
}

/// `solve_ivp(vdp(5), (0, 20), [2, 0], method='DOP853', rtol=1e-13, atol=1e-15)` of SciPy 1.17.1.
#[test]
fn van_der_pol_is_that_of_scipy() {
    for method in BOTH {
        let mut run = begun("van-der-pol@5", 2, 0, options(1e-9, method));
        // Communication points do not change the solution.
        for k in 1..=40 {
            run.step_to(f64::from(k) * 0.5).unwrap();
        }
        let reference = [-1.6012968795428366, 0.19832667633866666];
        for (x, reference) in run.states().iter().zip(reference) {
            assert!((x - reference).abs() < 1e-6, "{method:?} {x} {reference}");
        }
    }
}

/// The ball falls from 1 m and keeps 0.7 of its speed: bounce k is at `t1 (1 + 2 (e + e² + ...))`.
#[test]
fn a_ball_bounces_when_it_should_and_comes_to_rest() {
    const G: f64 = 9.81;
    let e: f64 = 0.7;
    let first = (2.0 / G).sqrt();
    let bounce = |k: i32| first * (1.0 + 2.0 * (1..k).map(|i| e.powi(i)).sum::<f64>());
    for method in BOTH {
        for step in [0.01, 0.1, 1.0, 5.0] {
            let mut run = begun("ball@0.7", 2, 1, options(1e-6, method));
            let mut k = 0;
            while run.time() < 5.0 {
                k += 1;
                run.step_to((f64::from(k) * step).min(5.0)).unwrap();
                let seen = events(&mut run);
                // Every bounce before now, and none after it.
                let is_rest = seen == 13;
                assert!(bounce(seen.max(1)) <= run.time() + 1e-9 || seen == 0);
                assert!(
                    is_rest || bounce(seen + 1) > run.time() - 1e-9,
                    "{step} {seen}"
                );
            }
            // 4.43 · 0.7^k falls below 0.05 at k = 13.
            assert_eq!(events(&mut run), 13, "{method:?} {step}");
            assert_eq!(run.states(), [0.0, 0.0]);
            assert_eq!(run.work().state_events, 13);
        }
    }
}

#[test]
fn a_ball_that_never_rests_is_told_and_not_a_hang() {
    let mut run = default("zeno@0.7", 2, 1);
    let error = run.step_to(5.0).unwrap_err();
    let RunError::Chattering { time, .. } = error else {
        panic!("{error}");
    };
    // All bounces together end at t1 (1 + e)/(1 - e).
    let end = (2.0f64 / 9.81).sqrt() * 1.7 / 0.3;
    assert!((time - end).abs() < 1e-6, "{time} {end}");
}

#[test]
fn an_indicator_that_is_positive_for_a_short_while_is_seen() {
    // By the state, whose solution is exact with any step, and by the time, without any state.
    for (model, states, from, to) in [("pulse", 1, 0.475, 0.525), ("timer", 0, 0.25, 0.75)] {
        let limited = RunOptions {
            longest_step: 0.1,
            ..RunOptions::default()
        };
        let mut run = begun(model, states, 1, limited);
        run.step_to(from - 1e-9).unwrap();
        assert_eq!(events(&mut run), 0, "{model}");
        run.step_to(from + 1e-9).unwrap();
        assert_eq!(events(&mut run), 1, "{model}");
        run.step_to(to - 1e-9).unwrap();
        assert_eq!(events(&mut run), 1, "{model}");
        run.step_to(1.0).unwrap();
        assert_eq!(
            (events(&mut run), run.work().state_events),
            (2, 2),
            "{model}"
        );
    }
}

#[test]
fn time_events_come_exactly_when_they_were_announced() {
    let mut run = default("counter", 0, 0);
    for (time, count) in [(0.29, 0), (0.3, 1), (0.59, 1), (2.0, 6), (2.1, 7)] {
        run.step_to(time).unwrap();
        assert_eq!(events(&mut run), count, "{time}");
    }
    assert_eq!(run.work().time_events, 7);
}

/// Times that are added up differ from those of the events, 0.3 apart, by rounding.
#[test]
fn time_events_at_the_end_of_a_step_up_to_rounding_come_in_it() {
    let (mut run, mut time) = (default("counter", 0, 0), 0.0);
    for step in 1..=60 {
        time += 0.1;
        run.step_to(time).unwrap();
        assert_eq!(events(&mut run), step / 3, "{time}");
        assert!((run.time() - time).abs() < 1e-12, "{time}");
    }
}

#[test]
fn states_and_nominals_may_jump_over_several_rounds() {
    let mut run = default("jump", 1, 0);
    run.step_to(0.4).unwrap();
    assert_eq!(run.states(), [1.0]);
    run.step_to(1.0).unwrap();
    assert_eq!(run.states(), [21.0]);
    assert_eq!((events(&mut run), run.work().time_events), (2, 1));
}

#[test]
fn models_may_ask_for_events_after_steps() {
    // x rises with slope 1 and is set to zero after the first step at whose end it is 0.25 or more.
    let limited = RunOptions {
        longest_step: 0.1,
        ..RunOptions::default()
    };
    let mut run = begun("stepper@0.25", 1, 0, limited);
    run.step_to(1.0).unwrap();
    let work = run.work();
    assert_eq!(events(&mut run), work.step_events as i32);
    assert!((2..=4).contains(&work.step_events), "{work:?}");
    assert!(run.states()[0] < 0.35);
}

#[test]
fn models_may_end_the_simulation() {
    let mut run = default("end", 0, 0);
    assert_eq!(run.step_to(0.4).unwrap(), Reached::Target);
    assert_eq!(run.step_to(1.0).unwrap(), Reached::EndRequested(0.5));
    assert_eq!(run.step_to(2.0).unwrap(), Reached::EndRequested(0.5));
}

#[test]
fn an_event_iteration_that_never_ends_is_told() {
    let mut run = run_of("endless", 0, 0, RunOptions::default());
    initialize(run.instance());
    assert_eq!(
        run.begin(0.0).unwrap_err().to_string(),
        "at 0 s the FMU still wants new discrete states after 1000 rounds of the event iteration"
    );
}

#[test]
fn derivatives_that_are_discarded_make_steps_shorter() {
    // dx/dt = -√x from 1: x = (1 - t/2)²; it is discarded where x is negative.
    for method in BOTH {
        let mut run = begun("torricelli", 1, 0, options(1e-6, method));
        run.step_to(1.99).unwrap();
        let expected = (1.0f64 - 1.99 / 2.0).powi(2);
        assert!((run.states()[0] - expected).abs() < 1e-6, "{method:?}");
    }
}

#[test]
fn held_inputs_jump_and_sloped_inputs_rise() {
    let mut run = default("integrator", 1, 0);
    // Held: 1 s of 2, then 1 s of -1.
    run.set_inputs(&[21], &[2.0], None).unwrap();
    run.step_to(1.0).unwrap();
    run.set_inputs(&[21], &[-1.0], None).unwrap();
    run.step_to(2.0).unwrap();
    assert!((run.states()[0] - 1.0).abs() < 1e-9);
    assert_eq!(run.work().input_events, 2);
    // The same again is no event.
    run.set_inputs(&[21], &[-1.0], None).unwrap();
    assert_eq!(run.work().input_events, 2);
    // From -1 with slope 2 for 1 s: the integral is 0; where it goes on as it did, there is no event.
    run.set_inputs(&[21], &[-1.0], Some(&[2.0])).unwrap();
    run.step_to(2.5).unwrap();
    run.set_inputs(&[21], &[0.0], Some(&[2.0])).unwrap();
    run.step_to(3.0).unwrap();
    assert!((run.states()[0] - 1.0).abs() < 1e-9, "{:?}", run.states());
    assert_eq!(run.work().input_events, 2);
    let mut y = [0.0];
    run.instance().get_real(&[22], &mut y).unwrap();
    assert!((y[0] - 2.0).abs() < 1e-9, "x + u = 1 + 1, not {}", y[0]);
}

/// In steady flight a strict tolerance asks for corrections that are smaller than the rounding errors of the
/// derivatives; that must not cost thousands of short steps.
#[test]
fn rounding_errors_in_steady_flight_cost_no_steps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("quadcopter.fmu");
    let provenance = pilotage::export::Provenance::vehicle(None);
    let vehicle = Model::quadcopter(&Default::default());
    let export = pilotage::export::Export::new(&vehicle, &provenance);
    export.write(&path).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    let mut instance = library
        .instantiate("steady", InterfaceType::ModelExchange)
        .unwrap();
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.set_real(&[1], &[0.1]).unwrap();
    instance.exit_initialization_mode().unwrap();
    let mut run = ModelExchangeRun::new(instance, library.description(), RunOptions::default());
    run.set_tolerance(1e-10);
    run.begin(0.0).unwrap();
    for k in 1..=20 {
        run.step_to(2.0 * f64::from(k)).unwrap();
    }
    let work = run.work().solver;
    assert!(work.jacobians > 0 && work.steps < 1000, "{work:?}");
}
