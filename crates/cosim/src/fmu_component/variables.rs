//! Conversion of an FMU's variables to the master's.

use super::arrays::Arrays;
use super::ranges::{items_of, ranges_of, types_of};
use crate::component::{Role, ValueKind, Variable};
use pilotage_fmi::description::{
    BaseType, Causality, Initial, ModelDescription, ScalarVariable, Unknown, Variability,
    VariableKind,
};
use std::collections::HashMap;

/// A variable or array element: position in the description, type, name suffix and handle.
type Seen = (usize, ValueKind, String, u32);

/// The description's variables as variables of the master.
///
/// The given arrays appear as their elements. Other arrays, binary variables and clocks of FMI 3.0 are omitted, since
/// connections cannot carry them.
pub(super) fn variables(description: &ModelDescription, arrays: &Arrays) -> Vec<Variable> {
    let all = description.variables.iter().enumerate();
    let parts = |(index, v): (usize, &'_ ScalarVariable)| {
        let ends = match v.dimensions.is_empty() {
            true => vec![(String::new(), v.value_reference)],
            false => arrays.elements_of(index),
        };
        let kind = kind(v);
        ends.into_iter()
            .filter_map(move |(end, handle)| Some((index, kind?, end, handle)))
    };
    let seen: Vec<Seen> = all.flat_map(parts).collect();
    // Inputs: index in the description and position in the result.
    let at = seen.iter().enumerate();
    let inputs: Vec<(usize, usize)> = at
        .filter(|(_, (index, ..))| description.variables[*index].causality == Causality::Input)
        .map(|(position, (index, ..))| (*index, position))
        .collect();
    let structure = &description.structure;
    let (running, initial) = (
        by_index(&structure.outputs),
        by_index(&structure.initial_unknowns),
    );
    let (units, ranges) = (description.units_of_variables(), ranges_of(description));
    let types = types_of(description);
    let see = |(index, kind, end, handle): &Seen| {
        let (index, kind, handle) = (*index, *kind, *handle);
        let variable = &description.variables[index];
        let is_output = variable.causality == Causality::Output;
        let one_based = index as u32 + 1;
        let (mut feedthrough, mut initial_feedthrough) = (Vec::new(), Vec::new());
        if is_output {
            feedthrough = fed_by(running.get(&one_based), &inputs);
            // An output with `initial = exact` has its start value and depends on nothing.
            if variable.effective_initial() != Some(Initial::Exact) {
                initial_feedthrough = fed_by(initial.get(&one_based), &inputs);
            }
        }
        Variable {
            name: format!("{}{end}", variable.name),
            aliases: (variable.aliases.iter())
                .map(|alias| format!("{}{end}", alias.name))
                .collect(),
            handle,
            kind,
            role: role(variable),
            settable: variable.is_settable(),
            is_tunable: variable.variability == Variability::Tunable,
            description: variable.description.clone().unwrap_or_default(),
            is_discrete: variable.variability != Variability::Continuous,
            unit: (units(variable).filter(|name| !name.is_empty()))
                .map(|name| description.unit(name)),
            range: ranges(variable),
            items: (items_of(&types, variable).iter())
                .map(|item| (item.name.clone(), item.value))
                .collect(),
            nominal: nominal(variable),
            feedthrough,
            initial_feedthrough,
        }
    };
    seen.iter().map(see).collect()
}

/// The unknowns by index; the first if several have the same index.
fn by_index(unknowns: &[Unknown]) -> HashMap<u32, &Unknown> {
    unknowns.iter().rev().map(|u| (u.index, u)).collect()
}

/// The inputs among an unknown's dependencies; all inputs if it is not listed or lists none.
fn fed_by(unknown: Option<&&Unknown>, inputs: &[(usize, usize)]) -> Vec<usize> {
    let listed = unknown.and_then(|u| u.dependencies.as_ref());
    let is_listed = |index: usize| {
        let one_based = index as u32 + 1;
        listed.is_none_or(|listed| listed.contains(&one_based))
    };
    let feeding = inputs.iter().filter(|(index, _)| is_listed(*index));
    feeding.map(|&(_, position)| position).collect()
}

fn kind(variable: &ScalarVariable) -> Option<ValueKind> {
    match variable.kind.base_type() {
        BaseType::Real(_) => Some(ValueKind::Real),
        BaseType::Integer(_) => Some(ValueKind::Integer),
        BaseType::Boolean => Some(ValueKind::Boolean),
        BaseType::String => Some(ValueKind::String),
        BaseType::Enumeration => Some(ValueKind::Enumeration),
        BaseType::Binary | BaseType::Clock => None,
    }
}

fn nominal(variable: &ScalarVariable) -> Option<f64> {
    match &variable.kind {
        VariableKind::Real(real) => real.attributes.nominal.map(f64::abs),
        _ => None,
    }
}

fn role(variable: &ScalarVariable) -> Role {
    match variable.causality {
        Causality::Parameter | Causality::StructuralParameter => Role::Parameter,
        Causality::Input => Role::Input,
        Causality::Output => Role::Output,
        Causality::CalculatedParameter | Causality::Local | Causality::Independent => Role::Local,
    }
}
