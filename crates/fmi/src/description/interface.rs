//! Capabilities of an FMU for each interface type.

use super::FmiVersion;

/// `<CoSimulation>` (FMI 2.0, section 4.3.1; FMI 3.0, section 4.4).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CoSimulation {
    /// Stem of the binary's file name; a C identifier.
    pub model_identifier: String,
    /// The FMU needs an installed tool to run.
    pub needs_execution_tool: bool,
    /// The communication step may vary.
    pub can_handle_variable_communication_step_size: bool,
    /// FMI 2.0: `fmi2SetRealInputDerivatives` works.
    pub can_interpolate_inputs: bool,
    /// Highest order that `fmi2GetRealOutputDerivatives` or `fmi3GetOutputDerivatives` returns.
    pub max_output_derivative_order: u32,
    /// FMI 2.0: `fmi2DoStep` may return `fmi2Pending`. The schema spells it `canRunAsynchronuously`.
    pub can_run_asynchronously: bool,
    /// Only one instance per process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// FMI 2.0: the FMU does not use the memory callbacks.
    pub can_not_use_memory_management_functions: bool,
    /// `fmi2GetFMUstate`, `fmi3GetFMUState` and the like work.
    pub can_get_and_set_fmu_state: bool,
    /// `fmi2SerializeFMUstate`, `fmi3SerializeFMUState` and the like work.
    pub can_serialize_fmu_state: bool,
    /// `fmi2GetDirectionalDerivative` or `fmi3GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// FMI 3.0: `fmi3GetAdjointDerivative` works.
    pub provides_adjoint_derivatives: bool,
    /// FMI 3.0: `fmi3GetVariableDependencies` works.
    pub provides_per_element_dependencies: bool,
    /// FMI 3.0: the FMU's internal step [s, or the unit of the independent variable].
    pub fixed_internal_step_size: Option<f64>,
    /// FMI 3.0: how often the inputs should be differentiable within a step.
    pub recommended_intermediate_input_smoothness: i32,
    /// FMI 3.0: the FMU calls back within a step.
    pub provides_intermediate_update: bool,
    /// FMI 3.0: `fmi3DoStep` may end before the requested time.
    pub might_return_early_from_do_step: bool,
    /// FMI 3.0: the callback may request an early end.
    pub can_return_early_after_intermediate_update: bool,
    /// FMI 3.0: the importer may handle events.
    pub has_event_mode: bool,
    /// FMI 3.0: `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
    /// FMI 2.0: C files under `sources/` to be compiled.
    pub source_files: Vec<String>,
}

/// `<ModelExchange>` (FMI 2.0, section 3.3.1; FMI 3.0, section 3.4).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelExchange {
    /// Stem of the binary's file name; a C identifier.
    pub model_identifier: String,
    /// The FMU needs an installed tool to run.
    pub needs_execution_tool: bool,
    /// `fmi2CompletedIntegratorStep` need not be called. FMI 3.0 has the opposite attribute,
    /// `needsCompletedIntegratorStep`.
    pub completed_integrator_step_not_needed: bool,
    /// Only one instance per process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// FMI 2.0: the FMU does not use the memory callbacks.
    pub can_not_use_memory_management_functions: bool,
    /// `fmi2GetFMUstate`, `fmi3GetFMUState` and the like work.
    pub can_get_and_set_fmu_state: bool,
    /// `fmi2SerializeFMUstate`, `fmi3SerializeFMUState` and the like work.
    pub can_serialize_fmu_state: bool,
    /// `fmi2GetDirectionalDerivative` or `fmi3GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// FMI 3.0: `fmi3GetAdjointDerivative` works.
    pub provides_adjoint_derivatives: bool,
    /// FMI 3.0: `fmi3GetVariableDependencies` works.
    pub provides_per_element_dependencies: bool,
    /// FMI 3.0: `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
    /// FMI 2.0: C files under `sources/` to be compiled.
    pub source_files: Vec<String>,
}

/// `<ScheduledExecution>` (FMI 3.0, section 5.4).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ScheduledExecution {
    /// Stem of the binary's file name; a C identifier.
    pub model_identifier: String,
    /// The FMU needs an installed tool to run.
    pub needs_execution_tool: bool,
    /// Only one instance per process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `fmi3GetFMUState` and the like work.
    pub can_get_and_set_fmu_state: bool,
    /// `fmi3SerializeFMUState` and the like work.
    pub can_serialize_fmu_state: bool,
    /// `fmi3GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// `fmi3GetAdjointDerivative` works.
    pub provides_adjoint_derivatives: bool,
    /// `fmi3GetVariableDependencies` works.
    pub provides_per_element_dependencies: bool,
}

