//! A watched process with a page.

use crate::leftovers::{self, Kind, Leftover};
use crate::page::Page;
use std::io;
use std::process::{Command, ExitStatus};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Passes the parent's process ID and the page's path to the child: `PID:PATH`.
const VARIABLE: &str = "PILOTAGE_WATCHED_BY";

/// Interval between checks whether the process still runs.
const BETWEEN: Duration = Duration::from_millis(2);

/// Number of interrupts forwarded to the child.
static HANDED_ON: AtomicU32 = AtomicU32::new(0);

/// A watched process. It is killed on drop.
#[derive(Debug)]
pub struct Child {
    child: std::process::Child,
    page: Page,
    /// Whether it leads its own process group.
    is_group: bool,
    is_over: bool,
    #[cfg(windows)]
    job: crate::job::Job,
    _leftover: Leftover,
}

/// How a process ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It reported that its work was done, with this exit code. `badly`: it then ended in another way.
    Done {
        /// The exit code.
        code: u8,
        /// How it actually ended, if differently; the inner `None`: it had to be killed.
        badly: Option<Option<ExitStatus>>,
    },
    /// It ended before reporting an outcome.
    Early(ExitStatus),
    /// It exceeded the time limit and was killed.
    Late,
}

impl Child {
    /// Starts the command with a page. In its own process group (`is_group`) it gets no Ctrl-C from the terminal, and
    /// every process that it starts ends with it.
    ///
    /// # Errors
    /// If the page cannot be created, or the process does not start.
    pub fn start(mut command: Command, is_group: bool) -> io::Result<Self> {
        let page = Page::create()?;
        let mut value = std::ffi::OsString::from(format!("{}:", std::process::id()));
        value.push(page.path());
        command.env(VARIABLE, value);
        #[cfg(unix)]
        if is_group {
            std::os::unix::process::CommandExt::process_group(&mut command, 0);
        }
        #[cfg(windows)]
        if is_group {
            const CREATE_NEW_PROCESS_GROUP: u32 = 0x200;
            std::os::windows::process::CommandExt::creation_flags(
                &mut command,
                CREATE_NEW_PROCESS_GROUP,
            );
        }
        let kind = |child: &std::process::Child| match is_group {
            true => Kind::Group(child.id()),
            false => Kind::Process(child.id()),
        };
        let (child, leftover) = leftovers::make(|| command.spawn(), kind)?;
        Ok(Self {
            #[cfg(windows)]
            job: crate::job::Job::of(&child)?,
            child,
            page,
            is_group,
            is_over: false,
            _leftover: leftover,
        })
    }

    /// The shared memory.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// The process.
    pub fn process(&mut self) -> &mut std::process::Child {
        &mut self.child
    }

    /// From now on SIGINT is forwarded to the child, whose end then also ends this process. A Ctrl-C at the terminal,
    /// which is sent to both, reaches the child twice.
    ///
    /// # Errors
    /// If the signal handler cannot be registered.
    #[cfg(unix)]
    pub fn hand_on_interrupts(&self) -> io::Result<()> {
        use rustix::process::Signal;
        let child = self.child.id();
        leftovers::leave_interrupts();
        crate::signals::listen(&[signal_hook::consts::SIGINT], move |_| {
            let before = HANDED_ON.fetch_add(1, Ordering::Relaxed);
            send(child, Signal::INT);
            // The child may block signals or be stopped: the third interrupt kills it.
            if before >= 2 {
                send(child, Signal::KILL);
            }
        })
    }

    /// From now on Ctrl-C does not end this process: the child gets it too, and its end then also ends this process.
    ///
    /// # Errors
    /// If the handler cannot be registered.
    #[cfg(windows)]
    pub fn hand_on_interrupts(&self) -> io::Result<()> {
        crate::job::count_interrupts(&HANDED_ON)
    }

    /// Number of interrupts forwarded.
    pub fn interrupts(&self) -> u32 {
        HANDED_ON.load(Ordering::Relaxed)
    }

    /// Waits for the process to end: at most `limit` for its work, and at most `after` once it has reported that this
    /// is done; every few milliseconds `look` sees what it does. Removes what it left in the temporary folder.
    ///
    /// # Errors
    /// If the system does not report the status.
    pub fn wait(
        &mut self,
        limit: Option<Duration>,
        after: Duration,
        look: impl FnMut(&Page),
    ) -> io::Result<Ended> {
        let ended = self.wait_for_end(limit, after, look)?;
        match ended {
            // The code that it called may have kept it from removing its own folders.
            Ended::Done { badly: None, .. } => self.sweep(),
            _ => crate::folder::sweep(),
        }
        Ok(ended)
    }

