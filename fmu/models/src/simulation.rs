//! A model that runs: values, states, steps.

use crate::integrate::{IntegrationError, Tolerance, integrate};
use crate::lti::{Transition, TransitionError};
use crate::quadcopter::N_STATES;
use crate::{COEFFICIENTS, Kind, Model, Pilot, Quadcopter, Scalar, ValueError};
use num_dual::Dual64;

/// Relative tolerance of the vehicle's integrator unless another is set.
pub const DEFAULT_TOLERANCE: f64 = 1e-9;

/// Range of tolerances; a wish beyond it is moved to its end.
pub const TOLERANCE_RANGE: (f64, f64) = (1e-12, 1e-4);

/// Why a value cannot be set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetError {
    /// No variable has this index.
    #[error("there is no variable {index}; the last one is {last}")]
    NoVariable {
        /// The index.
        index: usize,
        /// The largest index.
        last: usize,
    },
    /// Outputs are calculated.
    #[error("{name} is an output and cannot be set")]
    Output {
        /// The variable.
        name: String,
    },
    /// Only inputs have time derivatives.
    #[error("{name} is no input and has no derivative to set")]
    NoInput {
        /// The variable.
        name: String,
    },
    /// The variable cannot have this value.
    #[error(transparent)]
    Value(#[from] ValueError),
}

/// Why a step could not be done. The simulation then stands where it stood before.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The pilot's transition cannot be computed.
    #[error("the pilot's equations: {0}")]
    Pilot(TransitionError),
    /// The vehicle's integration was given up.
    #[error("the vehicle's equations: {0}")]
    Vehicle(IntegrationError),
    /// A state is no longer finite.
    #[error("state {state} is {value} after {step} s; the model or what drives it is unstable")]
    NotFinite {
        /// The state, from 1.
        state: usize,
        /// Its value.
        value: f64,
        /// The step [s].
        step: f64,
    },
}

/// Everything that changes when a simulation runs: equal snapshots have equal futures.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Inputs and parameters by index; outputs hold 0 here, since they are calculated.
    pub values: Vec<f64>,
    /// Time derivative of each input, for the next step alone.
    pub slopes: Vec<f64>,
    /// Time derivative that each input had in the last step.
    pub travelled: Vec<f64>,
    /// The states.
    pub states: Vec<f64>,
    /// Relative tolerance.
    pub tolerance: f64,
}

/// A running [`Model`]. It counts no time, since no equation depends on it.
#[derive(Debug, Clone)]
pub struct Simulation {
    model: Model,
    now: Snapshot,
    /// The pilot's transition and what it was computed for: step, then θ_1 to θ_n.
    transition: Option<(Vec<f64>, Transition)>,
    /// Space for the next states.
    next: Vec<f64>,
}