/// Declares the boolean attributes of an interface type: field, name in FMI 2.0 and in FMI 3.0 (empty if the version
/// has none). Reader, writer and [`flags`](CoSimulation::flags) use it.
macro_rules! flags {
    ($type:ident { $($field:ident: $v2:literal, $v3:literal;)+ }) => {
        impl $type {
            /// The boolean attributes whose default is `false`, by their XML names in that version, in the schema's
            /// order.
            pub fn flags(&self, version: FmiVersion) -> Vec<(&'static str, bool)> {
                let both = [$(($v2, $v3, self.$field)),+];
                let named = both.into_iter().map(|(v2, v3, value)| match version {
                    FmiVersion::V2 => (v2, value),
                    FmiVersion::V3 => (v3, value),
                });
                named.filter(|(name, _)| !name.is_empty()).collect()
            }

            /// Sets the boolean attributes to `value` of their names.
            pub(super) fn set_flags(
                &mut self,
                version: FmiVersion,
                value: impl Fn(&'static str) -> bool,
            ) {
                let name = |v2, v3| match version {
                    FmiVersion::V2 => v2,
                    FmiVersion::V3 => v3,
                };
                $(
                    let name_here: &'static str = name($v2, $v3);
                    if !name_here.is_empty() {
                        self.$field = value(name_here);
                    }
                )+
            }
        }
    };
}

flags! {
    CoSimulation {
        needs_execution_tool: "needsExecutionTool", "needsExecutionTool";
        can_handle_variable_communication_step_size:
            "canHandleVariableCommunicationStepSize", "canHandleVariableCommunicationStepSize";
        can_interpolate_inputs: "canInterpolateInputs", "";
        can_run_asynchronously: "canRunAsynchronuously", "";
        can_be_instantiated_only_once_per_process:
            "canBeInstantiatedOnlyOncePerProcess", "canBeInstantiatedOnlyOncePerProcess";
        can_not_use_memory_management_functions: "canNotUseMemoryManagementFunctions", "";
        can_get_and_set_fmu_state: "canGetAndSetFMUstate", "canGetAndSetFMUState";
        can_serialize_fmu_state: "canSerializeFMUstate", "canSerializeFMUState";
        provides_directional_derivative:
            "providesDirectionalDerivative", "providesDirectionalDerivatives";
        provides_adjoint_derivatives: "", "providesAdjointDerivatives";
        provides_per_element_dependencies: "", "providesPerElementDependencies";
        provides_intermediate_update: "", "providesIntermediateUpdate";
        might_return_early_from_do_step: "", "mightReturnEarlyFromDoStep";
        can_return_early_after_intermediate_update: "", "canReturnEarlyAfterIntermediateUpdate";
        has_event_mode: "", "hasEventMode";
        provides_evaluate_discrete_states: "", "providesEvaluateDiscreteStates";
    }
}

flags! {
    ModelExchange {
        needs_execution_tool: "needsExecutionTool", "needsExecutionTool";
        completed_integrator_step_not_needed: "completedIntegratorStepNotNeeded", "";
        can_be_instantiated_only_once_per_process:
            "canBeInstantiatedOnlyOncePerProcess", "canBeInstantiatedOnlyOncePerProcess";
        can_not_use_memory_management_functions: "canNotUseMemoryManagementFunctions", "";
        can_get_and_set_fmu_state: "canGetAndSetFMUstate", "canGetAndSetFMUState";
        can_serialize_fmu_state: "canSerializeFMUstate", "canSerializeFMUState";
        provides_directional_derivative:
            "providesDirectionalDerivative", "providesDirectionalDerivatives";
        provides_adjoint_derivatives: "", "providesAdjointDerivatives";
        provides_per_element_dependencies: "", "providesPerElementDependencies";
        provides_evaluate_discrete_states: "", "providesEvaluateDiscreteStates";
    }
}

flags! {
    ScheduledExecution {
        needs_execution_tool: "", "needsExecutionTool";
        can_be_instantiated_only_once_per_process: "", "canBeInstantiatedOnlyOncePerProcess";
        can_get_and_set_fmu_state: "", "canGetAndSetFMUState";
        can_serialize_fmu_state: "", "canSerializeFMUState";
        provides_directional_derivative: "", "providesDirectionalDerivatives";
        provides_adjoint_derivatives: "", "providesAdjointDerivatives";
        provides_per_element_dependencies: "", "providesPerElementDependencies";
    }
}
