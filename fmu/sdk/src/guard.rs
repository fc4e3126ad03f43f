//! Layer between C and safe code: it checks pointers, turns panics into a status, and enforces the calling order of a
//! version of FMI.

use crate::instance::{InterfaceType, Phase};
use crate::log::Log;
use crate::problem::{Problem, Severity};
use crate::{SimulationUnit, abi};
use std::any::Any;
use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Differences between FMI 2.0 and FMI 3.0: states, functions, status.
pub trait Version {
    /// State of an instance.
    type State: Copy + PartialEq + std::fmt::Debug;
    /// A function of the interface.
    type Function: Copy;
    /// Status that a function returns.
    type Status: Copy;
    /// Version number.
    const NUMBER: u8;

    /// Checks that the function may be called in the state; the error lists the states in which it may.
    fn legal(function: Self::Function, state: Self::State) -> Result<(), String>;
    /// Part of the interface that the function belongs to.
    fn part(function: Self::Function) -> abi::Part;
    /// The function's name.
    fn name(function: Self::Function) -> &'static str;
    /// Name of the state.
    fn state_name(state: Self::State) -> &'static str;
    /// What may be set in the state.
    fn phase(state: Self::State) -> Phase;
    /// The state after a problem.
    fn after(problem: &Problem, state: Self::State) -> Self::State;
    /// The status; `None` means success.
    fn status(severity: Option<Severity>) -> Self::Status;
    /// The state as a number.
    fn bits(state: Self::State) -> u16;
    /// The state of an instance with that number, if any.
    fn from_bits(bits: u16) -> Option<Self::State>;
}

/// The object to which the importer has a pointer.
#[derive(Debug)]
pub struct Component<U, V: Version> {
    /// The instance.
    pub instance: U,
    /// State of the calling order.
    pub state: V::State,
    /// Logger of its messages.
    pub log: Log,
    /// Handling of events.
    pub events: Events,
    /// The strings that the importer got last.
    pub strings: Vec<CString>,
}

/// How the importer handles events, and inputs within a step (co-simulation of FMI 3.0; unused in FMI 2.0).
#[derive(Debug, Clone, Copy, Default)]
pub struct Events {
    /// The importer uses event mode.
    pub event_mode: bool,
    /// A step may end early.
    pub early_return: bool,
    /// Callback in which the importer sets inputs within a step, and its first argument.
    pub update: Option<(
        abi::fmi3::types::IntermediateUpdateCallback,
        abi::fmi3::types::InstanceEnvironment,
    )>,
}

impl<U: SimulationUnit, V: Version> Component<U, V> {
    /// Runs the body of a function if it may be called now; reports a problem and enters the state that follows from
    /// it.
    pub fn call(
        &mut self,
        function: V::Function,
        body: impl FnOnce(&mut Self) -> Result<(), Problem>,
    ) -> V::Status {
        let result = self.check(function).and_then(|()| body(self));
        self.pass_messages_on();
        match result {
            Ok(()) => V::status(None),
            Err(problem) => self.fail(function, &problem),
        }
    }

    /// Passes what something inside has said to the importer's logger.
    #[inline]
    fn pass_messages_on(&mut self) {
        for (severity, text) in self.instance.take_messages() {
            self.log.say(severity, &text);
        }
    }

    fn check(&self, function: V::Function) -> Result<(), Problem> {
        let (needed, other) = match V::part(function) {
            abi::Part::Common => ("", None),
            abi::Part::CoSimulation => ("co-simulation", Some(InterfaceType::ModelExchange)),
            abi::Part::ModelExchange => ("model exchange", Some(InterfaceType::CoSimulation)),
            abi::Part::ScheduledExecution => ("scheduled execution", Some(self.instance.kind())),
        };
        V::legal(function, self.state).map_err(|legal| Problem::IllegalState {
            state: V::state_name(self.state),
            legal,
        })?;
        match other == Some(self.instance.kind()) {
            true => Err(Problem::WrongKind {
                needed,
                found: self.instance.kind().name(),
            }),
            false => Ok(()),
        }
    }

    /// Reports a problem, enters the state that follows from it, and returns the status.
    pub fn fail(&mut self, function: V::Function, problem: &Problem) -> V::Status {
        self.state = V::after(problem, self.state);
        self.log.report(V::name(function), problem);
        V::status(Some(problem.severity()))
    }

    /// What may be set now, and the name of the state.
    pub fn phase(&self) -> (Phase, &'static str) {
        (V::phase(self.state), V::state_name(self.state))
    }

    /// A copy of the complete state.
    ///
    /// # Errors
    /// If something inside cannot be copied.
    pub fn checkpoint(&mut self) -> Result<U::State, Problem> {
        self.instance.checkpoint(V::NUMBER, V::bits(self.state))
    }

