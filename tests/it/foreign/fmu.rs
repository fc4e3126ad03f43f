//! An FMU of "another tool", compiled by the tests with rustc alone: `ẏ = k (u - y)`, solved exactly with
//! `u` held, and echoes of an integer, a boolean and a string. How it misbehaves is said by its GUID,
//! `behaviour` or `behaviour@time`; see `step` and `fmi2Instantiate`.

#![allow(non_snake_case, private_interfaces)]

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};

const OK: c_int = 0;
const WARNING: c_int = 1;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;
const FATAL: c_int = 4;
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

#[derive(Clone)]
struct Values {
    u: f64,
    y: f64,
    k: f64,
    /// Tolerance, start and stop time as they were given.
    experiment: [f64; 3],
    integer: [c_int; 3],
    boolean: [c_int; 2],
    string: [CString; 2],
    time: f64,
    polls: u32,
}

struct Fmu {
    callbacks: Callbacks,
    name: CString,
    behaviour: String,
    at: f64,
    is_set_up: bool,
    values: Values,
}

impl Fmu {
    fn log(&self, status: c_int, category: &CStr, text: &str) {
        let text = CString::new(text.replace('%', "%%")).unwrap();
        let logger = self.callbacks.logger.unwrap();
        unsafe { logger(self.callbacks.environment, self.name.as_ptr(), status, category.as_ptr(), text.as_ptr()) }
    }
}

fn of<'a>(component: *mut c_void) -> &'a mut Fmu {
    unsafe { &mut *component.cast::<Fmu>() }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    if cfg!(fmi3) { c"3.0".as_ptr() } else { c"2.0".as_ptr() }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    logging_on: c_int,
) -> *mut c_void {
    let text = |p: *const c_char| unsafe { CStr::from_ptr(p) }.to_str().unwrap().to_owned();
    let guid = text(guid);
    let (behaviour, at) = guid.split_once('@').unwrap_or((&guid, "0"));
    let fmu = Fmu {
        callbacks: unsafe { *callbacks },
        name: CString::new(text(name)).unwrap(),
        behaviour: behaviour.to_owned(),
        at: at.parse().unwrap_or(0.0),
        is_set_up: false,
        values: Values {
            u: 0.0,
            y: 0.0,
            k: 1.0,
            experiment: [0.0; 3],
            integer: [0; 3],
            boolean: [0; 2],
            string: [c"".into(), c"".into()],
            time: f64::NAN,
            polls: 0,
        },
    };
    assert_eq!((kind, logging_on), (1, 1));
    // Memory callbacks must not be NULL: use them, as old FMUs do.
    let memory = unsafe { fmu.callbacks.allocate.unwrap()(4, 8) }.cast::<u8>();
    assert!((0..32).all(|i| unsafe { *memory.add(i) } == 0));
    unsafe { fmu.callbacks.free.unwrap()(memory.cast()) };
    assert!(text(resources).starts_with("file:///"));
    match behaviour {
        "refuse" => {
            fmu.log(ERROR, c"logStatusError", "no license for 100 % of this model\n");
            return std::ptr::null_mut();
        }
        b if b.ends_with('!') => {
            fmu.log(ERROR, c"logStatusError", "the guid is wrong");
            return std::ptr::null_mut();
        }
        "crash-in-instantiate" => std::process::abort(),
        "log" => unsafe {
            let log = fmu.callbacks.logger.unwrap();
            let (e, n) = (fmu.callbacks.environment, fmu.name.as_ptr());
            log(e, n, WARNING, c"a".as_ptr(), c"%s is %d of %g, 100 %%".as_ptr(), c"one".as_ptr(), 1, 2.5);
            log(e, n, OK, c"a".as_ptr(), c"%d%d%d%d%d%d%d%d %.1f%.1f%.1f%.1f%.1f%.1f%.1f%.1f%.1f%.1f".as_ptr(),
                1, 2, 3, 4, 5, 6, 7, 8, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, 9.5);
            log(e, n, OK, std::ptr::null(), std::ptr::null());
            log(e, n, OK, c"a".as_ptr(), c"writes %n to memory".as_ptr(), 0usize);
            log(e, n, OK, c"a".as_ptr(), c"\x1b[31mred\x07".as_ptr());
            // An environment that is not ours, as confused FMUs pass.
            log(std::ptr::null_mut(), n, OK, c"a".as_ptr(), c"lost".as_ptr());
            log(0x7fff_0000_0000_usize as *mut c_void, n, OK, c"a".as_ptr(), c"lost".as_ptr());
            let long = CString::new("x".repeat(5000) + "%d").unwrap();
            log(e, n, OK, c"a".as_ptr(), long.as_ptr(), 7);
        },
        _ => {}
    }
    Box::into_raw(Box::new(fmu)).cast()
}

