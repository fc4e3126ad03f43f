//! Calls that are wrong: each returns an error and says what to do; none aborts.

use super::raw::{Instance, Messages, Raw, call};
use super::{pilot, quadcopter};
use pilotage_abi::fmi2::functions::pointers;
use pilotage_abi::fmi2::{Component, Function, Status, StatusKind, Type};
use std::ptr::{null, null_mut};

/// A new instance, brought into stepComplete if so wished, misused; what it logged.
fn misuse(raw: &Raw, initialized: bool, wrong: impl FnOnce(&Instance) -> Status) -> String {
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    if initialized {
        instance.initialize();
    }
    let status = wrong(&instance);
    let logged = messages.take();
    assert_eq!(status, Status::ERROR, "{logged:?}");
    assert_eq!(logged.len(), 1, "{logged:?}");
    // It is in error now: it neither steps nor ends, but it can be read and reset.
    assert_eq!(instance.step(0.0, 0.1), Status::ERROR);
    assert_eq!(call!(instance, Terminate), Status::ERROR);
    assert_eq!(call!(instance, GetReal, null(), 0, null_mut()), Status::OK);
    assert_eq!(call!(instance, Reset), Status::OK);
    instance.initialize();
    assert_eq!(instance.step(0.0, 0.1), Status::OK);
    logged[0].clone()
}

/// FMI rule 26: wrong references, pointers, values and times are errors that say what to do (rules 21 and
/// 25 too).
#[test]
fn wrong_calls_are_told_what_to_do() {
    let raw = Raw::new(pilot());
    let early = |wrong: &dyn Fn(&Instance) -> Status| misuse(&raw, false, wrong);
    let late = |wrong: &dyn Fn(&Instance) -> Status| misuse(&raw, true, wrong);
    let (vr, beyond, output, input) = ([1_u32], [99_u32], [3_u32], [1_u32]);
    let (value, mut place, order, second) = ([1.0], [0.0], [1], [2]);
    let place = place.as_mut_ptr();
    let messages = [
        late(&|i| call!(i, SetReal, null(), 1, value.as_ptr())),
        late(&|i| call!(i, SetReal, vr.as_ptr(), 1, null())),
        late(&|i| call!(i, SetReal, vr.as_ptr(), usize::MAX, value.as_ptr())),
        late(&|i| call!(i, GetReal, null(), 1, place)),
        late(&|i| call!(i, GetReal, vr.as_ptr(), 1, null_mut())),
        late(&|i| call!(i, GetReal, beyond.as_ptr(), 1, place)),
        late(&|i| call!(i, SetReal, beyond.as_ptr(), 1, value.as_ptr())),
        late(&|i| call!(i, SetReal, output.as_ptr(), 1, value.as_ptr())),
        late(&|i| call!(i, GetInteger, vr.as_ptr(), 1, null_mut())),
        late(&|i| call!(i, SetBoolean, vr.as_ptr(), 1, order.as_ptr())),
        late(&|i| call!(i, GetString, vr.as_ptr(), 3, null_mut())),
        late(&|i| i.set("target", f64::NAN)),
        late(&|i| i.set("position", f64::INFINITY)),
        late(&|i| i.slope("target", f64::NAN)),
        late(&|i| i.slope("theta1", 1.0)),
        late(&|i| i.set("stick_limit", 0.5)),
        late(&|i| i.set("x1_start", 0.5)),
        early(&|i| i.set("stick_limit", -0.5)),
        early(&|i| i.set("theta1", f64::NEG_INFINITY)),
        late(&|i| {
            let (vr, value) = (vr.as_ptr(), value.as_ptr());
            call!(i, SetRealInputDerivatives, vr, 1, second.as_ptr(), value)
        }),
        late(&|i| {
            call!(
                i,
                SetRealInputDerivatives,
                vr.as_ptr(),
                1,
                null(),
                value.as_ptr()
            )
        }),
        late(&|i| {
            call!(
                i,
                GetRealOutputDerivatives,
                input.as_ptr(),
                1,
                order.as_ptr(),
                place
            )
        }),
        late(&|i| {
            call!(
                i,
                GetRealOutputDerivatives,
                output.as_ptr(),
                1,
                second.as_ptr(),
                place
            )
        }),
        late(&|i| {
            let (o, v) = (output.as_ptr(), value.as_ptr());
            call!(i, GetDirectionalDerivative, o, 1, o, 1, v, place)
        }),
        late(&|i| {
            let (k, v) = (input.as_ptr(), value.as_ptr());
            call!(i, GetDirectionalDerivative, k, 1, k, 1, v, place)
        }),
        late(&|i| i.step(0.0, 0.0)),
        late(&|i| i.step(0.0, -0.1)),
        late(&|i| i.step(0.0, f64::NAN)),
        late(&|i| i.step(0.0, f64::INFINITY)),
        late(&|i| i.step(f64::NAN, 0.1)),
        late(&|i| i.step(0.1, 0.1)),
        late(&|i| {
            call!(
                i,
                GetRealStatus,
                StatusKind::LAST_SUCCESSFUL_TIME,
                null_mut()
            )
        }),
        late(&|i| call!(i, CancelStep)),
        late(&|i| call!(i, GetFmuState, null_mut())),
        late(&|i| call!(i, SetFmuState, null_mut())),
        late(&|i| call!(i, SerializedFmuStateSize, null_mut(), null_mut())),
        late(&|i| call!(i, DeSerializeFmuState, null(), 9, null_mut())),
        late(&|i| i.setup(None)),
        early(&|i| i.step(0.0, 0.1)),
        early(&|i| call!(i, EnterInitializationMode)),
        early(&|i| i.setup(Some(-1.0))),
        early(&|i| call!(i, SetupExperiment, 1, 0.0, 0.0, 0, 0.0)),
        early(&|i| call!(i, SetupExperiment, 0, 0.0, f64::NAN, 0, 0.0)),
        early(&|i| call!(i, SetDebugLogging, 1, 2, null())),
    ];
    insta::assert_snapshot!(messages.join("\n"));
}

