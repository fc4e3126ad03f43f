//! Model exchange through the C interface.

use super::raw::{Instance, Messages, Raw, call};
use super::{pilot, quadcopter};
use pilotage::models::Model;
use pilotage_abi::fmi2::{EventInfo, Status, Type};
use pilotage_sdk::variable::reference;
use std::ptr::null_mut;

/// An instance in continuous-time mode, with its first input set.
fn running<'r>(raw: &'r Raw, messages: &Messages, input: f64) -> Instance<'r> {
    let instance = raw.instantiate_as(Type::MODEL_EXCHANGE, messages);
    let name = raw.model.variables()[0].name.clone();
    assert_eq!(instance.set(&name, input), Status::OK);
    instance.initialize();
    let info = new_discrete_states(&instance);
    assert_eq!(info.new_discrete_states_needed, 0);
    assert_eq!(info.values_of_continuous_states_changed, 0);
    assert_eq!(info.next_event_time_defined, 0);
    assert_eq!(call!(instance, EnterContinuousTimeMode), Status::OK);
    instance
}

fn new_discrete_states(instance: &Instance) -> EventInfo {
    let mut info = EventInfo {
        new_discrete_states_needed: 7,
        terminate_simulation: 7,
        nominals_of_continuous_states_changed: 7,
        values_of_continuous_states_changed: 7,
        next_event_time_defined: 7,
        next_event_time: f64::NAN,
    };
    assert_eq!(
        call!(instance, NewDiscreteStates, &raw mut info),
        Status::OK
    );
    info
}

fn states(instance: &Instance) -> Vec<f64> {
    let mut x = vec![f64::NAN; instance.raw.model.n_states()];
    let n = x.len();
    assert_eq!(
        call!(instance, GetContinuousStates, x.as_mut_ptr(), n),
        Status::OK
    );
    x
}

fn derivatives(instance: &Instance, time: f64, x: &[f64]) -> Vec<f64> {
    let mut dx = vec![f64::NAN; x.len()];
    let n = x.len();
    assert_eq!(call!(instance, SetTime, time), Status::OK);
    assert_eq!(
        call!(instance, SetContinuousStates, x.as_ptr(), n),
        Status::OK
    );
    assert_eq!(
        call!(instance, GetDerivatives, dx.as_mut_ptr(), n),
        Status::OK
    );
    dx
}

/// Classical Runge–Kutta on the C functions.
fn integrate(instance: &Instance, stop: f64, steps: usize) {
    let h = stop / steps as f64;
    let mut x = states(instance);
    let shifted = |x: &[f64], k: &[f64], a: f64| -> Vec<f64> {
        x.iter().zip(k).map(|(x, k)| x + a * k).collect()
    };
    for i in 0..steps {
        let t = i as f64 * h;
        let k1 = derivatives(instance, t, &x);
        let k2 = derivatives(instance, t + h / 2.0, &shifted(&x, &k1, h / 2.0));
        let k3 = derivatives(instance, t + h / 2.0, &shifted(&x, &k2, h / 2.0));
        let k4 = derivatives(instance, t + h, &shifted(&x, &k3, h));
        for j in 0..x.len() {
            x[j] += h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
        }
        let (mut enter, mut terminate) = (7, 7);
        let (e, t) = (&raw mut enter, &raw mut terminate);
        assert_eq!(
            call!(instance, CompletedIntegratorStep, 1, e, t),
            Status::OK
        );
        assert_eq!((enter, terminate), (0, 0));
    }
    derivatives(instance, stop, &x);
}

