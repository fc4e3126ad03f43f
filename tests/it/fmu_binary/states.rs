//! FMU states: got, set, serialized; and derivatives.

use super::raw::{Messages, Raw, call};
use super::{fly, pilot, quadcopter};
use pilotage::models::Model;
use pilotage_abi::fmi2::Status;
use pilotage_sdk::variable::reference;
use std::ptr::null_mut;

/// FMI rule 27: states of an instance, in memory and as bytes.
#[test]
fn what_follows_a_state_is_the_same_to_the_last_bit() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let (m1, m2) = (Messages::default(), Messages::default());
        let (instance, other) = (raw.instantiate(&m1), raw.instantiate(&m2));
        instance.initialize();
        fly(&instance, 0);
        let state = instance.get_state(null_mut());
        let bytes = instance.serialize(state);
        let go_on = |instance: &super::Instance| {
            let steps = [0.05, 0.2, 0.05];
            let mut time = 0.5;
            for h in steps {
                assert_eq!(instance.step(time, h), Status::OK);
                time += h;
            }
            instance.bits()
        };
        let expected = go_on(&instance);

        assert_eq!(call!(instance, SetFmuState, state), Status::OK);
        assert_eq!(go_on(&instance), expected, "set back");
        assert_eq!(call!(instance, SetFmuState, state), Status::OK);
        assert_eq!(instance.serialize(state), bytes, "a state outlives its use");

        // Another instance, which was never initialised, goes on from there.
        assert_eq!(call!(other, SetFmuState, state), Status::OK);
        assert_eq!(go_on(&other), expected, "another instance");

        let (status, copy) = other.deserialize(&bytes);
        assert_eq!(status, Status::OK);
        assert_eq!(call!(other, SetFmuState, copy), Status::OK);
        assert_eq!(go_on(&other), expected, "from bytes");

        // A state that is passed in again is overwritten, not leaked.
        let again = other.get_state(copy);
        assert_eq!(again, copy);
        assert_ne!(other.serialize(again), bytes);

        // It leads out of an error too.
        assert_eq!(instance.step(99.0, 1.0), Status::ERROR);
        assert_eq!(call!(instance, SetFmuState, state), Status::OK);
        assert_eq!(go_on(&instance), expected, "after an error");
        instance.free_state(state);
        other.free_state(copy);
        instance.free_state(null_mut());
    }
}

/// FMI rule 27: what is no state of this FMU.
#[test]
fn damaged_or_foreign_states_are_refused() {
    let raw = Raw::new(pilot());
    let foreign = Raw::new(Model::pilot(&[1.0, 0.5], 1.0));
    let (m1, m2) = (Messages::default(), Messages::default());
    let (instance, stranger) = (raw.instantiate(&m1), foreign.instantiate(&m2));
    let state = instance.get_state(null_mut());
    let bytes = instance.serialize(state);
    for broken in [
        &bytes[..bytes.len() - 1],
        &bytes[..5],
        &[],
        &[b"X", &bytes[1..]].concat(),
        &[&bytes[..], b"more"].concat(),
    ] {
        assert_eq!(instance.deserialize(broken), (Status::ERROR, null_mut()));
        assert!(m1.take()[0].contains("serializedState is no state of this FMU"));
    }
    assert_eq!(stranger.deserialize(&bytes), (Status::ERROR, null_mut()));
    assert!(m2.take()[0].contains("the GUID is"));
    assert_eq!(call!(stranger, SetFmuState, state), Status::ERROR);
    assert!(m2.take()[0].contains("belongs to an FMU with GUID"));

    let mut small = [0_i8; 10];
    let target = small.as_mut_ptr().cast();
    assert_eq!(
        call!(instance, SerializeFmuState, state, target, 10),
        Status::ERROR
    );
    assert!(m1.take()[0].contains("ask for their number first"));
    instance.free_state(state);
}

/// FMI rule 25: output derivatives.
#[test]
fn derivatives_of_outputs_agree_with_differences() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let messages = Messages::default();
        let instance = raw.instantiate(&messages);
        instance.initialize();
        fly(&instance, 1);
        let references: Vec<u32> = raw.model.outputs().map(reference).collect();
        let n = references.len();
        let (orders, mut slopes) = (vec![1; n], vec![f64::NAN; n]);
        let (r, o, s) = (references.as_ptr(), orders.as_ptr(), slopes.as_mut_ptr());
        assert_eq!(
            call!(instance, GetRealOutputDerivatives, r, n, o, s),
            Status::OK
        );
        let input = raw.model.variables()[0].name.clone();
        let before = instance.values();
        // The error's own slope is that of the last step; go on along it.
        let slope = if raw.model.n_states() == 3 {
            slopes[1]
        } else {
            0.0
        };
        assert_eq!(instance.slope(&input, slope), Status::OK);
        let h = 1e-6;
        assert_eq!(instance.step(0.5, h), Status::OK);
        let after = instance.values();
        for (i, slope) in raw.model.outputs().zip(slopes) {
            let difference = (after[i] - before[i]) / h;
            let tolerance = 1e-4 * (1.0 + slope.abs());
            assert!(
                (difference - slope).abs() < tolerance,
                "{i}: {difference} {slope}"
            );
        }
    }
}

/// FMI rule 29: exact derivatives of co-simulation.
#[test]
fn directional_derivatives_agree_with_differences() {
    let raw = Raw::new(pilot());
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    assert_eq!(instance.set("x2_start", 0.3), Status::OK);
    assert_eq!(instance.setup(None), Status::OK);
    assert_eq!(call!(instance, EnterInitializationMode), Status::OK);
    let unknowns = ["stick", "error"].map(|name| instance.reference(name));
    let derivative = |knowns: &[u32], seed: &[f64]| {
        let mut result = [f64::NAN; 2];
        let (u, k, s, r) = (
            unknowns.as_ptr(),
            knowns.as_ptr(),
            seed.as_ptr(),
            result.as_mut_ptr(),
        );
        let n = knowns.len();
        let status = call!(instance, GetDirectionalDerivative, u, 2, k, n, s, r);
        (status, result)
    };
    for known in [
        "target", "position", "theta1", "theta5", "x2_start", "x3_start",
    ] {
        let (status, exact) = derivative(&[instance.reference(known)], &[1.0]);
        assert_eq!(status, Status::OK);
        let here = instance.values();
        let h = 1e-6;
        let index = instance.reference(known) as usize - 1;
        assert_eq!(instance.set(known, here[index] + h), Status::OK);
        let there = instance.values();
        assert_eq!(instance.set(known, here[index]), Status::OK);
        for (unknown, exact) in unknowns.iter().zip(exact) {
            let i = *unknown as usize - 1;
            let difference = (there[i] - here[i]) / h;
            assert!(
                (difference - exact).abs() < 1e-8,
                "{known}: {difference} {exact}"
            );
        }
    }
    // Later, inputs alone are known; seeds add up.
    assert_eq!(call!(instance, ExitInitializationMode), Status::OK);
    let both = ["target", "position"].map(|name| instance.reference(name));
    assert_eq!(derivative(&both, &[2.0, 0.5]), (Status::OK, [0.0, 1.5]));
    let theta = [instance.reference("theta1")];
    assert_eq!(derivative(&theta, &[1.0]).0, Status::ERROR);
    assert!(messages.take()[0].contains("theta1 [1/s³] is not a known in state"));
}
