//! Connections between variables of different types.

use super::components::simulate;
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Abilities, Algorithm, Clock, Component, Coupling, Ending, MasterError, Progress, Role, Run,
    SeriesRecorder, System, Value, ValueKind, Variable, run,
};
use pilotage_text::error_chain::error_chain;
use std::sync::{Arc, Mutex};

/// An output that is a function of time, or an input that keeps what it is given.
struct Typed {
    variables: Vec<Variable>,
    output: fn(f64) -> Value,
    time: f64,
    saved: f64,
    got: Arc<Mutex<Vec<Value>>>,
}

impl Typed {
    fn new(kind: ValueKind, role: Role, output: fn(f64) -> Value) -> Self {
        Self {
            variables: vec![Variable::new("v", 0, kind, role)],
            output,
            time: 0.0,
            saved: 0.0,
            got: Arc::default(),
        }
    }
}

impl Component for Typed {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }
    fn set_reals(&mut self, _: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.set(0, &Value::Real(values[0]))
    }
    fn get_reals(&mut self, _: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values[0] = (self.output)(self.time).as_number();
        Ok(())
    }
    fn set(&mut self, _: u32, value: &Value) -> Result<(), ComponentError> {
        let own = match self.variables[0].kind {
            ValueKind::Enumeration => ValueKind::Integer,
            other => other,
        };
        assert_eq!(value.kind(), own, "{value:?}");
        self.got.lock().unwrap().push(value.clone());
        Ok(())
    }
    fn get(&mut self, _: u32, _: ValueKind) -> Result<Value, ComponentError> {
        Ok((self.output)(self.time))
    }
    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.time = t + h;
        Ok(Progress::Done)
    }
    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            variable_steps: true,
            ..Abilities::default()
        }
    }
    fn save(&mut self, _: usize) -> Result<(), ComponentError> {
        self.saved = self.time;
        Ok(())
    }
    fn restore(&mut self, _: usize) -> Result<(), ComponentError> {
        self.time = self.saved;
        Ok(())
    }
}

/// `from`, a function of time, feeds `to`; and what `to` was given.
fn system(
    from: ValueKind,
    output: fn(f64) -> Value,
    to: ValueKind,
) -> (System, Arc<Mutex<Vec<Value>>>) {
    let mut system = System::new();
    let sink = Typed::new(to, Role::Input, |_| Value::Integer(0));
    let got = sink.got.clone();
    let source = Typed::new(from, Role::Output, output);
    system.add("from", Box::new(source)).unwrap();
    system.add("to", Box::new(sink)).unwrap();
    system.connect("from.v", "to.v").unwrap();
    (system, got)
}

/// Whole numbers of steps of a quarter of a second.
fn quarters(t: f64) -> i64 {
    (4.0 * t).round() as i64
}

#[test]
fn values_become_those_of_the_inputs_type() {
    let integer: fn(f64) -> Value = |t| Value::Integer(quarters(t));
    let real: fn(f64) -> Value = |t| Value::Real(quarters(t) as f64);
    let boolean: fn(f64) -> Value = |t| Value::Boolean(quarters(t) % 2 == 1);
    let [reals, integers] = [
        [0.0, 1.0, 2.0, 3.0].map(Value::Real),
        [0, 1, 2, 3].map(Value::Integer),
    ];
    let cases = [
        (ValueKind::Integer, integer, ValueKind::Real, reals),
        (
            ValueKind::Integer,
            integer,
            ValueKind::Enumeration,
            integers.clone(),
        ),
        (
            ValueKind::Enumeration,
            integer,
            ValueKind::Integer,
            integers.clone(),
        ),
        (ValueKind::Real, real, ValueKind::Integer, integers),
        (
            ValueKind::Boolean,
            boolean,
            ValueKind::Integer,
            [0, 1, 0, 1].map(Value::Integer),
        ),
        (
            ValueKind::Boolean,
            boolean,
            ValueKind::Real,
            [0.0, 1.0, 0.0, 1.0].map(Value::Real),
        ),
    ];
    for (from, output, to, expected) in cases {
        for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong] {
            let (system, got) = system(from, output, to);
            let (run, _) = simulate(system, 0.75, 0.25, algorithm);
            assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
            let mut got = got.lock().unwrap().clone();
            got.dedup();
            // Jacobi's master gives the outputs before a step, the others those after it.
            let seen = match algorithm {
                Algorithm::Jacobi => &expected[..3],
                _ => &expected[..],
            };
            assert_eq!(got, seen, "{from} {to} {algorithm}");
        }
    }
}

fn run_to_one(system: System) -> Result<Run, MasterError> {
    let clock = Clock::new(0.0, 1.0, 0.25).unwrap();
    let coupling = Coupling::from(Algorithm::Jacobi);
    run(
        system,
        &clock,
        None,
        coupling,
        &mut SeriesRecorder::default(),
    )
}

#[test]
fn reals_that_are_not_whole_are_an_error_at_that_time() {
    let (system, _) = system(
        ValueKind::Real,
        |t| Value::Real(if t < 0.4 { 2.0 } else { 2.5 }),
        ValueKind::Integer,
    );
    let Ending::Failed { time, source, .. } = run_to_one(system).unwrap().ending else {
        panic!("2.5 was passed on");
    };
    let why = "`from.v` -> `to.v`: 2.5 is no whole number that an Integer can hold";
    assert_eq!((time, source.to_string().as_str()), (0.25, why));
}

#[test]
fn reals_that_are_not_whole_are_an_error_at_the_start() {
    for output in [
        (|_| Value::Real(0.5)) as fn(f64) -> Value,
        |_| Value::Real(f64::NAN),
        |_| Value::Real(9.3e18),
    ] {
        let (system, _) = system(ValueKind::Real, output, ValueKind::Integer);
        let error = run_to_one(system).unwrap_err();
        let cause = error_chain(&error);
        assert!(
            cause.ends_with("is no whole number that an Integer can hold"),
            "{cause}"
        );
    }
}
