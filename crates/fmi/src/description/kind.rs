//! Base types of variables and their attributes.

use super::{FmiVersion, IntegerType, IntervalVariability, Precision};

/// A base type; an enumeration is an integer with names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum BaseType {
    /// `fmi2Real`; `fmi3Float64` and `fmi3Float32`.
    Real(Precision),
    /// `fmi2Integer`; `fmi3Int8` to `fmi3UInt64`.
    Integer(IntegerType),
    /// `fmi2Boolean`, `fmi3Boolean`.
    Boolean,
    /// `fmi2String`, `fmi3String`.
    String,
    /// `fmi3Binary`.
    Binary,
    /// `fmi2Integer` or `fmi3Int64` with names.
    Enumeration,
    /// `fmi3Clock`.
    Clock,
}

impl BaseType {
    /// Name of the XML element, for example `Real` in FMI 2.0 and `Float64` in FMI 3.0.
    pub fn name(self, version: FmiVersion) -> &'static str {
        match (self, version) {
            (Self::Real(_), FmiVersion::V2) => "Real",
            (Self::Integer(_), FmiVersion::V2) => "Integer",
            (Self::Real(precision), FmiVersion::V3) => precision.as_str(),
            (Self::Integer(integer), FmiVersion::V3) => integer.as_str(),
            (Self::Boolean, _) => "Boolean",
            (Self::String, _) => "String",
            (Self::Binary, _) => "Binary",
            (Self::Enumeration, _) => "Enumeration",
            (Self::Clock, _) => "Clock",
        }
    }

    /// Whether it is a floating-point type.
    pub fn is_real(self) -> bool {
        matches!(self, Self::Real(_))
    }
}

/// Base type of a variable, with its attributes and start values.
///
/// `start` lists the start values: empty if there is none, one for a scalar, and for an array of FMI 3.0 one for all of
/// its elements or one for each.
#[derive(Debug, Clone, PartialEq)]
pub enum VariableKind {
    /// `<Real>`; `<Float64>` and `<Float32>`.
    Real(RealVariable),
    /// `<Integer>`; `<Int8>` to `<UInt64>`.
    Integer {
        /// Size and sign.
        integer: IntegerType,
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Quantity and limits.
        attributes: IntegerAttributes,
        /// Start values.
        start: Vec<i128>,
    },
    /// `<Boolean>`.
    Boolean {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Start values.
        start: Vec<bool>,
    },
    /// `<String>`.
    String {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Start values.
        start: Vec<String>,
    },
    /// `<Binary>` of FMI 3.0.
    Binary {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Kind and size of the data.
        attributes: BinaryAttributes,
        /// Start values.
        start: Vec<Vec<u8>>,
    },
    /// `<Enumeration>`.
    Enumeration {
        /// Name of a type definition; the schema requires it.
        declared_type: String,
        /// Quantity and limits.
        attributes: IntegerAttributes,
        /// Start values.
        start: Vec<i128>,
    },
    /// `<Clock>` of FMI 3.0.
    Clock {
        /// Name of a type definition.
        declared_type: Option<String>,
        /// Its ticks.
        attributes: ClockAttributes,
    },
}

impl VariableKind {
    /// A real with a unit (empty for none) and an optional start value.
    pub fn real(unit: &str, start: Option<f64>) -> Self {
        Self::Real(RealVariable {
            attributes: RealAttributes {
                unit: (!unit.is_empty()).then(|| unit.to_owned()),
                ..RealAttributes::default()
            },
            start: start.into_iter().collect(),
            ..RealVariable::default()
        })
    }

