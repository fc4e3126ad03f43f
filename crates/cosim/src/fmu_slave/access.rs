//! Values of an FMU's variables, whatever type they have in its version of FMI.

use super::arrays::Arrays;
use crate::slave::{Kind, SlaveError, Value};
use pilotage_fmi::description::{
    BaseType, Causality, FmiVersion, IntegerType, ModelDescription, Precision,
};
use pilotage_fmi::instance::Number;
use pilotage_fmi::{CallError, Instance};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use thiserror::Error;

/// A value that a variable's type cannot hold.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{value} does not fit into a variable of type {kind}")]
struct OutOfRange {
    value: i128,
    kind: &'static str,
}

/// How variables are reached by their value references.
#[derive(Debug)]
pub(super) struct Access {
    /// FMI 3.0: the types, which value references alone do not tell from each other.
    types: HashMap<u32, BaseType>,
    /// FMI 3.0: parameters that are set in configuration mode.
    structural: HashSet<u32>,
    /// Whether some reals are of 32 bits.
    has_singles: bool,
    /// Arrays, if they are reached by their elements.
    arrays: Option<RefCell<Arrays>>,
    /// Whether all reals are scalars of 64 bits.
    is_simple: bool,
}

impl Access {
    /// With these arrays.
    pub(super) fn with(description: &ModelDescription, arrays: Arrays) -> Self {
        let scalars = Self::of(description);
        Self {
            is_simple: scalars.is_simple && arrays.is_empty(),
            arrays: (!arrays.is_empty()).then(|| RefCell::new(arrays)),
            ..scalars
        }
    }

    /// Of the scalars.
    pub(super) fn of(description: &ModelDescription) -> Self {
        let is_fmi3 = description.fmi_version == FmiVersion::V3;
        let variables = || description.variables.iter().filter(|_| is_fmi3);
        let types: HashMap<_, _> = variables()
            .map(|v| (v.value_reference, v.kind.base_type()))
            .collect();
        let has_singles = types
            .values()
            .any(|t| *t == BaseType::Real(Precision::Single));
        Self {
            structural: variables()
                .filter(|v| v.causality == Causality::StructuralParameter)
                .map(|v| v.value_reference)
                .collect(),
            has_singles,
            arrays: None,
            is_simple: !has_singles,
            types,
        }
    }

    /// Whether some reals are of 32 bits.
    pub(super) fn has_singles(&self) -> bool {
        self.has_singles
    }

    /// Whether all reals are scalars of 64 bits, so that calls reach them by their handles.
    pub(super) fn is_simple(&self) -> bool {
        self.is_simple
    }

    fn is_single(&self, handle: u32) -> bool {
        self.types.get(&handle) == Some(&BaseType::Real(Precision::Single))
    }

    /// Sets reals; those of 64 bits in one call.
    #[inline(always)]
    pub(super) fn set_reals(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), CallError> {
        match self.is_simple {
            true => instance.set_real(handles, values),
            false => self.set_each_real(instance, handles, values),
        }
    }

    fn set_each_real(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), CallError> {
        if let (Some(arrays), false) = (&self.arrays, self.has_singles) {
            return arrays.borrow_mut().set(instance, handles, values);
        }
        for (&handle, &value) in handles.iter().zip(values) {
            match self.is_single(handle) {
                true => instance.set(&[handle], &[value as f32])?,
                false => match &self.arrays {
                    Some(arrays) => arrays.borrow_mut().set(instance, &[handle], &[value])?,
                    None => instance.set_real(&[handle], &[value])?,
                },
            }
        }
        Ok(())
    }

    /// Gets reals; those of 64 bits in one call.
    #[inline]
    pub(super) fn get_reals(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        match self.is_simple {
            true => instance.get_real(handles, values),
            false => self.get_each_real(instance, handles, values),
        }
    }

    fn get_each_real(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        if let (Some(arrays), false) = (&self.arrays, self.has_singles) {
            return arrays.borrow_mut().get(instance, handles, values);
        }
        for (&handle, value) in handles.iter().zip(values) {
            if self.is_single(handle) {
                let mut single = [0f32];
                instance.get(&[handle], &mut single)?;
                *value = f64::from(single[0]);
            } else {
                let value = std::slice::from_mut(value);
                match &self.arrays {
                    Some(arrays) => arrays.borrow_mut().get(instance, &[handle], value)?,
                    None => instance.get_real(&[handle], value)?,
                }
            }
        }
        Ok(())
    }

