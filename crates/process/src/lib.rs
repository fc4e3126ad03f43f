//! Code that may crash, hang or exit, in a process that is watched: what it was doing is known afterwards, and nothing
//! of it is left behind.
//!
//! FMUs are native code of strangers. A signal, `exit(0)` or `exec` in one ends the process that called it, and neither
//! a handler of signals nor one of `exit` sees all of these endings. So a parent watches: the process that calls writes
//! what it does into a [`Page`] of memory that both share, and what the parent finds there afterwards is what was
//! true. A process has ended well only if it said so there ([`finished`]); its exit code alone means nothing.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`page`] | the shared memory: which call is going on, records, how it ended |
//! | [`child`] | a process group with a page: started, waited for, killed |
//! | [`channel`] | questions and answers between two processes |
//! | [`folder`] | temporary folders, and what dead processes left of theirs |
//! | [`leftovers`] | what is removed when a signal ends this process |
//! | [`own`] | stdout, stderr and umask, as they were |
//! | `signals` | signals, heard by a thread |

pub mod channel;
pub mod child;
pub mod folder;
pub mod leftovers;
pub mod own;
pub mod page;
#[cfg(unix)]
pub mod signals;

pub use channel::{Channel, Spoiled};
pub use child::{Child, Ended, end_with_parent};
pub use folder::Folder;
pub use page::{Going, Page, Place, attach, finished, is_attached, record};
