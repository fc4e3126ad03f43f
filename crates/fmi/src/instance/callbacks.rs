//! The table of callbacks of an instance of FMI 2.0.

use crate::misuse::{Misuse, note};
use pilotage_abi::fmi2::CallbackFunctions;
use std::sync::{Mutex, PoisonError};

/// The standard's names of the fields.
const FIELDS: [&str; 5] = [
    "logger",
    "allocateMemory",
    "freeMemory",
    "stepFinished",
    "componentEnvironment",
];

/// The fields of a table as numbers.
type Words = [usize; FIELDS.len()];

const _: () = assert!(size_of::<Words>() == size_of::<CallbackFunctions>());

/// Tables are never freed, but kept where a search for lost memory finds them: an FMU may keep the address, and log late,
/// such as by a thread that goes on or when its library is unloaded. They have 40 bytes.
static ALL: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

#[expect(dead_code, reason = "it is only kept")]
struct Kept(*mut CallbackFunctions);

// SAFETY: the address is not used.
unsafe impl Send for Kept {}

/// A table that an FMU was given. On drop it notes what the FMU has changed: it must change nothing before it is terminated
/// (FMI 2.0, section 2.1.5).
#[derive(Debug)]
pub(super) struct Callbacks {
    table: *mut CallbackFunctions,
    given: Words,
}

impl Callbacks {
    pub(super) fn new(functions: CallbackFunctions) -> Self {
        let table = Box::into_raw(Box::new(functions));
        let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
        all.push(Kept(table));
        let mut own = Self {
            table,
            given: Words::default(),
        };
        own.given = own.words();
        own
    }

    /// What the FMU is given.
    pub(super) fn pointer(&self) -> *const CallbackFunctions {
        self.table
    }

    fn words(&self) -> Words {
        // SAFETY: the table is never freed, and consists of pointers, each of them as large as a word. The FMU may have
        // written anything.
        unsafe { self.table.cast::<Words>().read_volatile() }
    }
}

impl Drop for Callbacks {
    fn drop(&mut self) {
        let now = self.words();
        for (field, (now, given)) in FIELDS.into_iter().zip(now.iter().zip(&self.given)) {
            if now != given {
                note(Misuse::Changed { field });
            }
        }
    }
}
