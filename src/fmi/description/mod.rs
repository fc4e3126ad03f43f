//! modelDescription.xml of FMI 2.0 (section 2.2 and 4.3.1): typed, for Model Exchange and
//! Co-Simulation, of any tool.
//!
//! A description that this project writes reads back as the same value, field by field.

mod element;
mod enums;
mod finding;
mod model;
mod read;
mod read_types;
mod read_variable;
mod reading;
mod structure;
mod text;
mod units;
mod validate;
mod variable;
mod write;
mod xml;

pub use enums::{Causality, DependencyKind, Initial, NamingConvention, Variability};
pub use finding::{Finding, Rule, Severity};
pub use model::{
    CoSimulation, DefaultExperiment, LogCategory, ModelDescription, ModelExchange, Tool,
};
pub use read::read;
pub use reading::{Places, ReadError, Reading};
pub use structure::{ModelStructure, Unknown};
pub use text::Place;
pub use units::{BaseUnit, DisplayUnit, EnumerationItem, SimpleType, TypeKind, Unit};
pub use validate::validate;
pub use variable::{
    BaseType, IntegerAttributes, RealAttributes, RealVariable, ScalarVariable, VariableKind,
};
