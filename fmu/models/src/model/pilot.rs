//! The pilot's variables.

use crate::variable::{Dependency, Role, Variable};
use crate::{Pilot, Unit};

/// Inputs `target`, `position`; outputs `stick`, `error`; `theta1..`, `stick_limit`; `x1_start..`.
pub(super) fn variables(theta: &[f64], stick_limit: f64) -> Vec<Variable> {
    let pilot = Pilot {
        order: theta.len() / 2,
    };
    let mut variables = vec![
        Variable::input("target", Unit::metre(), "Position to go to, ŷ"),
        Variable::input("position", Unit::metre(), "Position of the vehicle, y_v"),
        stick(pilot.order),
        error(),
    ];
    variables.extend(
        theta
            .iter()
            .enumerate()
            .map(|(i, &v)| parameter(pilot, i, v)),
    );
    let limit = Variable::parameter(
        "stick_limit",
        Unit::one(),
        Role::Fixed,
        stick_limit,
        "Largest magnitude of the stick",
    );
    variables.push(limit.range(Some(0.0), None));
    variables.extend((0..pilot.order).map(|i| start(pilot.order, i)));
    variables
}

/// θ_{i+1}, with the units that [`crate::pilot`] derives.
fn parameter(pilot: Pilot, i: usize, value: f64) -> Variable {
    let n = pilot.order;
    let (unit, meaning) = match i < n {
        true => (
            Unit::per_second(n - i),
            "Coefficient of the denominator at s^",
        ),
        false => (
            Unit::per_metre_second(2 * n - i),
            "Coefficient of the numerator at s^",
        ),
    };
    let description = format!("{meaning}{}", i % n);
    Variable::parameter(
        format!("theta{}", i + 1),
        unit,
        Role::Tunable,
        value,
        description,
    )
}

fn start(order: usize, i: usize) -> Variable {
    Variable::parameter(
        format!("x{}_start", i + 1),
        Unit::metre_second(order - i),
        Role::Fixed,
        0.0,
        format!("Initial value of the pilot's state x_{}", i + 1),
    )
}

/// No input reaches the stick but through the states; at first they are the start values.
fn stick(n: usize) -> Variable {
    let outputs_at = 4;
    let initial = (outputs_at + n..outputs_at + 3 * n + 1)
        .map(|index| Dependency {
            index,
            constant: false,
        })
        .collect();
    let description = "Stick, y_p, within the stick limit";
    Variable::output("stick", Unit::one(), vec![], initial, description)
}

fn error() -> Variable {
    let inputs: Vec<_> = (0..2)
        .map(|index| Dependency {
            index,
            constant: true,
        })
        .collect();
    let description = "Error that the pilot sees, target minus position";
    Variable::output("error", Unit::metre(), inputs.clone(), inputs, description)
}
