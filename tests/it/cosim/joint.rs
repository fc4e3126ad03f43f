//! The closed loop of components goes to the directly integrated joint equations as the step shrinks.

use super::components::simulate;
use crate::joint_ode::Joint;
use pilotage::cosim::{Algorithm, Clock, Control, Coupling, NativeComponent, System};
use pilotage::models::{Model, Pilot, Quadcopter};

/// A pilot who brings the vehicle to its target: all poles of the loop are stable.
const THETA: [f64; 6] = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];
const TARGET: f64 = 10.0;
const STOP: f64 = 5.0;

/// Position and stick at `STOP` by the classical Runge-Kutta method with 20,000 steps.
fn reference() -> [f64; 2] {
    let joint = Joint {
        vehicle: Quadcopter::default(),
        pilot: Pilot::default(),
    };
    let n = joint.n_states();
    let f = |x: &[f64]| {
        let mut dx = vec![0.0; n];
        joint.derivative(x, &[TARGET], &THETA, &mut dx);
        dx
    };
    let plus = |x: &[f64], s: f64, dx: &[f64]| -> Vec<f64> {
        x.iter().zip(dx).map(|(x, dx)| x + s * dx).collect()
    };
    let steps = 20_000;
    let h = STOP / f64::from(steps);
    let mut x = vec![0.0; n];
    for _ in 0..steps {
        let k1 = f(&x);
        let k2 = f(&plus(&x, h / 2.0, &k1));
        let k3 = f(&plus(&x, h / 2.0, &k2));
        let k4 = f(&plus(&x, h, &k3));
        for i in 0..n {
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    [joint.measured(&x), joint.bounded(&x, &THETA)]
}

fn closed_loop() -> System {
    let mut system = System::new();
    let pilot = Model::pilot(&THETA, 1.0);
    let quadcopter = Model::quadcopter(&Quadcopter::default());
    system
        .add("pilot", Box::new(NativeComponent::new(pilot)))
        .unwrap();
    system
        .add("quadcopter", Box::new(NativeComponent::new(quadcopter)))
        .unwrap();
    system.connect("pilot.stick", "quadcopter.stick").unwrap();
    system.connect("quadcopter.z", "pilot.position").unwrap();
    system.set("pilot.target", &TARGET.to_string()).unwrap();
    system
}

/// Errors of position and stick at `STOP`.
fn errors(h: f64, coupling: impl Into<Coupling>, exact: [f64; 2]) -> [f64; 2] {
    let (_, recorder) = simulate(closed_loop(), STOP, h, coupling);
    let last = |name: &str| *recorder.series.column(name).unwrap().values.last().unwrap();
    [
        last("quadcopter.z") - exact[0],
        last("pilot.stick") - exact[1],
    ]
    .map(f64::abs)
}

/// With Jacobi both held inputs lag by h/2 on average, and all errors are of first order. With
/// Gauss-Seidel the vehicle steps first (the pilot's `error` depends on the position at once): it gets
/// the stick h/2 late, and the pilot gets the position h/2 early. Around the loop this cancels, so that
/// the stick is of second order, while the position, h/2 late, is of first.
#[test]
fn the_closed_loop_converges_at_the_expected_order() {
    let exact = reference();
    // Far enough from rest and from the stick's limit for the errors to mean something.
    let [z, stick] = exact;
    assert!(
        z > 1.0 && stick.abs() > 0.01 && stick.abs() < 1.0,
        "{z}, {stick}"
    );
    for (algorithm, orders) in [
        (Algorithm::Jacobi, [1.0, 1.0]),
        (Algorithm::GaussSeidel, [1.0, 2.0]),
    ] {
        let errors = [0.02, 0.01, 0.005, 0.0025].map(|h| errors(h, algorithm, exact));
        for signal in 0..2 {
            for pair in errors.windows(2) {
                let order = (pair[0][signal] / pair[1][signal]).log2();
                assert!(
                    (order - orders[signal]).abs() < 0.1,
                    "{algorithm}, signal {signal}: {errors:?}"
                );
            }
        }
        // Extrapolated to a step of 0, what is left of the position's error is of second order.
        let end = 2.0 * errors[3][0] - errors[2][0];
        assert!(end.abs() < 0.05 * errors[3][0], "{algorithm}: {errors:?}");
    }
}

/// At the step of the pilot's data, where Jacobi is off by centimetres after 5 s. The components follow ramps
/// and give the slopes of their outputs: the order is 3 at least.
#[test]
fn strong_coupling_of_pilot_and_quadcopter_is_exact_to_a_micrometre() {
    let exact = reference();
    let jacobi = errors(0.05, Algorithm::Jacobi, exact);
    assert!(jacobi[0] > 0.02, "{jacobi:?}");
    let strong = errors(0.05, Algorithm::Strong, exact);
    assert!(strong[0] < 1e-6 && strong[1] < 1e-6, "{strong:?}");
    let halved = errors(0.025, Algorithm::Strong, exact);
    let order = (strong[0] / halved[0]).log2();
    assert!(order > 3.0, "{strong:?} {halved:?}");
    let clock = Clock::new(0.0, STOP, 0.05).unwrap();
    let controlled = Coupling {
        control: Some(Control::new(1e-7, &clock)),
        ..Algorithm::Strong.into()
    };
    let controlled = errors(0.05, controlled, exact);
    assert!(controlled[0] < 1e-7, "{controlled:?}");
}
