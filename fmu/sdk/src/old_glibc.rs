//! Functions that glibc before 2.35 lacks, so that an FMU built on a new system runs on old ones.
//!
//! Only in libraries that are linked for glibc 2.17 (`old_glibc`, as in pilotage's build and `pilotage pack`). The
//! symbols are hidden: only this library finds them.

use libc::{c_char, c_int, c_void, dl_phdr_info, size_t, stat64};

// A library's own definition takes precedence over the C library's. Rust's `#[no_mangle]` would also export it.
core::arch::global_asm!(
    ".globl stat64, fstat64, _dl_find_object",
    ".hidden stat64, fstat64, _dl_find_object",
    "stat64: jmp {stat}",
    "fstat64: jmp {fstat}",
    "_dl_find_object: jmp {find}",
    stat = sym stat,
    fstat = sym fstat,
    find = sym find_object,
);

/// `_STAT_VER` of x86-64: the layout of `struct stat64`.
const STAT_VERSION: c_int = 1;

unsafe extern "C" {
    fn __xstat64(version: c_int, path: *const c_char, buffer: *mut stat64) -> c_int;
    fn __fxstat64(version: c_int, file: c_int, buffer: *mut stat64) -> c_int;
}

/// `stat64`, a separate function since glibc 2.33.
unsafe extern "C" fn stat(path: *const c_char, buffer: *mut stat64) -> c_int {
    // SAFETY: the caller fulfils the contract of `stat64`, which is that of this function.
    unsafe { __xstat64(STAT_VERSION, path, buffer) }
}

/// `fstat64`, a separate function since glibc 2.33.
unsafe extern "C" fn fstat(file: c_int, buffer: *mut stat64) -> c_int {
    // SAFETY: the caller fulfils the contract of `fstat64`, which is that of this function.
    unsafe { __fxstat64(STAT_VERSION, file, buffer) }
}

/// `struct dl_find_object` of glibc's dlfcn.h, on x86-64.
#[repr(C)]
struct Found {
    flags: u64,
    map_start: *const c_void,
    map_end: *const c_void,
    link_map: *const c_void,
    eh_frame: *const c_void,
    reserved: [u64; 7],
}

/// Argument and result of [`look`].
struct Question {
    address: usize,
    found: Option<Found>,
}

/// `_dl_find_object`, new in glibc 2.35: the unwinder uses it to find the frames of the function at an address. Older
/// unwinders call `dl_iterate_phdr`, as this function does.
unsafe extern "C" fn find_object(address: *const c_void, result: *mut Found) -> c_int {
    let mut question = Question {
        address: address as usize,
        found: None,
    };
    // SAFETY: the question outlives the call, and `look` casts it back to its type.
    unsafe { libc::dl_iterate_phdr(Some(look), (&raw mut question).cast()) };
    match question.found {
        // SAFETY: the caller's result is writable.
        Some(found) => unsafe {
            result.write(found);
            0
        },
        None => -1,
    }
}

/// If the address lies in this object, stores its position and the header of its frames.
unsafe extern "C" fn look(info: *mut dl_phdr_info, _: size_t, question: *mut c_void) -> c_int {
    // SAFETY: `dl_iterate_phdr` passes a valid object, and `find_object` passes its question.
    let (info, question) = unsafe { (&*info, &mut *question.cast::<Question>()) };
    // SAFETY: `dlpi_phnum` headers are valid there while the object is loaded.
    let headers = unsafe { std::slice::from_raw_parts(info.dlpi_phdr, info.dlpi_phnum.into()) };
    let place = |header: &libc::Elf64_Phdr| {
        let start = (info.dlpi_addr + header.p_vaddr) as usize;
        start..start + header.p_memsz as usize
    };
    let segment = headers
        .iter()
        .filter(|header| header.p_type == libc::PT_LOAD)
        .map(place)
        .find(|place| place.contains(&question.address));
    let frames = headers
        .iter()
        .find(|header| header.p_type == libc::PT_GNU_EH_FRAME);
    let (Some(segment), Some(frames)) = (segment, frames) else {
        return 0;
    };
    question.found = Some(Found {
        flags: 0,
        map_start: segment.start as *const c_void,
        map_end: segment.end as *const c_void,
        link_map: std::ptr::null(),
        eh_frame: place(frames).start as *const c_void,
        reserved: [0; 7],
    });
    1
}
