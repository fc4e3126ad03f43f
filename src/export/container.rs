//! A system in one FMU, for co-simulation: its parts, unpacked in `resources`, and the master's library.

use super::{ExportError, ExportOptions, Provenance, binary, documentation, package, terminals};
use crate::cosim::component::ComponentError;
use crate::cosim::container::{FILE, Link, Manifest, TIME};
use crate::cosim::{
    Algorithm, Experiment, MasterError, Port, Role, Session, System, Value, ValueKind, Variable,
};
use crate::fmi::description as fmi;
use pilotage_sdk::guid;
use pilotage_sdk::log::LOG_CATEGORIES;
use pilotage_sdk::variable::reference;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// What is exported.
pub struct Contents<'c> {
    /// Name of the FMU.
    pub name: &'c str,
    /// Version of the standard and platforms.
    pub options: ExportOptions,
    /// Author and date.
    pub provenance: &'c Provenance,
    /// The wired system, not yet initialized.
    pub system: System,
    /// Coupling, parts and start values; the rest is filled in.
    pub manifest: Manifest,
    /// Outputs and locals that become outputs.
    pub outputs: Vec<Port>,
    /// Files of the parts, by their names in `resources/parts`.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Where each part comes from, by its name.
    pub sources: Vec<(String, String)>,
    /// Start and stop time that the FMU suggests \[s\].
    pub times: (f64, Option<f64>),
    /// Whether only one instance may be in a process, as one of the parts asks for.
    pub is_single: bool,
}

