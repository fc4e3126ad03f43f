//! All that the numbers of a study depend on.

use super::run::Opened;
use super::traces::Traced;
use super::{Args, Failure, reducers};
use crate::cli::cosim::scenario;
use crate::cli::system::sum::sum;
use crate::cli::terminal;
use crate::cosim::SystemDescription;
use crate::cosim::clock::{Clock, ClockError};
use crate::inference::sample::square_root;
use crate::series::Rows;
use nalgebra::DMatrix;
use pilotage_language::ModelFile;
use pilotage_sweep::{Design, Joint, Measure, Method, Vary};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// [`Method`] by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum MethodName {
    /// All combinations of lists.
    Grid,
    /// Independent draws.
    Random,
    /// Each variable once in each of as many equally likely parts as there are samples.
    LatinHypercube,
    /// Points that fill the space evenly (Sobol's sequence, scrambled).
    Sobol,
    /// Base samples and what Sobol' indices need: N (k + 2) runs for k variables.
    Saltelli,
}

/// A study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the program.
    pub version: String,
    /// Sums of the contents of all instances, their wires and values.
    pub system: String,
    /// Settings of the simulation.
    pub simulation: String,
    /// The samples.
    pub design: Design,
    /// Names of the measures, with their expressions.
    pub measures: Vec<(String, String)>,
    /// Units of what is varied, and of nothing else.
    pub units: Vec<String>,
    /// Start, stop and step \[s\].
    pub times: [f64; 3],
    /// Signals whose trajectories are kept.
    pub traced: Vec<Traced>,
    /// Whether a sample gives the same numbers each time.
    pub is_repeatable: bool,
}

impl Plan {
    /// That of the arguments, and its measures.
    pub fn new(
        args: &Args,
        scenario: &scenario::Read,
        opened: &mut Opened,
    ) -> Result<(Self, Vec<Measure>), Failure> {
        let measures = measures(args, opened)?;
        let (clock, assumed) = opened.clock(args)?;
        if let Some(assumed) = assumed {
            terminal::note(&assumed);
        }
        let design = design(args, scenario, opened)?;
        let plan = Self {
            units: design.names().map(|name| opened.unit(name)).collect(),
            times: [clock.start(), clock.stop(), clock.step()],
            traced: match &args.trajectories {
                Some(patterns) => opened.traced(patterns)?,
                None => Vec::new(),
            },
            version: env!("CARGO_PKG_VERSION").to_owned(),
            system: sum(opened.description())?,
            simulation: format!("{clock:?} {:?} {:?}", args.coupling, scenario.scenario),
            design,
            measures: measures
                .iter()
                .map(|own| (own.name.clone(), own.given.clone()))
                .collect(),
            is_repeatable: true,
        };
        Ok((plan, measures))
    }

    /// When a run begins and ends, and its steps.
    pub fn clock(&self) -> Result<Clock, ClockError> {
        let [start, stop, step] = self.times;
        Clock::new(start, stop, step)
    }
}

/// The measures of the arguments, over the signals of a system.
fn measures(args: &Args, opened: &Opened) -> Result<Vec<Measure>, Failure> {
    let signals = opened.signals();
    let mut given = args.measure.clone();
    if given.is_empty() {
        // Systems of other tools have names that no expression can hold.
        let is_sayable = |name: &String| {
            let own = [(name.clone(), String::new())];
            Measure::parse(&format!("final({name})"), &own).is_ok()
        };
        let outputs = opened.outputs();
        let outputs = outputs.iter().filter(|name| is_sayable(name));
        given = outputs.map(|name| format!("final({name})")).collect();
    }
    if given.is_empty() {
        return Err(
            Failure::new("nothing is measured, and the system has no outputs")
                .hint("give --measure 'final(instance.variable)'"),
        );
    }
    let parse = |own: &String| {
        let used: Vec<_> = signals
            .iter()
            .filter(|(name, _)| own.contains(name.as_str()))
            .cloned()
            .collect();
        // All of them are named where one is unknown.
        Measure::parse(own, &used).map_err(|error| {
            let near = Measure::parse(own, &signals).err().unwrap_or(error);
            Failure::from(near).hint(format!("one number of a run is made by {}", reducers()))
        })
    };
    let all: Vec<Measure> = given.iter().map(parse).collect::<Result<_, _>>()?;
    if let Some(k) = (1..all.len()).find(|k| all[..*k].iter().any(|own| own.name == all[*k].name)) {
        let message = format!("two measures are named `{}`", all[k].name);
        return Err(Failure::new(message).hint("give one a name: --measure 'other = ...'"));
    }
    Ok(all)
}