    /// State of the calling order of a copy.
    ///
    /// # Errors
    /// If it is not a state of this version of FMI.
    pub fn state_of(&self, checkpoint: &U::State) -> Result<V::State, Problem> {
        let (version, bits) = U::origin(checkpoint);
        let own = version == V::NUMBER;
        let state = own.then(|| V::from_bits(bits)).flatten();
        state.ok_or_else(|| Problem::Bytes {
            what: "the state",
            found: format!("{bits} of FMI {version}"),
            expected: format!("that of an instance of FMI {}", V::NUMBER),
        })
    }

    /// Restores a copy.
    ///
    /// # Errors
    /// If it belongs to another FMU, kind or version of FMI.
    pub fn restore(&mut self, checkpoint: &U::State) -> Result<(), Problem> {
        let state = self.state_of(checkpoint)?;
        self.instance.restore(checkpoint)?;
        self.state = state;
        Ok(())
    }
}

/// Runs the body of a function on the instance that `component` points to.
///
/// # Safety
/// `component` is NULL, or was returned by an instantiate function for this model and this version and has not been
/// freed, and no other thread uses it.
pub unsafe fn call<U: SimulationUnit, V: Version>(
    component: *mut c_void,
    function: V::Function,
    body: impl FnOnce(&mut Component<U, V>) -> Result<(), Problem>,
) -> V::Status {
    // SAFETY: guaranteed by the caller to be NULL, or an instance that is not used elsewhere.
    let Some(component) = (unsafe { component.cast::<Component<U, V>>().as_mut() }) else {
        return V::status(Some(Severity::Error));
    };
    guarded(component, function, body)
}

/// Turns a panic of the body into a status. The instance is then in the state `fatal` and can only be freed, so it does
/// not matter in which condition the panic left it.
fn guarded<U: SimulationUnit, V: Version>(
    component: &mut Component<U, V>,
    function: V::Function,
    body: impl FnOnce(&mut Component<U, V>) -> Result<(), Problem>,
) -> V::Status {
    let run = catch_unwind(AssertUnwindSafe(|| component.call(function, body)));
    run.unwrap_or_else(|panic| {
        let problem = Problem::Panic {
            message: message(panic.as_ref()),
        };
        let report = catch_unwind(AssertUnwindSafe(|| component.fail(function, &problem)));
        report.unwrap_or(V::status(Some(Severity::Fatal)))
    })
}

/// Creates an instance; if that fails, reports a message and returns NULL.
pub fn instantiate<U: SimulationUnit, V: Version>(
    function: V::Function,
    log: Log,
    state: V::State,
    events: Events,
    create: impl FnOnce() -> Result<U, Problem>,
) -> *mut c_void {
    let result = catch_unwind(AssertUnwindSafe(create)).unwrap_or_else(|panic| {
        Err(Problem::Panic {
            message: message(panic.as_ref()),
        })
    });
    match result {
        Ok(instance) => {
            let mut component = Component::<U, V> {
                instance,
                state,
                log,
                events,
                strings: Vec::new(),
            };
            component.pass_messages_on();
            Box::into_raw(Box::new(component)).cast()
        }
        Err(problem) => {
            log.report(V::name(function), &problem);
            std::ptr::null_mut()
        }
    }
}

/// Checks the arguments that all instantiate functions have in common, and creates the instance.
///
/// # Errors
/// If the name is missing, the model cannot be loaded, or the fingerprint differs.
pub fn create<U: SimulationUnit>(
    load: crate::Load<U>,
    name: Result<&CStr, Problem>,
    kind: InterfaceType,
    fingerprint: (&'static str, &CStr),
    location: Option<&CStr>,
) -> Result<U, Problem> {
    if name?.is_empty() {
        return Err(Problem::NoName);
    }
    let location = location.map(CStr::to_string_lossy);
    let instance = load(kind, location.as_deref()).map_err(Problem::Load)?;
    let (argument, found) = fingerprint;
    match found.to_bytes() == instance.guid().as_bytes() {
        true => Ok(instance),
        false => Err(Problem::WrongGuid {
            argument,
            found: found.to_string_lossy().into_owned(),
            expected: instance.guid().to_owned(),
        }),
    }
}

/// Frees an instance in every state, to avoid leaks.
///
/// # Safety
/// As [`call`]; the instance must not be used afterwards.
pub unsafe fn free<U, V: Version>(component: *mut c_void) {
    if component.is_null() {
        return;
    }
    // SAFETY: it came from `Box::into_raw` in `instantiate`, and the importer does not use it afterwards.
    let component = unsafe { Box::from_raw(component.cast::<Component<U, V>>()) };
    // A panic while freeing must not reach the host; it can no longer be reported.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(component)));
}

/// Message of a panic.
pub(crate) fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let string = || panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(string).unwrap_or("panic").to_owned()
}

