//! Units and type definitions.

use super::*;

impl Checker<'_> {
    pub(super) fn units(&mut self) {
        let units = &self.description.units;
        for index in duplicates(units.iter().map(|u| u.name.as_str())) {
            let name = units[index].name.clone();
            self.report(self.places.units[index], Rule::DuplicateUnit { name });
        }
        for (unit, &place) in units.iter().zip(&self.places.units) {
            if unit.base.is_none() {
                let name = unit.name.clone();
                self.report(place, Rule::UnitWithoutBase { name });
            }
        }
    }

    pub(super) fn types(&mut self) {
        let types = &self.description.types;
        for index in duplicates(types.iter().map(|t| t.name.as_str())) {
            let name = types[index].name.clone();
            self.report(self.places.types[index], Rule::DuplicateType { name });
        }
        for (simple, &place) in types.iter().zip(&self.places.types) {
            if self.description.variable(&simple.name).is_some() {
                let name = simple.name.clone();
                self.report(place, Rule::TypeNamedAsVariable { name });
            }
            match &simple.kind {
                TypeKind::Real {
                    attributes: real, ..
                } => {
                    let rules = self.unit_rules(real);
                    rules.into_iter().for_each(|rule| self.report(place, rule));
                    let limits = (real.min, real.max);
                    self.limits(place, limits);
                }
                TypeKind::Integer {
                    attributes: integer,
                    ..
                } => {
                    let limits = (integer.min.map(|v| v as f64), integer.max.map(|v| v as f64));
                    self.limits(place, limits);
                }
                TypeKind::Enumeration { items, .. } => self.items(place, &simple.name, items),
                _ => {}
            }
        }
    }

    fn limits(&mut self, place: Place, limits: (Option<f64>, Option<f64>)) {
        if let (Some(min), Some(max)) = limits
            && min > max
        {
            self.report(place, Rule::MinAboveMax { min, max });
        }
    }

    fn items(&mut self, place: Place, name: &str, items: &[EnumerationItem]) {
        let values: Vec<String> = items.iter().map(|i| i.value.to_string()).collect();
        let twice = duplicates(items.iter().map(|i| i.name.as_str()))
            .into_iter()
            .map(|i| items[i].name.clone())
            .chain(
                duplicates(values.iter().map(String::as_str))
                    .into_iter()
                    .map(|i| values[i].clone()),
            );
        for item in twice {
            let name = name.to_owned();
            self.report(place, Rule::DuplicateItem { name, item });
        }
    }

    /// Rules about units that these attributes break.
    pub(super) fn unit_rules(&self, real: &RealAttributes) -> Vec<Rule> {
        let mut rules = Vec::new();
        match (&real.unit, &real.display_unit) {
            (Some(unit), display_unit) => {
                match self.description.units.iter().find(|u| u.name == *unit) {
                    None => rules.push(Rule::UnknownUnit { unit: unit.clone() }),
                    Some(found) => {
                        let known =
                            |name: &String| found.display_units.iter().any(|d| d.name == *name);
                        rules.extend(display_unit.iter().filter(|d| !known(d)).map(|d| {
                            Rule::UnknownDisplayUnit {
                                display_unit: d.clone(),
                                unit: unit.clone(),
                            }
                        }));
                    }
                }
            }
            (None, Some(display_unit)) => rules.push(Rule::DisplayUnitWithoutUnit {
                display_unit: display_unit.clone(),
            }),
            (None, None) => {}
        }
        rules
    }
}
