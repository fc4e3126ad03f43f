//! Constraints on the parameters alone.

use num_dual::DualNum;
use pilotage_expression::{Graph, Node, Obstacle, Tape, Traced, trace};

/// Constraints `values(θ) ≥ 0`, such as the stability of an identified model.
#[derive(Debug, Clone, Default)]
pub struct ParameterConstraints {
    tape: Tape,
    count: usize,
}

impl ParameterConstraints {
    /// The constraints of equations on so many parameters.
    ///
    /// # Errors
    /// Where the equations do what no graph says.
    pub fn trace(
        parameters: usize,
        values: impl FnOnce(&[Traced]) -> Vec<Traced>,
    ) -> Result<Self, Obstacle> {
        let (graph, values) = trace(parameters, values)?;
        Ok(Self::of(&graph, parameters, &values))
    }

    /// The constraints that these expressions over the parameters are.
    pub fn of(graph: &Graph, parameters: usize, values: &[Node]) -> Self {
        Self {
            tape: Tape::new(graph, parameters, |_| true, &[values]),
            count: values.len(),
        }
    }

    /// Number of constraints.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Their values; each must be at least zero.
    pub fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T]) -> Vec<T> {
        match self.count {
            0 => Vec::new(),
            _ => self.tape.evaluate(theta),
        }
    }
}
