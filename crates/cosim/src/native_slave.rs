//! Models in Rust as slaves, without FMUs between. They run the same [`Simulation`] as the exported FMUs.

use super::slave::{
    Abilities, Experiment, Kind, Linear, Progress, Role, Slave, SlaveError, Unit, Value, Variable,
};
use pilotage_kit::simulation::Snapshot;
use pilotage_kit::structure::{Structure, Unknown};
use pilotage_kit::{Equations, Simulation, Table, variable};
use pilotage_linear::StateSpace;
use thiserror::Error;

/// Why a native slave refuses a call.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NativeError {
    /// A handle that is no variable's.
    #[error("there is no variable with handle {handle}")]
    NoSuchVariable {
        /// The handle.
        handle: u32,
    },
    /// Models have real variables, and modes, which are Boolean and only read.
    #[error("there is no variable of type {kind} with handle {handle}")]
    NoSuchKind {
        /// The type asked for.
        kind: Kind,
        /// The handle.
        handle: u32,
    },
    /// Nothing was saved there.
    #[error("no state is saved in place {place}")]
    NothingSaved {
        /// Number of the place.
        place: usize,
    },
    /// Only outputs have derivatives to be asked for.
    #[error("the variable with handle {handle} is no output")]
    NoOutput {
        /// The handle.
        handle: u32,
    },
}

/// A running model; a variable's handle is its index in the model's [`Table`].
#[derive(Debug)]
pub struct NativeSlave<E> {
    simulation: Simulation<E>,
    variables: Vec<Variable>,
    saved: Vec<Option<Snapshot>>,
}

impl<E: Equations> NativeSlave<E> {
    /// The model at its start values.
    pub fn new(model: E) -> Self {
        let table = model.table();
        let structure = Structure::of(&model, &table);
        let variables = table.variables().iter().zip(0..);
        Self {
            variables: variables
                .map(|(variable, handle)| seen(variable, handle, &table, &structure))
                .collect(),
            simulation: Simulation::new(model),
            saved: Vec::new(),
        }
    }

    fn output(&self, handle: u32) -> Result<usize, NativeError> {
        let index = handle as usize;
        match self.simulation.table().outputs().contains(&index) {
            true => Ok(index),
            false => Err(NativeError::NoOutput { handle }),
        }
    }

    fn get_real(&self, handle: u32) -> Result<f64, NativeError> {
        match (handle as usize) < self.variables.len() {
            true => Ok(self.simulation.get(handle as usize)),
            false => Err(NativeError::NoSuchVariable { handle }),
        }
    }
}

/// A model's variable as the master sees it.
fn seen(
    variable: &variable::Variable,
    handle: u32,
    table: &Table,
    structure: &Structure,
) -> Variable {
    let inputs = table.inputs();
    let fed_by = |unknowns: &[Unknown]| {
        let unknown = unknowns.iter().find(|u| u.index == handle as usize);
        let indices = unknown
            .iter()
            .flat_map(|u| &u.dependencies)
            .map(|d| d.index);
        indices.filter(|index| inputs.contains(index)).collect()
    };
    let role = match variable.role {
        variable::Role::Input => Role::Input,
        variable::Role::Output | variable::Role::Mode => Role::Output,
        variable::Role::Fixed | variable::Role::Tunable => Role::Parameter,
        _ => Role::Local,
    };
    let (feedthrough, initial_feedthrough) = match role {
        Role::Output => (fed_by(&structure.outputs), fed_by(&structure.initial)),
        _ => (Vec::new(), Vec::new()),
    };
    let unit = Unit {
        name: variable.unit.name.clone(),
        base: Some(variable.unit.base),
    };
    let kind = match variable.is_boolean() {
        true => Kind::Boolean,
        false => Kind::Real,
    };
    Variable {
        unit: Some(unit).filter(|_| kind == Kind::Real),
        nominal: variable.nominal.unwrap_or(1.0),
        feedthrough,
        initial_feedthrough,
        ..Variable::new(&variable.name, handle, kind, role)
    }
}

