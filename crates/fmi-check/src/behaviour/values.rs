//! Checks of values before the first step: agreement with the description, and readability.

use super::subject::{Subject, is_double};
use super::{Reporter, Stop};
use crate::validate::shown;
use pilotage_fmi::description::{
    BaseType, Causality, FmiVersion, Initial, IntegerType, Precision, ScalarVariable, Severity,
    TypeKind, VariableKind,
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
        for variable in description.variables.iter().filter(|v| is_double(v)) {
            let VariableKind::Real(real) = &variable.kind else {
                continue;
            };
            let is_exact = variable.effective_initial() == Some(Initial::Exact)
                || variable.causality == Causality::Input;
            let Some(&start) = real.start.first().filter(|_| is_exact) else {
                continue;
            };
            let mut found = [f64::NAN];
            subject
                .instance
                .get_real(&[variable.value_reference], &mut found)?;
            let difference = (found[0] - start).abs();
            let is_same = found[0] == start || difference <= START_TOLERANCE * start.abs();
            if !is_same {
                let name = &variable.name;
                let [found, start] = [found[0], start].map(|value| shown(Precision::Double, value));
                let what = format!(
                    "`{name}` starts with {found} in the binary and with {start} in the description"
                );
                self.find(what, Severity::Error, Some(name));
            }
        }
        Ok(())
    }

    /// Every variable can be read, and enumerations have values of their items.
    pub(super) fn read_all(&mut self, subject: &mut Subject) -> Result<(), Stop> {
        let description = subject.description.clone();
        for variable in (description.variables.iter()).filter(|v| v.dimensions.is_empty()) {
            let name = &variable.name;
            let value = read(subject, variable).and_then(|()| item(subject, variable));
            let error = match value {
                Ok(value) => {
                    let declared = variable.kind.declared_type();
                    let items = (description.types.iter())
                        .filter(|t| Some(t.name.as_str()) == declared)
                        .find_map(|t| match &t.kind {
                            TypeKind::Enumeration { items, .. } => Some(items),
                            _ => None,
                        });
                    let is_no_item =
                        |value: &i64| items.is_some_and(|i| i.iter().all(|i| i.value != *value));
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

/// Reads a scalar of any type.
fn read(subject: &mut Subject, variable: &ScalarVariable) -> Result<(), CallError> {
    let instance = &mut subject.instance;
    let reference = variable.value_reference;
    /// Reads one value, which is not used.
    fn number<T: Number>(instance: &mut Instance, reference: u32) -> Result<(), CallError> {
        instance.get(&[reference], &mut [T::default()])
    }
    let read = match variable.kind.base_type() {
        BaseType::Real(Precision::Double) => number::<f64>,
        BaseType::Real(Precision::Single) => number::<f32>,
        BaseType::Boolean => |i: &mut Instance, r| i.get_boolean(r).map(|_| ()),
        BaseType::String => |i: &mut Instance, r| i.get_string(r).map(|_| ()),
        BaseType::Integer(integer) => match integer {
            IntegerType::Int8 => number::<i8>,
            IntegerType::UInt8 => number::<u8>,
            IntegerType::Int16 => number::<i16>,
            IntegerType::UInt16 => number::<u16>,
            IntegerType::Int32 => number::<i32>,
            IntegerType::UInt32 => number::<u32>,
            IntegerType::Int64 => number::<i64>,
            IntegerType::UInt64 => number::<u64>,
        },
        // Enumerations are read by [`item`], binaries have any length, and clocks are read at events.
        BaseType::Enumeration | BaseType::Binary | BaseType::Clock => return Ok(()),
    };
    read(instance, reference)
}

/// The value of an enumeration; `None` for other types.
fn item(subject: &mut Subject, variable: &ScalarVariable) -> Result<Option<i64>, CallError> {
    let instance = &mut subject.instance;
    let reference = [variable.value_reference];
    if variable.kind.base_type() != BaseType::Enumeration {
        return Ok(None);
    }
    match instance.version() {
        FmiVersion::V2 => {
            let mut value = [0_i32];
            instance.get(&reference, &mut value)?;
            Ok(Some(value[0].into()))
        }
        FmiVersion::V3 => {
            let mut value = [0_i64];
            instance.get(&reference, &mut value)?;
            Ok(Some(value[0]))
        }
    }
}
