//! The instances of a problem as equations.

use crate::problem::error::ProblemError;
use pilotage_cosim::description::{InstanceDescription, InstanceSource, Interface};
use pilotage_expression::{Function, Model, Node, Opaque, System};
use pilotage_fmi_equations::{Calls, EquationsError, FmuEquations, Variable as FmuVariable};
use pilotage_language::file::Variable;
use pilotage_language::{Compiled, ModelFileError, parse};
use pilotage_models::{library, traced};
use pilotage_sdk::{Equations, Table};
use pilotage_text::document::DocumentError;
use pilotage_text::error_chain::error_chain;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::Base;
use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Part of the range of an output within which the corners of its saturation are rounded.
const CORNER: f64 = 0.01;

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
    /// Its FMU, where it is one.
    pub fmu: Option<FmuPart>,
}

/// What an instance that is an FMU has beside its equations.
#[derive(Debug, Clone)]
pub struct FmuPart {
    /// The file.
    pub path: PathBuf,
    /// Its event indicators among the outputs.
    pub indicators: Vec<String>,
    /// The first time event \[s\].
    pub next_event: Option<f64>,
    /// What of its description is not so.
    pub notes: Vec<String>,
    /// States with the parameters that they begin at, of FMUs that pilotage has made.
    pub start_parameters: Vec<(String, String)>,
    /// Names of its continuous locals.
    pub locals: Vec<String>,
    /// Parameters that are no single reals of double precision, each with its type.
    pub others: Vec<(String, String)>,
    /// Whether it can still be called.
    pub calls: Calls,
    /// Its function, which knows why it had no values.
    pub function: Arc<dyn Opaque>,
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
            fmu: None,
            model,
            starts,
            variables,
        }
    }

    /// Lets outputs saturate at their limits, which are constraints no more. The corners are rounded within a hundredth of
    /// the range: of a corner itself the search has no derivative.
    pub fn saturate(&mut self) {
        let System { graph, outputs, .. } = &mut self.model.system;
        for (output, limit) in outputs.iter_mut().zip(&mut self.limits) {
            if let Some([low, high]) = limit.take() {
                let range = graph.subtract(high, low);
                let corner = graph.scale(CORNER, range);
                let square = graph.multiply(corner, corner);
                // Half of √((x - low)² + ε²) - √((x - high)² + ε²) + low + high.
                let [above, below] = [low, high].map(|end| {
                    let off = graph.subtract(*output, end);
                    let off = graph.multiply(off, off);
                    let sum = graph.add(off, square);
                    graph.unary(Function::Sqrt, sum)
                });
                let ends = graph.add(low, high);
                let sum = graph.subtract(above, below);
                let sum = graph.add(sum, ends);
                *output = graph.scale(0.5, sum);
            }
        }
    }

    /// The instance that an FMU for model exchange is.
    ///
    /// # Errors
    /// When it cannot be loaded, or has no equations.
    pub fn of_fmu(path: &Path) -> Result<Self, EquationsError> {
        Self::of_fmu_with(path, &[])
    }

    /// The same with these of its locals as outputs.
    ///
    /// # Errors
    /// As [`Self::of_fmu`].
    pub fn of_fmu_with(path: &Path, locals: &[String]) -> Result<Self, EquationsError> {
        let equations = pilotage_fmi_equations::open_with(path, locals)?;
        let FmuEquations { model, starts, .. } = equations;
        // Of an output that is a state the state is told first.
        let mut variables = HashMap::new();
        for own in &equations.variables {
            variables
                .entry(own.name.clone())
                .or_insert_with(|| of_fmu(own));
        }
        Ok(Self {
            limits: vec![None; model.outputs.len()],
            fmu: Some(FmuPart {
                path: path.to_owned(),
                indicators: equations.indicators,
                next_event: equations.next_event,
                notes: equations.notes,
                start_parameters: equations.start_parameters,
                locals: equations.locals,
                others: equations.others,
                calls: equations.calls,
                function: equations.function,
            }),
            file: None,
            starts,
            variables,
            model,
        })
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
            fmu: None,
            variables,
            model,
        })
    }
}

