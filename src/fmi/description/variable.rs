//! Scalar variables.

use super::{Causality, Initial, Tool, Variability};

/// A `<ScalarVariable>` (FMI 2.0, section 2.2.7).
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarVariable {
    /// Full, unique name.
    pub name: String,
    /// Handle of the value in calls; may be shared by aliases of one base type.
    pub value_reference: u32,
    /// One-line description.
    pub description: Option<String>,
    /// What the variable is for.
    pub causality: Causality,
    /// How it may change in time.
    pub variability: Variability,
    /// As written; [`effective_initial`](Self::effective_initial) applies the default.
    pub initial: Option<Initial>,
    /// Model Exchange only.
    pub can_handle_multiple_set_per_time_instant: Option<bool>,
    /// Base type with its attributes and start value.
    pub kind: VariableKind,
    /// Annotations of tools.
    pub annotations: Vec<Tool>,
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
            kind,
            annotations: Vec::new(),
        }
    }

    /// `initial`, or its default for this causality and variability (FMI 2.0, section 2.2.7, the
    /// table of allowed combinations); `None` where the attribute does not apply.
    pub fn effective_initial(&self) -> Option<Initial> {
        use Causality as C;
        use Variability as V;
        self.initial.or(match (self.causality, self.variability) {
            (C::Parameter, _) => Some(Initial::Exact),
            (C::CalculatedParameter, _) => Some(Initial::Calculated),
            (C::Output | C::Local, V::Constant) => Some(Initial::Exact),
            (C::Output | C::Local, _) => Some(Initial::Calculated),
            (C::Input | C::Independent, _) => None,
        })
    }
}

/// The five base types; an enumeration is an integer with names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum BaseType {
    /// `fmi2Real`.
    Real,
    /// `fmi2Integer`.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`.
    String,
    /// `fmi2Integer` with names.
    Enumeration,
}

impl std::fmt::Display for BaseType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Real => "Real",
            Self::Integer => "Integer",
            Self::Boolean => "Boolean",
            Self::String => "String",
            Self::Enumeration => "Enumeration",
        })
    }
}

/// Base type of a variable with what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub enum VariableKind {
    /// `<Real>`.
    Real(RealVariable),
    /// `<Integer>`.
    Integer {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Quantity and limits.
        attributes: IntegerAttributes,
        /// Start value.
        start: Option<i32>,
    },
    /// `<Boolean>`.
    Boolean {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Start value.
        start: Option<bool>,
    },
    /// `<String>`.
    String {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Start value.
        start: Option<String>,
    },
    /// `<Enumeration>`.
    Enumeration {
        /// Name of a type definition; the schema requires it.
        declared_type: String,
        /// Quantity and limits.
        attributes: IntegerAttributes,
        /// Start value.
        start: Option<i32>,
    },
}

impl VariableKind {
    /// A real with a unit (empty for none) and, perhaps, a start value.
    pub fn real(unit: &str, start: Option<f64>) -> Self {
        Self::Real(RealVariable {
            attributes: RealAttributes {
                unit: (!unit.is_empty()).then(|| unit.to_owned()),
                ..RealAttributes::default()
            },
            start,
            ..RealVariable::default()
        })
    }

    /// The base type.
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real(_) => BaseType::Real,
            Self::Integer { .. } => BaseType::Integer,
            Self::Boolean { .. } => BaseType::Boolean,
            Self::String { .. } => BaseType::String,
            Self::Enumeration { .. } => BaseType::Enumeration,
        }
    }

    /// Name of the type definition that it refers to.
    pub fn declared_type(&self) -> Option<&str> {
        match self {
            Self::Real(RealVariable { declared_type, .. })
            | Self::Integer { declared_type, .. }
            | Self::Boolean { declared_type, .. }
            | Self::String { declared_type, .. } => declared_type.as_deref(),
            Self::Enumeration { declared_type, .. } => Some(declared_type),
        }
    }

    /// Whether a start value is given.
    pub fn has_start(&self) -> bool {
        match self {
            Self::Real(real) => real.start.is_some(),
            Self::Integer { start, .. } | Self::Enumeration { start, .. } => start.is_some(),
            Self::Boolean { start, .. } => start.is_some(),
            Self::String { start, .. } => start.is_some(),
        }
    }
}

/// Attributes that `<Real>` has in a variable and in a type definition.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RealAttributes {
    /// Physical quantity, for example `Length`.
    pub quantity: Option<String>,
    /// Unit of all values here.
    pub unit: Option<String>,
    /// Unit for showing values to people.
    pub display_unit: Option<String>,
    /// The display unit's offset does not apply; default `false`.
    pub relative_quantity: Option<bool>,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// The variable may grow without bound; default `false`.
    pub unbounded: Option<bool>,
}

/// `<Real>` of a variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RealVariable {
    /// Name of a type definition; what is absent here is taken from it.
    pub declared_type: Option<String>,
    /// Quantity, units and limits.
    pub attributes: RealAttributes,
    /// Start value, in `unit`.
    pub start: Option<f64>,
    /// Index (from 1) of the variable whose time derivative this is.
    pub derivative: Option<u32>,
    /// Model Exchange: the state may be set at events; default `false`.
    pub reinit: bool,
}

/// Attributes that `<Integer>` has in a variable and in a type definition, and `<Enumeration>` in a
/// variable.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct IntegerAttributes {
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Smallest value.
    pub min: Option<i32>,
    /// Largest value.
    pub max: Option<i32>,
}
