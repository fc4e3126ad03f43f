//! The root element and what describes the FMU as a whole.

use super::{
    ModelStructure, NamingConvention, ScalarVariable, SimpleType, TypeKind, Unit, VariableKind,
};

/// A modelDescription.xml (FMI 2.0, section 2.2.1).
///
/// An optional attribute is an `Option`; a boolean attribute whose default is `false` is a `bool`.
/// `fmiVersion` is always `2.0` and therefore no field.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelDescription {
    /// Name of the model as the modelling tool used it.
    pub model_name: String,
    /// Fingerprint of the interface; `fmi2Instantiate` compares it with the binary's.
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
    /// Number of event indicators (Model Exchange).
    pub number_of_event_indicators: Option<u32>,
    /// Present if the FMU can do Model Exchange.
    pub model_exchange: Option<ModelExchange>,
    /// Present if the FMU can do Co-Simulation.
    pub co_simulation: Option<CoSimulation>,
    /// The units used below.
    pub units: Vec<Unit>,
    /// Named types that variables may refer to.
    pub types: Vec<SimpleType>,
    /// Log categories that the FMU knows.
    pub log_categories: Vec<LogCategory>,
    /// Suggested start, stop, tolerance and step.
    pub default_experiment: Option<DefaultExperiment>,
    /// Annotations of tools.
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

    /// Name of a real variable's unit: its own, else that of its declared type.
    pub fn unit_of<'a>(&'a self, variable: &'a ScalarVariable) -> Option<&'a str> {
        let VariableKind::Real(real) = &variable.kind else {
            return None;
        };
        real.attributes.unit.as_deref().or_else(|| {
            let name = real.declared_type.as_deref()?;
            match &self.types.iter().find(|t| t.name == name)?.kind {
                TypeKind::Real(declared) => declared.unit.as_deref(),
                _ => None,
            }
        })
    }
}

/// Attributes of `<CoSimulation>` (FMI 2.0, section 4.3.1).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CoSimulation {
    /// Stem of the binary's file name; a C identifier.
    pub model_identifier: String,
    /// A tool must be installed for the FMU to run.
    pub needs_execution_tool: bool,
    /// The communication step may vary.
    pub can_handle_variable_communication_step_size: bool,
    /// `fmi2SetRealInputDerivatives` works.
    pub can_interpolate_inputs: bool,
    /// Highest order that `fmi2GetRealOutputDerivatives` returns.
    pub max_output_derivative_order: u32,
    /// `fmi2DoStep` may return `fmi2Pending`. The schema spells it `canRunAsynchronuously`.
    pub can_run_asynchronously: bool,
    /// Only one instance for each process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The FMU does not use the memory callbacks.
    pub can_not_use_memory_management_functions: bool,
    /// `fmi2GetFMUstate` and the like work.
    pub can_get_and_set_fmu_state: bool,
    /// `fmi2SerializeFMUstate` and the like work.
    pub can_serialize_fmu_state: bool,
    /// `fmi2GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// C files under `sources/` to be compiled.
    pub source_files: Vec<String>,
}

/// Attributes of `<ModelExchange>` (FMI 2.0, section 3.3.1).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelExchange {
    /// Stem of the binary's file name; a C identifier.
    pub model_identifier: String,
    /// A tool must be installed for the FMU to run.
    pub needs_execution_tool: bool,
    /// `fmi2CompletedIntegratorStep` need not be called.
    pub completed_integrator_step_not_needed: bool,
    /// Only one instance for each process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The FMU does not use the memory callbacks.
    pub can_not_use_memory_management_functions: bool,
    /// `fmi2GetFMUstate` and the like work.
    pub can_get_and_set_fmu_state: bool,
    /// `fmi2SerializeFMUstate` and the like work.
    pub can_serialize_fmu_state: bool,
    /// `fmi2GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// C files under `sources/` to be compiled.
    pub source_files: Vec<String>,
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
    /// Start time [s].
    pub start_time: Option<f64>,
    /// Stop time [s].
    pub stop_time: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
    /// Communication step [s].
    pub step_size: Option<f64>,
}

/// Annotation of one tool (FMI 2.0, section 2.2.6): free XML.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tool {
    /// Name of the tool that reads it.
    pub name: String,
    /// The XML between `<Tool>` and `</Tool>`, as it stands.
    pub content: String,
}

impl CoSimulation {
    /// The boolean attributes by their names in XML.
    pub fn flags(&self) -> [(&'static str, bool); 9] {
        [
            ("needsExecutionTool", self.needs_execution_tool),
            (
                "canHandleVariableCommunicationStepSize",
                self.can_handle_variable_communication_step_size,
            ),
            ("canInterpolateInputs", self.can_interpolate_inputs),
            ("canRunAsynchronuously", self.can_run_asynchronously),
            (
                "canBeInstantiatedOnlyOncePerProcess",
                self.can_be_instantiated_only_once_per_process,
            ),
            (
                "canNotUseMemoryManagementFunctions",
                self.can_not_use_memory_management_functions,
            ),
            ("canGetAndSetFMUstate", self.can_get_and_set_fmu_state),
            ("canSerializeFMUstate", self.can_serialize_fmu_state),
            (
                "providesDirectionalDerivative",
                self.provides_directional_derivative,
            ),
        ]
    }
}

impl ModelExchange {
    /// The boolean attributes by their names in XML.
    pub fn flags(&self) -> [(&'static str, bool); 7] {
        [
            ("needsExecutionTool", self.needs_execution_tool),
            (
                "completedIntegratorStepNotNeeded",
                self.completed_integrator_step_not_needed,
            ),
            (
                "canBeInstantiatedOnlyOncePerProcess",
                self.can_be_instantiated_only_once_per_process,
            ),
            (
                "canNotUseMemoryManagementFunctions",
                self.can_not_use_memory_management_functions,
            ),
            ("canGetAndSetFMUstate", self.can_get_and_set_fmu_state),
            ("canSerializeFMUstate", self.can_serialize_fmu_state),
            (
                "providesDirectionalDerivative",
                self.provides_directional_derivative,
            ),
        ]
    }
}
