//! Variables.

use super::{Causality, Initial, Tool, Variability, VariableKind};

/// A variable (FMI 2.0, section 2.2.7; FMI 3.0, section 2.4.7); in FMI 3.0 it may be an array.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarVariable {
    /// Full, unique name.
    pub name: String,
    /// Handle of the value in calls. In FMI 2.0 aliases of the same base type may share it; in FMI 3.0 it is unique.
    pub value_reference: u32,
    /// One-line description.
    pub description: Option<String>,
    /// Role of the variable.
    pub causality: Causality,
    /// How it may change over time.
    pub variability: Variability,
    /// As written; [`effective_initial`](Self::effective_initial) applies the default.
    pub initial: Option<Initial>,
    /// Inputs: may be set several times at one instant.
    pub can_handle_multiple_set_per_time_instant: Option<bool>,
    /// FMI 3.0: indices (from 1) of the clocks at whose ticks it changes; empty if it is not clocked.
    pub clocks: Vec<u32>,
    /// FMI 3.0: accessible in intermediate update mode.
    pub intermediate_update: bool,
    /// FMI 3.0: index (from 1) of the variable that holds its value at the previous tick.
    pub previous: Option<u32>,
    /// FMI 3.0: sizes of the array; empty for a scalar.
    pub dimensions: Vec<Dimension>,
    /// FMI 3.0: aliases.
    pub aliases: Vec<Alias>,
    /// Base type with its attributes and start value.
    pub kind: VariableKind,
    /// Annotations of tools.
    pub annotations: Vec<Tool>,
}

/// Size of one dimension of an array (FMI 3.0, section 2.4.7.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// Constant size.
    Fixed(u64),
    /// The value of the variable with that index (from 1): a structural parameter or a constant.
    Variable(u32),
}

/// An alias of a variable (FMI 3.0, section 2.4.7.3).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Alias {
    /// Unique name.
    pub name: String,
    /// One-line description.
    pub description: Option<String>,
    /// Floating-point variables: unit for displaying values under this name.
    pub display_unit: Option<String>,
}

impl ScalarVariable {
    /// A variable with no optional attribute.
    pub fn new(
        name: impl Into<String>,
        value_reference: u32,
        causality: Causality,
        variability: Variability,
        kind: VariableKind,
    ) -> Self {
        Self {
            name: name.into(),
            value_reference,
            description: None,
            causality,
            variability,
            initial: None,
            can_handle_multiple_set_per_time_instant: None,
            clocks: Vec::new(),
            intermediate_update: false,
            previous: None,
            dimensions: Vec::new(),
            aliases: Vec::new(),
            kind,
            annotations: Vec::new(),
        }
    }

    /// Whether `fmi2SetXXX` is allowed before initialization ends (FMI 2.0, section 4.2.4, the table's footnotes).
    pub fn is_settable(&self) -> bool {
        let has_start = matches!(
            self.effective_initial(),
            Some(Initial::Exact | Initial::Approx)
        );
        self.causality == Causality::Input
            || (has_start && self.variability != Variability::Constant)
    }

    /// `initial`, or its default for this causality and variability (FMI 2.0, section 2.2.7, table of allowed
    /// combinations; FMI 3.0, section 2.4.7.5); `None` if the attribute does not apply.
    pub fn effective_initial(&self) -> Option<Initial> {
        use Causality as C;
        use Variability as V;
        if let VariableKind::Clock { .. } = self.kind {
            return None;
        }
        self.initial.or(match (self.causality, self.variability) {
            (C::Parameter | C::StructuralParameter, _) => Some(Initial::Exact),
            (C::CalculatedParameter, _) => Some(Initial::Calculated),
            (C::Output | C::Local, V::Constant) => Some(Initial::Exact),
            (C::Output | C::Local, _) => Some(Initial::Calculated),
            (C::Input | C::Independent, _) => None,
        })
    }
}
