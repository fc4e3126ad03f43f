//! Equations of the SDK's trait as an expression graph, for fitting and linearisation.

use pilotage_expression::{Model, Obstacle, Traced};
use pilotage_sdk::{At, Equations, Table};

/// Why a model cannot be traced.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TraceError {
    /// The equations use an operation that a graph cannot represent.
    #[error("model {model}: {obstacle}")]
    Obstacle {
        /// Name of the model.
        model: String,
        /// Reason.
        obstacle: Obstacle,
    },
    /// The equations do not write an output or derivative.
    #[error("model {model}: the equations do not write {variable}, which its table declares")]
    Unwritten {
        /// Name of the model.
        model: String,
        /// The variable.
        variable: String,
    },
    /// The model has events.
    #[error("model {0} has events, which a fit does not follow: fit it without them")]
    Events(String),
}

/// Traces the equations as a model, with the names of their table. Its outputs are those that the equations write,
/// before any [limit](Table::limited).
///
/// # Errors
/// If the equations compare numbers, have events, or do not write an output.
pub fn traced<E: Equations>(equations: &E) -> Result<Model, TraceError> {
    let table = equations.table();
    let name = || table.name().to_owned();
    if table.n_indicators() > 0 || table.modes().next().is_some() {
        return Err(TraceError::Events(name()));
    }
    let names = |indices: Vec<usize>| -> Vec<&str> {
        let of = |index: usize| table.variables()[index].name.as_str();
        indices.into_iter().map(of).collect()
    };
    let lists = [
        names(table.states().collect()),
        names(table.inputs().collect()),
        names(table.parameters().collect()),
        names(table.computed().collect()),
    ];
    let model = Model::trace(lists.each_ref().map(Vec::as_slice), |point| {
        let at = At {
            time: point.time,
            x: point.x,
            u: point.u,
            p: point.p,
        };
        let unwritten = Traced::from(f64::NAN);
        let mut dx = vec![unwritten; table.n_states()];
        let mut y = vec![unwritten; table.computed().count()];
        equations.derivative(at, &mut dx);
        equations.output(at, &mut y);
        [dx, y]
    });
    let model = model.map_err(|obstacle| TraceError::Obstacle {
        model: name(),
        obstacle,
    })?;
    let system = &model.system;
    let written = (system.derivatives.iter().zip(&model.states))
        .chain(system.outputs.iter().zip(&model.outputs));
    for (node, variable) in written {
        if system.graph.value(*node).is_some_and(f64::is_nan) {
            return Err(TraceError::Unwritten {
                model: name(),
                variable: variable.clone(),
            });
        }
    }
    Ok(model)
}

/// Names and start values of a table's parameters.
pub fn start_values(table: &Table) -> impl Iterator<Item = (&str, f64)> {
    let variables = table.variables();
    let of = |index: usize| {
        (
            variables[index].name.as_str(),
            variables[index].start.unwrap_or(0.0),
        )
    };
    table.parameters().map(of)
}