/// Why a container cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    /// It cannot be initialized, from which its start values are known.
    #[error("the system cannot be initialized")]
    Initialization(#[from] MasterError),
    /// A start value is not known.
    #[error("the start value of `{name}` is not known")]
    Start {
        /// The variable.
        name: String,
        /// The cause.
        source: ComponentError,
    },
    /// The file cannot be made.
    #[error(transparent)]
    Export(#[from] ExportError),
}

/// A variable of the container, with its value after initialization.
struct Seen {
    name: String,
    variable: Variable,
    causality: fmi::Causality,
    start: Option<Value>,
}

/// The bytes of the FMU.
///
/// # Errors
/// If the system cannot be initialized, or a library does not fit its platform.
pub fn bytes(contents: Contents<'_>) -> Result<Vec<u8>, ContainerError> {
    let Contents {
        name,
        provenance,
        system,
        mut manifest,
        files,
        ..
    } = contents;
    let version = contents.options.version;
    let abilities: Vec<_> = system.abilities().collect();
    let links = system.links().map(|link| Link {
        from: link.from.0,
        to: link.to.0,
        factor: link.conversion.factor,
        offset: link.conversion.offset,
        map: (link.map.iter())
            .map(|(from, to)| (from.to_string(), to.to_string()))
            .collect(),
    });
    manifest.wires = links.collect();
    let seen = seen(system, &manifest, &contents.outputs, contents.times.0)?;
    let names = seen.iter().map(|own| own.name.clone());
    manifest.variables = names.chain([TIME.to_owned()]).collect();
    let identifier = identifier(name);
    let names: Vec<&str> = (manifest.parts.iter())
        .map(|own| own.name.as_str())
        .collect();
    let about = format!(
        "{} as one: {} in steps of {} s",
        names.join(", "),
        manifest.algorithm,
        manifest.step
    );
    let types = types(&seen);
    let mut description = fmi::ModelDescription {
        fmi_version: version,
        model_name: name.to_owned(),
        description: Some(about.clone()),
        author: provenance.author.clone(),
        generation_date_and_time: provenance.date.clone(),
        generation_tool: Some(concat!("pilotage ", env!("CARGO_PKG_VERSION")).into()),
        naming_convention: match seen.iter().all(|own| is_structured(&own.name)) {
            true => fmi::NamingConvention::Structured,
            false => fmi::NamingConvention::Flat,
        },
        co_simulation: Some(fmi::CoSimulation {
            model_identifier: identifier.clone(),
            can_handle_variable_communication_step_size: abilities
                .iter()
                .all(|own| own.variable_steps),
            can_be_instantiated_only_once_per_process: contents.is_single,
            can_not_use_memory_management_functions: version == fmi::FmiVersion::V2,
            can_get_and_set_fmu_state: abilities.iter().all(|own| own.rollback),
            can_serialize_fmu_state: abilities
                .iter()
                .all(|own| own.rollback && own.serialization),
            ..fmi::CoSimulation::default()
        }),
        units: units(&seen),
        log_categories: (LOG_CATEGORIES.iter())
            .map(|(name, description)| fmi::LogCategory {
                name: (*name).into(),
                description: Some((*description).into()),
            })
            .collect(),
        default_experiment: Some(fmi::DefaultExperiment {
            start_time: Some(contents.times.0),
            stop_time: contents.times.1,
            tolerance: None,
            step_size: Some(manifest.step),
        }),
        variables: variables(&seen, &types, version),
        structure: structure(&seen),
        types: types.into_iter().map(|(own, _)| own).collect(),
        ..fmi::ModelDescription::default()
    };
    let fingerprint = fingerprint(&description, &manifest, &files);
    description.guid.clone_from(&fingerprint);
    manifest.guid = fingerprint;
    let mut entries: BTreeMap<String, Vec<u8>> = (files.into_iter())
        .map(|(name, bytes)| (format!("resources/parts/{name}"), bytes))
        .collect();
    entries.insert(
        "modelDescription.xml".to_owned(),
        description.to_xml().into_bytes(),
    );
    entries.insert(format!("resources/{FILE}"), text(&manifest).into_bytes());
    let libraries = contents.options.libraries(binary::CONTAINER)?;
    entries.extend(package::binaries(&libraries, (version, &identifier))?);
    let pages = documentation::container(
        name,
        &about,
        &contents.sources,
        &description.variables,
        version,
    );
    for (name, page) in pages {
        entries.insert(format!("documentation/{name}"), page.into_bytes());
    }
    entries.insert(package::picture_path(version), package::BLOCK.to_vec());
    if version == fmi::FmiVersion::V3 {
        let path = format!("{}/terminalsAndIcons.xml", terminals::FOLDER);
        let is_outside = |own: &&Seen| {
            matches!(
                own.causality,
                fmi::Causality::Input | fmi::Causality::Output
            )
        };
        let outside = seen.iter().filter(is_outside).map(|own| own.name.as_str());
        entries.insert(path, terminals::file(outside).into_bytes());
    }
    Ok(package::zipped(entries)?)
}

/// The manifest as a file.
fn text(manifest: &Manifest) -> String {
    let text = toml::to_string(manifest);
    // Keys are names of fields, and all values have a form in TOML.
    format!(
        "# What pilotage's container is made of\n{}",
        text.unwrap_or_default()
    )
}

/// Free inputs, parameters and the wanted outputs. The system is initialized, for the values with which it begins.
fn seen(
    system: System,
    manifest: &Manifest,
    outputs: &[Port],
    start: f64,
) -> Result<Vec<Seen>, ContainerError> {
    let fed: Vec<&String> = manifest.wires.iter().map(|link| &link.to).collect();
    let mut chosen = Vec::new();
    for role in [Role::Input, Role::Parameter] {
        for port in system.ports() {
            let variable = system.variable(port);
            let is_wanted = variable.role == role && variable.settable;
            if is_wanted && !fed.contains(&&system.port_name(port)) {
                chosen.push((port, role));
            }
        }
    }
    chosen.extend(outputs.iter().map(|port| (*port, Role::Output)));
    let chosen: Vec<_> = (chosen.into_iter())
        .map(|(port, role)| {
            let variable = system.variable(port).clone();
            (port, role, system.port_name(port), variable)
        })
        .collect();
    let mut session = Session::new(system, Algorithm::Jacobi.into())?;
    let experiment = Experiment {
        start,
        stop: f64::INFINITY,
        tolerance: manifest.part_tolerance,
    };
    session.enter_initialization(&experiment)?;
    let seen = chosen.into_iter().map(|(port, role, name, variable)| {
        let causality = match role {
            Role::Input => fmi::Causality::Input,
            Role::Parameter => fmi::Causality::Parameter,
            Role::Output | Role::Local => fmi::Causality::Output,
        };
        let start = match role {
            Role::Input | Role::Parameter => {
                let got = session.get(port, variable.handle, variable.kind);
                Some(got.map_err(|source| ContainerError::Start {
                    name: name.clone(),
                    source,
                })?)
            }
            Role::Output | Role::Local => None,
        };
        Ok(Seen {
            name,
            variable,
            causality,
            start,
        })
    });
    let seen = seen.collect();
    // An algebraic loop without a solution is found now rather than in another tool.
    session.exit_initialization(start)?;
    seen
}

/// A C identifier like a name: the stem of the library's file.
fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let text: String = name.chars().map(plain).collect();
    match text.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() {
        true => format!("_{text}"),
        false => text,
    }
}

