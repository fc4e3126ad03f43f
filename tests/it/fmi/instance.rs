//! Instances of foreign FMUs: what real FMUs need of an importer, and what broken ones do to it.

use crate::foreign;
use pilotage::fmi::{CallError, Fmu, Instance, InterfaceType, Step};
use pilotage_abi::fmi2::{Function, State, Status, StatusKind};
use std::path::Path;
use std::sync::{Arc, Mutex};
use tempfile::tempdir;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

fn instance_of(content: &[u8]) -> Instance {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    std::fs::write(&path, content).unwrap();
    let library = Fmu::open(&path).unwrap().load().unwrap();
    library
        .instantiate("here", InterfaceType::CoSimulation)
        .unwrap()
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

// FMI rules 22 and 26: callbacks and strings that live during the call alone; values of every type.
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

// FMI rule 24: the calling sequence.
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

// FMI rule 25: a step that was discarded, and how far it came.
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

// FMI rule 27: the same steps after going back give the same bits.
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

/// Everything optional is there.
fn capable(behaviour: &str) -> Instance {
    let description = foreign::DESCRIPTION
        .replace("guid=\"good\"", &format!("guid=\"{behaviour}\""))
        .replace(
            "canGetAndSetFMUstate=\"true\"",
            "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" \
             providesDirectionalDerivative=\"true\" canInterpolateInputs=\"true\" \
             maxOutputDerivativeOrder=\"2\" canRunAsynchronuously=\"true\"",
        );
    let mut instance = instance_of(&foreign::fmu_of(&description, foreign::binary()));
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

// FMI rule 27: states as bytes, and into another instance of the same FMU.
#[test]
fn states_go_to_bytes_and_into_another_instance() {
    let mut instance = capable("good");
    instance.set_real(&[0], &[1.0]).unwrap();
    instance.do_step_revocably(0.0, 0.5).unwrap();
    let saved = instance.save().unwrap();
    let bytes = instance.serialize(saved).unwrap();
    instance.do_step_revocably(0.5, 0.5).unwrap();
    let mut other = capable("good");
    let read = other.deserialize(&bytes).unwrap();
    other.restore(read).unwrap();
    other.do_step(0.5, 0.5).unwrap();
    assert_eq!(y(&mut other), y(&mut instance));
    assert_eq!(
        ready("good").deserialize(&bytes).unwrap_err().to_string(),
        "the FMU declares canSerializeFMUstate=\"false\""
    );
}

// FMI rule 29: directional derivatives, summed over the seed.
#[test]
fn derivatives_of_every_kind() {
    let mut instance = capable("good");
    let mut values = [0.0; 2];
    (instance.directional_derivative(&[1, 1], &[0, 1], &[3.0, 1.0], &mut values)).unwrap();
    assert_eq!(values, [2.0, 2.0]);
    instance.set_input_derivatives(&[0], &[1], &[4.0]).unwrap();
    (instance.get_output_derivatives(&[1, 1], &[1, 2], &mut values)).unwrap();
    assert_eq!(values, [4.0, -4.0]);
    assert!(instance.set_input_derivatives(&[0], &[2], &[4.0]).is_err());
    let mut instance = ready("good");
    assert_eq!(
        (instance.directional_derivative(&[1], &[0], &[1.0], &mut [0.0])).unwrap_err(),
        CallError::NotCapable {
            flag: "providesDirectionalDerivative"
        }
    );
    assert_eq!(
        (instance.adjoint_derivative(&[1], &[0], &[1.0], &mut [0.0]))
            .unwrap_err()
            .to_string(),
        "the FMU is of FMI 2.0, which has nothing like fmi3GetAdjointDerivative"
    );
}

#[test]
fn pending_steps_may_be_asked_for_or_cancelled() {
    let mut instance = capable("pending");
    assert_eq!(instance.begin_step(0.0, 1.0, true).unwrap(), None);
    assert_eq!(instance.state(), State::StepInProgress.into());
    // Within a step nothing else is allowed.
    assert!(matches!(
        instance.get_real(&[1], &mut [0.0]),
        Err(CallError::NotAllowed { .. })
    ));
    let text = instance.string_status(StatusKind::PENDING_STATUS).unwrap();
    assert_eq!(text, "half of it is done");
    assert!(instance.integer_status(StatusKind::PENDING_STATUS).is_err());
    let mut polls = 1;
    let step = loop {
        match instance.poll_step().unwrap() {
            Some(step) => break step,
            None => polls += 1,
        }
    };
    assert_eq!((step, polls), (Step::Done, 3));
    assert_eq!(instance.state(), State::StepComplete.into());

    instance.begin_step(1.0, 1.0, true).unwrap();
    instance.cancel_step().unwrap();
    assert_eq!(instance.state(), State::StepCanceled.into());
    assert!(instance.do_step(1.0, 1.0).is_err());
    instance.reset().unwrap();

    // An instance that goes while its step is on its way cancels it.
    let mut instance = capable("pending");
    instance.begin_step(0.0, 1.0, true).unwrap();
}

// FMI rule 23: which categories an FMU logs is the importer's choice; no category means all.
#[test]
fn categories_are_chosen() {
    let mut instance = capable("good");
    let mut categories = |on: bool, names: &[&str]| {
        instance.set_debug_logging(on, names).unwrap();
        instance.get_integer(2).unwrap()
    };
    assert_eq!(categories(true, &["logStatusError"]), 1);
    assert_eq!(categories(true, &[]), 0);
    assert_eq!(categories(false, &[]), -1);
    assert!(instance.set_debug_logging(true, &["other"]).is_err());
}

/// Collects events of `tracing` as text.
#[derive(Clone, Default)]
struct Events(Arc<Mutex<Vec<String>>>);

impl Subscriber for Events {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn event(&self, event: &Event<'_>) {
        struct Fields(String);
        impl Visit for Fields {
            fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
                self.0 += &format!(" {field}={value:?}");
            }
        }
        let mut fields = Fields(format!(
            "{} {}",
            event.metadata().level(),
            event.metadata().target()
        ));
        event.record(&mut fields);
        self.0.lock().unwrap().push(fields.0);
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

#[test]
fn messages_go_to_tracing() {
    let fail = || drop(ready("error").do_step(0.0, 0.1).unwrap_err());
    // `tracing` asks who listens when a place in the code sends its first event, and it asks the listeners of that thread.
    // Another test's may be the first, while this one already listens.
    fail();
    let events = Events::default();
    tracing::subscriber::with_default(events.clone(), fail);
    let events = events.0.lock().unwrap();
    let line = "ERROR fmu message=the solver failed instance=\"here\" category=\"logStatusError\" status=\"fmi2Error\"";
    assert_eq!(events.as_slice(), [line]);
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
    assert_eq!(texts[4], "\\u001b[31mred\\u0007");
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
    let instance = library
        .instantiate("a", InterfaceType::CoSimulation)
        .unwrap();
    drop(library);
    assert!(unpacked.exists());
    drop(instance);
    assert!(!unpacked.exists() && !Path::new(&unpacked).parent().unwrap().exists());
}

// FMI rule 28: many instances on many threads.
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