    fn wait_for_end(
        &mut self,
        limit: Option<Duration>,
        after: Duration,
        mut look: impl FnMut(&Page),
    ) -> io::Result<Ended> {
        let started = Instant::now();
        let mut done: Option<Instant> = None;
        loop {
            if let Some(status) = self.try_end()? {
                return Ok(match self.page.outcome() {
                    None => Ended::Early(status),
                    Some(code) => {
                        // `exit` within a call may have the same code.
                        let is_good =
                            status.code() == Some(i32::from(code)) && self.page.going().is_empty();
                        let badly = (!is_good).then_some(Some(status));
                        Ended::Done { code, badly }
                    }
                });
            }
            if let (None, Some(_)) = (done, self.page.outcome()) {
                done = Some(Instant::now());
            }
            if let (Some(since), Some(code)) = (done, self.page.outcome())
                && since.elapsed() > after
            {
                self.kill();
                let badly = Some(None);
                return Ok(Ended::Done { code, badly });
            }
            if done.is_none() && limit.is_some_and(|limit| started.elapsed() > limit) {
                self.kill();
                return Ok(Ended::Late);
            }
            // The third interrupt kills a child that takes none.
            #[cfg(windows)]
            if self.interrupts() >= 3 {
                self.job.kill();
            }
            look(&self.page);
            thread::sleep(BETWEEN);
        }
    }

    /// Removes what the killed process left in the temporary folder.
    pub fn sweep(&self) {
        crate::folder::sweep_of(self.child.id());
    }

    /// Current memory use \[bytes\]; `None` if the system does not report it.
    pub fn memory(&self) -> Option<u64> {
        #[cfg(windows)]
        return crate::job::memory(&self.child);
        #[cfg(not(windows))]
        self.resident()
    }

    /// What Linux reports.
    #[cfg(not(windows))]
    fn resident(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).ok()?;
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))?;
        let kilobytes: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
        Some(1024 * kilobytes)
    }

    /// Its status, if it has ended. All processes that it started are killed too.
    ///
    /// # Errors
    /// If the system does not report the status.
    pub fn try_end(&mut self) -> io::Result<Option<ExitStatus>> {
        #[cfg(unix)]
        if self.is_group && !self.is_over {
            // The process has ended but is not yet reaped, so its ID is not reused.
            if !has_ended(self.child.id())? {
                return Ok(None);
            }
            kill_group(self.child.id());
        }
        let status = match self.child.try_wait() {
            // Foreign code in this process has set SIGCHLD to be ignored: the exit status of a child is lost.
            #[cfg(unix)]
            Err(error) if is_no_child(&error) => Some(ExitStatus::default()),
            status => status?,
        };
        self.is_over |= status.is_some();
        Ok(status)
    }

    /// Kills the process and all processes that it started.
    pub fn kill(&mut self) {
        if self.is_over {
            return;
        }
        #[cfg(unix)]
        if self.is_group {
            kill_group(self.child.id());
        }
        #[cfg(windows)]
        self.job.kill();
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.is_over = true;
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Sends a signal to a process, if it still exists.
#[cfg(unix)]
fn send(process: u32, signal: rustix::process::Signal) {
    if let Some(pid) = i32::try_from(process)
        .ok()
        .and_then(rustix::process::Pid::from_raw)
    {
        let _ = rustix::process::kill_process(pid, signal);
    }
}

/// Sends SIGINT to a process, if it still exists.
#[cfg(unix)]
pub fn interrupt(process: u32) {
    send(process, rustix::process::Signal::INT);
}

/// Asks a process to end, so that it removes what it has created, and kills it if it does not end within 2 s.
#[cfg(unix)]
pub(crate) fn end(process: u32) {
    use rustix::process::Signal;
    send(process, Signal::TERM);
    let begun = Instant::now();
    // Another thread may have reaped it: then there is no such child.
    while !has_ended(process).unwrap_or(true) && begun.elapsed() < Duration::from_secs(2) {
        thread::sleep(BETWEEN);
    }
    send(process, Signal::KILL);
    crate::folder::sweep_of(process);
}

/// Kills a process group, if it still exists.
#[cfg(unix)]
pub(crate) fn kill_group(leader: u32) {
    use rustix::process::{Pid, Signal, kill_process_group};
    if let Some(pid) = i32::try_from(leader).ok().and_then(Pid::from_raw) {
        let _ = kill_process_group(pid, Signal::KILL);
    }
}

/// Whether a child has ended; does not reap it.
#[cfg(unix)]
fn has_ended(child: u32) -> io::Result<bool> {
    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
    let pid = i32::try_from(child).ok().and_then(Pid::from_raw);
    let Some(pid) = pid else { return Ok(true) };
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    match waitid(WaitId::Pid(pid), options) {
        Err(error) if is_no_child(&error.into()) => Ok(true),
        ended => Ok(ended?.is_some()),
    }
}

/// Whether the error means that there is no such child.
#[cfg(unix)]
fn is_no_child(error: &io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::CHILD.raw_os_error())
}

