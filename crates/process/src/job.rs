//! Windows: a job holds a process with all that it starts, and what the system tells of processes.

use std::io;
use std::mem::zeroed;
use std::os::windows::io::{AsRawHandle, FromRawHandle, OwnedHandle};
use std::process::Child;
use std::ptr::null;
use std::sync::atomic::{AtomicU32, Ordering};
use windows_sys::Win32::Foundation::WAIT_TIMEOUT;
use windows_sys::Win32::System::Console::{CTRL_C_EVENT, SetConsoleCtrlHandler};
use windows_sys::Win32::System::JobObjects::{
    AssignProcessToJobObject, CreateJobObjectW, JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE,
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION, JobObjectExtendedLimitInformation,
    SetInformationJobObject, TerminateJobObject,
};
use windows_sys::Win32::System::ProcessStatus::{K32GetProcessMemoryInfo, PROCESS_MEMORY_COUNTERS};
use windows_sys::Win32::System::Threading::{
    OpenProcess, PROCESS_SYNCHRONIZE, WaitForSingleObject,
};

/// A process and all that it starts. They end with this, and so with this process, however that ends.
#[derive(Debug)]
pub(crate) struct Job(OwnedHandle);

impl Job {
    /// Takes a process that was just started.
    pub(crate) fn of(child: &Child) -> io::Result<Self> {
        // SAFETY: no attributes, no name; a handle that is not null is ours to close.
        let job = unsafe {
            let handle = CreateJobObjectW(null(), null());
            if handle.is_null() {
                return Err(io::Error::last_os_error());
            }
            Self(OwnedHandle::from_raw_handle(handle))
        };
        // SAFETY: a structure of numbers, of which all zero is "no limit".
        let mut limits: JOBOBJECT_EXTENDED_LIMIT_INFORMATION = unsafe { zeroed() };
        limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE;
        // SAFETY: the structure is that of the class, with its size.
        done(unsafe {
            SetInformationJobObject(
                job.0.as_raw_handle(),
                JobObjectExtendedLimitInformation,
                (&raw const limits).cast(),
                size_of_val(&limits) as u32,
            )
        })?;
        // SAFETY: both handles are open.
        done(unsafe { AssignProcessToJobObject(job.0.as_raw_handle(), child.as_raw_handle()) })?;
        Ok(job)
    }

    /// Ends all of its processes.
    pub(crate) fn kill(&self) {
        // SAFETY: the handle is open.
        unsafe { TerminateJobObject(self.0.as_raw_handle(), 1) };
    }
}

fn done(result: i32) -> io::Result<()> {
    match result {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Memory that a process uses \[bytes\].
pub(crate) fn memory(child: &Child) -> Option<u64> {
    // SAFETY: a structure of numbers.
    let mut counters: PROCESS_MEMORY_COUNTERS = unsafe { zeroed() };
    let size = size_of_val(&counters) as u32;
    // SAFETY: the handle is open, and the structure has that size.
    let is_told =
        unsafe { K32GetProcessMemoryInfo(child.as_raw_handle(), &raw mut counters, size) };
    (is_told != 0).then_some(counters.WorkingSetSize as u64)
}

/// Whether a process runs; one that may not be asked does.
pub(crate) fn is_alive(number: u32) -> bool {
    const IS_NO_PROCESS: i32 = 87;
    // SAFETY: a handle that is not null is ours to close.
    let handle = unsafe { OpenProcess(PROCESS_SYNCHRONIZE, 0, number) };
    if handle.is_null() {
        return io::Error::last_os_error().raw_os_error() != Some(IS_NO_PROCESS);
    }
    // SAFETY: as above.
    let handle = unsafe { OwnedHandle::from_raw_handle(handle) };
    // SAFETY: the handle is open; this does not wait.
    unsafe { WaitForSingleObject(handle.as_raw_handle(), 0) == WAIT_TIMEOUT }
}

/// From now on Ctrl-C does not end this process, but is counted: all processes of a terminal get it.
pub(crate) fn count_interrupts(count: &'static AtomicU32) -> io::Result<()> {
    use std::sync::OnceLock;
    static COUNT: OnceLock<&AtomicU32> = OnceLock::new();
    unsafe extern "system" fn heard(event: u32) -> i32 {
        let count = COUNT.get().filter(|_| event == CTRL_C_EVENT);
        count.map(|count| count.fetch_add(1, Ordering::Relaxed));
        i32::from(count.is_some())
    }
    let _ = COUNT.set(count);
    // SAFETY: the handler may run in any thread, and only adds to an atomic.
    done(unsafe { SetConsoleCtrlHandler(Some(heard), 1) })
}
