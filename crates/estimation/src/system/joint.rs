//! The connected instances of a problem: one model with variables named `instance.variable`.

use crate::problem::error::ProblemError;
use crate::system::delayed::DelayedInput;
use crate::system::part::{About, Part};
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::{Spanned, Wire};
use pilotage_expression::{Model, Node};
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::{Conversion, Unit};
use std::collections::HashMap;

/// Connected instances.
#[derive(Debug)]
pub struct Joint {
    /// The parts with the names of their instances.
    pub parts: Vec<(String, Part)>,
    /// All of them as one model, whose outputs are those of the parts.
    pub model: Model,
    /// Attributes of each variable, by `instance.variable`.
    pub variables: HashMap<String, About>,
    /// Inputs driven by wires, each with the signal that drives it.
    pub driven: HashMap<String, String>,
}

impl Joint {
    /// Connects the parts of a description.
    ///
    /// # Errors
    /// When an end of a wire does not exist, or units are incompatible.
    pub fn new(
        description: &SystemDescription,
        parts: Vec<(String, Part)>,
    ) -> Result<Self, ProblemError> {
        Self::wired(description, parts, &[])
    }

    /// The same, with an additional noise input for each of these inputs: [`Self::noise_input`].
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_noise(
        &self,
        description: &SystemDescription,
        noisy: &[&str],
    ) -> Result<Self, ProblemError> {
        Self::wired(description, self.parts.clone(), noisy)
    }

    /// The variable of the model's graph that adds noise to an input. None if the name is not an input of an instance.
    pub fn noise_input(&self, name: &str) -> Option<usize> {
        let driver = self
            .driven
            .get(name)
            .and_then(|signal| signal.strip_suffix(".y"));
        let noise = driver.map(|part| format!("{part}.w"));
        let name = noise.as_deref().unwrap_or(name);
        let place = self.model.inputs.iter().position(|own| own == name)?;
        Some(self.model.system.input(place))
    }

    fn wired(
        description: &SystemDescription,
        parts: Vec<(String, Part)>,
        noisy: &[&str],
    ) -> Result<Self, ProblemError> {
        let mut variables = HashMap::new();
        for (instance, part) in &parts {
            for (name, about) in &part.variables {
                variables.insert(format!("{instance}.{name}"), about.clone());
            }
        }
        let mut models: Vec<(String, Model)> = (parts.iter())
            .map(|(name, part)| (name.clone(), part.model.clone()))
            .collect();
        let mut wires: Vec<(String, String)> = Vec::new();
        let mut driven: HashMap<String, String> = HashMap::new();
        for (k, wire) in description.connections.iter().enumerate() {
            let Wire { from, to, .. } = wire;
            check_end(&parts, from, End::Output)?;
            check_end(&parts, to, End::Input)?;
            let mut signal = from.value.clone();
            let conversion = conversion(&variables, wire)?;
            if conversion != Conversion::NONE {
                // A separate part: names of the user's instances contain no spaces.
                let name = format!("wire {k}");
                models.push((name.clone(), converter(conversion)));
                wires.push((signal, format!("{name}.u")));
                signal = format!("{name}.y");
            }
            if noisy.contains(&to.value.as_str()) {
                let name = format!("wire noise {k}");
                models.push((name.clone(), adder()));
                wires.push((signal, format!("{name}.u")));
                signal = format!("{name}.y");
            }
            wires.push((signal.clone(), to.value.clone()));
            if driven.insert(to.value.clone(), signal).is_some() {
                let fault = format!("`{}` is driven twice; leave one of the wires out", to.value);
                return Err(ProblemError::maybe_at(to.place.as_ref(), fault));
            }
        }
        let named: Vec<(&str, Model)> = (models.iter())
            .map(|(name, model)| (name.as_str(), model.clone()))
            .collect();
        let wires: Vec<(&str, &str)> = (wires.iter())
            .map(|(from, to)| (from.as_str(), to.as_str()))
            .collect();
        let model = Model::join(&named, &wires);
        Ok(Self {
            model: model.map_err(|error| ProblemError::Part(error.to_string()))?,
            parts,
            variables,
            driven,
        })
    }

    /// The expression of a signal or of a driven input in the model's graph.
    pub fn signal(&self, name: &str) -> Option<Node> {
        let name = self.driven.get(name).map_or(name, String::as_str);
        self.model.signal(name).ok()
    }

    /// Inputs that stand for delays, by `instance.variable`.
    pub fn delayed(&self) -> impl Iterator<Item = DelayedInput> {
        self.parts.iter().flat_map(|(instance, part)| {
            part.delayed.iter().map(move |own| DelayedInput {
                name: format!("{instance}.{}", own.name),
                signal: format!("{instance}.{}", own.signal),
                tau: format!("{instance}.{}", own.tau),
            })
        })
    }

    /// Names of all signals: states, outputs and inputs.
    pub fn signals(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for (instance, part) in &self.parts {
            let model = &part.model;
            for own in [part.outputs(), &model.states, &model.inputs] {
                names.extend(own.iter().map(|name| format!("{instance}.{name}")));
            }
        }
        names
    }

    /// The same with the local variables of FMUs, which may be measured too.
    pub fn measurable(&self) -> Vec<String> {
        let mut names = self.signals();
        for (instance, part) in &self.parts {
            let locals = part.fmu.iter().flat_map(|fmu| &fmu.locals);
            let locals = locals.map(|name| format!("{instance}.{name}"));
            let others: Vec<String> = locals.filter(|name| !names.contains(name)).collect();
            names.extend(others);
        }
        names
    }

