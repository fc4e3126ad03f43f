//! Communication steps.

use super::{CallError, Instance, call};
use crate::binding::{Functions, owned_result};
use crate::misuse::{Misuse, note};
use crate::version::State;
use pilotage_abi::fmi2::{FALSE, Status, StatusKind, TRUE};
use pilotage_abi::{fmi2, fmi3};
use std::ffi::c_char;
use std::ptr;
use std::time::Duration;

/// Result of a communication step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// It reached its end.
    Done,
    /// It ended early (`fmi2Discard`, `fmi3Discard`).
    Discarded {
        /// The last successful time \[s\], if the FMU reports it.
        last_successful: Option<f64>,
        /// The FMU requests the end of the simulation.
        is_end_requested: bool,
    },
    /// It ended with a notification (FMI 3.0, section 4.2.1).
    Stopped {
        /// Time reached \[s\]: before the end of the step after an early return.
        reached: f64,
        /// There is an event to handle: call [`Instance::enter_event_mode`].
        is_event: bool,
        /// The FMU requests the end of the simulation.
        is_end_requested: bool,
    },
}

/// Whether a time lies between two others, up to rounding.
fn is_within(time: f64, [from, to]: [f64; 2]) -> bool {
    let rounding = 1e-9 * (to - from) + 4.0 * f64::EPSILON * from.abs().max(to.abs());
    from - rounding <= time && time <= to + rounding
}

