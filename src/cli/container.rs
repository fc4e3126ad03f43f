//! `pilotage container`: makes one FMU of a system.

use super::cosim::coupling::CouplingArgs;
use super::export::{FmuArgs, PlatformArgs, print_written};
use super::number::{number, positive};
use super::overwrite::OutputKind;
use super::system::flags::Wiring;
use super::system::resolve::{Source, source};
use super::system::{Built, explain};
use super::{Failure, Outcome, terminal};
use crate::cosim::container::{Kind, Manifest, Part, TABLE};
use crate::cosim::description::InstanceDescription;
use crate::cosim::{Clock, Coupling, Port, Role, Selection, System};
use crate::export::{self, Platform, Provenance, binary, container};
use crate::file;
use crate::fmi::archive::{Archive, Limits};
use crate::fmi::{Fmu, InterfaceType};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments of `pilotage container`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    # Pilot and vehicle with strong coupling, as one FMU for any tool.\n  \
    pilotage container pilot.fmu quadcopter.fmu \\\n    \
      --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\\n    \
      --algorithm strong --step 0.05 -o flown.fmu\n\n  \
    # A system file or a system of another tool, with some outputs, for FMI 3.0.\n  \
    pilotage container system.ssp --outputs 'vehicle.*' --fmi 3 -o one.fmu\n\n\
The FMU is for co-simulation. It has no model exchange: algorithms exchange values at\n\
    communication points, which a solver outside does not know; parts that have model exchange alone\n\
    are solved inside. Free inputs of the system are its inputs, and parameters of the parts are\n\
    called INSTANCE.PARAMETER. It takes communication steps of any length if all parts do, and else\n\
    multiples of --step; it keeps states (canGetAndSetFMUstate) if all parts do.\n\n\
    Parts are third-party code that runs in the importer's process: a crash of one of them is a crash\n\
    of the importer.")]
pub struct Args {
    #[command(flatten)]
    wiring: Wiring,
    /// Communication step between the parts [s] [default: that of the system file, or the shortest that an FMU suggests].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    step: Option<f64>,
    /// Start time that the FMU suggests [s] [default: that of the system file, or 0].
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_hyphen_values = true)]
    start_time: Option<f64>,
    /// Stop time that the FMU suggests [s] [default: that of the system file, or what the FMUs suggest, if they agree].
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_hyphen_values = true)]
    stop_time: Option<f64>,
    #[command(flatten)]
    coupling: CouplingArgs,
    /// Outputs of the FMU, from the outputs and locals of the parts: `instance.variable`, where `*` stands for any characters
    /// and `?` for one character [default: all outputs].
    #[arg(long, value_name = "PATTERN,...", value_delimiter = ',')]
    outputs: Vec<String>,
    /// FMU to write.
    #[arg(short, long, value_name = "FILE", default_value = "container.fmu")]
    output: PathBuf,
    #[command(flatten)]
    fmu: FmuArgs,
    #[command(flatten)]
    platforms: PlatformArgs,
}

