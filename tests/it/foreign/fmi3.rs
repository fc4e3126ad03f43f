//! An FMU of FMI 3.0 of "another tool", compiled by the tests with rustc alone: co-simulation, model exchange and
//! scheduled execution. How it behaves is said by its token, `behaviour` or `behaviour@time`.
//!
//! Co-simulation: `dy/dt = k (u - y)`, solved exactly with `u` held. Model exchange: `dx/dt = -k x`, an event where
//! `x` falls below 1/2. Scheduled execution: clock 80 counts. Each other type has an input and an output that is its
//! echo plus one. Value references: see `fmi3.xml`.

#![allow(non_snake_case)]

use std::collections::HashMap;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::sync::Mutex;

const OK: c_int = 0;
const WARNING: c_int = 1;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;

type Log = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);
type Update = unsafe extern "C" fn(*mut c_void, f64, bool, bool, bool, bool, *mut u8, *mut f64);
type ClockUpdate = unsafe extern "C" fn(*mut c_void);

#[derive(Clone)]
struct Values {
    t: f64,
    u: f64,
    y: f64,
    k: f64,
    x: f64,
    experiment: [f64; 3],
    f32: f32,
    i8: i8,
    u8: u8,
    i16: i16,
    u16: u16,
    i32: i32,
    u32: u32,
    i64: i64,
    u64: u64,
    boolean: bool,
    string: CString,
    binary: Vec<u8>,
    array: Vec<f64>,
    lists: HashMap<u32, [f64; 3]>,
    count: i32,
    clocks: [bool; 2],
    interval: f64,
    shift: f64,
}

struct Fmu {
    environment: *mut c_void,
    log: Option<Log>,
    update: Option<Update>,
    clock_update: Option<ClockUpdate>,
    resources: CString,
    behaviour: String,
    at: f64,
    uses_events: bool,
    may_return: bool,
    watched: Vec<u32>,
    values: Values,
}

fn of<'a>(instance: *mut c_void) -> &'a mut Fmu {
    unsafe { &mut *instance.cast::<Fmu>() }
}

fn text(p: *const c_char) -> String {
    unsafe { CStr::from_ptr(p) }.to_str().unwrap().to_owned()
}

impl Fmu {
    /// Calls the logger as it must not be called, if it is to behave so.
    fn log_badly(&self) {
        let log = |environment, status, category: *const c_char, message: *const c_char| unsafe {
            self.log.unwrap()(environment, status, category, message);
        };
        let [category, text] = [c"logStatusError", c"a message"].map(CStr::as_ptr);
        let (null, none) = (std::ptr::null_mut(), std::ptr::null());
        let (environment, latin1) = (self.environment, c"l\xe4uft".as_ptr());
        match self.behaviour.as_str() {
            // Of FMI 2.0 alone: a step that is pending.
            "odd-status" => log(environment, 5, category, text),
            "other-environment" => log((&raw const *self).cast_mut().cast(), WARNING, category, text),
            "null-environment" => log(null, WARNING, category, text),
            "null-category" => log(environment, WARNING, none, text),
            "null-message" => log(environment, WARNING, category, none),
            "latin1-category" => log(environment, WARNING, latin1, text),
            "latin1-message" => log(environment, WARNING, category, latin1),
            _ => {}
        }
    }

    fn log_message(&self, status: c_int, category: &CStr, message: &str) {
        let message = CString::new(message).unwrap();
        unsafe { self.log.unwrap()(self.environment, status, category.as_ptr(), message.as_ptr()) }
    }
}

fn make(name: *const c_char, token: *const c_char, resources: *const c_char, environment: *mut c_void, log: Option<Log>) -> Box<Fmu> {
    assert!(!text(name).is_empty());
    let token = text(token);
    let (behaviour, at) = token.split_once('@').unwrap_or((&token, "0"));
    let values = Values {
        t: 0.0, u: 0.0, y: 0.0, k: 1.0, x: 1.0, experiment: [f64::NAN; 3], f32: 0.0, i8: 0, u8: 0, i16: 0, u16: 0,
        i32: 0, u32: 0, i64: 0, u64: 0, boolean: false, string: c"".into(), binary: Vec::new(), array: vec![0.0; 3],
        lists: HashMap::new(),
        count: 0, clocks: [false; 2], interval: 0.5, shift: 0.0,
    };
    Box::new(Fmu {
        environment, log, update: None, clock_update: None, resources: CString::new(text(resources)).unwrap(),
        behaviour: behaviour.to_owned(), at: at.parse().unwrap(), uses_events: false, may_return: false,
        watched: Vec::new(), values,
    })
}