impl Instance {
    /// `fmi2DoStep`, `fmi3DoStep`; the simulation will not return to a time before `t`. Waits for a pending step.
    #[inline(always)]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        match self.step(t, h, true)? {
            Some(step) => Ok(step),
            None => self.wait_for_step(),
        }
    }

    /// `fmi2DoStep`, `fmi3DoStep`, after which a state [saved](Self::save) earlier may be restored.
    pub fn do_step_revocably(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        let step = self.step(t, h, false)?;
        step.map_or_else(|| self.wait_for_step(), Ok)
    }

    /// `fmi2DoStep` without waiting: `None` if the step is pending, to be polled by [`Self::poll_step`]. `is_final`:
    /// the simulation will not return to a time before `t`.
    pub fn begin_step(
        &mut self,
        t: f64,
        h: f64,
        is_final: bool,
    ) -> Result<Option<Step>, CallError> {
        self.step(t, h, is_final)
    }

    /// Whether a pending step has ended, with its result (`fmi2GetStatus`).
    pub fn poll_step(&mut self) -> Result<Option<Step>, CallError> {
        let status = self.status(StatusKind::DO_STEP_STATUS)?;
        if status == Status::PENDING {
            return Ok(None);
        }
        self.state = State::Fmi2(fmi2::State::StepComplete);
        self.ended(status).map(Some)
    }

    /// `fmi2CancelStep`: cancels a pending step. Only reset, free and similar calls are allowed afterwards.
    pub fn cancel_step(&mut self) -> Result<(), CallError> {
        // SAFETY: the instance is alive and in a state that allows the call.
        unsafe { call!(self, fmi2 CancelStep.cancel_step())? };
        self.state = State::Fmi2(fmi2::State::StepCanceled);
        Ok(())
    }

    #[inline(always)]
    fn step(&mut self, t: f64, h: f64, is_final: bool) -> Result<Option<Step>, CallError> {
        self.place.at(t);
        let stepped = match &self.loaded.binding.functions {
            Functions::Fmi2(f) => {
                let function = fmi2::Function::DoStep.into();
                let call = self.ready(function, f.do_step)?;
                let no_set_state_prior = if is_final { TRUE } else { FALSE };
                // SAFETY: the instance is alive and in a state that allows the call.
                let step = || unsafe { call(self.component, t, h, no_set_state_prior) };
                match self.during(function, step) {
                    Status::OK => Ok(Some(Step::Done)),
                    status => self.not_done(status),
                }
            }
            Functions::Fmi3(_) => self.step3(t, h, is_final).map(Some),
        };
        if matches!(stepped, Ok(Some(Step::Done))) {
            self.place.at(t + h);
        }
        stepped
    }

    /// Separated from the path of successful steps.
    #[cold]
    #[inline(never)]
    fn not_done(&mut self, status: Status) -> Result<Option<Step>, CallError> {
        if status == Status::PENDING {
            if !self.facts.can_pend {
                note(Misuse::Pending);
            }
            self.state = State::Fmi2(fmi2::State::StepInProgress);
            return Ok(None);
        }
        self.ended(status).map(Some)
    }

    /// Result of a step of FMI 2.0 that ended with this status.
    fn ended(&mut self, status: Status) -> Result<Step, CallError> {
        if status == Status::DISCARD {
            self.state = State::Fmi2(fmi2::State::StepFailed);
            self.take_words();
            return Ok(self.discarded());
        }
        self.check(fmi2::Function::DoStep.into(), status)
            .map(|()| Step::Done)
    }

    /// The time that an FMU of FMI 3.0 says to have reached with its last step \[s\]; NaN if it says none. It may be another one
    /// than the end of a step that was done: that of the last of its own steps, if these have a fixed length.
    pub fn last_successful_time(&self) -> f64 {
        self.last_successful
    }

    #[inline(never)]
    fn step3(&mut self, t: f64, h: f64, is_final: bool) -> Result<Step, CallError> {
        // Bytes, since a Rust `bool` must be 0 or 1 and an FMU may write other values.
        let (mut event, mut end, mut early) = (0u8, 0u8, 0u8);
        let mut last = f64::NAN;
        // SAFETY: the instance is alive and in a state that allows the call; all pointers are valid for writes.
        let done = unsafe {
            call!(self, fmi3 DoStep.do_step(t, h, is_final, (&raw mut event).cast(),
                (&raw mut end).cast(), (&raw mut early).cast(), &raw mut last))
        };
        self.environment.resume_panic();
        let is_discard = |e: &CallError| matches!(e, CallError::Failed { status, .. } if *status == Status::DISCARD);
        self.last_successful = last;
        match done {
            Err(error) if is_discard(&error) => Ok(Step::Discarded {
                last_successful: Some(last).filter(|last| last.is_finite()),
                is_end_requested: end != 0,
            }),
            Err(error) => Err(error),
            Ok(()) if early != 0 && !is_within(last, [t, t + h]) => Err(CallError::Absurd {
                function: fmi3::Function::DoStep.into(),
                what: format!(
                    "{last:?} s as the last successful time of a step from {t:?} s to {:?} s",
                    t + h
                ),
            }),
            Ok(()) if (event, end, early) == (0, 0, 0) => Ok(Step::Done),
            Ok(()) => Ok(Step::Stopped {
                reached: match early != 0 || end != 0 && is_within(last, [t, t + h]) {
                    true => last,
                    false => t + h,
                },
                is_event: event != 0,
                is_end_requested: end != 0,
            }),
        }
    }

    /// Polls until a pending step has ended.
    #[cold]
    fn wait_for_step(&mut self) -> Result<Step, CallError> {
        loop {
            match self.poll_step()? {
                Some(step) => return Ok(step),
                None => std::thread::sleep(Duration::from_micros(100)),
            }
        }
    }

    /// Ends a pending step, so that the instance can be freed.
    pub(super) fn end_pending_step(&mut self) {
        if self.state == State::Fmi2(fmi2::State::StepInProgress) && self.cancel_step().is_err() {
            let _ = self.wait_for_step();
        }
    }

    /// The FMU's information about a discarded step.
    fn discarded(&mut self) -> Step {
        let last = self.real_status(StatusKind::LAST_SUCCESSFUL_TIME).ok();
        let is_end_requested = self.boolean_status(StatusKind::TERMINATED).unwrap_or(false);
        Step::Discarded {
            last_successful: last.filter(|time| time.is_finite()),
            is_end_requested,
        }
    }

    /// `fmi2GetStatus`.
    pub fn status(&mut self, kind: StatusKind) -> Result<Status, CallError> {
        let mut status = Status::PENDING;
        // SAFETY: the instance is alive and in a state that allows the call; the result is valid for writes, here and
        // below.
        unsafe { call!(self, fmi2 GetStatus.get_status(kind, &raw mut status)) }.map(|()| status)
    }

    /// `fmi2GetRealStatus`.
    pub fn real_status(&mut self, kind: StatusKind) -> Result<f64, CallError> {
        let mut value = f64::NAN;
        // SAFETY: as above.
        unsafe { call!(self, fmi2 GetRealStatus.get_real_status(kind, &raw mut value)) }
            .map(|()| value)
    }

    /// `fmi2GetIntegerStatus`; the standard defines no kind for it yet.
    pub fn integer_status(&mut self, kind: StatusKind) -> Result<i32, CallError> {
        let mut value = 0;
        // SAFETY: as above.
        unsafe { call!(self, fmi2 GetIntegerStatus.get_integer_status(kind, &raw mut value)) }
            .map(|()| value)
    }

    /// `fmi2GetBooleanStatus`.
    pub fn boolean_status(&mut self, kind: StatusKind) -> Result<bool, CallError> {
        let mut value = FALSE;
        // SAFETY: as above.
        unsafe { call!(self, fmi2 GetBooleanStatus.get_boolean_status(kind, &raw mut value)) }
            .map(|()| value != FALSE)
    }

    /// `fmi2GetStringStatus`: with [`StatusKind::PENDING_STATUS`], a text about a pending step.
    pub fn string_status(&mut self, kind: StatusKind) -> Result<String, CallError> {
        let mut text: *const c_char = ptr::null();
        // SAFETY: as above; after success it is NULL or a string that is valid until the next call.
        unsafe {
            call!(self, fmi2 GetStringStatus.get_string_status(kind, &raw mut text))?;
            Ok(owned_result(text, "fmi2GetStringStatus").unwrap_or_default())
        }
    }
}
