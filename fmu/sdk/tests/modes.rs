//! Modes: Booleans that change only at events.

use pilotage_sdk::structure::Structure;
use pilotage_sdk::{At, Equations, Scalar, Simulation, Table};

/// A room with a heater that switches on below 19 °C and off above 21 °C.
#[derive(Debug, Clone, Default)]
struct Room;

impl Equations for Room {
    fn table(&self) -> Table {
        // The mode is declared first, but follows the state in the equations' `x`.
        Table::new("room", "A room with a thermostat")
            .mode("heating", true, "Whether the heater is on")
            .parameter("power", "1/s", 2.0, "Rate of warming")
            .output_state("excess", "1", 0.0, "Temperature above 20 degrees")
            .output("bill", "1/s", "What heating costs")
            .indicator("cold", "1", "Distance to the lower limit")
            .indicator("warm", "1", "Distance to the upper limit")
    }

    fn derivative<T: Scalar>(&self, At { x, p, .. }: At<T>, dx: &mut [T]) {
        assert_eq!(dx.len(), 1);
        dx[0] = p[0] * x[1] - 1.0;
    }

    fn output<T: Scalar>(&self, At { x, .. }: At<T>, y: &mut [T]) {
        // A branch, which derivatives do not reveal.
        y[0] = T::from(if x[1].re() > 0.5 { 1.0 } else { 0.0 });
    }

    fn indicators<T: Scalar>(&self, At { x, .. }: At<T>, z: &mut [T]) {
        z[0] = x[0] + 1.0 + x[1];
        z[1] = x[0] - x[1];
    }

    fn event(&self, At { x, .. }: At<f64>, after: &mut [f64]) {
        match x[1] > 0.5 {
            // Any number other than 0 is true.
            false if x[0] <= -1.0 => after[1] = 7.0,
            true if x[0] >= 1.0 => after[1] = 0.0,
            _ => {}
        }
    }
}

fn index(name: &str) -> usize {
    Room.table().index(name).expect("it is declared")
}

/// Starting at 0, it warms for one second, then cools for two and warms for two, exactly linearly.
#[test]
fn a_mode_switches_at_events_whatever_the_step() {
    for h in [0.05, 0.3, 1.5] {
        let mut room = Simulation::new(Room);
        let steps = (4.5 / h) as usize;
        for k in 1..=steps {
            room.step(h).expect("nothing is stiff");
            let phase = (k as f64 * h + 1.0) % 4.0;
            let (excess, heating) = match phase < 2.0 {
                true => (phase - 1.0, 1.0),
                false => (3.0 - phase, 0.0),
            };
            assert!((room.get(index("excess")) - excess).abs() < 1e-9, "{k} {h}");
            // At the event itself both values are correct.
            if (phase % 2.0 - 1.0).abs() < 0.999 {
                assert_eq!(room.get(index("heating")), heating, "step {k} of {h}");
            }
        }
    }
}

#[test]
fn a_mode_is_part_of_the_snapshot_and_no_continuous_state() {
    let mut room = Simulation::new(Room);
    assert_eq!((room.table().n_states(), room.table().n_x()), (1, 2));
    room.step(1.5).expect("it switches off");
    assert_eq!(room.get(index("heating")), 0.0);
    let off = room.snapshot().clone();
    room.set_states(&[0.25]);
    assert_eq!(room.get(index("heating")), 0.0, "states leave it alone");
    room.reset();
    assert_eq!(room.get(index("heating")), 1.0);
    room.restore(&off);
    assert_eq!(room.snapshot(), &off);
    room.set(index("heating"), 1.0).expect("a Boolean");
    assert_eq!(room.get(index("bill")), 1.0);
    let error = room.set(index("heating"), 0.5).expect_err("no Boolean");
    assert_eq!(
        error.to_string(),
        "heating = 0.5 is no Boolean; set 0 for false or 1 for true"
    );
}

/// Everything that changes with the mode depends on it, even through a branch, but never with a constant factor.
#[test]
fn dependencies_on_a_mode_are_found() {
    let table = Room.table();
    let structure = Structure::of(&Room, &table);
    let heating = index("heating");
    let on_it: Vec<_> = (structure.initial.iter())
        .filter(|u| {
            u.dependencies
                .iter()
                .any(|d| d.index == heating && !d.constant)
        })
        .map(|u| table.variables()[u.index].name.as_str())
        .collect();
    assert_eq!(on_it, ["bill", "der(excess)"]);
    assert!(structure.initial.iter().all(|u| u.index != heating));
    // It is an output that depends on no known while the simulation runs.
    let own = structure.unknown(heating).expect("an output");
    assert!(own.dependencies.is_empty());
    let rate = structure.unknown(index("der(excess)"));
    assert!(rate.expect("an unknown").dependencies.is_empty());
}