/// Shortest step between the parts, relative to the stop time or a second.
const SHORTEST: f64 = 1e-9;

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let output = (args.output.as_path(), OutputKind::Fmu);
    let mut built = args.wiring.build(&args.fmu.overwrite, &[], &[output])?;
    let mut system = std::mem::take(&mut built.system);
    let step = args.step_of(&built, &system)?;
    let start = (args.start_time.or(built.description.experiment.start)).unwrap_or(0.0);
    let stop = (args.stop_time.or(built.description.experiment.stop))
        .or_else(|| system.suggested_stop().filter(|stop| *stop > start));
    if let Some(stop) = args.stop_time.filter(|stop| *stop <= start) {
        let message = format!("the simulation would run from {start} s to {stop} s");
        return Err(Failure::new(message).hint("say a stop after the start"));
    }
    let clock = Clock::standing(start, step)?;
    if step < SHORTEST * stop.unwrap_or(1.0).abs().max(1.0) {
        let message =
            format!("steps of {step:?} s are too short: the FMU would not come to its end");
        return Err(Failure::new(message).hint("such as --step 0.01"));
    }
    let coupling = args.coupling.coupling(&clock)?;
    args.refuse(&coupling)?;
    args.coupling.apply_parts(&mut system)?;
    let outputs = args.outputs_of(&built, &mut system)?;
    for note in built.notes.iter().cloned().chain(system.limitations()) {
        terminal::note(&note);
    }
    let mut parts = Parts::default();
    for instance in &built.description.instances {
        parts.add(instance, &args.coupling)?;
    }
    let set = built.description.settings.iter();
    let manifest = Manifest {
        guid: String::new(),
        step,
        algorithm: coupling.algorithm.to_string(),
        extrapolation: coupling.extrapolation,
        control: (coupling.control).map(|own| [own.tolerance, own.min_step, own.max_step]),
        part_tolerance: args.coupling.component_tolerance(),
        variables: Vec::new(),
        set: set
            .map(|own| (own.name.value.clone(), own.value.clone()))
            .collect(),
        parts: parts.parts,
        wires: Vec::new(),
    };
    let mut provenance = Provenance::default();
    args.fmu.sign(&mut provenance)?;
    let mut options = args.fmu.options()?;
    options.platforms = args.platforms.of(binary::CONTAINER)?;
    if let Some(common) = parts.platforms {
        let all = binary::CONTAINER.platforms()?;
        let is_common = |own: &Platform| common.contains(&own.tuple);
        let own = || all.into_iter().filter(is_common).collect();
        options.platforms.get_or_insert_with(own);
    }
    let name = args
        .output
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let contents = container::Contents {
        name: &name,
        provenance: &provenance,
        options,
        system,
        manifest,
        outputs,
        files: parts.files,
        sources: parts.sources,
        times: (start, stop),
        is_single: parts.is_single,
    };
    let bytes = container::bytes(contents).map_err(|error| match error {
        container::ContainerError::Initialization(error) => explain(error, &built.description),
        other => Failure::from(other),
    })?;
    export::write(&args.output, &bytes)?;
    print_written(&provenance, &args.output)
}

impl Args {
    fn step_of(&self, built: &Built, system: &System) -> Result<f64, Failure> {
        let step = self.step.or(built.description.experiment.step);
        step.or_else(|| system.suggested_step()).ok_or_else(|| {
            Failure::new("no --step, and the FMUs suggest none")
                .hint("say the communication step between the parts, such as --step 0.01")
        })
    }

    /// Options of a run that an FMU cannot have.
    fn refuse(&self, coupling: &Coupling) -> Result<(), Failure> {
        let refused = |option: &str, why: &str| {
            let message = format!("{option} is not for `container`");
            Err(Failure::new(message).hint(why))
        };
        match (coupling.parallel, coupling.measure) {
            _ if self.wiring.isolates_any() => {
                refused("--isolate", "the parts run in the importer's process")
            }
            (true, _) => refused(
                "--parallel",
                "an FMU starts no threads in the importer's process",
            ),
            (_, true) => refused("--details", "`pilotage cosim` of the same system has them"),
            _ => Ok(()),
        }
    }

    /// The outputs of the FMU.
    fn outputs_of(&self, built: &Built, system: &mut System) -> Result<Vec<Port>, Failure> {
        let is_table = |name: &str| {
            built
                .tables
                .iter()
                .any(|own| name.starts_with(&format!("{}.", own.name)))
        };
        if self.outputs.is_empty() {
            let outputs = system.ports().filter(|port| {
                system.variable(*port).role == Role::Output && !is_table(&system.port_name(*port))
            });
            return Ok(outputs.collect());
        }
        let matching = Selection::matching(system, &self.outputs)?;
        let mut ports: Vec<Port> = Vec::new();
        for (port, _) in matching {
            let is_wanted = matches!(system.variable(port).role, Role::Output | Role::Local);
            if is_wanted && !ports.contains(&port) {
                system.observe(port);
                ports.push(port);
            }
        }
        match ports.is_empty() {
            true => Err(Failure::new(format!(
                "no output or local is named like {}",
                self.outputs.join(", ")
            ))
            .hint("inputs and parameters of the FMU are there in any case")),
            false => Ok(ports),
        }
    }
}

