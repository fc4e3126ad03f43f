//! Values that are no reals, under strong coupling.

use super::components::{Linear, simulate};
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Abilities, Algorithm, Component, Ending, Progress, Role, System, Value, ValueKind, Variable,
};

/// What it gives at the end of a step is a function of what it got for the step: of a real or a boolean a
/// boolean, or of a boolean a real.
struct Logic {
    f: fn(f64) -> f64,
    u: f64,
    y: f64,
    saved: [(f64, f64); 3],
    variables: Vec<Variable>,
}

impl Logic {
    fn new(from: ValueKind, to: ValueKind, f: fn(f64) -> f64) -> Self {
        Self {
            f,
            u: 0.0,
            y: f(0.0),
            saved: [(0.0, 0.0); 3],
            variables: vec![
                Variable::new("u", 0, from, Role::Input),
                Variable {
                    feedthrough: vec![0],
                    ..Variable::new("y", 1, to, Role::Output)
                },
            ],
        }
    }
}

impl Component for Logic {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.y = (self.f)(self.u);
        Ok(())
    }

    fn set_reals(&mut self, _handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.u = values[0];
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values[0] = self.y;
        Ok(())
    }

    fn get(&mut self, _handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        Ok(match kind {
            ValueKind::Boolean => Value::Boolean(self.y > 0.5),
            _ => Value::Real(self.y),
        })
    }

    fn step(&mut self, _t: f64, _h: f64) -> Result<Progress, ComponentError> {
        self.y = (self.f)(self.u);
        Ok(Progress::Done)
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            variable_steps: true,
            ..Abilities::default()
        }
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        self.saved[place] = (self.u, self.y);
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        (self.u, self.y) = self.saved[place];
        Ok(())
    }
}

fn add(system: &mut System, name: &str, component: impl Component + 'static) {
    system.add(name, Box::new(component)).unwrap();
}

/// A level of a growing signal is passed through two gates: with Jacobi each is a step late, with strong
/// coupling both have changed at the same communication point.
#[test]
fn a_change_goes_through_a_chain_at_once() {
    let changes = |algorithm| {
        let mut system = System::new();
        let ramp = Linear::new(0.0, 1.0, 1.0, 0.0).revocable();
        add(&mut system, "ramp", ramp);
        add(
            &mut system,
            "level",
            Logic::new(ValueKind::Real, ValueKind::Boolean, |u| {
                f64::from(u8::from(u > 0.55))
            }),
        );
        let not: fn(f64) -> f64 = |u| 1.0 - u;
        add(
            &mut system,
            "not",
            Logic::new(ValueKind::Boolean, ValueKind::Boolean, not),
        );
        add(
            &mut system,
            "again",
            Logic::new(ValueKind::Boolean, ValueKind::Boolean, not),
        );
        system.connect("ramp.y", "level.u").unwrap();
        system.connect("level.y", "not.u").unwrap();
        system.connect("not.y", "again.u").unwrap();
        system.set("ramp.u", "1").unwrap();
        let (run, recorder) = simulate(system, 1.0, 0.1, algorithm);
        assert!(matches!(run.ending, Ending::Completed));
        let row = |name| {
            let values = &recorder.series.column(name).unwrap().values;
            (values.windows(2).position(|pair| pair[0] != pair[1])).map(|k| k + 1)
        };
        let steps = run.report.steps;
        (
            ["level.y", "not.y", "again.y"].map(row),
            steps.repeated,
            steps.unsettled,
        )
    };
    assert_eq!(
        changes(Algorithm::Jacobi),
        ([Some(7), Some(8), Some(9)], 0, 0)
    );
    // Each link of the chain takes one more repetition.
    assert_eq!(
        changes(Algorithm::Strong),
        ([Some(6), Some(6), Some(6)], 2, 0)
    );
}

/// A thermostat that is on where that makes it off: nothing settles, the steps are taken all the same, with
/// the value of their begin, and are counted.
#[test]
fn what_does_not_settle_is_a_step_late_and_counted() {
    let mut system = System::new();
    // ẋ = -x + u from 0 to 1; on while below 0.5.
    let room = Linear::new(-1.0, 1.0, 1.0, 0.0).revocable();
    add(&mut system, "room", room);
    add(
        &mut system,
        "cold",
        Logic::new(ValueKind::Real, ValueKind::Boolean, |u| {
            f64::from(u8::from(u < 0.5))
        }),
    );
    add(
        &mut system,
        "heater",
        Logic::new(ValueKind::Boolean, ValueKind::Real, |u| u),
    );
    system.connect("room.y", "cold.u").unwrap();
    system.connect("cold.y", "heater.u").unwrap();
    system.connect("heater.y", "room.u").unwrap();
    let (run, recorder) = simulate(system, 5.0, 0.1, Algorithm::Strong);
    assert!(matches!(run.ending, Ending::Completed));
    let steps = run.report.steps;
    assert!(
        steps.unsettled > 0 && steps.unsettled < steps.accepted,
        "{steps:?}"
    );
    let y = recorder.series.column("room.y").unwrap();
    for y in &y.values[10..] {
        assert!((y - 0.5).abs() < 0.06, "{y}");
    }
}