    pub(super) fn set(
        &self,
        instance: &mut Instance,
        handle: u32,
        value: &Value,
    ) -> Result<(), SlaveError> {
        if self.structural.contains(&handle) {
            instance.enter_configuration_mode()?;
            self.set_value(instance, handle, value)?;
            return Ok(instance.exit_configuration_mode()?);
        }
        self.set_value(instance, handle, value)
    }

    fn set_value(
        &self,
        instance: &mut Instance,
        handle: u32,
        value: &Value,
    ) -> Result<(), SlaveError> {
        match value {
            Value::Real(value) => self.set_reals(instance, &[handle], &[*value])?,
            Value::Integer(value) => match self.integer(handle) {
                IntegerType::Int8 => set::<i8>(instance, handle, *value)?,
                IntegerType::UInt8 => set::<u8>(instance, handle, *value)?,
                IntegerType::Int16 => set::<i16>(instance, handle, *value)?,
                IntegerType::UInt16 => set::<u16>(instance, handle, *value)?,
                IntegerType::Int32 => set::<i32>(instance, handle, *value)?,
                IntegerType::UInt32 => set::<u32>(instance, handle, *value)?,
                IntegerType::Int64 => set::<i64>(instance, handle, *value)?,
                IntegerType::UInt64 => set::<u64>(instance, handle, *value)?,
            },
            Value::Boolean(value) => instance.set_boolean(handle, *value)?,
            Value::String(value) => instance.set_string(handle, value)?,
        }
        Ok(())
    }

    pub(super) fn get(
        &self,
        instance: &mut Instance,
        handle: u32,
        kind: Kind,
    ) -> Result<Value, SlaveError> {
        Ok(match kind {
            Kind::Real => {
                let mut value = [0.0];
                self.get_reals(instance, &[handle], &mut value)?;
                Value::Real(value[0])
            }
            Kind::Integer | Kind::Enumeration => Value::Integer(match self.integer(handle) {
                IntegerType::Int8 => get::<i8>(instance, handle)?,
                IntegerType::UInt8 => get::<u8>(instance, handle)?,
                IntegerType::Int16 => get::<i16>(instance, handle)?,
                IntegerType::UInt16 => get::<u16>(instance, handle)?,
                IntegerType::Int32 => get::<i32>(instance, handle)?,
                IntegerType::UInt32 => get::<u32>(instance, handle)?,
                IntegerType::Int64 => get::<i64>(instance, handle)?,
                IntegerType::UInt64 => get::<u64>(instance, handle)?,
            }),
            Kind::Boolean => Value::Boolean(instance.get_boolean(handle)?),
            Kind::String => Value::String(instance.get_string(handle)?),
        })
    }

    /// The integer type of a variable: in FMI 2.0 there is one, in FMI 3.0 enumerations are `Int64`.
    fn integer(&self, handle: u32) -> IntegerType {
        match self.types.get(&handle) {
            Some(BaseType::Integer(integer)) => *integer,
            Some(BaseType::Enumeration) => IntegerType::Int64,
            _ => IntegerType::Int32,
        }
    }
}

fn set<T: Number + TryFrom<i64>>(
    instance: &mut Instance,
    handle: u32,
    value: i64,
) -> Result<(), SlaveError> {
    let narrow = T::try_from(value).map_err(|_| OutOfRange {
        value: value.into(),
        kind: std::any::type_name::<T>(),
    })?;
    Ok(instance.set(&[handle], &[narrow])?)
}

fn get<T: Number + Into<i128>>(instance: &mut Instance, handle: u32) -> Result<i64, SlaveError> {
    let mut value = [T::default()];
    instance.get(&[handle], &mut value)?;
    let value: i128 = value[0].into();
    let kind = "i64";
    Ok(i64::try_from(value).map_err(|_| OutOfRange { value, kind })?)
}
