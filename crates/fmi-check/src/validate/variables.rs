//! Checks of individual variables (FMI 2.0, section 2.2.7; FMI 3.0, section 2.4.7).

use super::*;

impl Checker<'_> {
    pub(super) fn variables(&mut self) {
        let description = self.description;
        self.unique_names();
        self.independents();
        for (position, variable) in description.variables.iter().enumerate() {
            let mut rules = Vec::new();
            let aliases = variable.aliases.iter().map(|alias| alias.name.as_str());
            for name in std::iter::once(variable.name.as_str()).chain(aliases) {
                rules.extend(self.name(name, variable.kind.base_type()));
            }
            rules.extend(combination::combination(variable, self.version));
            if !self.doubtful.contains(variable.name.as_str()) {
                rules.extend(combination::start_presence(variable));
            }
            rules.extend(self.declared_type(variable));
            rules.extend(self.values(variable));
            rules.extend(self.units_of(variable));
            rules.extend(self.attributes_for_causality(variable));
            for rule in rules {
                self.report_variable(position, rule);
            }
        }
    }

    fn name(&self, name: &str, base: BaseType) -> Option<Rule> {
        let is_structured = self.description.naming_convention == NamingConvention::Structured;
        let name_owned = || name.to_owned();
        if name.is_empty() {
            Some(Rule::EmptyName)
        } else if let Some(character) = names::forbidden_control(name) {
            Some(Rule::ControlInName {
                name: name_owned(),
                character,
            })
        } else if is_structured && !names::is_structured(name) {
            Some(Rule::NotStructured { name: name_owned() })
        } else if is_structured && name.starts_with("der(") && !base.is_real() {
            Some(Rule::DerivativeName {
                name: name_owned(),
                base: base.name(self.version),
            })
        } else {
            None
        }
    }

    /// Checks that the names of variables, and in FMI 3.0 of their aliases, are unique.
    fn unique_names(&mut self) {
        let variables = &self.description.variables;
        let mut first = HashMap::new();
        let named = variables.iter().enumerate().flat_map(|(position, v)| {
            let aliases = v.aliases.iter().map(|alias| alias.name.as_str());
            let names = std::iter::once(v.name.as_str()).chain(aliases);
            names.map(move |name| (position, name))
        });
        let mut twice = Vec::new();
        for (position, name) in named {
            match first.entry(name) {
                std::collections::hash_map::Entry::Vacant(entry) => {
                    entry.insert(position);
                }
                std::collections::hash_map::Entry::Occupied(entry) => {
                    let rule = Rule::DuplicateVariable {
                        name: name.to_owned(),
                        first: self.places.variables[*entry.get()].line,
                    };
                    twice.push((position, rule));
                }
            }
        }
        for (position, rule) in twice {
            self.report_variable(position, rule);
        }
    }

    fn independents(&mut self) {
        let mut first: Option<&str> = None;
        for (position, variable) in self.description.variables.iter().enumerate() {
            if variable.causality != Causality::Independent {
                continue;
            }
            if let Some(first) = first {
                let first = first.to_owned();
                self.report_variable(position, Rule::SecondIndependent { first });
            }
            first.get_or_insert(&variable.name);
            let base = variable.kind.base_type();
            if !base.is_real() {
                let base = base.name(self.version);
                let expected = match self.version {
                    FmiVersion::V2 => "Real",
                    FmiVersion::V3 => "Float64 or Float32",
                };
                self.report_variable(position, Rule::IndependentNotReal { base, expected });
            }
        }
        if self.is_v3() && first.is_none() {
            self.report(self.places.root, Rule::NoIndependent);
        }
    }

    fn declared_type(&self, variable: &ScalarVariable) -> Option<Rule> {
        // Empty: the missing attribute is already reported.
        let name = variable.kind.declared_type().filter(|n| !n.is_empty())?;
        let name_owned = name.to_owned();
        let Some(kind) = self.types.get(name) else {
            return Some(Rule::UnknownType { name: name_owned });
        };
        let (found, expected) = (kind.base_type(), variable.kind.base_type());
        (found != expected).then_some(Rule::WrongType {
            name: name_owned,
            found: found.name(self.version),
            expected: expected.name(self.version),
        })
    }

    /// Checks the variable's own units, else those of its declared type; and the display units of its aliases.
    fn units_of(&self, variable: &ScalarVariable) -> Vec<Rule> {
        let VariableKind::Real(real) = &variable.kind else {
            return Vec::new();
        };
        let mut unit = real.attributes.unit.as_deref();
        let mut display_unit = real.attributes.display_unit.as_deref();
        if let (None, Some(TypeKind::Real { attributes, .. })) = (unit, self.declared(variable)) {
            unit = attributes.unit.as_deref();
            display_unit = display_unit.or(attributes.display_unit.as_deref());
        }
        let mut rules = self.unit_rules(unit, display_unit);
        for alias in variable.aliases.iter().filter(|a| a.display_unit.is_some()) {
            rules.extend(self.unit_rules(unit, alias.display_unit.as_deref()));
        }
        rules
    }

    fn attributes_for_causality(&self, variable: &ScalarVariable) -> Vec<Rule> {
        let causality = variable.causality;
        let mut rules = Vec::new();
        let needs_model_exchange = !self.is_v3();
        if variable.can_handle_multiple_set_per_time_instant.is_some()
            && (causality != Causality::Input
                || (needs_model_exchange && self.description.model_exchange.is_none()))
        {
            rules.push(Rule::MultipleSet {
                model_exchange: needs_model_exchange,
            });
        }
        let is_parameter = matches!(
            causality,
            Causality::Parameter | Causality::StructuralParameter
        );
        if variable.intermediate_update && is_parameter {
            rules.push(Rule::NotForCausality {
                attribute: "intermediateUpdate",
                causality,
            });
        }
        rules
    }
}
