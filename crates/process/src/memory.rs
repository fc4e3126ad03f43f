//! Out of memory: a message and exit code 2, where the standard library aborts.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator. If it has no memory left, the process ends with a message and exit code 2; what it has locked
/// is removed by the next process, as after a kill.
///
/// To be the `#[global_allocator]` of a command, not of a library: no caller sees a failed allocation.
#[derive(Debug)]
pub struct Heap;

// SAFETY: every call is passed on as it is, and the only other effect is the end of the process.
unsafe impl GlobalAlloc for Heap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller vouches.
        given(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller vouches.
        given(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as the caller vouches.
        given(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller vouches.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[inline]
fn given(memory: *mut u8, size: usize) -> *mut u8 {
    #[cfg(unix)]
    if memory.is_null() {
        give_up(size);
    }
    // Elsewhere the standard library aborts.
    #[cfg(not(unix))]
    let _ = size;
    memory
}

/// Exit code of a command that cannot run as it was asked to.
#[cfg(unix)]
const CODE: u8 = 2;

/// Ends the process. Nothing here allocates, nor waits for another thread.
#[cfg(unix)]
#[cold]
fn give_up(size: usize) -> ! {
    use rustix::stdio::stderr;
    use std::io::{Cursor, Write};
    use std::sync::atomic::{AtomicBool, Ordering};
    static IS_SAID: AtomicBool = AtomicBool::new(false);
    let mut text = Cursor::new([0; 256]);
    let _ = write!(
        text,
        "error: out of memory: {size} bytes more are not to be had\nhint: give it less data or fewer threads \
         (RAYON_NUM_THREADS), or allow it more memory (`ulimit -v`)\n"
    );
    let length = usize::try_from(text.position()).unwrap_or(0);
    let text = &text.get_ref()[..length];
    crate::page::finished(CODE);
    // Threads that run out at the same time say so once.
    match IS_SAID.swap(true, Ordering::AcqRel) {
        false => drop(rustix::io::write(stderr(), text)),
        true => std::thread::sleep(std::time::Duration::from_millis(100)),
    }
    signal_hook::low_level::exit(i32::from(CODE))
}