/// Whether a name is made of identifiers with indices between dots: most are. Others of that grammar are taken as flat.
fn is_structured(name: &str) -> bool {
    name.split('.').all(|part| {
        let (stem, index) = match part.split_once('[') {
            Some((stem, rest)) => (stem, rest.strip_suffix(']')),
            None => (part, Some("1")),
        };
        let is_index = |text: &str| {
            let mut numbers = text.split(',');
            numbers.all(|n| !n.is_empty() && n.chars().all(|c| c.is_ascii_digit()))
        };
        pilotage_text::is_identifier(stem) && index.is_some_and(is_index)
    })
}

/// The units without duplicates. Where two parts mean different things by one name, only the first is kept.
fn units(seen: &[Seen]) -> Vec<fmi::Unit> {
    let mut units: Vec<fmi::Unit> = Vec::new();
    for unit in seen.iter().filter_map(|own| own.variable.unit.as_ref()) {
        if !units.iter().any(|own| own.name == unit.name) {
            units.push(fmi::Unit {
                name: unit.name.clone(),
                base: unit.base,
                display_units: Vec::new(),
            });
        }
    }
    units
}

/// The enumerations, each with the values that it has in the parts.
type Types = Vec<(fmi::SimpleType, Vec<(String, i64)>)>;

fn types(seen: &[Seen]) -> Types {
    let mut types: Types = Vec::new();
    for own in seen.iter().filter(|own| is_enumeration(&own.variable)) {
        let items = &own.variable.items;
        if types.iter().any(|(_, known)| known == items) {
            continue;
        }
        let item = |(name, value): &(String, i64)| fmi::EnumerationItem {
            name: name.clone(),
            value: *value,
            description: None,
        };
        let kind = fmi::TypeKind::Enumeration {
            attributes: fmi::IntegerAttributes::default(),
            items: items.iter().map(item).collect(),
        };
        let own = fmi::SimpleType {
            // No variable is called so: those have a dot.
            name: format!("Enumeration{}", types.len() + 1),
            description: None,
            kind,
        };
        types.push((own, items.clone()));
    }
    types
}

fn is_enumeration(variable: &Variable) -> bool {
    variable.kind == ValueKind::Enumeration && !variable.items.is_empty()
}

fn variables(seen: &[Seen], types: &Types, version: fmi::FmiVersion) -> Vec<fmi::ScalarVariable> {
    use fmi::{Causality as C, Initial as I, Variability as V};
    let units = units(seen);
    let own = seen.iter().enumerate().map(|(index, own)| {
        let variable = &own.variable;
        let (variability, initial) = match own.causality {
            C::Parameter if variable.is_tunable => (V::Tunable, Some(I::Exact)),
            C::Parameter => (V::Fixed, Some(I::Exact)),
            C::Output => (changes(variable), Some(I::Calculated)),
            _ => (changes(variable), None),
        };
        let kind = kind(own, types, &units, version);
        fmi::ScalarVariable {
            description: Some(variable.description.clone()).filter(|text| !text.is_empty()),
            initial,
            ..fmi::ScalarVariable::new(
                &own.name,
                reference(index),
                own.causality,
                variability,
                kind,
            )
        }
    });
    // FMI 3.0 requires the time; in FMI 2.0 some importers expect a start value of it, which the standard forbids.
    let time = (version == fmi::FmiVersion::V3).then(|| {
        let kind = fmi::VariableKind::real("", None);
        let reference = reference(seen.len());
        fmi::ScalarVariable {
            description: Some("Time".into()),
            ..fmi::ScalarVariable::new(TIME, reference, C::Independent, V::Continuous, kind)
        }
    });
    own.chain(time).collect()
}