/// FMI rule 25: the stop time, within tolerance.
#[test]
fn steps_beyond_the_stop_time_are_refused_but_for_rounding() {
    let raw = Raw::new(quadcopter());
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    assert_eq!(instance.setup(Some(0.3)), Status::OK);
    assert_eq!(call!(instance, EnterInitializationMode), Status::OK);
    assert_eq!(call!(instance, ExitInitializationMode), Status::OK);
    for time in [0.0, 0.1, 0.1 + 0.1] {
        // 0.2 + 0.1 is more than 0.3.
        assert_eq!(instance.step(time, 0.1), Status::OK);
    }
    assert_eq!(instance.step(0.3, 0.1), Status::ERROR);
    assert_eq!(
        messages.take(),
        [
            "test: fmi2Error [logStatusError] fmi2DoStep: the step from 0.3 s by 0.1 s ends after \
             stopTime = 0.3 s; shorten it, or set none by \
             stopTimeDefined"
        ]
    );
}

/// FMI rules 3 and 22: what an instance needs, and the fingerprint.
#[test]
fn instances_that_cannot_be_are_null_and_say_why() {
    let raw = Raw::new(pilot());
    let (guid, location) = (raw.model.guid(), raw.location());
    let messages = Messages::default();
    let log = Some(messages.callbacks());
    let cs = Type::CO_SIMULATION;
    let attempts = [
        raw.try_instantiate(None, cs, Some(&guid), Some(&location), log),
        raw.try_instantiate(Some(""), cs, Some(&guid), Some(&location), log),
        raw.try_instantiate(Some("a"), Type(-1), Some(&guid), Some(&location), log),
        raw.try_instantiate(Some("a"), Type(77), Some(&guid), Some(&location), log),
        raw.try_instantiate(Some("a"), cs, None, Some(&location), log),
        raw.try_instantiate(Some("a"), cs, Some("{x}"), Some(&location), log),
        raw.try_instantiate(Some("100%#"), cs, Some("50 % #1"), Some(&location), log),
    ];
    assert_eq!(attempts, [null_mut(); 7]);
    insta::assert_snapshot!(messages.take().join("\n"));

    // Where the resources are gone, it says where it looked.
    let model = raw.folder.path().join("resources/model.toml");
    std::fs::rename(&model, raw.folder.path().join("elsewhere.toml")).unwrap();
    let lost = raw.try_instantiate(Some("a"), cs, Some(&guid), Some("file:///nowhere"), log);
    assert_eq!(lost, null_mut());
    let logged = messages.take().join("\n");
    assert!(
        logged.contains("model.toml was not found in /nowhere or "),
        "{logged}"
    );
    std::fs::write(&model, "format = 1\nmodel = \"boat\"\n").unwrap();
    let broken = raw.try_instantiate(Some("a"), cs, Some(&guid), Some(&location), log);
    assert_eq!(broken, null_mut());
    let expected =
        "line 2: model = \"boat\", expected \"pilot\" or \"quadcopter\"; export the FMU again";
    assert!(messages.take()[0].ends_with(expected));
}