impl<E: Equations + Send> Slave for NativeSlave<E> {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), SlaveError> {
        if let Some(tolerance) = experiment.tolerance {
            self.simulation.set_tolerance(tolerance);
        }
        Ok(())
    }

    fn exit_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError> {
        for (&handle, &value) in handles.iter().zip(values) {
            self.simulation.set(handle as usize, value)?;
        }
        Ok(())
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError> {
        for (&handle, value) in handles.iter().zip(values) {
            *value = self.get_real(handle)?;
        }
        Ok(())
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError> {
        let kind = match value {
            Value::Real(value) => return self.set_reals(&[handle], &[*value]),
            Value::Integer(_) => Kind::Integer,
            Value::Boolean(_) => Kind::Boolean,
            Value::String(_) => Kind::String,
        };
        Err(NativeError::NoSuchKind { kind, handle }.into())
    }

    fn get(&mut self, handle: u32, kind: Kind) -> Result<Value, SlaveError> {
        let is_own = (self.variables.get(handle as usize)).is_some_and(|own| own.kind == kind);
        match kind {
            Kind::Real => Ok(Value::Real(self.get_real(handle)?)),
            Kind::Boolean if is_own => Ok(Value::Boolean(self.get_real(handle)? != 0.0)),
            kind => Err(NativeError::NoSuchKind { kind, handle }.into()),
        }
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, SlaveError> {
        self.simulation.step(h)?;
        Ok(Progress::Done)
    }

    /// Exact, by dual numbers.
    fn linearize(&mut self, _step: f64) -> Result<Linear, SlaveError> {
        let table = self.simulation.table();
        let unknowns: Vec<usize> = table.derivatives().chain(table.outputs()).collect();
        let knowns: Vec<usize> = table.states().chain(table.inputs()).collect();
        let named = |indices: &[usize]| -> Vec<String> {
            let variables = table.variables();
            indices.iter().map(|&i| variables[i].name.clone()).collect()
        };
        let n = table.n_states();
        let names = [
            named(&knowns[..n]),
            named(&knowns[n..]),
            named(&unknowns[n..]),
        ];
        let system = StateSpace::from_columns(names, |k| {
            let seed = [(knowns[k], 1.0)];
            Ok::<_, SlaveError>(self.simulation.directional_derivative(&unknowns, &seed))
        })?;
        Ok(system.into())
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            variable_steps: true,
            input_derivatives: true,
            output_derivatives: true,
            directional_derivatives: true,
        }
    }

    fn save(&mut self, place: usize) -> Result<(), SlaveError> {
        if self.saved.len() <= place {
            self.saved.resize(place + 1, None);
        }
        match &mut self.saved[place] {
            // `clone_from` of the derive would allocate anew.
            Some(saved) => copy(self.simulation.snapshot(), saved),
            empty => *empty = Some(self.simulation.snapshot().clone()),
        }
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), SlaveError> {
        let Some(Some(saved)) = self.saved.get(place) else {
            return Err(NativeError::NothingSaved { place }.into());
        };
        self.simulation.restore(saved);
        Ok(())
    }

    fn set_input_derivatives(&mut self, handles: &[u32], slopes: &[f64]) -> Result<(), SlaveError> {
        for (&handle, &slope) in handles.iter().zip(slopes) {
            self.simulation.set_slope(handle as usize, slope)?;
        }
        Ok(())
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), SlaveError> {
        for (&handle, slope) in handles.iter().zip(slopes) {
            *slope = self.simulation.output_derivative(self.output(handle)?);
        }
        Ok(())
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), SlaveError> {
        let outputs = outputs.iter().map(|&handle| self.output(handle));
        let outputs = outputs.collect::<Result<Vec<_>, _>>()?;
        for &handle in inputs {
            self.get_real(handle)?;
        }
        let pairs = inputs.iter().zip(seed);
        let seeds: Vec<_> = pairs
            .map(|(&handle, &part)| (handle as usize, part))
            .collect();
        result.copy_from_slice(&self.simulation.directional_derivative(&outputs, &seeds));
        Ok(())
    }
}

/// Copies a snapshot of the same model without allocation.
fn copy(from: &Snapshot, to: &mut Snapshot) {
    to.time = from.time;
    to.positive.copy_from_slice(&from.positive);
    to.values.copy_from_slice(&from.values);
    to.slopes.copy_from_slice(&from.slopes);
    to.travelled.copy_from_slice(&from.travelled);
    to.states.copy_from_slice(&from.states);
    to.tolerance = from.tolerance;
}
