//! Derivatives: directional, adjoint, and of inputs and outputs with respect to time.

use super::states::capable;
use super::{CallError, Instance, call};
use crate::description::FmiVersion;
use pilotage_abi::{fmi2, fmi3};

impl Instance {
    /// Whether the description declares directional derivatives.
    pub fn provides_directional_derivatives(&self) -> bool {
        self.facts.directional
    }

    /// `fmi2GetDirectionalDerivative`, `fmi3GetDirectionalDerivative`: change of `unknowns` for a change `seed` of
    /// `knowns`.
    ///
    /// # Panics
    /// If the lengths of `seed` and `knowns`, or of `result` and `unknowns`, differ, with all elements of arrays.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        let flag = match self.version() {
            FmiVersion::V2 => "providesDirectionalDerivative",
            FmiVersion::V3 => "providesDirectionalDerivatives",
        };
        capable(self.facts.directional, flag)?;
        self.check_lengths(knowns, seed.len());
        self.check_lengths(unknowns, result.len());
        let (u, n) = (unknowns.as_ptr(), unknowns.len());
        let (k, m) = (knowns.as_ptr(), knowns.len());
        let (s, l, results) = (seed.as_ptr(), seed.len(), result.len());
        let functions = (
            Some(fmi2::Function::GetDirectionalDerivative),
            fmi3::Function::GetDirectionalDerivative,
        );
        // SAFETY: the instance is alive and in a state that allows the call; all arrays have the stated lengths, here
        // and below.
        self.guarded(result, functions, |own, r| unsafe {
            call!(own, fmi2 GetDirectionalDerivative.get_directional_derivative(u, n, k, m, s, r),
                fmi3 GetDirectionalDerivative.get_directional_derivative(
                    u, n, k, m, s, l, r, results))
        })
    }

    /// `fmi3GetAdjointDerivative`: derivatives of the sum of `unknowns`, weighted by `seed`, with respect to each of
    /// `knowns`.
    ///
    /// # Panics
    /// If the lengths of `seed` and `unknowns`, or of `result` and `knowns`, differ, with all elements of arrays.
    pub fn adjoint_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        if self.version() == FmiVersion::V3 {
            capable(self.facts.adjoint, "providesAdjointDerivatives")?;
        }
        self.check_lengths(unknowns, seed.len());
        self.check_lengths(knowns, result.len());
        let (u, n) = (unknowns.as_ptr(), unknowns.len());
        let (k, m) = (knowns.as_ptr(), knowns.len());
        let (s, l, results) = (seed.as_ptr(), seed.len(), result.len());
        let functions = (None, fmi3::Function::GetAdjointDerivative);
        // SAFETY: as above.
        self.guarded(result, functions, |own, r| unsafe {
            call!(own, fmi3 GetAdjointDerivative.get_adjoint_derivative(
                u, n, k, m, s, l, r, results))
        })
    }

    /// `fmi2SetRealInputDerivatives`: time derivatives of inputs, of these orders (from 1). FMI 3.0 has intermediate
    /// updates instead.
    ///
    /// # Panics
    /// If the numbers of orders or values and references differ, here and below.
    pub fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        assert_eq!(references.len(), orders.len());
        assert_eq!(references.len(), values.len());
        let (r, n) = (references.as_ptr(), references.len());
        let (o, v) = (orders.as_ptr(), values.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi2 SetRealInputDerivatives.set_real_input_derivatives(r, n, o, v)) }
    }

    /// `fmi2GetRealOutputDerivatives`, `fmi3GetOutputDerivatives`: time derivatives of outputs, of these orders (from
    /// 1).
    pub fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        assert_eq!(references.len(), orders.len());
        self.check_lengths(references, values.len());
        let (r, n) = (references.as_ptr(), references.len());
        let (o, m) = (orders.as_ptr(), values.len());
        let functions = (
            Some(fmi2::Function::GetRealOutputDerivatives),
            fmi3::Function::GetOutputDerivatives,
        );
        // SAFETY: as above.
        self.guarded(values, functions, |own, v| unsafe {
            call!(own, fmi2 GetRealOutputDerivatives.get_real_output_derivatives(r, n, o, v),
                fmi3 GetOutputDerivatives.get_output_derivatives(r, n, o, v, m))
        })
    }
}
