//! The instances of a problem as equations.

use crate::problem::error::ProblemError;
use crate::system::delayed::DelayedInput;
use pilotage_cosim::description::{InstanceDescription, InstanceSource, Interface};
use pilotage_expression::{Function, Graph, Model, Node, Opaque, System};
use pilotage_fmi_equations::{Calls, EquationsError, FmuEquations, Variable as FmuVariable};
use pilotage_language::file::Variable;
use pilotage_language::{Compiled, Delayed, ModelFileError, parse};
use pilotage_models::{library, traced};
use pilotage_sdk::{Equations, Table};
use pilotage_text::document::DocumentError;
use pilotage_text::error_chain::error_chain;
use pilotage_text::file;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::Base;
use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// `|x|` with a corner that is rounded within `width`: `w ln(2 cosh(x/w)) = s + w ln(1 + exp(-2s/w))` for `s = |x|`, whose error
/// vanishes exponentially. `s` is `√(x² + δ²)` with a `δ` that is far below the width, so that all derivatives exist at 0.
fn rounded_magnitude(graph: &mut Graph, x: Node, width: Node) -> Node {
    const SHARP: f64 = 1e-6;
    let least = graph.scale(SHARP, width);
    let [square, least] = [x, least].map(|own| graph.multiply(own, own));
    let sum = graph.add(square, least);
    let size = graph.unary(Function::Sqrt, sum);
    let ratio = graph.divide(size, width);
    let ratio = graph.scale(-2.0, ratio);
    let small = graph.unary(Function::Exp, ratio);
    let small = graph.unary(Function::Ln1p, small);
    let rest = graph.multiply(width, small);
    graph.add(size, rest)
}

/// An instance's model.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its equations, with all parameters.
    pub model: Model,
    /// For each output, the limits between which it is held, as expressions of parameters.
    pub limits: Vec<Option<[Node; 2]>>,
    /// Start value of each state, as an expression of parameters.
    pub starts: Vec<Node>,
    /// Attributes of each variable.
    pub variables: HashMap<String, About>,
    /// Inputs that stand for delays.
    pub delayed: Vec<DelayedInput>,
    /// Its model file, if it has one.
    pub file: Option<Box<Compiled>>,
    /// Its FMU, if it is one.
    pub fmu: Option<FmuPart>,
}

/// Additional data of an instance that is an FMU.
#[derive(Debug, Clone)]
pub struct FmuPart {
    /// The file.
    pub path: PathBuf,
    /// Names of its event indicators, which are among the outputs.
    pub indicators: Vec<String>,
    /// The first time event \[s\].
    pub next_event: Option<f64>,
    /// Incorrect statements in its description.
    pub notes: Vec<String>,
    /// States and the parameters that hold their start values, for FMUs exported by pilotage.
    pub start_parameters: Vec<(String, String)>,
    /// Names of its continuous local variables.
    pub locals: Vec<String>,
    /// Parameters that are not scalar reals of double precision, with their types.
    pub others: Vec<(String, String)>,
    /// Whether it can still be called.
    pub calls: Calls,
    /// Its function, which stores why an evaluation failed.
    pub function: Arc<dyn Opaque>,
}

/// Attributes of a variable.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct About {
    /// Name of its unit; `None` if the unit is not checked.
    pub unit: Option<String>,
    /// Start value.
    pub start: f64,
    /// Minimum value.
    pub min: Option<f64>,
    /// Maximum value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
}

