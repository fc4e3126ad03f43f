//! The C functions. Each checks its pointers, runs the instance's safe method, and turns a panic into
//! `fmi2Fatal`, so that nothing here aborts the host.

// The standard's names.
#![allow(non_snake_case)]

mod co_simulation;
mod common;
mod lifecycle;

use crate::instance::Instance;
use crate::problem::Problem;
use pilotage_abi::fmi2::{Component, Function, Status};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs the body of a function on the instance that `component` points to.
///
/// # Safety
/// `component` is NULL, or came from `fmi2Instantiate` and was not freed, and no other thread uses it.
unsafe fn call(
    component: Component,
    function: Function,
    body: impl FnOnce(&mut Instance) -> Result<(), Problem>,
) -> Status {
    // SAFETY: by the caller's promise it is NULL, or an instance that nobody else uses.
    let Some(instance) = (unsafe { component.cast::<Instance>().as_mut() }) else {
        return Status::ERROR;
    };
    guarded(instance, function, body)
}

/// An instance whose body panicked is in the state `fatal` and is never used again but to be freed;
/// therefore it does not matter in which state the panic left it.
fn guarded(
    instance: &mut Instance,
    function: Function,
    body: impl FnOnce(&mut Instance) -> Result<(), Problem>,
) -> Status {
    let run = catch_unwind(AssertUnwindSafe(|| instance.call(function, body)));
    run.unwrap_or_else(|panic| {
        let problem = Problem::Panic {
            message: message(panic.as_ref()),
        };
        let report = catch_unwind(AssertUnwindSafe(|| instance.fail(function, &problem)));
        report.unwrap_or(Status::FATAL)
    })
}

/// What a panic says.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let string = || panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(string).unwrap_or("panic").to_owned()
}

/// The array of `count` elements that C passes as a pointer; NULL is allowed where `count` is 0.
///
/// # Safety
/// `pointer` is NULL, or points to `count` elements that nobody writes while `'a` lasts.
unsafe fn array<'a, T>(
    pointer: *const T,
    count: usize,
    argument: &'static str,
) -> Result<&'a [T], Problem> {
    check_array(pointer.is_null(), size_of::<T>(), count, argument)?;
    match count {
        0 => Ok(&[]),
        // SAFETY: not NULL, and by the caller's promise valid for `count` elements.
        _ => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// As [`array`], to be written.
///
/// # Safety
/// `pointer` is NULL, or points to `count` elements that nobody else uses while `'a` lasts.
unsafe fn array_mut<'a, T>(
    pointer: *mut T,
    count: usize,
    argument: &'static str,
) -> Result<&'a mut [T], Problem> {
    check_array(pointer.is_null(), size_of::<T>(), count, argument)?;
    match count {
        0 => Ok(&mut []),
        // SAFETY: not NULL, and by the caller's promise valid for `count` elements.
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

/// The place that C passes as a pointer.
///
/// # Safety
/// `pointer` is NULL, or points to a value that nobody else uses while `'a` lasts.
unsafe fn place<'a, T>(pointer: *mut T, argument: &'static str) -> Result<&'a mut T, Problem> {
    // SAFETY: by the caller's promise it is NULL or valid.
    unsafe { pointer.as_mut() }.ok_or(Problem::Null { argument })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;
    use pilotage_abi::fmi2::State;
    use pilotage_models::{Model, Quadcopter};

    #[test]
    fn a_panic_becomes_fatal_and_ruins_this_instance_alone() {
        let model = Model::quadcopter(&Quadcopter::default());
        let new = || Instance::new(model.clone(), Log::new(None, c"test", false));
        let (mut broken, mut other) = (new(), new());
        let status = guarded(&mut broken, Function::GetVersion, |_| panic!("at {}", 1));
        assert_eq!(status, Status::FATAL);
        assert_eq!(broken.checkpoint().state, State::Fatal);
        let reset = |i: &mut Instance| {
            i.reset();
            Ok(())
        };
        assert_eq!(guarded(&mut broken, Function::Reset, reset), Status::ERROR);
        assert_eq!(guarded(&mut other, Function::Reset, reset), Status::OK);
    }
}
