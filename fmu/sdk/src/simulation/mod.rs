//! A running model: values, states, steps, events, derivatives.

mod derivatives;
mod fault;
mod flow;
mod history;
mod step;
mod time_events;

pub use fault::{StepError, StepFault};
pub use history::History;
pub use step::Reached;

use crate::lti::Transition;
use crate::variable::{Role, ValueError, Variable};
use crate::{At, Equations, Table};
use history::Jet;
use pilotage_ode::{Method, Solver, SolverOptions};
use std::borrow::Cow;

/// Default relative tolerance of the integrator.
pub const DEFAULT_TOLERANCE: f64 = 1e-9;

/// Range of tolerances; values outside it are clamped.
pub const TOLERANCE_RANGE: (f64, f64) = (1e-12, 1e-4);

/// Maximum number of outputs that are computed without allocation.
const ON_STACK: usize = 32;

/// Why a value cannot be set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetError {
    /// No variable has this index.
    #[error("there is no variable {index}; the last one is {last}")]
    NoVariable {
        /// The index.
        index: usize,
        /// The largest index.
        last: usize,
    },
    /// Outputs, states and derivatives are calculated.
    #[error("{name} is {role} and cannot be set{hint}")]
    Calculated {
        /// The variable.
        name: String,
        /// Its role, with an article.
        role: &'static str,
        /// What to set instead, if anything.
        hint: String,
    },
    /// Only inputs have time derivatives.
    #[error("{name} is no input and has no derivative to set")]
    NoInput {
        /// The variable.
        name: String,
    },
    /// The variable cannot have this value.
    #[error(transparent)]
    Value(#[from] ValueError),
}

/// Everything that changes while a simulation runs: equal snapshots continue equally.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Time \[s\].
    pub time: f64,
    /// Inputs, parameters and start values by index; outputs hold 0 here, since they are calculated.
    pub values: Vec<f64>,
    /// Time derivative of each input, for the next step only.
    pub slopes: Vec<f64>,
    /// Time derivative of each input in the last step.
    pub last_slopes: Vec<f64>,
    /// The states, then the modes.
    pub states: Vec<f64>,
    /// Whether each event indicator was positive when an event was last handled.
    pub positive: Vec<bool>,
    /// Relative tolerance.
    pub tolerance: f64,
    /// Whether the simulation has left its start values, so that parameters no longer change them.
    pub has_started: bool,
    /// Whether the equations were stiff in the last step, so that the next one begins with the implicit method.
    pub is_stiff: bool,
    /// Time at which events were last handled \[s\]: conditions on time that change there have changed.
    pub handled: f64,
    /// Signals that are delayed.
    pub history: History,
}

/// A running model.
#[derive(Debug)]
pub struct Simulation<E> {
    equations: E,
    table: Table,
    slots: Vec<Slot>,
    /// Number of outputs that the equations compute.
    n_computed: usize,
    /// Number of delays that are exact.
    n_delays: usize,
    now: Snapshot,
    solver: Solver,
    /// Typical magnitudes of the states and modes.
    nominals: Vec<f64>,
    /// The exact step of a linear model with its key (step, then parameters), and the previous one: a master that
    /// checks its steps alternates between whole and half steps.
    transitions: [Option<(Vec<f64>, Transition)>; 2],
    space: Space,
}

/// Where the value of a variable is stored.
#[derive(Debug, Clone, Copy)]
enum Slot {
    /// Among the values that are set, at the index of the variable.
    Value,
    State(usize),
    /// Position among the outputs that the equations compute.
    Output(usize),
    Derivative(usize),
    Indicator(usize),
    Time,
}

/// Work arrays for one step.
#[derive(Debug, Clone, Default)]
struct Space {
    next: Vec<f64>,
    inputs: Vec<f64>,
    indicators: Vec<f64>,
    /// Where the derivatives were not finite in the last step: time, and cause from the equations.
    trouble: Option<(f64, String)>,
}

