//! Checks of the shared library of each platform, without loading it.

use super::finding::NOT_USED;
use super::layout::{extension, identifiers};
use super::{Finding, Rule};
use object::{Architecture, BinaryFormat, Object, ObjectKind};
use pilotage_abi::{Part, fmi2, fmi3};
use pilotage_fmi::archive::Archive;
use pilotage_fmi::binary;
use pilotage_fmi::description::{FmiVersion, ModelDescription};
use pilotage_fmi::platform::{Platform, processor};
use std::collections::BTreeSet;

/// All findings about the libraries.
pub(super) fn check(archive: &mut Archive, description: &ModelDescription) -> Vec<Finding> {
    let files: Vec<String> = archive.files().map(str::to_owned).collect();
    let mut findings = Vec::new();
    for file in &files {
        let Some((folder, name)) = file
            .strip_prefix("binaries/")
            .and_then(|rest| rest.split_once('/'))
        else {
            continue;
        };
        let Some((stem, end)) = name.rsplit_once('.') else {
            continue;
        };
        if extension(folder) != Some(end) || !identifiers(description).contains(stem) {
            continue;
        }
        // Unreadable files are reported elsewhere.
        let Ok(bytes) = archive.read(file) else {
            continue;
        };
        let prefix = format!("binaries/{folder}/");
        let beside: BTreeSet<&str> = (files.iter())
            .filter_map(|f| f.strip_prefix(&prefix))
            .collect();
        let rules = library(&bytes, folder, stem, description, &beside);
        findings.extend(
            rules
                .into_iter()
                .map(|rule| Finding::file(Some(description.fmi_version), file, rule)),
        );
    }
    findings
}

fn library(
    bytes: &[u8],
    folder: &str,
    stem: &str,
    description: &ModelDescription,
    beside: &BTreeSet<&str>,
) -> Vec<Rule> {
    let fits_here = |architecture| fits(folder, BinaryFormat::MachO, architecture);
    let file = match binary::thin(bytes, fits_here).and_then(object::File::parse) {
        Ok(file) => file,
        Err(error) => {
            let why = format!("it is not a shared library: {error}");
            return vec![Rule::BadBinary { why }];
        }
    };
    if file.kind() != ObjectKind::Dynamic {
        let why = format!(
            "it is an object of kind {:?}, not a shared library",
            file.kind()
        );
        return vec![Rule::BadBinary { why }];
    }
    if !fits(folder, file.format(), file.architecture()) {
        return vec![Rule::WrongPlatform {
            found: format!("{:?}", file.format()),
            architecture: format!("{:?}", file.architecture()),
            folder: folder.to_owned(),
        }];
    }
    let mut rules = functions(&file, stem, description);
    rules.extend(needs(&file, beside));
    rules
}

/// Whether a library of that format and architecture belongs in a folder with that name.
fn fits(folder: &str, format: BinaryFormat, architecture: Architecture) -> bool {
    let expected_format = match extension(folder) {
        Some("dll") => format == BinaryFormat::Pe || format == BinaryFormat::Coff,
        Some("so") => format == BinaryFormat::Elf,
        Some("dylib") => format == BinaryFormat::MachO,
        _ => true,
    };
    let name = folder.split('-').next().unwrap_or_default();
    let mut known = Platform::of_folder(name)
        .map(|platform| platform.architecture)
        .chain(processor(name))
        .peekable();
    expected_format && (known.peek().is_none() || known.any(|own| own == architecture))
}

/// The functions that the standard requires and the library lacks.
fn functions(file: &object::File, stem: &str, description: &ModelDescription) -> Vec<Rule> {
    let found = binary::exported(file).unwrap_or_default();
    (wanted(stem, description).into_iter())
        .filter(|(function, _)| !found.contains(function.as_bytes()))
        .map(|(function, is_used)| Rule::NoFunction {
            function,
            why: if is_used { USED } else { NOT_USED },
        })
        .collect()
}

/// Why a missing function is an error.
const USED: &str = "which every importer calls, or a capability of this description offers";

/// The functions that a library with that name must have, and whether they are used.
fn wanted(stem: &str, description: &ModelDescription) -> Vec<(&'static str, bool)> {
    let is = |identifier: Option<&String>| identifier.is_some_and(|i| i == stem);
    let parts = [
        (
            Part::CoSimulation,
            is(description
                .co_simulation
                .as_ref()
                .map(|e| &e.model_identifier)),
        ),
        (
            Part::ModelExchange,
            is(description
                .model_exchange
                .as_ref()
                .map(|e| &e.model_identifier)),
        ),
        (
            Part::ScheduledExecution,
            is(description
                .scheduled_execution
                .as_ref()
                .map(|e| &e.model_identifier)),
        ),
        (Part::Common, true),
    ];
    let has = |part: Part| parts.contains(&(part, true));
    match description.fmi_version {
        FmiVersion::V2 => (fmi2::Function::ALL.iter())
            .filter(|f| has(f.part()))
            .map(|f| (f.name(), used_2(*f, description)))
            .collect(),
        FmiVersion::V3 => (fmi3::Function::ALL.iter())
            .filter(|f| has(f.part()))
            .map(|f| (f.name(), used_3(*f, description)))
            .collect(),
    }
}

