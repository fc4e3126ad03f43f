//! An FMU for model exchange (FMI 2.0) of "another tool", compiled by the tests with rustc alone. Which model it
//! is is said by its GUID, `model` or `model@number`; see `Fmu::derivatives` and `Fmu::update`.
//!
//! Reals: states 0 and 1, their derivatives 10 and 11, parameter 20, input 21, output 22 (the first state plus
//! the input). Integer 0: how often events were handled.

#![allow(non_snake_case)]

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};

const OK: c_int = 0;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;
const FATAL: c_int = 4;

#[repr(C)]
struct EventInfo {
    again: c_int,
    end: c_int,
    nominals: c_int,
    values: c_int,
    has_next: c_int,
    next: f64,
}

#[derive(Default)]
struct Fmu {
    model: String,
    number: f64,
    t: f64,
    x: [f64; 2],
    p: f64,
    u: f64,
    events: c_int,
    nominal: f64,
    next: f64,
    is_resting: bool,
    is_triggered: bool,
    is_event: bool,
}

const G: f64 = 9.81;

impl Fmu {
    fn states(&self) -> usize {
        match self.model.as_str() {
            "counter" | "end" | "endless" | "timer" => 0,
            "ball" | "zeno" | "van-der-pol" => 2,
            _ => 1,
        }
    }

    fn derivatives(&self) -> [f64; 2] {
        let [a, b] = self.x;
        match self.model.as_str() {
            "ball" | "zeno" if self.is_resting => [0.0, 0.0],
            "ball" | "zeno" => [b, -G],
            // dx/dt = p (u - x)
            "decay" | "decay-by-differences" | "decay-wrongly" | "ranged" => [self.p * (self.u - a), 0.0],
            "fatal" => [-self.p * a, 0.0],
            // A table whose knot is where the state starts.
            "decay-kinked" => [-self.p * (a + 2.0 * (a - 1.0).max(0.0)), 0.0],
            "van-der-pol" => [b, self.p * (1.0 - a * a) * b - a],
            "integrator" => [self.u, 0.0],
            "torricelli" => [-a.sqrt(), 0.0],
            "stepper" | "pulse" => [1.0, 0.0],
            _ => [0.0, 0.0],
        }
    }

