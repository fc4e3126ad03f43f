//! Limits and start values.

use super::*;

impl Checker<'_> {
    /// Checks min, max and start against each other, including those of the declared type.
    pub(super) fn values(&self, variable: &ScalarVariable) -> Vec<Rule> {
        let declared = self.declared(variable);
        match &variable.kind {
            VariableKind::Real(real) => real_rules(real, declared),
            VariableKind::Integer {
                attributes, start, ..
            } => whole_rules(attributes, start, declared),
            VariableKind::Enumeration {
                attributes,
                start,
                declared_type,
            } => {
                let mut rules = whole_rules(attributes, start, declared);
                rules.extend(not_an_item(declared_type, start, declared));
                rules
            }
            VariableKind::Binary {
                attributes, start, ..
            } => {
                let inherited = match declared {
                    Some(TypeKind::Binary(binary)) => binary.max_size,
                    _ => None,
                };
                let limit = attributes.max_size.or(inherited).unwrap_or(u64::MAX);
                let lengths = start.iter().map(Vec::len);
                let mut too_long = lengths.filter(|&length| length as u64 > limit);
                let rule = too_long.next();
                rule.map(|found| Rule::StartTooLong { found, limit })
                    .into_iter()
                    .collect()
            }
            _ => Vec::new(),
        }
    }

    /// The definition of the variable's declared type.
    pub(super) fn declared(&self, variable: &ScalarVariable) -> Option<&TypeKind> {
        let name = variable.kind.declared_type()?;
        self.types.get(name).copied()
    }

    /// Checks that the number of start values is one or the number of elements.
    pub(super) fn start_count(&self, variable: &ScalarVariable) -> Option<Rule> {
        let found = variable.kind.start_count();
        let expected = self.description.size(variable)?;
        // An empty array is reported by its dimension.
        (found > 1 && expected > 0 && found as u64 != expected)
            .then_some(Rule::StartCount { found, expected })
    }
}

fn real_rules(real: &RealVariable, declared: Option<&TypeKind>) -> Vec<Rule> {
    let own = &real.attributes;
    let mut rules = Vec::new();
    for (attribute, value) in [("min", own.min), ("max", own.max), ("nominal", own.nominal)] {
        if value.is_some_and(f64::is_nan) {
            rules.push(Rule::NotANumber { attribute });
        }
    }
    if real.start.iter().any(|v| v.is_nan()) {
        rules.push(Rule::NotANumber { attribute: "start" });
    }
    if let Some(found) = own.nominal.filter(|&n| n <= 0.0) {
        rules.push(Rule::NominalNotPositive { found });
    }
    let (inherited_min, inherited_max) = match declared {
        Some(TypeKind::Real { attributes, .. }) => (attributes.min, attributes.max),
        _ => (None, None),
    };
    let min = own.min.or(inherited_min).unwrap_or(f64::NEG_INFINITY);
    let max = own.max.or(inherited_max).unwrap_or(f64::INFINITY);
    let text = |value: f64| shown(real.precision, value);
    if min > max {
        rules.push(Rule::MinAboveMax {
            min: text(min),
            max: text(max),
        });
    } else if let Some(&start) = real.start.iter().find(|s| **s < min || **s > max) {
        rules.push(Rule::StartOutside {
            start: text(start),
            min: text(min),
            max: text(max),
        });
    }
    rules
}

/// Limits of a floating-point type definition.
pub(super) fn real_limits(precision: Precision, attributes: &RealAttributes) -> Vec<Rule> {
    let real = RealVariable {
        precision,
        attributes: attributes.clone(),
        ..RealVariable::default()
    };
    real_rules(&real, None)
}

/// Limits of an integer or enumeration type definition.
pub(super) fn whole_limits(attributes: &IntegerAttributes) -> Vec<Rule> {
    whole_rules(attributes, &[], None)
}

fn whole_rules(own: &IntegerAttributes, starts: &[i128], declared: Option<&TypeKind>) -> Vec<Rule> {
    let (inherited_min, inherited_max) = match declared {
        Some(TypeKind::Integer { attributes, .. } | TypeKind::Enumeration { attributes, .. }) => {
            (attributes.min, attributes.max)
        }
        _ => (None, None),
    };
    let (min, max) = (own.min.or(inherited_min), own.max.or(inherited_max));
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        return vec![Rule::MinAboveMax {
            min: min.to_string(),
            max: max.to_string(),
        }];
    }
    let is_outside =
        |start: &&i128| min.is_some_and(|m| **start < m) || max.is_some_and(|m| **start > m);
    let limit = |value: Option<i128>, none: &str| value.map_or(none.to_owned(), |v| v.to_string());
    let outside = starts.iter().find(is_outside);
    let rule = outside.map(|start| Rule::StartOutside {
        start: start.to_string(),
        min: limit(min, "-inf"),
        max: limit(max, "inf"),
    });
    rule.into_iter().collect()
}

fn not_an_item(name: &str, starts: &[i128], declared: Option<&TypeKind>) -> Option<Rule> {
    let Some(TypeKind::Enumeration { items, .. }) = declared else {
        return None;
    };
    let is_item = |start: &&i128| items.iter().any(|i| i128::from(i.value) == **start);
    let start = starts.iter().find(|start| !is_item(start))?;
    Some(Rule::NotAnItem {
        start: *start,
        name: name.to_owned(),
    })
}

/// A number formatted for messages.
pub(crate) fn shown(precision: Precision, value: f64) -> String {
    match precision {
        // The debug format uses an exponent instead of many zeros.
        Precision::Double => format!("{value:?}"),
        Precision::Single => format!("{:?}", value as f32),
    }
    .trim_end_matches(".0")
    .to_owned()
}
