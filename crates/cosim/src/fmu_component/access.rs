//! Access to the values of an FMU's variables, independent of their types in its FMI version.

use super::arrays::Arrays;
use super::ranges::{items, types_of};
use crate::component::{ComponentError, Value, ValueKind};
use pilotage_fmi::description::{
    BaseType, Causality, FmiVersion, IntegerType, ModelDescription, Precision, ScalarVariable,
    VariableKind,
};
use pilotage_fmi::instance::Number;
use pilotage_fmi::{CallError, Instance};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use thiserror::Error;

/// A value that cannot be represented in a variable's type.
#[derive(Debug, Clone, PartialEq, Error)]
enum Lost {
    #[error("{value} does not fit into a variable of type {kind}")]
    OutOfRange { value: i128, kind: &'static str },
    #[error("`{name}` is of type Float32, and {value:?} is too large for it")]
    NotSingle { value: f64, name: String },
    #[error("{value} is none of the values of the enumeration, which are {items:?}")]
    NoItem { value: i64, items: Vec<i64> },
}

/// Access to variables by value reference.
#[derive(Debug)]
pub(super) struct Access {
    /// FMI 3.0: the types, which value references alone do not determine.
    types: HashMap<u32, BaseType>,
    /// FMI 3.0: parameters that are set in configuration mode.
    structural: HashSet<u32>,
    /// Names of 32-bit reals.
    singles: HashMap<u32, String>,
    /// Values of enumerations by handle.
    items: HashMap<u32, Vec<i64>>,
    /// Arrays accessed by element, if any.
    arrays: Option<RefCell<Arrays>>,
    /// Whether all reals are 64-bit scalars; the same for those that are inputs, and for those that are outputs.
    is_simple: bool,
    has_simple_inputs: bool,
    has_simple_outputs: bool,
}

impl Access {
    /// Access including these arrays.
    pub(super) fn new(description: &ModelDescription, arrays: Arrays) -> Self {
        let is_fmi3 = description.fmi_version == FmiVersion::V3;
        let variables = || description.variables.iter().filter(|_| is_fmi3);
        let types: HashMap<_, _> = variables()
            .map(|v| (v.value_reference, v.kind.base_type()))
            .collect();
        let single = Some(&BaseType::Real(Precision::Single));
        let singles: HashMap<_, _> = variables()
            .filter(|v| types.get(&v.value_reference) == single)
            .map(|v| (v.value_reference, v.name.clone()))
            .collect();
        let has_simple = |causality: Causality| {
            let double = BaseType::Real(Precision::Double);
            let is_simple = |v: &ScalarVariable| {
                v.dimensions.is_empty()
                    && (!matches!(v.kind, VariableKind::Real(_)) || v.kind.base_type() == double)
            };
            variables()
                .filter(|v| v.causality == causality)
                .all(is_simple)
        };
        Self {
            has_simple_inputs: has_simple(Causality::Input),
            has_simple_outputs: has_simple(Causality::Output),
            items: items_of(description),
            structural: variables()
                .filter(|v| v.causality == Causality::StructuralParameter)
                .map(|v| v.value_reference)
                .collect(),
            is_simple: singles.is_empty() && arrays.is_empty(),
            arrays: (!arrays.is_empty()).then(|| RefCell::new(arrays)),
            singles,
            types,
        }
    }

    /// Whether there are 32-bit reals.
    fn has_singles(&self) -> bool {
        !self.singles.is_empty()
    }

    /// Whether all real inputs are 64-bit scalars, which calls access directly by handle.
    pub(super) fn has_simple_inputs(&self) -> bool {
        self.has_simple_inputs
    }

    /// The same for outputs.
    pub(super) fn has_simple_outputs(&self) -> bool {
        self.has_simple_outputs
    }

    /// Whether this real is a 64-bit scalar.
    pub(super) fn is_scalar(&self, handle: u32) -> bool {
        let is_element = |arrays: &RefCell<Arrays>| arrays.borrow().has(handle);
        self.is_simple
            || !self.singles.contains_key(&handle) && !self.arrays.as_ref().is_some_and(is_element)
    }

    /// Sets reals; 64-bit reals in one call.
    #[inline(always)]
    pub(super) fn set_reals(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), ComponentError> {
        match self.is_simple {
            true => Ok(instance.set_real(handles, values)?),
            false => self.set_each_real(instance, handles, values),
        }
    }

    fn set_each_real(
        &self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), ComponentError> {
        if let (Some(arrays), false) = (&self.arrays, self.has_singles()) {
            return Ok(arrays.borrow_mut().set(instance, handles, values)?);
        }
        for (&handle, &value) in handles.iter().zip(values) {
            match self.singles.get(&handle) {
                Some(name) => instance.set(&[handle], &[single(value, name)?])?,
                None => match &self.arrays {
                    Some(arrays) => arrays.borrow_mut().set(instance, &[handle], &[value])?,
                    None => instance.set_real(&[handle], &[value])?,
                },
            }
        }
        Ok(())
    }