fn hand_out(fmu: Box<Fmu>) -> *mut c_void {
    if fmu.behaviour == "refuse" {
        fmu.log_message(ERROR, c"logStatusError", "100 %s of the tokens are wrong\n");
        return std::ptr::null_mut();
    }
    fmu.log_badly();
    if fmu.behaviour == "log" {
        fmu.log_message(WARNING, c"a", "plain %d text");
    }
    Box::into_raw(fmu).cast()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    if cfg!(no_version) {
        return std::ptr::null();
    }
    c"3.0.1".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char, token: *const c_char, resources: *const c_char, _visible: bool, logging: bool, events: bool,
    early: bool, variables: *const u32, n: usize, environment: *mut c_void, log: Option<Log>, update: Option<Update>,
) -> *mut c_void {
    assert!(logging);
    let mut fmu = make(name, token, resources, environment, log);
    fmu.update = update;
    fmu.uses_events = events;
    if fmu.behaviour == "clocked" && !events {
        fmu.log_message(ERROR, c"logStatusError", "clocks tick in event mode alone");
        return std::ptr::null_mut();
    }
    fmu.may_return = early;
    fmu.watched = (0..n).map(|i| unsafe { *variables.add(i) }).collect();
    hand_out(fmu)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange(
    name: *const c_char, token: *const c_char, resources: *const c_char, _visible: bool, _logging: bool,
    environment: *mut c_void, log: Option<Log>,
) -> *mut c_void {
    hand_out(make(name, token, resources, environment, log))
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution(
    name: *const c_char, token: *const c_char, resources: *const c_char, _visible: bool, _logging: bool,
    environment: *mut c_void, log: Option<Log>, clock_update: Option<ClockUpdate>,
    lock: Option<unsafe extern "C" fn()>, unlock: Option<unsafe extern "C" fn()>,
) -> *mut c_void {
    unsafe { (lock.unwrap()(), unlock.unwrap()()) };
    let mut fmu = make(name, token, resources, environment, log);
    fmu.clock_update = clock_update;
    hand_out(fmu)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3FreeInstance(c: *mut c_void) {
    if of(c).behaviour == "late-message" {
        *FREED.lock().unwrap() = of(c).log.map(|log| (log, of(c).environment.addr()));
    }
    drop(unsafe { Box::from_raw(c.cast::<Fmu>()) });
}

/// Logger and environment of an instance that was freed.
static FREED: Mutex<Option<(Log, usize)>> = Mutex::new(None);

/// Runs when the library is unloaded.
#[cfg(target_os = "linux")]
#[used]
#[unsafe(link_section = ".fini_array")]
static FINALIZATION: extern "C" fn() = finalize;

#[cfg(target_os = "linux")]
extern "C" fn finalize() {
    if let Some((log, environment)) = FREED.lock().unwrap().take() {
        let environment = std::ptr::without_provenance_mut(environment);
        unsafe { log(environment, WARNING, c"logStatusError".as_ptr(), c"late".as_ptr()) };
    }
}

#[unsafe(no_mangle)]
extern "C" fn fmi3EnterInitializationMode(c: *mut c_void, has_tolerance: bool, tolerance: f64, start: f64, has_stop: bool, stop: f64) -> c_int {
    let defined = |has: bool, value: f64| if has { value } else { f64::NAN };
    of(c).values.experiment = [defined(has_tolerance, tolerance), start, defined(has_stop, stop)];
    of(c).values.t = start;
    OK
}

macro_rules! nothing {
    ($($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(_c: *mut c_void) -> c_int {
            OK
        }
    )*};
}

nothing! { fmi3ExitInitializationMode fmi3Terminate fmi3Reset fmi3EnterEventMode fmi3EnterStepMode
    fmi3EnterContinuousTimeMode fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3EvaluateDiscreteStates }

#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(_c: *mut c_void, _on: bool, _n: usize, _categories: *const *const c_char) -> c_int {
    OK
}

/// Booleans are written as 2 where they are true: C code may do so.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    c: *mut c_void, t: f64, h: f64, _final: bool, event: *mut u8, end: *mut u8, early: *mut u8, last: *mut f64,
) -> c_int {
    let fmu = of(c);
    unsafe { (*event, *end, *early, *last) = (0, 0, 0, t + h) };
    let mut reached = t + h;
    match fmu.behaviour.as_str() {
        "discard" => {
            unsafe { *last = fmu.at };
            return DISCARD;
        }
        "end" => unsafe { *end = 2 },
        "past" => unsafe { (*early, *last) = (1, t - 1.0) },
        // It is elsewhere, and says so in the time alone.
        "unsaid" => unsafe { *last = t + 0.5 * h },
        "beyond" => unsafe { *last = t + 2.0 * h },
        "unwritten" => unsafe { *last = 0.0 },
        "end-within" => unsafe { (*end, *last) = (1, t + 0.5 * h) },
        "nowhere" => unsafe { (*early, *last) = (1, f64::NAN) },
        "event" if fmu.uses_events && t < fmu.at && t + h >= fmu.at && fmu.may_return => {
            reached = fmu.at;
            unsafe { (*event, *early, *last) = (2, 2, reached) };
        }
        _ => {}
    }
    // The step's first half, then a word with the importer, who may set the input.
    let half = 0.5 * (t + reached);
    for (from, to) in [(t, half), (half, reached)] {
        let v = &mut fmu.values;
        v.y = v.u + (v.y - v.u) * (-v.k * (to - from)).exp();
        v.t = to;
        let (mut wants, mut at) = (0, 0.0);
        if !fmu.watched.is_empty() && fmu.behaviour != "quiet" {
            let update = fmu.update.unwrap();
            unsafe { update(fmu.environment, to, true, true, true, fmu.may_return, &mut wants, &mut at) };
        }
        if wants != 0 {
            unsafe { (*early, *last) = (1, to) };
            return OK;
        }
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3UpdateDiscreteStates(
    c: *mut c_void, again: *mut u8, end: *mut u8, nominals: *mut u8, values: *mut u8, has_next: *mut u8, next: *mut f64,
) -> c_int {
    of(c).values.count += 1;
    unsafe { (*again, *end, *nominals, *values, *has_next, *next) = (0, 0, 0, 0, 2, 5.0) };
    OK
}

/// Gets or sets each of the variables of a type: an input and an output that is greater by 1, and as much of arrays of three.
macro_rules! scalar {
    ($get:ident $set:ident $type:ident $vr:literal) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(c: *mut c_void, vr: *const u32, n: usize, to: *mut $type, m: usize) -> c_int {
            let mut at = 0;
            for i in 0..n {
                let v = &of(c).values;
                let list = || v.lists.get(&($vr + 100)).copied().unwrap_or_default();
                let values: Vec<$type> = match unsafe { *vr.add(i) } {
                    $vr => vec![v.$type],
                    o if o == $vr + 20 => vec![v.$type + (1 as $type)],
                    o if o == $vr + 100 => list().map(|x| x as $type).into(),
                    o if o == $vr + 120 => list().map(|x| (x + 1.0) as $type).into(),
                    _ => return ERROR,
                };
                if at + values.len() > m {
                    return ERROR;
                }
                values.iter().for_each(|value| unsafe { *to.add(at) = *value; at += 1 });
            }
            if at == m { OK } else { ERROR }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(c: *mut c_void, vr: *const u32, n: usize, from: *const $type, m: usize) -> c_int {
            let mut at = 0;
            for i in 0..n {
                match unsafe { *vr.add(i) } {
                    $vr => { of(c).values.$type = unsafe { *from.add(at) }; at += 1 }
                    o if o == $vr + 100 => {
                        let list = [0, 1, 2].map(|k| unsafe { *from.add(at + k) } as f64);
                        of(c).values.lists.insert(o, list);
                        at += 3;
                    }
                    _ => return ERROR,
                }
            }
            if at == m { OK } else { ERROR }
        }
    };
}

scalar!(fmi3GetFloat32 fmi3SetFloat32 f32 10);
scalar!(fmi3GetInt8 fmi3SetInt8 i8 11);
scalar!(fmi3GetUInt8 fmi3SetUInt8 u8 12);
scalar!(fmi3GetInt16 fmi3SetInt16 i16 13);
scalar!(fmi3GetUInt16 fmi3SetUInt16 u16 14);
scalar!(fmi3GetUInt32 fmi3SetUInt32 u32 16);
scalar!(fmi3GetInt64 fmi3SetInt64 i64 17);

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetInt32(c: *mut c_void, vr: *const u32, n: usize, to: *mut i32, _m: usize) -> c_int {
    for i in 0..n {
        let v = &of(c).values;
        let value = match unsafe { *vr.add(i) } {
            15 => v.i32,
            35 => v.i32 + 1,
            50 => v.count,
            _ => return ERROR,
        };
        unsafe { *to.add(i) = value };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetInt32(c: *mut c_void, _vr: *const u32, _n: usize, from: *const i32, _m: usize) -> c_int {
    of(c).values.i32 = unsafe { *from };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetUInt64(c: *mut c_void, vr: *const u32, _n: usize, to: *mut u64, _m: usize) -> c_int {
    let v = &of(c).values;
    unsafe { *to = match *vr { 18 => v.u64, 38 => v.u64 + 1, _ => v.array.len() as u64 } };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetUInt64(c: *mut c_void, vr: *const u32, _n: usize, from: *const u64, _m: usize) -> c_int {
    let v = &mut of(c).values;
    let value = unsafe { *from };
    match unsafe { *vr } {
        18 => v.u64 = value,
        // The structural parameter.
        _ => v.array = vec![0.0; value as usize],
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFloat64(c: *mut c_void, vr: *const u32, n: usize, to: *mut f64, m: usize) -> c_int {
    let mut at = 0;
    for i in 0..n {
        let v = &of(c).values;
        let values = match unsafe { *vr.add(i) } {
            0 => vec![v.t],
            1 => vec![v.u],
            2 => vec![v.y],
            3 => vec![v.k],
            4..=6 => vec![v.experiment[unsafe { *vr.add(i) } as usize - 4]],
            // Running sums.
            72 => v.array.iter().scan(0.0, |sum, x| { *sum += x; Some(*sum) }).collect(),
            70 => v.array.clone(),
            90 => vec![v.x],
            91 => vec![-v.k * v.x],
            92 => vec![v.x - 0.5],
            _ => return ERROR,
        };
        if at + values.len() > m {
            return ERROR;
        }
        values.iter().enumerate().for_each(|(j, value)| unsafe { *to.add(at + j) = *value });
        at += values.len();
    }
    if at == m { OK } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFloat64(c: *mut c_void, vr: *const u32, n: usize, from: *const f64, m: usize) -> c_int {
    let mut at = 0;
    for i in 0..n {
        let v = &mut of(c).values;
        let next = || unsafe { *from.add(at) };
        match unsafe { *vr.add(i) } {
            1 => v.u = next(),
            3 => v.k = next(),
            90 => v.x = next(),
            70 => {
                let len = v.array.len();
                v.array = (0..len).map(|j| unsafe { *from.add(at + j) }).collect();
                at += len - 1;
            }
            _ => return ERROR,
        }
        at += 1;
    }
    if at == m { OK } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetBoolean(c: *mut c_void, vr: *const u32, _n: usize, to: *mut u8, _m: usize) -> c_int {
    let v = &of(c).values;
    unsafe { *to = 2 * u8::from(if *vr == 40 { v.boolean } else { !v.boolean }) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetBoolean(c: *mut c_void, _vr: *const u32, _n: usize, from: *const u8, _m: usize) -> c_int {
    of(c).values.boolean = unsafe { *from } != 0;
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetString(c: *mut c_void, vr: *const u32, _n: usize, to: *mut *const c_char, _m: usize) -> c_int {
    let other = match of(c).behaviour.as_str() {
        "no-text" => Some(std::ptr::null()),
        "latin1-text" => Some(c"l\xe4uft".as_ptr()),
        _ => None,
    };
    if let Some(other) = other {
        unsafe { *to = other };
        return OK;
    }
    unsafe { *to = if *vr == 45 { of(c).resources.as_ptr() } else { of(c).values.string.as_ptr() } };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetString(c: *mut c_void, _vr: *const u32, _n: usize, from: *const *const c_char, _m: usize) -> c_int {
    of(c).values.string = unsafe { CStr::from_ptr(*from) }.into();
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetBinary(c: *mut c_void, _vr: *const u32, n: usize, sizes: *mut usize, to: *mut *const u8, _m: usize) -> c_int {
    for i in 0..n {
        let binary = &of(c).values.binary;
        unsafe { (*sizes.add(i), *to.add(i)) = (binary.len(), binary.as_ptr()) };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetBinary(c: *mut c_void, _vr: *const u32, _n: usize, sizes: *const usize, from: *const *const u8, _m: usize) -> c_int {
    of(c).values.binary = unsafe { std::slice::from_raw_parts(*from, *sizes) }.to_vec();
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetClock(c: *mut c_void, vr: *const u32, n: usize, to: *mut u8) -> c_int {
    (0..n).for_each(|i| unsafe { *to.add(i) = 2 * u8::from(of(c).values.clocks[*vr.add(i) as usize - 80]) });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetClock(c: *mut c_void, vr: *const u32, n: usize, from: *const u8) -> c_int {
    (0..n).for_each(|i| unsafe { of(c).values.clocks[*vr.add(i) as usize - 80] = *from.add(i) != 0 });
    match &*of(c).behaviour {
        "stuck" => ERROR,
        "dead clock" => std::process::abort(),
        _ => OK,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetIntervalDecimal(c: *mut c_void, _vr: *const u32, n: usize, to: *mut f64, qualifiers: *mut c_int) -> c_int {
    let interval = if of(c).behaviour == "backwards" { -1.0 } else { of(c).values.interval };
    let qualifier = if of(c).behaviour == "unknown" { 0 } else { 2 };
    (0..n).for_each(|i| unsafe { (*to.add(i), *qualifiers.add(i)) = (interval, qualifier) });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetIntervalFraction(c: *mut c_void, _vr: *const u32, n: usize, counters: *mut u64, resolutions: *mut u64, qualifiers: *mut c_int) -> c_int {
    let ticks = (of(c).values.interval * 1000.0) as u64;
    (0..n).for_each(|i| unsafe { (*counters.add(i), *resolutions.add(i), *qualifiers.add(i)) = (ticks, 1000, 1) });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetIntervalDecimal(c: *mut c_void, _vr: *const u32, _n: usize, from: *const f64) -> c_int {
    of(c).values.interval = unsafe { *from };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetIntervalFraction(c: *mut c_void, _vr: *const u32, _n: usize, counter: *const u64, resolution: *const u64) -> c_int {
    of(c).values.interval = unsafe { *counter as f64 / *resolution as f64 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetShiftDecimal(c: *mut c_void, _vr: *const u32, n: usize, to: *mut f64) -> c_int {
    (0..n).for_each(|i| unsafe { *to.add(i) = of(c).values.shift });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetShiftFraction(c: *mut c_void, _vr: *const u32, n: usize, counters: *mut u64, resolutions: *mut u64) -> c_int {
    let ticks = (of(c).values.shift * 1000.0) as u64;
    (0..n).for_each(|i| unsafe { (*counters.add(i), *resolutions.add(i)) = (ticks, 1000) });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetShiftDecimal(c: *mut c_void, _vr: *const u32, _n: usize, from: *const f64) -> c_int {
    of(c).values.shift = unsafe { *from };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetShiftFraction(c: *mut c_void, _vr: *const u32, _n: usize, counter: *const u64, resolution: *const u64) -> c_int {
    of(c).values.shift = unsafe { *counter as f64 / *resolution as f64 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3ActivateModelPartition(c: *mut c_void, clock: u32, _t: f64) -> c_int {
    if clock != 80 {
        return ERROR;
    }
    of(c).values.count += 1;
    unsafe { of(c).clock_update.unwrap()(of(c).environment) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetNumberOfVariableDependencies(_c: *mut c_void, vr: u32, n: *mut usize) -> c_int {
    unsafe { *n = if vr == 2 { 2 } else { 0 } };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetVariableDependencies(
    _c: *mut c_void, _vr: u32, elements: *mut usize, on: *mut u32, on_elements: *mut usize, kinds: *mut c_int, n: usize,
) -> c_int {
    for i in 0..n {
        unsafe { (*elements.add(i), *on.add(i), *on_elements.add(i), *kinds.add(i)) = (0, 1 + 2 * i as u32, 0, 5) };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetDirectionalDerivative(
    c: *mut c_void, _u: *const u32, n: usize, _k: *const u32, m: usize, seed: *const f64, ns: usize, to: *mut f64, nt: usize,
) -> c_int {
    // Of the derivative with respect to the state.
    assert_eq!((n, m), (nt, ns));
    unsafe { *to = -of(c).values.k * *seed };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetAdjointDerivative(
    c: *mut c_void, _u: *const u32, _n: usize, _k: *const u32, _m: usize, seed: *const f64, _ns: usize, to: *mut f64, _nt: usize,
) -> c_int {
    unsafe { *to = -of(c).values.k * *seed };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetOutputDerivatives(c: *mut c_void, _vr: *const u32, _n: usize, orders: *const i32, to: *mut f64, _m: usize) -> c_int {
    let v = &of(c).values;
    unsafe { *to = (v.u - v.y) * v.k * (-v.k).powi(*orders - 1) };
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetTime(c: *mut c_void, t: f64) -> c_int {
    of(c).values.t = t;
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3CompletedIntegratorStep(_c: *mut c_void, _final: bool, event: *mut u8, end: *mut u8) -> c_int {
    unsafe { (*event, *end) = (0, 0) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetContinuousStates(c: *mut c_void, x: *const f64, _n: usize) -> c_int {
    of(c).values.x = unsafe { *x };
    OK
}

macro_rules! one {
    ($($name:ident |$v:ident| $value:expr;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(c: *mut c_void, to: *mut f64, n: usize) -> c_int {
            assert_eq!(n, 1);
            let $v = &of(c).values;
            unsafe { *to = $value };
            OK
        }
    )*};
}

one! {
    fmi3GetContinuousStates |v| v.x;
    fmi3GetContinuousStateDerivatives |v| -v.k * v.x;
    fmi3GetEventIndicators |v| v.x - 0.5;
    fmi3GetNominalsOfContinuousStates |_v| 1.0;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetNumberOfContinuousStates(_c: *mut c_void, n: *mut usize) -> c_int {
    unsafe { *n = 1 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetNumberOfEventIndicators(_c: *mut c_void, n: *mut usize) -> c_int {
    unsafe { *n = 1 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFMUState(c: *mut c_void, to: *mut *mut c_void) -> c_int {
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
unsafe extern "C" fn fmi3SetFMUState(c: *mut c_void, from: *mut c_void) -> c_int {
    of(c).values = unsafe { (*from.cast::<Values>()).clone() };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeFMUState(_c: *mut c_void, state: *mut *mut c_void) -> c_int {
    unsafe {
        if !(*state).is_null() {
            drop(Box::from_raw((*state).cast::<Values>()));
            *state = std::ptr::null_mut();
        }
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializedFMUStateSize(_c: *mut c_void, _state: *mut c_void, size: *mut usize) -> c_int {
    unsafe { *size = 16 };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializeFMUState(_c: *mut c_void, state: *mut c_void, to: *mut u8, n: usize) -> c_int {
    let v = unsafe { &*state.cast::<Values>() };
    let bytes = [v.u.to_le_bytes(), v.y.to_le_bytes()].concat();
    assert_eq!(n, bytes.len());
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, n) };
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DeserializeFMUState(c: *mut c_void, from: *const u8, n: usize, state: *mut *mut c_void) -> c_int {
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
