//! The root element and what describes the FMU as a whole.

use super::{
    CoSimulation, Dimension, FmiVersion, ModelExchange, ModelStructure, NamingConvention,
    ScalarVariable, ScheduledExecution, SimpleType, TypeKind, Unit, VariableKind,
};
use std::collections::HashMap;

/// A modelDescription.xml (FMI 2.0, section 2.2.1; FMI 3.0, section 2.4.1).
///
/// An optional attribute is an `Option`; a boolean attribute whose default is `false` is a `bool`.
/// What only one version has is said so; in a description of the other one it keeps its default and
/// is not written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelDescription {
    /// The version of the standard that it follows.
    pub fmi_version: FmiVersion,
    /// `fmiVersion` as written, if it is another text than `2.0` or `3.0`: `3.0.1`, say.
    pub fmi_release: Option<String>,
    /// Name of the model as the modelling tool used it.
    pub model_name: String,
    /// Fingerprint of the interface, which the binary compares with its own when it is instantiated:
    /// `guid` in FMI 2.0, `instantiationToken` in FMI 3.0.
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
    /// Tool that wrote the file.
    pub generation_tool: Option<String>,
    /// When it was written, `YYYY-MM-DDThh:mm:ssZ`.
    pub generation_date_and_time: Option<String>,
    /// How variable names are built.
    pub naming_convention: NamingConvention,
    /// FMI 2.0: number of event indicators (Model Exchange). FMI 3.0 lists them in
    /// [`ModelStructure::event_indicators`].
    pub number_of_event_indicators: Option<u32>,
    /// Present if the FMU can do Model Exchange.
    pub model_exchange: Option<ModelExchange>,
    /// Present if the FMU can do Co-Simulation.
    pub co_simulation: Option<CoSimulation>,
    /// FMI 3.0: present if the FMU can do Scheduled Execution.
    pub scheduled_execution: Option<ScheduledExecution>,
    /// The units used below.
    pub units: Vec<Unit>,
    /// Named types that variables may refer to.
    pub types: Vec<SimpleType>,
    /// Log categories that the FMU knows.
    pub log_categories: Vec<LogCategory>,
    /// Suggested start, stop, tolerance and step.
    pub default_experiment: Option<DefaultExperiment>,
    /// Annotations of tools: `<VendorAnnotations>` in FMI 2.0, `<Annotations>` in FMI 3.0.
    pub vendor_annotations: Vec<Tool>,
    /// The variables; their order is what [`ModelStructure`] counts, from 1.
    pub variables: Vec<ScalarVariable>,
    /// Outputs, derivatives, initial unknowns, and what they depend on.
    pub structure: ModelStructure,
}

impl ModelDescription {
    /// The variable of that name, and its index from 0.
    pub fn variable(&self, name: &str) -> Option<(usize, &ScalarVariable)> {
        self.variables
            .iter()
            .enumerate()
            .find(|(_, v)| v.name == name)
    }

    /// Tells the name of a real variable's unit: its own, else that of its declared type.
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

    /// Number of values that a variable has at the start: 1 for a scalar, for an array the product of
    /// its dimensions. `None` if a dimension's size is not known or the product is too large.
    pub fn size(&self, variable: &ScalarVariable) -> Option<u64> {
        let sizes = variable.dimensions.iter().map(|dimension| match dimension {
            Dimension::Fixed(size) => Some(*size),
            Dimension::Variable(index) => {
                let position = (*index as usize).checked_sub(1)?;
                match &self.variables.get(position)?.kind {
                    VariableKind::Integer { start, .. } => u64::try_from(*start.first()?).ok(),
                    _ => None,
                }
            }
        });
        sizes
            .into_iter()
            .try_fold(1, |product: u64, size| product.checked_mul(size?))
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

/// What a simulation uses if the user says nothing (FMI 2.0, section 2.2.5).
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

/// Annotation of one tool (FMI 2.0, section 2.2.6, `<Tool>`; FMI 3.0, section 2.4, `<Annotation>`):
/// free XML.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tool {
    /// Name of the tool that reads it; in FMI 3.0 `type`, a domain in reverse.
    pub name: String,
    /// The XML between its tags, as it stands.
    pub content: String,
}