fn changes(variable: &Variable) -> fmi::Variability {
    match variable.is_discrete {
        true => fmi::Variability::Discrete,
        false => fmi::Variability::Continuous,
    }
}

fn kind(
    own: &Seen,
    types: &Types,
    units: &[fmi::Unit],
    version: fmi::FmiVersion,
) -> fmi::VariableKind {
    let variable = &own.variable;
    let [min, max] = variable.range;
    let integer = fmi::IntegerAttributes {
        min: min.is_finite().then_some(min as i128),
        max: max.is_finite().then_some(max as i128),
        ..fmi::IntegerAttributes::default()
    };
    let whole: Vec<i128> = match &own.start {
        Some(Value::Integer(value)) => vec![i128::from(*value)],
        _ => Vec::new(),
    };
    match variable.kind {
        ValueKind::Real => {
            let is_own = |unit: &&crate::cosim::Unit| {
                (units.iter()).any(|own| own.name == unit.name && own.base == unit.base)
            };
            let unit = variable.unit.as_ref().filter(is_own);
            let attributes = fmi::RealAttributes {
                unit: unit.map(|unit| unit.name.clone()),
                min: min.is_finite().then_some(min),
                max: max.is_finite().then_some(max),
                nominal: variable.nominal,
                ..fmi::RealAttributes::default()
            };
            fmi::VariableKind::Real(fmi::RealVariable {
                attributes,
                start: (own.start.iter()).map(Value::as_number).collect(),
                ..fmi::RealVariable::default()
            })
        }
        ValueKind::Enumeration if is_enumeration(variable) => {
            let known = types.iter().find(|(_, items)| *items == variable.items);
            fmi::VariableKind::Enumeration {
                declared_type: known.map_or(String::new(), |(own, _)| own.name.clone()),
                attributes: fmi::IntegerAttributes::default(),
                start: whole,
            }
        }
        ValueKind::Integer | ValueKind::Enumeration => fmi::VariableKind::Integer {
            integer: match version {
                fmi::FmiVersion::V2 => fmi::IntegerType::Int32,
                fmi::FmiVersion::V3 => fmi::IntegerType::Int64,
            },
            declared_type: None,
            attributes: integer,
            start: whole,
        },
        ValueKind::Boolean => fmi::VariableKind::Boolean {
            declared_type: None,
            start: match own.start {
                Some(Value::Boolean(value)) => vec![value],
                _ => Vec::new(),
            },
        },
        ValueKind::String => fmi::VariableKind::String {
            declared_type: None,
            start: match &own.start {
                Some(Value::String(text)) => vec![text.clone()],
                _ => Vec::new(),
            },
        },
    }
}

/// Outputs. Between steps they have the values of the last communication point, whatever inputs are set; at the start they
/// may depend on everything.
fn structure(seen: &[Seen]) -> fmi::ModelStructure {
    let outputs: Vec<u32> = (seen.iter().zip(1..))
        .filter(|(own, _)| own.causality == fmi::Causality::Output)
        .map(|(_, index)| index)
        .collect();
    let unknown = |dependencies: Option<Vec<u32>>| {
        let made = outputs.iter().map(|&index| fmi::Unknown {
            index,
            dependencies: dependencies.clone(),
            dependencies_kind: None,
        });
        made.collect()
    };
    fmi::ModelStructure {
        outputs: unknown(Some(Vec::new())),
        initial_unknowns: unknown(None),
        ..fmi::ModelStructure::default()
    }
}

/// A GUID that links description, manifest and parts.
fn fingerprint(
    description: &fmi::ModelDescription,
    manifest: &Manifest,
    files: &BTreeMap<String, Vec<u8>>,
) -> String {
    let mut hash = Sha256::new();
    hash.update(description.to_xml());
    hash.update(text(manifest));
    for (name, bytes) in files {
        hash.update(name);
        hash.update(Sha256::digest(bytes));
    }
    let sum: String = (hash.finalize().iter())
        .map(|byte| format!("{byte:02x}"))
        .collect();
    guid::of(&sum)
}