/// The parts of the system, with their files.
#[derive(Default)]
struct Parts {
    parts: Vec<Part>,
    files: BTreeMap<String, Vec<u8>>,
    sources: Vec<(String, String)>,
    is_single: bool,
    /// The platforms for which all FMUs have a binary; None without FMUs.
    platforms: Option<Vec<&'static str>>,
    /// Folders of FMUs that several instances share.
    folders: BTreeMap<PathBuf, String>,
}

impl Parts {
    fn add(
        &mut self,
        instance: &InstanceDescription,
        coupling: &CouplingArgs,
    ) -> Result<(), Failure> {
        let name = &instance.name;
        let new = self.new_folder(name);
        let (kind, folder) = match source(instance)? {
            Source::Native(model) => {
                for (file, bytes) in export::resources_of(&model)? {
                    self.files.insert(format!("{new}/{file}"), bytes);
                }
                (Kind::Native, new)
            }
            Source::Table(path) => {
                let bytes = file::bytes(&path).map_err(|error| {
                    Failure::new(format!("cannot read {}: {error}", path.display()))
                })?;
                if bytes.starts_with(b"PAR1") {
                    let message = format!("{}: an FMU reads no Parquet", path.display());
                    return Err(Failure::new(message).hint("write the table as CSV"));
                }
                self.files.insert(format!("{new}/{TABLE}"), bytes);
                (Kind::Table, new)
            }
            Source::Fmu(path, wanted) => self.fmu(&path, wanted, new)?,
        };
        let divided = coupling.parts().iter().find(|(own, _)| own == name);
        self.parts.push(Part {
            name: name.clone(),
            folder,
            kind,
            divides: divided
                .and_then(|(_, parts)| parts.parse().ok())
                .unwrap_or(1),
            at_once: instance.at_once,
        });
        let from = instance.source.value.file();
        let from = from
            .and_then(Path::file_name)
            .map(|own| own.to_string_lossy());
        let from = from.map_or("a built-in model".to_owned(), |own| own.into_owned());
        self.sources.push((name.clone(), from));
        Ok(())
    }

    /// A folder for a part: its name, as far as every system takes it.
    fn new_folder(&self, name: &str) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let stem: String = name.chars().map(plain).take(40).collect();
        format!("{}-{stem}", self.parts.len() + 1)
    }

    /// Adds the files of an FMU that a running one may need, for all its platforms.
    fn fmu(
        &mut self,
        path: &Path,
        wanted: Option<InterfaceType>,
        new: String,
    ) -> Result<(Kind, String), Failure> {
        let fmu = Fmu::open(path)?;
        let description = fmu.description();
        let has_both = (
            description.co_simulation.is_some(),
            description.model_exchange.is_some(),
        );
        let kind = match (has_both, wanted) {
            ((_, true), Some(InterfaceType::ModelExchange)) | ((false, true), _) => {
                Kind::ModelExchange
            }
            _ => Kind::CoSimulation,
        };
        self.is_single |= match kind {
            Kind::ModelExchange => description
                .model_exchange
                .as_ref()
                .is_some_and(|own| own.can_be_instantiated_only_once_per_process),
            _ => description
                .co_simulation
                .as_ref()
                .is_some_and(|own| own.can_be_instantiated_only_once_per_process),
        };
        if let Some(folder) = self.folders.get(path) {
            return Ok((kind, folder.clone()));
        }
        let mut archive = Archive::open(path, Limits::default())?;
        let names: Vec<String> = archive.files().map(str::to_owned).collect();
        let at_rest =
            |name: &&String| !(name.starts_with("documentation/") || name.starts_with("sources/"));
        for name in names.iter().filter(at_rest) {
            let bytes = archive.read(name)?;
            self.files.insert(format!("{new}/{name}"), bytes);
        }
        let folders = fmu.platforms();
        let has = |own: &Platform| folders.iter().any(|name| own.has_name(name));
        let own = Platform::ALL.into_iter().filter(has).map(|own| own.tuple);
        self.platforms = Some(match self.platforms.take() {
            Some(known) => own.filter(|own| known.contains(own)).collect(),
            None => own.collect(),
        });
        self.folders.insert(path.to_owned(), new.clone());
        Ok((kind, new))
    }
}
