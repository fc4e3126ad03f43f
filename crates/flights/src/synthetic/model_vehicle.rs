//! Model files as vehicles.

use super::tuning::SLOWEST;
use super::{Hands, SyntheticError, Vehicle, stability};
use nalgebra::Complex;
use num_dual::Dual64;
use pilotage_linear::StateSpace;
use pilotage_models::{Scalar, TextModel};
use pilotage_sdk::{At, Equations};
use std::convert::Infallible;

/// Location of a signal in a model.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    State(usize),
    /// Index in the output of [`Equations::output`].
    Computed(usize),
}

/// A model file as a vehicle: inputs `stick` and, with two axes, `stick2`; other inputs keep their start values.
#[derive(Debug, Clone)]
pub struct ModelVehicle {
    model: TextModel,
    parameters: Vec<f64>,
    /// Values of all inputs; those of the sticks are overwritten.
    inputs: Vec<f64>,
    /// Indices of the sticks among the inputs.
    sticks: Vec<usize>,
    /// The measured positions with their units.
    positions: Vec<(Place, String)>,
    others: Vec<(Place, String, String)>,
    /// Linearisation from the sticks to the positions about the start.
    linear: StateSpace,
    signs: Vec<f64>,
}

impl ModelVehicle {
    /// Uses the outputs `measured` of the model as positions, one per stick; by default `position` and `position2`.
    ///
    /// # Errors
    /// If the model has no stick or no such output, or cannot be linearised at its start.
    pub fn new(model: TextModel, measured: &[String]) -> Result<Self, SyntheticError> {
        let table = model.variables();
        let inputs = table.inputs();
        let stick = |name: &str| table.index(name).filter(|index| inputs.contains(index));
        let first = stick("stick").ok_or_else(|| SyntheticError::NoStick {
            vehicle: table.name().into(),
        })?;
        let sticks: Vec<usize> = [Some(first), stick("stick2")]
            .into_iter()
            .flatten()
            .collect();
        let usual = ["position", "position2"].map(str::to_owned);
        let names = match measured {
            [] => &usual[..sticks.len()],
            given => given,
        };
        if names.len() != sticks.len() {
            return Err(SyntheticError::Axes {
                sticks: sticks.len(),
                measured: names.len(),
            });
        }
        let found = names.iter().map(|name| output(&model, name));
        let found: Vec<usize> = found.collect::<Result<_, _>>()?;
        let unit = |index: usize| table.variables()[index].unit.name.clone();
        let positions = found
            .iter()
            .map(|&index| (place(&model, index), unit(index)));
        let rest = table.outputs().filter(|index| !found.contains(index));
        let rest = rest.filter(|&index| !is_column(&table.variables()[index].name));
        let others = rest.map(|index| {
            (
                place(&model, index),
                table.variables()[index].name.clone(),
                unit(index),
            )
        });
        let starts = inputs
            .clone()
            .map(|index| table.variables()[index].start.unwrap_or(0.0));
        let mut own = Self {
            parameters: model.compiled().parameters(),
            inputs: starts.collect(),
            sticks: sticks.iter().map(|index| index - inputs.start).collect(),
            positions: positions.collect(),
            others: others.collect(),
            linear: StateSpace::empty(),
            signs: Vec::new(),
            model: model.clone(),
        };
        own.linear = own.linearised(names);
        own.linear.check_finite()?;
        let at = Complex::from(own.anchor());
        own.signs = (0..own.axes())
            .map(|axis| own.linear.transfer(axis, axis, at).re.signum())
            .collect();
        Ok(own)
    }

    /// Linearisation from the sticks to the positions about the start.
    pub fn linear(&self) -> &StateSpace {
        &self.linear
    }

    /// A real frequency above the unstable poles, close to 0 if there are none, at which the sign of the transfer
    /// function gives the direction of a stick [1/s].
    pub(super) fn anchor(&self) -> f64 {
        let poles = self.linear.poles();
        let unstable = poles.iter().map(|pole| pole.re).fold(0.0, f64::max);
        (2.0 * unstable).max(SLOWEST)
    }

    fn linearised(&self, names: &[String]) -> StateSpace {
        let (n, m) = (self.start().len(), self.sticks.len());
        let known = |count: usize, of: &str| (1..=count).map(|k| format!("{of}{k}")).collect();
        let column = |k: usize| {
            let marked = |k: usize, values: &[f64]| -> Vec<Dual64> {
                let mark = |(i, value): (usize, &f64)| Dual64::new(*value, f64::from(i == k));
                values.iter().enumerate().map(mark).collect()
            };
            let x = marked(k, &self.start());
            // Inputs other than sticks have no derivative.
            let u = marked(
                k.checked_sub(n).map_or(usize::MAX, |k| self.sticks[k]),
                &self.inputs,
            );
            let mut column = self.rates(Dual64::from(0.0), &x, &u);
            let computed = self.computed(Dual64::from(0.0), &x, &u);
            column.extend(
                self.positions
                    .iter()
                    .map(|(place, _)| value(*place, &x, &computed)),
            );
            Ok::<_, Infallible>(column.iter().map(|entry| entry.eps).collect())
        };
        let system =
            StateSpace::from_columns([known(n, "x"), known(m, "stick"), names.to_vec()], column);
        let Ok(system) = system;
        system
    }

