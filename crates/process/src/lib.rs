//! Runs code that may crash, hang or exit in a watched process: afterwards it is known what the process was doing, and
//! it leaves nothing behind.
//!
//! FMUs are third-party native code. A signal, `exit(0)` or `exec` in one of them ends the calling process, and neither
//! signal handlers nor `atexit` handlers catch all of these cases. Therefore a parent process watches: the calling
//! process writes what it does to a [`Page`] of shared memory, which the parent reads afterwards. A process has ended
//! well only if it reported so there ([`finished`]); its exit code alone means nothing.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`page`] | the shared memory: the current call, records, the outcome |
//! | [`child`] | a process group with a page: start, wait, kill |
//! | [`channel`] | requests and replies between two processes |
//! | [`folder`] | temporary folders, and removal of those that dead processes left |
//! | `job` | Windows: a process with all that it starts |
//! | [`leftovers`] | what is removed when a signal ends this process |
//! | [`lock`] | locks on files that one process at a time writes |
//! | [`memory`] | an allocator that ends the process with a message |
//! | [`shared`] | the memory that two processes share |
//! | [`own`] | restores stdout, stderr and the umask |
//! | [`program`] | the program that runs: its arguments, and how it is started again |
//! | `signals` | signals, handled by a thread |

pub mod channel;
pub mod child;
pub mod folder;
#[cfg(windows)]
mod job;
pub mod leftovers;
pub mod lock;
pub mod memory;
pub mod own;
pub mod page;
pub mod program;
pub mod shared;
#[cfg(unix)]
pub mod signals;

pub use channel::{Channel, Spoiled};
pub use child::{Child, Ended, end_with_parent};
pub use folder::Folder;
pub use page::{Going, Page, Place, attach, finished, is_attached, record};
