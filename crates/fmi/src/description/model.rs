//! The root element, which describes the FMU as a whole.

use super::{
    CoSimulation, Dimension, FmiVersion, ModelExchange, ModelStructure, NamingConvention,
    ScalarVariable, ScheduledExecution, SimpleType, TypeKind, Unit, VariableKind,
};
use std::collections::HashMap;

/// A modelDescription.xml (FMI 2.0, section 2.2.1; FMI 3.0, section 2.4.1).
///
/// An optional attribute is an `Option`; a boolean attribute whose default is `false` is a `bool`. Fields of only one
/// version are marked; in a description of the other version they keep their default and are not written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelDescription {
    /// The version of the standard that it follows.
    pub fmi_version: FmiVersion,
    /// `fmiVersion` as written, if it is not `2.0` or `3.0`, e.g. `3.0.1`.
    pub fmi_release: Option<String>,
    /// Name of the model in the modelling tool.
    pub model_name: String,
    /// Fingerprint of the interface, which the binary compares with its own at instantiation: `guid` in FMI 2.0,
    /// `instantiationToken` in FMI 3.0.
    pub guid: String,
    /// One-line description.
    pub description: Option<String>,
    /// Author of the model.
    pub author: Option<String>,
    /// Version of the model.
    pub version: Option<String>,
    /// Copyright of the model.
    pub copyright: Option<String>,
    /// License of the model.
    pub license: Option<String>,
    /// Tool that generated the file.
    pub generation_tool: Option<String>,
    /// Time of generation, `YYYY-MM-DDThh:mm:ssZ`.
    pub generation_date_and_time: Option<String>,
    /// How variable names are structured.
    pub naming_convention: NamingConvention,
    /// FMI 2.0: number of event indicators (Model Exchange). FMI 3.0 lists them in
    /// [`ModelStructure::event_indicators`].
    pub number_of_event_indicators: Option<u32>,
    /// Present if the FMU supports Model Exchange.
    pub model_exchange: Option<ModelExchange>,
    /// Present if the FMU supports Co-Simulation.
    pub co_simulation: Option<CoSimulation>,
    /// FMI 3.0: present if the FMU supports Scheduled Execution.
    pub scheduled_execution: Option<ScheduledExecution>,
    /// The units used below.
    pub units: Vec<Unit>,
    /// Named types that variables may refer to.
    pub types: Vec<SimpleType>,
    /// Log categories of the FMU.
    pub log_categories: Vec<LogCategory>,
    /// Suggested start, stop, tolerance and step.
    pub default_experiment: Option<DefaultExperiment>,
    /// Annotations of tools: `<VendorAnnotations>` in FMI 2.0, `<Annotations>` in FMI 3.0.
    pub vendor_annotations: Vec<Tool>,
    /// The variables, in the order of the indices (from 1) of [`ModelStructure`].
    pub variables: Vec<ScalarVariable>,
    /// Outputs, derivatives, initial unknowns, and their dependencies.
    pub structure: ModelStructure,
}

impl ModelDescription {
    /// The variable with that name, and its index from 0.
    pub fn variable(&self, name: &str) -> Option<(usize, &ScalarVariable)> {
        self.variables
            .iter()
            .enumerate()
            .find(|(_, v)| v.name == name)
    }

    /// Returns the name of a real variable's unit: its own, else that of its declared type.
    pub fn units_of_variables<'a>(&'a self) -> impl Fn(&'a ScalarVariable) -> Option<&'a str> {
        let mut types: HashMap<&str, &str> = HashMap::new();
        for declared in self.types.iter().rev() {
            if let TypeKind::Real { attributes, .. } = &declared.kind
                && let Some(unit) = &attributes.unit
            {
                types.insert(&declared.name, unit);
            }
        }
        move |variable| match &variable.kind {
            VariableKind::Real(real) => {
                let declared = || types.get(real.declared_type.as_deref()?).copied();
                real.attributes.unit.as_deref().or_else(declared)
            }
            _ => None,
        }
    }

    /// A unit, with its meaning if it is defined and values can be converted by it.
    pub fn unit(&self, name: &str) -> pilotage_units::Unit {
        let defined = self.units.iter().find(|unit| unit.name == name);
        // Nothing is converted by a factor of 0 or infinity.
        let is_usable = |base: &super::BaseUnit| base.factor.is_normal() && base.offset.is_finite();
        pilotage_units::Unit {
            name: name.to_owned(),
            base: defined.and_then(|unit| unit.base).filter(is_usable),
        }
    }

    /// Sizes of the dimensions of a variable; empty for a scalar. `None` if one is unknown.
    pub fn sizes(&self, variable: &ScalarVariable) -> Option<Vec<u64>> {
        let size = |dimension: &Dimension| match dimension {
            Dimension::Fixed(size) => Some(*size),
            Dimension::Variable(index) => {
                let position = (*index as usize).checked_sub(1)?;
                match &self.variables.get(position)?.kind {
                    VariableKind::Integer { start, .. } => u64::try_from(*start.first()?).ok(),
                    _ => None,
                }
            }
        };
        variable.dimensions.iter().map(size).collect()
    }

    /// Number of start values of a variable: 1 for a scalar, the product of the dimensions for an array. `None` if the
    /// size of a dimension is unknown or the product is too large.
    pub fn size(&self, variable: &ScalarVariable) -> Option<u64> {
        let mut sizes = self.sizes(variable)?.into_iter();
        sizes.try_fold(1, |product: u64, size| product.checked_mul(size))
    }
}

/// A log category (FMI 2.0, section 2.2.4).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LogCategory {
    /// Name, for example `logStatusError`.
    pub name: String,
    /// What is logged under it.
    pub description: Option<String>,
}

/// Default settings of a simulation (FMI 2.0, section 2.2.5).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DefaultExperiment {
    /// Start time \[s\].
    pub start_time: Option<f64>,
    /// Stop time \[s\].
    pub stop_time: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
    /// Communication step \[s\].
    pub step_size: Option<f64>,
}

/// Annotation of one tool (FMI 2.0, section 2.2.6, `<Tool>`; FMI 3.0, section 2.4, `<Annotation>`): arbitrary XML.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tool {
    /// Name of the tool that reads it; in FMI 3.0 `type`, a reverse domain name.
    pub name: String,
    /// The XML between its tags, unchanged.
    pub content: String,
}
