//! The equations of a model exchange instance for the solver.

use crate::description::{ModelDescription, VariableKind};
use crate::{CallError, Instance};
use nalgebra::DMatrix;
use pilotage_abi::fmi2::Status;
use pilotage_ode::System;
use std::collections::HashMap;

/// An instance in continuous-time mode, with its inputs as functions of time.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) instance: Instance,
    inputs: Inputs,
    /// Value references of the derivatives and of their states, if the FMU provides the Jacobian.
    jacobian: Option<(Vec<u32>, Vec<u32>)>,
}

/// Real inputs: `value + slope·(t - since)`.
#[derive(Debug, Clone, Default)]
pub(super) struct Inputs {
    positions: HashMap<u32, usize>,
    references: Vec<u32>,
    values: Vec<f64>,
    slopes: Vec<f64>,
    since: f64,
    now: Vec<f64>,
    is_sloped: bool,
}

impl Inputs {
    fn at(&self, position: usize, t: f64) -> f64 {
        self.values[position] + self.slopes[position] * (t - self.since)
    }

    fn position(&mut self, reference: u32) -> usize {
        let new = self.references.len();
        let position = *self.positions.entry(reference).or_insert(new);
        if position == new {
            self.references.push(reference);
            self.values.push(f64::NAN);
            self.slopes.push(0.0);
            self.now.push(f64::NAN);
        }
        position
    }

    /// Moves the reference time of the slopes to `t`; the inputs stay the same functions.
    fn rebase(&mut self, t: f64) {
        for position in 0..self.values.len() {
            self.values[position] = self.at(position, t);
        }
        self.since = t;
    }
}

impl Model {
    pub(super) fn new(instance: Instance, description: &ModelDescription) -> Self {
        let jacobian = (instance.provides_directional_derivatives())
            .then(|| derivatives_and_states(description))
            .flatten();
        Self {
            instance,
            inputs: Inputs::default(),
            jacobian,
        }
    }

    /// The inputs as functions of time.
    pub(super) fn inputs(&self) -> Inputs {
        self.inputs.clone()
    }

    /// The inputs as numbers: references, values and slopes since a time.
    pub(super) fn kept_inputs(&self) -> (Vec<u32>, Vec<f64>, Vec<f64>, f64) {
        let own = &self.inputs;
        let (references, values) = (own.references.clone(), own.values.clone());
        (references, values, own.slopes.clone(), own.since)
    }

    /// Takes them back.
    pub(super) fn take_inputs(&mut self, kept: &(Vec<u32>, Vec<f64>, Vec<f64>, f64)) {
        let (references, values, slopes, since) = kept;
        let mut own = Inputs::default();
        let known = references.iter().zip(values).zip(slopes);
        for ((reference, value), slope) in known {
            let position = own.position(*reference);
            (own.values[position], own.slopes[position]) = (*value, *slope);
        }
        own.is_sloped = own.slopes.iter().any(|&slope| slope != 0.0);
        own.since = *since;
        self.inputs = own;
    }

    pub(super) fn set_back(&mut self, inputs: &Inputs) {
        self.inputs.clone_from(inputs);
    }

    /// Takes inputs from time `t` on. Returns whether one of them jumps.
    pub(super) fn plan_inputs(
        &mut self,
        t: f64,
        references: &[u32],
        values: &[f64],
        slopes: Option<&[f64]>,
    ) -> bool {
        self.inputs.rebase(t);
        let mut jumps = false;
        for (i, (&reference, &value)) in references.iter().zip(values).enumerate() {
            let position = self.inputs.position(reference);
            let before = self.inputs.values[position];
            // A value that continues as before, except for rounding, is no jump; the first value is one.
            let is_same = (value - before).abs() <= 1e-12 * value.abs().max(before.abs());
            jumps |= !is_same && value != before;
            self.inputs.values[position] = value;
            self.inputs.slopes[position] = slopes.map_or(0.0, |slopes| slopes[i]);
        }
        self.inputs.is_sloped = self.inputs.slopes.iter().any(|&slope| slope != 0.0);
        jumps
    }

    /// Sets all planned inputs to their values at `t`.
    pub(super) fn set_inputs(&mut self, t: f64) -> Result<(), CallError> {
        let inputs = &mut self.inputs;
        for position in 0..inputs.now.len() {
            inputs.now[position] = inputs.at(position, t);
        }
        match inputs.references.is_empty() {
            true => Ok(()),
            false => self.instance.set_real(&inputs.references, &inputs.now),
        }
    }

    /// Sets time and states of the instance.
    pub(super) fn put(&mut self, t: f64, x: &[f64]) -> Result<(), CallError> {
        self.instance.set_time(t)?;
        if self.inputs.is_sloped {
            self.set_inputs(t)?;
        }
        match x.is_empty() {
            true => Ok(()),
            false => self.instance.set_continuous_states(x),
        }
    }
}

/// Value references of the derivatives and of their states; `None` if any is missing or an array.
fn derivatives_and_states(description: &ModelDescription) -> Option<(Vec<u32>, Vec<u32>)> {
    let variable = |index: u32| description.variables.get((index as usize).checked_sub(1)?);
    let pair = |index: u32| {
        let derivative = variable(index)?;
        let VariableKind::Real(real) = &derivative.kind else {
            return None;
        };
        let state = variable(real.derivative?)?;
        let are_scalars = derivative.dimensions.is_empty() && state.dimensions.is_empty();
        are_scalars.then_some((derivative.value_reference, state.value_reference))
    };
    let listed = &description.structure.derivatives;
    let pairs: Option<Vec<_>> = listed.iter().map(|unknown| pair(unknown.index)).collect();
    Some(pairs?.into_iter().unzip())
}

/// `false` if the FMU discarded the call: the values are not defined at this point.
fn defined(result: Result<(), CallError>) -> Result<bool, CallError> {
    match result {
        Ok(()) => Ok(true),
        Err(CallError::Failed { status, .. }) if status == Status::DISCARD => Ok(false),
        Err(error) => Err(error),
    }
}

impl System for Model {
    type Error = CallError;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, CallError> {
        if x.is_empty() {
            return Ok(true);
        }
        let put = self.put(t, x);
        defined(put.and_then(|()| self.instance.get_derivatives(dx)))
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, CallError> {
        let put = self.put(t, x);
        defined(put.and_then(|()| self.instance.get_event_indicators(z)))
    }

    fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, CallError> {
        let Some((derivatives, states)) = &self.jacobian else {
            return Ok(false);
        };
        if states.len() != x.len() {
            return Ok(false);
        }
        let (derivatives, states) = (derivatives.clone(), states.clone());
        self.put(t, x)?;
        let mut column = vec![0.0; x.len()];
        for j in 0..x.len() {
            let (unknowns, known) = (&derivatives, &states[j..=j]);
            let instance = &mut self.instance;
            let found = instance.directional_derivative(unknowns, known, &[1.0], &mut column);
            if !defined(found)? {
                return Ok(false);
            }
            jacobian.column_mut(j).copy_from_slice(&column);
        }
        Ok(true)
    }
}
