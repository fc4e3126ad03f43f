//! Linear systems from their impulse responses.

use nalgebra::DMatrix;
use pilotage_linear::*;

/// An unstable oscillation, an integrator chain and a fast mode, with two inputs, two outputs and feedthrough.
fn system() -> StateSpace {
    let rows = [
        [0.1, 3.0, 0.0, 0.0, 0.5],
        [-3.0, 0.1, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, -8.0],
    ];
    let names = |prefix: &str, n: usize| (1..=n).map(|k| format!("{prefix}{k}")).collect();
    StateSpace {
        a: DMatrix::from_fn(5, 5, |i, j| rows[i][j]),
        b: DMatrix::from_row_slice(5, 2, &[0.0, 1.0, 0.0, 0.0, 0.0, 0.2, 0.3, 0.0, 100.0, 0.0]),
        c: DMatrix::from_row_slice(2, 5, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.001, 2.0, 0.0, 0.0]),
        d: DMatrix::from_row_slice(2, 2, &[0.0, 0.7, 0.0, 0.0]),
        states: names("x", 5),
        inputs: names("u", 2),
        outputs: names("y", 2),
    }
}

/// Responses by the exponential of the whole system including the inputs.
fn pulses(system: &StateSpace, step: f64) -> Vec<DMatrix<f64>> {
    let (n, m) = system.b.shape();
    let mut all = DMatrix::zeros(n + m, n + m);
    all.view_mut((0, 0), (n, n)).copy_from(&system.a);
    all.view_mut((0, n), (n, m)).copy_from(&system.b);
    let exponential = (all * step).exp();
    let phi = exponential.view((0, 0), (n, n)).into_owned();
    let mut x = exponential.view((0, n), (n, m)).into_owned();
    (0..steps_needed(m, system.outputs.len()))
        .map(|k| {
            let mut y = &system.c * &x;
            if k == 0 {
                y += &system.d;
            }
            x = &phi * &x;
            y
        })
        .collect()
}

#[test]
fn a_system_comes_back_from_its_responses() {
    let exact = system();
    let names = (exact.inputs.clone(), exact.outputs.clone());
    let found = realize(&pulses(&exact, 0.05), 0.05, names.0, names.1).unwrap();
    assert_eq!(found.system.states.len(), 5, "{:?}", found.singular_values);
    assert!(
        (&found.system.d - &exact.d).amax() < 1e-8,
        "{}",
        found.system.d
    );
    for omega in [0.1, 1.0, 3.0, 10.0, 40.0] {
        let s = nalgebra::Complex::new(0.0, omega);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let of = |system: &StateSpace| system.transfer(i, j, s);
            let (found, exact) = (of(&found.system), of(&exact));
            assert!(
                (found - exact).norm() < 1e-6 * exact.norm(),
                "{omega} {i} {j}: {found} {exact}"
            );
        }
    }
}

#[test]
fn what_cannot_be_found_is_said() {
    let names = |prefix: &str, n: usize| (1..=n).map(|k| format!("{prefix}{k}")).collect();
    // A delay of one step has no logarithm.
    let mut delay = vec![DMatrix::zeros(1, 1); steps_needed(1, 1)];
    delay[1][(0, 0)] = 1.0;
    let error = realize(&delay, 0.1, names("u", 1), names("y", 1)).unwrap_err();
    assert_eq!(error, RealizationError::Logarithm { step: 0.1 });
    // Noise.
    let noise: Vec<DMatrix<f64>> = (0..steps_needed(1, 1))
        .map(|k| DMatrix::from_element(1, 1, (1e5 * f64::from(k as u32).sin()).fract()))
        .collect();
    let error = realize(&noise, 0.1, names("u", 1), names("y", 1)).unwrap_err();
    assert!(matches!(error, RealizationError::Order { .. }), "{error}");
}

/// The decomposition would not end for a response that is not a number.
#[test]
fn a_response_that_is_no_number_is_named() {
    let exact = system();
    let mut pulses = pulses(&exact, 0.05);
    pulses[7][(1, 0)] = f64::NAN;
    let error = realize(&pulses, 0.05, exact.inputs, exact.outputs).unwrap_err();
    assert_eq!(
        error.to_string(),
        "its `y2` is NaN after a pulse of `u1`, so that nothing can be found of its states; run it to a \
         time at which it is finite"
    );
}

/// Without states there is only feedthrough.
#[test]
fn a_gain_has_no_states() {
    let mut gain = vec![DMatrix::zeros(1, 1); steps_needed(1, 1)];
    gain[0][(0, 0)] = 3.0;
    let found = realize(&gain, 0.1, vec!["u".into()], vec!["y".into()]).unwrap();
    assert_eq!(
        (found.system.states.len(), found.system.d[(0, 0)]),
        (0, 3.0)
    );
}

/// One mode, from an integrator to fast ones: the Hankel matrix of its responses has rank one to the last bit.
#[test]
fn one_mode_comes_back_however_slow_it_is() {
    for k in 0..60 {
        let pole = if k == 0 { 0.0 } else { -3.0 / 1.12_f64.powi(k) };
        let decay = pole.exp();
        let responses: Vec<DMatrix<f64>> = (0..steps_needed(1, 1))
            .map(|step| DMatrix::from_element(1, 1, 0.7 * decay.powi(step as i32)))
            .collect();
        let names = |name: &str| vec![name.to_owned()];
        let found = realize(&responses, 1.0, names("u"), names("y")).unwrap();
        let poles = found.system.poles();
        assert_eq!(poles.len(), 1);
        assert!((poles[0].re - pole).abs() < 1e-12, "{pole}: {}", poles[0]);
    }
}
