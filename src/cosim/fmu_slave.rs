//! An FMU of FMI 2.0 as a slave. The only place here that knows of FMUs.

use super::slave::{
    Base, Experiment, Kind, Progress, Role, Slave, SlaveError, Unit, Value, Variable,
};
use crate::fmi::description::{
    BaseType, Causality, Initial, ModelDescription, ScalarVariable, Unknown, Variability,
};
use crate::fmi::{self, Fmu, FmuError, Instance, Step, fmu};
use std::path::Path;

/// An instance of an FMU.
#[derive(Debug)]
pub struct FmuSlave {
    instance: Instance,
    variables: Vec<Variable>,
    /// Tolerance of the description's `DefaultExperiment`.
    tolerance: Option<f64>,
}

impl FmuSlave {
    /// Opens and loads an FMU and makes an instance of it.
    ///
    /// # Errors
    /// If anything about it is wrong.
    pub fn open(path: &Path, name: &str) -> Result<Self, FmuError> {
        Self::new(&Fmu::open(path)?.load()?, name)
    }

    /// Makes an instance of a loaded FMU.
    ///
    /// # Errors
    /// If the FMU refuses.
    pub fn new(library: &fmu::Library, name: &str) -> Result<Self, FmuError> {
        let description = library.description();
        Ok(Self {
            instance: library.instantiate(name, fmi::Kind::CoSimulation)?,
            variables: variables(description),
            tolerance: description.default_experiment.and_then(|e| e.tolerance),
        })
    }
}

impl Slave for FmuSlave {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), SlaveError> {
        let tolerance = experiment.tolerance.or(self.tolerance);
        let (start, stop) = (experiment.start, experiment.stop);
        Ok(self.instance.setup_experiment(tolerance, start, stop)?)
    }

    fn enter_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.enter_initialization_mode()?)
    }

    fn exit_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.exit_initialization_mode()?)
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError> {
        Ok(self.instance.set_real(handles, values)?)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError> {
        Ok(self.instance.get_real(handles, values)?)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError> {
        let instance = &mut self.instance;
        let set = match value {
            Value::Real(value) => instance.set_real(&[handle], &[*value]),
            Value::Integer(value) => instance.set_integer(handle, *value),
            Value::Boolean(value) => instance.set_boolean(handle, *value),
            Value::String(value) => instance.set_string(handle, value),
        };
        Ok(set?)
    }

    fn get(&mut self, handle: u32, kind: Kind) -> Result<Value, SlaveError> {
        Ok(match kind {
            Kind::Real => {
                let mut value = [0.0];
                self.instance.get_real(&[handle], &mut value)?;
                Value::Real(value[0])
            }
            Kind::Integer | Kind::Enumeration => Value::Integer(self.instance.get_integer(handle)?),
            Kind::Boolean => Value::Boolean(self.instance.get_boolean(handle)?),
            Kind::String => Value::String(self.instance.get_string(handle)?),
        })
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, SlaveError> {
        Ok(match self.instance.do_step(t, h)? {
            Step::Done => Progress::Done,
            Step::Discarded {
                last_successful,
                is_end_requested,
            } => {
                let reached = last_successful.unwrap_or(t);
                match is_end_requested {
                    true => Progress::EndRequested { reached },
                    false => Progress::Discarded { reached },
                }
            }
            Step::Stopped {
                reached,
                is_end_requested: true,
                ..
            } => Progress::EndRequested { reached },
            // Neither early return nor event mode was allowed.
            Step::Stopped { .. } => Progress::Done,
        })
    }

    fn terminate(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.terminate()?)
    }
}

/// The description's variables as the master sees them.
fn variables(description: &ModelDescription) -> Vec<Variable> {
    let all = description.variables.iter().enumerate();
    let is_input = |(_, v): &(usize, &ScalarVariable)| v.causality == Causality::Input;
    let inputs: Vec<usize> = all.clone().filter(is_input).map(|(i, _)| i).collect();
    all.map(|(position, variable)| {
        let is_output = variable.causality == Causality::Output;
        let structure = &description.structure;
        let find = |list: &[Unknown]| {
            list.iter()
                .find(|u| u.index as usize == position + 1)
                .cloned()
        };
        let (mut feedthrough, mut initial_feedthrough) = (Vec::new(), Vec::new());
        if is_output {
            feedthrough = fed_by(find(&structure.outputs), &inputs);
            // An output with initial exact has its start value; it depends on nothing.
            if variable.effective_initial() != Some(Initial::Exact) {
                initial_feedthrough = fed_by(find(&structure.initial_unknowns), &inputs);
            }
        }
        Variable {
            name: variable.name.clone(),
            handle: variable.value_reference,
            kind: kind(variable),
            role: role(variable),
            settable: is_settable(variable),
            unit: unit(description, variable),
            feedthrough,
            initial_feedthrough,
        }
    })
    .collect()
}

/// The inputs among an unknown's dependencies: all of them if it is not listed or says nothing.
fn fed_by(unknown: Option<Unknown>, inputs: &[usize]) -> Vec<usize> {
    match unknown.and_then(|u| u.dependencies) {
        None => inputs.to_vec(),
        Some(listed) => {
            let is_listed = |&&input: &&usize| listed.contains(&(input as u32 + 1));
            inputs.iter().filter(is_listed).copied().collect()
        }
    }
}

fn kind(variable: &ScalarVariable) -> Kind {
    match variable.kind.base_type() {
        BaseType::Real(_) => Kind::Real,
        BaseType::Integer(_) => Kind::Integer,
        BaseType::Boolean | BaseType::Clock => Kind::Boolean,
        BaseType::String | BaseType::Binary => Kind::String,
        BaseType::Enumeration => Kind::Enumeration,
    }
}

fn role(variable: &ScalarVariable) -> Role {
    match variable.causality {
        Causality::Parameter => Role::Parameter,
        Causality::Input => Role::Input,
        Causality::Output => Role::Output,
        Causality::CalculatedParameter
        | Causality::Local
        | Causality::Independent
        | Causality::StructuralParameter => Role::Local,
    }
}

/// Whether `fmi2SetXXX` is allowed before initialization ends (FMI 2.0, section 4.2.4, the table's
/// footnotes).
fn is_settable(variable: &ScalarVariable) -> bool {
    let has_start = matches!(
        variable.effective_initial(),
        Some(Initial::Exact | Initial::Approx)
    );
    variable.causality == Causality::Input
        || (has_start && variable.variability != Variability::Constant)
}

fn unit(description: &ModelDescription, variable: &ScalarVariable) -> Option<Unit> {
    let name = description.unit_of(variable)?;
    let defined = description.units.iter().find(|u| u.name == name);
    let base = defined.and_then(|u| u.base).map(|base| Base {
        exponents: base.exponents().map(|(_, exponent)| exponent),
        factor: base.factor,
        offset: base.offset,
    });
    Some(Unit {
        name: name.to_owned(),
        base,
    })
}
