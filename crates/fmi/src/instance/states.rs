//! Saving and restoring the complete state.

use super::{CallError, Instance, call};
use crate::description::FmiVersion;
use crate::version::{Function, State};
use pilotage_abi::{fmi2, fmi3};
use std::ptr;

/// Maximum size of a serialized state \[bytes\]: an FMU may return any number.
const LARGEST: usize = 1 << 31;

/// A copy of an instance's state, held by the FMU; valid only for the instance that created it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saved {
    slot: usize,
    owner: usize,
    state: State,
}

/// A copy of an instance's state as bytes: valid for every instance of the same FMU and kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Serialized {
    /// In the FMU's own format.
    pub bytes: Vec<u8>,
    /// The state of the state machine in which it was saved.
    pub state: State,
}

impl Instance {
    /// `fmi2GetFMUstate`, `fmi3GetFMUState`: saves the complete state, which can be restored any number of times.
    pub fn save(&mut self) -> Result<Saved, CallError> {
        let saved = self.empty_slot(self.state);
        self.save_into(saved)
    }

    /// `fmi2GetFMUstate`, `fmi3GetFMUState`: saves the complete state, overwriting a saved one.
    ///
    /// # Panics
    /// If `saved` belongs to another instance, here and below.
    pub fn save_into(&mut self, saved: Saved) -> Result<Saved, CallError> {
        self.can_save()?;
        let state = self.state;
        let place = self.place(saved);
        let slot: *mut _ = &raw mut self.saved[place];
        // SAFETY: the instance is alive; the slot holds NULL or a state that it created.
        unsafe {
            call!(self, fmi2 GetFmuState.get_fmu_state(slot), fmi3 GetFmuState.get_fmu_state(slot))?;
        }
        self.is_there(
            place,
            (fmi2::Function::GetFmuState, fmi3::Function::GetFmuState),
        )?;
        Ok(Saved { state, ..saved })
    }

    /// `fmi2SetFMUstate`, `fmi3SetFMUState`: restores a saved state.
    ///
    /// # Panics
    /// If the state was freed, here and below.
    pub fn restore(&mut self, saved: Saved) -> Result<(), CallError> {
        self.can_save()?;
        let kept = self.kept(saved);
        // SAFETY: the instance is alive and created this state.
        unsafe {
            call!(self, fmi2 SetFmuState.set_fmu_state(kept), fmi3 SetFmuState.set_fmu_state(kept))?;
        }
        self.state = saved.state;
        Ok(())
    }

    /// `fmi2FreeFMUstate`, `fmi3FreeFMUState`. States that are not freed are freed with the instance.
    pub fn free(&mut self, saved: Saved) -> Result<(), CallError> {
        self.can_save()?;
        let place = self.place(saved);
        let slot: *mut _ = &raw mut self.saved[place];
        // SAFETY: the instance is alive and created this state; the FMU writes NULL back.
        let freed = unsafe {
            call!(self, fmi2 FreeFmuState.free_fmu_state(slot), fmi3 FreeFmuState.free_fmu_state(slot))
        };
        self.saved[place] = ptr::null_mut();
        freed
    }

    /// `fmi2SerializedFMUstateSize` and `fmi2SerializeFMUstate`, or the equivalents of FMI 3.0.
    pub fn serialize(&mut self, saved: Saved) -> Result<Serialized, CallError> {
        self.can_serialize()?;
        let kept = self.kept(saved);
        let mut size = 0usize;
        let s = &raw mut size;
        // SAFETY: the instance is alive and created this state; `size` is valid for writes.
        unsafe {
            call!(self, fmi2 SerializedFmuStateSize.serialized_fmu_state_size(kept, s),
                        fmi3 SerializedFmuStateSize.serialized_fmu_state_size(kept, s))?;
        }
        let functions = (
            fmi2::Function::SerializedFmuStateSize,
            fmi3::Function::SerializedFmuStateSize,
        );
        if size > LARGEST {
            return Err(self.absurd(functions, format!("a state of {size} bytes")));
        }
        let mut bytes = vec![0u8; size];
        let b = bytes.as_mut_ptr();
        // SAFETY: as above, and there are `size` bytes.
        unsafe {
            call!(self, fmi2 SerializeFmuState.serialize_fmu_state(kept, b.cast(), size),
                        fmi3 SerializeFmuState.serialize_fmu_state(kept, b, size))?;
        }
        Ok(Serialized {
            bytes,
            state: saved.state,
        })
    }

