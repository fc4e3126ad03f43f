//! Access to the values of an FMU's variables, independent of their types in its FMI version.

use super::arrays::{Arrays, size_parameter};
use super::ranges::{items_of, types_of};
use crate::component::{ComponentError, Value, ValueKind};
use pilotage_fmi::description::{
    BaseType, Causality, Dimension, FmiVersion, IntegerType, ModelDescription, Precision,
    ScalarVariable, VariableKind,
};
use pilotage_fmi::instance::Number;
use pilotage_fmi::{CallError, Instance};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use thiserror::Error;

/// A value that cannot be represented in a variable's type.
#[derive(Debug, Clone, PartialEq, Error)]
pub(super) enum Lost {
    #[error("{value} does not fit into a variable of type {kind}")]
    OutOfRange { value: i128, kind: &'static str },
    #[error(
        "arrays have the sizes of the description here, where it is {size}; change its start value there for other sizes"
    )]
    Resized { size: i64 },
    #[error(
        "{value}, of type {kind}, is beyond the integers of the master, which have 64 bits with a sign"
    )]
    TooLarge { value: i128, kind: &'static str },
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
    /// Those that are sizes of arrays, with their values in the description, by which the arrays are taken.
    sizes: HashMap<u32, i64>,
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
            items: values_of_items(description),
            structural: variables()
                .filter(|v| v.causality == Causality::StructuralParameter)
                .map(|v| v.value_reference)
                .collect(),
            sizes: sizes_of(description),
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
            return arrays.borrow_mut().set_reals(instance, handles, values);
        }
        for (&handle, &value) in handles.iter().zip(values) {
            match self.singles.get(&handle) {
                Some(name) => instance.set(&[handle], &[single(value, name)?])?,
                None => match &self.arrays {
                    Some(arrays) => arrays
                        .borrow_mut()
                        .set_reals(instance, &[handle], &[value])?,
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
            return arrays.borrow_mut().get_reals(instance, handles, values);
        }
        for (&handle, value) in handles.iter().zip(values) {
            if self.singles.contains_key(&handle) {
                let mut single = [0f32];
                instance.get(&[handle], &mut single)?;
                *value = f64::from(single[0]);
            } else {
                let value = std::slice::from_mut(value);
                match &self.arrays {
                    Some(arrays) => arrays.borrow_mut().get_reals(instance, &[handle], value)?,
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
            if let (Some(&size), Value::Integer(value)) = (self.sizes.get(&handle), value)
                && size != *value
            {
                return Err(Lost::Resized { size }.into());
            }
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
        if let (Some(arrays), false) = (&self.arrays, matches!(value, Value::Real(_)))
            && arrays.borrow_mut().set(instance, handle, value)?
        {
            return Ok(());
        }
        match value {
            Value::Real(value) => self.set_reals(instance, &[handle], &[*value])?,
            Value::Integer(value) => {
                set_integers(self.integer(handle), instance, handle, &[*value])?;
            }
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
        if let (Some(arrays), false) = (&self.arrays, kind == ValueKind::Real)
            && let Some(value) = arrays.borrow_mut().get(instance, handle)?
        {
            return Ok(value);
        }
        Ok(match kind {
            ValueKind::Real => {
                let mut value = [0.0];
                self.get_reals(instance, &[handle], &mut value)?;
                Value::Real(value[0])
            }
            ValueKind::Integer | ValueKind::Enumeration => {
                let mut value = [0];
                get_integers(self.integer(handle), instance, handle, &mut value)?;
                Value::Integer(value[0])
            }
            ValueKind::Boolean => Value::Boolean(instance.get_boolean(handle)?),
            ValueKind::String => Value::String(instance.get_string(handle)?),
        })
    }

    /// The value reference of a variable, or of the array with that element.
    fn reference_of(&self, handle: u32) -> u32 {
        let array = (self.arrays.as_ref()).and_then(|own| own.borrow().reference_of(handle));
        array.unwrap_or(handle)
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
        let handle = self.reference_of(handle);
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
pub(super) fn single(value: f64, name: &str) -> Result<f32, Lost> {
    match value.is_finite() && !(value as f32).is_finite() {
        false => Ok(value as f32),
        true => Err(Lost::NotSingle {
            value,
            name: name.to_owned(),
        }),
    }
}

/// The structural parameters that are sizes of arrays, by handle.
fn sizes_of(description: &ModelDescription) -> HashMap<u32, i64> {
    let dimensions = description.variables.iter().flat_map(|v| &v.dimensions);
    let size = |dimension: &Dimension| match dimension {
        Dimension::Variable(index) => size_parameter(description, *index),
        Dimension::Fixed(_) => None,
    };
    dimensions.filter_map(size).collect()
}

/// The values of scalar enumerations by handle; enumerations whose type lists no items are omitted.
fn values_of_items(description: &ModelDescription) -> HashMap<u32, Vec<i64>> {
    let types = types_of(description);
    let values = |variable: &ScalarVariable| {
        let items = items_of(&types, variable).iter();
        let values: Vec<i64> = items.map(|item| item.value).collect();
        (!values.is_empty()).then_some((variable.value_reference, values))
    };
    description.variables.iter().filter_map(values).collect()
}

/// Runs a function for the type of an integer.
macro_rules! for_integer {
    ($of:expr, $function:ident($($argument:expr),*)) => {
        match $of {
            IntegerType::Int8 => $function::<i8>($($argument),*),
            IntegerType::UInt8 => $function::<u8>($($argument),*),
            IntegerType::Int16 => $function::<i16>($($argument),*),
            IntegerType::UInt16 => $function::<u16>($($argument),*),
            IntegerType::Int32 => $function::<i32>($($argument),*),
            IntegerType::UInt32 => $function::<u32>($($argument),*),
            IntegerType::Int64 => $function::<i64>($($argument),*),
            IntegerType::UInt64 => $function::<u64>($($argument),*),
        }
    };
}

/// Sets an integer, or all elements of an array.
pub(super) fn set_integers(
    of: IntegerType,
    instance: &mut Instance,
    reference: u32,
    values: &[i64],
) -> Result<(), ComponentError> {
    for_integer!(of, set(of, instance, reference, values))
}

/// Gets an integer, or all elements of an array.
pub(super) fn get_integers(
    of: IntegerType,
    instance: &mut Instance,
    reference: u32,
    values: &mut [i64],
) -> Result<(), ComponentError> {
    for_integer!(of, get(of, instance, reference, values))
}

fn set<T: Number + TryFrom<i64>>(
    of: IntegerType,
    instance: &mut Instance,
    reference: u32,
    values: &[i64],
) -> Result<(), ComponentError> {
    let narrow = |&value: &i64| {
        T::try_from(value).map_err(|_| Lost::OutOfRange {
            value: value.into(),
            kind: of.as_str(),
        })
    };
    // A scalar needs no memory of its own.
    if let [value] = values {
        return Ok(instance.set(&[reference], &[narrow(value)?])?);
    }
    let narrow: Vec<T> = values.iter().map(narrow).collect::<Result<_, _>>()?;
    Ok(instance.set(&[reference], &narrow)?)
}

fn get<T: Number + Into<i128>>(
    of: IntegerType,
    instance: &mut Instance,
    reference: u32,
    values: &mut [i64],
) -> Result<(), ComponentError> {
    let (mut one, mut many) = ([T::default()], Vec::new());
    let read = match values.len() {
        1 => &mut one[..],
        count => {
            many.resize(count, T::default());
            &mut many[..]
        }
    };
    instance.get(&[reference], read)?;
    for (value, read) in values.iter_mut().zip(read) {
        let wide: i128 = (*read).into();
        *value = i64::try_from(wide).map_err(|_| Lost::TooLarge {
            value: wide,
            kind: of.as_str(),
        })?;
    }
    Ok(())
}
