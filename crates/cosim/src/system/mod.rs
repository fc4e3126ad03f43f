//! A system of connected components, with checks of names, types and units.

mod error;

pub use error::SystemError;

use super::component::{Abilities, Component, Conversion, Role, Value, ValueKind, Variable};
use pilotage_text::suggestion::suggestion;

/// A variable of an instance, given by positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Port {
    /// Position of the instance.
    pub instance: usize,
    /// Position in [`Component::variables`].
    pub variable: usize,
}

/// A wire from an output to an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// The output.
    pub from: Port,
    /// The input.
    pub to: Port,
    /// Conversion from the output's unit to the input's.
    pub conversion: Conversion,
    /// Values of the output, and what the input is given for them; others stay.
    pub map: Vec<(Value, Value)>,
}

/// What happens to values on a wire: `to = factor·from + offset`, after the conversion of units or instead of it; or, where
/// they are not real, another value for each.
#[derive(Debug, Clone, PartialEq)]
pub struct Transformation {
    /// Factor and offset.
    pub linear: Conversion,
    /// Whether values are converted from the output's unit to the input's first.
    pub converts_units: bool,
    /// Values of the output with those for the input, as text: numbers, `true`, `false` or names of an enumeration's items.
    /// Other values stay (SSP 2.0, sections 4.5.2.2 to 4.5.2.4).
    pub map: Vec<(String, String)>,
}

impl Default for Transformation {
    /// Only units are converted.
    fn default() -> Self {
        Self {
            linear: Conversion::NONE,
            converts_units: true,
            map: Vec::new(),
        }
    }
}