    /// `fmi2DeSerializeFMUstate`, `fmi3DeserializeFMUState`: creates a saved state from bytes that this or another
    /// instance of the same FMU has serialized.
    pub fn deserialize(&mut self, serialized: &Serialized) -> Result<Saved, CallError> {
        self.can_serialize()?;
        let saved = self.empty_slot(serialized.state);
        let (b, n) = (serialized.bytes.as_ptr(), serialized.bytes.len());
        let slot: *mut _ = &raw mut self.saved[saved.slot];
        // SAFETY: the instance is alive; there are `n` bytes, and the slot is valid for writes.
        unsafe {
            call!(self, fmi2 DeSerializeFmuState.deserialize_fmu_state(b.cast(), n, slot),
                        fmi3 DeserializeFmuState.deserialize_fmu_state(b, n, slot))?;
        }
        let functions = (
            fmi2::Function::DeSerializeFmuState,
            fmi3::Function::DeserializeFmuState,
        );
        self.is_there(saved.slot, functions)?;
        Ok(saved)
    }

    /// Frees the remaining states before the instance is freed.
    pub(super) fn free_saved(&mut self) {
        for slot in 0..self.saved.len() {
            let (owner, state) = (self.environment.number(), self.state);
            if !self.saved[slot].is_null() {
                let _ = self.free(Saved { slot, owner, state });
            }
        }
    }

    /// An error if an FMU returned OK without storing a state.
    fn is_there(
        &self,
        place: usize,
        functions: (fmi2::Function, fmi3::Function),
    ) -> Result<(), CallError> {
        match self.saved[place].is_null() {
            true => Err(self.absurd(functions, "no state".to_owned())),
            false => Ok(()),
        }
    }

    /// The error that this function of the FMU's version returned an impossible result.
    pub(super) fn absurd(
        &self,
        (of2, of3): (fmi2::Function, fmi3::Function),
        what: String,
    ) -> CallError {
        let function = match self.version() {
            FmiVersion::V2 => Function::Fmi2(of2),
            FmiVersion::V3 => Function::Fmi3(of3),
        };
        CallError::Absurd { function, what }
    }

    fn empty_slot(&mut self, state: State) -> Saved {
        self.saved.push(ptr::null_mut());
        Saved {
            slot: self.saved.len() - 1,
            owner: self.environment.number(),
            state,
        }
    }

    fn place(&self, saved: Saved) -> usize {
        let is_own = saved.owner == self.environment.number();
        assert!(is_own, "a state of another instance");
        saved.slot
    }

    fn kept(&self, saved: Saved) -> *mut std::ffi::c_void {
        let kept = self.saved[self.place(saved)];
        assert!(!kept.is_null(), "a state that was freed");
        kept
    }

    fn can_save(&self) -> Result<(), CallError> {
        let flag = match self.version() {
            FmiVersion::V2 => "canGetAndSetFMUstate",
            FmiVersion::V3 => "canGetAndSetFMUState",
        };
        capable(self.facts.can_save, flag)
    }

    fn can_serialize(&self) -> Result<(), CallError> {
        let flag = match self.version() {
            FmiVersion::V2 => "canSerializeFMUstate",
            FmiVersion::V3 => "canSerializeFMUState",
        };
        capable(self.facts.can_serialize, flag)
    }
}

/// An error if the description declares that the FMU does not support something.
pub(super) fn capable(is_capable: bool, flag: &'static str) -> Result<(), CallError> {
    match is_capable {
        true => Ok(()),
        false => Err(CallError::NotCapable { flag }),
    }
}