    /// All inputs, with these stick values.
    fn inputs<T: Scalar>(&self, stick: &[T]) -> Vec<T> {
        let mut inputs: Vec<T> = self.inputs.iter().map(|value| T::from(*value)).collect();
        for (k, value) in self.sticks.iter().zip(stick) {
            inputs[*k] = *value;
        }
        inputs
    }

    fn rates<T: Scalar>(&self, time: T, x: &[T], u: &[T]) -> Vec<T> {
        let p: Vec<T> = self
            .parameters
            .iter()
            .map(|value| T::from(*value))
            .collect();
        let mut dx = vec![T::from(0.0); x.len()];
        self.model.derivative(At { time, x, u, p: &p }, &mut dx);
        dx
    }

    fn computed<T: Scalar>(&self, time: T, x: &[T], u: &[T]) -> Vec<T> {
        let p: Vec<T> = self
            .parameters
            .iter()
            .map(|value| T::from(*value))
            .collect();
        let mut y = vec![T::from(0.0); self.model.variables().computed().count()];
        self.model.output(At { time, x, u, p: &p }, &mut y);
        y
    }
}

/// Index of the output with that name.
fn output(model: &TextModel, name: &str) -> Result<usize, SyntheticError> {
    let table = model.variables();
    let index = table
        .index(name)
        .filter(|index| table.outputs().contains(index));
    index.ok_or_else(|| {
        let outputs = table
            .outputs()
            .map(|index| table.variables()[index].name.clone());
        SyntheticError::NoOutput {
            vehicle: table.name().into(),
            output: name.into(),
            outputs: outputs.collect(),
        }
    })
}

fn place(model: &TextModel, index: usize) -> Place {
    let table = model.variables();
    match table.state_at(index) {
        Some(state) => Place::State(state),
        None => Place::Computed(
            table
                .computed()
                .position(|own| own == index)
                .unwrap_or_default(),
        ),
    }
}

/// Whether another column of a recording has that name.
fn is_column(name: &str) -> bool {
    [
        "time",
        "target",
        "position",
        "stick",
        "target2",
        "position2",
        "stick2",
    ]
    .contains(&name)
}

fn value<T: Copy>(place: Place, x: &[T], computed: &[T]) -> T {
    match place {
        Place::State(k) => x[k],
        Place::Computed(k) => computed[k],
    }
}

impl Vehicle for ModelVehicle {
    fn start(&self) -> Vec<f64> {
        self.model.compiled().start_values(&self.parameters)
    }

    fn axes(&self) -> usize {
        self.sticks.len()
    }

    fn unit(&self, axis: usize) -> &str {
        &self.positions[axis].1
    }

    /// The range of the input; infinite if the model has none.
    fn stops(&self, axis: usize) -> (f64, f64) {
        let table = self.model.variables();
        let stick = &table.variables()[table.inputs().start + self.sticks[axis]];
        (
            stick.min.unwrap_or(f64::NEG_INFINITY),
            stick.max.unwrap_or(f64::INFINITY),
        )
    }

    fn sign(&self, axis: usize) -> f64 {
        self.signs[axis]
    }

    fn derivative(&self, time: f64, x: &[f64], stick: &[f64], dx: &mut [f64]) {
        dx.copy_from_slice(&self.rates(time, x, &self.inputs(stick)));
    }

    fn observe(&self, time: f64, x: [&[f64]; 2], stick: [&[f64]; 2]) -> Vec<(f64, f64)> {
        let duals = |[values, rates]: [&[f64]; 2]| -> Vec<Dual64> {
            values
                .iter()
                .zip(rates)
                .map(|(value, rate)| Dual64::new(*value, *rate))
                .collect()
        };
        let x = duals(x);
        let computed = self.computed(Dual64::new(time, 1.0), &x, &self.inputs(&duals(stick)));
        let seen = self
            .positions
            .iter()
            .map(|(place, _)| value(*place, &x, &computed));
        seen.map(|position| (position.re, position.eps)).collect()
    }

    fn others(&self) -> Vec<(String, String)> {
        let named = |(_, name, unit): &(Place, String, String)| (name.clone(), unit.clone());
        self.others.iter().map(named).collect()
    }

    fn record(&self, time: f64, x: &[f64], stick: &[f64]) -> Vec<f64> {
        let computed = self.computed(time, x, &self.inputs(stick));
        self.others
            .iter()
            .map(|(place, ..)| value(*place, x, &computed))
            .collect()
    }

    fn fastest(&self) -> f64 {
        self.linear
            .poles()
            .iter()
            .map(|pole| pole.norm())
            .fold(0.0, f64::max)
    }

    fn is_held_by(&self, hands: &Hands) -> bool {
        stability::is_stable(hands, self)
    }

    fn check_command(&self) -> &'static str {
        "pilotage model check"
    }
}
