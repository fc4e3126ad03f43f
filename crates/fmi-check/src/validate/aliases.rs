//! Variables that share a value reference (FMI 2.0, section 2.2.7, `valueReference`).

use super::*;

/// The base type whose value references a variable uses.
fn reference_space(variable: &ScalarVariable) -> BaseType {
    match variable.kind.base_type() {
        BaseType::Enumeration => BaseType::Integer(IntegerType::Int32),
        base => base,
    }
}

impl Checker<'_> {
    pub(super) fn aliases(&mut self) {
        let variables = &self.description.variables;
        let mut sets: HashMap<(BaseType, u32), Vec<usize>> = HashMap::new();
        for (index, variable) in variables.iter().enumerate() {
            let key = (reference_space(variable), variable.value_reference);
            sets.entry(key).or_default().push(index);
        }
        for set in sets.into_values().filter(|set| set.len() > 1) {
            self.alias_set(&set);
        }
    }

    fn alias_set(&mut self, set: &[usize]) {
        let all = &self.description.variables;
        let reference = all[set[0]].value_reference;
        let is_constant = |i: usize| all[i].variability == Variability::Constant;
        let is_settable = |i: usize| is_settable(&all[i]);
        let has_start = |i: usize| all[i].kind.has_start() && !is_constant(i);
        let name = |i: usize| all[i].name.clone();

        let mut rules = Vec::new();
        for &(holds, make) in &[
            (
                &is_settable as &dyn Fn(usize) -> bool,
                &(|other| Rule::SettableAlias { reference, other }) as &dyn Fn(String) -> Rule,
            ),
            (&has_start, &|other| Rule::AliasStart { reference, other }),
        ] {
            let mut members = set.iter().copied().filter(|&i| holds(i));
            if let Some(first) = members.next() {
                rules.extend(members.map(|i| (i, make(name(first)))));
            }
        }
        rules.extend(self.settable_independent(set));
        rules.extend(self.alias_variability(set));
        for &i in &set[1..] {
            let (unit, other_unit) = (self.unit_of(i), self.unit_of(set[0]));
            if unit != other_unit {
                let rule = Rule::AliasUnit {
                    reference,
                    other: name(set[0]),
                    unit: unit.unwrap_or("").to_owned(),
                    other_unit: other_unit.unwrap_or("").to_owned(),
                };
                rules.push((i, rule));
            }
            let other = name(set[0]);
            if is_constant(i) != is_constant(set[0]) {
                rules.push((i, Rule::AliasConstant { reference, other }));
            } else if is_constant(i) && !same_start(&all[i].kind, &all[set[0]].kind) {
                rules.push((i, Rule::AliasValue { reference, other }));
            }
        }
        for (index, rule) in rules {
            self.report_variable(index, rule);
        }
    }

    /// Setting a variable that shares its value with the time would set the time.
    fn settable_independent(&self, set: &[usize]) -> Option<(usize, Rule)> {
        let all = &self.description.variables;
        let mut members = set.iter().copied();
        let other = members.clone().find(|&i| is_settable(&all[i]))?;
        let time = members.find(|&i| all[i].causality == Causality::Independent)?;
        let rule = Rule::SettableIndependent {
            reference: all[time].value_reference,
            other: all[other].name.clone(),
        };
        Some((time, rule))
    }

    /// All members must have the variability of the input or parameter among them, else the highest. Constants are
    /// handled separately.
    fn alias_variability(&self, set: &[usize]) -> Option<(usize, Rule)> {
        let all = &self.description.variables;
        let members = || set.iter().copied();
        if members().any(|i| all[i].variability == Variability::Constant) {
            return None;
        }
        let rank = |i: &usize| {
            Variability::ALL
                .iter()
                .position(|v| *v == all[*i].variability)
        };
        let settable = members().find(|&i| is_settable(&all[i]));
        let leading = settable.or_else(|| members().max_by_key(rank))?;
        let expected = all[leading].variability;
        let odd = members().find(|&i| all[i].variability != expected)?;
        let rule = Rule::AliasVariability {
            reference: all[odd].value_reference,
            other: all[leading].name.clone(),
            variability: all[odd].variability,
            expected,
        };
        Some((odd, rule))
    }

    fn unit_of(&self, index: usize) -> Option<&str> {
        let variable = &self.description.variables[index];
        let VariableKind::Real(real) = &variable.kind else {
            return None;
        };
        let inherited = match self.declared(variable) {
            Some(TypeKind::Real { attributes, .. }) => attributes.unit.as_deref(),
            _ => None,
        };
        real.attributes.unit.as_deref().or(inherited)
    }
}

fn is_settable(variable: &ScalarVariable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Parameter)
}

/// Whether the start values are equal; integers and enumerations share value references.
fn same_start(a: &VariableKind, b: &VariableKind) -> bool {
    match (a, b) {
        (VariableKind::Real(a), VariableKind::Real(b)) => a.start == b.start,
        (
            VariableKind::Integer { start: a, .. } | VariableKind::Enumeration { start: a, .. },
            VariableKind::Integer { start: b, .. } | VariableKind::Enumeration { start: b, .. },
        ) => a == b,
        (VariableKind::Boolean { start: a, .. }, VariableKind::Boolean { start: b, .. }) => a == b,
        (VariableKind::String { start: a, .. }, VariableKind::String { start: b, .. }) => a == b,
        _ => true,
    }
}
