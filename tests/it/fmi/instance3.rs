//! Instances of a foreign FMU of FMI 3.0, of all kinds.

use crate::foreign;
use pilotage::fmi::instance::{Fraction, Number};
use pilotage::fmi::{
    CallError, Fmu, FmuError, Instance, InstanceOptions, InterfaceType, IntermediateUpdate,
    ModelExchangeRun, Reached, RunOptions, Step,
};
use pilotage_abi::fmi3::{DependencyKind, Function, IntervalQualifier, State};
use std::path::{MAIN_SEPARATOR, Path};
use std::sync::{Arc, Mutex};
use tempfile::tempdir;

fn made(
    behaviour: &str,
    kind: InterfaceType,
    options: InstanceOptions,
) -> Result<Instance, FmuError> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    std::fs::write(&path, foreign::fmu3(behaviour)).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    assert_eq!(library.bindings().count(), 1);
    library.instantiate_with("here", kind, options)
}

fn initialized(behaviour: &str, kind: InterfaceType, options: InstanceOptions) -> Instance {
    let mut instance = made(behaviour, kind, options).unwrap();
    instance.setup_experiment(Some(1e-4), 0.0, 2.0).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

fn co_simulation(behaviour: &str) -> Instance {
    initialized(
        behaviour,
        InterfaceType::CoSimulation,
        InstanceOptions::default(),
    )
}

fn real(instance: &mut Instance, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    instance.get_real(&[reference], &mut value).unwrap();
    value[0]
}

fn echo<T: Number + PartialEq + std::fmt::Debug>(i: &mut Instance, vr: u32, from: T, to: T) {
    i.set(&[vr], &[from]).unwrap();
    let mut values = [T::default()];
    i.get(&[vr + 20], &mut values).unwrap();
    assert_eq!(values, [to]);
}

#[test]
fn values_of_every_type() {
    let mut i = co_simulation("good");
    echo(&mut i, 10, 1.5f32, 2.5);
    echo(&mut i, 11, -128i8, -127);
    echo(&mut i, 12, 254u8, 255);
    echo(&mut i, 13, i16::MIN, i16::MIN + 1);
    echo(&mut i, 14, u16::MAX - 1, u16::MAX);
    echo(&mut i, 15, i32::MIN, i32::MIN + 1);
    echo(&mut i, 16, u32::MAX - 1, u32::MAX);
    echo(&mut i, 17, i64::MIN, i64::MIN + 1);
    echo(&mut i, 18, u64::MAX - 1, u64::MAX);
    // The FMU writes the byte 2 for true.
    for value in [true, false] {
        i.set_boolean(40, value).unwrap();
        assert_eq!(i.get_boolean(40).unwrap(), value);
        assert_eq!(i.get_boolean(60).unwrap(), !value);
    }
    i.set_string(41, "größe").unwrap();
    assert_eq!(i.get_string(61).unwrap(), "größe");
    for bytes in [&b"\0\xff\0binary"[..], b""] {
        i.set_binaries(&[42], &[bytes]).unwrap();
        assert_eq!(i.get_binaries(&[62, 62], 2).unwrap(), [bytes, bytes]);
    }
    let mut experiment = [0.0; 3];
    i.get_real(&[4, 5, 6], &mut experiment).unwrap();
    assert_eq!(experiment, [1e-4, 0.0, 2.0]);
}

#[test]
fn arrays_have_the_sizes_that_structural_parameters_give_them() {
    let mut i = made(
        "good",
        InterfaceType::CoSimulation,
        InstanceOptions::default(),
    )
    .unwrap();
    i.enter_configuration_mode().unwrap();
    assert_eq!(i.state(), State::ConfigurationMode.into());
    i.set(&[71], &[4u64]).unwrap();
    i.exit_configuration_mode().unwrap();
    assert_eq!(i.state(), State::Instantiated.into());
    i.enter_initialization_mode().unwrap();
    // An array and a scalar in one call.
    i.set_real(&[70, 1], &[1.0, 2.0, 3.0, 4.0, 9.0]).unwrap();
    i.exit_initialization_mode().unwrap();
    let mut values = [0.0; 5];
    i.get_real(&[1, 72], &mut values).unwrap();
    assert_eq!(values, [9.0, 1.0, 3.0, 6.0, 10.0]);
    // Reconfiguration leads back to where it came from.
    i.enter_configuration_mode().unwrap();
    assert_eq!(i.state(), State::ReconfigurationMode.into());
    i.exit_configuration_mode().unwrap();
    assert_eq!(i.state(), State::StepMode.into());
}

// FMI rule 19: where the resources are; in FMI 3.0 a path with a separator at its end.
#[test]
fn resources_are_an_absolute_path_with_a_separator_at_its_end() {
    let path = co_simulation("good").get_string(45).unwrap();
    assert!(
        path.ends_with(&format!("resources{MAIN_SEPARATOR}")),
        "{path}"
    );
    assert!(Path::new(&path).is_absolute());
}

#[test]
fn steps_end_early_discarded_or_with_a_wish_to_end() {
    let mut i = co_simulation("good");
    i.set_real(&[1], &[2.0]).unwrap();
    assert_eq!(i.do_step(0.0, 0.5).unwrap(), Step::Done);
    let expected = 2.0 * (1.0 - (-0.5f64).exp());
    assert!((real(&mut i, 2) - expected).abs() < 1e-15);
    let mut derivatives = [0.0; 1];
    i.get_output_derivatives(&[2], &[1], &mut derivatives)
        .unwrap();
    assert!((derivatives[0] - (2.0 - expected)).abs() < 1e-15);

    let discarded = Step::Discarded {
        last_successful: Some(0.25),
        is_end_requested: false,
    };
    let mut i = co_simulation("discard@0.25");
    assert_eq!(i.do_step(0.0, 0.5).unwrap(), discarded);
    assert_eq!(i.state(), State::StepMode.into());
    let stopped = |reached, is_event, is_end_requested| Step::Stopped {
        reached,
        is_event,
        is_end_requested,
    };
    let ended = co_simulation("end").do_step(0.0, 0.5).unwrap();
    assert_eq!(ended, stopped(0.5, false, true));

    // Without event mode the FMU keeps its events for itself.
    assert_eq!(
        co_simulation("event@0.3").do_step(0.0, 0.5).unwrap(),
        Step::Done
    );
    let options = InstanceOptions {
        event_mode_used: true,
        early_return_allowed: true,
        ..InstanceOptions::default()
    };
    let mut i = initialized("event@0.3", InterfaceType::CoSimulation, options);
    assert_eq!(i.state(), State::EventMode.into());
    i.evaluate_discrete_states().unwrap();
    let update = i.update_discrete_states().unwrap();
    assert_eq!((update.needs_another, update.next_time), (false, Some(5.0)));
    i.enter_step_mode().unwrap();
    assert_eq!(i.do_step(0.0, 0.5).unwrap(), stopped(0.3, true, false));
    i.enter_event_mode().unwrap();
    i.update_discrete_states().unwrap();
    i.enter_step_mode().unwrap();
    assert_eq!(i.do_step(0.3, 0.2).unwrap(), Step::Done);
}

/// What an importer sees and does within a step.
fn watched(update: IntermediateUpdate) -> Instance {
    let options = InstanceOptions {
        early_return_allowed: true,
        required_intermediate_variables: vec![1, 2],
        intermediate_update: Some(update),
        ..InstanceOptions::default()
    };
    initialized("good", InterfaceType::CoSimulation, options)
}

#[test]
fn a_closure_sees_and_sets_variables_within_a_step() {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let log = seen.clone();
    let update = IntermediateUpdate::new(move |within| {
        let mut y = [0.0];
        within.get_real(&[2], &mut y).unwrap();
        log.lock().unwrap().push((within.time, y[0]));
        // The input jumps in the middle of the step.
        within.set_real(&[1], &[3.0]).unwrap();
        (within.time >= 2.0).then_some(within.time)
    });
    let mut i = watched(update);
    i.set_real(&[1], &[1.0]).unwrap();
    assert_eq!(
        i.do_step(0.0, 2.0).unwrap(),
        Step::Stopped {
            reached: 2.0,
            is_event: false,
            is_end_requested: false,
        }
    );
    let middle = 1.0 - (-1f64).exp();
    let end = 3.0 + (middle - 3.0) * (-1f64).exp();
    let seen = seen.lock().unwrap();
    assert_eq!(seen.len(), 2);
    assert!((seen[0].1 - middle).abs() < 1e-15 && (seen[1].1 - end).abs() < 1e-15);
    assert_eq!((seen[0].0, seen[1].0), (1.0, 2.0));
}

#[test]
fn a_panic_of_the_closure_goes_past_the_fmu() {
    let mut i = watched(IntermediateUpdate::new(|_| panic!("of the closure")));
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| i.do_step(0.0, 1.0)));
    assert_eq!(caught.unwrap_err().downcast_ref(), Some(&"of the closure"));
    // The FMU came back, so that the instance lives on.
    assert!(real(&mut i, 2).is_finite());
}