/// FMI rule 19: every spelling of the resource location.
#[test]
fn every_reasonable_resource_location_works_and_none_too() {
    let raw = Raw::new(pilot());
    let path = raw.folder.path().join("resources").display().to_string();
    let guid = raw.model.guid();
    for location in [
        Some(format!("file://{path}")),
        Some(format!("file:{path}")),
        Some(format!("file://localhost{path}/")),
        Some(path),
        Some("file:///nowhere".into()),
        Some(String::new()),
        None,
    ] {
        let messages = Messages::default();
        let callbacks = Some(messages.callbacks());
        let (kind, location) = (Type::CO_SIMULATION, location.as_deref());
        let component = raw.try_instantiate(Some("a"), kind, Some(&guid), location, callbacks);
        assert!(!component.is_null(), "{location:?}: {:?}", messages.take());
        drop(Instance {
            raw: &raw,
            component,
        });
    }
}

/// FMI rule 21: NULL for an instance.
#[test]
fn null_instances_are_errors() {
    let raw = Raw::new(pilot());
    let nobody = std::mem::ManuallyDrop::new(Instance {
        raw: &raw,
        component: null_mut(),
    });
    assert_eq!(nobody.setup(None), Status::ERROR);
    assert_eq!(nobody.step(0.0, 0.1), Status::ERROR);
    assert_eq!(call!(nobody, GetReal, null(), 0, null_mut()), Status::ERROR);
    assert_eq!(call!(nobody, Reset), Status::ERROR);
    assert_eq!(call!(nobody, FreeFmuState, null_mut()), Status::ERROR);
    call!(nobody, FreeInstance);
}

/// FMI rule 23: logging on and off, by category.
#[test]
fn logging_can_be_switched_and_missing_loggers_do_no_harm() {
    let raw = Raw::new(pilot());
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    instance.initialize();
    let discard = || {
        let mut place = 0;
        let kind = StatusKind::TERMINATED;
        let status = call!(instance, GetIntegerStatus, kind, &raw mut place);
        assert_eq!(status, Status::DISCARD);
        messages.take().len()
    };
    let switch = |on, category: Option<&std::ffi::CStr>| {
        let categories = category.map(|c| [c.as_ptr()]);
        let (n, pointer) = categories.as_ref().map_or((0, null()), |c| (1, c.as_ptr()));
        call!(instance, SetDebugLogging, on, n, pointer)
    };
    assert_eq!(discard(), 1);
    assert_eq!(switch(0, None), Status::OK);
    assert_eq!(discard(), 0);
    assert_eq!(switch(1, Some(c"logStatusDiscard")), Status::OK);
    assert_eq!(discard(), 1);
    assert_eq!(switch(0, Some(c"logStatusDiscard")), Status::OK);
    assert_eq!(discard(), 0);
    assert_eq!(switch(1, None), Status::OK);
    assert_eq!(switch(1, Some(c"logEvents")), Status::WARNING);
    assert!(messages.take()[0].contains("log category \"logEvents\" is unknown and ignored"));

    let guid = raw.model.guid();
    let mut silent = messages.callbacks();
    silent.logger = None;
    for callbacks in [Some(silent), None] {
        let kind = Type::CO_SIMULATION;
        let component = raw.try_instantiate(Some("a"), kind, Some(&guid), None, callbacks);
        let instance = Instance {
            raw: &raw,
            component,
        };
        assert_eq!(instance.step(0.0, 0.1), Status::ERROR);
    }
}

/// FMI rule 22: callbacks and name are copied (rule 23 too).
#[test]
fn the_callbacks_struct_and_the_name_are_copied() {
    let raw = Raw::new(pilot());
    let messages = Messages::default();
    let name = std::ffi::CString::new("copied").unwrap();
    let guid = std::ffi::CString::new(raw.model.guid()).unwrap();
    let callbacks = Box::new(messages.callbacks());
    // SAFETY: the type is the function's, and all pointers are valid during the call.
    let component: Component = unsafe {
        let f: pointers::Instantiate = raw.function(Function::Instantiate);
        let kind = Type::CO_SIMULATION;
        f(
            name.as_ptr(),
            kind,
            guid.as_ptr(),
            null(),
            &raw const *callbacks,
            0,
            0,
        )
    };
    drop((name, guid, callbacks));
    let instance = Instance {
        raw: &raw,
        component,
    };
    // Errors are told even when logging is off.
    assert_eq!(instance.step(0.0, 0.1), Status::ERROR);
    assert!(messages.take()[0].starts_with("copied: fmi2Error"));
}
