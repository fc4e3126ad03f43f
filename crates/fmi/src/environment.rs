//! Callbacks of an instance: its messages, intermediate updates within a step, and clock updates.

use crate::binding::{Functions, Loaded};
use crate::message::Message;
use crate::misuse::{Misuse, note};
use pilotage_abi::fmi3::{InstanceEnvironment, IntermediateUpdateCallback, Status};
use std::any::Any;
use std::collections::{BTreeMap, VecDeque};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum number of messages kept per instance: the newest ones.
const KEPT: usize = 200;

/// Environments of callbacks, by the number that an instance's FMU got as environment. The lookup, instead of a trusted
/// pointer, keeps a faulty FMU from crashing the process.
static ENVIRONMENTS: Mutex<BTreeMap<usize, Arc<Environment>>> = Mutex::new(BTreeMap::new());

/// The next number.
static NEXT: AtomicUsize = AtomicUsize::new(1);

/// The environment of one instance.
#[derive(Debug)]
struct Environment {
    name: String,
    loaded: Arc<Loaded>,
    instance: AtomicPtr<c_void>,
    messages: Mutex<VecDeque<Message>>,
    update: Mutex<Option<IntermediateUpdate>>,
    /// Payload of a panic in `update`, resumed where Rust called the FMU.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
    clocks_changed: AtomicBool,
}

/// An environment that callbacks find until this is dropped.
#[derive(Debug)]
pub(super) struct Registered {
    number: usize,
    environment: Arc<Environment>,
}

impl Registered {
    pub(super) fn new(name: &str, loaded: Arc<Loaded>, update: Option<IntermediateUpdate>) -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let environment = Arc::new(Environment {
            name: name.to_owned(),
            loaded,
            instance: AtomicPtr::default(),
            messages: Mutex::default(),
            update: Mutex::new(update),
            panic: Mutex::default(),
            clocks_changed: AtomicBool::new(false),
        });
        lock(&ENVIRONMENTS).insert(number, environment.clone());
        Self {
            number,
            environment,
        }
    }

    /// A number that is unique in this process.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// The FMU's environment: a number, never dereferenced as a pointer.
    pub(super) fn pointer(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.number)
    }

    /// Sets the instance that the FMU has created.
    pub(super) fn made(&self, instance: *mut c_void) {
        self.environment.instance.store(instance, Ordering::Release);
    }

    /// Takes the messages out.
    pub(super) fn take(&self) -> Vec<Message> {
        lock(&self.environment.messages).drain(..).collect()
    }

    /// Whether the FMU has reported a clock update since the last call.
    pub(super) fn take_clocks_changed(&self) -> bool {
        (self.environment.clocks_changed).swap(false, Ordering::AcqRel)
    }

    /// Resumes a panic of the closure that the FMU called.
    pub(super) fn resume_panic(&self) {
        let panic = lock(&self.environment.panic).take();
        if let Some(panic) = panic {
            std::panic::resume_unwind(panic);
        }
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        lock(&ENVIRONMENTS).remove(&self.number);
    }
}

/// A poisoned lock is used as it is: the values behind these locks are always consistent.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The environment that a callback was called with, if it is that of a living instance.
fn find(environment: *mut c_void, callback: &'static str) -> Option<Arc<Environment>> {
    let number = environment.addr();
    let found = lock(&ENVIRONMENTS).get(&number).cloned();
    if found.is_none() {
        note(match number {
            0 => Misuse::NoEnvironment { callback },
            _ if number < NEXT.load(Ordering::Relaxed) => Misuse::Freed { callback },
            _ => Misuse::OtherEnvironment { callback },
        });
    }
    found
}

/// Stores a message and passes it to `tracing`.
pub(super) fn deliver(environment: *mut c_void, callback: &'static str, message: Message) {
    let Some(environment) = find(environment, callback) else {
        return;
    };
    message.trace(&environment.name);
    let mut messages = lock(&environment.messages);
    if messages.len() == KEPT {
        messages.pop_front();
    }
    messages.push_back(message);
}

/// `fmi3ClockUpdateCallback`.
pub(super) unsafe extern "C" fn clock_update(environment: InstanceEnvironment) {
    if let Some(environment) = find(environment, "clockUpdate") {
        environment.clocks_changed.store(true, Ordering::Release);
    }
}

/// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`: no lock is needed, since `&mut` lets only one
/// partition of an instance run at a time.
pub(super) unsafe extern "C" fn no_preemption() {}