/// The array of `count` elements that C passes as a pointer; NULL is allowed if `count` is 0.
///
/// # Safety
/// `pointer` is NULL, or points to `count` elements that are not written during `'a`.
///
/// # Errors
/// If it is NULL, or `count` is too large.
pub unsafe fn array<'a, T>(
    pointer: *const T,
    count: usize,
    argument: &'static str,
) -> Result<&'a [T], Problem> {
    check_array(pointer.is_null(), size_of::<T>(), count, argument)?;
    match count {
        0 => Ok(&[]),
        // SAFETY: not NULL, and guaranteed by the caller to be valid for `count` elements.
        _ => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// As [`array()`], but mutable.
///
/// # Safety
/// `pointer` is NULL, or points to `count` elements that are not used elsewhere during `'a`.
///
/// # Errors
/// As [`array()`].
pub unsafe fn array_mut<'a, T>(
    pointer: *mut T,
    count: usize,
    argument: &'static str,
) -> Result<&'a mut [T], Problem> {
    check_array(pointer.is_null(), size_of::<T>(), count, argument)?;
    match count {
        0 => Ok(&mut []),
        // SAFETY: not NULL, and guaranteed by the caller to be valid for `count` elements.
        _ => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) }),
    }
}

fn check_array(
    null: bool,
    size: usize,
    count: usize,
    argument: &'static str,
) -> Result<(), Problem> {
    if count
        .checked_mul(size)
        .is_none_or(|n| n > isize::MAX as usize)
    {
        return Err(Problem::TooMany { argument, count });
    }
    match null && count > 0 {
        true => Err(Problem::Null { argument }),
        false => Ok(()),
    }
}

/// The value to which a pointer from C points.
///
/// # Safety
/// `pointer` is NULL, or points to a value that is not used elsewhere during `'a`.
///
/// # Errors
/// When it is NULL.
pub unsafe fn place<'a, T>(pointer: *mut T, argument: &'static str) -> Result<&'a mut T, Problem> {
    // SAFETY: guaranteed by the caller to be NULL or valid.
    unsafe { pointer.as_mut() }.ok_or(Problem::Null { argument })
}

/// The C string to which a pointer points.
///
/// # Safety
/// `pointer` is NULL, or a C string that is valid during `'a`.
///
/// # Errors
/// When it is NULL.
pub unsafe fn string<'a>(
    pointer: *const c_char,
    argument: &'static str,
) -> Result<&'a CStr, Problem> {
    if pointer.is_null() {
        return Err(Problem::Null { argument });
    }
    // SAFETY: not NULL, and guaranteed by the caller to be a C string.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

/// The strings of an array of pointers.
///
/// # Safety
/// `pointer` is NULL, or points to `count` pointers that are NULL or C strings; all are valid during `'a`.
///
/// # Errors
/// When one of them is NULL.
pub unsafe fn strings<'a>(
    pointer: *const *const c_char,
    count: usize,
    argument: &'static str,
) -> Result<Vec<&'a CStr>, Problem> {
    // SAFETY: guaranteed by the caller.
    let pointers = unsafe { array(pointer, count, argument) }?;
    pointers
        .iter()
        // SAFETY: guaranteed by the caller to be NULL or a C string.
        .map(|p| unsafe { string(*p, argument) })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fmi2::Fmi2;
    use crate::instance::Instance;
    use crate::log::Sink;
    use crate::{At, Equations, Scalar, Table};
    use abi::fmi2::{Function, State, Status};

    struct Nothing;

    impl Equations for Nothing {
        fn table(&self) -> Table {
            Table::new("nothing", "A model without variables").input("u", "1", "Its input")
        }

        fn derivative<T: Scalar>(&self, _at: At<T>, _dx: &mut [T]) {}
    }

    /// FMI rule 21: a panic becomes a status.
    #[test]
    fn a_panic_becomes_fatal_and_ruins_this_instance_alone() {
        let new = || Component::<_, Fmi2> {
            instance: Instance::new(Nothing, InterfaceType::CoSimulation),
            state: State::Instantiated,
            log: Log::new(Sink::Fmi2(None), c"test", false),
            events: Events::default(),
            strings: Vec::new(),
        };
        let (mut broken, mut other) = (new(), new());
        let status = guarded(&mut broken, Function::GetVersion, |_| panic!("at {}", 1));
        assert_eq!(status, Status::FATAL);
        assert_eq!(broken.state, State::Fatal);
        let reset = |c: &mut Component<Instance<Nothing>, Fmi2>| {
            c.instance.reset();
            Ok(())
        };
        assert_eq!(guarded(&mut broken, Function::Reset, reset), Status::ERROR);
        assert_eq!(broken.state, State::Fatal);
        assert_eq!(guarded(&mut other, Function::Reset, reset), Status::OK);
    }
}
