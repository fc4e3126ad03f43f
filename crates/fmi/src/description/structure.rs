//! Unknowns and their dependencies.

use super::DependencyKind;

/// `<ModelStructure>` (FMI 2.0, section 2.2.8; FMI 3.0, section 2.4.8).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelStructure {
    /// All variables of causality output.
    pub outputs: Vec<Unknown>,
    /// Derivatives of the continuous states.
    pub derivatives: Vec<Unknown>,
    /// FMI 3.0: states that change at ticks of their clocks.
    pub clocked_states: Vec<Unknown>,
    /// Variables computed at initialization.
    pub initial_unknowns: Vec<Unknown>,
    /// FMI 3.0: event indicators (Model Exchange).
    pub event_indicators: Vec<Unknown>,
}

/// One unknown and its dependencies.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Unknown {
    /// Index of the variable in `ModelVariables`, from 1. The XML of FMI 3.0 has its value reference instead; 0 stands
    /// for a reference without variable.
    pub index: u32,
    /// Indices (from 1) of the knowns that it depends on. `None`: not declared, so it depends on all. Empty: it depends
    /// on none.
    pub dependencies: Option<Vec<u32>>,
    /// Kind of each dependency.
    pub dependencies_kind: Option<Vec<DependencyKind>>,
}
