//! Arrays of FMI 3.0: each element is a variable for the master.

use super::access::{Lost, get_integers, set_integers, single};
use crate::component::{ComponentError, Value};
use pilotage_fmi::description::{
    BaseType, Dimension, IntegerType, ModelDescription, Precision, ScalarVariable, VariableKind,
};
use pilotage_fmi::{CallError, Instance};

/// Maximum number of elements; larger arrays are omitted, since each element would be a column of the result. Reals are
/// read all together, others one by one.
const LARGEST: usize = 10_000;
const LARGEST_OF_OTHERS: usize = 1_000;

/// The arrays. Elements have handles above all value references.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    /// The first handle of an element, and array and element index for each.
    base: u32,
    elements: Vec<(usize, usize)>,
    all: Vec<Array>,
}

#[derive(Debug)]
struct Array {
    /// Position in the description.
    index: usize,
    reference: u32,
    sizes: Vec<usize>,
    first: u32,
    name: String,
    elements: Elements,
    is_changed: bool,
}

/// Values set or read last.
#[derive(Debug)]
enum Elements {
    Doubles(Vec<f64>),
    Singles(Vec<f32>),
    Integers(IntegerType, Vec<i64>),
    Booleans(Vec<bool>),
    Texts(Vec<String>),
}

impl Elements {
    /// The start values of an array; none for types that the master does not have. A single start value applies to all
    /// elements.
    fn of(kind: &VariableKind, count: usize) -> Option<Self> {
        fn all<T: Clone + Default>(start: &[T], count: usize) -> Vec<T> {
            let value = |k: usize| start.get(if start.len() == 1 { 0 } else { k });
            (0..count)
                .map(|k| value(k).cloned().unwrap_or_default())
                .collect()
        }
        Some(match (kind.base_type(), kind) {
            (BaseType::Real(Precision::Double), VariableKind::Real(real)) => {
                Self::Doubles(all(&real.start, count))
            }
            (BaseType::Real(Precision::Single), VariableKind::Real(real)) => {
                let values = all(&real.start, count).into_iter();
                Self::Singles(values.map(|value| value as f32).collect())
            }
            (
                base,
                VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. },
            ) => {
                let of = match base {
                    BaseType::Integer(of) => of,
                    _ => IntegerType::Int64,
                };
                // What does not fit is refused when it is read.
                let values = all(start, count).into_iter();
                let narrow = |value| i64::try_from(value).unwrap_or(i64::MAX);
                Self::Integers(of, values.map(narrow).collect())
            }
            (BaseType::Boolean, VariableKind::Boolean { start, .. }) => {
                Self::Booleans(all(start, count))
            }
            (BaseType::String, VariableKind::String { start, .. }) => {
                Self::Texts(all(start, count))
            }
            _ => return None,
        })
    }

    fn len(&self) -> usize {
        match self {
            Self::Doubles(values) => values.len(),
            Self::Singles(values) => values.len(),
            Self::Integers(_, values) => values.len(),
            Self::Booleans(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }

    /// Reads them; not integers, which may not fit.
    fn read(&mut self, instance: &mut Instance, reference: u32) -> Result<(), CallError> {
        match self {
            Self::Doubles(values) => instance.get(&[reference], values),
            Self::Singles(values) => instance.get(&[reference], values),
            Self::Integers(..) => Ok(()),
            Self::Booleans(values) => instance.get_booleans(&[reference], values),
            Self::Texts(values) => {
                *values = instance.get_strings(&[reference], values.len())?;
                Ok(())
            }
        }
    }

    fn write(&self, instance: &mut Instance, reference: u32) -> Result<(), ComponentError> {
        match self {
            Self::Doubles(values) => instance.set(&[reference], values)?,
            Self::Singles(values) => instance.set(&[reference], values)?,
            Self::Integers(of, values) => set_integers(*of, instance, reference, values)?,
            Self::Booleans(values) => instance.set_booleans(&[reference], values)?,
            Self::Texts(values) => {
                let texts: Vec<&str> = values.iter().map(String::as_str).collect();
                instance.set_strings(&[reference], &texts)?;
            }
        }
        Ok(())
    }

    /// A real; NaN of other types.
    fn real(&self, k: usize) -> f64 {
        match self {
            Self::Doubles(values) => values[k],
            Self::Singles(values) => values[k].into(),
            _ => f64::NAN,
        }
    }

    fn value(&self, k: usize) -> Value {
        match self {
            Self::Doubles(_) | Self::Singles(_) => Value::Real(self.real(k)),
            Self::Integers(_, values) => Value::Integer(values[k]),
            Self::Booleans(values) => Value::Boolean(values[k]),
            Self::Texts(values) => Value::String(values[k].clone()),
        }
    }

    fn set(&mut self, k: usize, value: &Value, name: &str) -> Result<(), Lost> {
        match (self, value) {
            (Self::Doubles(values), Value::Real(value)) => values[k] = *value,
            (Self::Singles(values), Value::Real(value)) => values[k] = single(*value, name)?,
            (Self::Integers(_, values), Value::Integer(value)) => values[k] = *value,
            (Self::Booleans(values), Value::Boolean(value)) => values[k] = *value,
            (Self::Texts(values), Value::String(value)) => values[k].clone_from(value),
            (_, value) => unreachable!("the master sets values of the variable's type: {value:?}"),
        }
        Ok(())
    }
}

impl Arrays {
    /// The arrays of a description, with their initial sizes.
    pub(super) fn of(description: &ModelDescription) -> Self {
        let references = description.variables.iter().map(|v| v.value_reference);
        let mut arrays = Self {
            base: references.max().map_or(0, |last| last.saturating_add(1)),
            ..Self::default()
        };
        for (index, variable) in description.variables.iter().enumerate() {
            if let Some(sizes) = sizes(description, variable) {
                arrays.add(index, variable, sizes);
            }
        }
        arrays
    }

    fn add(&mut self, index: usize, variable: &ScalarVariable, sizes: Vec<usize>) {
        let count: usize = sizes.iter().product();
        // Handles have 32 bits.
        let first = u32::try_from(self.elements.len()).ok();
        let first = first.and_then(|first| self.base.checked_add(first));
        let (Some(first), Some(elements)) = (first, Elements::of(&variable.kind, count)) else {
            return;
        };
        let array = self.all.len();
        self.elements.extend((0..count).map(|k| (array, k)));
        self.all.push(Array {
            index,
            reference: variable.value_reference,
            sizes,
            first,
            name: variable.name.clone(),
            elements,
            is_changed: false,
        });
    }

    /// Whether there are no arrays.
    pub(super) fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// Name suffixes and handles of the elements of the variable at that position: `[1]`, `[2]`..., for a matrix row by
    /// row `[1,1]`, `[1,2]`...
    pub(super) fn elements_of(&self, index: usize) -> Vec<(String, u32)> {
        let Some(array) = self.all.iter().find(|array| array.index == index) else {
            return Vec::new();
        };
        let name = |k: usize| {
            let mut rest = k;
            let mut places: Vec<String> = (array.sizes.iter().rev())
                .map(|size| {
                    let place = rest % size + 1;
                    rest /= size;
                    place.to_string()
                })
                .collect();
            places.reverse();
            format!("[{}]", places.join(","))
        };
        let handles = array.first..;
        (0..array.elements.len()).map(name).zip(handles).collect()
    }

    /// Whether the handle is that of an element.
    pub(super) fn has(&self, handle: u32) -> bool {
        self.element(handle).is_some()
    }

    /// Value reference of the array with this element.
    pub(super) fn reference_of(&self, handle: u32) -> Option<u32> {
        let (array, _) = self.element(handle)?;
        Some(self.all[array].reference)
    }

    fn element(&self, handle: u32) -> Option<(usize, usize)> {
        let k = handle.checked_sub(self.base)?;
        self.elements.get(k as usize).copied()
    }

    /// Gets reals including array elements; reads each array once.
    pub(super) fn get_reals(
        &mut self,
        instance: &mut Instance,
        handles: &[u32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let mut read = None;
        for (&handle, value) in handles.iter().zip(values) {
            let Some((array, k)) = self.element(handle) else {
                instance.get_real(&[handle], std::slice::from_mut(value))?;
                continue;
            };
            let found = &mut self.all[array];
            if read != Some(array) {
                found.elements.read(instance, found.reference)?;
                read = Some(array);
            }
            *value = found.elements.real(k);
        }
        Ok(())
    }

    /// Sets reals including array elements; writes each array once. Elements not given keep the values set last.
    pub(super) fn set_reals(
        &mut self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), ComponentError> {
        for (&handle, &value) in handles.iter().zip(values) {
            match self.element(handle) {
                None => instance.set_real(&[handle], &[value])?,
                Some((array, k)) => {
                    let array = &mut self.all[array];
                    (array.elements).set(k, &Value::Real(value), &array.name)?;
                    array.is_changed = true;
                }
            }
        }
        for array in self.all.iter_mut().filter(|array| array.is_changed) {
            array.is_changed = false;
            array.elements.write(instance, array.reference)?;
        }
        Ok(())
    }

    /// Gets an element; `None` if the handle is that of no element.
    pub(super) fn get(
        &mut self,
        instance: &mut Instance,
        handle: u32,
    ) -> Result<Option<Value>, ComponentError> {
        let Some((array, k)) = self.element(handle) else {
            return Ok(None);
        };
        let array = &mut self.all[array];
        array.elements.read(instance, array.reference)?;
        if let Elements::Integers(of, values) = &mut array.elements {
            get_integers(*of, instance, array.reference, values)?;
        }
        Ok(Some(array.elements.value(k)))
    }

    /// Sets an element; false if the handle is that of no element. The others keep the values set last.
    pub(super) fn set(
        &mut self,
        instance: &mut Instance,
        handle: u32,
        value: &Value,
    ) -> Result<bool, ComponentError> {
        let Some((array, k)) = self.element(handle) else {
            return Ok(false);
        };
        let array = &mut self.all[array];
        array.elements.set(k, value, &array.name)?;
        array.elements.write(instance, array.reference)?;
        Ok(true)
    }
}

/// Sizes of an array, if known and not too large.
fn sizes(description: &ModelDescription, variable: &ScalarVariable) -> Option<Vec<usize>> {
    if variable.dimensions.is_empty() {
        return None;
    }
    let largest = match variable.kind.base_type() {
        BaseType::Real(_) => LARGEST,
        _ => LARGEST_OF_OTHERS,
    };
    let count = usize::try_from(description.size(variable)?).ok()?;
    let size = |dimension: &Dimension| match dimension {
        Dimension::Fixed(size) => usize::try_from(*size).ok(),
        Dimension::Variable(index) => usize::try_from(size_parameter(description, *index)?.1).ok(),
    };
    let sizes: Option<Vec<usize>> = variable.dimensions.iter().map(size).collect();
    sizes.filter(|_| (1..=largest).contains(&count))
}

/// Value reference and start value of the structural parameter with that index, which is a size of arrays.
pub(super) fn size_parameter(description: &ModelDescription, index: u32) -> Option<(u32, i64)> {
    let parameter = (description.variables).get((index as usize).checked_sub(1)?)?;
    match &parameter.kind {
        VariableKind::Integer { start, .. } => {
            let size = i64::try_from(*start.first()?).ok()?;
            Some((parameter.value_reference, size))
        }
        _ => None,
    }
}
