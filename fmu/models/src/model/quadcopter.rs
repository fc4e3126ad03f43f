//! The quadcopter's variables.

use crate::coefficient::COEFFICIENTS;
use crate::quadcopter::{N_STATES, STATE_NAMES};
use crate::variable::{Dependency, Role, Variable};
use crate::{Quadcopter, Unit};

/// Unit, typical magnitude and meaning of a state.
type State = (fn() -> Unit, f64, &'static str);

const STATES: [State; N_STATES] = [
    (Unit::metre, 1.0, "position z"),
    (Unit::radian, 0.1, "pitch angle φ, nose-up positive"),
    (Unit::metre_per_second, 1.0, "velocity v"),
    (Unit::radian_per_second, 0.1, "pitch rate q"),
    (
        Unit::kiloradian_per_second,
        0.01,
        "front rotors' speed minus that of hover, ω_f",
    ),
    (
        Unit::kiloradian_per_second,
        0.01,
        "back rotors' speed minus that of hover, ω_b",
    ),
];

/// Typical magnitudes of the states, in their units.
pub(crate) fn nominals() -> [f64; N_STATES] {
    STATES.map(|(_, nominal, _)| nominal)
}

/// Input `stick`; the six states as outputs; the coefficients; `z_start` and the like.
pub(super) fn variables(vehicle: &Quadcopter) -> Vec<Variable> {
    let mut variables = vec![Variable::input(
        "stick",
        Unit::one(),
        "Stick of the pilot, -1 to 1; forward is negative",
    )];
    variables.extend((0..N_STATES).map(output));
    variables.extend(COEFFICIENTS.iter().map(|c| {
        let (min, max) = c.range;
        let meaning = capitalised(c.meaning);
        Variable::parameter(c.name, (c.unit)(), Role::Fixed, (c.get)(vehicle), meaning)
            .range(Some(min), Some(max))
    }));
    variables.extend((0..N_STATES).map(|i| {
        let (unit, _, meaning) = STATES[i];
        let name = format!("{}_start", STATE_NAMES[i]);
        let description = format!("Initial {meaning}");
        Variable::parameter(name, unit(), Role::Fixed, 0.0, description)
    }));
    variables
}

/// A state; no input reaches it within an instant, and at first it is its start value.
fn output(i: usize) -> Variable {
    let (unit, nominal, meaning) = STATES[i];
    let start = Dependency {
        index: 1 + N_STATES + COEFFICIENTS.len() + i,
        constant: true,
    };
    let description = capitalised(meaning);
    Variable::output(STATE_NAMES[i], unit(), vec![], vec![start], &description).nominal(nominal)
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map(|first| first.to_uppercase().chain(chars).collect())
        .unwrap_or_default()
}
