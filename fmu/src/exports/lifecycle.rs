//! Versions, creation and destruction, calling order (FMI 2.0.5, sections 2.1.4 to 2.1.6).

use super::{array, call, message};
use crate::instance::{Experiment, Instance};
use crate::log::Log;
use crate::problem::Problem;
use crate::resources;
use pilotage_abi::fmi2::functions::{Function, pointers};
use pilotage_abi::fmi2::types::*;
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// `fmi2GetTypesPlatform`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const Char {
    TYPES_PLATFORM.as_ptr()
}

/// `fmi2GetVersion`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const Char {
    VERSION.as_ptr()
}

/// `fmi2SetDebugLogging`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetDebugLogging(
    component: Component,
    on: Boolean,
    count: usize,
    categories: *const *const Char,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: the importer passes NULL or `count` strings.
        let pointers = unsafe { array(categories, count, "categories") }?;
        let names = pointers
            .iter()
            // SAFETY: each is NULL or a C string that lives during the call.
            .map(|p| unsafe { string(*p, "categories") })
            .collect::<Result<Vec<_>, _>>()?;
        instance.log().switch(on != FALSE, &names)
    };
    // SAFETY: the importer passes NULL or its instance (FMI 2.0.5, section 2.1.5).
    unsafe { call(component, Function::SetDebugLogging, body) }
}

/// `fmi2Instantiate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const Char,
    kind: Type,
    guid: *const Char,
    location: *const Char,
    callbacks: *const CallbackFunctions,
    _visible: Boolean,
    logging: Boolean,
) -> Component {
    // SAFETY: the importer passes NULL or its callbacks.
    let callbacks = unsafe { callbacks.as_ref() }.copied();
    // SAFETY: the importer passes NULL or a C string.
    let name = unsafe { string(name, "instanceName") };
    let log = Log::new(callbacks, name.as_ref().unwrap_or(&c""), logging != FALSE);
    let create = || {
        // SAFETY: the importer passes NULL or C strings.
        let (guid, location) = unsafe { (string(guid, "fmuGUID")?, string(location, "").ok()) };
        create(name?, kind, guid, location)
    };
    let result = catch_unwind(AssertUnwindSafe(create)).unwrap_or_else(|panic| {
        Err(Problem::Panic {
            message: message(panic.as_ref()),
        })
    });
    match result {
        Ok(model) => Box::into_raw(Box::new(Instance::new(model, log))).cast(),
        Err(problem) => {
            log.report(Function::Instantiate, &problem);
            std::ptr::null_mut()
        }
    }
}

/// The model of a new instance, once all that the importer says of it is right.
fn create(
    name: &CStr,
    kind: Type,
    guid: &CStr,
    location: Option<&CStr>,
) -> Result<pilotage_models::Model, Problem> {
    if name.is_empty() {
        return Err(Problem::NoName);
    }
    if kind != Type::CO_SIMULATION {
        return Err(Problem::WrongType { found: kind });
    }
    let model = resources::model(location.map(CStr::to_string_lossy).as_deref())?;
    let expected = model.guid();
    match guid.to_bytes() == expected.as_bytes() {
        true => Ok(model),
        false => Err(Problem::WrongGuid {
            found: guid.to_string_lossy().into_owned(),
            expected,
        }),
    }
}

/// `fmi2FreeInstance`: frees in every state, since a leak helps nobody.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(component: Component) {
    if component.is_null() {
        return;
    }
    // SAFETY: it came from `Box::into_raw` in `fmi2Instantiate`, and the importer gives it up.
    let instance = unsafe { Box::from_raw(component.cast::<Instance>()) };
    // A panic while freeing must not reach the host; there is nobody left to report it.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(instance)));
}

/// `fmi2SetupExperiment`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    component: Component,
    tolerance_defined: Boolean,
    tolerance: Real,
    start: Real,
    stop_defined: Boolean,
    stop: Real,
) -> Status {
    let experiment = Experiment {
        tolerance: (tolerance_defined != FALSE).then_some(tolerance),
        start,
        stop: (stop_defined != FALSE).then_some(stop),
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe {
        call(component, Function::SetupExperiment, |i| {
            i.setup(experiment)
        })
    }
}

/// `fmi2EnterInitializationMode`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(component: Component) -> Status {
    let function = Function::EnterInitializationMode;
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, function, Instance::enter_initialization) }
}

/// `fmi2ExitInitializationMode`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2ExitInitializationMode(component: Component) -> Status {
    let body = |instance: &mut Instance| {
        instance.exit_initialization();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::ExitInitializationMode, body) }
}

/// `fmi2Terminate`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Terminate(component: Component) -> Status {
    let body = |instance: &mut Instance| {
        instance.terminate();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::Terminate, body) }
}

/// `fmi2Reset`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Reset(component: Component) -> Status {
    let body = |instance: &mut Instance| {
        instance.reset();
        Ok(())
    };
    // SAFETY: the importer passes NULL or its instance.
    unsafe { call(component, Function::Reset, body) }
}

/// The C string that a pointer leads to.
///
/// # Safety
/// `pointer` is NULL, or a C string that lives while `'a` lasts.
unsafe fn string<'a>(pointer: *const Char, argument: &'static str) -> Result<&'a CStr, Problem> {
    if pointer.is_null() {
        return Err(Problem::Null { argument });
    }
    // SAFETY: not NULL, and by the caller's promise a C string.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

// The compiler checks that these functions have the types of the standard.
const _: pointers::GetTypesPlatform = fmi2GetTypesPlatform;
const _: pointers::GetVersion = fmi2GetVersion;
const _: pointers::SetDebugLogging = fmi2SetDebugLogging;
const _: pointers::Instantiate = fmi2Instantiate;
const _: pointers::FreeInstance = fmi2FreeInstance;
const _: pointers::SetupExperiment = fmi2SetupExperiment;
const _: pointers::EnterInitializationMode = fmi2EnterInitializationMode;
const _: pointers::ExitInitializationMode = fmi2ExitInitializationMode;
const _: pointers::Terminate = fmi2Terminate;
const _: pointers::Reset = fmi2Reset;