/// A closure that an instance calls within steps (FMI 3.0, section 4.2.2). It may return a time at which the step
/// should end early.
pub struct IntermediateUpdate(Box<Update>);

type Update = dyn FnMut(&mut Intermediate<'_>) -> Option<f64> + Send;

impl IntermediateUpdate {
    /// Wraps a closure. If it panics, the panic is resumed after the FMU has returned.
    pub fn new(update: impl FnMut(&mut Intermediate<'_>) -> Option<f64> + Send + 'static) -> Self {
        Self(Box::new(update))
    }
}

impl std::fmt::Debug for IntermediateUpdate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("IntermediateUpdate")
    }
}

/// An instance within a step, in Intermediate Update Mode.
#[derive(Debug)]
pub struct Intermediate<'a> {
    /// Time \[s\].
    pub time: f64,
    /// Whether inputs may be set.
    pub can_set: bool,
    /// Whether outputs may be read.
    pub can_get: bool,
    /// Whether a step of the FMU's own solver has just ended.
    pub is_step_finished: bool,
    /// Whether the step may end early.
    pub can_return_early: bool,
    environment: &'a Environment,
}

impl Intermediate<'_> {
    /// `fmi3GetFloat64` of scalars. `None` if the FMU does not allow it or fails.
    ///
    /// # Panics
    /// If the numbers of values and references differ, here and below.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Option<()> {
        assert_eq!(references.len(), values.len());
        let Functions::Fmi3(f) = &self.environment.loaded.binding.functions else {
            return None;
        };
        let get = f.get_float64.filter(|_| self.can_get)?;
        let n = references.len();
        let instance = self.environment.instance.load(Ordering::Acquire);
        // SAFETY: the instance has called this process and waits; both arrays have `n` elements.
        let status = unsafe { get(instance, references.as_ptr(), n, values.as_mut_ptr(), n) };
        (status <= Status::WARNING).then_some(())
    }

    /// `fmi3SetFloat64` of scalars. `None` if the FMU does not allow it or fails.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Option<()> {
        assert_eq!(references.len(), values.len());
        let Functions::Fmi3(f) = &self.environment.loaded.binding.functions else {
            return None;
        };
        let set = f.set_float64.filter(|_| self.can_set)?;
        let n = references.len();
        let instance = self.environment.instance.load(Ordering::Acquire);
        // SAFETY: the instance has called this process and waits; both arrays have `n` elements.
        let status = unsafe { set(instance, references.as_ptr(), n, values.as_ptr(), n) };
        (status <= Status::WARNING).then_some(())
    }
}

/// Calls the closure. Booleans are passed as bytes: a Rust `bool` must be 0 or 1, and C may pass other values.
unsafe extern "C" fn update(
    environment: InstanceEnvironment,
    time: f64,
    can_set: u8,
    can_get: u8,
    is_step_finished: u8,
    can_return_early: u8,
    wants_return: *mut u8,
    return_time: *mut f64,
) {
    let Some(environment) = find(environment, "intermediateUpdate") else {
        return;
    };
    // A recursive call from within the closure is ignored.
    let Ok(mut update) = environment.update.try_lock() else {
        return;
    };
    let mut intermediate = Intermediate {
        time,
        can_set: can_set != 0,
        can_get: can_get != 0,
        is_step_finished: is_step_finished != 0,
        can_return_early: can_return_early != 0,
        environment: &environment,
    };
    let call = || update.as_mut().and_then(|f| f.0(&mut intermediate));
    let wanted = catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        *lock(&environment.panic) = Some(panic);
        Some(time)
    });
    let wanted = wanted.filter(|_| can_return_early != 0);
    // SAFETY: the FMU passes NULL or valid addresses that it reads afterwards.
    unsafe {
        if !wants_return.is_null() {
            *wants_return = u8::from(wanted.is_some());
        }
        if let Some(wanted) = wanted.filter(|_| !return_time.is_null()) {
            *return_time = wanted;
        }
    }
}

/// The callback with the type required by the standard.
pub(super) fn intermediate_update() -> IntermediateUpdateCallback {
    type WithBytes = unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64);
    // SAFETY: both are function pointers; a C `bool` is passed like a byte of the same value.
    unsafe { std::mem::transmute::<WithBytes, IntermediateUpdateCallback>(update) }
}
