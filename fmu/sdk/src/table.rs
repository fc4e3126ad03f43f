//! The table of a model's variables, in which an FMU looks up names and value references.

use crate::variable::{Role, Variable};
use crate::{Scalar, Unit, guid, json};
use std::ops::Range;

/// The variables of a model, in the order of their value references: inputs, outputs, parameters, start values of the
/// states, the states that are not outputs, locals, derivatives, event indicators, time.
///
/// It is built by one call per variable; each group keeps the order of the calls:
///
/// ```
/// use pilotage_sdk::Table;
/// let table = Table::new("ball", "A ball that bounces")
///     .parameter("e", "1", 0.7, "Restitution")
///     .output_state("h", "m", 1.0, "Height")
///     .state("v", "m/s", 0.0, "Velocity")
///     .indicator("gap", "m", "Distance to the ground");
/// let names: Vec<_> = table.variables().iter().map(|v| v.name.as_str()).collect();
/// assert_eq!(names, ["h", "e", "h_start", "v_start", "v", "der(h)", "der(v)", "gap", "time"]);
/// ```
///
/// # Panics
/// Its methods panic on names that are not identifiers or not unique, on units that cannot be parsed, and on start
/// values out of range: errors in the model's source, which `pilotage pack` reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    name: String,
    description: String,
    variables: Vec<Variable>,
    inputs: usize,
    outputs: usize,
    parameters: usize,
    /// For each state its position among the outputs, if it is one.
    states: Vec<Option<usize>>,
    /// For each mode its position among the outputs.
    modes: Vec<usize>,
    indicators: usize,
    /// Outputs limited to ± a parameter: positions among the computed outputs and among the parameters.
    limits: Vec<(usize, usize)>,
}

impl Table {
    /// A table without variables. The name is a C identifier: FMI's `modelIdentifier`.
    pub fn new(name: &str, description: &str) -> Self {
        assert!(
            is_identifier(name),
            "model name \"{name}\" is no identifier"
        );
        Self {
            name: name.to_owned(),
            description: description.to_owned(),
            variables: vec![Variable::calculated(
                "time",
                Unit::of("s"),
                Role::Time,
                "Time",
            )],
            inputs: 0,
            outputs: 0,
            parameters: 0,
            states: Vec::new(),
            modes: Vec::new(),
            indicators: 0,
            limits: Vec::new(),
        }
    }

    /// Adds an input, 0 until it is set.
    pub fn input(self, name: &str, unit: &str, description: &str) -> Self {
        self.with(Variable::input(name, Unit::of(unit), description))
    }

    /// Adds an output that [`output`](crate::Equations::output) computes.
    pub fn output(self, name: &str, unit: &str, description: &str) -> Self {
        self.with(Variable::calculated(
            name,
            Unit::of(unit),
            Role::Output,
            description,
        ))
    }

