//! The pilot's variables.

use crate::variable::Role;
use crate::{Table, Unit, Variable};
use pilotage_units::power;

/// Inputs `target`, `position`; outputs `stick`, `error`; `theta1..`, `stick_limit`; `x1_start..`; states `x1..`. All
/// parameters are 0, and the stick limit is 1.
pub(super) fn table(order: usize) -> Table {
    let about = format!(
        "Human pilot as a linear system of order {order}, from the error that it sees to the stick."
    );
    let limit = Variable::parameter(
        "stick_limit",
        Unit::of("1"),
        Role::Fixed,
        1.0,
        "Largest magnitude of the stick",
    );
    let mut table = Table::new("pilot", &about)
        .input("target", "m", "Position to go to, ŷ")
        .input("position", "m", "Position of the vehicle, y_v")
        .output("stick", "1", "Stick, y_p, within the stick limit")
        .output(
            "error",
            "m",
            "Error that the pilot sees, target minus position",
        );
    for i in 0..2 * order {
        table = table.with(parameter(order, i));
    }
    table = table
        .with(limit.range(Some(0.0), None))
        .limited("stick", "stick_limit");
    for i in 0..order {
        table = table.state_with(state(order, i), 0.0);
    }
    table
}

/// θ_{i+1}, with the units that [`crate::pilot`] derives.
fn parameter(n: usize, i: usize) -> Variable {
    let (unit, meaning) = match i < n {
        true => (
            Unit::of(&format!("1/{}", power("s", n - i))),
            "Coefficient of the denominator at s^",
        ),
        false => (
            Unit::of(&format!("1/(m.{})", power("s", 2 * n - i))),
            "Coefficient of the numerator at s^",
        ),
    };
    let description = format!("{meaning}{}", i % n);
    let name = format!("theta{}", i + 1);
    Variable::parameter(&name, unit, Role::Tunable, 0.0, &description)
}

fn state(n: usize, i: usize) -> Variable {
    let name = format!("x{}", i + 1);
    let description = format!("State x_{} of the pilot", i + 1);
    let unit = Unit::of(&format!("m.{}", power("s", n - i)));
    Variable::calculated(&name, unit, Role::State, &description)
}
