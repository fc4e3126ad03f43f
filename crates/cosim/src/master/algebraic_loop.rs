//! Newton's method for algebraic loops between components during initialization. Components may be set and read any
//! number of times there (FMI 2.0, section 4.2.4).

use super::lu::Lu;
use super::{MasterError, Stage};
use crate::component::{ComponentError, Value, ValueKind};
use crate::system::{Connection, Port, System};

/// Maximum number of Newton steps, and of halvings of one step.
const MAX_STEPS: usize = 50;
const MAX_HALVINGS: usize = 10;

/// The target for the remaining differences, relative to the values themselves. If rounding prevents it, the same relative to
/// `1 + |value|` suffices after some steps, and a larger one if no step is better.
const AIM: f64 = 1e-12;
const STEPS_AT_NOISE: usize = 3;
const ENOUGH: f64 = 1e-9;

/// Relative change of a value for finite differences, if a component provides no derivatives.
const DIFFERENCE: f64 = 1e-6;

/// A loop whose gain is closer to 1 than this counts as singular.
const SINGULAR: f64 = 1e-8;

/// Solves for the inputs of these real connections (positions in the system) that equal the outputs that feed them.
pub(super) fn solve(system: &mut System, positions: &[usize]) -> Result<(), MasterError> {
    let connections: Vec<_> = positions
        .iter()
        .map(|&c| system.connections[c].clone())
        .collect();
    let n = connections.len();
    let mut values = outputs(system, &connections)?;
    let mut found = inputs_to_outputs(system, &connections, &values)?;
    for step in 0..MAX_STEPS {
        let size = difference(&values, &found, 0.0);
        if size <= AIM {
            return Ok(());
        }
        let rough = difference(&values, &found, 1.0);
        let mut matrix = jacobian(system, &connections, &values, &found)?;
        let mut direction: Vec<f64> = (0..n).map(|k| found[k] - values[k]).collect();
        let is_regular = matrix.factor(SINGULAR);
        if is_regular {
            if rough <= AIM && step >= STEPS_AT_NOISE {
                return Ok(());
            }
            matrix.solve(&mut direction);
        }
        let mut length = 1.0;
        let mut improved = None;
        for _ in 0..=MAX_HALVINGS {
            let next: Vec<f64> = (0..n).map(|k| values[k] + length * direction[k]).collect();
            let then = inputs_to_outputs(system, &connections, &next)?;
            if difference(&next, &then, 0.0) < size {
                improved = Some((next, then));
                break;
            }
            length /= 2.0;
        }
        match improved {
            Some((next, then)) => (values, found) = (next, then),
            // Without a regular matrix a small difference says nothing: the loop may have no solution.
            None if rough <= ENOUGH && is_regular => {
                inputs_to_outputs(system, &connections, &values)?;
                return Ok(());
            }
            None => return Err(unsolved(system, &connections, step + 1, size)),
        }
    }
    let size = difference(&values, &found, 0.0);
    Err(unsolved(system, &connections, MAX_STEPS, size))
}

fn unsolved(
    system: &System,
    connections: &[Connection],
    steps: usize,
    difference: f64,
) -> MasterError {
    let mut names: Vec<_> = (connections.iter())
        .map(|c| system.port_name(c.from))
        .collect();
    names.dedup();
    MasterError::AlgebraicLoop {
        names,
        steps,
        difference,
    }
}

/// Largest difference, relative to `least` plus the values; infinite if one is not a number.
fn difference(values: &[f64], found: &[f64], least: f64) -> f64 {
    let pairs = values.iter().zip(found);
    pairs.fold(0.0, |max, (value, found)| {
        let size = match value == found {
            true => 0.0,
            false => (value - found).abs() / (least + value.abs().max(found.abs())),
        };
        if size <= max {
            max
        } else if size.is_finite() {
            size
        } else {
            f64::INFINITY
        }
    })
}