    /// Limits a computed output to ± the value of a parameter; both must already be declared. The value that
    /// [`output`](crate::Equations::output) writes is clipped, and a fit treats the limit as a constraint on the
    /// unclipped output.
    pub fn limited(mut self, output: &str, parameter: &str) -> Self {
        let place = |mut among: Box<dyn Iterator<Item = usize> + '_>, name: &str| {
            let found = among.position(|index| self.variables[index].name == name);
            found.unwrap_or_else(|| panic!("{name} is not declared, or no output or parameter"))
        };
        let output = place(Box::new(self.computed()), output);
        let parameter = place(Box::new(self.parameters()), parameter);
        self.limits.push((output, parameter));
        self
    }

    /// Adds a local that [`output`](crate::Equations::output) computes, after the outputs.
    pub fn local(self, name: &str, unit: &str, description: &str) -> Self {
        self.with(Variable::calculated(
            name,
            Unit::of(unit),
            Role::Local,
            description,
        ))
    }

    /// Adds a parameter that is constant in time.
    pub fn parameter(self, name: &str, unit: &str, start: f64, description: &str) -> Self {
        let unit = Unit::of(unit);
        self.with(Variable::parameter(
            name,
            unit,
            Role::Fixed,
            start,
            description,
        ))
    }

    /// Adds a state, together with `<name>_start` and `der(<name>)`.
    pub fn state(self, name: &str, unit: &str, start: f64, description: &str) -> Self {
        self.state_with(
            Variable::calculated(name, Unit::of(unit), Role::State, description),
            start,
        )
    }

    /// Adds a state that is an output.
    pub fn output_state(self, name: &str, unit: &str, start: f64, description: &str) -> Self {
        self.state_with(
            Variable::calculated(name, Unit::of(unit), Role::Output, description),
            start,
        )
    }

    /// Adds a mode, a Boolean output that only [`event`](crate::Equations::event) changes. In the equations' `x` the
    /// modes follow the states, in the order of the modes, as 1 or 0.
    pub fn mode(self, name: &str, start: bool, description: &str) -> Self {
        self.with(Variable::mode(name, start, description))
    }

    /// Adds an event indicator: see [`indicators`](crate::Equations::indicators).
    pub fn indicator(mut self, name: &str, unit: &str, description: &str) -> Self {
        let unit = Unit::of(unit);
        let variable = Variable::calculated(name, unit, Role::Indicator, description);
        self.insert(self.time(), variable);
        self.indicators += 1;
        self
    }

    /// Adds an input, an output that is not a state, a mode, a local, or a parameter, with all fields of a
    /// [`Variable`].
    pub fn with(mut self, variable: Variable) -> Self {
        let at = match variable.role {
            Role::Input => self.inputs().end,
            Role::Output | Role::Mode => self.outputs().end,
            Role::Fixed | Role::Tunable => self.parameters().end,
            Role::Local => self.signals().end,
            role => panic!("{} is a {}", variable.name, role.name()),
        };
        match variable.role {
            Role::Input => self.inputs += 1,
            Role::Output => self.outputs += 1,
            Role::Mode => {
                self.modes.push(self.outputs);
                self.outputs += 1;
            }
            Role::Local => {}
            _ => self.parameters += 1,
        }
        self.insert(at, variable);
        self
    }

    /// Adds a state, [`Role::State`] or [`Role::Output`], with all fields of a [`Variable`]. `STATE_start` is its start value.
    pub fn state_with(self, variable: Variable, start: f64) -> Self {
        let name = format!("{}_start", variable.name);
        self.state_from(variable, &name, start)
    }

    /// The same with another name of the start value, for a model that has a variable `STATE_start` of its own.
    pub fn state_from(mut self, variable: Variable, start_name: &str, start: f64) -> Self {
        let Variable {
            name,
            unit,
            description,
            ..
        } = &variable;
        let rate = Variable::calculated(
            &format!("der({name})"),
            unit.rate(),
            Role::Derivative,
            &format!("Time derivative of {name}"),
        );
        let initial = match description.is_empty() {
            true => format!("Initial value of {name}"),
            false => format!("Initial {}", lowered(description)),
        };
        let start = Variable::parameter(start_name, unit.clone(), Role::Fixed, start, &initial);
        let (starts, locals) = (self.starts().end, self.locals().end);
        self.insert(self.derivatives().end, rate);
        if variable.role == Role::Output {
            self.insert(starts, start);
            let at = self.outputs().end;
            self.insert(at, variable);
            self.states.push(Some(self.outputs));
            self.outputs += 1;
        } else {
            self.insert(locals, variable);
            self.insert(starts, start);
            self.states.push(None);
        }
        self
    }

    fn insert(&mut self, at: usize, variable: Variable) {
        let name = &variable.name;
        let plain = match name.strip_prefix("der(") {
            Some(rest) => rest.strip_suffix(')').unwrap_or_default(),
            None => name.strip_suffix(".start").unwrap_or(name),
        };
        assert!(
            is_identifier(plain),
            "variable name \"{name}\" is no identifier"
        );
        assert!(self.index(name).is_none(), "{name} is declared twice");
        if let Some(Err(error)) = variable.start.map(|start| variable.check(start)) {
            panic!("{error}");
        }
        self.variables.insert(at, variable);
    }

    /// Name of the model.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Description of the model in one sentence.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The variables, in the order of their value references.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Start values of inputs, modes, parameters and states by index, mutable.
    pub fn starts_mut(&mut self) -> impl Iterator<Item = (&str, &mut f64)> {
        self.variables.iter_mut().filter_map(|v| {
            let Variable { name, start, .. } = v;
            start.as_mut().map(|start| (name.as_str(), start))
        })
    }

    /// Index of the variable with that name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|v| v.name == name)
    }

    /// Number of continuous states.
    pub fn n_states(&self) -> usize {
        self.states.len()
    }

    /// Number of elements of the equations' `x`: continuous states and modes.
    pub fn n_x(&self) -> usize {
        self.states.len() + self.modes.len()
    }

    /// Number of event indicators.
    pub fn n_indicators(&self) -> usize {
        self.indicators
    }

    /// Indices of the inputs.
    pub fn inputs(&self) -> Range<usize> {
        0..self.inputs
    }

    /// Indices of the outputs.
    pub fn outputs(&self) -> Range<usize> {
        self.inputs..self.inputs + self.outputs
    }

    /// Indices of the parameters without the start values of states.
    pub fn parameters(&self) -> Range<usize> {
        let first = self.outputs().end;
        first..first + self.parameters
    }

    /// Indices of the states' start values.
    pub fn starts(&self) -> Range<usize> {
        let first = self.parameters().end;
        first..first + self.states.len()
    }

    /// Indices of the states that are not outputs.
    pub fn locals(&self) -> Range<usize> {
        let first = self.starts().end;
        let locals = self.states.iter().filter(|output| output.is_none());
        first..first + locals.count()
    }

    /// Indices of the locals: calculated variables that are neither outputs nor states.
    pub fn signals(&self) -> Range<usize> {
        self.locals().end..self.derivatives().start
    }

    /// Indices of the derivatives.
    pub fn derivatives(&self) -> Range<usize> {
        let end = self.indicators().start;
        end - self.states.len()..end
    }

    /// Indices of the event indicators.
    pub fn indicators(&self) -> Range<usize> {
        self.time() - self.indicators..self.time()
    }

    /// Index of time.
    pub fn time(&self) -> usize {
        self.variables.len() - 1
    }

    /// Index of each state's variable, in the order of the states.
    pub fn states(&self) -> impl Iterator<Item = usize> + '_ {
        let mut locals = self.locals();
        self.states.iter().map(move |output| match output {
            Some(position) => self.inputs + position,
            None => locals.next().unwrap_or_default(),
        })
    }

    /// Index of each mode.
    pub fn modes(&self) -> impl Iterator<Item = usize> + '_ {
        self.modes.iter().map(|position| self.inputs + position)
    }

    /// Index of the variable of each element of the equations' `x`: the states, then the modes.
    pub fn x(&self) -> impl Iterator<Item = usize> + '_ {
        self.states().chain(self.modes())
    }

    /// Indices of the outputs that are neither states nor modes, then of the locals: the variables that
    /// [`output`](crate::Equations::output) writes.
    pub fn computed(&self) -> impl Iterator<Item = usize> + '_ {
        let is_x = |position: usize| {
            self.states.contains(&Some(position)) || self.modes.contains(&position)
        };
        self.outputs()
            .filter(move |index| !is_x(index - self.inputs))
            .chain(self.signals())
    }

    /// The [`limited`](Self::limited) outputs: position among the computed ones, and position of the limit among the
    /// parameters.
    pub fn limits(&self) -> &[(usize, usize)] {
        &self.limits
    }

    /// Clips computed outputs to their limits.
    pub(crate) fn clip<T: Scalar>(&self, outputs: &mut [T], parameters: &[T]) {
        for &(output, parameter) in &self.limits {
            let (value, limit) = (outputs[output].re(), parameters[parameter]);
            if value > limit.re() {
                outputs[output] = limit;
            } else if value < -limit.re() {
                outputs[output] = -limit;
            }
        }
    }

    /// The continuous state that the variable is, if it is one.
    pub fn state_at(&self, index: usize) -> Option<usize> {
        match self.outputs().contains(&index) || self.locals().contains(&index) {
            true => self.states().position(|i| i == index),
            false => None,
        }
    }

    /// Typical magnitude of each state in its unit; 1 if none is declared.
    pub fn nominals(&self) -> Vec<f64> {
        self.states()
            .map(|i| self.variables[i].nominal.unwrap_or(1.0))
            .collect()
    }

    /// Typical magnitude of each element of the equations' `x`: that of a mode is 1.
    pub(crate) fn nominals_of_x(&self) -> Vec<f64> {
        let mut nominals = self.nominals();
        nominals.resize(self.n_x(), 1.0);
        nominals
    }

    /// The equations' `x` for these start values, one for each variable that has one.
    pub(crate) fn start_of_x<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let starts = self.starts().chain(self.modes());
        starts.map(|index| values[index]).collect()
    }

    /// FMI's `guid` and `instantiationToken`: a hash of all declarations.
    ///
    /// Exporter and binary compute it with this function, so that a description, a binary and resources that do not
    /// match are detected at instantiation.
    pub fn guid(&self) -> String {
        guid::of(&self.to_json())
    }

    /// All declarations.
    fn to_json(&self) -> String {
        let position = |output: &Option<usize>| json::number(output.map(|i| i as f64));
        json::object([
            ("name", json::string(&self.name)),
            ("description", json::string(&self.description)),
            (
                "variables",
                json::array(self.variables.iter().map(Variable::to_json)),
            ),
            ("states", json::array(self.states.iter().map(position))),
            ("indicators", self.indicators.to_string()),
        ])
    }

    /// Checks that the variables allow their start values.
    ///
    /// # Errors
    /// If a start value is not finite or out of range: the error names the first such variable.
    pub fn check(&self) -> Result<(), crate::ValueError> {
        self.variables
            .iter()
            .try_for_each(|v| v.start.map_or(Ok(()), |start| v.check(start)))
    }
}

fn is_identifier(name: &str) -> bool {
    let begins = |c: char| c == '_' || c.is_ascii_alphabetic();
    name.starts_with(begins) && name.chars().all(|c| begins(c) || c.is_ascii_digit())
}

/// `Height` as `height`, for use within a sentence.
fn lowered(text: &str) -> String {
    let mut chars = text.chars();
    let second_is_upper = text.chars().nth(1).is_some_and(char::is_uppercase);
    match chars.next() {
        Some(first) if !second_is_upper => first.to_lowercase().chain(chars).collect(),
        _ => text.to_owned(),
    }
}