fn design(args: &Args, scenario: &scenario::Read, opened: &Opened) -> Result<Design, Failure> {
    // A variable of the system, or a number of an event.
    let varied = |name: &str, value: f64| match event(name).filter(|_| args.scenario.is_some()) {
        Some(own) => {
            scenario.clone().set(own, value)?;
            Ok(name.to_owned())
        }
        None => opened.varied(name),
    };
    if let Some(file) = &args.table {
        return of_table(file, &varied);
    }
    let (mut vary, mut joint) = (Vec::new(), Vec::new());
    for given in &args.vary {
        match given.split_once('~') {
            Some((instance, "fit")) => joint.push(fitted(instance.trim(), opened.description())?),
            _ => {
                let mut own = Vary::parse(given)?;
                own.name = varied(&own.name, own.law.quantile(0.5))?;
                vary.push(own);
            }
        }
    }
    let is_grid = joint.is_empty() && vary.iter().all(|own| own.law.list().is_some());
    let method = match args.method {
        None if is_grid => Method::Grid,
        None | Some(MethodName::LatinHypercube) => Method::LatinHypercube,
        Some(MethodName::Grid) => Method::Grid,
        Some(MethodName::Random) => Method::Random,
        Some(MethodName::Sobol) => Method::Sobol,
        Some(MethodName::Saltelli) => Method::Saltelli,
    };
    let design = Design {
        vary,
        joint,
        method,
        samples: args.samples as usize,
        seed: args.seed,
        rows: Vec::new(),
    };
    Ok(design.checked()?)
}

/// What a varied name says of an event of the scenario.
pub fn event(name: &str) -> Option<&str> {
    name.strip_prefix(scenario::PREFIX)
}

/// The rows of a table.
fn of_table(
    path: &Path,
    varied: &dyn Fn(&str, f64) -> Result<String, Failure>,
) -> Result<Design, Failure> {
    let file = path.display().to_string();
    let bytes = crate::file::bytes(path);
    let bytes = bytes.map_err(|error| Failure::new(format!("cannot read {file}: {error}")))?;
    let mut rows = Rows::new(&bytes[..], &file)?;
    let mut vary = Vec::new();
    if rows.advance()? {
        for name in rows.cells().map(str::to_owned).collect::<Vec<_>>() {
            let name = varied(&name, 1.0)
                .map_err(|failure| failure.hint(format!("{file} has a column of that name")))?;
            let law = pilotage_sweep::Law::List(Vec::new());
            vary.push(Vary { name, law });
        }
    }
    let mut all = Vec::new();
    while rows.advance()? {
        if rows.count() != vary.len() {
            return Err(rows.ragged(vary.len()).into());
        }
        let value = |(cell, own): (&str, &Vary)| {
            let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
            let words = || {
                Failure::new(format!(
                    "{file}, line {}: `{cell}` is no value of {}",
                    rows.line(),
                    own.name
                ))
            };
            value.ok_or_else(words)
        };
        all.push(
            rows.cells()
                .zip(&vary)
                .map(value)
                .collect::<Result<Vec<f64>, _>>()?,
        );
    }
    let design = Design {
        vary,
        joint: Vec::new(),
        method: Method::Table,
        samples: 0,
        seed: 0,
        rows: all,
    };
    let fault = |error| Failure::from(error).hint(format!("look into {file}"));
    design.checked().map_err(fault)
}

/// Parameters of an instance with the covariance that a fit left in its model file.
fn fitted(instance: &str, description: &SystemDescription) -> Result<Joint, Failure> {
    let own = description
        .instances
        .iter()
        .find(|own| own.name == instance);
    let Some(own) = own else {
        let all: Vec<&str> = description
            .instances
            .iter()
            .map(|own| own.name.as_str())
            .collect();
        let message = format!("--vary {instance}~fit: there is no instance `{instance}`");
        return Err(Failure::new(message).hint(format!("there are {}", all.join(", "))));
    };
    let file = own
        .source
        .value
        .file()
        .filter(|file| crate::cli::recognise::is_model(file));
    let none = || {
        let message = format!(
            "--vary {instance}~fit: `{instance}` is no model file with the covariance of a fit"
        );
        Failure::new(message).hint("`pilotage fit -o pilot.toml` writes one")
    };
    let model: ModelFile = pilotage_language::read(file.ok_or_else(none)?)?.file;
    let sure = model.uncertainty.as_ref().ok_or_else(none)?;
    let start = |name: &String| {
        let own = model.parameters.iter().find(|own| own.name == *name)?;
        own.start.number()
    };
    let means: Vec<Option<f64>> = sure.parameters.iter().map(start).collect();
    let kept: Vec<usize> = (0..means.len()).filter(|k| means[*k].is_some()).collect();
    let n = kept.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| sure.covariance[kept[i]][kept[j]]);
    let root = square_root(&covariance);
    Ok(Joint {
        names: kept
            .iter()
            .map(|k| format!("{instance}.{}", sure.parameters[*k]))
            .collect(),
        mean: kept.iter().filter_map(|k| means[*k]).collect(),
        root: (0..n)
            .map(|i| root.row(i).iter().copied().collect())
            .collect(),
    })
}
