//! Rust models as components, without FMUs. They run the same [`Simulation`] as the exported FMUs.

use super::component::{
    Abilities, Component, ComponentError, DelayedLinear, Experiment, Linear, Progress, Role, Unit,
    Value, ValueKind, Variable,
};
use pilotage_linear::StateSpace;
use pilotage_models::AnyModel;
use pilotage_sdk::checkpoint::Checkpoint;
use pilotage_sdk::instance::InterfaceType;
use pilotage_sdk::simulation::Snapshot;
use pilotage_sdk::structure::{Structure, Unknown};
use pilotage_sdk::{Equations, Simulation, Table, variable};
use std::convert::Infallible;
use thiserror::Error;

/// Why a native component rejects a call.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NativeError {
    /// An expression is not finite.
    #[error("{name} is {value} ({cause})")]
    NotFinite {
        /// The variable.
        name: String,
        /// Its value.
        value: f64,
        /// The expression and its location.
        cause: String,
    },
    /// An invalid handle.
    #[error("there is no variable with handle {handle}")]
    NoSuchVariable {
        /// The handle.
        handle: u32,
    },
    /// Models have real variables and read-only Boolean modes.
    #[error("there is no variable of type {kind} with handle {handle}")]
    NoSuchKind {
        /// The type asked for.
        kind: ValueKind,
        /// The handle.
        handle: u32,
    },
    /// The slot is empty.
    #[error("no state is saved in place {place}")]
    NothingSaved {
        /// Number of the slot.
        place: usize,
    },
    /// Only outputs have derivatives.
    #[error("the variable with handle {handle} is no output")]
    NoOutput {
        /// The handle.
        handle: u32,
    },
}

/// A running model; a variable's handle is its index in the model's [`Table`].
#[derive(Debug)]
pub struct NativeComponent<E> {
    simulation: Simulation<E>,
    variables: Vec<Variable>,
    saved: Vec<Option<Snapshot>>,
}

/// A built-in model or a model from a file. Compiled in this crate, where steps are optimized, and not in the caller's.
pub fn of_model(model: AnyModel) -> Box<dyn Component> {
    Box::new(NativeComponent::new(model))
}

impl<E: Equations> NativeComponent<E> {
    /// A model at its start values.
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

    /// Rejects a non-finite value if the equations report a cause; other non-finite values may be intended.
    #[cold]
    fn check_defined(&self, handle: u32, value: f64) -> Result<(), NativeError> {
        let name = self.variables[handle as usize].name.clone();
        match self.simulation.trouble() {
            Some(cause) => Err(NativeError::NotFinite { name, value, cause }),
            None => Ok(()),
        }
    }

    fn get_real(&self, handle: u32) -> Result<f64, NativeError> {
        match (handle as usize) < self.variables.len() {
            true => Ok(self.simulation.get(handle as usize)),
            false => Err(NativeError::NoSuchVariable { handle }),
        }
    }
}

/// Converts a model's variable to the master's.
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
        true => ValueKind::Boolean,
        false => ValueKind::Real,
    };
    Variable {
        unit: Some(unit).filter(|_| kind == ValueKind::Real && variable.unit.is_some()),
        range: [
            variable.min.unwrap_or(f64::NEG_INFINITY),
            variable.max.unwrap_or(f64::INFINITY),
        ],
        is_tunable: variable.role == variable::Role::Tunable,
        description: variable.description.clone(),
        nominal: variable.nominal,
        feedthrough,
        initial_feedthrough,
        ..Variable::new(&variable.name, handle, kind, role)
    }
}