impl Part {
    /// The instance described by a model file.
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
        // If a state and an output share a name, the state comes first: it has more attributes.
        let mut variables = HashMap::new();
        for (name, about) in delays.chain(declared) {
            variables.entry(name).or_insert(about);
        }
        let mut limits = compiled.limits.clone();
        let mut delayed = Vec::new();
        for own in compiled
            .free_delays
            .iter()
            .filter(|own| own.by == Delayed::Input)
        {
            let [signal, tau] = ["signal", "time"].map(|what| format!("{what} of {}", own.name));
            model.outputs.extend([signal.clone(), tau.clone()]);
            model.system.outputs.extend([own.signal, own.tau]);
            limits.extend([None; 2]);
            let name = own.name.clone();
            delayed.push(DelayedInput { name, signal, tau });
        }
        Self {
            limits,
            delayed,
            file: Some(Box::new(compiled)),
            fmu: None,
            model,
            starts,
            variables,
        }
    }

    /// Fraction of an output's range within which the corners of its saturation are rounded.
    pub(crate) const CORNER: f64 = 0.01;

    /// Lets outputs saturate at their limits. The corners are rounded within a
    /// hundredth of the range, since a sharp corner has no derivative for the search; elsewhere the output is the same to
    /// rounding.
    pub fn saturate(&mut self) {
        let System { graph, outputs, .. } = &mut self.model.system;
        for (output, limit) in outputs.iter_mut().zip(&self.limits) {
            if let Some([low, high]) = *limit {
                let range = graph.subtract(high, low);
                let corner = graph.scale(Self::CORNER, range);
                // Half of |x - low| - |x - high| + low + high.
                let [above, below] = [low, high].map(|end| {
                    let off = graph.subtract(*output, end);
                    rounded_magnitude(graph, off, corner)
                });
                let ends = graph.add(low, high);
                let sum = graph.subtract(above, below);
                let sum = graph.add(sum, ends);
                *output = graph.scale(0.5, sum);
            }
        }
    }

    /// The instance given by an FMU for model exchange.
    ///
    /// # Foreign code
    /// The FMU's code runs in this process, with its rights; also whenever its equations are evaluated.
    ///
    /// # Errors
    /// When it cannot be loaded, or has no equations.
    pub fn of_fmu(path: &Path) -> Result<Self, EquationsError> {
        Self::of_fmu_with(path, &[])
    }

    /// The same with some of its local variables as outputs.
    ///
    /// # Foreign code
    /// As [`Self::of_fmu`].
    ///
    /// # Errors
    /// As [`Self::of_fmu`].
    pub fn of_fmu_with(path: &Path, locals: &[String]) -> Result<Self, EquationsError> {
        let equations = pilotage_fmi_equations::open_with(path, locals)?;
        let FmuEquations { model, starts, .. } = equations;
        // If an output is a state, the state is listed first.
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
            delayed: Vec::new(),
            starts,
            variables,
            model,
        })
    }

    /// The instance described by equations in Rust.
    ///
    /// # Errors
    /// When they cannot be written as expressions.
    pub fn of_equations<E: Equations>(equations: &E) -> Result<Self, ProblemError> {
        let mut model = traced(equations).map_err(|error| ProblemError::Part(error.to_string()))?;
        let table = equations.table();
        let mut variables: HashMap<String, About> = of_table(&table).collect();
        let start = |index: usize| table.variables()[index].start.unwrap_or_default();
        let mut starts = Vec::new();
        for (name, start) in model.states.iter().zip(table.starts().map(start)) {
            starts.push(model.system.graph.constant(start));
            if let Some(about) = variables.get_mut(name) {
                about.start = start;
            }
        }
        let mut limits = vec![None; model.outputs.len()];
        for (output, parameter) in table.limits() {
            let place = model.system.parameter(*parameter);
            let high = model.system.graph.variable(place);
            limits[*output] = Some([model.system.graph.negate(high), high]);
        }
        Ok(Self {
            starts,
            limits,
            file: None,
            fmu: None,
            delayed: Vec::new(),
            variables,
            model,
        })
    }

    /// Names of its outputs without those that serve the fit alone.
    pub fn outputs(&self) -> &[String] {
        let indicators = self.fmu.as_ref().map_or(0, |fmu| fmu.indicators.len());
        let hidden = indicators + 2 * self.delayed.len();
        &self.model.outputs[..self.model.outputs.len() - hidden]
    }
}

/// An instance with those local variables of its FMU as outputs that the problem names.
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
    // Some FMUs allow only one instance at a time.
    drop(part);
    let bad = |error: EquationsError| {
        ProblemError::maybe_at(instance.source.place.as_ref(), in_full(&path, &error))
    };
    Part::of_fmu_with(&path, &wanted).map_err(bad)
}

fn of_fmu(variable: &FmuVariable) -> About {
    // Unknown units cannot be checked.
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
/// # Foreign code
/// Of an FMU: [`Part::of_fmu`].
///
/// # Errors
/// When it does not exist or contains a mistake.
pub fn open(instance: &InstanceDescription) -> Result<Part, ProblemError> {
    open_with(instance, &|_| Ok(None))
}

/// The text of a model that a file stands for; `None` if it is a model file itself.
pub type ModelText<'t> = &'t dyn Fn(&Path) -> Result<Option<String>, ProblemError>;

/// The same with other files that stand for models.
///
/// # Foreign code
/// As [`open`].
///
/// # Errors
/// As [`open`], and those of `text`.
pub fn open_with(
    instance: &InstanceDescription,
    text: ModelText<'_>,
) -> Result<Part, ProblemError> {
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
        let text = "`kind` selects the interface of an FMU, and this is none; leave it out";
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
            parse(&text, name, &no_table)?
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
            match text(file)? {
                Some(text) => parse(&text, &file.display().to_string(), &no_table)?,
                None => pilotage_language::read(file).map_err(unread)?,
            }
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

/// Reads no table, for models without any.
fn no_table(_: &str) -> std::io::Result<String> {
    Err(std::io::ErrorKind::NotFound.into())
}

/// Whether a path is an archive or the folder of an unpacked FMU.
fn is_fmu(path: &Path) -> bool {
    let mut first = [0; 4];
    let is_archive =
        |mut file: File| file.read_exact(&mut first).is_ok() && &first == b"PK\x03\x04";
    path.join("modelDescription.xml").is_file() || file::regular(path).is_ok_and(is_archive)
}

/// Message for a file that has the extension of an FMU but is not one.
fn not_an_fmu(file: &Path) -> String {
    let name = file.display();
    let is_empty = std::fs::metadata(file).is_ok_and(|about| about.len() == 0);
    match (file.is_dir(), is_empty) {
        (true, _) => format!("{name} is no FMU: the folder has no modelDescription.xml"),
        (false, true) => format!("{name} is no FMU: the file is empty"),
        (false, false) => format!("{name} is no FMU: it is no zip archive"),
    }
}

/// Whether a path exists and has the extension of an FMU.
fn is_called_fmu(file: &Path) -> bool {
    file.exists() && file.extension().is_some_and(|end| end == "fmu")
}

/// An error about a file with its error chain, in one line.
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
