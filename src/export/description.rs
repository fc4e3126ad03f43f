//! Creates modelDescription.xml from the model's table of variables, including value references, units and
//! dependencies.

use super::Provenance;
use crate::fmi::description as fmi;
use pilotage_sdk::log::LOG_CATEGORIES;
use pilotage_sdk::simulation::DEFAULT_TOLERANCE;
use pilotage_sdk::structure::Unknown;
use pilotage_sdk::variable::reference;
use pilotage_sdk::{Interface, Role, Unit, Variable};

/// Default stop time: that of the paper's runs [s].
const STOP_TIME: f64 = 15.0;

/// Default communication step: the sampling interval of the paper [s].
const STEP_SIZE: f64 = 0.05;

/// The model description of an FMU.
pub fn description(
    interface: &Interface,
    provenance: &Provenance,
    version: fmi::FmiVersion,
) -> fmi::ModelDescription {
    let caveat = provenance.caveat.iter().map(String::as_str);
    let about: Vec<_> = [interface.description.as_str(), &provenance.origin]
        .into_iter()
        .chain(caveat)
        .filter(|sentence| !sentence.is_empty())
        .map(str::to_owned)
        .collect();
    let indicators = interface.structure.indicators.len();
    let is_fmi3 = version == fmi::FmiVersion::V3;
    let described = described(interface, is_fmi3);
    fmi::ModelDescription {
        fmi_version: version,
        model_name: interface.name.clone(),
        guid: interface.guid.clone(),
        description: Some(about.join(" ")),
        version: Some(env!("CARGO_PKG_VERSION").into()),
        author: provenance.author.clone(),
        license: provenance.license.clone(),
        generation_date_and_time: provenance.date.clone(),
        generation_tool: Some(concat!("pilotage ", env!("CARGO_PKG_VERSION")).into()),
        naming_convention: fmi::NamingConvention::Structured,
        number_of_event_indicators: (!is_fmi3)
            .then(|| u32::try_from(indicators).unwrap_or(u32::MAX)),
        model_exchange: Some(model_exchange(interface, is_fmi3)),
        co_simulation: Some(co_simulation(interface, is_fmi3)),
        units: units(&interface.variables[..described]),
        log_categories: log_categories(),
        default_experiment: Some(fmi::DefaultExperiment {
            start_time: Some(0.0),
            stop_time: Some(STOP_TIME),
            tolerance: Some(DEFAULT_TOLERANCE),
            step_size: Some(STEP_SIZE),
        }),
        variables: (0..described)
            .map(|index| variable(interface, index, is_fmi3))
            .collect(),
        structure: structure(interface, version),
        ..fmi::ModelDescription::default()
    }
}

/// Number of described variables: all, except the time (the last variable) if nothing depends on it. FMI 3.0 always
/// requires it; in FMI 2.0, some importers expect a start value of it, which the standard forbids.
fn described(interface: &Interface, is_fmi3: bool) -> usize {
    let last = interface.variables.len() - 1;
    let s = &interface.structure;
    let mut unknowns = (s.outputs.iter())
        .chain(&s.derivatives)
        .chain(&s.indicators)
        .chain(&s.initial);
    let is_needed = is_fmi3 || unknowns.any(|u| u.dependencies.iter().any(|d| d.index == last));
    last + usize::from(is_needed)
}

/// `is_fmi3`: whether to set the attributes that only FMI 3.0 has.
fn model_exchange(interface: &Interface, is_fmi3: bool) -> fmi::ModelExchange {
    fmi::ModelExchange {
        model_identifier: interface.name.clone(),
        completed_integrator_step_not_needed: true,
        can_not_use_memory_management_functions: !is_fmi3,
        can_get_and_set_fmu_state: true,
        can_serialize_fmu_state: true,
        provides_directional_derivative: true,
        provides_adjoint_derivatives: is_fmi3,
        provides_per_element_dependencies: is_fmi3,
        ..fmi::ModelExchange::default()
    }
}