    /// The event iteration.
    fn update(&mut self, info: &mut EventInfo) {
        let [h, v] = self.x;
        match self.model.as_str() {
            // The restitution is `p`; the ball rests when it is slow.
            "ball" | "zeno" if h <= 0.0 && v < 0.0 => {
                self.events += 1;
                self.x = [f64::MIN_POSITIVE, -self.p * v];
                if self.model == "ball" && self.x[1] < 0.05 {
                    self.x = [0.0, 0.0];
                    self.is_resting = true;
                }
                info.values = 1;
            }
            // Events at 0.3, 0.6, ...
            "counter" => {
                if self.t >= self.next {
                    self.events += 1;
                    self.next = f64::from(self.events + 1) * 0.3;
                }
                (info.has_next, info.next) = (1, self.next);
            }
            // Two rounds of the iteration at 0.5, where the state jumps and its nominal value with it.
            "jump" => {
                (info.has_next, info.next) = (1, 0.5);
                if self.t >= 0.5 {
                    self.events += 1;
                    (self.x[0], self.nominal) = (self.x[0] + 10.0, 100.0);
                    (info.has_next, info.again, info.values, info.nominals) =
                        (0, c_int::from(self.events == 1), 1, 1);
                    if self.events == 2 {
                        (info.values, info.nominals) = (0, 0);
                    }
                }
            }
            "end" => {
                (info.has_next, info.next) = (1, 0.5);
                info.end = c_int::from(self.t >= 0.5);
            }
            "endless" => info.again = 1,
            // An event that the model asks for after a step.
            "stepper" if self.is_triggered => {
                self.events += 1;
                self.is_triggered = false;
                self.x[0] = 0.0;
                info.values = 1;
            }
            "pulse" | "timer" if self.is_event => self.events += 1,
            _ => {}
        }
        self.is_event = false;
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
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    _name: *const c_char, kind: c_int, guid: *const c_char, _r: *const c_char, _c: *const c_void, _v: c_int, _l: c_int,
) -> *mut c_void {
    assert_eq!(kind, 0);
    let guid = unsafe { CStr::from_ptr(guid) }.to_str().unwrap();
    let (model, number) = guid.split_once('@').unwrap_or((guid, "1"));
    let number: f64 = number.parse().unwrap();
    let x = match model {
        "ball" | "zeno" => [1.0, 0.0],
        "van-der-pol" => [2.0, 0.0],
        "integrator" | "stepper" | "pulse" => [0.0, 0.0],
        _ => [1.0, 0.0],
    };
    Box::into_raw(Box::new(Fmu {
        model: model.to_owned(), number, x, p: number, nominal: 1.0, next: 0.3, ..Fmu::default()
    })).cast()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeInstance(c: *mut c_void) {
    drop(unsafe { Box::from_raw(c.cast::<Fmu>()) });
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(c: *mut c_void, _d: c_int, _t: f64, start: f64, _s: c_int, _b: f64) -> c_int {
    of(c).t = start;
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

nothing! { fmi2EnterInitializationMode fmi2ExitInitializationMode fmi2Terminate fmi2Reset fmi2EnterContinuousTimeMode }

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterEventMode(c: *mut c_void) -> c_int {
    of(c).is_event = true;
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2NewDiscreteStates(c: *mut c_void, info: *mut EventInfo) -> c_int {
    let info = unsafe { &mut *info };
    *info = EventInfo { again: 0, end: 0, nominals: 0, values: 0, has_next: 0, next: 0.0 };
    of(c).update(info);
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2CompletedIntegratorStep(c: *mut c_void, _final: c_int, event: *mut c_int, end: *mut c_int) -> c_int {
    let fmu = of(c);
    fmu.is_triggered = fmu.model == "stepper" && fmu.x[0] >= fmu.number;
    unsafe { (*event, *end) = (c_int::from(fmu.is_triggered), 0) };
    OK
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetTime(c: *mut c_void, t: f64) -> c_int {
    of(c).t = t;
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetContinuousStates(c: *mut c_void, x: *const f64, n: usize) -> c_int {
    assert_eq!(n, of(c).states());
    (0..n).for_each(|i| of(c).x[i] = unsafe { *x.add(i) });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetContinuousStates(c: *mut c_void, x: *mut f64, n: usize) -> c_int {
    (0..n).for_each(|i| unsafe { *x.add(i) = of(c).x[i] });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDerivatives(c: *mut c_void, x: *mut f64, n: usize) -> c_int {
    if of(c).model == "torricelli" && of(c).x[0] < 0.0 {
        return DISCARD;
    }
    if of(c).model == "fatal" && of(c).p > 0.8 {
        return FATAL;
    }
    (0..n).for_each(|i| unsafe { *x.add(i) = of(c).derivatives()[i] });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetNominalsOfContinuousStates(c: *mut c_void, x: *mut f64, n: usize) -> c_int {
    (0..n).for_each(|i| unsafe { *x.add(i) = of(c).nominal });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetEventIndicators(c: *mut c_void, z: *mut f64, n: usize) -> c_int {
    let fmu = of(c);
    let value = match fmu.model.as_str() {
        "ball" | "zeno" if fmu.is_resting => 1.0,
        "ball" | "zeno" => fmu.x[0],
        // Positive for a twentieth of a second around 0.5, by the state and by the time.
        "pulse" => 0.025 - (fmu.x[0] - 0.5).abs(),
        // Zero but for rounding, and what rises from zero.
        "flicker" => 1e-17 * (40.0 * fmu.t + 1.0).cos(),
        "riser" => fmu.t,
        "timer" => (fmu.t - 0.25) * (0.75 - fmu.t),
        _ => 1.0,
    };
    (0..n).for_each(|i| unsafe { *z.add(i) = value });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(c: *mut c_void, vr: *const c_uint, n: usize, to: *mut f64) -> c_int {
    for i in 0..n {
        let fmu = of(c);
        let value = match unsafe { *vr.add(i) } {
            k @ 0..=1 => fmu.x[k as usize],
            k @ 10..=11 => fmu.derivatives()[k as usize - 10],
            20 => fmu.p,
            21 => fmu.u,
            22 => fmu.x[0] + fmu.u,
            23 => 3.0 * fmu.x[0],
            _ => return ERROR,
        };
        unsafe { *to.add(i) = value };
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(c: *mut c_void, vr: *const c_uint, n: usize, from: *const f64) -> c_int {
    for i in 0..n {
        let value = unsafe { *from.add(i) };
        match unsafe { *vr.add(i) } {
            k @ 0..=1 => of(c).x[k as usize] = value,
            // It refuses what is out of the ranges that it declares.
            20 if of(c).model == "ranged" && value > 1.2 => return ERROR,
            21 if of(c).model == "ranged" && value < 0.0 => return ERROR,
            20 => of(c).p = value,
            21 => of(c).u = value,
            _ => return ERROR,
        }
    }
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetInteger(c: *mut c_void, _vr: *const c_uint, n: usize, to: *mut c_int) -> c_int {
    (0..n).for_each(|i| unsafe { *to.add(i) = of(c).events });
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: *mut c_void, unknowns: *const c_uint, n: usize, knowns: *const c_uint, m: usize, seed: *const f64, to: *mut f64,
) -> c_int {
    let fmu = of(c);
    let [a, b] = fmu.x;
    // By both states and the input.
    let rows = match fmu.model.as_str() {
        "decay" => [[-fmu.p, 0.0, fmu.p], [0.0, 0.0, 0.0]],
        "decay-kinked" => [[if a < 1.0 { -fmu.p } else { -3.0 * fmu.p }, 0.0, 0.0], [0.0, 0.0, 0.0]],
        "decay-wrongly" => [[-2.0 * fmu.p, 0.0, fmu.p], [0.0, 0.0, 0.0]],
        "van-der-pol" => [[0.0, 1.0, 0.0], [-2.0 * fmu.p * a * b - 1.0, fmu.p * (1.0 - a * a), 0.0]],
        _ => return ERROR,
    };
    for i in 0..n {
        let row = match unsafe { *unknowns.add(i) } {
            k @ 10..=11 => rows[k as usize - 10],
            22 => [1.0, 0.0, 1.0],
            _ => return ERROR,
        };
        let place = |known: c_uint| if known == 21 { 2 } else { known as usize };
        let term = |j: usize| unsafe { row[place(*knowns.add(j))] * *seed.add(j) };
        unsafe { *to.add(i) = (0..m).map(term).sum() };
    }
    OK
}
