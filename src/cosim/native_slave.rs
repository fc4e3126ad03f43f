//! The project's own models as slaves, without FMUs between: for tests, and for whoever needs no FMU.

use super::slave::{Experiment, Kind, Progress, Role, Slave, SlaveError, Unit, Value, Variable};
use pilotage_models::{Pilot, Quadcopter, quadcopter};
use thiserror::Error;

/// Why a native slave refuses a call.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NativeError {
    /// A handle that is no input's.
    #[error("there is no input with handle {handle}")]
    NoSuchInput {
        /// The handle.
        handle: u32,
    },
    /// A handle that is no variable's.
    #[error("there is no real variable with handle {handle}")]
    NoSuchVariable {
        /// The handle.
        handle: u32,
    },
    /// A state that is no longer finite.
    #[error("state {state} is no longer finite")]
    Diverged {
        /// Position of the state, from 0.
        state: usize,
    },
}

/// What a [`NativeSlave`] simulates.
#[derive(Debug, Clone, PartialEq)]
enum Model {
    /// Inputs target and position [m], outputs stick [1] and error [m].
    Pilot { pilot: Pilot, theta: Vec<f64> },
    /// Input stick [1], outputs all states.
    Quadcopter(Quadcopter),
}

/// A model integrated by the classical Runge-Kutta method (order 4), inputs held during a step.
#[derive(Debug, Clone)]
pub struct NativeSlave {
    model: Model,
    variables: Vec<Variable>,
    states: Vec<f64>,
    inputs: Vec<f64>,
    longest_substep: f64,
    /// Room for the four slopes and the point at which the next one is taken.
    slopes: [Vec<f64>; 4],
    point: Vec<f64>,
}

impl NativeSlave {
    /// A pilot with parameters θ, at rest. `longest_substep` [s] is that of the integrator.
    ///
    /// # Panics
    /// If there are not `2·order` parameters.
    pub fn pilot(pilot: Pilot, theta: &[f64], longest_substep: f64) -> Self {
        assert_eq!(theta.len(), pilot.n_parameters());
        let metre = |name: &str, handle, role| with_unit(name, handle, role, "m");
        let mut error = metre("error", 3, Role::Output);
        error.feedthrough = vec![0, 1];
        error.initial_feedthrough = vec![0, 1];
        let variables = vec![
            metre("target", 0, Role::Input),
            metre("position", 1, Role::Input),
            with_unit("stick", 2, Role::Output, "1"),
            error,
        ];
        let theta = theta.to_vec();
        let states = vec![0.0; pilot.order];
        Self::new(
            Model::Pilot { pilot, theta },
            variables,
            states,
            2,
            longest_substep,
        )
    }

    /// A quadcopter hovering at 0 m. `longest_substep` [s] is that of the integrator.
    pub fn quadcopter(vehicle: Quadcopter, longest_substep: f64) -> Self {
        const UNITS: [&str; quadcopter::N_STATES] =
            ["m", "rad", "m/s", "rad/s", "krad/s", "krad/s"];
        let states = quadcopter::STATE_NAMES.iter().zip(UNITS).zip(1..);
        let outputs =
            states.map(|((name, unit), handle)| with_unit(name, handle, Role::Output, unit));
        let variables = std::iter::once(with_unit("stick", 0, Role::Input, "1"))
            .chain(outputs)
            .collect();
        let states = Quadcopter::hover(0.0).to_vec();
        Self::new(
            Model::Quadcopter(vehicle),
            variables,
            states,
            1,
            longest_substep,
        )
    }

    fn new(
        model: Model,
        variables: Vec<Variable>,
        states: Vec<f64>,
        n_inputs: usize,
        longest_substep: f64,
    ) -> Self {
        let n = states.len();
        Self {
            model,
            variables,
            states,
            inputs: vec![0.0; n_inputs],
            longest_substep,
            slopes: std::array::from_fn(|_| vec![0.0; n]),
            point: vec![0.0; n],
        }
    }

    /// The value of the variable with that handle.
    fn value(&self, handle: u32) -> Result<f64, NativeError> {
        let index = handle as usize;
        let value = match &self.model {
            _ if index < self.inputs.len() => Some(self.inputs[index]),
            Model::Pilot { pilot, theta } => match index - self.inputs.len() {
                0 => Some(pilot.output(&self.states, theta)),
                1 => Some(self.inputs[0] - self.inputs[1]),
                _ => None,
            },
            Model::Quadcopter(_) => self.states.get(index - self.inputs.len()).copied(),
        };
        value.ok_or(NativeError::NoSuchVariable { handle })
    }

    /// Advances the states by `h` [s] in one Runge-Kutta step.
    fn substep(&mut self, h: f64) {
        const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
        const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
        for stage in 0..4 {
            for (i, point) in self.point.iter_mut().enumerate() {
                let slope = if stage == 0 {
                    0.0
                } else {
                    self.slopes[stage - 1][i]
                };
                *point = self.states[i] + NODES[stage] * h * slope;
            }
            let (x, dx) = (&self.point, &mut self.slopes[stage]);
            match &self.model {
                Model::Pilot { pilot, theta } => {
                    pilot.derivative(x, self.inputs[0] - self.inputs[1], theta, dx);
                }
                Model::Quadcopter(vehicle) => vehicle.derivative(x, self.inputs[0], dx),
            }
        }
        for (i, state) in self.states.iter_mut().enumerate() {
            let slopes = self.slopes.iter().zip(WEIGHTS);
            *state += h * slopes.map(|(slope, weight)| weight * slope[i]).sum::<f64>();
        }
    }
}

/// A real variable with a unit known by name alone.
fn with_unit(name: &str, handle: u32, role: Role, unit: &str) -> Variable {
    Variable {
        unit: Some(Unit {
            name: unit.to_owned(),
            base: None,
        }),
        ..Variable::new(name, handle, Kind::Real, role)
    }
}

impl Slave for NativeSlave {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, _experiment: &Experiment) -> Result<(), SlaveError> {
        Ok(())
    }

    fn enter_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(())
    }

    fn exit_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError> {
        for (&handle, &value) in handles.iter().zip(values) {
            let input = self.inputs.get_mut(handle as usize);
            *input.ok_or(NativeError::NoSuchInput { handle })? = value;
        }
        Ok(())
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError> {
        for (&handle, value) in handles.iter().zip(values) {
            *value = self.value(handle)?;
        }
        Ok(())
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError> {
        match value {
            Value::Real(value) => self.set_reals(&[handle], &[*value]),
            _ => Err(NativeError::NoSuchInput { handle }.into()),
        }
    }

    fn get(&mut self, handle: u32, kind: Kind) -> Result<Value, SlaveError> {
        match kind {
            Kind::Real => Ok(Value::Real(self.value(handle)?)),
            _ => Err(NativeError::NoSuchVariable { handle }.into()),
        }
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, SlaveError> {
        let substeps = (h / self.longest_substep).ceil().max(1.0);
        for _ in 0..substeps as u64 {
            self.substep(h / substeps);
        }
        match self.states.iter().position(|x| !x.is_finite()) {
            Some(state) => Err(NativeError::Diverged { state }.into()),
            None => Ok(Progress::Done),
        }
    }

    fn terminate(&mut self) -> Result<(), SlaveError> {
        Ok(())
    }
}