impl<E: Equations + Clone> Clone for Simulation<E> {
    fn clone(&self) -> Self {
        let mut clone = Self::new(self.equations.clone());
        clone.n_delays = self.n_delays;
        clone.restore(&self.now);
        clone
    }
}

impl<E: Equations> Simulation<E> {
    /// The model with all variables at their start values, at 0 s.
    pub fn new(equations: E) -> Self {
        let table = equations.table();
        let now = at_start(&table);
        let nominals = table.nominals_of_x();
        let mut delays = Vec::new();
        equations.delays(&now.values[table.parameters()], &mut delays);
        let options = SolverOptions {
            relative: now.tolerance,
            absolute: nominals.clone(),
            method: Method::Automatic,
            longest_step: f64::INFINITY,
        };
        Self {
            solver: Solver::new(table.n_indicators(), options),
            nominals,
            transitions: [None, None],
            space: Space {
                next: now.states.clone(),
                inputs: now.slopes.clone(),
                indicators: vec![0.0; table.n_indicators()],
                trouble: None,
            },
            slots: slots(&table),
            n_computed: table.computed().count(),
            n_delays: delays.len(),
            now,
            table,
            equations,
        }
    }

    /// Approximates delays by states, as an importer needs that solves the equations itself.
    #[must_use]
    pub fn with_states_for_delays(mut self) -> Self {
        self.n_delays = 0;
        self
    }

    /// The model.
    pub fn model(&self) -> &E {
        &self.equations
    }

    /// The table of its variables.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// The state that a later [`restore`](Self::restore) needs.
    pub fn snapshot(&self) -> &Snapshot {
        &self.now
    }

