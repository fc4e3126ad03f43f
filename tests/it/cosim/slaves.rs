//! Slaves for tests.

use pilotage::cosim::slave::SlaveError;
use pilotage::cosim::{
    Algorithm, Clock, Experiment, Kind, Progress, Role, Run, SeriesRecorder, Slave, System, Unit,
    Value, Variable, run,
};
use std::cell::RefCell;
use std::rc::Rc;

/// `ẋ = a x + b u`, `y = c x + d u`, solved exactly with `u` held during a step. Input `u`, output `y`,
/// parameter `x0`. It keeps a log of its calls.
pub struct Linear {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub x: f64,
    pub u: f64,
    variables: Vec<Variable>,
    name: &'static str,
    log: Log,
}

/// Calls of several slaves in the order in which they were made.
pub type Log = Rc<RefCell<Vec<String>>>;

impl Linear {
    pub fn new(a: f64, b: f64, c: f64, d: f64) -> Self {
        let mut y = Variable::new("y", 1, Kind::Real, Role::Output);
        if d != 0.0 {
            y.feedthrough = vec![0];
            y.initial_feedthrough = vec![0];
        }
        let variables = vec![
            Variable::new("u", 0, Kind::Real, Role::Input),
            y,
            Variable::new("x0", 2, Kind::Real, Role::Parameter),
        ];
        Self {
            a,
            b,
            c,
            d,
            x: 0.0,
            u: 0.0,
            variables,
            name: "",
            log: Log::default(),
        }
    }

    pub fn from(mut self, x: f64) -> Self {
        self.x = x;
        self
    }

    /// Units of input and output.
    pub fn in_units(mut self, u: Unit, y: Unit) -> Self {
        self.variables[0].unit = Some(u);
        self.variables[1].unit = Some(y);
        self
    }

    pub fn logged(mut self, name: &'static str, log: &Log) -> Self {
        (self.name, self.log) = (name, log.clone());
        self
    }

    pub fn y(&self) -> f64 {
        self.c * self.x + self.d * self.u
    }

    pub fn advance(&mut self, h: f64) {
        let decay = (self.a * h).exp();
        let gain = if self.a == 0.0 {
            h
        } else {
            (decay - 1.0) / self.a
        };
        self.x = decay * self.x + gain * self.b * self.u;
    }

    fn note(&self, what: &str) {
        if !self.name.is_empty() {
            self.log.borrow_mut().push(format!("{}.{what}", self.name));
        }
    }
}

impl Slave for Linear {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, _experiment: &Experiment) -> Result<(), SlaveError> {
        self.note("setup");
        Ok(())
    }

    fn enter_initialization(&mut self) -> Result<(), SlaveError> {
        self.note("enter");
        Ok(())
    }

    fn exit_initialization(&mut self) -> Result<(), SlaveError> {
        self.note("exit");
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError> {
        for (handle, &value) in handles.iter().zip(values) {
            match handle {
                0 => self.u = value,
                2 => self.x = value,
                _ => return Err(format!("no handle {handle}").into()),
            }
            self.note(if *handle == 0 { "set u" } else { "set x0" });
        }
        Ok(())
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError> {
        assert_eq!(handles, [1]);
        values[0] = self.y();
        self.note("get y");
        Ok(())
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError> {
        self.set_reals(&[handle], &[value.as_number()])
    }

    fn get(&mut self, handle: u32, _kind: Kind) -> Result<Value, SlaveError> {
        let mut value = [0.0];
        self.get_reals(&[handle], &mut value)?;
        Ok(Value::Real(value[0]))
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, SlaveError> {
        self.advance(h);
        self.note("step");
        Ok(Progress::Done)
    }

    fn terminate(&mut self) -> Result<(), SlaveError> {
        self.note("terminate");
        Ok(())
    }
}

/// Runs a system and returns what was recorded.
pub fn simulate(
    system: System,
    stop: f64,
    step: f64,
    algorithm: Algorithm,
) -> (Run, SeriesRecorder) {
    let clock = Clock::new(0.0, stop, step).unwrap();
    let mut recorder = SeriesRecorder::default();
    let run = run(system, &clock, None, algorithm, &mut recorder).unwrap();
    (run, recorder)
}
