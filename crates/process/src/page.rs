//! Memory shared by a process and its parent.
//!
//! Everything in it is an atomic: the other side may write at any time, and the code there may be hostile. Lengths are
//! clamped to the available size.

use crate::shared::{self, Name};
use memmap2::MmapRaw;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicPtr, AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// First word of every page with this layout.
const MAGIC: u64 = 0x7069_6c6f_7461_6702;
/// Maximum number of places; the last is shared by all further ones.
const PLACES: usize = 512;
/// Maximum length of a place's name \[bytes\].
const NAME: usize = 240;
/// Capacity for records \[bytes\].
const RECORDS: usize = 1 << 20;

/// State of one owner of called code.
#[repr(C)]
struct Slot {
    /// The current call; 0 if none.
    call: AtomicU32,
    /// Number of calls so far, which tells a long call from many short ones.
    count: AtomicU32,
    length: AtomicU32,
    /// Bits of the time of the last call that had one \[s\].
    time: AtomicU64,
    name: [AtomicU8; NAME],
}

#[repr(C)]
struct Layout {
    magic: AtomicU64,
    /// 0 while the process runs, then its exit code plus one.
    outcome: AtomicU32,
    places: AtomicU32,
    recorded: AtomicU64,
    lost: AtomicU64,
    all: [Slot; PLACES],
    records: [AtomicU8; RECORDS],
}

/// A page, on the parent's side.
#[derive(Debug)]
pub struct Page {
    map: MmapRaw,
    name: Name,
}

/// A call in progress.
#[derive(Debug, Clone, PartialEq)]
pub struct Going {
    /// Name of the called code's [place](Place::new).
    pub name: String,
    /// Number of the call.
    pub call: u32,
    /// Its number among the calls of that place.
    pub count: u32,
    /// Time of the last call that had one \[s\].
    pub time: Option<f64>,
}

impl Page {
    /// Creates a page.
    ///
    /// # Errors
    /// If there is no space for it.
    pub fn create() -> io::Result<Self> {
        let (map, name) = shared::create(size_of::<Layout>())?;
        layout(&map).magic.store(MAGIC, Ordering::Release);
        Ok(Self { map, name })
    }

    /// The path by which the other process opens the page.
    pub fn path(&self) -> &Path {
        self.name.path()
    }

    fn layout(&self) -> &Layout {
        layout(&self.map)
    }

    /// The exit code that the other process has [reported](finished).
    pub fn outcome(&self) -> Option<u8> {
        let outcome = self.layout().outcome.load(Ordering::Acquire);
        u8::try_from(outcome.checked_sub(1)?).ok()
    }

    /// The calls in progress, or those that were when the other process ended.
    pub fn going(&self) -> Vec<Going> {
        let layout = self.layout();
        let places = layout.places.load(Ordering::Acquire) as usize;
        let of = |place: &Slot| {
            let call = place.call.load(Ordering::Acquire);
            let time = f64::from_bits(place.time.load(Ordering::Acquire));
            let length = (place.length.load(Ordering::Acquire) as usize).min(NAME);
            let name: Vec<u8> = place.name[..length].iter().map(load).collect();
            // The code there may have written anything, and this is shown on terminals.
            let name = String::from_utf8_lossy(&name).replace(char::is_control, "\u{fffd}");
            (call != 0).then(|| Going {
                name,
                call,
                count: place.count.load(Ordering::Relaxed),
                time: (!time.is_nan()).then_some(time),
            })
        };
        layout.all[..places.min(PLACES)]
            .iter()
            .filter_map(of)
            .collect()
    }

    /// The [records](record), and the number of records lost for lack of space.
    pub fn records(&self) -> (Vec<String>, u64) {
        let layout = self.layout();
        let length = (layout.recorded.load(Ordering::Acquire) as usize).min(RECORDS);
        let bytes: Vec<u8> = layout.records[..length].iter().map(load).collect();
        let text = String::from_utf8_lossy(&bytes);
        let lines = text.lines().map(str::to_owned).collect();
        (lines, layout.lost.load(Ordering::Acquire))
    }
}