fn co_simulation(interface: &Interface, is_fmi3: bool) -> fmi::CoSimulation {
    let events = !interface.structure.indicators.is_empty();
    fmi::CoSimulation {
        model_identifier: interface.name.clone(),
        can_handle_variable_communication_step_size: true,
        can_interpolate_inputs: !is_fmi3,
        max_output_derivative_order: 1,
        can_not_use_memory_management_functions: !is_fmi3,
        can_get_and_set_fmu_state: true,
        can_serialize_fmu_state: true,
        provides_directional_derivative: true,
        provides_adjoint_derivatives: is_fmi3,
        provides_per_element_dependencies: is_fmi3,
        has_event_mode: is_fmi3,
        // Inputs vary linearly within a step: smoother than held.
        recommended_intermediate_input_smoothness: i32::from(is_fmi3),
        provides_intermediate_update: is_fmi3,
        might_return_early_from_do_step: is_fmi3 && events,
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

/// The units without duplicates, in order of first use.
fn units(variables: &[Variable]) -> Vec<fmi::Unit> {
    let mut units: Vec<fmi::Unit> = Vec::new();
    // Booleans have no unit.
    for variable in variables
        .iter()
        .filter(|v| !v.is_boolean() && v.unit.is_some())
    {
        if !units.iter().any(|unit| unit.name == variable.unit.name) {
            units.push(unit(&variable.unit));
        }
    }
    units
}

fn unit(unit: &Unit) -> fmi::Unit {
    let display = |(name, factor): &(String, f64)| fmi::DisplayUnit {
        name: name.clone(),
        factor: *factor,
        offset: 0.0,
        inverse: false,
    };
    fmi::Unit {
        name: unit.name.clone(),
        base: Some(unit.base),
        display_units: unit.display.iter().map(display).collect(),
    }
}

fn variable(interface: &Interface, index: usize, is_fmi3: bool) -> fmi::ScalarVariable {
    use fmi::{Causality as C, Initial as I, Variability as V};
    let variable = &interface.variables[index];
    let (causality, variability, initial) = match variable.role {
        Role::Input => (C::Input, V::Continuous, None),
        Role::Output => (C::Output, V::Continuous, Some(I::Calculated)),
        Role::Mode => (C::Output, V::Discrete, Some(I::Exact)),
        Role::Fixed => (C::Parameter, V::Fixed, Some(I::Exact)),
        Role::Tunable => (C::Parameter, V::Tunable, Some(I::Exact)),
        Role::State | Role::Local | Role::Derivative | Role::Indicator => {
            (C::Local, V::Continuous, Some(I::Calculated))
        }
        Role::Time => (C::Independent, V::Continuous, None),
    };
    let kind = match variable.is_boolean() {
        true => fmi::VariableKind::Boolean {
            declared_type: None,
            start: variable.start.into_iter().map(|v| v != 0.0).collect(),
        },
        false => fmi::VariableKind::Real(real(interface, index)),
    };
    let reference = reference(index);
    fmi::ScalarVariable {
        description: Some(variable.description.clone()),
        initial,
        intermediate_update: is_fmi3 && variable.role == Role::Input,
        ..fmi::ScalarVariable::new(&variable.name, reference, causality, variability, kind)
    }
}

fn real(interface: &Interface, index: usize) -> fmi::RealVariable {
    let variable = &interface.variables[index];
    let attributes = fmi::RealAttributes {
        unit: Some(variable.unit.name.clone()).filter(|_| variable.unit.is_some()),
        display_unit: variable.unit.display.as_ref().map(|(name, _)| name.clone()),
        min: variable.min,
        max: variable.max,
        nominal: variable.nominal,
        ..fmi::RealAttributes::default()
    };
    // States jump only at events.
    let jumps = interface.states.contains(&index) && !interface.structure.indicators.is_empty();
    fmi::RealVariable {
        attributes,
        start: variable.start.into_iter().collect(),
        derivative: interface.state_of(index).map(number),
        reinit: jumps,
        ..fmi::RealVariable::default()
    }
}

/// Outputs, derivatives, initial unknowns and, in FMI 3.0, event indicators, with their dependencies.
fn structure(interface: &Interface, version: fmi::FmiVersion) -> fmi::ModelStructure {
    let list = |unknowns: &[Unknown]| unknowns.iter().map(unknown).collect();
    let structure = &interface.structure;
    fmi::ModelStructure {
        outputs: list(&structure.outputs),
        derivatives: list(&structure.derivatives),
        initial_unknowns: list(&structure.initial),
        event_indicators: match version {
            fmi::FmiVersion::V2 => Vec::new(),
            fmi::FmiVersion::V3 => list(&structure.indicators),
        },
        ..fmi::ModelStructure::default()
    }
}

fn unknown(unknown: &Unknown) -> fmi::Unknown {
    let on = &unknown.dependencies;
    let kind = |constant: bool| match constant {
        true => fmi::DependencyKind::Constant,
        false => fmi::DependencyKind::Dependent,
    };
    fmi::Unknown {
        index: number(unknown.index),
        dependencies: Some(on.iter().map(|d| number(d.index)).collect()),
        dependencies_kind: (!on.is_empty()).then(|| on.iter().map(|d| kind(d.constant)).collect()),
    }
}

/// Index of a variable in the model description, counted from 1.
fn number(index: usize) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}