    /// The base type.
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real(real) => BaseType::Real(real.precision),
            Self::Integer { integer, .. } => BaseType::Integer(*integer),
            Self::Boolean { .. } => BaseType::Boolean,
            Self::String { .. } => BaseType::String,
            Self::Binary { .. } => BaseType::Binary,
            Self::Enumeration { .. } => BaseType::Enumeration,
            Self::Clock { .. } => BaseType::Clock,
        }
    }

    /// Name of the type definition, if any.
    pub fn declared_type(&self) -> Option<&str> {
        match self {
            Self::Real(RealVariable { declared_type, .. })
            | Self::Integer { declared_type, .. }
            | Self::Boolean { declared_type, .. }
            | Self::String { declared_type, .. }
            | Self::Binary { declared_type, .. }
            | Self::Clock { declared_type, .. } => declared_type.as_deref(),
            Self::Enumeration { declared_type, .. } => Some(declared_type),
        }
    }

    /// Number of start values.
    pub fn start_count(&self) -> usize {
        match self {
            Self::Real(real) => real.start.len(),
            Self::Integer { start, .. } | Self::Enumeration { start, .. } => start.len(),
            Self::Boolean { start, .. } => start.len(),
            Self::String { start, .. } => start.len(),
            Self::Binary { start, .. } => start.len(),
            Self::Clock { .. } => 0,
        }
    }

    /// Whether there is a start value.
    pub fn has_start(&self) -> bool {
        self.start_count() > 0
    }
}

/// Attributes common to a floating-point variable and its type definition.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RealAttributes {
    /// Physical quantity, for example `Length`.
    pub quantity: Option<String>,
    /// Unit of all values here.
    pub unit: Option<String>,
    /// Unit for displaying values.
    pub display_unit: Option<String>,
    /// The display unit's offset does not apply; default `false`.
    pub relative_quantity: Option<bool>,
    /// Minimum.
    pub min: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// The variable may grow without bound; default `false`.
    pub unbounded: Option<bool>,
}

/// A floating-point variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RealVariable {
    /// Size of its values. `Float32` values are stored as `f64`, which represents them exactly.
    pub precision: Precision,
    /// Name of a type definition, which supplies absent attributes.
    pub declared_type: Option<String>,
    /// Quantity, units and limits.
    pub attributes: RealAttributes,
    /// Start values, in `unit`.
    pub start: Vec<f64>,
    /// Index (from 1) of the variable whose time derivative this is.
    pub derivative: Option<u32>,
    /// Model Exchange: the state may be set at events; default `false`.
    pub reinit: bool,
}

/// Attributes common to an integer variable, an enumeration and their type definitions.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct IntegerAttributes {
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Minimum.
    pub min: Option<i128>,
    /// Maximum.
    pub max: Option<i128>,
}

/// Attributes common to `<Binary>` and `<BinaryType>`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BinaryAttributes {
    /// MIME type of the data; default `application/octet-stream`.
    pub mime_type: Option<String>,
    /// Maximum size \[bytes\].
    pub max_size: Option<u64>,
}

/// Attributes common to `<Clock>` and `<ClockType>` (FMI 3.0, section 2.4.4). Times are in the unit of the independent
/// variable.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockAttributes {
    /// The importer may deactivate it.
    pub can_be_deactivated: bool,
    /// Scheduled Execution: smaller values have priority.
    pub priority: Option<u32>,
    /// How its interval is determined.
    pub interval_variability: IntervalVariability,
    /// Interval of a periodic clock.
    pub interval_decimal: Option<f32>,
    /// Time of the first tick of a periodic clock after the start.
    pub shift_decimal: f32,
    /// `fmi3GetIntervalFraction` and the like may be called.
    pub supports_fraction: bool,
    /// Fraction of a time unit that the counters count: 1/`resolution`.
    pub resolution: Option<u64>,
    /// Interval of a periodic clock, in such fractions.
    pub interval_counter: Option<u64>,
    /// Time of the first tick of a periodic clock after the start, in such fractions.
    pub shift_counter: u64,
}

impl ClockAttributes {
    /// A clock with no optional attribute.
    pub fn new(interval_variability: IntervalVariability) -> Self {
        Self {
            can_be_deactivated: false,
            priority: None,
            interval_variability,
            interval_decimal: None,
            shift_decimal: 0.0,
            supports_fraction: false,
            resolution: None,
            interval_counter: None,
            shift_counter: 0,
        }
    }
}