fn load(byte: &AtomicU8) -> u8 {
    byte.load(Ordering::Relaxed)
}

fn layout(map: &MmapRaw) -> &Layout {
    // SAFETY: the map has the length of a `Layout` and is aligned to a memory page, any bytes are valid atomics, and it
    // is shared only through atomics. Its length is sealed; if that cannot be, it is in a private folder.
    unsafe { &*map.as_ptr().cast::<Layout>() }
}

/// The page of this process, if its parent watches it.
static ATTACHED: AtomicPtr<Layout> = AtomicPtr::new(std::ptr::null_mut());
/// Which places of this process are in use.
static TAKEN: Mutex<Vec<bool>> = Mutex::new(Vec::new());
/// Serialises the writing of records.
static RECORDING: Mutex<()> = Mutex::new(());

fn attached() -> Option<&'static Layout> {
    // SAFETY: it is NULL or a page that is mapped until the process ends.
    unsafe { ATTACHED.load(Ordering::Acquire).as_ref() }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Attaches the page at that path to this process; called once.
///
/// # Errors
/// If it cannot be opened, or is no page.
pub fn attach(path: &Path) -> io::Result<()> {
    let map = shared::open(path, size_of::<Layout>())?;
    if layout(&map).magic.load(Ordering::Acquire) != MAGIC {
        let message = format!("{} is no page", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidData, message));
    }
    let page = map.as_mut_ptr().cast::<Layout>();
    // It stays mapped until the process ends.
    std::mem::forget(map);
    ATTACHED.store(page, Ordering::Release);
    note_forks();
    Ok(())
}

/// What has happened to this process during a call: nothing, ...
static STATE: AtomicU8 = AtomicU8::new(GOES_ON);
const GOES_ON: u8 = 0;
/// ... a signal that ends it, ...
const ENDS: u8 = 1;
/// ... or it is a copy created by `fork`.
const IS_COPY: u8 = 2;

/// No call returns from now on: a signal is ending this process.
#[cfg(unix)]
pub(crate) fn stop() {
    let _ = STATE.compare_exchange(GOES_ON, ENDS, Ordering::Relaxed, Ordering::Relaxed);
}

/// Whether a signal is ending this process; set as soon as it arrives.
pub(crate) fn is_stopped() -> bool {
    STATE.load(Ordering::Relaxed) == ENDS
}

/// Registers a handler that marks forked copies. A copy that returned from the code that forked it would continue the
/// same work, in the same files and the same shared memory.
#[cfg(unix)]
fn note_forks() {
    type Handler = Option<extern "C" fn()>;
    unsafe extern "C" {
        /// C library: registers functions that run before and after `fork`.
        fn pthread_atfork(before: Handler, parent: Handler, child: Handler) -> i32;
    }
    extern "C" fn child() {
        STATE.store(IS_COPY, Ordering::Relaxed);
    }
    // SAFETY: the handler only stores into an atomic. If there is no memory to register it, it does not run.
    let _ = unsafe { pthread_atfork(None, None, Some(child)) };
}

#[cfg(not(unix))]
fn note_forks() {}

/// Does not return: a forked copy ends at once without cleanup or report; otherwise a signal ends this process.
#[cold]
fn vanish() -> ! {
    while STATE.load(Ordering::Relaxed) != IS_COPY {
        std::thread::sleep(std::time::Duration::from_secs(1));
    }
    #[cfg(unix)]
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    std::process::abort()
}

/// Whether this process is watched.
pub fn is_attached() -> bool {
    attached().is_some()
}

/// Reports to the parent that the work is done, and the exit code: whatever ends this process from now on does no harm.
pub fn finished(code: u8) {
    if let Some(page) = attached() {
        page.outcome.store(u32::from(code) + 1, Ordering::Release);
    }
}