/// Whether this process was started by [`Child::start`]: if so, it attaches its page and ends when its parent ends.
///
/// # Errors
/// If the page is missing or invalid.
pub fn end_with_parent() -> io::Result<bool> {
    let Some(value) = std::env::var_os(VARIABLE) else {
        return Ok(false);
    };
    // A process started by an FMU inherits the variable, but has another parent.
    let bytes = value.as_encoded_bytes();
    let Some(colon) = bytes.iter().position(|&byte| byte == b':') else {
        return Ok(false);
    };
    let parent = std::str::from_utf8(&bytes[..colon])
        .ok()
        .and_then(|text| text.parse::<u32>().ok());
    let Some(parent) = parent else {
        return Ok(false);
    };
    #[cfg(unix)]
    if !is_parent(parent) {
        return match is_alive(parent) {
            true => Ok(false),
            // The parent was killed before the check: there is nothing left to do.
            false => Err(io::Error::other(
                "the process that started this one is gone",
            )),
        };
    }
    #[cfg(unix)]
    let path: std::path::PathBuf = {
        use std::os::unix::ffi::OsStrExt;
        std::ffi::OsStr::from_bytes(&bytes[colon + 1..]).into()
    };
    #[cfg(windows)]
    let path: std::path::PathBuf = value.to_string_lossy()[colon + 1..].into();
    crate::page::attach(&path)?;
    #[cfg(unix)]
    thread::Builder::new()
        .name("parent".into())
        .spawn(move || watch(parent))?;
    // The job of this process ends with its parent. No process that an FMU starts takes itself for this one.
    #[cfg(windows)]
    // SAFETY: always safe on this system.
    unsafe {
        std::env::remove_var(VARIABLE);
    }
    Ok(true)
}

/// Ends this process when its parent has ended.
#[cfg(unix)]
fn watch(parent: u32) {
    while is_parent(parent) {
        thread::sleep(Duration::from_millis(20));
    }
    leftovers::remove();
    let own = rustix::process::getpid();
    if rustix::process::getpgrp() == own {
        let _ = rustix::process::kill_process_group(own, rustix::process::Signal::KILL);
    }
    // SIGKILL skips the exit handlers that an FMU has registered.
    let _ = rustix::process::kill_process(own, rustix::process::Signal::KILL);
    std::process::abort();
}

#[cfg(unix)]
fn is_parent(number: u32) -> bool {
    let parent = rustix::process::getppid();
    parent.is_some_and(|pid| u32::try_from(pid.as_raw_nonzero().get()) == Ok(number))
}

#[cfg(unix)]
pub(crate) fn is_alive(number: u32) -> bool {
    let pid = i32::try_from(number)
        .ok()
        .and_then(rustix::process::Pid::from_raw);
    let is_there = |pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH);
    pid.is_some_and(is_there) && !is_zombie(number)
}

/// Whether a process has ended and is not yet reaped.
#[cfg(unix)]
fn is_zombie(number: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{number}/stat")).unwrap_or_default();
    // The name, in parentheses, may contain anything.
    let state = stat
        .rsplit_once(") ")
        .and_then(|(_, rest)| rest.chars().next());
    matches!(state, Some('Z' | 'X'))
}

#[cfg(windows)]
pub(crate) use crate::job::is_alive;
