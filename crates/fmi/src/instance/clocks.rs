//! Clocks, model partitions and dependencies of FMI 3.0 (sections 2.2.9 to 2.2.11 and 5.2).

use super::{CallError, Instance, MOST, call};
use crate::version::Function;
use pilotage_abi::fmi3::{self, DependencyKind, IntervalQualifier};

/// Interval of a clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval<T> {
    /// Until the next tick, in \[s\] or as a [`Fraction`].
    pub value: T,
    /// Whether it is known, and new.
    pub qualifier: IntervalQualifier,
}

/// `counter / resolution` \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fraction {
    /// Ticks of the resolution.
    pub counter: u64,
    /// Ticks in a second.
    pub resolution: u64,
}

/// How an element of a variable depends on an element of another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dependency {
    /// Index of the dependent variable's element, from 1; 0 for all elements.
    pub element: usize,
    /// Value reference of the variable that it depends on.
    pub on: u32,
    /// Index of that variable's element, from 1; 0 for all elements.
    pub on_element: usize,
    /// Kind of the dependency.
    pub kind: DependencyKind,
}

impl Instance {
    /// Whether the FMU has reported new clock intervals since the last call (scheduled execution,
    /// `fmi3ClockUpdateCallback`).
    pub fn take_clocks_changed(&self) -> bool {
        self.environment.take_clocks_changed()
    }

    /// `fmi3GetIntervalDecimal` \[s\].
    pub fn get_intervals(&mut self, clocks: &[u32]) -> Result<Vec<Interval<f64>>, CallError> {
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let mut values = vec![f64::NAN; n];
        let mut qualifiers = vec![IntervalQualifier::NOT_YET_KNOWN; n];
        let (v, q) = (values.as_mut_ptr(), qualifiers.as_mut_ptr());
        // SAFETY: the instance is alive and in a state that allows the call; all arrays have the stated lengths, here
        // and below.
        unsafe { call!(self, fmi3 GetIntervalDecimal.get_interval_decimal(r, n, v, q))? };
        let pairs = values.into_iter().zip(qualifiers);
        let interval = |(value, qualifier)| Interval { value, qualifier };
        Ok(pairs.map(interval).collect())
    }

    /// `fmi3GetIntervalFraction`.
    pub fn get_interval_fractions(
        &mut self,
        clocks: &[u32],
    ) -> Result<Vec<Interval<Fraction>>, CallError> {
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let (mut counters, mut resolutions) = (vec![0; n], vec![1; n]);
        let mut qualifiers = vec![IntervalQualifier::NOT_YET_KNOWN; n];
        let (c, s) = (counters.as_mut_ptr(), resolutions.as_mut_ptr());
        let q = qualifiers.as_mut_ptr();
        // SAFETY: as above.
        unsafe { call!(self, fmi3 GetIntervalFraction.get_interval_fraction(r, n, c, s, q))? };
        let pairs = fractions(&counters, &resolutions).zip(qualifiers);
        let interval = |(value, qualifier)| Interval { value, qualifier };
        Ok(pairs.map(interval).collect())
    }