#[cfg(not(without_free))]
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(component: *mut c_void) {
    drop(unsafe { Box::from_raw(component.cast::<Fmu>()) });
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(c: *mut c_void, _d: c_int, tolerance: f64, start: f64, _s: c_int, stop: f64) -> c_int {
    let fmu = of(c);
    fmu.is_set_up = true;
    // Some FMUs forget what was set before.
    fmu.values.k = 1.0;
    fmu.values.experiment = [tolerance, start, stop];
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterInitializationMode(c: *mut c_void) -> c_int {
    if of(c).is_set_up { OK } else { ERROR }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2ExitInitializationMode(c: *mut c_void) -> c_int {
    if of(c).behaviour == "error-in-initialization" {
        of(c).log(ERROR, c"logStatusError", "no initial values found");
        return ERROR;
    }
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Terminate(_c: *mut c_void) -> c_int {
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Reset(c: *mut c_void) -> c_int {
    let v = &mut of(c).values;
    (v.y, v.integer[1], v.boolean[1]) = (0.0, 0, 0);
    OK
}

#[cfg(not(without_do_step))]
#[unsafe(no_mangle)]
extern "C" fn fmi2DoStep(c: *mut c_void, t: f64, h: f64, no_state_prior: c_int) -> c_int {
    let fmu = of(c);
    let reaches = t + h > fmu.at + 1e-9;
    match fmu.behaviour.as_str() {
        // Wrong results when the importer does not say that it will not go back.
        "never-back" if no_state_prior != 1 => return ERROR,
        "error" if reaches => {
            fmu.log(ERROR, c"logStatusError", "the solver failed");
            return ERROR;
        }
        "silent-error" if reaches => return ERROR,
        "fatal" if reaches => return FATAL,
        "odd-status" if reaches => return 42,
        "crash" if reaches => std::process::abort(),
        "discard" | "discard-silently" | "end" if reaches => {
            let v = &mut fmu.values;
            v.time = fmu.at;
            v.y = v.u + (v.y - v.u) * (-v.k * (fmu.at - t)).exp();
            return DISCARD;
        }
        _ => {}
    }
    let v = &mut fmu.values;
    v.y = v.u + (v.y - v.u) * (-v.k * h).exp();
    v.integer[1] = v.integer[0] + 1;
    v.boolean[1] = 1 - v.boolean[0];
    v.string[1] = v.string[0].clone();
    if fmu.behaviour == "pending" {
        v.polls = 3;
        return PENDING;
    }
    if fmu.behaviour == "warn" {
        fmu.log(WARNING, c"logStatusWarning", "the table ends at 100 %");
        fmu.log(WARNING, c"logStatusWarning", &format!("extrapolated at {t} s"));
        fmu.log(OK, c"logAll", "stepped");
        return WARNING;
    }
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetStatus(c: *mut c_void, _kind: c_int, to: *mut c_int) -> c_int {
    let v = &mut of(c).values;
    v.polls -= 1;
    unsafe { *to = if v.polls > 0 { PENDING } else { OK } };
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetRealStatus(c: *mut c_void, _kind: c_int, to: *mut f64) -> c_int {
    if of(c).behaviour == "discard-silently" {
        return DISCARD;
    }
    unsafe { *to = of(c).values.time };
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetBooleanStatus(c: *mut c_void, _kind: c_int, to: *mut c_int) -> c_int {
    unsafe { *to = c_int::from(of(c).behaviour == "end") };
    OK
}

/// Gets or sets each of `n` values.
macro_rules! access {
    ($get:ident, $set:ident, $type:ty, |$v:ident, $vr:ident| $place:expr, $writable:pat) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut $type) -> c_int {
            for i in 0..n {
                let ($v, $vr) = (&mut of(c).values, unsafe { *vr.add(i) });
                match $place {
                    Some(place) => unsafe { *to.add(i) = *place },
                    None => return ERROR,
                }
            }
            OK
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(c: *mut c_void, vr: *const c_uint, n: usize, from: *const $type) -> c_int {
            for i in 0..n {
                let ($v, $vr) = (&mut of(c).values, unsafe { *vr.add(i) });
                match ($vr, $place) {
                    ($writable, Some(place)) => *place = unsafe { *from.add(i) },
                    _ => return ERROR,
                }
            }
            OK
        }
    };
}

access!(fmi2GetReal, fmi2SetReal, f64, |v, vr| match vr {
    0 => Some(&mut v.u),
    1 => Some(&mut v.y),
    2 => Some(&mut v.k),
    3..=5 => Some(&mut v.experiment[vr as usize - 3]),
    _ => None,
}, 0 | 2);
access!(fmi2GetInteger, fmi2SetInteger, c_int, |v, vr| v.integer.get_mut(vr as usize), 0);
access!(fmi2GetBoolean, fmi2SetBoolean, c_int, |v, vr| v.boolean.get_mut(vr as usize), 0);

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut *const c_char) -> c_int {
    for i in 0..n {
        unsafe { *to.add(i) = of(c).values.string[*vr.add(i) as usize].as_ptr() };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetString(c: *mut c_void, vr: *const c_uint, n: usize, from: *const *const c_char) -> c_int {
    for i in 0..n {
        of(c).values.string[unsafe { *vr.add(i) } as usize] = unsafe { CStr::from_ptr(*from.add(i)) }.into();
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(c: *mut c_void, to: *mut *mut c_void) -> c_int {
    let copy = of(c).values.clone();
    unsafe {
        if (*to).is_null() {
            *to = Box::into_raw(Box::new(copy)).cast();
        } else {
            *(*to).cast::<Values>() = copy;
        }
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(c: *mut c_void, from: *mut c_void) -> c_int {
    of(c).values = unsafe { (*from.cast::<Values>()).clone() };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(_c: *mut c_void, state: *mut *mut c_void) -> c_int {
    unsafe {
        if !(*state).is_null() {
            drop(Box::from_raw((*state).cast::<Values>()));
            *state = std::ptr::null_mut();
        }
    }
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2CancelStep(c: *mut c_void) -> c_int {
    of(c).values.polls = 0;
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetStringStatus(_c: *mut c_void, _kind: c_int, to: *mut *const c_char) -> c_int {
    unsafe { *to = c"half of it is done".as_ptr() };
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetIntegerStatus(_c: *mut c_void, _kind: c_int, _to: *mut c_int) -> c_int {
    // No kind is defined for it.
    DISCARD
}

/// The number of categories that were asked for is in integer 2, or -1 for off.
#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(c: *mut c_void, on: c_int, n: usize, categories: *const *const c_char) -> c_int {
    let known = |i: usize| unsafe { CStr::from_ptr(*categories.add(i)) } == c"logStatusError";
    if !(0..n).all(known) {
        return ERROR;
    }
    of(c).values.integer[2] = if on == 0 { -1 } else { n as c_int };
    OK
}

/// The slope of `u` is added to `u` at once: enough to see that it came.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetRealInputDerivatives(c: *mut c_void, vr: *const c_uint, n: usize, orders: *const c_int, from: *const f64) -> c_int {
    for i in 0..n {
        if unsafe { (*vr.add(i), *orders.add(i)) } != (0, 1) {
            return ERROR;
        }
        of(c).values.u += unsafe { *from.add(i) };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealOutputDerivatives(c: *mut c_void, _vr: *const c_uint, n: usize, orders: *const c_int, to: *mut f64) -> c_int {
    // As FMUs of OpenModelica do, which declare derivatives.
    if of(c).behaviour == "no-slopes" {
        (0..n).for_each(|i| unsafe { *to.add(i) = f64::NAN });
        return OK;
    }
    let v = &of(c).values;
    for i in 0..n {
        unsafe { *to.add(i) = v.k * (v.u - v.y) * (-v.k).powi(*orders.add(i) - 1) };
    }
    OK
}

/// Of the derivative of `y` with respect to `u` and `y`, in any order of the knowns.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: *mut c_void, _unknowns: *const c_uint, n: usize, knowns: *const c_uint, m: usize, seed: *const f64, to: *mut f64,
) -> c_int {
    let k = of(c).values.k;
    let term = |j: usize| unsafe { *seed.add(j) * if *knowns.add(j) == 0 { k } else { -k } };
    (0..n).for_each(|i| unsafe { *to.add(i) = (0..m).map(term).sum() });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializedFMUstateSize(_c: *mut c_void, _state: *mut c_void, size: *mut usize) -> c_int {
    unsafe { *size = 16 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializeFMUstate(_c: *mut c_void, state: *mut c_void, to: *mut u8, n: usize) -> c_int {
    let v = unsafe { &*state.cast::<Values>() };
    let bytes = [v.u.to_le_bytes(), v.y.to_le_bytes()].concat();
    if n < bytes.len() {
        return ERROR;
    }
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, bytes.len()) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DeSerializeFMUstate(c: *mut c_void, from: *const u8, n: usize, state: *mut *mut c_void) -> c_int {
    if n != 16 {
        return ERROR;
    }
    let bytes = unsafe { std::slice::from_raw_parts(from, n) };
    let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let mut values = of(c).values.clone();
    (values.u, values.y) = (number(0), number(8));
    unsafe { *state = Box::into_raw(Box::new(values)).cast() };
    OK
}
