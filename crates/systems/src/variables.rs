//! The variables of an FMU, by name.

use pilotage_fmi::description::{ModelDescription, ScalarVariable};
use pilotage_units::Unit;
use std::collections::HashMap;
use std::sync::Arc;

/// The variables of an FMU by name.
pub(crate) struct Variables {
    pub(crate) fmu: Arc<ModelDescription>,
    pub(crate) by_name: HashMap<String, usize>,
    units: Vec<Option<Unit>>,
}

/// A variable of a name.
pub(crate) struct Found<'a> {
    pub(crate) variable: &'a ScalarVariable,
    pub(crate) unit: Option<Unit>,
    /// Whether the name is that of an element of the variable.
    pub(crate) is_element: bool,
}

impl Variables {
    pub(crate) fn of(fmu: Arc<ModelDescription>) -> Self {
        let all = fmu.variables.iter().enumerate();
        let names = all.flat_map(|(k, own)| {
            let aliases = own.aliases.iter().map(|alias| alias.name.clone());
            std::iter::once(own.name.clone())
                .chain(aliases)
                .map(move |name| (name, k))
        });
        let by_name = names.collect();
        let name = fmu.units_of_variables();
        let unit = |own| {
            name(own)
                .filter(|name| !name.is_empty())
                .map(|name| fmu.unit(name))
        };
        let units = fmu.variables.iter().map(unit).collect();
        drop(name);
        Self {
            fmu,
            by_name,
            units,
        }
    }

    pub(crate) fn find(&self, name: &str) -> Option<Found<'_>> {
        let found = |k: usize, is_element| Found {
            variable: &self.fmu.variables[k],
            unit: self.units[k].clone(),
            is_element,
        };
        if let Some(k) = self.by_name.get(name) {
            return Some(found(*k, false));
        }
        let array = &name[..name.strip_suffix(']')?.rfind('[')?];
        let own = found(*self.by_name.get(array)?, true);
        (!own.variable.dimensions.is_empty()).then_some(own)
    }
}

/// Name suffixes of an array's elements, row by row: `[1,1]`, `[1,2]`...; at most one more than that many.
pub(crate) fn elements(sizes: &[u64], most: usize) -> Vec<String> {
    let mut all = vec![String::new()];
    for size in sizes {
        let inner = |begin: &String| {
            let begin = begin.clone();
            (1..=*size).map(move |k| {
                if begin.is_empty() {
                    k.to_string()
                } else {
                    format!("{begin},{k}")
                }
            })
        };
        all = all.iter().flat_map(inner).take(most + 1).collect();
    }
    all.iter().map(|own| format!("[{own}]")).collect()
}