    /// `fmi3SetIntervalDecimal` \[s\].
    ///
    /// # Panics
    /// If the numbers of values and clocks differ, here and below.
    pub fn set_intervals(&mut self, clocks: &[u32], values: &[f64]) -> Result<(), CallError> {
        assert_eq!(clocks.len(), values.len());
        let (r, n, v) = (clocks.as_ptr(), clocks.len(), values.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetIntervalDecimal.set_interval_decimal(r, n, v)) }
    }

    /// `fmi3SetIntervalFraction`.
    pub fn set_interval_fractions(
        &mut self,
        clocks: &[u32],
        values: &[Fraction],
    ) -> Result<(), CallError> {
        assert_eq!(clocks.len(), values.len());
        let (counters, resolutions) = parts(values);
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let (c, s) = (counters.as_ptr(), resolutions.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetIntervalFraction.set_interval_fraction(r, n, c, s)) }
    }

    /// `fmi3GetShiftDecimal`: time of the first tick of each clock \[s\].
    pub fn get_shifts(&mut self, clocks: &[u32]) -> Result<Vec<f64>, CallError> {
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let mut values = vec![f64::NAN; n];
        let v = values.as_mut_ptr();
        // SAFETY: as above.
        unsafe { call!(self, fmi3 GetShiftDecimal.get_shift_decimal(r, n, v)) }.map(|()| values)
    }

    /// `fmi3GetShiftFraction`.
    pub fn get_shift_fractions(&mut self, clocks: &[u32]) -> Result<Vec<Fraction>, CallError> {
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let (mut counters, mut resolutions) = (vec![0; n], vec![1; n]);
        let (c, s) = (counters.as_mut_ptr(), resolutions.as_mut_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 GetShiftFraction.get_shift_fraction(r, n, c, s))? };
        Ok(fractions(&counters, &resolutions).collect())
    }

    /// `fmi3SetShiftDecimal` \[s\].
    pub fn set_shifts(&mut self, clocks: &[u32], values: &[f64]) -> Result<(), CallError> {
        assert_eq!(clocks.len(), values.len());
        let (r, n, v) = (clocks.as_ptr(), clocks.len(), values.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetShiftDecimal.set_shift_decimal(r, n, v)) }
    }

    /// `fmi3SetShiftFraction`.
    pub fn set_shift_fractions(
        &mut self,
        clocks: &[u32],
        values: &[Fraction],
    ) -> Result<(), CallError> {
        assert_eq!(clocks.len(), values.len());
        let (counters, resolutions) = parts(values);
        let (r, n) = (clocks.as_ptr(), clocks.len());
        let (c, s) = (counters.as_ptr(), resolutions.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetShiftFraction.set_shift_fraction(r, n, c, s)) }
    }

    /// `fmi3ActivateModelPartition`: runs the partition of a clock that ticks at `time` \[s\] (scheduled execution).
    pub fn activate_model_partition(&mut self, clock: u32, time: f64) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi3 ActivateModelPartition.activate_model_partition(clock, time)) }
    }

    /// `fmi3GetNumberOfVariableDependencies` and `fmi3GetVariableDependencies`: dependencies of a variable after
    /// structural parameters have changed.
    pub fn variable_dependencies(&mut self, dependent: u32) -> Result<Vec<Dependency>, CallError> {
        let mut n = 0usize;
        // SAFETY: as above.
        unsafe {
            call!(self, fmi3 GetNumberOfVariableDependencies
                .get_number_of_variable_dependencies(dependent, &raw mut n))?;
        }
        if n > MOST {
            let function = Function::Fmi3(fmi3::Function::GetNumberOfVariableDependencies);
            let what = n.to_string();
            return Err(CallError::Absurd { function, what });
        }
        let (mut elements, mut on_elements) = (vec![0usize; n], vec![0usize; n]);
        let mut on = vec![0u32; n];
        let mut kinds = vec![DependencyKind::DEPENDENT; n];
        let (e, i) = (elements.as_mut_ptr(), on.as_mut_ptr());
        let (o, k) = (on_elements.as_mut_ptr(), kinds.as_mut_ptr());
        // SAFETY: as above.
        unsafe {
            call!(self, fmi3 GetVariableDependencies
                .get_variable_dependencies(dependent, e, i, o, k, n))?;
        }
        let dependency = |i: usize| Dependency {
            element: elements[i],
            on: on[i],
            on_element: on_elements[i],
            kind: kinds[i],
        };
        Ok((0..n).map(dependency).collect())
    }
}

fn fractions(counters: &[u64], resolutions: &[u64]) -> impl Iterator<Item = Fraction> {
    let pairs = counters.iter().zip(resolutions);
    pairs.map(|(&counter, &resolution)| Fraction {
        counter,
        resolution,
    })
}

fn parts(fractions: &[Fraction]) -> (Vec<u64>, Vec<u64>) {
    fractions.iter().map(|f| (f.counter, f.resolution)).unzip()
}
