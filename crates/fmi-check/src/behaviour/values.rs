//! Checks of values before the first step: agreement with the description, and readability.

use super::subject::{Subject, is_double};
use super::{Reporter, Stop};
use crate::validate::shown;
use pilotage_fmi::description::{
    BaseType, Causality, FmiVersion, Initial, IntegerType, Precision, ScalarVariable, Severity,
    TypeKind, Variability, VariableKind,
};
use pilotage_fmi::instance::Number;
use pilotage_fmi::{CallError, Instance};

/// Relative tolerance for start values: some tools write few digits.
const START_TOLERANCE: f64 = 1e-6;

/// The stage in which a variable that does not exist is read.
pub(super) const BEYOND: &str = "reading a variable that does not exist";

/// A value reference that is unlikely to exist in an FMU.
const UNKNOWN: u32 = 0xffff_fff0;

impl Reporter<'_> {
    /// In initialization mode, parameters, inputs and exact values have the start values of the description.
    pub(super) fn start_values(&mut self, subject: &mut Subject) -> Result<(), Stop> {
        self.stage("reading the start values");
        let description = subject.description.clone();
        for variable in (description.variables.iter()).filter(|v| v.dimensions.is_empty()) {
            let is_exact = variable.effective_initial() == Some(Initial::Exact)
                || variable.causality == Causality::Input;
            let Some(start) = start_of(&variable.kind).filter(|_| is_exact) else {
                continue;
            };
            let found = match read(subject, variable) {
                // Text, binaries and clocks.
                Ok(None) => continue,
                Ok(Some(found)) => found,
                Err(error @ CallError::Failed { .. }) => return Err(error.into()),
                // It cannot be read at all, which is reported where all are read.
                Err(_) => continue,
            };
            let is_same = found == start || (found - start).abs() <= START_TOLERANCE * start.abs();
            if !is_same {
                let name = &variable.name;
                let precision = match is_double(variable) {
                    true => Precision::Double,
                    false => Precision::Single,
                };
                let [found, start] = match &variable.kind {
                    VariableKind::Real(_) => [found, start].map(|value| shown(precision, value)),
                    VariableKind::Boolean { .. } => {
                        [found, start].map(|value| (value != 0.0).to_string())
                    }
                    _ => [found, start].map(|value| value.to_string()),
                };
                let what = format!(
                    "`{name}` starts with {found} in the binary and with {start} in the description"
                );
                self.find(what, Severity::Error, Some(name));
            }
        }
        Ok(())
    }

    /// The values of what does not change after initialization: constant and fixed variables, and inputs, which the importer
    /// alone sets. Indices and values.
    pub(super) fn held(&mut self, subject: &mut Subject) -> Result<Vec<(usize, f64)>, Stop> {
        let description = subject.description.clone();
        let mut held = Vec::new();
        for (index, variable) in description.variables.iter().enumerate() {
            let is_held = matches!(
                variable.variability,
                Variability::Constant | Variability::Fixed
            );
            if variable.dimensions.is_empty() && (is_held || variable.causality == Causality::Input)
            {
                let value = read(subject, variable)?;
                held.extend(value.map(|value| (index, value)));
            }
        }
        Ok(held)
    }

    /// Compares them after the steps (FMI 2.0.5, section 2.2.7; FMI 3.0, section 2.4.7.4).
    pub(super) fn compare_held(
        &mut self,
        subject: &mut Subject,
        before: &[(usize, f64)],
    ) -> Result<(), Stop> {
        self.stage("reading what does not change");
        let after = self.held(subject)?;
        for ((index, before), (_, after)) in before.iter().zip(&after) {
            if before == after || before.is_nan() && after.is_nan() {
                continue;
            }
            let variable = &self.description.variables[*index];
            let (name, what) = (
                variable.name.clone(),
                match variable.causality {
                    Causality::Input => "an input that nobody has set again",
                    _ => match variable.variability {
                        Variability::Constant => "constant",
                        _ => "fixed",
                    },
                },
            );
            let what =
                format!("`{name}` is {what}, and goes from {before} to {after} in the steps");
            self.find(what, Severity::Warning, Some(&name));
        }
        Ok(())
    }

    /// Every variable can be read, and enumerations have values of their items.
    pub(super) fn read_all(&mut self, subject: &mut Subject) -> Result<(), Stop> {
        let description = subject.description.clone();
        for variable in (description.variables.iter()).filter(|v| v.dimensions.is_empty()) {
            let name = &variable.name;
            let error = match read(subject, variable) {
                Ok(value) => {
                    let declared = variable.kind.declared_type();
                    let items = (description.types.iter())
                        .filter(|t| Some(t.name.as_str()) == declared)
                        .find_map(|t| match &t.kind {
                            TypeKind::Enumeration { items, .. } => Some(items),
                            _ => None,
                        });
                    let is_no_item = |value: &f64| {
                        items.is_some_and(|all| all.iter().all(|own| own.value as f64 != *value))
                    };
                    if let Some(value) = value.filter(is_no_item) {
                        let what = format!("`{name}` is {value}, which is no item of its type");
                        self.find(what, Severity::Error, Some(name));
                    }
                    continue;
                }
                Err(error) => error,
            };
            self.find(
                format!("`{name}` cannot be read: {error}"),
                Severity::Error,
                Some(name),
            );
            // After an error the instance cannot be used further; a call that was not made did no harm.
            if matches!(error, CallError::Failed { .. }) {
                return Err(Stop::Reported);
            }
        }
        Ok(())
    }

    /// A value reference without variable is rejected. The instance is in the error state afterwards.
    pub(super) fn unknown_reference(&mut self, subject: &mut Subject) {
        let variables = &subject.description.variables;
        if variables.iter().any(|v| v.value_reference == UNKNOWN) {
            return;
        }
        self.stage(BEYOND);
        if subject.instance.get_real(&[UNKNOWN], &mut [0.0]).is_ok() {
            self.warn(format!(
                "it gives a value for the value reference {UNKNOWN}, which no variable has"
            ));
        }
    }
}

