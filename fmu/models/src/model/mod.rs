//! The exported form of a model: its kind, and its variables with their start values.

mod file;
mod pilot;
mod quadcopter;

pub use file::ModelFileError;

use crate::{Pilot, Quadcopter, Scalar, Table, Variable};
use pilotage_sdk::{At, Equations};
use std::ops::Range;

/// Name of the model file in the FMU's `resources`.
pub const MODEL_FILE: &str = "model.toml";

/// Equations of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModelKind {
    /// The linear pilot with its order.
    Pilot(Pilot),
    /// The quadcopter's pitch axis.
    Quadcopter,
}

impl ModelKind {
    /// Name: a C identifier, used for files and as FMI's `modelIdentifier`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pilot(_) => "pilot",
            Self::Quadcopter => "quadcopter",
        }
    }
}

/// Kind and variables of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    kind: ModelKind,
    table: Table,
}

/// The model file in the resources is not the one that was exported.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}; export the FMU again", file.display())]
pub(crate) struct BadResource {
    pub(crate) file: std::path::PathBuf,
    pub(crate) source: ModelFileError,
}

impl Model {
    /// Highest order of a pilot: far more than data can distinguish.
    pub const MAX_ORDER: usize = 12;

    /// A pilot at rest with the given θ (twice as many entries as the order) and stick limit.
    ///
    /// # Panics
    /// When θ has an odd number of entries, none, or more than twice [`Model::MAX_ORDER`].
    pub fn pilot(theta: &[f64], stick_limit: f64) -> Self {
        let order = theta.len() / 2;
        assert!(
            theta.len() == 2 * order && (1..=Self::MAX_ORDER).contains(&order),
            "θ of a pilot of order 1 to {} has twice as many entries, not {}",
            Self::MAX_ORDER,
            theta.len()
        );
        let mut model = Self {
            kind: ModelKind::Pilot(Pilot { order }),
            table: pilot::table(order),
        };
        let values = theta.iter().copied().chain([stick_limit]);
        model.set_parameters(values);
        model
    }

    /// A quadcopter at hover at the origin.
    pub fn quadcopter(vehicle: &Quadcopter) -> Self {
        let mut model = Self {
            kind: ModelKind::Quadcopter,
            table: quadcopter::table(),
        };
        model.set_parameters(crate::COEFFICIENTS.iter().map(|c| (c.get)(vehicle)));
        model
    }

    /// Sets the start values of the parameters proper. They are checked on export.
    fn set_parameters(&mut self, values: impl Iterator<Item = f64>) {
        let inputs = self.inputs().len();
        let starts = self.table.starts_mut().skip(inputs);
        for ((_, start), value) in starts.zip(values) {
            *start = value;
        }
    }

    /// Kind of the model.
    pub fn kind(&self) -> ModelKind {
        self.kind
    }

    /// The table of variables.
    pub fn variable_table(&self) -> &Table {
        &self.table
    }

    /// The variables, in the order of their value references.
    pub fn variables(&self) -> &[Variable] {
        self.table.variables()
    }

    /// Index of the variable with that name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.table.index(name)
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.table.n_states()
    }

    /// Indices of the inputs.
    pub fn inputs(&self) -> Range<usize> {
        self.table.inputs()
    }

    /// Indices of the outputs.
    pub fn outputs(&self) -> Range<usize> {
        self.table.outputs()
    }

    /// Indices of the parameters proper: θ and the stick limit, or the vehicle's coefficients.
    pub fn coefficients(&self) -> Range<usize> {
        self.table.parameters()
    }

    /// Indices of the states' start values.
    pub fn starts(&self) -> Range<usize> {
        self.table.starts()
    }

    /// FMI's `guid`: see [`Table::guid`].
    pub fn guid(&self) -> String {
        self.table.guid()
    }

    /// Checks that the variables allow their start values.
    ///
    /// # Errors
    /// If a start value is not finite or out of range: the error names the first such variable.
    pub fn check(&self) -> Result<(), crate::ValueError> {
        self.table.check()
    }
}

impl Equations for Model {
    fn table(&self) -> Table {
        self.table.clone()
    }

    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
        match self.kind {
            ModelKind::Pilot(pilot) => pilot.derivative(at.x, at.u[0] - at.u[1], at.p, dx),
            ModelKind::Quadcopter => {
                let coefficients = std::array::from_fn(|i| at.p[i]);
                crate::quadcopter::derivative(coefficients, at.x, at.u[0], dx);
            }
        }
    }

    /// Stick and error of the pilot; the quadcopter's outputs are states.
    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        if let ModelKind::Pilot(pilot) = self.kind {
            y[0] = pilot.output(at.x, at.p);
            y[1] = at.u[0] - at.u[1];
        }
    }

    fn is_linear(&self) -> bool {
        matches!(self.kind, ModelKind::Pilot(_))
    }
}
