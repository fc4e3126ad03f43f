//! Wrong wires and values: the exact message of each.

use super::components::{Linear, simulate};
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{Algorithm, Progress};
use pilotage::cosim::{Base, Component, NativeComponent, Role, System, Unit, ValueKind, Variable};
use pilotage::models::{Model, Quadcopter};

/// A component that has variables and does nothing.
struct Inert(Vec<Variable>);

impl Component for Inert {
    fn variables(&self) -> &[Variable] {
        &self.0
    }
    fn set_reals(&mut self, _: &[u32], _: &[f64]) -> Result<(), ComponentError> {
        Ok(())
    }
    fn get_reals(&mut self, _: &[u32], _: &mut [f64]) -> Result<(), ComponentError> {
        Ok(())
    }
    fn step(&mut self, _: f64, _: f64) -> Result<Progress, ComponentError> {
        Ok(Progress::Done)
    }
}

/// A real output in a unit of length of that factor; `None`: the unit has a name only.
fn length(name: &str, unit: &str, factor: Option<f64>, role: Role) -> Variable {
    let base = factor.map(|factor| Base {
        exponents: [0, 1, 0, 0, 0, 0, 0, 0],
        factor,
        offset: 0.0,
    });
    Variable {
        unit: Some(Unit {
            name: unit.to_owned(),
            base,
        }),
        ..Variable::new(name, 0, ValueKind::Real, role)
    }
}

fn system() -> System {
    let mut system = System::new();
    let pilot = NativeComponent::new(Model::pilot(&[1.0; 6], 1.0));
    let quadcopter = NativeComponent::new(Model::quadcopter(&Quadcopter::default()));
    system.add("pilot", Box::new(pilot)).unwrap();
    system.add("quadcopter", Box::new(quadcopter)).unwrap();
    system
        .add("plain", Box::new(Linear::new(0.0, 0.0, 1.0, 0.0)))
        .unwrap();
    let table = Inert(vec![
        Variable::new("n", 0, ValueKind::Integer, Role::Output),
        Variable::new("m", 1, ValueKind::Integer, Role::Input),
        Variable::new("flag", 2, ValueKind::Boolean, Role::Input),
        Variable::new("mode", 3, ValueKind::Enumeration, Role::Input),
        Variable::new("inside", 4, ValueKind::Real, Role::Local),
        length("feet", "ft", Some(0.3048), Role::Output),
        length("metres", "metre", Some(1.0), Role::Output),
        length("named", "m", None, Role::Output),
    ]);
    system.add("table.1", Box::new(table)).unwrap();
    system
}

#[test]
fn wires_that_do_not_fit() {
    for (from, to, message) in [
        (
            "pilt.stick",
            "quadcopter.stick",
            "`pilt.stick`: there is no instance `pilt`; did you mean `pilot`?, known are `pilot`, `quadcopter`, `plain`, `table.1`",
        ),
        (
            "stick",
            "quadcopter.stick",
            "`stick` names no variable; expected INSTANCE.VARIABLE",
        ),
        (
            "pilot.sick",
            "quadcopter.stick",
            "`pilot.sick`: `pilot` has no variable `sick`; did you mean `pilot.stick`?",
        ),
        (
            "table.1.xyz",
            "quadcopter.stick",
            "`table.1.xyz`: `table.1` has no variable `xyz`",
        ),
        (
            "quadcopter.stick",
            "pilot.stick",
            "`quadcopter.stick` -> `pilot.stick`: `quadcopter.stick` is an input, a connection begins at an output; did you mean `pilot.stick` -> `quadcopter.stick`?",
        ),
        (
            "pilot.theta1",
            "quadcopter.stick",
            "`pilot.theta1` -> `quadcopter.stick`: `pilot.theta1` is a parameter, a connection begins at an output",
        ),
        (
            "table.1.inside",
            "plain.u",
            "`table.1.inside` -> `plain.u`: `table.1.inside` is a local variable, a connection begins at an output",
        ),
        (
            "pilot.stick",
            "quadcopter.z",
            "`pilot.stick` -> `quadcopter.z`: `quadcopter.z` is an output, a connection ends at an input",
        ),
        (
            "pilot.stick",
            "quadcopter.mass",
            "`pilot.stick` -> `quadcopter.mass`: `quadcopter.mass` is a parameter, a connection ends at an input",
        ),
        (
            "pilot.error",
            "quadcopter.stick",
            "`pilot.error` is in m and `quadcopter.stick` is in 1: one cannot be converted into the other",
        ),
        (
            "quadcopter.v",
            "pilot.position",
            "`quadcopter.v` is in m/s and `pilot.position` is in m: one cannot be converted into the other",
        ),
        (
            "table.1.n",
            "table.1.flag",
            "`table.1.n` -> `table.1.flag`: Integer cannot feed Boolean",
        ),
        (
            "pilot.stick",
            "table.1.flag",
            "`pilot.stick` -> `table.1.flag`: Real cannot feed Boolean",
        ),
        (
            "pilot.stick",
            "table.1.mode",
            "`pilot.stick` -> `table.1.mode`: Real cannot feed Enumeration",
        ),
    ] {
        assert_eq!(system().connect(from, to).unwrap_err().to_string(), message);
    }
}

