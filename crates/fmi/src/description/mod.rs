//! modelDescription.xml of FMI 2.0 (sections 2.2, 3.3.1 and 4.3.1) and of FMI 3.0 (sections 2.4, 3.4, 4.4 and 5.4):
//! typed, for every interface type and for files of any tool. One type serves both versions.
//!
//! A description written by this project reads back as the same value, field by field.

mod enums;
mod finding;
mod interface;
mod kind;
mod model;
mod read;
mod reading;
mod rule;
mod structure;
mod text;
mod units;
mod variable;
mod write;

pub use enums::{
    Causality, DependencyKind, FmiVersion, Initial, IntegerType, IntervalVariability,
    NamingConvention, Precision, Variability,
};
pub use finding::{Finding, Severity};
pub use interface::{CoSimulation, ModelExchange, ScheduledExecution};
pub use kind::{
    BaseType, BinaryAttributes, ClockAttributes, IntegerAttributes, RealAttributes, RealVariable,
    VariableKind,
};
pub use model::{DefaultExperiment, LogCategory, ModelDescription, Tool};
pub use read::read;
pub use read::{build, terminals, text_of};
pub use reading::{Places, ReadError, Reading};
pub use rule::{Handle, Rule};
pub use structure::{ModelStructure, Unknown};
pub use text::{LineIndex, Place};
pub use units::{BaseUnit, DisplayUnit, EnumerationItem, SimpleType, TypeKind, Unit};
pub use write::Xml;

/// Whether XML can be parsed in time proportional to its size.
pub fn is_within_limits(text: &str) -> bool {
    read::limits::check(text).is_ok()
}
pub use variable::{Alias, Dimension, ScalarVariable};
