//! An FMU of "another tool" for both kinds of FMI 2.0, `ẋ = u - k x`, `y = x`, with every function of the
//! standard. Its GUID says which one fault it has: see the uses of `is`. Compiled by rustc alone.

#![allow(non_snake_case, private_interfaces)]

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

const OK: c_int = 0;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;
const PENDING: c_int = 5;

type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

#[repr(C)]
#[derive(Clone, Copy)]
struct Callbacks {
    logger: Option<Logger>,
    allocate: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    free: Option<unsafe extern "C" fn(*mut c_void)>,
    finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    environment: *mut c_void,
}

#[derive(Clone, Copy, PartialEq)]
struct Values {
    u: f64,
    x: f64,
    k: f64,
    time: f64,
}

const START: Values = Values { u: 0.0, x: 1.0, k: 1.0, time: 0.0 };

/// What the fault `shared` keeps for all instances, as bits.
static SHARED: AtomicU64 = AtomicU64::new(0);

struct Fmu {
    callbacks: Callbacks,
    fault: String,
    values: Values,
    /// First step size, for the fault `fixed-step`.
    step: Option<f64>,
    /// Memory of the importer.
    block: *mut c_void,
    /// The importer's text, for the fault `own-name`.
    name: *const c_char,
}

impl Fmu {
    fn is(&self, fault: &str) -> bool {
        self.fault == fault
    }

    /// Ends the process if that is the fault.
    fn crash(&self, place: &str) {
        if self.fault.strip_prefix("crash-in-") == Some(place) {
            std::process::abort();
        }
    }

    fn status(&self, place: &str) -> c_int {
        if self.fault.strip_prefix("error-in-") == Some(place) { ERROR } else { OK }
    }

    fn log(&self, name: &CStr, category: &CStr) {
        unsafe {
            self.callbacks.logger.unwrap()(
                self.callbacks.environment,
                name.as_ptr(),
                1,
                category.as_ptr(),
                c"a message".as_ptr(),
            );
        }
    }

    /// Calls the logger as it must not be called, if that is the fault.
    fn log_badly(&self) {
        let Callbacks { environment, logger, .. } = self.callbacks;
        let log = |environment, name: *const c_char, status, category: *const c_char, message: *const c_char| unsafe {
            logger.unwrap()(environment, name, status, category, message)
        };
        let (null, none) = (std::ptr::null_mut(), std::ptr::null());
        let [name, category, text] = [c"check", c"logStatusWarning", c"a message"].map(CStr::as_ptr);
        let latin1 = c"l\xe4uft".as_ptr();
        match self.fault.as_str() {
            "odd-status" => log(environment, name, 77, category, text),
            "null-environment" => log(null, name, 1, category, text),
            "null-name" => log(environment, none, 1, category, text),
            "null-category" => log(environment, name, 1, none, text),
            "null-message" => log(environment, name, 1, category, none),
            "latin1-name" => log(environment, latin1, 1, category, text),
            "latin1-category" => log(environment, name, 1, latin1, text),
            "latin1-message" => log(environment, name, 1, category, latin1),
            _ => {}
        }
    }

    fn derivative(&self) -> f64 {
        self.values.u - self.values.k * self.values.x
    }

    fn output(&self) -> f64 {
        let Values { x, u, .. } = self.values;
        match self.fault.as_str() {
            "undeclared" => x + u,
            "nan" if self.values.time > 0.0 => f64::NAN,
            _ => x,
        }
    }
}

fn of<'a>(component: *mut c_void) -> &'a mut Fmu {
    unsafe { &mut *component.cast::<Fmu>() }
}