/// The values provided by the connections.
fn outputs(system: &mut System, connections: &[Connection]) -> Result<Vec<f64>, MasterError> {
    connections.iter().map(|c| output(system, c)).collect()
}

/// Sets the inputs, and reads the values that the connections then provide.
fn inputs_to_outputs(
    system: &mut System,
    connections: &[Connection],
    values: &[f64],
) -> Result<Vec<f64>, MasterError> {
    for (connection, value) in connections.iter().zip(values) {
        set(system, connection.to, *value)?;
    }
    outputs(system, connections)
}

fn output(system: &mut System, connection: &Connection) -> Result<f64, MasterError> {
    let handle = system.variable(connection.from).handle;
    let component = &mut system.instances[connection.from.instance].component;
    match component.get(handle, ValueKind::Real) {
        Ok(value) => Ok(connection.conversion.apply(value.as_number())),
        Err(source) => Err(failed(system, connection.from, source)),
    }
}

fn set(system: &mut System, port: Port, value: f64) -> Result<(), MasterError> {
    let handle = system.variable(port).handle;
    let component = &mut system.instances[port.instance].component;
    let done = component.set(handle, &Value::Real(value));
    done.map_err(|source| failed(system, port, source))
}

fn failed(system: &System, port: Port, source: ComponentError) -> MasterError {
    MasterError::Initialization {
        instance: system.instances[port.instance].name.clone(),
        stage: Stage::Propagate(system.variable(port).name.clone()),
        source,
    }
}

/// `I - ∂F/∂z`, where `F` maps input values to the values of the outputs that feed them: exact if components provide
/// derivatives, otherwise by finite differences.
fn jacobian(
    system: &mut System,
    connections: &[Connection],
    values: &[f64],
    found: &[f64],
) -> Result<Lu, MasterError> {
    let mut matrix = Lu::new(connections.len());
    matrix.set_identity();
    for (column, changed) in connections.iter().enumerate() {
        let depends = |c: &Connection| {
            c.from.instance == changed.to.instance
                && (system.variable(c.from).initial_feedthrough).contains(&changed.to.variable)
        };
        let rows: Vec<usize> = (0..connections.len())
            .filter(|&row| depends(&connections[row]))
            .collect();
        let instance = &system.instances[changed.to.instance];
        let slopes = match instance.component.abilities().directional_derivatives {
            true => derivatives(system, connections, &rows, changed.to)?,
            false => differences(system, connections, &rows, column, values, found)?,
        };
        for (&row, slope) in rows.iter().zip(slopes) {
            matrix.add(row, column, -slope);
        }
    }
    Ok(matrix)
}

fn derivatives(
    system: &mut System,
    connections: &[Connection],
    rows: &[usize],
    input: Port,
) -> Result<Vec<f64>, MasterError> {
    let outputs: Vec<u32> = (rows.iter())
        .map(|&row| system.variable(connections[row].from).handle)
        .collect();
    let handle = system.variable(input).handle;
    let mut slopes = vec![0.0; rows.len()];
    let component = &mut system.instances[input.instance].component;
    let done = component.directional_derivative(&outputs, &[handle], &[1.0], &mut slopes);
    done.map_err(|source| failed(system, input, source))?;
    for (slope, &row) in slopes.iter_mut().zip(rows) {
        *slope *= connections[row].conversion.factor;
    }
    Ok(slopes)
}

fn differences(
    system: &mut System,
    connections: &[Connection],
    rows: &[usize],
    column: usize,
    values: &[f64],
    found: &[f64],
) -> Result<Vec<f64>, MasterError> {
    let (input, value) = (connections[column].to, values[column]);
    let change = DIFFERENCE * (1.0 + value.abs());
    set(system, input, value + change)?;
    let mut slopes = Vec::with_capacity(rows.len());
    for &row in rows {
        let changed = output(system, &connections[row])?;
        slopes.push((changed - found[row]) / change);
    }
    set(system, input, value)?;
    Ok(slopes)
}