/// An owner of called code: an instance of an FMU, or its library. No other thread calls at the same place, so that its
/// record is right whatever other threads do.
#[derive(Debug)]
pub struct Place(usize);

impl Place {
    /// A place with that name, until it is dropped.
    pub fn new(name: &str) -> Self {
        let mut taken = lock(&TAKEN);
        let free = taken.iter().position(|taken| !taken);
        let number = free.unwrap_or(taken.len()).min(PLACES - 1);
        let is_shared = number + 1 == PLACES;
        if number == taken.len() {
            // The shared place is never marked as taken, so it is never free either.
            taken.push(true);
        }
        taken[number] = true;
        if let Some(page) = attached() {
            page.all[number].name(if is_shared { "one of many" } else { name });
            page.places.fetch_max(number as u32 + 1, Ordering::AcqRel);
        }
        Self(number)
    }

    /// Records the call `number` for as long as `work` takes; `number` is chosen by the caller and not 0.
    #[inline(always)]
    pub fn call<T>(&self, number: u32, work: impl FnOnce() -> T) -> T {
        let outer = self.enter(number);
        let done = work();
        self.leave(outer);
        done
    }

    /// Records a call; returns the outer one if it is an inner call (a callback). At the shared place the other call may
    /// belong to another owner.
    #[inline]
    fn enter(&self, number: u32) -> u32 {
        let Some(page) = attached() else {
            return 0;
        };
        let Slot { call, count, .. } = &page.all[self.0];
        count.store(
            count.load(Ordering::Relaxed).wrapping_add(1),
            Ordering::Relaxed,
        );
        let outer = match self.0 + 1 == PLACES {
            true => 0,
            false => call.load(Ordering::Relaxed),
        };
        call.store(number, Ordering::Release);
        outer
    }

    /// Records that a call is done, and the outer one once more.
    #[inline]
    fn leave(&self, outer: u32) {
        let Some(page) = attached() else {
            return;
        };
        if STATE.load(Ordering::Relaxed) != GOES_ON {
            vanish();
        }
        page.all[self.0].call.store(outer, Ordering::Release);
    }

    /// Records another call within the current one.
    pub fn doing(&self, number: u32) {
        if let Some(page) = attached() {
            page.all[self.0].call.store(number, Ordering::Release);
        }
    }

    /// Records the time \[s\] reached.
    #[inline(always)]
    pub fn at(&self, time: f64) {
        if let Some(page) = attached() {
            page.all[self.0]
                .time
                .store(time.to_bits(), Ordering::Relaxed);
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if self.0 + 1 < PLACES {
            lock(&TAKEN)[self.0] = false;
        }
    }
}

impl Slot {
    /// Sets the name; no time is reached yet.
    fn name(&self, name: &str) {
        let bytes = name.as_bytes();
        let length = bytes.len().min(NAME);
        for (to, &byte) in self.name.iter().zip(bytes) {
            to.store(byte, Ordering::Relaxed);
        }
        self.length.store(length as u32, Ordering::Release);
        self.time.store(f64::NAN.to_bits(), Ordering::Release);
    }
}

/// Passes a line to the parent. If there is no space left, it is counted as lost.
pub fn record(line: &str) {
    let Some(page) = attached() else { return };
    let _one = lock(&RECORDING);
    let from = page.recorded.load(Ordering::Acquire) as usize;
    let Some(room) = (page.records.get(from..)).filter(|room| room.len() > line.len()) else {
        page.lost.fetch_add(1, Ordering::AcqRel);
        return;
    };
    let bytes = line
        .bytes()
        .map(|byte| if byte == b'\n' { b' ' } else { byte });
    for (to, byte) in room.iter().zip(bytes.chain([b'\n'])) {
        to.store(byte, Ordering::Relaxed);
    }
    let to = from + line.len() + 1;
    page.recorded.store(to as u64, Ordering::Release);
}
