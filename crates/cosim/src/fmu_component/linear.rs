//! Linearization of an FMU about its current state.

use super::Access;
use crate::component::ComponentError;
use pilotage_fmi::description::{
    Causality, ModelDescription, ScalarVariable, Variability, VariableKind,
};
use pilotage_fmi::{Instance, ModelExchangeRun};
use pilotage_linear::StateSpace;
use thiserror::Error;

/// Why an FMU cannot be linearized.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(super) enum LinearError {
    /// Its states are hidden, and their derivatives are not available.
    #[error(
        "it is for co-simulation, gives no directional derivatives and cannot go back to a saved state, so \
         that nothing can be found of its states; take it for model exchange (--kind me), if it can be"
    )]
    Opaque,
    /// A listed derivative does not belong to a scalar state.
    #[error("its derivative `{name}` belongs to no state that is a single real")]
    Derivative {
        /// The derivative's name.
        name: String,
    },
}

/// Names and value references of continuous states, inputs and outputs.
#[derive(Debug, Default)]
pub(super) struct Knowns {
    names: [Vec<String>; 3],
    /// The states, then the inputs.
    knowns: Vec<u32>,
    /// Derivatives of the states, then the outputs.
    unknowns: Vec<u32>,
    /// Name of a derivative that does not belong to a scalar state.
    strange: Option<String>,
}

impl Knowns {
    pub(super) fn of(description: &ModelDescription) -> Self {
        let mut all = Self::default();
        for unknown in &description.structure.derivatives {
            let derivative = variable(description, unknown.index);
            match derivative.and_then(|d| Some((d, state_of(description, d)?))) {
                Some((derivative, state)) => {
                    all.names[0].push(state.name.clone());
                    all.knowns.push(state.value_reference);
                    all.unknowns.push(derivative.value_reference);
                }
                None => {
                    let name = derivative.map(|derivative| derivative.name.clone());
                    all.strange = name.or_else(|| Some(format!("index {}", unknown.index)));
                }
            }
        }
        let continuous = description.variables.iter().filter(|v| {
            let is_real = matches!(v.kind, VariableKind::Real(_));
            is_real && v.dimensions.is_empty() && v.variability == Variability::Continuous
        });
        for variable in continuous {
            let name = variable.name.clone();
            if variable.causality == Causality::Input {
                all.names[1].push(name);
                all.knowns.push(variable.value_reference);
            } else if variable.causality == Causality::Output {
                all.names[2].push(name);
                all.unknowns.push(variable.value_reference);
            }
        }
        all
    }

    /// Whether the description lists continuous states.
    pub(super) fn has_states(&self) -> bool {
        !self.names[0].is_empty()
    }

    /// Names and value references of the inputs, and of the outputs.
    pub(super) fn ends(&self) -> [(&[String], &[u32]); 2] {
        let n = self.names[0].len();
        [
            (&self.names[1], &self.knowns[n..]),
            (&self.names[2], &self.unknowns[n..]),
        ]
    }

    /// Linearizes by directional derivatives.
    pub(super) fn by_derivatives(
        &self,
        instance: &mut Instance,
    ) -> Result<StateSpace, ComponentError> {
        self.check()?;
        if !instance.provides_directional_derivatives() {
            return Err(LinearError::Opaque.into());
        }
        StateSpace::from_columns(self.names.clone(), |k| {
            let mut column = vec![0.0; self.unknowns.len()];
            // Avoids a call without outputs, which a description may lack.
            if !column.is_empty() {
                let known = &self.knowns[k..=k];
                instance.directional_derivative(&self.unknowns, known, &[1.0], &mut column)?;
            }
            Ok(column)
        })
    }

    /// Linearizes in model exchange: by directional derivatives if available, otherwise by central differences.
    pub(super) fn of_run(
        &self,
        run: &mut ModelExchangeRun,
        access: &Access,
    ) -> Result<StateSpace, ComponentError> {
        self.check()?;
        // Enter continuous-time mode, where states and inputs may be changed.
        run.step_to(run.time())?;
        if run.instance().provides_directional_derivatives() {
            return self.by_derivatives(run.instance());
        }
        let states = run.states().to_vec();
        let n = states.len();
        let mut nominals = vec![1.0; n];
        let instance = run.instance();
        if n > 0 {
            instance.get_nominals(&mut nominals)?;
        }
        let mut column = |k: usize| -> Result<Vec<f64>, ComponentError> {
            let middle = match k < n {
                true => states[k],
                false => {
                    let mut value = [0.0];
                    access.get_reals(instance, &self.knowns[k..=k], &mut value)?;
                    value[0]
                }
            };
            let nominal = nominals.get(k).copied().unwrap_or(1.0).abs();
            // Truncation and rounding errors are about equal at the cube root of the rounding unit.
            let step = f64::EPSILON.cbrt() * middle.abs().max(nominal);
            let ends = [middle + step, middle - step];
            let [above, below] = ends.map(|value| self.moved(instance, access, &states, k, value));
            let (above, below) = (above?, below?);
            self.moved(instance, access, &states, k, middle)?;
            let difference = |(above, below): (&f64, &f64)| (above - below) / (ends[0] - ends[1]);
            Ok(above.iter().zip(&below).map(difference).collect())
        };
        StateSpace::from_columns(self.names.clone(), &mut column)
    }

    /// Derivatives and outputs after changing one known to `value`.
    fn moved(
        &self,
        instance: &mut Instance,
        access: &Access,
        states: &[f64],
        k: usize,
        value: f64,
    ) -> Result<Vec<f64>, ComponentError> {
        let n = states.len();
        match k < n {
            true => {
                let mut states = states.to_vec();
                states[k] = value;
                instance.set_continuous_states(&states)?;
            }
            false => access.set_reals(instance, &self.knowns[k..=k], &[value])?,
        }
        let mut found = vec![0.0; self.unknowns.len()];
        if n > 0 {
            instance.get_derivatives(&mut found[..n])?;
        }
        access.get_reals(instance, &self.unknowns[n..], &mut found[n..])?;
        Ok(found)
    }

    fn check(&self) -> Result<(), LinearError> {
        match &self.strange {
            Some(name) => Err(LinearError::Derivative { name: name.clone() }),
            None => Ok(()),
        }
    }
}

fn variable(description: &ModelDescription, index: u32) -> Option<&ScalarVariable> {
    description.variables.get((index as usize).checked_sub(1)?)
}

/// The scalar state whose derivative the variable is.
fn state_of<'a>(
    description: &'a ModelDescription,
    derivative: &ScalarVariable,
) -> Option<&'a ScalarVariable> {
    let VariableKind::Real(real) = &derivative.kind else {
        return None;
    };
    let state = variable(description, real.derivative?)?;
    (derivative.dimensions.is_empty() && state.dimensions.is_empty()).then_some(state)
}