    /// Gets reals; 64-bit reals in one call.
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
        if let (Some(arrays), false) = (&self.arrays, self.has_singles()) {
            return arrays.borrow_mut().get(instance, handles, values);
        }
        for (&handle, value) in handles.iter().zip(values) {
            if self.singles.contains_key(&handle) {
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
    ) -> Result<(), ComponentError> {
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
    ) -> Result<(), ComponentError> {
        self.check(handle, value)?;
        let kind = self.integer_name(handle);
        match value {
            Value::Real(value) => self.set_reals(instance, &[handle], &[*value])?,
            Value::Integer(value) => match self.integer(handle) {
                IntegerType::Int8 => set::<i8>(instance, handle, *value, kind)?,
                IntegerType::UInt8 => set::<u8>(instance, handle, *value, kind)?,
                IntegerType::Int16 => set::<i16>(instance, handle, *value, kind)?,
                IntegerType::UInt16 => set::<u16>(instance, handle, *value, kind)?,
                IntegerType::Int32 => set::<i32>(instance, handle, *value, kind)?,
                IntegerType::UInt32 => set::<u32>(instance, handle, *value, kind)?,
                IntegerType::Int64 => set::<i64>(instance, handle, *value, kind)?,
                IntegerType::UInt64 => set::<u64>(instance, handle, *value, kind)?,
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
        kind: ValueKind,
    ) -> Result<Value, ComponentError> {
        Ok(match kind {
            ValueKind::Real => {
                let mut value = [0.0];
                self.get_reals(instance, &[handle], &mut value)?;
                Value::Real(value[0])
            }
            ValueKind::Integer | ValueKind::Enumeration => {
                Value::Integer(match self.integer(handle) {
                    IntegerType::Int8 => get::<i8>(instance, handle)?,
                    IntegerType::UInt8 => get::<u8>(instance, handle)?,
                    IntegerType::Int16 => get::<i16>(instance, handle)?,
                    IntegerType::UInt16 => get::<u16>(instance, handle)?,
                    IntegerType::Int32 => get::<i32>(instance, handle)?,
                    IntegerType::UInt32 => get::<u32>(instance, handle)?,
                    IntegerType::Int64 => get::<i64>(instance, handle)?,
                    IntegerType::UInt64 => get::<u64>(instance, handle)?,
                })
            }
            ValueKind::Boolean => Value::Boolean(instance.get_boolean(handle)?),
            ValueKind::String => Value::String(instance.get_string(handle)?),
        })
    }

    /// Name of the variable's integer type in the FMU's FMI version.
    fn integer_name(&self, handle: u32) -> &'static str {
        match self.types.get(&handle) {
            Some(BaseType::Integer(integer)) => integer.as_str(),
            Some(_) => "Int64",
            None => "Integer",
        }
    }

    /// Rejects an integer that the variable cannot hold.
    pub(super) fn check(&self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        let &Value::Integer(value) = value else {
            return Ok(());
        };
        if let Some(items) = self.items.get(&handle)
            && !items.contains(&value)
        {
            let items = items.clone();
            return Err(Lost::NoItem { value, items }.into());
        }
        let (range, kind) = (self.integer(handle).range(), self.integer_name(handle));
        match range.contains(&i128::from(value)) {
            true => Ok(()),
            false => {
                let value = value.into();
                Err(Lost::OutOfRange { value, kind }.into())
            }
        }
    }

    /// The integer type of a variable: FMI 2.0 has one; in FMI 3.0 enumerations are `Int64`.
    fn integer(&self, handle: u32) -> IntegerType {
        match self.types.get(&handle) {
            Some(BaseType::Integer(integer)) => *integer,
            Some(BaseType::Enumeration) => IntegerType::Int64,
            _ => IntegerType::Int32,
        }
    }
}

/// Converts to a 32-bit real. Rounding is accepted; overflow to infinity is an error.
fn single(value: f64, name: &str) -> Result<f32, Lost> {
    match value.is_finite() && !(value as f32).is_finite() {
        false => Ok(value as f32),
        true => Err(Lost::NotSingle {
            value,
            name: name.to_owned(),
        }),
    }
}

/// The values of scalar enumerations by handle; enumerations whose type lists no items are omitted.
fn items_of(description: &ModelDescription) -> HashMap<u32, Vec<i64>> {
    let types = types_of(description);
    let items = |variable: &ScalarVariable| {
        let VariableKind::Enumeration { declared_type, .. } = &variable.kind else {
            return None;
        };
        let items = items(types.get(declared_type.as_str()).copied()).iter();
        let values: Vec<i64> = items.map(|item| item.value).collect();
        (!values.is_empty()).then_some((variable.value_reference, values))
    };
    description.variables.iter().filter_map(items).collect()
}

fn set<T: Number + TryFrom<i64>>(
    instance: &mut Instance,
    handle: u32,
    value: i64,
    kind: &'static str,
) -> Result<(), ComponentError> {
    let narrow = T::try_from(value).map_err(|_| Lost::OutOfRange {
        value: value.into(),
        kind,
    })?;
    Ok(instance.set(&[handle], &[narrow])?)
}

fn get<T: Number + Into<i128>>(
    instance: &mut Instance,
    handle: u32,
) -> Result<i64, ComponentError> {
    let mut value = [T::default()];
    instance.get(&[handle], &mut value)?;
    let value: i128 = value[0].into();
    let kind = "Int64";
    Ok(i64::try_from(value).map_err(|_| Lost::OutOfRange { value, kind })?)
}
