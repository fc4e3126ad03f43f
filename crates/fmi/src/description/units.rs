//! Units and named types.

use super::{
    BaseType, BinaryAttributes, ClockAttributes, IntegerAttributes, IntegerType, Precision,
    RealAttributes,
};

/// Meaning of a [`Unit`] (FMI 2.0, section 2.2.2): exponents of the base units, factor, offset.
pub use pilotage_units::Base as BaseUnit;

/// A unit (FMI 2.0, section 2.2.2; FMI 3.0, section 2.4.3).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Unit {
    /// Name used by variables, for example `m/s`.
    pub name: String,
    /// Its meaning in SI base units.
    pub base: Option<BaseUnit>,
    /// Units for displaying values.
    pub display_units: Vec<DisplayUnit>,
}

/// A unit for displaying values: `displayed = factor·value + offset`, or `factor/value` if inverse.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: String,
    /// Factor from the unit to the display unit.
    pub factor: f64,
    /// Offset from the unit to the display unit.
    pub offset: f64,
    /// FMI 3.0: the reciprocal is displayed.
    pub inverse: bool,
}

/// A named type that variables may refer to by `declaredType` (FMI 2.0, section 2.2.3; FMI 3.0,
/// section 2.4.4).
#[derive(Debug, Clone, PartialEq)]
pub struct SimpleType {
    /// Name, different from the names of all variables.
    pub name: String,
    /// One-line description.
    pub description: Option<String>,
    /// Base type with its attributes.
    pub kind: TypeKind,
}

/// Base type of a [`SimpleType`].
#[derive(Debug, Clone, PartialEq)]
pub enum TypeKind {
    /// Floating point.
    Real {
        /// Size of its values.
        precision: Precision,
        /// Quantity, units and limits.
        attributes: RealAttributes,
    },
    /// Integer.
    Integer {
        /// Size and sign.
        integer: IntegerType,
        /// Quantity and limits.
        attributes: IntegerAttributes,
    },
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// FMI 3.0: bytes.
    Binary(BinaryAttributes),
    /// Integer with names for its values.
    Enumeration {
        /// Quantity; limits in FMI 3.0 only.
        attributes: IntegerAttributes,
        /// The values.
        items: Vec<EnumerationItem>,
    },
    /// FMI 3.0: clock.
    Clock(ClockAttributes),
}

impl TypeKind {
    /// The base type.
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real { precision, .. } => BaseType::Real(*precision),
            Self::Integer { integer, .. } => BaseType::Integer(*integer),
            Self::Boolean => BaseType::Boolean,
            Self::String => BaseType::String,
            Self::Binary(_) => BaseType::Binary,
            Self::Enumeration { .. } => BaseType::Enumeration,
            Self::Clock(_) => BaseType::Clock,
        }
    }
}

/// One value of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnumerationItem {
    /// Name of the value.
    pub name: String,
    /// The value: 32 bits in FMI 2.0, 64 in FMI 3.0.
    pub value: i64,
    /// What it means.
    pub description: Option<String>,
}