/// The FMU takes the number of values from its variables: it would read and write beyond a shorter list.
#[test]
fn numbers_of_values_are_those_of_the_variables() {
    let panics = |call: &mut dyn FnMut(&mut Instance)| {
        let mut i = co_simulation("good");
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| call(&mut i))).is_err()
    };
    assert!(panics(&mut |i| _ = i.set_real(&[1, 3], &[1.0])));
    assert!(panics(&mut |i| _ = i.get_real(&[1; 100_000], &mut [0.0])));
    assert!(panics(&mut |i| _ = i.get_real(&[1], &mut [0.0; 2])));
    assert!(panics(&mut |i| _ = i.set_booleans(&[40], &[])));
    // A structural parameter says how many values the array has; the scalar beside it is one.
    assert!(!panics(&mut |i| i
        .get_real(&[1, 70], &mut [0.0; 4])
        .unwrap()));
    assert!(panics(&mut |i| _ = i.get_real(&[1, 70], &mut [])));
}

#[test]
fn times_before_a_step_and_beside_the_numbers_are_absurd() {
    for behaviour in ["past", "nowhere"] {
        let error = co_simulation(behaviour).do_step(1.0, 0.5).unwrap_err();
        let CallError::Absurd { what, .. } = error else {
            panic!("{behaviour}: {error}")
        };
        assert!(
            what.contains("as the last successful time of a step from 1.0 s to 1.5 s"),
            "{what}"
        );
    }
    // An FMU may say where the last of its own steps ended.
    for (behaviour, last) in [("unsaid", 1.25), ("beyond", 2.0), ("unwritten", 0.0)] {
        let mut instance = co_simulation(behaviour);
        assert_eq!(instance.do_step(1.0, 0.5).unwrap(), Step::Done);
        assert_eq!(instance.last_successful_time(), last);
    }
}

