//! An instance of a generated problem file: its variables for connections, measurements and estimation.

use crate::cli::model::open;
use crate::cli::{Failure, recognise};
use crate::fmi::Fmu;
use crate::fmi::description::{
    Causality, ModelDescription, Precision, ScalarVariable, Variability, VariableKind,
};
use crate::models::{Role, TextModel, library};
use std::path::Path;

/// An instance of the problem.
pub struct Instance {
    pub name: String,
    /// The model as given on the command line.
    pub given: String,
    pub inputs: Vec<String>,
    /// Names of outputs and states.
    pub outputs: Vec<String>,
    pub states: Vec<String>,
    pub parameters: Vec<Parameter>,
    /// Whether the parameters are known to be suited for estimation.
    pub is_known: bool,
}

/// A parameter that may be estimated.
pub struct Parameter {
    pub name: String,
    pub start: f64,
    /// Name of its unit; empty if it has none.
    pub unit: String,
    pub description: String,
}

impl Instance {
    /// Opens a built-in model, a model file or an FMU.
    pub fn open(name: &str, given: &str) -> Result<Self, Failure> {
        let path = Path::new(given);
        let is_other = !path.exists() && path.extension().is_none();
        let is_name = is_other || library::find(given).is_some() && !path.is_file();
        match is_name {
            true => Ok(Self::of_model(name, given, &open::named(given, None)?)),
            false if recognise::is_fmu(path) => {
                let fmu = Fmu::open(path)?;
                Ok(Self::of_fmu(name, given, fmu.description()))
            }
            false => Ok(Self::of_model(name, given, &open::read(path)?)),
        }
    }

    fn of_model(name: &str, given: &str, model: &TextModel) -> Self {
        let table = model.variables();
        let all = table.variables();
        let named = |is_it: &dyn Fn(Role) -> bool| -> Vec<String> {
            let own = all.iter().filter(|variable| is_it(variable.role));
            own.map(|variable| variable.name.clone()).collect()
        };
        let parameter = |index: usize| Parameter {
            name: all[index].name.clone(),
            start: all[index].start.unwrap_or_default(),
            unit: all[index].unit.name.to_string(),
            description: all[index].description.to_string(),
        };
        let state = |index: usize| all[index].name.clone();
        Self {
            name: name.to_owned(),
            given: given.to_owned(),
            inputs: named(&|role| role == Role::Input),
            outputs: named(&|role| matches!(role, Role::Output | Role::State)),
            states: table.states().map(state).collect(),
            parameters: table.parameters().map(parameter).collect(),
            is_known: true,
        }
    }

    fn of_fmu(name: &str, given: &str, description: &ModelDescription) -> Self {
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
            own.name
                .strip_suffix("_start")
                .is_some_and(|state| states.iter().any(|own| own == state))
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
        Self {
            name: name.to_owned(),
            given: given.to_owned(),
            inputs: named(with(Causality::Input)),
            parameters: parameters.collect(),
            is_known: tool.starts_with("pilotage "),
            outputs,
            states,
        }
    }
}

/// Whether a variable is a scalar real of double precision, as required by a fit.
fn is_double(variable: &ScalarVariable) -> bool {
    let is_real = |kind: &VariableKind| matches!(kind, VariableKind::Real(real) if real.precision == Precision::Double);
    variable.dimensions.is_empty() && is_real(&variable.kind)
}