impl Simulation {
    /// The model with all variables at their start values.
    pub fn new(model: Model) -> Self {
        let start = |v: &crate::Variable| v.start.unwrap_or(0.0);
        let values: Vec<f64> = model.variables().iter().map(start).collect();
        let now = Snapshot {
            slopes: vec![0.0; model.inputs().len()],
            travelled: vec![0.0; model.inputs().len()],
            states: values[model.starts()].to_vec(),
            tolerance: DEFAULT_TOLERANCE,
            values,
        };
        Self {
            next: now.states.clone(),
            transition: None,
            now,
            model,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// All that a later [`restore`](Self::restore) needs.
    pub fn snapshot(&self) -> &Snapshot {
        &self.now
    }

    /// Goes back (or forth) to a snapshot of the same model.
    ///
    /// # Panics
    /// When the snapshot's lengths are those of another model.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.now.values.copy_from_slice(&snapshot.values);
        self.now.slopes.copy_from_slice(&snapshot.slopes);
        self.now.travelled.copy_from_slice(&snapshot.travelled);
        self.now.states.copy_from_slice(&snapshot.states);
        self.now.tolerance = snapshot.tolerance;
    }

    /// All variables back to their start values, and the default tolerance.
    pub fn reset(&mut self) {
        *self = Self::new(self.model.clone());
    }

    /// Sets the relative tolerance, moved into [`TOLERANCE_RANGE`].
    pub fn set_tolerance(&mut self, relative: f64) {
        self.now.tolerance = relative.clamp(TOLERANCE_RANGE.0, TOLERANCE_RANGE.1);
    }

    /// The value of a variable, outputs calculated from states and inputs as they are now.
    ///
    /// # Panics
    /// When there is no such variable.
    pub fn get(&self, index: usize) -> f64 {
        let outputs = self.model.outputs();
        match outputs.contains(&index) {
            true => self.output(&self.now.values, &self.now.states, index - outputs.start),
            false => self.now.values[index],
        }
    }

    /// Sets an input, a parameter or a start value; a start value sets its state too.
    ///
    /// # Errors
    /// When it is an output, or the value not finite or out of the variable's range.
    pub fn set(&mut self, index: usize, value: f64) -> Result<(), SetError> {
        let variable = self.variable(index)?;
        if variable.is_output() {
            return Err(SetError::Output {
                name: variable.label(),
            });
        }
        variable.check(value)?;
        self.now.values[index] = value;
        let starts = self.model.starts();
        if starts.contains(&index) {
            self.now.states[index - starts.start] = value;
        }
        Ok(())
    }

    /// Sets the time derivative of an input [its unit per second] for the next step, at whose
    /// beginning the input has the value that is set.
    ///
    /// # Errors
    /// When it is no input, or the slope not finite.
    pub fn set_slope(&mut self, index: usize, slope: f64) -> Result<(), SetError> {
        let variable = self.variable(index)?;
        if !self.model.inputs().contains(&index) {
            return Err(SetError::NoInput {
                name: variable.label(),
            });
        }
        if !slope.is_finite() {
            return Err(SetError::Value(ValueError::NotFinite {
                name: format!("time derivative of {}", variable.label()),
                value: slope,
            }));
        }
        self.now.slopes[index] = slope;
        Ok(())
    }

    /// Advances by `h` > 0 seconds, with inputs held or, where a slope was set, along it. Afterwards
    /// the inputs have the values that they reached, and the slopes are 0.
    ///
    /// # Errors
    /// When the step cannot be done; nothing has changed then.
    pub fn step(&mut self, h: f64) -> Result<(), StepError> {
        match self.model.kind() {
            Kind::Pilot(pilot) => self.step_pilot(pilot, h)?,
            Kind::Quadcopter => self.step_quadcopter(h)?,
        }
        if let Some(i) = self.next.iter().position(|v| !v.is_finite()) {
            return Err(StepError::NotFinite {
                state: i + 1,
                value: self.next[i],
                step: h,
            });
        }
        std::mem::swap(&mut self.now.states, &mut self.next);
        std::mem::swap(&mut self.now.travelled, &mut self.now.slopes);
        self.now.slopes.fill(0.0);
        for (value, slope) in self.now.values.iter_mut().zip(&self.now.travelled) {
            *value += slope * h;
        }
        Ok(())
    }

    /// Time derivative of an output at this instant, at the end of the last step [its unit per
    /// second].
    ///
    /// # Panics
    /// When the variable is no output.
    pub fn output_derivative(&self, index: usize) -> f64 {
        assert!(
            self.model.outputs().contains(&index),
            "{index} is no output"
        );
        let position = index - self.model.outputs().start;
        match self.model.kind() {
            Kind::Pilot(pilot) => self.pilot_derivative(pilot, position),
            Kind::Quadcopter => self.vehicle_slope()[position],
        }
    }

    /// Derivatives of outputs in the direction of `seeds`, pairs of a known's index and its part:
    /// `Σ ∂output/∂known · part`, exact, by dual numbers. A start value moves its state.
    ///
    /// # Panics
    /// When there is no such variable, or one of `outputs` is no output.
    pub fn directional_derivative(&self, outputs: &[usize], seeds: &[(usize, f64)]) -> Vec<f64> {
        let lift = |values: &[f64]| -> Vec<Dual64> { values.iter().map(|&v| v.into()).collect() };
        let (mut values, mut states) = (lift(&self.now.values), lift(&self.now.states));
        let starts = self.model.starts();
        for &(index, part) in seeds {
            values[index].eps += part;
            if starts.contains(&index) {
                states[index - starts.start].eps += part;
            }
        }
        let first = self.model.outputs().start;
        outputs
            .iter()
            .map(|index| self.output(&values, &states, index - first).eps)
            .collect()
    }

    fn variable(&self, index: usize) -> Result<&crate::Variable, SetError> {
        let variables = self.model.variables();
        variables.get(index).ok_or(SetError::NoVariable {
            index,
            last: variables.len() - 1,
        })
    }

    /// An output from values and states: the one formula, for numbers and for their derivatives.
    fn output<T: Scalar>(&self, values: &[T], states: &[T], position: usize) -> T {
        match (self.model.kind(), position) {
            (Kind::Pilot(pilot), 0) => {
                let coefficients = &values[self.model.coefficients()];
                clipped(
                    pilot.output(states, coefficients),
                    coefficients[pilot.n_parameters()],
                )
            }
            (Kind::Pilot(_), _) => values[0] - values[1],
            (Kind::Quadcopter, i) => states[i],
        }
    }

    // The pilot.

    fn theta(&self, pilot: Pilot) -> &[f64] {
        let first = self.model.coefficients().start;
        &self.now.values[first..first + pilot.n_parameters()]
    }

    fn error(&self) -> f64 {
        self.now.values[0] - self.now.values[1]
    }

    fn pilot_derivative(&self, pilot: Pilot, position: usize) -> f64 {
        if position == 1 {
            return self.now.travelled[0] - self.now.travelled[1];
        }
        let theta = self.theta(pilot);
        let limit = self.now.values[self.model.coefficients().end - 1];
        if pilot.output(&self.now.states, theta).abs() > limit {
            return 0.0;
        }
        let mut slope = vec![0.0; pilot.order];
        pilot.derivative(&self.now.states, self.error(), theta, &mut slope);
        pilot.output(&slope, theta)
    }

    fn step_pilot(&mut self, pilot: Pilot, h: f64) -> Result<(), StepError> {
        let denominator = &self.theta(pilot)[..pilot.order];
        let known = |(key, _): &(Vec<f64>, Transition)| key[0] == h && key[1..] == *denominator;
        if !self.transition.as_ref().is_some_and(known) {
            let theta = self.theta(pilot);
            let transition = Transition::new(pilot.order, h, |x, u, dx| {
                pilot.derivative(x, u, theta, dx);
            })
            .map_err(StepError::Pilot)?;
            let key = std::iter::once(h).chain(denominator.iter().copied());
            self.transition = Some((key.collect(), transition));
        }
        let error = self.error();
        let slope = self.now.slopes[0] - self.now.slopes[1];
        if let Some((_, transition)) = &self.transition {
            transition.apply(&self.now.states, error, slope, &mut self.next);
        }
        Ok(())
    }

    // The vehicle.

    fn vehicle(&self) -> Quadcopter {
        let values = &self.now.values[self.model.coefficients()];
        let mut vehicle = Quadcopter::default();
        for (coefficient, value) in COEFFICIENTS.iter().zip(values) {
            (coefficient.set)(&mut vehicle, *value);
        }
        vehicle
    }

    fn vehicle_states(&self) -> [f64; N_STATES] {
        std::array::from_fn(|i| self.now.states[i])
    }

    fn vehicle_slope(&self) -> [f64; N_STATES] {
        let mut slope = [0.0; N_STATES];
        self.vehicle()
            .derivative(&self.vehicle_states(), self.now.values[0], &mut slope);
        slope
    }

    fn step_quadcopter(&mut self, h: f64) -> Result<(), StepError> {
        let vehicle = self.vehicle();
        let (stick, slope) = (self.now.values[0], self.now.slopes[0]);
        let derivative = |time: f64, x: &[f64; N_STATES]| {
            let mut dx = [0.0; N_STATES];
            vehicle.derivative(x, stick + slope * time, &mut dx);
            dx
        };
        let relative = self.now.tolerance;
        let tolerance = Tolerance {
            relative,
            absolute: crate::model::quadcopter_nominals().map(|nominal| nominal * relative),
        };
        let (next, _) = integrate(derivative, self.vehicle_states(), h, &tolerance)
            .map_err(StepError::Vehicle)?;
        self.next.copy_from_slice(&next);
        Ok(())
    }
}

/// `value` within ±`limit`.
fn clipped<T: Scalar>(value: T, limit: T) -> T {
    if value.re() > limit.re() {
        limit
    } else if value.re() < -limit.re() {
        -limit
    } else {
        value
    }
}
