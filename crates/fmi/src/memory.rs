//! Memory that FMUs of FMI 2.0 allocate by callbacks: by the C library, with bookkeeping during a [`Watch`].

use std::collections::BTreeSet;
use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of [`Watch`]es.
static WATCHES: AtomicUsize = AtomicUsize::new(0);
/// Blocks that instances created under a watch have allocated and not freed.
static BLOCKS: Mutex<BTreeSet<usize>> = Mutex::new(BTreeSet::new());
/// How often such an instance freed a block that it had not allocated.
static STRAYS: AtomicUsize = AtomicUsize::new(0);

/// Byte that fills a poisoned text.
pub const POISON: u8 = b'?';

type Allocate = unsafe extern "C" fn(usize, usize) -> *mut c_void;
type Free = unsafe extern "C" fn(*mut c_void);

/// While this lives, allocations of newly created instances are recorded: those of all threads, so the result is
/// meaningful only in a process that runs one FMU at a time.
#[derive(Debug)]
pub struct Watch(());

impl Watch {
    /// Starts recording.
    #[expect(clippy::new_without_default, reason = "it does something")]
    pub fn new() -> Self {
        WATCHES.fetch_add(1, Ordering::AcqRel);
        Self(())
    }

    /// Number of blocks not freed.
    pub fn kept(&self) -> usize {
        blocks(|blocks| blocks.len())
    }

    /// How often a block was freed that had not been allocated.
    pub fn strays(&self) -> usize {
        STRAYS.load(Ordering::Acquire)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        WATCHES.fetch_sub(1, Ordering::AcqRel);
    }
}

fn is_watched() -> bool {
    WATCHES.load(Ordering::Acquire) > 0
}

/// The callbacks for an instance created now.
pub(super) fn callbacks() -> (Allocate, Free) {
    match is_watched() {
        true => (noted_calloc, noted_free),
        false => (calloc, free),
    }
}

/// Texts passed to an FMU for one call, filled with question marks afterwards: an FMU that keeps the address instead of
/// a copy reads these. Freed on drop.
#[derive(Debug, Default)]
pub(super) struct PoisonedTexts(Vec<*mut c_char>);

impl PoisonedTexts {
    /// Poisons the texts if there is a watch.
    pub(super) fn new<const N: usize>(texts: [CString; N]) -> Self {
        let texts = texts.into_iter().filter(|_| is_watched());
        Self(texts.map(poison).collect())
    }
}

impl Drop for PoisonedTexts {
    fn drop(&mut self) {
        for text in self.0.drain(..) {
            // SAFETY: it came from `CString::into_raw` and has its original length.
            drop(unsafe { CString::from_raw(text) });
        }
    }
}

/// Overwrites a text through the same address that was passed.
fn poison(text: CString) -> *mut c_char {
    let length = text.as_bytes().len();
    let text = text.into_raw();
    // SAFETY: there are `length` bytes, to which no other pointer exists except, wrongly, the FMU's.
    unsafe { text.cast::<u8>().write_bytes(POISON, length) };
    text
}

fn blocks<T>(look: impl FnOnce(&mut BTreeSet<usize>) -> T) -> T {
    look(&mut BLOCKS.lock().unwrap_or_else(PoisonError::into_inner))
}

unsafe extern "C" fn noted_calloc(count: usize, size: usize) -> *mut c_void {
    // SAFETY: any arguments are allowed.
    let block = unsafe { calloc(count, size) };
    if !block.is_null() {
        blocks(|blocks| blocks.insert(block.addr()));
    }
    block
}

unsafe extern "C" fn noted_free(block: *mut c_void) {
    if block.is_null() {
    } else if blocks(|blocks| blocks.remove(&block.addr())) {
        // SAFETY: the block came from `calloc` and was not freed before.
        unsafe { free(block) };
    } else {
        STRAYS.fetch_add(1, Ordering::AcqRel);
    }
}

unsafe extern "C" {
    /// C library: zeroed memory, or NULL. Passed to FMUs as it is.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    /// C library: frees memory of `calloc`. Passed to FMUs as it is.
    fn free(memory: *mut c_void);
}
