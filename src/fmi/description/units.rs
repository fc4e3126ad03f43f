//! Units and named types.

use super::variable::{IntegerAttributes, RealAttributes};

/// A unit (FMI 2.0, section 2.2.2).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Unit {
    /// Name as variables refer to it, for example `m/s`.
    pub name: String,
    /// Its meaning in SI base units.
    pub base: Option<BaseUnit>,
    /// Units for showing values to people.
    pub display_units: Vec<DisplayUnit>,
}

/// Exponents of the SI base units and the radian: `value in base units = factor·value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Exponent of kilogram.
    pub kg: i32,
    /// Exponent of metre.
    pub m: i32,
    /// Exponent of second.
    pub s: i32,
    /// Exponent of ampere (`A`).
    pub ampere: i32,
    /// Exponent of kelvin (`K`).
    pub kelvin: i32,
    /// Exponent of mole.
    pub mol: i32,
    /// Exponent of candela.
    pub cd: i32,
    /// Exponent of radian.
    pub rad: i32,
    /// Factor from this unit to the base units.
    pub factor: f64,
    /// Offset from this unit to the base units.
    pub offset: f64,
}

impl Default for BaseUnit {
    /// The dimensionless unit 1.
    fn default() -> Self {
        Self {
            kg: 0,
            m: 0,
            s: 0,
            ampere: 0,
            kelvin: 0,
            mol: 0,
            cd: 0,
            rad: 0,
            factor: 1.0,
            offset: 0.0,
        }
    }
}

impl BaseUnit {
    /// The exponents in the schema's order, with the attributes' names.
    pub fn exponents(&self) -> [(&'static str, i32); 8] {
        [
            ("kg", self.kg),
            ("m", self.m),
            ("s", self.s),
            ("A", self.ampere),
            ("K", self.kelvin),
            ("mol", self.mol),
            ("cd", self.cd),
            ("rad", self.rad),
        ]
    }
}

/// A unit for showing values: `displayed = factor·value + offset`.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: String,
    /// Factor from the unit to the display unit.
    pub factor: f64,
    /// Offset from the unit to the display unit.
    pub offset: f64,
}

/// A named type that variables may refer to by `declaredType` (FMI 2.0, section 2.2.3).
#[derive(Debug, Clone, PartialEq)]
pub struct SimpleType {
    /// Name, different from every variable's.
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
    Real(RealAttributes),
    /// 32-bit integer.
    Integer(IntegerAttributes),
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// Integer with names for its values.
    Enumeration {
        /// Physical quantity.
        quantity: Option<String>,
        /// The values.
        items: Vec<EnumerationItem>,
    },
}

/// One value of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnumerationItem {
    /// Name of the value.
    pub name: String,
    /// The value.
    pub value: i32,
    /// What it means.
    pub description: Option<String>,
}