#[test]
fn integrated_from_outside_it_goes_where_it_goes_by_itself() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let (m1, m2) = (Messages::default(), Messages::default());
        let outside = running(&raw, &m1, 0.4);
        integrate(&outside, 2.0, 4000);
        let inside = raw.instantiate(&m2);
        let name = raw.model.variables()[0].name.clone();
        assert_eq!(inside.set(&name, 0.4), Status::OK);
        inside.initialize();
        for k in 0..40 {
            assert_eq!(inside.step(f64::from(k) * 0.05, 0.05), Status::OK);
        }
        let compare = outside.values().into_iter().zip(inside.values());
        for (i, (a, b)) in compare.enumerate() {
            let name = &raw.model.variables()[i].name;
            assert!((a - b).abs() < 1e-7 * b.abs().max(1.0), "{name}: {a} {b}");
        }
        assert_eq!(call!(outside, Terminate), Status::OK);
        assert_eq!((m1.take(), m2.take()), (vec![], vec![]));
    }
}

/// FMI rule 29: the Jacobian of derivatives and outputs with respect to states and inputs.
#[test]
fn directional_derivatives_agree_with_differences() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let messages = Messages::default();
        let instance = running(&raw, &messages, 0.1);
        let table = raw.model.variable_table();
        let unknowns: Vec<u32> = (table.outputs().chain(table.derivatives()))
            .map(reference)
            .collect();
        let x: Vec<f64> = (0..table.n_states())
            .map(|i| 0.03 * i as f64 + 0.01)
            .collect();
        let all = |x: &[f64]| {
            derivatives(&instance, 0.0, x);
            instance.values()
        };
        let h = 1e-6;
        for (state, known) in table.states().enumerate() {
            derivatives(&instance, 0.0, &x);
            let (known, seed) = ([reference(known)], [2.0]);
            let mut result = vec![f64::NAN; unknowns.len()];
            let (u, n, k) = (unknowns.as_ptr(), unknowns.len(), known.as_ptr());
            let (s, r) = (seed.as_ptr(), result.as_mut_ptr());
            assert_eq!(
                call!(instance, GetDirectionalDerivative, u, n, k, 1, s, r),
                Status::OK
            );
            let moved = |h: f64| {
                let mut moved = x.clone();
                moved[state] += h;
                all(&moved)
            };
            let (plus, minus) = (moved(h), moved(-h));
            for (unknown, exact) in unknowns.iter().zip(result) {
                let i = *unknown as usize - 1;
                let difference = 2.0 * (plus[i] - minus[i]) / (2.0 * h);
                let tolerance = 1e-7 * exact.abs().max(1.0);
                assert!(
                    (difference - exact).abs() < tolerance,
                    "{difference} {exact}"
                );
            }
        }
    }
}

/// FMI rule 27: a state taken in continuous-time mode brings all back, in another instance too.
#[test]
fn states_of_model_exchange_repeat_to_the_last_bit() {
    let raw = Raw::new(quadcopter());
    let (m1, m2, m3) = (
        Messages::default(),
        Messages::default(),
        Messages::default(),
    );
    let (instance, other) = (
        running(&raw, &m1, 0.2),
        raw.instantiate_as(Type::MODEL_EXCHANGE, &m2),
    );
    integrate(&instance, 0.5, 20);
    let state = instance.get_state(null_mut());
    let (status, copy) = other.deserialize(&instance.serialize(state));
    assert_eq!(status, Status::OK);
    let bits = |i: &Instance| -> Vec<u64> {
        let x = states(i);
        let dx = derivatives(i, 0.7, &x);
        dx.iter().map(|v| v.to_bits()).chain(i.bits()).collect()
    };
    assert_eq!(call!(other, SetFmuState, copy), Status::OK);
    assert_eq!(bits(&other), bits(&instance));

    // It is no state of an instance for co-simulation.
    let cs = raw.instantiate(&m3);
    assert_eq!(call!(cs, SetFmuState, state), Status::ERROR);
    assert!(m3.take()[0].contains("it is for model exchange, but this instance was made for co-s"));
    instance.free_state(state);
    other.free_state(copy);
}

