//! Units and type definitions.

use super::*;

impl<'r> Checker<'r> {
    pub(super) fn units(&mut self) {
        let units = &self.description.units;
        for index in duplicates(units.iter().map(|u| u.name.as_str())) {
            let name = units[index].name.clone();
            self.report(self.places.units[index], Rule::DuplicateUnit { name });
        }
        for (unit, &place) in units.iter().zip(&self.places.units) {
            match &unit.base {
                None => {
                    let name = unit.name.clone();
                    self.report(place, Rule::UnitWithoutBase { name });
                }
                Some(base) => self.conversion(place, &unit.name, base.factor, base.offset),
            }
            let displays = &unit.display_units;
            for index in duplicates(displays.iter().map(|d| d.name.as_str())) {
                let rule = Rule::DuplicateDisplayUnit {
                    name: displays[index].name.clone(),
                    unit: unit.name.clone(),
                };
                self.report(place, rule);
            }
            for display in displays {
                self.conversion(place, &display.name, display.factor, display.offset);
                if display.inverse && display.offset != 0.0 {
                    let name = display.name.clone();
                    self.report(place, Rule::InverseWithOffset { name });
                }
            }
        }
    }

    fn conversion(&mut self, place: Place, name: &str, factor: f64, offset: f64) {
        for (attribute, found, is_good) in [
            ("factor", factor, factor.is_finite() && factor != 0.0),
            ("offset", offset, offset.is_finite()),
        ] {
            if !is_good {
                let name = name.to_owned();
                let rule = Rule::BadConversion {
                    name,
                    attribute,
                    found,
                };
                self.report(place, rule);
            }
        }
    }

    pub(super) fn types(&mut self) {
        let types = &self.description.types;
        for index in duplicates(types.iter().map(|t| t.name.as_str())) {
            let name = types[index].name.clone();
            self.report(self.places.types[index], Rule::DuplicateType { name });
        }
        let variables = self.description.variables.iter();
        let variables = first_of_each(variables.map(|v| (v.name.as_str(), ())));
        for (simple, &place) in types.iter().zip(&self.places.types) {
            if variables.contains_key(simple.name.as_str()) {
                let name = simple.name.clone();
                self.report(place, Rule::TypeNamedAsVariable { name });
            }
            let mut rules = match &simple.kind {
                TypeKind::Real {
                    precision,
                    attributes,
                } => {
                    let mut rules = self.unit_rules(
                        attributes.unit.as_deref(),
                        attributes.display_unit.as_deref(),
                    );
                    rules.extend(start::real_limits(*precision, attributes));
                    rules
                }
                TypeKind::Integer { attributes, .. } => start::whole_limits(attributes),
                TypeKind::Enumeration { attributes, .. } => start::whole_limits(attributes),
                TypeKind::Clock(clock) => clocks::attribute_rules(clock, None),
                TypeKind::Boolean | TypeKind::String | TypeKind::Binary(_) => Vec::new(),
            };
            if let TypeKind::Enumeration { items, .. } = &simple.kind {
                rules.extend(item_rules(&simple.name, items));
            }
            rules.into_iter().for_each(|rule| self.report(place, rule));
        }
    }

    /// Violated rules about a unit and a display unit.
    pub(super) fn unit_rules(&self, unit: Option<&str>, display_unit: Option<&str>) -> Vec<Rule> {
        let display = || display_unit.unwrap_or_default().to_owned();
        let Some(unit) = unit else {
            return match display_unit {
                Some(_) => vec![Rule::DisplayUnitWithoutUnit {
                    display_unit: display(),
                }],
                None => Vec::new(),
            };
        };
        let Some(found) = self.units.get(unit) else {
            let unit = unit.to_owned();
            return vec![Rule::UnknownUnit { unit }];
        };
        let is_known = |name| found.display_units.iter().any(|d| d.name == name);
        match display_unit {
            Some(name) if !is_known(name) => vec![Rule::UnknownDisplayUnit {
                display_unit: display(),
                unit: unit.to_owned(),
            }],
            _ => Vec::new(),
        }
    }
}

fn item_rules(name: &str, items: &[EnumerationItem]) -> Vec<Rule> {
    let values: Vec<String> = items.iter().map(|i| i.value.to_string()).collect();
    let names = duplicates(items.iter().map(|i| i.name.as_str()));
    let names = names.into_iter().map(|i| items[i].name.clone());
    let same_values = duplicates(values.iter().map(String::as_str));
    let same_values = same_values.into_iter().map(|i| values[i].clone());
    let twice = names.chain(same_values);
    twice
        .map(|item| Rule::DuplicateItem {
            name: name.to_owned(),
            item,
        })
        .collect()
}