/// A connection with the names of its ends, each `instance.variable`.
#[derive(Debug, Clone, PartialEq)]
pub struct Link<'a> {
    /// The output.
    pub from: (String, &'a Variable),
    /// The input.
    pub to: (String, &'a Variable),
    /// Conversion from the output's unit to the input's.
    pub conversion: Conversion,
    /// Values of the output, and what the input is given for them; others stay.
    pub map: &'a [(Value, Value)],
}

/// A named component.
pub(super) struct Instance {
    pub(super) name: String,
    pub(super) component: Box<dyn Component>,
    /// Positions of variables read at each communication point although they are not outputs.
    pub(super) observed: Vec<usize>,
    /// Number of parts into which it divides each communication step.
    pub(super) parts: u32,
    /// Whether its outputs are read with the inputs of the same time.
    pub(super) at_once: bool,
}

/// Components, connections and start values.
#[derive(Default)]
pub struct System {
    pub(super) instances: Vec<Instance>,
    pub(super) connections: Vec<Connection>,
    pub(super) settings: Vec<(Port, Value)>,
}

impl System {
    /// An empty system.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a component under a name.
    ///
    /// # Errors
    /// If the name is empty or taken.
    pub fn add(
        &mut self,
        name: impl Into<String>,
        component: Box<dyn Component>,
    ) -> Result<(), SystemError> {
        let name = name.into();
        if name.is_empty() {
            return Err(SystemError::EmptyInstance { name });
        }
        if self.instances.iter().any(|i| i.name == name) {
            return Err(SystemError::DuplicateInstance { name });
        }
        self.instances.push(Instance {
            name,
            component,
            observed: Vec::new(),
            parts: 1,
            at_once: false,
        });
        Ok(())
    }

    /// The components with their names, without what connects them.
    pub fn components(self) -> Vec<(String, Box<dyn Component>)> {
        let own = self.instances.into_iter();
        own.map(|own| (own.name, own.component)).collect()
    }

    /// Reads an instance's outputs after all others have stepped, with the inputs of that time, so that they are not a
    /// communication step late with Jacobi: for sums, gains and the like, whose outputs depend on inputs alone. Unknown
    /// names have no effect.
    pub fn set_at_once(&mut self, name: &str) {
        let own = self.instances.iter_mut().find(|own| own.name == name);
        own.into_iter().for_each(|own| own.at_once = true);
    }

    /// Makes an instance divide every communication step into that many equal parts (multi-rate), with inputs
    /// interpolated if they change within the step.
    ///
    /// # Errors
    /// If there is no such instance, or `parts` is 0.
    pub fn set_parts(&mut self, name: &str, parts: u32) -> Result<(), SystemError> {
        if parts == 0 {
            let name = name.to_owned();
            return Err(SystemError::NoParts { name });
        }
        match self.instances.iter_mut().find(|i| i.name == name) {
            Some(instance) => {
                instance.parts = parts;
                Ok(())
            }
            None => Err(self.unknown_instance(name)),
        }
    }

    /// Connects an output to an input, both as `instance.variable`. Values are converted if the units differ but have
    /// the same dimension. Arrays of the same dimensions are connected element by element.
    ///
    /// # Errors
    /// If a name is unknown, causality, type or unit do not match, or the input is already connected.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), SystemError> {
        self.connect_by(from, to, Transformation::default())
    }

    /// As [`connect`](Self::connect), with a transformation of the values.
    ///
    /// # Errors
    /// If a name is unknown, causality, type or unit do not match, the input is already connected, what is not real
    /// is to be transformed, or what is real is to be mapped.
    pub fn connect_by(
        &mut self,
        from: &str,
        to: &str,
        by: Transformation,
    ) -> Result<(), SystemError> {
        if self.resolve(from).is_ok() || self.resolve(to).is_ok() {
            return self.connect_one(from, to, &by);
        }
        let (outputs, inputs) = (self.elements(from), self.elements(to));
        if outputs.is_empty() || inputs.is_empty() {
            return self.connect_one(from, to, &by);
        }
        if outputs != inputs {
            return Err(SystemError::SizeMismatch {
                from: from.to_owned(),
                from_elements: outputs.len(),
                to: to.to_owned(),
                to_elements: inputs.len(),
            });
        }
        for element in outputs {
            self.connect_one(&format!("{from}{element}"), &format!("{to}{element}"), &by)?;
        }
        Ok(())
    }

    /// Name suffixes of an array's elements: `[1]`, `[2]`...
    fn elements(&self, array: &str) -> Vec<String> {
        let end = |(_, name): (Port, String)| {
            let end = name.strip_prefix(array)?;
            (end.starts_with('[') && end.ends_with(']')).then(|| end.to_owned())
        };
        self.names().filter_map(end).collect()
    }

    fn connect_one(
        &mut self,
        from: &str,
        to: &str,
        by: &Transformation,
    ) -> Result<(), SystemError> {
        let (output, input) = (self.resolve(from)?, self.resolve(to)?);
        self.check_roles(output, input)?;
        let units = self.check_types(output, input, by.converts_units)?;
        let connection = Connection {
            from: output,
            to: input,
            conversion: units.then(by.linear),
            map: self.map(output, input, &by.map)?,
        };
        let is_real = self.is_real(&connection);
        if by.linear != Conversion::NONE && !is_real {
            let (from, to) = (from.to_owned(), to.to_owned());
            return Err(SystemError::NotTransformed { from, to });
        }
        let fed = self.connections.iter().find(|c| c.to == connection.to);
        if fed == Some(&connection) {
            return Ok(());
        }
        if let Some(first) = fed {
            return Err(SystemError::FedTwice {
                to: to.to_owned(),
                first: self.port_name(first.from),
                second: from.to_owned(),
            });
        }
        if self.settings.iter().any(|(port, _)| *port == connection.to) {
            return Err(SystemError::SetWhileFed {
                name: to.to_owned(),
                from: from.to_owned(),
            });
        }
        self.connections.push(connection);
        Ok(())
    }

    /// The values of a map.
    fn map(
        &self,
        output: Port,
        input: Port,
        by: &[(String, String)],
    ) -> Result<Vec<(Value, Value)>, SystemError> {
        if !by.is_empty()
            && matches!(
                self.variable(output).kind,
                ValueKind::Real | ValueKind::String
            )
        {
            let [from, to] = [output, input].map(|port| self.port_name(port));
            return Err(SystemError::NotMapped { from, to });
        }
        let value = |port: Port, text: &String| {
            let variable = self.variable(port);
            variable.parse(text).ok_or_else(|| SystemError::BadValue {
                name: self.port_name(port),
                kind: variable.kind,
                text: text.clone(),
                items: variable.items.clone(),
            })
        };
        let mut map: Vec<(Value, Value)> = Vec::new();
        for (from, to) in by {
            let pair = (value(output, from)?, value(input, to)?);
            if map.iter().any(|(known, _)| *known == pair.0) {
                let (name, value) = (self.port_name(output), from.clone());
                return Err(SystemError::MappedTwice { name, value });
            }
            map.push(pair);
        }
        Ok(map)
    }

    /// Sets the start value of a parameter or input; name and value are text.
    ///
    /// # Errors
    /// If the name or the value is invalid, or the variable cannot be set.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), SystemError> {
        let port = self.resolve(name)?;
        let variable = self.variable(port);
        let (kind, role) = (variable.kind, variable.role);
        let name = name.to_owned();
        if !variable.settable {
            return Err(SystemError::NotSettable { name, role });
        }
        if let Some(fed) = self.connections.iter().find(|c| c.to == port) {
            let from = self.port_name(fed.from);
            return Err(SystemError::SetWhileFed { name, from });
        }
        if self.settings.iter().any(|(other, _)| *other == port) {
            return Err(SystemError::SetTwice { name });
        }
        let parsed = variable.parse(value).ok_or_else(|| SystemError::BadValue {
            name,
            kind,
            text: value.to_owned(),
            items: variable.items.clone(),
        })?;
        self.check_range(port, &parsed, value)?;
        self.settings.push((port, parsed));
        Ok(())
    }

    /// Rejects a start value, given as `text`, outside the variable's range.
    fn check_range(&self, port: Port, value: &Value, text: &str) -> Result<(), SystemError> {
        let (name, variable) = (self.port_name(port), self.variable(port));
        let number = match value {
            Value::Real(number) if number.is_nan() => return Err(SystemError::NotANumber { name }),
            Value::Real(_) | Value::Integer(_) => value.as_number(),
            Value::Boolean(_) | Value::String(_) => return Ok(()),
        };
        let [min, max] = variable.range;
        match min <= number && number <= max {
            true => Ok(()),
            false => Err(SystemError::OutOfRange {
                name,
                text: text.to_owned(),
                range: [min, max],
                unit: variable
                    .unit
                    .as_ref()
                    .map_or(String::new(), |u| format!(" {}", u.name)),
            }),
        }
    }

    /// Connections whose values are converted or transformed: output, its unit, input, its unit.
    pub fn converted(&self) -> Vec<[String; 4]> {
        let unit = |variable: &Variable| match &variable.unit {
            Some(unit) => unit.name.clone(),
            None => String::new(),
        };
        (self.links())
            .filter(|link| link.conversion != Conversion::NONE)
            .map(|Link { from, to, .. }| [from.0, unit(from.1), to.0, unit(to.1)])
            .collect()
    }

    /// The connections, in order of creation.
    pub fn links(&self) -> impl Iterator<Item = Link<'_>> {
        self.connections.iter().map(|connection| Link {
            from: self.named(connection.from),
            to: self.named(connection.to),
            conversion: connection.conversion,
            map: &connection.map,
        })
    }

    /// All outputs.
    pub fn outputs(&self) -> impl Iterator<Item = (String, &Variable)> {
        let ports = self.ports();
        let outputs = ports.filter(|port| self.variable(*port).role == Role::Output);
        outputs.map(|port| self.named(port))
    }

    /// Unconnected inputs.
    pub fn free_inputs(&self) -> impl Iterator<Item = (String, &Variable)> {
        self.unfed().map(|port| self.named(port))
    }

    fn named(&self, port: Port) -> (String, &Variable) {
        (self.port_name(port), self.variable(port))
    }

    /// The variable named `instance.variable`.
    ///
    /// # Errors
    /// If there is no such instance, or it has no such variable.
    pub fn find(&self, name: &str) -> Result<&Variable, SystemError> {
        Ok(self.variable(self.resolve(name)?))
    }

    /// The wire to an input.
    pub(super) fn feeding(&self, input: Port) -> Option<&Connection> {
        self.connections.iter().find(|c| c.to == input)
    }

    /// Makes a variable be read at each communication point, as outputs are.
    pub fn observe(&mut self, port: Port) {
        let is_output = self.variable(port).role == Role::Output;
        let observed = &mut self.instances[port.instance].observed;
        if !is_output && !observed.contains(&port.variable) {
            observed.push(port.variable);
        }
    }

    /// What is not simulated of an instance.
    pub fn limitations(&self) -> impl Iterator<Item = String> {
        let own = self.instances.iter();
        own.filter_map(|own| Some(format!("`{}`: {}", own.name, own.component.limitation()?)))
    }

    /// Stop time suggested by the instances \[s\]; `None` if none suggests one or they differ.
    pub fn suggested_stop(&self) -> Option<f64> {
        let mut stops = (self.instances.iter()).filter_map(|i| i.component.suggested().stop);
        let first = stops.next()?;
        stops.all(|stop| stop == first).then_some(first)
    }

    /// The shortest communication step that an instance suggests \[s\].
    pub fn suggested_step(&self) -> Option<f64> {
        let steps = (self.instances.iter()).filter_map(|i| i.component.suggested().step);
        steps.reduce(f64::min)
    }

    /// Names of the instances, in the order in which they were added.
    pub fn instance_names(&self) -> impl Iterator<Item = &str> {
        self.instances.iter().map(|i| i.name.as_str())
    }

    /// Inputs that are neither connected nor set: they keep their start values.
    pub fn open_inputs(&self) -> Vec<String> {
        let is_set = |port: &Port| self.settings.iter().any(|(set, _)| set == port);
        let ports = self.unfed().filter(|port| !is_set(port));
        ports.map(|port| self.port_name(port)).collect()
    }

    /// What the components can.
    pub fn abilities(&self) -> impl Iterator<Item = Abilities> {
        self.instances.iter().map(|own| own.component.abilities())
    }

    fn unfed(&self) -> impl Iterator<Item = Port> {
        self.ports().filter(|port| {
            self.variable(*port).role == Role::Input
                && !self.connections.iter().any(|c| c.to == *port)
        })
    }

    /// The name `instance.variable` of a port.
    pub fn port_name(&self, port: Port) -> String {
        let instance = &self.instances[port.instance].name;
        format!("{instance}.{}", self.variable(port).name)
    }

    /// Whether both ends of a connection are reals.
    pub(super) fn is_real(&self, connection: &Connection) -> bool {
        let ends = [connection.from, connection.to];
        ends.iter()
            .all(|&port| self.variable(port).kind == ValueKind::Real)
    }

    /// The variable of a port.
    pub fn variable(&self, port: Port) -> &Variable {
        &self.instances[port.instance].component.variables()[port.variable]
    }

    /// `instance.variable` for all ports, including aliases.
    pub fn names(&self) -> impl Iterator<Item = (Port, String)> {
        self.ports().flat_map(|port| {
            let instance = &self.instances[port.instance].name;
            let names = self.variable(port).names();
            names.map(move |name| (port, format!("{instance}.{name}")))
        })
    }

    /// All ports.
    pub fn ports(&self) -> impl Iterator<Item = Port> {
        self.instances
            .iter()
            .enumerate()
            .flat_map(|(instance, wired)| {
                let variables = 0..wired.component.variables().len();
                variables.map(move |variable| Port { instance, variable })
            })
    }

    /// The port of `instance.variable`. Both parts may contain dots; the longest instance name wins.
    ///
    /// # Errors
    /// If there is no such instance, or it has no such variable.
    pub fn resolve(&self, text: &str) -> Result<Port, SystemError> {
        let split = |instance: &Instance| {
            let rest = text.strip_prefix(instance.name.as_str())?;
            rest.strip_prefix('.').map(str::len)
        };
        let candidates = self.instances.iter().enumerate();
        let found = candidates
            .filter_map(|(position, instance)| Some((split(instance)?, position)))
            .min();
        let Some((length, instance)) = found else {
            return Err(match text.contains('.') {
                true => self.unknown_instance(text),
                false => self.no_variable(text),
            });
        };
        let name = &text[text.len() - length..];
        let variables = self.instances[instance].component.variables();
        match variables
            .iter()
            .position(|v| v.names().any(|own| own == name))
        {
            Some(variable) => Ok(Port { instance, variable }),
            None => {
                let instance = self.instances[instance].name.clone();
                let names = variables.iter().flat_map(Variable::names);
                Err(SystemError::UnknownVariable {
                    text: text.to_owned(),
                    suggestion: suggestion(name, names).map(|n| format!("{instance}.{n}")),
                    instance,
                    variable: name.to_owned(),
                })
            }
        }
    }

    fn unknown_instance(&self, text: &str) -> SystemError {
        let instance = text.split_once('.').map_or(text, |(instance, _)| instance);
        SystemError::UnknownInstance {
            text: text.to_owned(),
            instance: instance.to_owned(),
            suggestion: suggestion(instance, self.instance_names()).map(str::to_owned),
            known: self.instance_names().map(str::to_owned).collect(),
        }
    }

    /// Error for a name without a dot.
    fn no_variable(&self, text: &str) -> SystemError {
        let end = format!(".{text}");
        let mut fitting = self.names().map(|(_, name)| name);
        let first = fitting.find(|name| name.ends_with(&end));
        SystemError::NoVariable {
            text: text.to_owned(),
            suggestion: first.filter(|_| !fitting.any(|name| name.ends_with(&end))),
        }
    }

    fn check_roles(&self, from: Port, to: Port) -> Result<(), SystemError> {
        let (from_role, to_role) = (self.variable(from).role, self.variable(to).role);
        if from_role != Role::Output {
            return Err(SystemError::NotAnOutput {
                from: self.port_name(from),
                to: self.port_name(to),
                role: from_role,
                swapped: from_role == Role::Input && to_role == Role::Output,
            });
        }
        if to_role != Role::Input {
            return Err(SystemError::NotAnInput {
                from: self.port_name(from),
                to: self.port_name(to),
                role: to_role,
            });
        }
        Ok(())
    }

    fn check_types(
        &self,
        output: Port,
        input: Port,
        converts_units: bool,
    ) -> Result<Conversion, SystemError> {
        let (from, to) = (self.variable(output), self.variable(input));
        let names = || (self.port_name(output), self.port_name(input));
        if !from.kind.feeds(to.kind) {
            let (from_name, to_name) = names();
            return Err(SystemError::KindMismatch {
                from: from_name,
                to: to_name,
                from_kind: from.kind,
                to_kind: to.kind,
            });
        }
        // Without a unit, a variable cannot be checked.
        let (Some(a), Some(b), true) = (&from.unit, &to.unit, converts_units) else {
            return Ok(Conversion::NONE);
        };
        a.conversion(b).ok_or_else(|| {
            let (from, to) = names();
            SystemError::UnitMismatch {
                from,
                to,
                from_unit: a.name.clone(),
                to_unit: b.name.clone(),
            }
        })
    }
}
