//! Getting and setting values.

use super::{CallError, Instance, c_string};
use crate::fmi::binding::owned;
use pilotage_abi::fmi2::{Boolean, FALSE, Function, TRUE};
use std::ffi::c_char;
use std::ptr;

impl Instance {
    /// `fmi2SetReal`.
    ///
    /// # Panics
    /// If there are not as many values as references, here and in the calls below.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        self.allow(Function::SetReal)?;
        let call = self.optional(Function::SetReal, self.loaded.binding.set_real)?;
        let n = references.len();
        // SAFETY: the instance is alive, both arrays have `n` elements.
        let status = unsafe { call(self.component, references.as_ptr(), n, values.as_ptr()) };
        self.check(Function::SetReal, status)
    }

    /// `fmi2GetReal`.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        self.allow(Function::GetReal)?;
        let call = self.optional(Function::GetReal, self.loaded.binding.get_real)?;
        let n = references.len();
        // SAFETY: the instance is alive, both arrays have `n` elements.
        let status = unsafe { call(self.component, references.as_ptr(), n, values.as_mut_ptr()) };
        self.check(Function::GetReal, status)
    }

    /// `fmi2SetInteger`, of one variable.
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<(), CallError> {
        self.allow(Function::SetInteger)?;
        let call = self.optional(Function::SetInteger, self.loaded.binding.set_integer)?;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const value) };
        self.check(Function::SetInteger, status)
    }

    /// `fmi2GetInteger`, of one variable.
    pub fn get_integer(&mut self, reference: u32) -> Result<i32, CallError> {
        self.allow(Function::GetInteger)?;
        let call = self.optional(Function::GetInteger, self.loaded.binding.get_integer)?;
        let mut value = 0;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut value) };
        self.check(Function::GetInteger, status).map(|()| value)
    }

    /// `fmi2SetBoolean`, of one variable.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), CallError> {
        self.allow(Function::SetBoolean)?;
        let call = self.optional(Function::SetBoolean, self.loaded.binding.set_boolean)?;
        let value: Boolean = if value { TRUE } else { FALSE };
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const value) };
        self.check(Function::SetBoolean, status)
    }

    /// `fmi2GetBoolean`, of one variable.
    pub fn get_boolean(&mut self, reference: u32) -> Result<bool, CallError> {
        self.allow(Function::GetBoolean)?;
        let call = self.optional(Function::GetBoolean, self.loaded.binding.get_boolean)?;
        let mut value: Boolean = FALSE;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut value) };
        self.check(Function::GetBoolean, status)
            .map(|()| value != FALSE)
    }

    /// `fmi2SetString`, of one variable.
    pub fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        self.allow(Function::SetString)?;
        let call = self.optional(Function::SetString, self.loaded.binding.set_string)?;
        let value = c_string(value)?;
        let pointer = value.as_ptr();
        // SAFETY: the instance is alive, both pointers are to one element, and the string lives
        // until the call returns.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const pointer) };
        self.check(Function::SetString, status)
    }

    /// `fmi2GetString`, of one variable.
    pub fn get_string(&mut self, reference: u32) -> Result<String, CallError> {
        self.allow(Function::GetString)?;
        let call = self.optional(Function::GetString, self.loaded.binding.get_string)?;
        let mut pointer: *const c_char = ptr::null();
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut pointer) };
        self.check(Function::GetString, status)?;
        // SAFETY: after success it is NULL or a string that lives until the next call.
        Ok(unsafe { owned(pointer) }.unwrap_or_default())
    }
}
