//! The quadcopter's variables.

use crate::coefficient::COEFFICIENTS;
use crate::quadcopter::{N_STATES, STATE_NAMES};
use crate::variable::Role;
use crate::{Quadcopter, Table, Unit, Variable};

/// Unit, typical magnitude and meaning of a state.
type State = (&'static str, f64, &'static str);

const STATES: [State; N_STATES] = [
    ("m", 1.0, "position z"),
    ("rad", 0.1, "pitch angle φ, nose-up positive"),
    ("m/s", 1.0, "velocity v"),
    ("rad/s", 0.1, "pitch rate q"),
    (
        "krad/s",
        0.01,
        "front rotors' speed minus that of hover, ω_f",
    ),
    (
        "krad/s",
        0.01,
        "back rotors' speed minus that of hover, ω_b",
    ),
];

/// Input `stick`; the six states as outputs; the coefficients of the default vehicle; `z_start` and the other start
/// values.
pub(super) fn table() -> Table {
    let mut table = Table::new(
        "quadcopter",
        "Pitch axis of a quadcopter with its attitude controller, from the stick to the position.",
    )
    .with(
        Variable::input(
            "stick",
            Unit::of("1"),
            "Stick of the pilot; forward is negative",
        )
        .range(Some(-1.0), Some(1.0)),
    );
    for c in &COEFFICIENTS {
        let start = (c.get)(&Quadcopter::default());
        let meaning = capitalised(c.meaning);
        let parameter = Variable::parameter(c.name, Unit::of(c.unit), Role::Fixed, start, &meaning);
        table = table.with(parameter.range(Some(c.range.0), Some(c.range.1)));
    }
    for (name, (unit, nominal, meaning)) in STATE_NAMES.iter().zip(STATES) {
        let state = Variable::calculated(name, Unit::of(unit), Role::Output, &capitalised(meaning));
        table = table.state_with(state.nominal(nominal), 0.0);
    }
    table
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map(|first| first.to_uppercase().chain(chars).collect())
        .unwrap_or_default()
}
