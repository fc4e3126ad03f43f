//! The logger callback of FMI 2.0.
//!
//! The message is a `printf` format with values (FMI 2.0, section 2.1.5), so the callback is variadic. Stable Rust
//! cannot define such a function. On x86-64 with the System V calling convention (Linux, macOS) an assembly entry point
//! builds a `va_list` from the registers and the C library formats the message; on other platforms the format is shown
//! unchanged, without the values.

use crate::binding::owned_message;
use crate::environment;
use crate::message::Message;
use crate::misuse::{CATEGORY, INSTANCE_NAME, MESSAGE, Misuse, note, note_text};
use pilotage_abi::fmi2::{Char, ComponentEnvironment, Status};
use std::ffi::c_void;

#[cfg(all(target_arch = "x86_64", unix))]
mod format;

/// Maximum length of a formatted message \[bytes\].
#[cfg(all(target_arch = "x86_64", unix))]
const LONGEST: usize = 4096;

/// The standard's name of the callback.
const CALLBACK: &str = "logger";

/// Stores a message; `values` is NULL or the `va_list` of the values.
///
/// # Safety
/// Strings are NULL or NUL-terminated; `values` matches the format, for which the FMU vouches.
unsafe extern "C" fn receive(
    environment: ComponentEnvironment,
    instance_name: *const Char,
    status: Status,
    category: *const Char,
    format: *const Char,
    values: *mut c_void,
) {
    // SAFETY: the obligation is passed on from the caller.
    let (instance_name, category, text) = unsafe {
        note_text(instance_name, CALLBACK, INSTANCE_NAME);
        note_text(category, CALLBACK, CATEGORY);
        note_text(format, CALLBACK, MESSAGE);
        let category = owned_message(category).unwrap_or_default();
        (
            owned_message(instance_name),
            category,
            expand(format, values),
        )
    };
    if status.name().is_none() {
        note(Misuse::Status {
            callback: CALLBACK,
            status: status.0,
        });
    }
    let message = Message::new(status, instance_name, category, &text);
    environment::deliver(environment, CALLBACK, message);
}

#[cfg(all(target_arch = "x86_64", unix))]
mod sys_v {
    use super::*;
    use std::ffi::CStr;

    unsafe extern "C" {
        /// C library: formats at most `size` bytes with the values of a `va_list`.
        pub(super) fn vsnprintf(
            to: *mut Char,
            size: usize,
            format: *const Char,
            values: *mut c_void,
        ) -> i32;
    }

    /// The logger callback: saves the registers that may hold values, builds a `va_list` from them (System V ABI, AMD64
    /// supplement, section 3.5.7) and calls [`receive`].
    ///
    /// There are five named arguments, so the first value is in the sixth register, r9.
    #[unsafe(naked)]
    pub(super) unsafe extern "C" fn entry(
        environment: ComponentEnvironment,
        instance_name: *const Char,
        status: Status,
        category: *const Char,
        format: *const Char,
        first: usize,
    ) {
        // Frame: 176 bytes register save area, 24 bytes va_list, 8 bytes for alignment.
        std::arch::naked_asm!(
            "push rbp",
            "mov rbp, rsp",
            "sub rsp, 208",
            "mov [rsp + 40], r9",
            // al: nonzero if vector registers are in use.
            "test al, al",
            "je 2f",
            "movaps [rsp + 48], xmm0",
            "movaps [rsp + 64], xmm1",
            "movaps [rsp + 80], xmm2",
            "movaps [rsp + 96], xmm3",
            "movaps [rsp + 112], xmm4",
            "movaps [rsp + 128], xmm5",
            "movaps [rsp + 144], xmm6",
            "movaps [rsp + 160], xmm7",
            "2:",
            // gp_offset, fp_offset, overflow_arg_area, reg_save_area.
            "mov dword ptr [rsp + 176], 40",
            "mov dword ptr [rsp + 180], 48",
            "lea rax, [rbp + 16]",
            "mov [rsp + 184], rax",
            "mov [rsp + 192], rsp",
            "lea r9, [rsp + 176]",
            "call {receive}",
            "leave",
            "ret",
            receive = sym receive,
        )
    }

    /// The format, expanded with its values.
    ///
    /// Formats that are not [harmless](format::is_harmless) are not expanded but shown unchanged.
    ///
    /// # Safety
    /// `format` is NULL or NUL-terminated; `values` matches it.
    pub(super) unsafe fn expand(format: *const Char, values: *mut c_void) -> String {
        // SAFETY: the obligation is passed on from the caller.
        let Some(raw) = (unsafe { owned_message(format) }) else {
            return String::new();
        };
        // SAFETY: it is not NULL, and the caller vouches for the rest. These are the bytes that the C library reads: `raw`
        // may be cut, and has other ones where they are not UTF-8.
        let bytes = unsafe { CStr::from_ptr(format) }.to_bytes();
        if !bytes.contains(&b'%') || bytes.len() >= LONGEST || !format::is_harmless(bytes) {
            return raw;
        }
        let mut text = vec![0u8; LONGEST];
        // SAFETY: the buffer has that size, and the caller vouches for the rest.
        let length = unsafe { vsnprintf(text.as_mut_ptr().cast(), text.len(), format, values) };
        match usize::try_from(length) {
            Ok(length) => {
                text.truncate(length.min(LONGEST - 1));
                String::from_utf8_lossy(&text).into_owned()
            }
            Err(_) => raw,
        }
    }
}

#[cfg(all(target_arch = "x86_64", unix))]
use sys_v::{entry, expand};

/// The logger callback on platforms without the assembly entry point: named arguments only.
///
/// # Safety
/// Strings are NULL or NUL-terminated.
#[cfg(not(all(target_arch = "x86_64", unix)))]
unsafe extern "C" fn entry(
    environment: ComponentEnvironment,
    instance_name: *const Char,
    status: Status,
    category: *const Char,
    format: *const Char,
    _first: usize,
) {
    let none = std::ptr::null_mut();
    // SAFETY: the obligation is passed on from the caller.
    unsafe { receive(environment, instance_name, status, category, format, none) }
}

/// The format, unchanged.
///
/// # Safety
/// `format` is NULL or NUL-terminated.
#[cfg(not(all(target_arch = "x86_64", unix)))]
unsafe fn expand(format: *const Char, _values: *mut c_void) -> String {
    // SAFETY: the obligation is passed on from the caller.
    unsafe { owned_message(format) }.unwrap_or_default()
}

/// The logger callback with the type required by the standard.
pub(crate) fn callback() -> pilotage_abi::fmi2::types::CallbackLogger {
    let entry: unsafe extern "C" fn(
        ComponentEnvironment,
        *const Char,
        Status,
        *const Char,
        *const Char,
        usize,
    ) = entry;
    // SAFETY: both are function pointers. On all known platforms a caller passes the five named arguments as to a
    // function of fixed arity; the sixth is read only by the assembly above, which knows its location.
    unsafe { std::mem::transmute(entry) }
}
