//! Arguments that say what is simulated, and the system that they make.

use super::super::Failure;
use super::super::recognise::{self, Kind as Kinds};
use super::{inputs, parameters};
use crate::cosim::{NativeSlave, Slave, System, fmu_slave};
use crate::document::{self, Document};
use crate::fmi::Kind;
use crate::identification::PilotFile;
use crate::models::model::Model;
use crate::vehicle;
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// FMUs, models, tables, wires and values.
#[derive(Debug, clap::Args)]
pub struct Wiring {
    /// FMUs, or pilot and vehicle files (TOML) that run without being exported; an instance is named
    /// after its file unless NAME= says otherwise.
    #[arg(required = true, value_name = "[NAME=]FMU")]
    models: Vec<String>,
    /// What FMUs that can be both are used for [default: cs].
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    /// Wire an output to an input; may be given many times. Arrays of the same dimensions are wired element
    /// by element, `NAME[1]` is one of them (in quotes, for the sake of shells such as zsh).
    #[arg(long, value_name = "INSTANCE.OUTPUT=INSTANCE.INPUT", value_parser = pair)]
    connect: Vec<(String, String)>,
    /// Feed inputs from a table (CSV: `time [s]`, then columns with units); a column that is named like
    /// an input (of a single FMU: without the instance, too) feeds it, others are wired by --connect NAME.COLUMN=INSTANCE.INPUT. Values between
    /// samples are interpolated (held, where the input is no real); a repeated time is a jump.
    #[arg(long, value_name = "[NAME=]CSV")]
    input: Vec<String>,
    /// Give a parameter or an unconnected input its value; may be given many times.
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// Take such values from a file: TOML (`[instance]`, then `variable = value`) or CSV (columns `name`,
    /// `value` and, if wanted, `unit`). What --set says comes first.
    #[arg(long, value_name = "FILE")]
    parameters: Vec<PathBuf>,
}

/// [`Kind`] by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum KindName {
    /// Co-simulation: the FMU brings its own solver.
    Cs,
    /// Model exchange: the FMU's equations are solved here, with error control and events.
    Me,
}

impl From<KindName> for Kind {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Cs => Self::CoSimulation,
            KindName::Me => Self::ModelExchange,
        }
    }
}

/// `a=b`, split at the first `=`.
pub fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((left, right)) if !left.is_empty() => Ok((left.to_owned(), right.to_owned())),
        _ => Err("expected two parts with `=` between them".to_owned()),
    }
}

/// A wired system, and what to tell about the tables that feed it.
pub struct Wired {
    /// Ready to run.
    pub system: System,
    /// The tables.
    pub tables: Vec<inputs::Table>,
}

impl Wiring {
    /// All files that are read.
    pub fn files(&self) -> Vec<PathBuf> {
        let named = self.models.iter().chain(&self.input);
        let named = named.map(|argument| instance(argument).1);
        named.chain(self.parameters.iter().cloned()).collect()
    }

    /// Opens everything and wires it.
    pub fn build(&self) -> Result<Wired, Failure> {
        self.expect()?;
        let mut system = System::new();
        for argument in &self.models {
            let (name, file) = instance(argument);
            system.add(&name, self.open(&file, &name)?)?;
        }
        let only = (self.models.len() == 1).then(|| instance(&self.models[0]).0);
        let tables = (self.input.iter())
            .map(|argument| inputs::add(&mut system, argument, &self.connect, only.as_deref()))
            .collect::<Result<Vec<_>, Failure>>()?;
        for (from, to) in &self.connect {
            system.connect(from, to)?;
        }
        for (name, value) in &self.set {
            system.set(name, value).map_err(|error| {
                let failure = Failure::from(error);
                match document::with_point(value) {
                    Some(number) => {
                        failure.hint(format!("write a decimal point: --set {name}={number}"))
                    }
                    None => failure,
                }
            })?;
        }
        for file in &self.parameters {
            parameters::apply(&mut system, file, &self.set)?;
        }
        Ok(Wired { system, tables })
    }

    /// Refuses files in the wrong place.
    fn expect(&self) -> Result<(), Failure> {
        use Kinds::{Archive, Fmu, Pilot, Table, Trial, Vehicle};
        let named = |arguments: &[String]| -> Vec<PathBuf> {
            arguments
                .iter()
                .map(|argument| instance(argument).1)
                .collect()
        };
        let models = "an FMU, a pilot file or a vehicle file";
        recognise::expect(
            &named(&self.models),
            &[Fmu, Archive, Pilot, Vehicle],
            models,
        )?;
        let table = "a table over time (CSV) for --input";
        recognise::expect(&named(&self.input), &[Trial, Table], table)?;
        let values = "start values for --parameters (TOML or CSV)";
        recognise::expect(&self.parameters, &[], values)
    }

    fn open(&self, file: &Path, name: &str) -> Result<Box<dyn Slave>, Failure> {
        let is_model = file
            .extension()
            .is_some_and(|extension| extension == "toml");
        match is_model {
            true => Ok(Box::new(NativeSlave::new(model(file)?))),
            false => Ok(fmu_slave::open(file, name, self.kind.map(Kind::from))?),
        }
    }
}

/// Name and file of `NAME=FILE` or `FILE`; a file whose own name has a `=` is a file.
pub fn instance(argument: &str) -> (String, PathBuf) {
    let path = Path::new(argument);
    match argument.split_once('=') {
        Some((name, file)) if !path.exists() => (name.to_owned(), PathBuf::from(file)),
        _ => {
            // `.` and `..` have a name too, that of their folder.
            let full = match path.file_stem() {
                Some(_) => path.to_owned(),
                None => path.canonicalize().unwrap_or_default(),
            };
            let stem = full.file_stem().unwrap_or_default();
            (stem.to_string_lossy().into_owned(), path.to_owned())
        }
    }
}

/// The model that a pilot or a vehicle file describes: a pilot has θ.
fn model(file: &Path) -> Result<Model, Failure> {
    let (text, name) = (document::read(file)?, file.display().to_string());
    if !Document::parse(&text, &name)?
        .root()
        .names()
        .contains(&"theta")
    {
        return Ok(Model::quadcopter(&vehicle::parse(&text, &name)?));
    }
    let pilot = PilotFile::parse(&text, &name)?;
    let order = pilot.theta.len() / 2;
    match order <= Model::MAX_ORDER {
        true => Ok(Model::pilot(&pilot.theta, pilot.stick_limit)),
        false => Err(Failure::new(format!(
            "{name}: a pilot of order {order} cannot run; the highest order is {}",
            Model::MAX_ORDER
        ))),
    }
}