    /// Restores a snapshot of the same model.
    ///
    /// # Panics
    /// If the snapshot's lengths are those of another model.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.now.time = snapshot.time;
        self.now.values.copy_from_slice(&snapshot.values);
        self.now.slopes.copy_from_slice(&snapshot.slopes);
        self.now.last_slopes.copy_from_slice(&snapshot.last_slopes);
        self.now.states.copy_from_slice(&snapshot.states);
        self.now.positive.copy_from_slice(&snapshot.positive);
        self.now.tolerance = snapshot.tolerance;
        self.now.has_started = snapshot.has_started;
        self.now.is_stiff = snapshot.is_stiff;
        self.now.handled = snapshot.handled;
        self.now.history.clone_from(&snapshot.history);
    }

    /// Restores all start values and the default tolerance.
    pub fn reset(&mut self) {
        self.now = at_start(&self.table);
    }

    /// Sets the relative tolerance, clamped to [`TOLERANCE_RANGE`].
    ///
    /// # Panics
    /// If it is NaN.
    pub fn set_tolerance(&mut self, relative: f64) {
        assert!(!relative.is_nan(), "a tolerance of {relative}");
        self.now.tolerance = relative.clamp(TOLERANCE_RANGE.0, TOLERANCE_RANGE.1);
    }

    /// Sets the time \[s\].
    ///
    /// # Panics
    /// If it is not finite.
    pub fn set_time(&mut self, time: f64) {
        assert!(time.is_finite(), "a time of {time} s");
        self.now.time = time;
    }

    /// The value of a variable; a calculated one follows from the current states and inputs.
    ///
    /// # Panics
    /// When there is no such variable.
    pub fn get(&self, index: usize) -> f64 {
        let mut value = [0.0];
        self.get_all([index], &mut value);
        value[0]
    }

    /// As [`get`](Self::get), for several variables: outputs are computed at most once.
    ///
    /// # Panics
    /// When there is no such variable.
    pub fn get_all(&self, indices: impl IntoIterator<Item = usize>, values: &mut [f64]) {
        let (n, mut stack) = (self.n_computed, [f64::NAN; ON_STACK]);
        // Both allocate only if necessary.
        let mut heap = vec![f64::NAN; if n > ON_STACK { n } else { 0 }];
        let mut slopes = Vec::new();
        let outputs = match n > ON_STACK {
            true => &mut heap[..],
            false => &mut stack[..n],
        };
        let mut computed = false;
        for (index, value) in indices.into_iter().zip(values) {
            *value = match self.slots[index] {
                Slot::Value => self.now.values[index],
                Slot::State(state) => self.now.states[state],
                Slot::Output(position) => {
                    if !computed {
                        let u = self.inputs();
                        let at = self.at(&u);
                        self.equations.output(at, outputs);
                        self.table.clip(outputs, at.p);
                        computed = true;
                    }
                    outputs[position]
                }
                Slot::Derivative(state) => {
                    if slopes.is_empty() {
                        slopes.resize(self.table.n_states(), 0.0);
                        self.derivatives(&mut slopes);
                    }
                    slopes[state]
                }
                Slot::Indicator(position) => {
                    let mut indicators = vec![0.0; self.table.n_indicators()];
                    self.indicators(&mut indicators);
                    indicators[position]
                }
                Slot::Time => self.now.time,
            };
        }
    }

    /// Sets an input, a parameter, a mode or a start value; a start value sets its state too.
    ///
    /// # Errors
    /// If the variable is calculated, or the value is not finite or out of range.
    pub fn set(&mut self, index: usize, value: f64) -> Result<(), SetError> {
        let variable = self.variable(index)?;
        if variable.is_calculated() {
            return Err(self.calculated(variable));
        }
        variable.check(value)?;
        if variable.is_boolean()
            && let Some(mode) = self.table.x().position(|i| i == index)
        {
            self.now.states[mode] = value;
        }
        if self.table.parameters().contains(&index) && !self.now.has_started {
            self.set_parameter(index, value);
        }
        self.now.values[index] = value;
        let starts = self.table.starts();
        if starts.contains(&index) {
            self.now.states[index - starts.start] = value;
        }
        Ok(())
    }

    /// Sets a parameter before the start, and updates those start values that depend on parameters and still have the
    /// values that the equations give.
    fn set_parameter(&mut self, index: usize, value: f64) {
        let (parameters, starts) = (self.table.parameters(), self.table.starts());
        let mut before = self.now.values[starts.clone()].to_vec();
        let mut after = before.clone();
        self.equations
            .start(&self.now.values[parameters.clone()], &mut before);
        self.now.values[index] = value;
        self.equations
            .start(&self.now.values[parameters], &mut after);
        for (state, index) in starts.enumerate() {
            if before[state] != after[state] && self.now.values[index] == before[state] {
                self.now.values[index] = after[state];
                self.now.states[state] = after[state];
            }
        }
    }

    /// Cause of a value that is not finite at present, if the equations give it.
    pub fn trouble(&self) -> Option<String> {
        self.equations.trouble(self.at(&self.inputs()))
    }

    fn calculated(&self, variable: &Variable) -> SetError {
        let role = match variable.role {
            Role::Output => "an output",
            Role::Local => "a local",
            Role::Derivative => "a derivative",
            Role::Indicator => "an event indicator",
            Role::Time => "no parameter",
            _ => "a state",
        };
        let index = self.table.index(&variable.name);
        let state = index.and_then(|index| self.table.state_at(index));
        let hint = match state.filter(|_| variable.role == Role::State) {
            Some(state) => {
                let start = &self.table.variables()[self.table.starts().start + state].name;
                format!("; set {start} before the start, or the states as a whole")
            }
            None => String::new(),
        };
        SetError::Calculated {
            name: variable.label(),
            role,
            hint,
        }
    }

    /// Sets the time derivative of an input [its unit per second] for the next step, which starts at the value that is
    /// set.
    ///
    /// # Errors
    /// If it is not an input, or the slope is not finite.
    pub fn set_slope(&mut self, index: usize, slope: f64) -> Result<(), SetError> {
        let variable = self.variable(index)?;
        if !self.table.inputs().contains(&index) {
            return Err(SetError::NoInput {
                name: variable.label(),
            });
        }
        if !slope.is_finite() {
            return Err(SetError::Value(ValueError::NotFinite {
                name: format!("time derivative of {}", variable.label()),
                value: slope,
            }));
        }
        self.now.slopes[index] = slope;
        Ok(())
    }

    /// Sets all continuous states.
    ///
    /// # Panics
    /// If the number of values is wrong.
    pub fn set_states(&mut self, states: &[f64]) {
        self.now.has_started = true;
        self.now.states[..self.table.n_states()].copy_from_slice(states);
    }

    /// Writes the derivatives of the states.
    ///
    /// # Panics
    /// If the number of values is wrong.
    pub fn derivatives(&self, slopes: &mut [f64]) {
        assert_eq!(slopes.len(), self.table.n_states(), "number of states");
        let u = self.inputs();
        let at = At {
            time: self.sided_time(),
            ..self.at(&u)
        };
        self.equations.derivative(at, slopes);
    }

    /// Writes the event indicators.
    ///
    /// # Panics
    /// If the number of values is wrong.
    pub fn indicators(&self, indicators: &mut [f64]) {
        assert_eq!(indicators.len(), self.table.n_indicators(), "indicators");
        self.equations
            .indicators(self.at(&self.inputs()), indicators);
    }

    /// The inputs, and after them the delayed signals.
    fn inputs(&self) -> Cow<'_, [f64]> {
        let own = &self.now.values[self.table.inputs()];
        match self.n_delays {
            0 => Cow::Borrowed(own),
            _ => {
                let delayed = self.delayed();
                Cow::Owned(
                    own.iter()
                        .copied()
                        .chain(delayed.map(|jet| jet[0]))
                        .collect(),
                )
            }
        }
    }

    /// The delayed signals with their derivatives by time; none unless they are exact.
    fn delayed(&self) -> impl Iterator<Item = Jet> {
        let mut times = Vec::new();
        if self.n_delays > 0 {
            let p = &self.now.values[self.table.parameters()];
            self.equations.delays(p, &mut times);
        }
        let now = &self.now;
        let delayed = times.into_iter().enumerate();
        delayed.map(|(k, tau)| now.history.after(k, now.time, tau))
    }

    /// Current arguments of the equations, with these inputs.
    fn at<'a>(&'a self, u: &'a [f64]) -> At<'a, f64> {
        At {
            time: self.now.time,
            x: &self.now.states,
            u,
            p: &self.now.values[self.table.parameters()],
        }
    }

    fn variable(&self, index: usize) -> Result<&Variable, SetError> {
        let variables = self.table.variables();
        variables.get(index).ok_or(SetError::NoVariable {
            index,
            last: variables.len() - 1,
        })
    }
}

fn slots(table: &Table) -> Vec<Slot> {
    let mut slots = vec![Slot::Value; table.variables().len()];
    for (position, index) in table.computed().enumerate() {
        slots[index] = Slot::Output(position);
    }
    for (state, index) in table.x().enumerate() {
        slots[index] = Slot::State(state);
    }
    for (state, index) in table.derivatives().enumerate() {
        slots[index] = Slot::Derivative(state);
    }
    for (position, index) in table.indicators().enumerate() {
        slots[index] = Slot::Indicator(position);
    }
    slots[table.time()] = Slot::Time;
    slots
}

/// The snapshot at the start values.
fn at_start(table: &Table) -> Snapshot {
    let settable = &table.variables()[..table.starts().end];
    let values: Vec<f64> = settable.iter().map(|v| v.start.unwrap_or(0.0)).collect();
    Snapshot {
        time: 0.0,
        slopes: vec![0.0; table.inputs().len()],
        last_slopes: vec![0.0; table.inputs().len()],
        states: table.start_of_x(&values),
        positive: vec![true; table.n_indicators()],
        tolerance: DEFAULT_TOLERANCE,
        has_started: false,
        is_stiff: false,
        handled: f64::MIN,
        history: History::default(),
        values,
    }
}
