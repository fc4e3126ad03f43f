//! Applies values to variables of components and connectors of systems.

use crate::error::SspError;
use crate::flatten::{Flat, joined};
use crate::tree::Entry;
use crate::variables::elements;
use crate::wiring::{Leg, Owner, composite};
use pilotage_cosim::description::{Setting, Spanned};
use pilotage_fmi::description::BaseType;
use pilotage_text::printable::excerpt;
use pilotage_units::Conversion;

impl Flat {
    /// Applies a value to all variables and connectors of that name in a system (section 5.2.3).
    pub(crate) fn apply(&mut self, entry: &Entry, path: &str, own: usize) -> Result<(), SspError> {
        let mut is_used = false;
        let dots = entry.name.match_indices('.').map(|(at, _)| at);
        for dot in dots {
            let (element, rest) = (&entry.name[..dot], &entry.name[dot + 1..]);
            match self.names.get(&joined(path, element)) {
                Some(Owner::Component(number)) => is_used |= self.set(*number, rest, entry)?,
                Some(Owner::System(number)) => is_used |= self.give(*number, rest, entry),
                _ => {}
            }
        }
        is_used |= self.give(own, &entry.name, entry);
        if !is_used {
            self.reader.unmatched(&entry.at, &entry.name);
        }
        Ok(())
    }

    /// Gives a value to a connector of a system. Returns whether there is one of that name.
    fn give(&mut self, system: usize, name: &str, entry: &Entry) -> bool {
        let is_there = self.systems[system].contains(name);
        if is_there {
            self.given
                .insert((Owner::System(system), name.to_owned()), entry.clone());
        }
        is_there
    }

    /// Sets a variable of a component to a value in the entry's unit. Returns whether there is one of that name.
    pub(crate) fn set(
        &mut self,
        component: usize,
        name: &str,
        entry: &Entry,
    ) -> Result<bool, SspError> {
        let variables = self.components[component].clone();
        let Some(found) = variables.find(name) else {
            return Ok(false);
        };
        let leg = Leg {
            unit: found.unit,
            step: entry.step.clone(),
            at: entry.at.clone(),
        };
        let conversion = composite(entry.unit.clone(), &[leg])?;
        self.set_to(component, name, entry, conversion)?;
        Ok(true)
    }

    /// Sets a variable of a component to the entry's values, converted.
    pub(crate) fn set_to(
        &mut self,
        component: usize,
        name: &str,
        entry: &Entry,
        conversion: Conversion,
    ) -> Result<(), SspError> {
        let variables = self.components[component].clone();
        let Some(found) = variables.find(name) else {
            return Ok(());
        };
        let variable = found.variable;
        let instance = &self.description.instances[component].name;
        let full = format!("{instance}.{name}");
        let kind = variable.kind.base_type();
        if !variable.is_settable() || matches!(kind, BaseType::Binary | BaseType::Clock) {
            let note = format!(
                "{}: `{}` cannot be set; left out",
                entry.at.place,
                excerpt(&full)
            );
            self.reader.note(note);
            return Ok(());
        }
        let ends = match found.is_element || variable.dimensions.is_empty() {
            true => vec![String::new()],
            false => elements(
                &variables.fmu.sizes(variable).unwrap_or(vec![0]),
                entry.values.len(),
            ),
        };
        if ends.len() != entry.values.len() {
            let (found, full) = (entry.values.len(), excerpt(&full));
            return Err(entry.at.fault(format!(
                "{found} values for `{full}`, which has other dimensions"
            )));
        }
        for (end, value) in ends.iter().zip(&entry.values) {
            let value = text_of(value, kind, conversion).map_err(|fault| entry.at.fault(fault))?;
            let name = format!("{full}{end}");
            let place = Some(entry.at.place.clone());
            let setting = Setting {
                name: Spanned {
                    value: name.clone(),
                    place,
                },
                value,
            };
            match self.set.get(&name) {
                Some(known) => self.settings[*known].1 = setting,
                None => {
                    self.set.insert(name, self.settings.len());
                    self.settings.push((component, setting));
                }
            }
        }
        Ok(())
    }
}

/// A value as text for a variable of that type.
fn text_of(value: &str, kind: BaseType, conversion: Conversion) -> Result<String, String> {
    let number = || value.trim().parse::<f64>().ok();
    let is_real = kind.is_real();
    if conversion != Conversion::NONE {
        return match number() {
            Some(number) if is_real => Ok(format!("{:?}", conversion.apply(number))),
            Some(_) => Err("units and factors are for values that are real".to_owned()),
            None => Err(format!(
                "`{}` is no number, and is to be converted",
                excerpt(value)
            )),
        };
    }
    let is_whole = |number: &f64| number.fract() == 0.0 && number.abs() < 9e15;
    let whole = || {
        number()
            .filter(is_whole)
            .map(|number| format!("{number:.0}"))
    };
    Ok(match kind {
        BaseType::String => value.to_owned(),
        // Tools write reals for all that is a number.
        BaseType::Integer(_) | BaseType::Enumeration if value.trim().parse::<i128>().is_err() => {
            whole().unwrap_or_else(|| value.trim().to_owned())
        }
        BaseType::Boolean => match number() {
            Some(1.0) => "true".to_owned(),
            Some(0.0) => "false".to_owned(),
            _ => value.trim().to_owned(),
        },
        _ => value.trim().to_owned(),
    })
}
