//! Components for tests.

use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Abilities, Clock, Component, Coupling, Experiment, Progress, Role, Run, SeriesRecorder, System,
    Unit, ValueKind, Variable, run,
};
use std::sync::{Arc, Mutex};

/// `ẋ = a x + b u`, `y = c x + d u`, solved exactly with `u` held during a step. Input `u`, output `y`,
/// parameter `x0`. It keeps a log of its calls.
pub struct Linear {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub x: f64,
    pub u: f64,
    pub panics: bool,
    slope: f64,
    abilities: Abilities,
    saved: Vec<[f64; 3]>,
    variables: Vec<Variable>,
    name: &'static str,
    log: Log,
}

/// Calls of several components in the order in which they were made.
#[derive(Debug, Clone, Default)]
pub struct Log(Arc<Mutex<Vec<String>>>);

impl Log {
    fn push(&self, call: String) {
        self.0.lock().unwrap().push(call);
    }

    /// The calls since the last time.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

impl Linear {
    pub fn new(a: f64, b: f64, c: f64, d: f64) -> Self {
        let mut y = Variable::new("y", 1, ValueKind::Real, Role::Output);
        if d != 0.0 {
            y.feedthrough = vec![0];
            y.initial_feedthrough = vec![0];
        }
        let variables = vec![
            Variable::new("u", 0, ValueKind::Real, Role::Input),
            y,
            Variable::new("x0", 2, ValueKind::Real, Role::Parameter),
        ];
        Self {
            a,
            b,
            c,
            d,
            x: 0.0,
            u: 0.0,
            panics: false,
            slope: 0.0,
            abilities: Abilities {
                variable_steps: true,
                ..Abilities::default()
            },
            saved: Vec::new(),
            variables,
            name: "",
            log: Log::default(),
        }
    }

    pub fn from(mut self, x: f64) -> Self {
        self.x = x;
        self
    }

    /// One that can go back to saved states.
    pub fn revocable(mut self) -> Self {
        self.abilities.rollback = true;
        self
    }

    /// One whose steps must all be of one length.
    pub fn fixed(mut self) -> Self {
        self.abilities.variable_steps = false;
        self
    }

    /// One whose output is said to depend on the input at once, as that of an FMU is that says nothing.
    pub fn undeclared(mut self) -> Self {
        self.variables[1].feedthrough = vec![0];
        self
    }

    /// One whose input can be a ramp within a step.
    pub fn following(mut self) -> Self {
        self.abilities.input_derivatives = true;
        self
    }

    /// One that tells its feedthrough as a derivative.
    pub fn differentiable(mut self) -> Self {
        self.abilities.directional_derivatives = true;
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
        // The integral of `e^{a (h - s)} s`: of a ramp's part.
        let slope_gain = if self.a == 0.0 {
            0.5 * h * h
        } else {
            (gain - h) / self.a
        };
        self.x = decay * self.x + self.b * (gain * self.u + slope_gain * self.slope);
        self.u += self.slope * h;
        self.slope = 0.0;
    }

    fn note(&self, what: &str) {
        if !self.name.is_empty() {
            self.log.push(format!("{}.{what}", self.name));
        }
    }
}

impl Component for Linear {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, _experiment: &Experiment) -> Result<(), ComponentError> {
        self.note("setup");
        Ok(())
    }

    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        self.note("enter");
        Ok(())
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.note("exit");
        Ok(())
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
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

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        assert_eq!(handles, [1]);
        values[0] = self.y();
        self.note("get y");
        Ok(())
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, ComponentError> {
        assert!(!self.panics, "as it was told");
        self.advance(h);
        self.note("step");
        Ok(Progress::Done)
    }

    fn terminate(&mut self) -> Result<(), ComponentError> {
        self.note("terminate");
        Ok(())
    }

    fn abilities(&self) -> Abilities {
        self.abilities
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        self.note("save");
        self.saved
            .resize(self.saved.len().max(place + 1), [f64::NAN; 3]);
        self.saved[place] = [self.x, self.u, self.slope];
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        self.note("restore");
        [self.x, self.u, self.slope] = self.saved[place];
        Ok(())
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        assert_eq!(handles, [0]);
        self.slope = slopes[0];
        self.note("slope u");
        Ok(())
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        assert_eq!((outputs, inputs), (&[1_u32][..], &[0_u32][..]));
        result[0] = self.d * seed[0];
        self.note("derivative");
        Ok(())
    }
}

/// `y = f(u)`, without state; both are 0 until `u` is set.
pub struct Static {
    f: fn(f64) -> f64,
    u: f64,
    variables: Vec<Variable>,
}

impl Static {
    pub fn new(f: fn(f64) -> f64) -> Self {
        let variables = Linear::new(0.0, 0.0, 0.0, 1.0).variables;
        Self {
            f,
            u: 0.0,
            variables,
        }
    }
}

impl Component for Static {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, _handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.u = values[0];
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values[0] = (self.f)(self.u);
        Ok(())
    }

    fn step(&mut self, _t: f64, _h: f64) -> Result<Progress, ComponentError> {
        Ok(Progress::Done)
    }
}

/// Two inputs `u0` and `u1` whose sum is integrated, by Euler's method.
pub struct Sum {
    x: f64,
    u: [f64; 2],
    variables: Vec<Variable>,
}

impl Sum {
    pub fn new() -> Self {
        Self {
            x: 1.0,
            u: [0.0; 2],
            variables: vec![
                Variable::new("u0", 0, ValueKind::Real, Role::Input),
                Variable::new("u1", 1, ValueKind::Real, Role::Input),
                Variable::new("y", 2, ValueKind::Real, Role::Output),
            ],
        }
    }
}

impl Component for Sum {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        for (&handle, &value) in handles.iter().zip(values) {
            self.u[handle as usize] = value;
        }
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values[0] = self.x;
        Ok(())
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.x += h * (self.u[0] + self.u[1]);
        Ok(Progress::Done)
    }
}

/// `y = f(t)` with its slope, which it may keep to itself.
pub struct Signal {
    f: fn(f64) -> [f64; 2],
    time: f64,
    saved: [f64; 3],
    pub can_vary: bool,
    pub gives_slope: bool,
    pub variables: Vec<Variable>,
}

impl Signal {
    pub fn new(f: fn(f64) -> [f64; 2]) -> Self {
        Self {
            f,
            time: 0.0,
            saved: [0.0; 3],
            can_vary: true,
            gives_slope: true,
            variables: vec![Variable::new("y", 0, ValueKind::Real, Role::Output)],
        }
    }
}

impl Component for Signal {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, handles: &[u32], _values: &[f64]) -> Result<(), ComponentError> {
        assert!(handles.is_empty());
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values[0] = (self.f)(self.time)[0];
        Ok(())
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.time = t + h;
        Ok(Progress::Done)
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            variable_steps: self.can_vary,
            output_derivatives: self.gives_slope,
            ..Abilities::default()
        }
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        self.saved[place] = self.time;
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        self.time = self.saved[place];
        Ok(())
    }

    fn get_output_derivatives(
        &mut self,
        _handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        slopes[0] = (self.f)(self.time)[1];
        Ok(())
    }
}

/// Runs a system and returns what was recorded.
pub fn simulate(
    system: System,
    stop: f64,
    step: f64,
    coupling: impl Into<Coupling>,
) -> (Run, SeriesRecorder) {
    let clock = Clock::new(0.0, stop, step).unwrap();
    let mut recorder = SeriesRecorder::default();
    let run = run(system, &clock, None, coupling, &mut recorder).unwrap();
    (run, recorder)
}