/// An instance with those locals of its FMU among the outputs that the problem names.
///
/// # Errors
/// When the FMU cannot be loaded again.
pub fn with_locals(
    instance: &InstanceDescription,
    part: Part,
    named: &HashSet<String>,
) -> Result<Part, ProblemError> {
    let Some(fmu) = &part.fmu else {
        return Ok(part);
    };
    let is_named = |local: &&String| named.contains(&format!("{}.{local}", instance.name));
    let wanted: Vec<String> = fmu.locals.iter().filter(is_named).cloned().collect();
    if wanted.is_empty() {
        return Ok(part);
    }
    let path = fmu.path.clone();
    // Of some FMUs there may be one instance at a time.
    drop(part);
    let bad = |error: EquationsError| {
        ProblemError::maybe_at(instance.source.place.as_ref(), in_full(&path, &error))
    };
    Part::of_fmu_with(&path, &wanted).map_err(bad)
}

fn of_fmu(variable: &FmuVariable) -> About {
    // Units that nobody knows cannot be checked.
    let known = |name: &&String| Base::of(name).is_some();
    About {
        unit: variable.unit.as_ref().filter(known).cloned(),
        start: variable.start,
        min: variable.min,
        max: variable.max,
        nominal: variable.nominal,
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

/// Opens a built-in model, a model file or an FMU.
///
/// # Errors
/// When there is none, or it has a mistake.
pub fn open(instance: &InstanceDescription) -> Result<Part, ProblemError> {
    let place = instance.source.place.as_ref();
    let fault = |text: String| ProblemError::maybe_at(place, text);
    match instance.source.value.file().filter(|file| is_fmu(file)) {
        Some(file) if instance.interface == Some(Interface::CoSimulation) => {
            return Err(fault(format!(
                "{} is taken for co-simulation here, which hides its equations; a fit needs kind = \"me\"",
                file.display()
            )));
        }
        Some(file) => {
            if let Some(order) = &instance.order {
                let text = format!("{} has no order; leave `order` out", file.display());
                return Err(ProblemError::maybe_at(order.place.as_ref(), text));
            }
            let bad = |error: EquationsError| fault(in_full(file, &error));
            return Part::of_fmu(file).map_err(bad);
        }
        None => {}
    }
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
        InstanceSource::Model(file) if is_called_fmu(file) => {
            return Err(fault(not_an_fmu(file)));
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

/// Whether a file is an archive, or a folder of an unpacked FMU.
fn is_fmu(path: &Path) -> bool {
    let mut first = [0; 4];
    let is_archive =
        |mut file: File| file.read_exact(&mut first).is_ok() && &first == b"PK\x03\x04";
    path.join("modelDescription.xml").is_file() || File::open(path).is_ok_and(is_archive)
}

/// What to say of a file that is no FMU, though called one.
fn not_an_fmu(file: &Path) -> String {
    let name = file.display();
    let is_empty = std::fs::metadata(file).is_ok_and(|about| about.len() == 0);
    match (file.is_dir(), is_empty) {
        (true, _) => format!("{name} is no FMU: the folder has no modelDescription.xml"),
        (false, true) => format!("{name} is no FMU: the file is empty"),
        (false, false) => format!("{name} is no FMU: it is no zip archive"),
    }
}

/// Whether what is there is called an FMU.
fn is_called_fmu(file: &Path) -> bool {
    file.exists() && file.extension().is_some_and(|end| end == "fmu")
}

/// An error about a file with its causes, in one line.
fn in_full(file: &Path, error: &dyn Error) -> String {
    let (name, text) = (file.display().to_string(), error_chain(error));
    match error.to_string().contains(&name) {
        true => text,
        false => format!("{name}: {text}"),
    }
}

fn unknown(name: &str) -> String {
    let near = did_you_mean(suggestion(
        name,
        library::all().iter().map(|model| model.name),
    ));
    format!("there is no built-in model `{name}`{near}; `pilotage models` lists them")
}
