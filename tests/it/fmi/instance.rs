//! Instances of foreign FMUs: what real FMUs need of an importer, and what broken ones do to it.

use crate::foreign;
use pilotage::fmi::{CallError, Fmu, Instance, Kind, Step};
use pilotage_abi::fmi2::{Function, State, Status};
use std::path::Path;
use tempfile::tempdir;

fn instance_of(content: &[u8]) -> Instance {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    std::fs::write(&path, content).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    library.instantiate("here", Kind::CoSimulation).unwrap()
}

/// An instance at the start time.
fn ready(behaviour: &str) -> Instance {
    let mut instance = instance_of(&foreign::fmu(behaviour));
    instance.setup_experiment(Some(1e-4), 0.0, 1.0).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

fn y(instance: &mut Instance) -> f64 {
    let mut value = [f64::NAN];
    instance.get_real(&[1], &mut value).unwrap();
    value[0]
}

#[test]
fn steps_and_values_of_every_type() {
    let mut instance = ready("never-back");
    instance.set_real(&[0], &[2.0]).unwrap();
    instance.set_integer(0, 41).unwrap();
    instance.set_boolean(0, false).unwrap();
    instance.set_string(0, "größe").unwrap();
    assert_eq!(instance.do_step(0.0, 0.5).unwrap(), Step::Done);
    assert_eq!(y(&mut instance), 2.0 * (1.0 - (-0.5f64).exp()));
    assert_eq!(instance.get_integer(1).unwrap(), 42);
    assert!(instance.get_boolean(1).unwrap());
    assert_eq!(instance.get_string(1).unwrap(), "größe");
    let mut experiment = [0.0; 3];
    instance.get_real(&[3, 4, 5], &mut experiment).unwrap();
    assert_eq!(experiment, [1e-4, 0.0, 1.0]);
    instance.terminate().unwrap();
    assert_eq!(instance.state(), State::Terminated.into());
}

#[test]
fn nothing_illegal_reaches_the_fmu() {
    let mut instance = instance_of(&foreign::fmu("good"));
    let refused = |result: Result<(), CallError>, function: Function, state: State| {
        let (function, state) = (function.into(), state.into());
        assert_eq!(result, Err(CallError::NotAllowed { function, state }));
    };
    use Function::*;
    use State::*;
    refused(instance.do_step(0.0, 0.1).map(|_| ()), DoStep, Instantiated);
    refused(instance.get_real(&[1], &mut [0.0]), GetReal, Instantiated);
    refused(
        instance.exit_initialization_mode(),
        ExitInitializationMode,
        Instantiated,
    );
    instance.setup_experiment(None, 0.0, 1.0).unwrap();
    instance.enter_initialization_mode().unwrap();
    refused(instance.terminate(), Terminate, InitializationMode);
    instance.exit_initialization_mode().unwrap();
    refused(
        instance.enter_initialization_mode(),
        EnterInitializationMode,
        StepComplete,
    );
    instance.terminate().unwrap();
    refused(instance.set_real(&[0], &[1.0]), SetReal, Terminated);
    instance.reset().unwrap();
    instance.setup_experiment(None, 0.0, 1.0).unwrap();
}

#[test]
fn failed_calls_carry_what_the_fmu_said() {
    let mut instance = ready("error@0.2");
    instance.do_step(0.0, 0.1).unwrap();
    let error = instance.do_step(0.1, 0.2).unwrap_err();
    assert_eq!(
        error.to_string(),
        "fmi2DoStep returned fmi2Error: the solver failed"
    );
    assert_eq!(instance.state(), State::Error.into());
    // For debugging, values may still be read.
    assert!(y(&mut instance).is_finite());
    assert!(instance.do_step(0.1, 0.1).is_err());

    let error = ready("silent-error").do_step(0.0, 0.1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "fmi2DoStep returned fmi2Error without a message"
    );
    let error = ready("odd-status").do_step(0.0, 0.1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "fmi2DoStep returned 42, which is no fmi2Status without a message"
    );
    let mut instance = ready("fatal");
    assert!(matches!(
        instance.do_step(0.0, 0.1),
        Err(CallError::Failed {
            status: Status::FATAL,
            ..
        })
    ));
    assert_eq!(instance.state(), State::Fatal.into());
    assert!(matches!(
        instance.reset(),
        Err(CallError::NotAllowed { .. })
    ));
}

#[test]
fn warnings_go_on_and_pending_steps_are_waited_for() {
    for behaviour in ["warn", "pending"] {
        let mut instance = ready(behaviour);
        instance.set_real(&[0], &[1.0]).unwrap();
        assert_eq!(instance.do_step(0.0, 1.0).unwrap(), Step::Done);
        assert_eq!(y(&mut instance), 1.0 - (-1.0f64).exp());
    }
}

#[test]
fn discarded_steps_say_how_far_they_came() {
    let step = |behaviour| ready(behaviour).do_step(0.0, 0.5).unwrap();
    let discarded = |last_successful, is_end_requested| Step::Discarded {
        last_successful,
        is_end_requested,
    };
    assert_eq!(step("discard@0.25"), discarded(Some(0.25), false));
    assert_eq!(step("discard-silently@0.25"), discarded(None, false));
    assert_eq!(step("end@0.25"), discarded(Some(0.25), true));
}

#[test]
fn states_are_saved_restored_and_freed() {
    let mut instance = ready("good");
    instance.set_real(&[0], &[1.0]).unwrap();
    instance.do_step_revocably(0.0, 0.1).unwrap();
    let saved = instance.save().unwrap();
    let at_save = y(&mut instance);
    let mut ends = Vec::new();
    for _ in 0..2 {
        instance.do_step_revocably(0.1, 0.1).unwrap();
        ends.push(y(&mut instance));
        instance.restore(saved).unwrap();
        assert_eq!(y(&mut instance), at_save);
    }
    assert_eq!(ends[0], ends[1]);
    instance.do_step_revocably(0.1, 0.1).unwrap();
    let later = instance.save_into(saved).unwrap();
    instance.restore(later).unwrap();
    assert_eq!(y(&mut instance), ends[0]);
    instance.free(later).unwrap();
    // A state left over goes with the instance.
    instance.save().unwrap();

    let cannot = foreign::DESCRIPTION.replace("canGetAndSetFMUstate=\"true\"", "");
    let mut instance = instance_of(&foreign::fmu_of(&cannot, foreign::binary()));
    assert_eq!(
        instance.save().unwrap_err().to_string(),
        "the FMU declares canGetAndSetFMUstate=\"false\""
    );
}

#[test]
fn messages_are_formatted_escaped_and_bounded() {
    let instance = instance_of(&foreign::fmu("log"));
    let messages = instance.take_messages();
    let texts: Vec<&str> = messages.iter().map(|m| m.text.as_str()).collect();
    assert_eq!(messages.len(), 6);
    assert_eq!(
        (messages[0].status, messages[0].category.as_str()),
        (Status::WARNING, "a")
    );
    if cfg!(all(target_arch = "x86_64", unix)) {
        assert_eq!(texts[0], "one is 1 of 2.5, 100 %");
        assert_eq!(texts[1], "12345678 0.51.52.53.54.55.56.57.58.59.5");
    }
    assert_eq!((messages[2].category.as_str(), texts[2]), ("", ""));
    assert_eq!(texts[3], "writes %n to memory");
    assert_eq!(texts[4], "\\u{1b}[31mred\\u{7}");
    assert!(texts[5].starts_with("xxx") && texts[5].len() <= 5002);
    assert!(instance.take_messages().is_empty());
}

#[test]
fn libm_is_there_for_fmus_that_do_not_ask_for_it() {
    let mut instance = instance_of(&foreign::fmu_of(
        foreign::DESCRIPTION,
        foreign::binary_needing_libm(),
    ));
    instance.setup_experiment(None, 0.0, 1.0).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance.do_step(0.0, 0.5).unwrap();
    assert_eq!(y(&mut instance), 0.5f64.tanh());
    // Functions that the binary lacks are an error when they are needed.
    assert_eq!(
        instance.get_string(0).unwrap_err().to_string(),
        "the FMU's binary has no function `fmi2GetString`"
    );
}

#[test]
fn unpacked_folders_go_with_the_last_instance() {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), "good");
    let library = Fmu::open(&path).unwrap().load().unwrap();
    let unpacked = library.bindings().next().unwrap().path().to_owned();
    let instance = library.instantiate("a", Kind::CoSimulation).unwrap();
    drop(library);
    assert!(unpacked.exists());
    drop(instance);
    assert!(!unpacked.exists() && !Path::new(&unpacked).parent().unwrap().exists());
}

#[test]
fn instances_of_one_library_do_not_meet() {
    let threads: Vec<_> = (1..=8)
        .map(|k| {
            std::thread::spawn(move || {
                let mut instance = ready("good");
                instance.set_real(&[0], &[f64::from(k)]).unwrap();
                for i in 0..100 {
                    instance.do_step(f64::from(i), 1.0).unwrap();
                }
                y(&mut instance)
            })
        })
        .collect();
    for (k, thread) in (1..).zip(threads) {
        assert!((thread.join().unwrap() - f64::from(k)).abs() < 1e-12);
    }
}
