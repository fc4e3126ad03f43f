//! What an instance can call back: its messages, updates within a step, and news of its clocks.

use crate::binding::{Functions, Loaded};
use crate::message::Message;
use pilotage_abi::fmi3::{InstanceEnvironment, IntermediateUpdateCallback, Status};
use std::any::Any;
use std::collections::{BTreeMap, VecDeque};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How many messages of one instance are kept: the newest.
const KEPT: usize = 200;

/// Where callbacks go, by the number that an instance's FMU got as environment. Looking it up here
/// rather than trusting a pointer keeps a confused FMU from taking the process with it.
static ENVIRONMENTS: Mutex<BTreeMap<usize, Arc<Environment>>> = Mutex::new(BTreeMap::new());

/// What belongs to one instance.
#[derive(Debug)]
struct Environment {
    name: String,
    loaded: Arc<Loaded>,
    instance: AtomicPtr<c_void>,
    messages: Mutex<VecDeque<Message>>,
    update: Mutex<Option<IntermediateUpdate>>,
    /// What a panic in `update` carried, to go on where Rust called the FMU.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
    clocks_changed: AtomicBool,
}

/// An environment that callbacks find as long as this lives.
#[derive(Debug)]
pub(super) struct Registered {
    number: usize,
    environment: Arc<Environment>,
}

impl Registered {
    pub(super) fn new(name: &str, loaded: Arc<Loaded>, update: Option<IntermediateUpdate>) -> Self {
        static NEXT: AtomicUsize = AtomicUsize::new(1);
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

    /// A number that no other environment of this process has or had.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// What the FMU gets as its environment: a number, never to be followed as a pointer.
    pub(super) fn pointer(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.number)
    }

    /// The FMU has made the instance.
    pub(super) fn made(&self, instance: *mut c_void) {
        self.environment.instance.store(instance, Ordering::Release);
    }

    /// Takes the messages out.
    pub(super) fn take(&self) -> Vec<Message> {
        lock(&self.environment.messages).drain(..).collect()
    }

    /// Whether the FMU has said since the last time that its clocks have news.
    pub(super) fn take_clocks_changed(&self) -> bool {
        (self.environment.clocks_changed).swap(false, Ordering::AcqRel)
    }

    /// Goes on with a panic of the closure that the FMU called.
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

/// A poisoned lock is used as it is: the values behind these are always whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Messages with an environment that no instance was given.
static STRAYS: AtomicUsize = AtomicUsize::new(0);

/// How many messages since the last time came with an environment that no living instance was given.
pub fn take_stray_messages() -> usize {
    STRAYS.swap(0, Ordering::AcqRel)
}

fn find(environment: *mut c_void) -> Option<Arc<Environment>> {
    lock(&ENVIRONMENTS).get(&environment.addr()).cloned()
}

/// Notes a message and hands it to `tracing`.
pub(super) fn deliver(environment: *mut c_void, message: Message) {
    let Some(environment) = find(environment) else {
        STRAYS.fetch_add(1, Ordering::AcqRel);
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
    if let Some(environment) = find(environment) {
        environment.clocks_changed.store(true, Ordering::Release);
    }
}

/// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`: nothing is to be locked, since `&mut`
/// lets one partition of an instance run at a time.
pub(super) unsafe extern "C" fn no_preemption() {}

/// A closure that an instance calls within steps (FMI 3.0, section 4.2.2). It may return a time at which it
/// wants the step to end early.
pub struct IntermediateUpdate(Box<Update>);

type Update = dyn FnMut(&mut Intermediate<'_>) -> Option<f64> + Send;

impl IntermediateUpdate {
    /// Of a closure. If it panics, the panic goes on when the FMU has come back.
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
    /// `fmi3GetFloat64` of scalars. `None` if the FMU does not allow or do it.
    ///
    /// # Panics
    /// If there are not as many values as references, here and below.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Option<()> {
        assert_eq!(references.len(), values.len());
        let Functions::Fmi3(f) = &self.environment.loaded.binding.functions else {
            return None;
        };
        let get = f.get_float64.filter(|_| self.can_get)?;
        let n = references.len();
        let instance = self.environment.instance.load(Ordering::Acquire);
        // SAFETY: the instance has called us and waits; both arrays have `n` elements.
        let status = unsafe { get(instance, references.as_ptr(), n, values.as_mut_ptr(), n) };
        (status <= Status::WARNING).then_some(())
    }

    /// `fmi3SetFloat64` of scalars. `None` if the FMU does not allow or do it.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Option<()> {
        assert_eq!(references.len(), values.len());
        let Functions::Fmi3(f) = &self.environment.loaded.binding.functions else {
            return None;
        };
        let set = f.set_float64.filter(|_| self.can_set)?;
        let n = references.len();
        let instance = self.environment.instance.load(Ordering::Acquire);
        // SAFETY: the instance has called us and waits; both arrays have `n` elements.
        let status = unsafe { set(instance, references.as_ptr(), n, values.as_ptr(), n) };
        (status <= Status::WARNING).then_some(())
    }
}

/// Calls the closure. Booleans come as bytes: only 0 and 1 are a `bool` of Rust, and C may pass others.
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
    let Some(environment) = find(environment) else {
        return;
    };
    // An FMU that calls from within a call of the closure gets no answer.
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
    // SAFETY: the FMU gives NULL or places that it reads afterwards.
    unsafe {
        if !wants_return.is_null() {
            *wants_return = u8::from(wanted.is_some());
        }
        if let Some(wanted) = wanted.filter(|_| !return_time.is_null()) {
            *return_time = wanted;
        }
    }
}

/// The callback with the type that the standard gives it.
pub(super) fn intermediate_update() -> IntermediateUpdateCallback {
    type WithBytes = unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64);
    // SAFETY: both are pointers to code; a C `bool` is passed as a byte of that value is.
    unsafe { std::mem::transmute::<WithBytes, IntermediateUpdateCallback>(update) }
}