    /// Name used in messages for the model of a variable's instance.
    pub fn source_of(&self, name: &str) -> String {
        let own = self.part_of(name).map(|(part, _)| part);
        let file = own.and_then(|part| part.file.as_ref());
        let fmu = own.and_then(|part| part.fmu.as_ref());
        match (file, fmu) {
            (Some(compiled), _) => compiled.file.file.clone(),
            (_, Some(fmu)) => fmu.path.display().to_string(),
            _ => "its model".to_owned(),
        }
    }

    /// The type of an FMU's parameter that is not a scalar real of double precision.
    pub fn parameter_of_other_type(&self, name: &str) -> Option<&str> {
        let (part, own) = self.part_of(name)?;
        let mut others = part.fmu.as_ref()?.others.iter();
        let found = others.find(|(other, _)| other == own);
        found.map(|(_, kind)| kind.as_str())
    }

    /// Whether a parameter is the start value of a state of an FMU.
    pub fn is_start_parameter(&self, name: &str) -> bool {
        let found = self.part_of(name);
        let fmu = found.and_then(|(part, own)| Some((part.fmu.as_ref()?, own)));
        fmu.is_some_and(|(fmu, own)| fmu.start_parameters.iter().any(|(_, start)| start == own))
    }

    /// The part of the instance that prefixes a name, and the rest of the name.
    fn part_of<'n>(&self, name: &'n str) -> Option<(&Part, &'n str)> {
        self.parts.iter().find_map(|(instance, part)| {
            let rest = name.strip_prefix(instance.as_str())?.strip_prefix('.')?;
            Some((part, rest))
        })
    }

    /// Name of a variable's unit, if it has one.
    pub fn unit(&self, name: &str) -> Option<&str> {
        self.variables.get(name)?.unit.as_deref()
    }
}

/// An end of a wire.
#[derive(Debug, Clone, Copy)]
enum End {
    Output,
    Input,
}

fn check_end(
    parts: &[(String, Part)],
    name: &Spanned<String>,
    end: End,
) -> Result<(), ProblemError> {
    let mut known: Vec<String> = Vec::new();
    for (instance, part) in parts {
        let model = &part.model;
        let own: &[&[String]] = match end {
            End::Output => &[part.outputs(), &model.states],
            End::Input => &[&model.inputs],
        };
        let own = own.iter().copied().flatten();
        known.extend(own.map(|variable| format!("{instance}.{variable}")));
    }
    if known.contains(&name.value) {
        return Ok(());
    }
    let what = match end {
        End::Output => "output",
        End::Input => "input",
    };
    let own = |part: &Part| match end {
        End::Output => part.model.inputs.clone(),
        End::Input => [part.outputs(), &part.model.states].concat(),
    };
    let is_other = parts.iter().any(|(instance, part)| {
        let rest = name.value.strip_prefix(&format!("{instance}."));
        rest.is_some_and(|rest| own(part).iter().any(|own| own == rest))
    });
    if is_other {
        let fault = format!(
            "`{}` is no {what}; a wire goes from an output to an input",
            name.value
        );
        return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
    }
    Err(ProblemError::maybe_at(
        name.place.as_ref(),
        unknown(what, &name.value, &known),
    ))
}

/// Message for an unknown name.
pub fn unknown(what: &str, name: &str, known: &[String]) -> String {
    const MOST: usize = 30;
    let near = did_you_mean(suggestion(name, known.iter().map(String::as_str)));
    let shown = known[..known.len().min(MOST)].join(", ");
    let more = match known.len().saturating_sub(MOST) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    match known.is_empty() {
        true => format!("there is no {what} `{name}`: there is none at all"),
        false => format!("there is no {what} `{name}`{near}; there are {shown}{more}"),
    }
}

/// Conversion of the values of a wire: of units, and by its factor and offset.
pub(crate) fn conversion(
    variables: &HashMap<String, About>,
    wire: &Wire,
) -> Result<Conversion, ProblemError> {
    let unit = |name: &str| variables.get(name)?.unit.as_deref();
    let by = &wire.transformation;
    if !by.map.is_empty() {
        let fault = "a map of a wire is not in equations; `cosim` runs it".to_owned();
        return Err(ProblemError::maybe_at(wire.to.place.as_ref(), fault));
    }
    let ends = (unit(&wire.from.value), unit(&wire.to.value));
    let (Some(from), Some(to), true) = (ends.0, ends.1, by.converts_units) else {
        return Ok(by.linear);
    };
    let conversion = Unit::named(from).conversion(&Unit::named(to));
    let conversion = conversion.map(|units| units.then(by.linear));
    conversion.ok_or_else(|| {
        let fault = format!(
            "`{}` [{from}] does not fit `{}` [{to}]; convert it in a model between them",
            wire.from.value, wire.to.value
        );
        ProblemError::maybe_at(wire.to.place.as_ref(), fault)
    })
}

/// The model `y = u + w`.
fn adder() -> Model {
    let names: [&[&str]; 4] = [&[], &["u", "w"], &[], &["y"]];
    let model = Model::trace(names, |at| [vec![], vec![at.u[0] + at.u[1]]]);
    model.expect("a sum is an expression")
}

/// The model `y = factor u + offset`.
fn converter(conversion: Conversion) -> Model {
    let Conversion { factor, offset } = conversion;
    let names: [&[&str]; 4] = [&[], &["u"], &[], &["y"]];
    let model = Model::trace(names, |at| [vec![], vec![at.u[0] * factor + offset]]);
    model.expect("a line is an expression")
}
