//! Each variable by itself (FMI 2.0, section 2.2.7).

use super::*;

impl Checker<'_> {
    pub(super) fn variables(&mut self) {
        let description = self.description;
        self.unique_names();
        self.independents();
        for (index, variable) in description.variables.iter().enumerate() {
            let mut rules = Vec::new();
            if description.naming_convention == NamingConvention::Structured
                && !names::is_structured(&variable.name)
            {
                let name = variable.name.clone();
                rules.push(Rule::NotStructured { name });
            }
            rules.extend(combination(variable, description.fmi_version));
            rules.extend(start_presence(variable));
            rules.extend(self.declared_type(variable));
            rules.extend(self.values(variable));
            rules.extend(self.real(index, variable));
            if variable.can_handle_multiple_set_per_time_instant.is_some()
                && (description.model_exchange.is_none() || variable.causality != Causality::Input)
            {
                rules.push(Rule::MultipleSet);
            }
            for rule in rules {
                self.report_variable(index, rule);
            }
        }
    }

    fn unique_names(&mut self) {
        let variables = &self.description.variables;
        let mut first = HashMap::new();
        for (index, variable) in variables.iter().enumerate() {
            let before = *first.entry(variable.name.as_str()).or_insert(index);
            if before != index {
                let rule = Rule::DuplicateVariable {
                    name: variable.name.clone(),
                    first: self.places.variables[before].line,
                };
                self.report_variable(index, rule);
            }
        }
    }

    fn independents(&mut self) {
        let mut first: Option<&str> = None;
        for (index, variable) in self.description.variables.iter().enumerate() {
            if variable.causality != Causality::Independent {
                continue;
            }
            if let Some(first) = first {
                let first = first.to_owned();
                self.report_variable(index, Rule::SecondIndependent { first });
            }
            first.get_or_insert(&variable.name);
            let base = variable.kind.base_type();
            if !base.is_real() {
                let base = base.name(self.description.fmi_version);
                self.report_variable(index, Rule::IndependentNotReal { base });
            }
        }
    }

    fn type_definition(&self, name: &str) -> Option<&TypeKind> {
        let mut types = self.description.types.iter();
        types.find(|t| t.name == name).map(|t| &t.kind)
    }

    fn declared_type(&self, variable: &ScalarVariable) -> Option<Rule> {
        // Empty: the missing attribute is already reported.
        let name = variable.kind.declared_type().filter(|n| !n.is_empty())?;
        let name_owned = name.to_owned();
        let Some(kind) = self.type_definition(name) else {
            return Some(Rule::UnknownType { name: name_owned });
        };
        let version = self.description.fmi_version;
        let (found, expected) = (kind.base_type(), variable.kind.base_type());
        (found != expected).then_some(Rule::WrongType {
            name: name_owned,
            found: found.name(version),
            expected: expected.name(version),
        })
    }

    /// min, max and start against each other, with what the declared type says.
    fn values(&self, variable: &ScalarVariable) -> Vec<Rule> {
        let declared = variable.kind.declared_type();
        let declared = declared.and_then(|name| self.type_definition(name));
        let whole = |a: &IntegerAttributes| (a.min.map(|v| v as f64), a.max.map(|v| v as f64));
        let (own, starts) = match &variable.kind {
            VariableKind::Real(real) => (
                (real.attributes.min, real.attributes.max),
                real.start.clone(),
            ),
            VariableKind::Integer {
                attributes, start, ..
            }
            | VariableKind::Enumeration {
                attributes, start, ..
            } => (whole(attributes), start.iter().map(|&v| v as f64).collect()),
            _ => return Vec::new(),
        };
        let inherited = match declared {
            Some(TypeKind::Real { attributes, .. }) => (attributes.min, attributes.max),
            Some(
                TypeKind::Integer { attributes, .. } | TypeKind::Enumeration { attributes, .. },
            ) => whole(attributes),
            _ => (None, None),
        };
        let min = own.0.or(inherited.0).unwrap_or(f64::NEG_INFINITY);
        let max = own.1.or(inherited.1).unwrap_or(f64::INFINITY);
        let mut rules = Vec::new();
        if min > max {
            rules.push(Rule::MinAboveMax { min, max });
        } else if let Some(start) = starts.into_iter().find(|s| *s < min || *s > max) {
            rules.push(Rule::StartOutside { start, min, max });
        }
        rules.extend(not_an_item(variable, declared));
        rules
    }

    fn real(&self, index: usize, variable: &ScalarVariable) -> Vec<Rule> {
        let VariableKind::Real(real) = &variable.kind else {
            return Vec::new();
        };
        let mut rules = self.unit_rules(&self.with_declared_unit(real));
        if let Some(found) = real.attributes.nominal.filter(|&n| n <= 0.0) {
            rules.push(Rule::NominalNotPositive { found });
        }
        if real.reinit
            && (self.description.model_exchange.is_none()
                || !self.states.contains(&(index as u32 + 1)))
        {
            rules.push(Rule::Reinit);
        }
        if let Some(of) = real.derivative {
            let variables = &self.description.variables;
            let state = (of as usize).checked_sub(1).and_then(|i| variables.get(i));
            let is_good = of as usize != index + 1
                && state.is_some_and(|s| {
                    s.variability == Variability::Continuous && s.kind.base_type().is_real()
                });
            if !is_good {
                rules.push(Rule::BadDerivative {
                    index: of,
                    count: variables.len(),
                });
            }
        }
        rules
    }

    /// The attributes with the unit that the declared type gives if the variable gives none.
    fn with_declared_unit(&self, real: &RealVariable) -> RealAttributes {
        let mut attributes = real.attributes.clone();
        let declared = real.declared_type.as_ref();
        if let (
            None,
            Some(TypeKind::Real {
                attributes: declared,
                ..
            }),
        ) = (
            &attributes.unit,
            declared.and_then(|n| self.type_definition(n)),
        ) {
            attributes.unit.clone_from(&declared.unit);
            if attributes.display_unit.is_none() {
                attributes.display_unit.clone_from(&declared.display_unit);
            }
        }
        attributes
    }
}