/// Two integrators that hold each other's output, with units of a temperature and a length: what the
/// second gets is what the units' definitions say.
#[test]
fn values_are_converted_between_units_of_one_quantity() {
    let unit = |name: &str, exponents, factor, offset| Unit {
        name: name.to_owned(),
        base: Some(Base {
            exponents,
            factor,
            offset,
        }),
    };
    let temperature = [0, 0, 0, 0, 1, 0, 0, 0];
    let length = [0, 1, 0, 0, 0, 0, 0, 0];
    let kelvin = || unit("K", temperature, 1.0, 0.0);
    let celsius = || unit("degC", temperature, 1.0, 273.15);
    let fahrenheit = || unit("degF", temperature, 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0);
    let (foot, inch) = (
        unit("ft", length, 0.3048, 0.0),
        unit("in", length, 0.0254, 0.0),
    );
    for (from, to, value, expected) in [
        (celsius(), kelvin(), 20.0, 293.15),
        (celsius(), fahrenheit(), 100.0, 212.0),
        (kelvin(), celsius(), 0.0, -273.15),
        (foot, inch, 2.0, 24.0),
    ] {
        // The source keeps its value; the sink passes its input on at once.
        let source = Linear::new(0.0, 0.0, 1.0, 0.0)
            .from(value)
            .in_units(to.clone(), from.clone());
        let sink = Linear::new(0.0, 0.0, 0.0, 1.0).in_units(to.clone(), to.clone());
        let mut system = System::new();
        system.add("source", Box::new(source)).unwrap();
        system.add("sink", Box::new(sink)).unwrap();
        system.connect("source.y", "sink.u").unwrap();
        let converted = ["source.y", &from.name, "sink.u", &to.name].map(str::to_owned);
        assert_eq!(system.converted(), [converted]);
        let (run, recorder) = simulate(system, 1.0, 0.5, Algorithm::GaussSeidel);
        assert_eq!(run.steps, 2);
        let found = &recorder.series.column("sink.y").unwrap().values;
        // The first row stands for the initialization, the others for the steps.
        assert_eq!(found.len(), 3);
        for found in found {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }
}

#[test]
fn wires_that_fit() {
    let mut system = system();
    // The same unit under another name, by its meaning; by name where the meaning is not said; and
    // where one side says no unit.
    system.connect("table.1.metres", "pilot.position").unwrap();
    system.connect("table.1.named", "pilot.target").unwrap();
    system.connect("quadcopter.q", "plain.u").unwrap();
    system.connect("table.1.n", "table.1.m").unwrap();
    assert_eq!(
        system.open_inputs(),
        ["quadcopter.stick", "table.1.flag", "table.1.mode"]
    );
    assert_eq!(
        system
            .connect("quadcopter.z", "pilot.position")
            .unwrap_err()
            .to_string(),
        "`pilot.position` is fed twice: by `table.1.metres` and by `quadcopter.z`"
    );
    assert_eq!(
        system.set("pilot.position", "1").unwrap_err().to_string(),
        "`pilot.position` is fed by `table.1.metres`, so that its value cannot be set"
    );
}

#[test]
fn values_that_do_not_fit() {
    for (name, value, message) in [
        (
            "pilot.targt",
            "1",
            "`pilot.targt`: `pilot` has no variable `targt`; did you mean `pilot.target`?",
        ),
        (
            "pilot.target",
            "ten",
            "`pilot.target` is of type Real, `ten` is not",
        ),
        (
            "pilot.target",
            "",
            "`pilot.target` is of type Real, `` is not",
        ),
        (
            "table.1.m",
            "1.5",
            "`table.1.m` is of type Integer, `1.5` is not",
        ),
        (
            "table.1.flag",
            "yes",
            "`table.1.flag` is of type Boolean, `yes` is not",
        ),
        (
            "quadcopter.z",
            "1",
            "`quadcopter.z` is an output and cannot be set; parameters and inputs can",
        ),
        (
            "table.1.inside",
            "1",
            "`table.1.inside` is a local variable and cannot be set; parameters and inputs can",
        ),
    ] {
        assert_eq!(system().set(name, value).unwrap_err().to_string(), message);
    }
    let mut system = system();
    system.set("pilot.target", "1").unwrap();
    assert_eq!(
        system.set("pilot.target", "2").unwrap_err().to_string(),
        "`pilot.target` is set twice"
    );
    assert_eq!(
        system
            .connect("quadcopter.z", "pilot.target")
            .unwrap_err()
            .to_string(),
        "`pilot.target` is fed by `quadcopter.z`, so that its value cannot be set"
    );
    let another = || Box::new(Linear::new(0.0, 0.0, 1.0, 0.0));
    assert_eq!(
        system.add("pilot", another()).unwrap_err().to_string(),
        "two instances are named `pilot`; give one another name"
    );
    assert_eq!(
        system.add("", another()).unwrap_err().to_string(),
        "`` cannot name an instance: it must not be empty"
    );
}
