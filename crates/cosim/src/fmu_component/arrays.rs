//! Real arrays of FMI 3.0: each element is a variable for the master.

use pilotage_fmi::description::{
    BaseType, Dimension, ModelDescription, Precision, ScalarVariable, VariableKind,
};
use pilotage_fmi::{CallError, Instance};

/// Maximum number of elements; larger arrays are omitted, since each element would be a column of the result.
const LARGEST: usize = 10_000;

/// The arrays of 64-bit reals. Elements have handles above all value references.
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
    /// Values set or read last.
    values: Vec<f64>,
    is_changed: bool,
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
        let Some(first) = first.and_then(|first| self.base.checked_add(first)) else {
            return;
        };
        let start = match &variable.kind {
            VariableKind::Real(real) => &real.start[..],
            _ => &[],
        };
        // A single start value applies to all elements.
        let value = |k: usize| start.get(if start.len() == 1 { 0 } else { k });
        let values = (0..count)
            .map(|k| value(k).copied().unwrap_or(0.0))
            .collect();
        let array = self.all.len();
        self.elements.extend((0..count).map(|k| (array, k)));
        self.all.push(Array {
            index,
            reference: variable.value_reference,
            sizes,
            first,
            values,
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
        (0..array.values.len()).map(name).zip(handles).collect()
    }

    /// Whether the handle is that of an element.
    pub(super) fn has(&self, handle: u32) -> bool {
        self.element(handle).is_some()
    }

    fn element(&self, handle: u32) -> Option<(usize, usize)> {
        let k = handle.checked_sub(self.base)?;
        self.elements.get(k as usize).copied()
    }

    /// Gets reals including array elements; reads each array once.
    pub(super) fn get(
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
                instance.get(&[found.reference], &mut found.values)?;
                read = Some(array);
            }
            *value = found.values[k];
        }
        Ok(())
    }

    /// Sets reals including array elements; writes each array once. Elements not given keep the values set last.
    pub(super) fn set(
        &mut self,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), CallError> {
        for (&handle, &value) in handles.iter().zip(values) {
            match self.element(handle) {
                None => instance.set_real(&[handle], &[value])?,
                Some((array, k)) => {
                    self.all[array].values[k] = value;
                    self.all[array].is_changed = true;
                }
            }
        }
        for array in self.all.iter_mut().filter(|array| array.is_changed) {
            array.is_changed = false;
            instance.set(&[array.reference], &array.values)?;
        }
        Ok(())
    }
}

/// Sizes of an array of 64-bit reals, if known and not too large.
fn sizes(description: &ModelDescription, variable: &ScalarVariable) -> Option<Vec<usize>> {
    let is_double = variable.kind.base_type() == BaseType::Real(Precision::Double);
    if variable.dimensions.is_empty() || !is_double {
        return None;
    }
    let count = usize::try_from(description.size(variable)?).ok()?;
    let size = |dimension: &Dimension| match dimension {
        Dimension::Fixed(size) => usize::try_from(*size).ok(),
        Dimension::Variable(index) => {
            let position = (*index as usize).checked_sub(1)?;
            match &description.variables.get(position)?.kind {
                VariableKind::Integer { start, .. } => usize::try_from(*start.first()?).ok(),
                _ => None,
            }
        }
    };
    let sizes: Option<Vec<usize>> = variable.dimensions.iter().map(size).collect();
    sizes.filter(|_| (1..=LARGEST).contains(&count))
}