/// The table of allowed combinations of causality, variability and initial.
fn combination(variable: &ScalarVariable, version: FmiVersion) -> Option<Rule> {
    use Causality as C;
    use Initial as I;
    use Variability as V;
    let (causality, variability) = (variable.causality, variable.variability);
    let base = variable.kind.base_type();
    if variability == V::Continuous && !base.is_real() {
        let base = base.name(version);
        return Some(Rule::ContinuousNotReal { base });
    }
    let allowed: &[I] = match (causality, variability) {
        (C::Parameter | C::StructuralParameter, V::Fixed | V::Tunable) => &[I::Exact],
        (C::CalculatedParameter, V::Fixed | V::Tunable) => &[I::Calculated, I::Approx],
        (C::Input, V::Discrete | V::Continuous) => match version {
            FmiVersion::V2 => &[],
            FmiVersion::V3 => &[I::Exact],
        },
        (C::Output | C::Local, V::Constant) => &[I::Exact],
        (C::Output | C::Local, V::Discrete | V::Continuous) => {
            &[I::Calculated, I::Exact, I::Approx]
        }
        (C::Local, V::Fixed | V::Tunable) => &[I::Calculated, I::Approx],
        (C::Independent, V::Continuous) => &[],
        _ => {
            return Some(Rule::CausalityVariability {
                causality,
                variability,
            });
        }
    };
    let initial = variable.initial.filter(|i| !allowed.contains(i))?;
    Some(Rule::InitialNotAllowed {
        causality,
        variability,
        initial,
    })
}

/// Whether a start value is there exactly if it must be.
fn start_presence(variable: &ScalarVariable) -> Option<Rule> {
    let has_start = variable.kind.has_start();
    let causality = variable.causality;
    let by_causality = || format!("causality=\"{causality}\"");
    match (causality, variable.effective_initial()) {
        (Causality::Input | Causality::Parameter, _) if !has_start => Some(Rule::MissingStart {
            why: by_causality(),
        }),
        (Causality::Independent, _) if has_start => Some(Rule::ForbiddenStart {
            why: by_causality(),
        }),
        (_, Some(initial @ (Initial::Exact | Initial::Approx))) if !has_start => {
            Some(Rule::MissingStart {
                why: format!("initial=\"{initial}\""),
            })
        }
        (_, Some(initial @ Initial::Calculated)) if has_start => Some(Rule::ForbiddenStart {
            why: format!("initial=\"{initial}\""),
        }),
        _ => None,
    }
}

fn not_an_item(variable: &ScalarVariable, declared: Option<&TypeKind>) -> Option<Rule> {
    let VariableKind::Enumeration {
        declared_type,
        start,
        ..
    } = &variable.kind
    else {
        return None;
    };
    let Some(TypeKind::Enumeration { items, .. }) = declared else {
        return None;
    };
    let is_item = |start: &&i128| items.iter().any(|i| i128::from(i.value) == **start);
    let start = start.iter().find(|start| !is_item(start))?;
    Some(Rule::NotAnItem {
        start: *start,
        name: declared_type.clone(),
    })
}
