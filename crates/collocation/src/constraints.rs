//! Constraints that depend only on the parameters.

use num_dual::DualNum;
use pilotage_expression::{Graph, Node, Obstacle, Tape, Traced, trace};

/// Constraints `values(θ) ≥ 0`, such as the stability of an identified model.
#[derive(Debug, Clone, Default)]
pub struct ParameterConstraints {
    tape: Tape,
    count: usize,
    /// Known parameters with their indices among all parameters, ascending.
    known: Vec<(usize, f64)>,
}

impl ParameterConstraints {
    /// The constraints given by equations on this number of parameters.
    ///
    /// # Errors
    /// If the equations perform an operation that a graph cannot represent.
    pub fn trace(
        parameters: usize,
        values: impl FnOnce(&[Traced]) -> Vec<Traced>,
    ) -> Result<Self, Obstacle> {
        let (graph, values) = trace(parameters, values)?;
        Ok(Self::of(&graph, parameters, &values))
    }

    /// The constraints given by these expressions over the parameters.
    pub fn of(graph: &Graph, parameters: usize, values: &[Node]) -> Self {
        Self {
            tape: Tape::new(graph, parameters, |_| true, &[values]),
            count: values.len(),
            known: Vec::new(),
        }
    }

    /// The same constraints with one of the parameters known.
    pub fn with_parameter(&self, parameter: usize, value: f64) -> Self {
        let mut own = self.clone();
        // Its index among all parameters.
        let place =
            (self.known.iter()).fold(parameter, |at, (known, _)| at + usize::from(*known <= at));
        own.known.push((place, value));
        own.known.sort_by_key(|(place, _)| *place);
        own
    }

    /// Number of constraints.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Values of the constraints; each must be at least zero.
    pub fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T]) -> Vec<T> {
        match (self.count, self.known.is_empty()) {
            (0, _) => Vec::new(),
            (_, true) => self.tape.evaluate(theta),
            (_, false) => {
                let mut all = theta.to_vec();
                let known = self.known.iter();
                known.for_each(|(place, value)| all.insert(*place, T::from(*value)));
                self.tape.evaluate(&all)
            }
        }
    }
}
