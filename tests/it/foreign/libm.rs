//! A library that uses libm without saying that it needs it, as FMUs of some tools do; or, with
//! `unresolved`, a function that nobody has, or with `python` one of the interpreter of Python.

#![no_std]
#![allow(non_snake_case)]

use core::ffi::{c_char, c_int, c_void};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

unsafe extern "C" {
    #[cfg_attr(python, link_name = "_Py_NoneStruct")]
    #[cfg_attr(unresolved, link_name = "a_function_that_nobody_has")]
    fn tanh(x: f64) -> f64;
}

static mut INSTANCE: f64 = 0.0;

#[unsafe(no_mangle)]
extern "C" fn fmi2Instantiate(
    _name: *const c_char, _kind: c_int, guid: *const c_char, _r: *const c_char, _c: *const c_void, _v: c_int, _l: c_int,
) -> *mut c_void {
    // A wrong guid ends with an exclamation mark.
    let mut end = guid;
    unsafe {
        while *end != 0 {
            end = end.add(1);
        }
        if *end.sub(1) == b'!' as c_char {
            return core::ptr::null_mut();
        }
    }
    (&raw mut INSTANCE).cast()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeInstance(_c: *mut c_void) {}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(_c: *mut c_void, _d: c_int, _t: f64, _a: f64, _s: c_int, _b: f64) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterInitializationMode(_c: *mut c_void) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn fmi2ExitInitializationMode(_c: *mut c_void) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Terminate(_c: *mut c_void) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn fmi2DoStep(_c: *mut c_void, t: f64, h: f64, _n: c_int) -> c_int {
    unsafe { INSTANCE = tanh(t + h) };
    0
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetReal(_c: *mut c_void, _vr: *const u32, n: usize, to: *mut f64) -> c_int {
    for i in 0..n {
        unsafe { *to.add(i) = INSTANCE };
    }
    0
}