fn text(p: *const c_char) -> String {
    unsafe { CStr::from_ptr(p) }.to_str().unwrap().to_owned()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    if cfg!(no_texts) {
        return std::ptr::null();
    }
    if cfg!(odd_platform) { c"standard32" } else { c"default" }.as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    if cfg!(no_texts) {
        return std::ptr::null();
    }
    if cfg!(odd_version) { c"1.0" } else { c"2.0" }.as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    _kind: c_int,
    guid: *const c_char,
    _resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> *mut c_void {
    let guid = text(guid);
    // The importer changes the GUID by appending to it.
    if guid.ends_with('!') && !guid.starts_with("any-guid") {
        return std::ptr::null_mut();
    }
    let mut fmu = Fmu {
        callbacks: unsafe { *callbacks },
        fault: guid.trim_end_matches('!').to_owned(),
        values: START,
        step: None,
        block: std::ptr::null_mut(),
        name: std::ptr::null(),
    };
    if fmu.is("wrong-start") {
        fmu.values.k = 2.0;
    }
    fmu.crash("instantiate");
    if fmu.is("refuses") {
        return std::ptr::null_mut();
    }
    let given = CString::new(text(name)).unwrap();
    if fmu.is("odd-category") {
        fmu.log(&given, c"logChatter");
    }
    if fmu.is("odd-environment") {
        fmu.callbacks.environment = (&raw mut fmu).cast();
        fmu.log(&given, c"logStatusWarning");
    }
    if fmu.is("own-name") {
        fmu.name = name;
    }
    unsafe {
        let table = callbacks.cast_mut();
        match fmu.fault.as_str() {
            "other-logger" => (*table).logger = None,
            "other-memory" => ((*table).allocate, (*table).free) = (None, None),
            "other-environment" => (*table).environment = (&raw mut fmu).cast(),
            _ => {}
        }
    }
    unsafe {
        let (allocate, free) = (fmu.callbacks.allocate.unwrap(), fmu.callbacks.free.unwrap());
        fmu.block = allocate(2, 8);
        if fmu.is("leak") {
            allocate(1, 100);
        }
        if fmu.is("odd-free") {
            free((&raw mut fmu).cast());
        }
    }
    if fmu.is("odd-name") {
        fmu.log(c"somebody", c"logStatusWarning");
    }
    Box::into_raw(Box::new(fmu)).cast()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(c: *mut c_void) {
    of(c).crash("free");
    if of(c).is("late-message") {
        *FREED.lock().unwrap() = Some(Late(of(c).callbacks));
    }
    unsafe { of(c).callbacks.free.unwrap()(of(c).block) };
    drop(unsafe { Box::from_raw(c.cast::<Fmu>()) });
}

/// The callbacks of an instance that was freed, for the fault `late-message`.
static FREED: Mutex<Option<Late>> = Mutex::new(None);

struct Late(Callbacks);

unsafe impl Send for Late {}

/// Runs when the library is unloaded.
#[cfg(target_os = "linux")]
#[used]
#[unsafe(link_section = ".fini_array")]
static FINALIZATION: extern "C" fn() = finalize;

#[cfg(target_os = "linux")]
extern "C" fn finalize() {
    if let Some(Late(callbacks)) = FREED.lock().unwrap().take() {
        let [name, category, text] = [c"check", c"logStatusWarning", c"late"].map(CStr::as_ptr);
        unsafe { callbacks.logger.unwrap()(callbacks.environment, name, 1, category, text) };
    }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(_: *mut c_void, _: c_int, _: usize, _: *const *const c_char) -> c_int {
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(c: *mut c_void, _: c_int, _: f64, start: f64, _: c_int, _: f64) -> c_int {
    of(c).values.time = start;
    of(c).status("setup")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterInitializationMode(c: *mut c_void) -> c_int {
    of(c).crash("initialization");
    of(c).status("initialization")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2ExitInitializationMode(c: *mut c_void) -> c_int {
    of(c).status("fmi2ExitInitializationMode")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Terminate(c: *mut c_void) -> c_int {
    if of(c).is("own-name") {
        of(c).log(unsafe { CStr::from_ptr(of(c).name) }, c"logStatusWarning");
    }
    of(c).log_badly();
    of(c).status("terminate")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Reset(c: *mut c_void) -> c_int {
    let fmu = of(c);
    fmu.crash("reset");
    let x = fmu.values.x;
    fmu.values = START;
    if fmu.is("reset-forgets") {
        fmu.values.x = x;
    }
    fmu.status("reset")
}

#[cfg(not(without_do_step))]
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(c: *mut c_void, t: f64, h: f64, _: c_int) -> c_int {
    let fmu = of(c);
    fmu.crash("step");
    if fmu.is("hangs") {
        loop {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }
    // No fault: nothing is to be done after the stop time.
    if fmu.is("strict-stop") && t + h > 1.0 + 1e-9 {
        return ERROR;
    }
    if fmu.is("fixed-step") && (fmu.step.get_or_insert(h) as &f64 - h).abs() > 1e-12 {
        return ERROR;
    }
    if fmu.is("shared") {
        // All instances have one state.
        let bits = SHARED.load(Ordering::Relaxed);
        if bits != 0 {
            fmu.values.x = f64::from_bits(bits);
        }
    }
    let Values { u, x, k, .. } = fmu.values;
    fmu.values.x = u / k + (x - u / k) * (-k * h).exp();
    if fmu.is("shared") {
        SHARED.store(fmu.values.x.to_bits(), Ordering::Relaxed);
    }
    fmu.values.time = t + h;
    if fmu.is("changes-input") {
        fmu.values.u += h;
    }
    if fmu.is("changes-fixed") {
        fmu.values.k += h;
    }
    if fmu.is("discards") {
        return DISCARD;
    }
    if fmu.is("pends") {
        return PENDING;
    }
    fmu.status("step")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut f64) -> c_int {
    let fmu = of(c);
    for i in 0..n {
        let value = match unsafe { *vr.add(i) } {
            0 => fmu.values.u,
            1 => fmu.output(),
            2 => fmu.values.k,
            3 => fmu.derivative(),
            _ if fmu.is("any-reference") => 0.0,
            _ => {
                fmu.crash("unknown-reference");
                return ERROR;
            }
        };
        unsafe { *to.add(i) = value };
    }
    fmu.status("get")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(c: *mut c_void, vr: *const c_uint, n: usize, from: *const f64) -> c_int {
    let fmu = of(c);
    for i in 0..n {
        let value = unsafe { *from.add(i) };
        match unsafe { *vr.add(i) } {
            // No fault: below its minimum.
            0 if fmu.is("discards-below") && value < 0.0 => return DISCARD,
            0 => fmu.values.u = value,
            1 => fmu.values.x = value,
            2 => fmu.values.k = value,
            _ => return ERROR,
        }
    }
    OK
}

/// Of an enumeration that the description may declare.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetInteger(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut c_int) -> c_int {
    for i in 0..n {
        if unsafe { *vr.add(i) } != 9 {
            return ERROR;
        }
        unsafe { *to.add(i) = if of(c).is("odd-item") { 7 } else { 1 } };
    }
    of(c).status("fmi2GetInteger")
}

/// Functions of types that this FMU has no variables of.
macro_rules! none {
    ($($name:ident: $pointer:ty;)*) => {
        $(#[unsafe(no_mangle)]
        extern "C" fn $name(_: *mut c_void, _: *const c_uint, n: usize, _: $pointer) -> c_int {
            if n == 0 { OK } else { ERROR }
        })*
    };
}

/// Of a text that the description may declare.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut *const c_char) -> c_int {
    for i in 0..n {
        if unsafe { *vr.add(i) } != 9 {
            return ERROR;
        }
        let text = if of(c).is("no-text") { std::ptr::null() } else { c"l\xe4uft".as_ptr() };
        unsafe { *to.add(i) = text };
    }
    OK
}

none! {
    fmi2GetBoolean: *mut c_int;
    fmi2SetInteger: *const c_int;
    fmi2SetBoolean: *const c_int;
    fmi2SetString: *const *const c_char;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(c: *mut c_void, to: *mut *mut Values) -> c_int {
    of(c).crash("state");
    let copy = of(c).values;
    unsafe {
        if (*to).is_null() {
            *to = Box::into_raw(Box::new(copy));
        } else {
            **to = copy;
        }
    }
    of(c).status("state")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(c: *mut c_void, from: *mut Values) -> c_int {
    let fmu = of(c);
    let x = fmu.values.x;
    fmu.values = unsafe { *from };
    if fmu.is("state-forgets") {
        fmu.values.x = x;
    }
    // A solver that starts anew, with its tolerance of 1e-3.
    if fmu.is("state-nearly") {
        fmu.values.x *= 1.0 + 1e-4;
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(_: *mut c_void, state: *mut *mut Values) -> c_int {
    unsafe {
        if !(*state).is_null() {
            drop(Box::from_raw(*state));
            *state = std::ptr::null_mut();
        }
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializedFMUstateSize(c: *mut c_void, _: *mut Values, size: *mut usize) -> c_int {
    unsafe { *size = size_of::<Values>() };
    of(c).status("serialize")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializeFMUstate(_: *mut c_void, state: *mut Values, to: *mut Values, _: usize) -> c_int {
    unsafe { to.write_unaligned(*state) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DeSerializeFMUstate(
    c: *mut c_void,
    from: *const Values,
    _: usize,
    state: *mut *mut Values,
) -> c_int {
    let mut values = unsafe { from.read_unaligned() };
    if of(c).is("serialize-forgets") {
        values.x = START.x;
    }
    unsafe { *state = Box::into_raw(Box::new(values)) };
    OK
}

/// Of `y` and `der(x)` by `u`, and in model exchange by `x`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: *mut c_void,
    unknowns: *const c_uint,
    n_unknowns: usize,
    knowns: *const c_uint,
    n_knowns: usize,
    seed: *const f64,
    to: *mut f64,
) -> c_int {
    let fmu = of(c);
    for i in 0..n_unknowns {
        let unknown = unsafe { *unknowns.add(i) };
        let mut sum = 0.0;
        for j in 0..n_knowns {
            let part = match (unknown, unsafe { *knowns.add(j) }) {
                (1, 0) => f64::from(u8::from(fmu.is("undeclared"))),
                (1, 1) => 1.0,
                (3, 0) if fmu.is("wrong-derivative") => -1.0,
                (3, 0) => 1.0,
                (3, 1) => -fmu.values.k,
                _ => return ERROR,
            };
            sum += part * unsafe { *seed.add(j) };
        }
        unsafe { *to.add(i) = sum };
    }
    fmu.status("derivative")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetRealInputDerivatives(
    _: *mut c_void,
    _: *const c_uint,
    _: usize,
    _: *const c_int,
    _: *const f64,
) -> c_int {
    ERROR
}

/// Of the one output.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealOutputDerivatives(
    c: *mut c_void,
    _: *const c_uint,
    n: usize,
    _: *const c_int,
    to: *mut f64,
) -> c_int {
    let fmu = of(c);
    let slope = match fmu.fault.as_str() {
        "wrong-slope" => -fmu.derivative(),
        "nan-slope" => f64::NAN,
        _ => fmu.derivative(),
    };
    (0..n).for_each(|i| unsafe { *to.add(i) = slope });
    fmu.status("fmi2GetRealOutputDerivatives")
}

#[cfg(not(without_cancel_step))]
#[unsafe(no_mangle)]
extern "C" fn fmi2CancelStep(_: *mut c_void) -> c_int {
    ERROR
}

/// A step that was pending is done.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetStatus(_: *mut c_void, _: c_int, to: *mut c_int) -> c_int {
    unsafe { *to = OK };
    OK
}

/// The other status functions: no step is ever discarded.
macro_rules! no_status {
    ($($name:ident)*) => {
        $(#[unsafe(no_mangle)]
        extern "C" fn $name(_: *mut c_void, _: c_int, _: *mut c_void) -> c_int {
            2
        })*
    };
}

no_status!(fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus);

#[repr(C)]
struct EventInfo {
    new_discrete_states_needed: c_int,
    terminate: c_int,
    nominals_changed: c_int,
    states_changed: c_int,
    next_event_time_defined: c_int,
    next_event_time: f64,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterEventMode(c: *mut c_void) -> c_int {
    of(c).status("fmi2EnterEventMode")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2NewDiscreteStates(c: *mut c_void, info: *mut EventInfo) -> c_int {
    let fmu = of(c);
    unsafe {
        *info = EventInfo {
            new_discrete_states_needed: c_int::from(fmu.is("endless-events")),
            terminate: 0,
            nominals_changed: 0,
            states_changed: 0,
            next_event_time_defined: c_int::from(fmu.is("past-event")),
            next_event_time: -1.0,
        };
    }
    fmu.status("fmi2NewDiscreteStates")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterContinuousTimeMode(c: *mut c_void) -> c_int {
    of(c).status("fmi2EnterContinuousTimeMode")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2CompletedIntegratorStep(
    c: *mut c_void,
    _: c_int,
    enter_event_mode: *mut c_int,
    terminate: *mut c_int,
) -> c_int {
    let is_event = of(c).is("error-in-fmi2EnterEventMode");
    unsafe { (*enter_event_mode, *terminate) = (is_event.into(), 0) };
    of(c).status("fmi2CompletedIntegratorStep")
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetTime(c: *mut c_void, time: f64) -> c_int {
    if of(c).is("strict-stop") && time > 1.0 + 1e-9 {
        return ERROR;
    }
    of(c).values.time = time;
    of(c).status("fmi2SetTime")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetContinuousStates(c: *mut c_void, from: *const f64, n: usize) -> c_int {
    of(c).values.x = unsafe { *from };
    if n == 1 { of(c).status("fmi2SetContinuousStates") } else { ERROR }
}

/// Writes one number.
macro_rules! one {
    ($($name:ident: |$fmu:ident| $value:expr;)*) => {
        $(#[unsafe(no_mangle)]
        unsafe extern "C" fn $name(c: *mut c_void, to: *mut f64, n: usize) -> c_int {
            let $fmu = of(c);
            if n != 1 {
                return ERROR;
            }
            unsafe { *to = $value };
            $fmu.status(stringify!($name))
        })*
    };
}

one! {
    fmi2GetDerivatives: |fmu| if fmu.is("nan-derivative") { f64::NAN } else { fmu.derivative() };
    fmi2GetContinuousStates: |fmu| fmu.values.x;
    fmi2GetEventIndicators: |fmu| fmu.values.x + 1.0;
    fmi2GetNominalsOfContinuousStates: |fmu| if fmu.is("zero-nominal") { 0.0 } else { 1.0 };
}