#[test]
fn the_end_of_the_simulation_may_lie_within_a_step() {
    let ended = co_simulation("end-within").do_step(1.0, 0.5).unwrap();
    let end = Step::Stopped {
        reached: 1.25,
        is_event: false,
        is_end_requested: true,
    };
    assert_eq!(ended, end);
}

#[test]
fn states_go_to_bytes_and_into_another_instance() {
    let mut i = co_simulation("good");
    i.set_real(&[1], &[1.0]).unwrap();
    i.do_step_revocably(0.0, 0.5).unwrap();
    let saved = i.save().unwrap();
    let bytes = i.serialize(saved).unwrap();
    i.do_step_revocably(0.5, 0.5).unwrap();
    let end = real(&mut i, 2);
    let mut other = made(
        "good",
        InterfaceType::CoSimulation,
        InstanceOptions::default(),
    )
    .unwrap();
    let read = other.deserialize(&bytes).unwrap();
    other.restore(read).unwrap();
    assert_eq!(other.state(), State::StepMode.into());
    other.do_step(0.5, 0.5).unwrap();
    assert_eq!(real(&mut other, 2), end);
    let mut cut = bytes.clone();
    cut.bytes.pop();
    assert!(matches!(
        other.deserialize(&cut),
        Err(CallError::Failed { .. })
    ));

    let mut me = initialized(
        "good",
        InterfaceType::ModelExchange,
        InstanceOptions::default(),
    );
    let saved = me.save().unwrap();
    let error = me.serialize(saved).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the FMU declares canSerializeFMUState=\"false\""
    );
}

