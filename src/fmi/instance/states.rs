//! Saving and restoring the complete state.

use super::{CallError, Instance};
use pilotage_abi::fmi2::{Function, State};
use std::ptr;

/// A copy of an instance's state, held by the FMU; valid for the instance that made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saved {
    slot: usize,
    owner: usize,
    state: State,
}

impl Instance {
    /// `fmi2GetFMUstate`: saves the complete state, to be restored any number of times.
    pub fn save(&mut self) -> Result<Saved, CallError> {
        let saved = Saved {
            slot: self.saved.len(),
            owner: self.mailbox.number(),
            state: self.state,
        };
        self.saved.push(ptr::null_mut());
        self.save_into(saved)
    }

    /// `fmi2GetFMUstate`: saves the complete state in the place of one saved before.
    ///
    /// # Panics
    /// If `saved` belongs to another instance or was freed, here and below.
    pub fn save_into(&mut self, saved: Saved) -> Result<Saved, CallError> {
        let call = self.state_function(Function::GetFmuState, self.loaded.binding.get_fmu_state)?;
        let state = self.state;
        let place = self.place(saved);
        // SAFETY: the instance is alive; the place holds NULL or a state that it made.
        let status = unsafe { call(self.component, &raw mut self.saved[place]) };
        self.check(Function::GetFmuState, status)?;
        Ok(Saved { state, ..saved })
    }

    /// `fmi2SetFMUstate`: goes back to a saved state.
    pub fn restore(&mut self, saved: Saved) -> Result<(), CallError> {
        let call = self.state_function(Function::SetFmuState, self.loaded.binding.set_fmu_state)?;
        let place = self.place(saved);
        assert!(!self.saved[place].is_null(), "a state that was freed");
        // SAFETY: the instance is alive and made this state.
        let status = unsafe { call(self.component, self.saved[place]) };
        self.check(Function::SetFmuState, status)?;
        self.state = saved.state;
        Ok(())
    }

    /// `fmi2FreeFMUstate`. States that are not freed go with the instance.
    pub fn free(&mut self, saved: Saved) -> Result<(), CallError> {
        let call =
            self.state_function(Function::FreeFmuState, self.loaded.binding.free_fmu_state)?;
        let place = self.place(saved);
        // SAFETY: the instance is alive and made this state; the FMU writes NULL back.
        let status = unsafe { call(self.component, &raw mut self.saved[place]) };
        self.saved[place] = ptr::null_mut();
        self.check(Function::FreeFmuState, status)
    }

    fn place(&self, saved: Saved) -> usize {
        let is_own = saved.owner == self.mailbox.number();
        assert!(is_own, "a state of another instance");
        saved.slot
    }

    fn state_function<T>(&self, function: Function, pointer: Option<T>) -> Result<T, CallError> {
        if !self.can_save {
            let flag = "canGetAndSetFMUstate";
            return Err(CallError::NotCapable { flag });
        }
        self.allow(function)?;
        self.optional(function, pointer)
    }
}
