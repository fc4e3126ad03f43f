//! Units that a file defines (section 4.4.2).

use crate::error::SspError;
use crate::xml::Node;
use pilotage_units::{BASE_UNITS, Base, Unit};
use std::collections::HashMap;

/// The units of a file by name.
#[derive(Debug, Clone, Default)]
pub(crate) struct Units(HashMap<String, Option<Base>>);

impl Units {
    /// Reads the `<Units>` of a file's root.
    pub(crate) fn read(root: Node<'_, '_>) -> Result<Self, SspError> {
        let mut units = HashMap::new();
        for unit in root.listed("Units", "Unit") {
            let base = unit.child("BaseUnit").map(base).transpose()?;
            units.insert(unit.named()?.to_owned(), base);
        }
        Ok(Self(units))
    }

    /// The unit of that name. `None` for no name, for the `None` that some tools write, and for a name that is neither
    /// defined nor known otherwise.
    pub(crate) fn find(&self, name: Option<&str>) -> Option<Unit> {
        let name = name.filter(|name| !["", "None"].contains(name))?;
        let defined = self.0.get(name).copied().flatten();
        let base = defined.or_else(|| Base::of(name))?;
        let name = name.to_owned();
        Some(Unit {
            name,
            base: Some(base),
        })
    }
}

fn base(node: Node<'_, '_>) -> Result<Base, SspError> {
    let mut exponents = [0; 8];
    for (exponent, name) in exponents.iter_mut().zip(BASE_UNITS) {
        let value = node.number(name, 0.0)?;
        if value.fract() != 0.0 || value.abs() > 100.0 {
            return Err(node.fault(format!(
                "`{name}` is {value}; expected a small whole number"
            )));
        }
        *exponent = value as i32;
    }
    let factor = node.number("factor", 1.0)?;
    if !factor.is_normal() {
        return Err(node.fault(format!("a unit cannot have the factor {factor}")));
    }
    let offset = node.number("offset", 0.0)?;
    Ok(Base {
        exponents,
        factor,
        offset,
    })
}
