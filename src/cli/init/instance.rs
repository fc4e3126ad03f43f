//! Opens the instances of a generated problem file.

use crate::cli::model::open;
use crate::cli::{Failure, recognise};
use crate::flights::problem::{Instance, Parameter};
use crate::fmi::Fmu;
use crate::fmi::description::{
    Causality, ModelDescription, Precision, ScalarVariable, Variability, VariableKind,
};
use crate::models::library;
use std::path::Path;

/// Order of a pilot that has one.
const ORDER: usize = 3;

/// Opens a built-in model, a model, pilot or vehicle file, or an FMU; the problem names it `model`.
pub fn opened(name: &str, given: &str, model: &str) -> Result<Instance, Failure> {
    let path = Path::new(given);
    let is_other = !path.exists() && path.extension().is_none();
    let is_name = is_other || library::find(given).is_some() && !path.is_file();
    match is_name {
        true => {
            let mut own = Instance::of_model(name, model, &open::named(given, None)?);
            own.order = open::built_in(given)?.has_order.then_some(ORDER);
            Ok(own)
        }
        false if recognise::is_fmu(path) => {
            let fmu = Fmu::open(path)?;
            Ok(of_fmu(name, model, fmu.description()))
        }
        false => Ok(Instance::of_model(name, model, &open::read_any(path)?)),
    }
}

fn of_fmu(name: &str, model: &str, description: &ModelDescription) -> Instance {
    let all = &description.variables;
    let with = |causality: Causality| {
        let own = all.iter().filter(|own| own.causality == causality);
        own.filter(|own| is_double(own)).collect::<Vec<_>>()
    };
    let named = |own: Vec<&ScalarVariable>| -> Vec<String> {
        own.into_iter().map(|own| own.name.clone()).collect()
    };
    let derivatives = description.structure.derivatives.iter();
    let states = derivatives.filter_map(|own| {
        let derivative = all.get((own.index as usize).checked_sub(1)?)?;
        let VariableKind::Real(real) = &derivative.kind else {
            return None;
        };
        let state = all.get((real.derivative? as usize).checked_sub(1)?)?;
        Some(state.name.clone())
    });
    let states: Vec<String> = states.collect();
    let mut outputs = named(with(Causality::Output));
    outputs.extend(
        states
            .iter()
            .filter(|own| !outputs.contains(own))
            .cloned()
            .collect::<Vec<_>>(),
    );
    let units = description.units_of_variables();
    let is_start = |own: &ScalarVariable| {
        let of = |end: &str| {
            let state = own.name.strip_suffix(end);
            state.filter(|state| states.iter().any(|own| own == state))
        };
        let has = |name: &str| all.iter().any(|other| other.name == name);
        of(".start").is_some() || of("_start").is_some_and(|state| !has(&format!("{state}.start")))
    };
    let sought = with(Causality::Parameter).into_iter().filter(|own| {
        matches!(own.variability, Variability::Fixed | Variability::Tunable) && !is_start(own)
    });
    let parameters = sought.map(|own| Parameter {
        name: own.name.clone(),
        start: match &own.kind {
            VariableKind::Real(real) => real.start.first().copied().unwrap_or_default(),
            _ => 0.0,
        },
        unit: units(own).unwrap_or_default().to_owned(),
        description: own.description.clone().unwrap_or_default(),
    });
    let tool = description.generation_tool.as_deref().unwrap_or_default();
    Instance {
        name: name.to_owned(),
        model: model.to_owned(),
        order: None,
        set: Vec::new(),
        inputs: named(with(Causality::Input)),
        parameters: parameters.collect(),
        is_known: tool.starts_with("pilotage "),
        outputs,
        states,
    }
}

/// Whether a variable is a scalar real of double precision, as required by a fit.
fn is_double(variable: &ScalarVariable) -> bool {
    let is_real = |kind: &VariableKind| matches!(kind, VariableKind::Real(real) if real.precision == Precision::Double);
    variable.dimensions.is_empty() && is_real(&variable.kind)
}
