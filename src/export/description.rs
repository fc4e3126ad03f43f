//! modelDescription.xml, from the model's table of variables: value references, units, dependencies
//! and all.

use super::Provenance;
use crate::fmi::description as fmi;
use crate::models::model::LOG_CATEGORIES;
use crate::models::simulation::DEFAULT_TOLERANCE;
use crate::models::variable::{Dependency, Role};
use crate::models::{Kind, Model, Unit, Variable};

/// Stop time that a simulation takes if the user says nothing: that of the paper's runs [s].
const STOP_TIME: f64 = 15.0;

/// Communication step then: that of the paper's samples [s].
const STEP_SIZE: f64 = 0.05;

/// The description of a model's FMU.
pub fn description(model: &Model, provenance: &Provenance) -> fmi::ModelDescription {
    let caveat = provenance.caveat.iter().map(String::as_str);
    let about: Vec<_> = [headline(model.kind()).as_str(), &provenance.origin]
        .into_iter()
        .chain(caveat)
        .map(str::to_owned)
        .collect();
    fmi::ModelDescription {
        model_name: model.kind().name().into(),
        guid: model.guid(),
        description: Some(about.join(" ")),
        version: Some(env!("CARGO_PKG_VERSION").into()),
        license: Some("MIT OR Apache-2.0".into()),
        generation_tool: Some(concat!("pilotage ", env!("CARGO_PKG_VERSION")).into()),
        co_simulation: Some(co_simulation(model.kind().name())),
        units: units(model.variables()),
        log_categories: log_categories(),
        default_experiment: Some(fmi::DefaultExperiment {
            start_time: Some(0.0),
            stop_time: Some(STOP_TIME),
            tolerance: Some(DEFAULT_TOLERANCE),
            step_size: Some(STEP_SIZE),
        }),
        variables: (0..)
            .zip(model.variables())
            .map(|(reference, v)| variable(reference, v))
            .collect(),
        structure: structure(model.variables()),
        ..fmi::ModelDescription::default()
    }
}

/// One sentence: what the model is.
pub(super) fn headline(kind: Kind) -> String {
    match kind {
        Kind::Pilot(pilot) => format!(
            "Human pilot as a linear system of order {}, from the error that it sees to the stick.",
            pilot.order
        ),
        Kind::Quadcopter => {
            "Pitch axis of a quadcopter with its attitude controller, from the stick to the position."
                .into()
        }
    }
}

fn co_simulation(model_identifier: &str) -> fmi::CoSimulation {
    fmi::CoSimulation {
        model_identifier: model_identifier.into(),
        can_handle_variable_communication_step_size: true,
        can_interpolate_inputs: true,
        max_output_derivative_order: 1,
        can_not_use_memory_management_functions: true,
        can_get_and_set_fmu_state: true,
        can_serialize_fmu_state: true,
        provides_directional_derivative: true,
        ..fmi::CoSimulation::default()
    }
}

fn log_categories() -> Vec<fmi::LogCategory> {
    LOG_CATEGORIES
        .iter()
        .map(|(name, description)| fmi::LogCategory {
            name: (*name).into(),
            description: Some((*description).into()),
        })
        .collect()
}

/// Each unit once, in the order of first use.
fn units(variables: &[Variable]) -> Vec<fmi::Unit> {
    let mut units: Vec<fmi::Unit> = Vec::new();
    for variable in variables {
        if !units.iter().any(|unit| unit.name == variable.unit.name) {
            units.push(unit(&variable.unit));
        }
    }
    units
}

fn unit(unit: &Unit) -> fmi::Unit {
    let [kg, m, s, rad] = unit.exponents;
    let display = |(name, factor): (&str, f64)| fmi::DisplayUnit {
        name: name.into(),
        factor,
        offset: 0.0,
        inverse: false,
    };
    fmi::Unit {
        name: unit.name.clone(),
        base: Some(fmi::BaseUnit {
            kg,
            m,
            s,
            rad,
            factor: unit.factor,
            ..fmi::BaseUnit::default()
        }),
        display_units: unit.display.map(display).into_iter().collect(),
    }
}

fn variable(reference: u32, variable: &Variable) -> fmi::ScalarVariable {
    use fmi::{Causality, Initial, Variability};
    let (causality, variability, initial) = match variable.role {
        Role::Input => (Causality::Input, Variability::Continuous, None),
        Role::Output { .. } => (
            Causality::Output,
            Variability::Continuous,
            Some(Initial::Calculated),
        ),
        Role::Fixed => (
            Causality::Parameter,
            Variability::Fixed,
            Some(Initial::Exact),
        ),
        Role::Tunable => (
            Causality::Parameter,
            Variability::Tunable,
            Some(Initial::Exact),
        ),
    };
    let attributes = fmi::RealAttributes {
        unit: Some(variable.unit.name.clone()),
        display_unit: variable.unit.display.map(|(name, _)| name.into()),
        min: variable.min,
        max: variable.max,
        nominal: variable.nominal,
        ..fmi::RealAttributes::default()
    };
    let kind = fmi::VariableKind::Real(fmi::RealVariable {
        attributes,
        start: variable.start.into_iter().collect(),
        ..fmi::RealVariable::default()
    });
    fmi::ScalarVariable {
        description: Some(variable.description.clone()),
        initial,
        ..fmi::ScalarVariable::new(&variable.name, reference, causality, variability, kind)
    }
}

/// Outputs and initial unknowns with what they depend on. FMI counts variables from 1 here.
fn structure(variables: &[Variable]) -> fmi::ModelStructure {
    let mut structure = fmi::ModelStructure::default();
    for (index, variable) in (1..).zip(variables) {
        if let Role::Output {
            dependencies,
            initial_dependencies,
        } = &variable.role
        {
            structure.outputs.push(unknown(index, dependencies));
            structure
                .initial_unknowns
                .push(unknown(index, initial_dependencies));
        }
    }
    structure
}

fn unknown(index: u32, dependencies: &[Dependency]) -> fmi::Unknown {
    let mut sorted = dependencies.to_vec();
    sorted.sort_unstable();
    let kind = |d: &Dependency| match d.constant {
        true => fmi::DependencyKind::Constant,
        false => fmi::DependencyKind::Dependent,
    };
    // A table has some dozen variables.
    let number = |d: &Dependency| u32::try_from(d.index + 1).unwrap_or(u32::MAX);
    fmi::Unknown {
        index,
        dependencies: Some(sorted.iter().map(number).collect()),
        dependencies_kind: (!sorted.is_empty()).then(|| sorted.iter().map(kind).collect()),
    }
}