impl<E: Equations + Send> Component for NativeComponent<E> {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        if let Some(tolerance) = experiment.tolerance {
            self.simulation.set_tolerance(tolerance);
        }
        self.simulation.set_time(experiment.start);
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        for (&handle, &value) in handles.iter().zip(values) {
            self.simulation.set(handle as usize, value)?;
        }
        Ok(())
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        for (&handle, value) in handles.iter().zip(values) {
            *value = self.get_real(handle)?;
            if !value.is_finite() {
                self.check_defined(handle, *value)?;
            }
        }
        Ok(())
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        let kind = match value {
            Value::Real(value) => return self.set_reals(&[handle], &[*value]),
            Value::Integer(_) => ValueKind::Integer,
            Value::Boolean(_) => ValueKind::Boolean,
            Value::String(_) => ValueKind::String,
        };
        Err(NativeError::NoSuchKind { kind, handle }.into())
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        let is_own = (self.variables.get(handle as usize)).is_some_and(|own| own.kind == kind);
        match kind {
            ValueKind::Real => Ok(Value::Real(self.get_real(handle)?)),
            ValueKind::Boolean if is_own => Ok(Value::Boolean(self.get_real(handle)? != 0.0)),
            kind => Err(NativeError::NoSuchKind { kind, handle }.into()),
        }
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.simulation.step(h)?;
        Ok(Progress::Done)
    }

    fn renew(&mut self) -> Result<bool, ComponentError> {
        self.simulation.reset();
        Ok(true)
    }

    /// Exact, by dual numbers.
    fn linearize(&mut self, _step: f64) -> Result<Linear, ComponentError> {
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
        let times = self.simulation.delay_times();
        let delayed = (!times.is_empty()).then(|| {
            let [states, mut inputs, mut outputs] = names.clone();
            let channels = (0..times.len()).map(|k| format!("delay {k}"));
            inputs.extend(channels.clone());
            outputs.extend(channels);
            let column = |k: usize| -> Result<Vec<f64>, Infallible> {
                let seed = knowns.get(k).map(|known| (*known, 1.0));
                let delay = k.checked_sub(knowns.len());
                let seeds: Vec<_> = seed.into_iter().collect();
                Ok((self.simulation).delayed_derivative(&unknowns, &seeds, delay))
            };
            let Ok(system) = StateSpace::from_columns([states, inputs, outputs], column);
            DelayedLinear {
                system: system.without_idle_states(),
                times,
            }
        });
        let system = StateSpace::from_columns(names, |k| {
            let seed = [(knowns[k], 1.0)];
            Ok::<_, ComponentError>(self.simulation.linear_derivative(&unknowns, &seed))
        })?;
        Ok(Linear {
            delayed,
            ..system.into()
        })
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            serialization: true,
            variable_steps: true,
            input_derivatives: true,
            output_derivatives: true,
            directional_derivatives: true,
            cuts_steps: false,
        }
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        if self.saved.len() <= place {
            self.saved.resize(place + 1, None);
        }
        match &mut self.saved[place] {
            // The derived `clone_from` would allocate.
            Some(saved) => copy(self.simulation.snapshot(), saved),
            empty => *empty = Some(self.simulation.snapshot().clone()),
        }
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        let Some(Some(saved)) = self.saved.get(place) else {
            return Err(NativeError::NothingSaved { place }.into());
        };
        self.simulation.restore(saved);
        Ok(())
    }

    /// As an exported FMU does.
    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        let checkpoint = Checkpoint {
            guid: self.simulation.table().guid(),
            version: 0,
            kind: InterfaceType::CoSimulation,
            state: 0,
            clock: None,
            snapshot: self.simulation.snapshot().clone(),
        };
        Ok(checkpoint.to_bytes())
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        let table = self.simulation.table();
        let checkpoint = Checkpoint::from_bytes(bytes, table, &table.guid())?;
        self.simulation.restore(&checkpoint.snapshot);
        Ok(())
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        for (&handle, &slope) in handles.iter().zip(slopes) {
            self.simulation.set_slope(handle as usize, slope)?;
        }
        Ok(())
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
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
    ) -> Result<(), ComponentError> {
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
    to.last_slopes.copy_from_slice(&from.last_slopes);
    to.states.copy_from_slice(&from.states);
    to.tolerance = from.tolerance;
    to.is_stiff = from.is_stiff;
    to.handled = from.handled;
    to.history.clone_from(&from.history);
}
