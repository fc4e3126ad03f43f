//! Communication steps.

use super::{CallError, Instance};
use pilotage_abi::fmi2::{Boolean, FALSE, Function, State, Status, StatusKind, TRUE};
use std::time::Duration;

/// How a communication step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// At its end.
    Done,
    /// Before its end (`fmi2Discard`).
    Discarded {
        /// `fmi2LastSuccessfulTime` [s], if the FMU says.
        last_successful: Option<f64>,
        /// `fmi2Terminated`: the FMU wants the simulation to end.
        is_end_requested: bool,
    },
}

impl Instance {
    /// `fmi2DoStep`; nobody will go back before `t`. A pending step is waited for.
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        self.step(t, h, TRUE)
    }

    /// `fmi2DoStep`, after which a state [saved](Self::save) before may be restored.
    pub fn do_step_revocably(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        self.step(t, h, FALSE)
    }

    fn step(&mut self, t: f64, h: f64, no_set_state_prior: Boolean) -> Result<Step, CallError> {
        self.allow(Function::DoStep)?;
        // SAFETY: the instance is alive and in a state that allows the call.
        let mut status =
            unsafe { (self.loaded.binding.do_step)(self.component, t, h, no_set_state_prior) };
        if status == Status::PENDING {
            status = self.wait_for_step()?;
        }
        if status == Status::DISCARD {
            self.state = State::StepFailed;
            return Ok(self.discarded());
        }
        self.check(Function::DoStep, status).map(|()| Step::Done)
    }

    /// Asks until a pending step has ended.
    fn wait_for_step(&mut self) -> Result<Status, CallError> {
        let get_status = self.optional(Function::GetStatus, self.loaded.binding.get_status)?;
        loop {
            let mut status = Status::PENDING;
            let kind = StatusKind::DO_STEP_STATUS;
            // SAFETY: the instance is alive and its step is in progress.
            let asked = unsafe { get_status(self.component, kind, &raw mut status) };
            self.check(Function::GetStatus, asked)?;
            if status != Status::PENDING {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// What the FMU tells about a discarded step.
    fn discarded(&self) -> Step {
        let binding = &self.loaded.binding;
        let mut time = f64::NAN;
        let mut terminated = FALSE;
        // SAFETY: the instance is alive and its step has failed, which allows both calls.
        let (has_time, has_terminated) = unsafe {
            let kind = StatusKind::LAST_SUCCESSFUL_TIME;
            let real = binding.get_real_status;
            let has_time = real.map(|f| f(self.component, kind, &raw mut time));
            let kind = StatusKind::TERMINATED;
            let boolean = binding.get_boolean_status;
            (
                has_time,
                boolean.map(|f| f(self.component, kind, &raw mut terminated)),
            )
        };
        Step::Discarded {
            last_successful: (has_time == Some(Status::OK) && time.is_finite()).then_some(time),
            is_end_requested: has_terminated == Some(Status::OK) && terminated != FALSE,
        }
    }
}
