//! Values before the first step: those of the description, and readable.

use super::subject::{Subject, is_double};
use super::{Stop, Teller};
use crate::fmi::CallError;
use crate::fmi::description::{BaseType, Causality, Initial, ScalarVariable, VariableKind};

/// Relative difference up to which a start value is the description's: some tools print few digits.
const START_TOLERANCE: f64 = 1e-6;

/// A value reference that an FMU is unlikely to have.
const UNKNOWN: u32 = 0xffff_fff0;

impl Teller<'_> {
    /// In initialization mode, parameters, inputs and exact values are what the description says.
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
                let what = format!(
                    "`{name}` starts with {} in the binary and with {start} in the description",
                    found[0]
                );
                self.find(what, true, Some(name));
            }
        }
        Ok(())
    }

    /// Every variable can be read, and what is no variable cannot.
    pub(super) fn read_all(&mut self, subject: &mut Subject) -> Result<(), Stop> {
        let description = subject.description.clone();
        for variable in (description.variables.iter()).filter(|v| v.dimensions.is_empty()) {
            let Err(error) = read(subject, variable) else {
                continue;
            };
            let name = &variable.name;
            self.find(
                format!("`{name}` cannot be read: {error}"),
                true,
                Some(name),
            );
            // After an error nothing else can be done with the instance; a call that was not made
            // did no harm.
            if matches!(error, CallError::Failed { .. }) {
                return Err(Stop::Told);
            }
        }
        Ok(())
    }

    /// A value reference that no variable has is refused. The instance is in error afterwards.
    pub(super) fn unknown_reference(&mut self, subject: &mut Subject) {
        let variables = &subject.description.variables;
        if variables.iter().any(|v| v.value_reference == UNKNOWN) {
            return;
        }
        self.stage("reading a variable that does not exist");
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
    match variable.kind.base_type() {
        BaseType::Real(_) if is_double(variable) => instance.get_real(&[reference], &mut [0.0]),
        BaseType::Boolean => instance.get_boolean(reference).map(|_| ()),
        BaseType::String => instance.get_string(reference).map(|_| ()),
        BaseType::Integer(crate::fmi::description::IntegerType::Int32) => {
            instance.get_integer(reference).map(|_| ())
        }
        _ => Ok(()),
    }
}