/// A solver that comes upon such a value may try a shorter step, and a reset leads back in any case.
#[test]
fn values_that_are_no_numbers_do_no_harm() {
    let raw = Raw::new(pilot());
    let messages = Messages::default();
    let instance = running(&raw, &messages, 0.0);
    for value in [f64::NAN, f64::INFINITY] {
        assert_eq!(instance.set("target", value), Status::DISCARD);
        assert!(messages.take()[0].contains("target [m] = "));
    }
    assert_eq!(instance.set("target", 2.0), Status::OK);
    assert_eq!(call!(instance, EnterEventMode), Status::OK);
    assert_eq!(instance.set("theta1", f64::NAN), Status::DISCARD);
    assert_eq!(instance.set("theta1", 2.0), Status::OK);
    assert_eq!(messages.take().len(), 1);
    // Before the simulation nobody tries again: an error, from which a reset leads back.
    assert_eq!(call!(instance, Reset), Status::OK);
    assert_eq!(instance.set("theta1", f64::NAN), Status::ERROR);
    assert_eq!(call!(instance, Reset), Status::OK);
    assert_eq!(instance.set("theta1", 2.0), Status::OK);
}

/// The range of an input says where the model holds; who looks beyond it is not refused.
#[test]
fn inputs_have_a_range_and_may_leave_it() {
    let raw = Raw::new(quadcopter());
    let stick = &raw.model.variables()[0];
    assert_eq!(
        (stick.name.as_str(), stick.min, stick.max),
        ("stick", Some(-1.0), Some(1.0))
    );
    let messages = Messages::default();
    let instance = running(&raw, &messages, 0.0);
    assert_eq!(instance.set("stick", 1.0 + 1e-9), Status::OK);
    assert_eq!(messages.take(), [""; 0]);
}

#[test]
fn what_the_solver_does_wrong_is_told() {
    let raw = Raw::new(Model::pilot(&[1.0, 1.0], 1.0));
    let message = |wrong: &dyn Fn(&Instance) -> Status, expected: Status| {
        let messages = Messages::default();
        let instance = running(&raw, &messages, 0.0);
        assert_eq!(wrong(&instance), expected);
        messages.take().concat()
    };
    let (mut two, mut nan) = ([0.0; 2], [f64::NAN]);
    let two = two.as_mut_ptr();
    type Wrong<'w> = (&'w dyn Fn(&Instance) -> Status, Status, &'w str);
    let errors: [Wrong; 7] = [
        (
            &|i| call!(i, SetTime, -1.0),
            Status::ERROR,
            "fmi2SetTime: time = -1 s; pass a finite number not before the start time 0 s",
        ),
        (
            &|i| call!(i, SetContinuousStates, two, 2),
            Status::ERROR,
            "fmi2SetContinuousStates: nx = 2, but there are 1",
        ),
        (
            &|i| call!(i, SetContinuousStates, nan.as_ptr(), 1),
            Status::DISCARD,
            "fmi2SetContinuousStates: x1 [m·s] is NaN at 0 s; the solver should take a smaller step",
        ),
        (
            &|i| call!(i, GetDerivatives, two, 2),
            Status::ERROR,
            "fmi2GetDerivatives: nx = 2, but there are 1",
        ),
        (
            &|i| call!(i, GetEventIndicators, two, 2),
            Status::ERROR,
            "fmi2GetEventIndicators: ni = 2, but there are 0",
        ),
        (
            &|i| i.set("theta1", 2.0),
            Status::ERROR,
            "fmi2SetReal: theta1 [1/s] is tunable and cannot be set in state \"continuous-time \
             mode\"; set it in event mode",
        ),
        (
            &|i| i.set("x1", 2.0),
            Status::ERROR,
            "fmi2SetReal: x1 [m·s] is a state and cannot be set; set x1_start before the start, or \
             the states as a whole",
        ),
    ];
    for (wrong, status, expected) in errors {
        let logged = message(wrong, status);
        assert!(logged.ends_with(expected), "{logged}\n{expected}");
    }
    nan[0] = 0.0;
    let silent = message(
        &|i| call!(i, SetContinuousStates, nan.as_ptr(), 1),
        Status::OK,
    );
    assert_eq!(silent, "");
}
