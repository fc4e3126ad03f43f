//! The instances of a problem as equations.

use crate::error::ProblemError;
use pilotage_cosim::description::{InstanceDescription, InstanceSource};
use pilotage_expression::{Model, Node};
use pilotage_language::file::Variable;
use pilotage_language::{Compiled, ModelFileError, parse};
use pilotage_models::{library, traced};
use pilotage_sdk::{Equations, Table};
use pilotage_text::document::DocumentError;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::collections::HashMap;

/// An instance's model.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its equations, with all parameters.
    pub model: Model,
    /// For each output between which values it is held, as expressions of parameters.
    pub limits: Vec<Option<[Node; 2]>>,
    /// Start value of each state, as an expression of parameters.
    pub starts: Vec<Node>,
    /// What is known of each variable.
    pub variables: HashMap<String, About>,
    /// Its model file, where it has one.
    pub file: Option<Box<Compiled>>,
}

/// What is known of a variable.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct About {
    /// Name of its unit; `None` where it is not to be checked.
    pub unit: Option<String>,
    /// Start value.
    pub start: f64,
    /// Least value.
    pub min: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
}

impl Part {
    /// The instance that a model file describes.
    pub fn of_file(compiled: Compiled) -> Self {
        let mut model = compiled.model.clone();
        let zero = model.system.graph.constant(0.0);
        let mut starts = compiled.starts().to_vec();
        starts.resize(model.states.len(), zero);
        let delays = compiled.delays.iter().map(|state| {
            let unit = state.unit.clone();
            (
                state.name.clone(),
                About {
                    unit,
                    ..About::default()
                },
            )
        });
        let declared = compiled.file.variables();
        let declared = declared.map(|(own, _)| (own.name.clone(), about(own)));
        // Of a state and an output of one name the state comes first, and knows more.
        let mut variables = HashMap::new();
        for (name, about) in delays.chain(declared) {
            variables.entry(name).or_insert(about);
        }
        Self {
            limits: compiled.limits.clone(),
            file: Some(Box::new(compiled)),
            model,
            starts,
            variables,
        }
    }

    /// The instance that equations in Rust describe.
    ///
    /// # Errors
    /// Where they are no expressions.
    pub fn of_equations<E: Equations>(equations: &E) -> Result<Self, ProblemError> {
        let mut model = traced(equations).map_err(|error| ProblemError::Part(error.to_string()))?;
        let table = equations.table();
        let variables: HashMap<String, About> = of_table(&table).collect();
        let start = |name: &String| variables.get(name).map_or(0.0, |about| about.start);
        let starts: Vec<f64> = model.states.iter().map(start).collect();
        let graph = &mut model.system.graph;
        Ok(Self {
            starts: starts
                .into_iter()
                .map(|start| graph.constant(start))
                .collect(),
            limits: vec![None; model.outputs.len()],
            file: None,
            variables,
            model,
        })
    }
}

fn of_table(table: &Table) -> impl Iterator<Item = (String, About)> {
    table.variables().iter().map(|own| {
        let about = About {
            unit: own.unit.is_some().then(|| own.unit.name.to_string()),
            start: own.start.unwrap_or_default(),
            min: own.min,
            max: own.max,
            nominal: own.nominal,
        };
        (own.name.to_string(), about)
    })
}

fn about(variable: &Variable) -> About {
    About {
        unit: variable.unit.clone(),
        start: variable.start.number().unwrap_or_default(),
        min: variable.min,
        max: variable.max,
        nominal: variable.nominal,
    }
}

/// Opens a built-in model or a model file.
///
/// # Errors
/// When there is none, or it has a mistake.
pub fn open(instance: &InstanceDescription) -> Result<Part, ProblemError> {
    let place = instance.source.place.as_ref();
    let fault = |text: String| ProblemError::maybe_at(place, text);
    if instance.interface.is_some() {
        let text = "`kind` says what an FMU is used for, and this is none; leave it out";
        return Err(fault(text.to_owned()));
    }
    let compiled = match &instance.source.value {
        InstanceSource::BuiltIn(name) => {
            let built_in = library::find(name).ok_or_else(|| fault(unknown(name)))?;
            let order = instance.order.as_ref().map(|order| order.value as usize);
            let text = match (order, built_in.has_order) {
                (Some(order), true) if order > library::MAX_ORDER => {
                    let most = library::MAX_ORDER;
                    return Err(fault(format!(
                        "the order is {order}; the highest is {most}"
                    )));
                }
                (Some(order), true) => library::linear(order),
                (Some(_), false) => {
                    let fault = format!("the model `{name}` has no order; leave `order` out");
                    let place = instance
                        .order
                        .as_ref()
                        .and_then(|order| order.place.as_ref());
                    return Err(ProblemError::maybe_at(place, fault));
                }
                (None, _) => built_in.text.to_owned(),
            };
            parse(&text, name, &|_| Err(std::io::ErrorKind::NotFound.into()))?
        }
        InstanceSource::Model(file) => {
            if let Some(order) = &instance.order {
                let text = format!("{} has no order; leave `order` out", file.display());
                return Err(ProblemError::maybe_at(order.place.as_ref(), text));
            }
            let unread = |error| match error {
                ModelFileError::Document(error @ DocumentError::Read { .. }) => {
                    ProblemError::unread(place, file, &error)
                }
                other => other.into(),
            };
            pilotage_language::read(file).map_err(unread)?
        }
        InstanceSource::Table(file) => {
            return Err(fault(format!(
                "{} is a table; name its columns in [inputs] of the problem",
                file.display()
            )));
        }
    };
    Ok(Part::of_file(compiled))
}

fn unknown(name: &str) -> String {
    let near = did_you_mean(suggestion(
        name,
        library::all().iter().map(|model| model.name),
    ));
    format!("there is no built-in model `{name}`{near}; `pilotage models` lists them")
}