/// The start value of a scalar as a number; `None` of text, binaries and clocks, or without one.
fn start_of(kind: &VariableKind) -> Option<f64> {
    match kind {
        VariableKind::Real(real) => real.start.first().copied(),
        VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => {
            start.first().map(|value| *value as f64)
        }
        VariableKind::Boolean { start, .. } => start.first().map(|value| f64::from(*value)),
        _ => None,
    }
}

/// Reads a scalar of any type, as a number; `None` of text, binaries and clocks.
fn read(subject: &mut Subject, variable: &ScalarVariable) -> Result<Option<f64>, CallError> {
    fn number<T: Number + Into<f64>>(
        instance: &mut Instance,
        reference: u32,
    ) -> Result<f64, CallError> {
        let mut value = [T::default()];
        instance.get(&[reference], &mut value)?;
        Ok(value[0].into())
    }
    fn wide<T: Number + Into<i128>>(
        instance: &mut Instance,
        reference: u32,
    ) -> Result<f64, CallError> {
        let mut value = [T::default()];
        instance.get(&[reference], &mut value)?;
        Ok(value[0].into() as f64)
    }
    let instance = &mut subject.instance;
    let reference = variable.value_reference;
    let read = match variable.kind.base_type() {
        BaseType::Real(Precision::Double) => number::<f64>,
        BaseType::Real(Precision::Single) => number::<f32>,
        BaseType::Boolean => |i: &mut Instance, r| i.get_boolean(r).map(f64::from),
        BaseType::String => return instance.get_string(reference).map(|_| None),
        BaseType::Integer(integer) => match integer {
            IntegerType::Int8 => number::<i8>,
            IntegerType::UInt8 => number::<u8>,
            IntegerType::Int16 => number::<i16>,
            IntegerType::UInt16 => number::<u16>,
            IntegerType::Int32 => number::<i32>,
            IntegerType::UInt32 => number::<u32>,
            IntegerType::Int64 => wide::<i64>,
            IntegerType::UInt64 => wide::<u64>,
        },
        BaseType::Enumeration => match instance.version() {
            FmiVersion::V2 => number::<i32>,
            FmiVersion::V3 => wide::<i64>,
        },
        // Binaries have any length, and clocks are read at events.
        BaseType::Binary | BaseType::Clock => return Ok(None),
    };
    read(instance, reference).map(Some)
}
