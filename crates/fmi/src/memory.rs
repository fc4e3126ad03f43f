//! Memory that FMUs of FMI 2.0 get by callbacks: the C library's, and its books while somebody looks.

use std::collections::BTreeSet;
use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// How many [`Watch`]es there are.
static WATCHES: AtomicUsize = AtomicUsize::new(0);
/// Blocks that instances made under a watch got and did not give back.
static BLOCKS: Mutex<BTreeSet<usize>> = Mutex::new(BTreeSet::new());
/// How often such an instance gave back what it had not got.
static STRAYS: AtomicUsize = AtomicUsize::new(0);

/// What a poisoned text is full of.
pub const POISON: u8 = b'?';

type Allocate = unsafe extern "C" fn(usize, usize) -> *mut c_void;
type Free = unsafe extern "C" fn(*mut c_void);

/// While this lives, books are kept for instances that are made: of all threads, so that only a process
/// that runs one FMU at a time learns something of that FMU.
#[derive(Debug)]
pub struct Watch(());

impl Watch {
    /// Begins to keep books.
    #[expect(clippy::new_without_default, reason = "it does something")]
    pub fn new() -> Self {
        WATCHES.fetch_add(1, Ordering::AcqRel);
        Self(())
    }

    /// Blocks that were not given back.
    pub fn kept(&self) -> usize {
        blocks(|blocks| blocks.len())
    }

    /// How often something was given back that had not been got.
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

/// The callbacks for an instance that is made now.
pub(super) fn callbacks() -> (Allocate, Free) {
    match is_watched() {
        true => (noted_calloc, noted_free),
        false => (calloc, free),
    }
}

/// Texts that an FMU got for one call, full of question marks afterwards: whoever kept an address rather than
/// a copy will read these. Freed when this goes.
#[derive(Debug, Default)]
pub(super) struct PoisonedTexts(Vec<*mut c_char>);

impl PoisonedTexts {
    /// Poisons the texts if somebody watches.
    pub(super) fn new<const N: usize>(texts: [CString; N]) -> Self {
        let texts = texts.into_iter().filter(|_| is_watched());
        Self(texts.map(poison).collect())
    }
}

impl Drop for PoisonedTexts {
    fn drop(&mut self) {
        for text in self.0.drain(..) {
            // SAFETY: it came from `CString::into_raw` and is as long as it was.
            drop(unsafe { CString::from_raw(text) });
        }
    }
}

/// Overwrites a text through the very address that was given away.
fn poison(text: CString) -> *mut c_char {
    let length = text.as_bytes().len();
    let text = text.into_raw();
    // SAFETY: there are as many bytes, which nobody else holds but, wrongly, the FMU.
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
        // SAFETY: `calloc` gave it, and it was not given back before.
        unsafe { free(block) };
    } else {
        STRAYS.fetch_add(1, Ordering::AcqRel);
    }
}

unsafe extern "C" {
    /// C library: zeroed memory, or NULL. Given to FMUs as it is.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    /// C library: gives memory of `calloc` back. Given to FMUs as it is.
    fn free(memory: *mut c_void);
}