/// Whether an FMU of FMI 2.0 cannot be used without a function.
fn used_2(function: fmi2::Function, description: &ModelDescription) -> bool {
    use fmi2::Function as F;
    let capability = |name: &str| has_flag(description, name);
    match function {
        F::GetFmuState | F::SetFmuState | F::FreeFmuState => capability("canGetAndSetFMUstate"),
        F::SerializedFmuStateSize | F::SerializeFmuState | F::DeSerializeFmuState => {
            capability("canSerializeFMUstate")
        }
        F::GetDirectionalDerivative => capability("providesDirectionalDerivative"),
        F::SetRealInputDerivatives => capability("canInterpolateInputs"),
        F::GetRealOutputDerivatives => (description.co_simulation.as_ref())
            .is_some_and(|cs| cs.max_output_derivative_order > 0),
        F::CancelStep | F::GetIntegerStatus | F::GetStringStatus => {
            capability("canRunAsynchronuously")
        }
        _ => true,
    }
}

/// As [`used_2`], for FMI 3.0.
fn used_3(function: fmi3::Function, description: &ModelDescription) -> bool {
    use fmi3::Function as F;
    let capability = |name: &str| has_flag(description, name);
    match function {
        F::GetFmuState | F::SetFmuState | F::FreeFmuState => capability("canGetAndSetFMUState"),
        F::SerializedFmuStateSize | F::SerializeFmuState | F::DeserializeFmuState => {
            capability("canSerializeFMUState")
        }
        F::GetDirectionalDerivative => capability("providesDirectionalDerivatives"),
        F::GetAdjointDerivative => capability("providesAdjointDerivatives"),
        F::GetNumberOfVariableDependencies | F::GetVariableDependencies => {
            capability("providesPerElementDependencies")
        }
        F::EvaluateDiscreteStates => capability("providesEvaluateDiscreteStates"),
        F::EnterEventMode | F::UpdateDiscreteStates => {
            description.model_exchange.is_some() || capability("hasEventMode")
        }
        F::EnterStepMode => capability("hasEventMode"),
        F::GetOutputDerivatives => (description.co_simulation.as_ref())
            .is_some_and(|cs| cs.max_output_derivative_order > 0),
        F::InstantiateModelExchange => description.model_exchange.is_some(),
        F::InstantiateCoSimulation => description.co_simulation.is_some(),
        F::InstantiateScheduledExecution => description.scheduled_execution.is_some(),
        F::GetVersion
        | F::FreeInstance
        | F::EnterInitializationMode
        | F::ExitInitializationMode
        | F::Terminate
        | F::Reset
        | F::GetFloat64
        | F::SetFloat64
        | F::DoStep => true,
        _ => function.part() == Part::ModelExchange,
    }
}

/// Whether any interface of the description has a capability.
fn has_flag(description: &ModelDescription, name: &str) -> bool {
    let version = description.fmi_version;
    let cs = description.co_simulation.as_ref().map(|e| e.flags(version));
    let me = description
        .model_exchange
        .as_ref()
        .map(|e| e.flags(version));
    let se = description
        .scheduled_execution
        .as_ref()
        .map(|e| e.flags(version));
    let mut flags = cs.into_iter().chain(me).chain(se).flatten();
    flags.any(|(flag, on)| on && flag == name)
}

/// Required libraries that are neither part of every system nor in the same folder (ELF).
fn needs(file: &object::File, beside: &BTreeSet<&str>) -> Vec<Rule> {
    const SYSTEM: [&str; 8] = [
        "libc.so",
        "libm.so",
        "libdl.so",
        "libpthread.so",
        "librt.so",
        "libgcc_s.so",
        "libstdc++.so",
        "ld-linux",
    ];
    let object::File::Elf64(elf) = file else {
        return Vec::new();
    };
    let imported = needed(elf);
    (imported.into_iter())
        .filter(|name| !SYSTEM.iter().any(|system| name.starts_with(system)))
        .filter(|name| !beside.contains(name.as_str()))
        .map(|library| Rule::Needs { library })
        .collect()
}

/// `DT_NEEDED` entries of an ELF file.
fn needed(elf: &object::read::elf::ElfFile64) -> Vec<String> {
    use object::read::elf::Dyn;
    let (endian, data) = (elf.endian(), elf.data());
    let table = elf.elf_section_table();
    let Ok(Some((entries, link))) = table.dynamic(endian, data) else {
        return Vec::new();
    };
    let Ok(strings) = table.strings(endian, data, link) else {
        return Vec::new();
    };
    (entries.iter())
        .filter(|e| e.tag(endian) == object::elf::DT_NEEDED)
        .filter_map(|e| e.string(endian, strings).ok())
        .map(|name| String::from_utf8_lossy(name).into_owned())
        .collect()
}