#[test]
fn clocks_tick_and_partitions_run() {
    let mut i = initialized(
        "good",
        InterfaceType::ScheduledExecution,
        InstanceOptions::default(),
    );
    assert_eq!(i.state(), State::ClockActivationMode.into());
    let interval = i.get_intervals(&[80]).unwrap()[0];
    assert_eq!(
        (interval.value, interval.qualifier),
        (0.5, IntervalQualifier::CHANGED)
    );
    i.set_intervals(&[80], &[0.25]).unwrap();
    let fraction = i.get_interval_fractions(&[80]).unwrap()[0];
    let quarter = Fraction {
        counter: 250,
        resolution: 1000,
    };
    assert_eq!(
        (fraction.value, fraction.qualifier),
        (quarter, IntervalQualifier::UNCHANGED)
    );
    i.set_interval_fractions(
        &[80],
        &[Fraction {
            counter: 1,
            resolution: 8,
        }],
    )
    .unwrap();
    assert_eq!(i.get_intervals(&[80]).unwrap()[0].value, 0.125);
    i.set_shifts(&[80], &[0.25]).unwrap();
    assert_eq!(i.get_shift_fractions(&[80]).unwrap(), [quarter]);
    i.set_shift_fractions(
        &[80],
        &[Fraction {
            counter: 1,
            resolution: 2,
        }],
    )
    .unwrap();
    assert_eq!(i.get_shifts(&[80]).unwrap(), [0.5]);
    i.set_clocks(&[80], &[true]).unwrap();
    let mut clocks = [false; 2];
    i.get_clocks(&[80, 81], &mut clocks).unwrap();
    assert_eq!(clocks, [true, false]);
    assert!(!i.take_clocks_changed());
    for tick in 1..=3 {
        i.activate_model_partition(80, f64::from(tick) * 0.5)
            .unwrap();
        assert!(i.take_clocks_changed() && !i.take_clocks_changed());
    }
    assert_eq!(i.get_integer(50).unwrap(), 3);
    assert!(i.activate_model_partition(81, 2.0).is_err());
    assert_eq!(i.state(), State::Error.into());
}

#[test]
fn model_exchange_of_fmi_3_is_integrated() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    std::fs::write(&path, foreign::fmu3("good")).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    let instance = library
        .instantiate("here", InterfaceType::ModelExchange)
        .unwrap();
    let mut run = ModelExchangeRun::new(instance, library.description(), RunOptions::default());
    let i = run.instance();
    i.setup_experiment(None, 0.0, None).unwrap();
    i.set_real(&[3], &[2.0]).unwrap();
    i.enter_initialization_mode().unwrap();
    i.exit_initialization_mode().unwrap();
    run.begin(0.0).unwrap();
    let mut derivative = [0.0];
    let i = run.instance();
    i.directional_derivative(&[91], &[90], &[3.0], &mut derivative)
        .unwrap();
    assert_eq!(derivative, [-6.0]);
    i.adjoint_derivative(&[91], &[90], &[0.5], &mut derivative)
        .unwrap();
    assert_eq!(derivative, [-1.0]);
    // x = exp(-2 t) falls below 1/2 at ln 2 / 2.
    let event = std::f64::consts::LN_2 / 2.0;
    for (time, count) in [(event - 1e-6, 1), (event + 1e-6, 2), (1.0, 2)] {
        assert_eq!(run.step_to(time).unwrap(), Reached::Target);
        assert_eq!(run.instance().get_integer(50).unwrap(), count);
        assert!((run.states()[0] - (-2.0 * time).exp()).abs() < 1e-6);
    }
    run.instance().terminate().unwrap();
}

#[test]
fn dependencies_are_told() {
    let mut i = co_simulation("good");
    let on: Vec<u32> = (i.variable_dependencies(2).unwrap().iter())
        .filter(|d| d.kind == DependencyKind::DEPENDENT && (d.element, d.on_element) == (0, 0))
        .map(|d| d.on)
        .collect();
    assert_eq!(on, [1, 3]);
    assert!(i.variable_dependencies(3).unwrap().is_empty());
}

#[test]
fn what_the_version_the_kind_or_the_state_does_not_have_is_refused() {
    let mut i = co_simulation("good");
    let version = i.set_input_derivatives(&[1], &[1], &[0.0]).unwrap_err();
    assert_eq!(
        version.to_string(),
        "the FMU is of FMI 3.0, which has nothing like fmi2SetRealInputDerivatives"
    );
    let (function, state) = (Function::SetTime.into(), State::StepMode.into());
    assert_eq!(
        i.set_time(1.0),
        Err(CallError::NotAllowed { function, state })
    );
    i.terminate().unwrap();
    let (function, state) = (Function::DoStep.into(), State::Terminated.into());
    assert_eq!(
        i.do_step(0.0, 0.1),
        Err(CallError::NotAllowed { function, state })
    );

    // The token is wrong; the message is plain text, not a format.
    let refused = made(
        "refuse",
        InterfaceType::CoSimulation,
        InstanceOptions::default(),
    )
    .unwrap_err();
    let FmuError::Instantiate { source, .. } = refused else {
        panic!("{refused}");
    };
    assert_eq!(
        source.to_string(),
        "fmi3InstantiateCoSimulation refused: 100 %s of the tokens are wrong"
    );
    let messages = made(
        "log",
        InterfaceType::ModelExchange,
        InstanceOptions::default(),
    )
    .unwrap()
    .take_messages();
    assert_eq!(messages[0].text, "plain %d text");
}
