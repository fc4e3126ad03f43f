//! Checks of the files of an FMU (FMI 2.0, section 2.3; FMI 3.0, section 2.5).

use super::{Finding, Rule};
use pilotage_fmi::archive::Archive;
use pilotage_fmi::description::{self, FmiVersion, ModelDescription, is_within_limits};
use pilotage_fmi::platform::{self, Platform, processor};
use std::collections::BTreeSet;

/// Second part of a platform tuple (FMI 3.0, section 2.5.1.1).
const SYSTEMS: [&str; 3] = ["darwin", "linux", "windows"];

/// All findings about the files other than the description.
pub(super) fn check(archive: &mut Archive, description: &ModelDescription) -> Vec<Finding> {
    let version = Some(description.fmi_version);
    let files: Vec<String> = archive.files().map(str::to_owned).collect();
    let mut findings = tops(&files, description.fmi_version);
    findings.extend(platforms(&files, description.fmi_version));
    findings.extend(libraries(&files, description));
    findings.extend(sources(&files, description));
    findings.extend(extras(&files, version));
    let has = |name: &str| files.iter().any(|file| file == name);
    let has_documentation = files.iter().any(|file| file.starts_with("documentation/"));
    if has_documentation && !has("documentation/index.html") {
        findings.push(Finding::file(version, "documentation/", Rule::NoIndex));
    }
    for picture in ["model.png", "terminalsAndIcons/icon.png"] {
        let is_png = |bytes: Vec<u8>| bytes.starts_with(b"\x89PNG\r\n\x1a\n");
        if has(picture) && !archive.read(picture).is_ok_and(is_png) {
            findings.push(Finding::file(version, picture, Rule::NotPng));
        }
    }
    for (file, judge) in XML_FILES {
        if has(file) {
            findings.extend(xml(archive, description, file, judge));
        }
    }
    findings
}

/// Checks an additional XML file.
type Judge =
    fn(&str, &roxmltree::Document, &ModelDescription) -> Vec<pilotage_fmi::description::Finding>;

/// Additional XML files defined by FMI 3.0 and adopted by FMI 2.0.4.
const XML_FILES: [(&str, Judge); 2] = [
    (
        "terminalsAndIcons/terminalsAndIcons.xml",
        description::terminals,
    ),
    ("sources/buildDescription.xml", description::build),
];

fn xml(
    archive: &mut Archive,
    description: &ModelDescription,
    file: &str,
    judge: Judge,
) -> Vec<Finding> {
    let version = description.fmi_version;
    // Entries that cannot be unpacked are reported by the caller.
    let Ok(bytes) = archive.read(file) else {
        return Vec::new();
    };
    let why = match std::str::from_utf8(&bytes) {
        Err(error) => error.to_string(),
        Ok(text) if !is_within_limits(text) => {
            "it is nested too deeply, or has too many attributes".to_owned()
        }
        Ok(text) => match roxmltree::Document::parse(text) {
            Err(error) => error.to_string(),
            Ok(document) => {
                let found = judge(text, &document, description);
                let finding = |f| Finding {
                    file: file.to_owned(),
                    ..Finding::description(version, f)
                };
                return found.iter().map(finding).collect();
            }
        },
    };
    vec![Finding::file(Some(version), file, Rule::NotXml { why })]
}

/// Checks the top level of the archive.
fn tops(files: &[String], version: FmiVersion) -> Vec<Finding> {
    let mut known = vec![
        "modelDescription.xml",
        "documentation",
        "sources",
        "binaries",
        "resources",
        "extra",
    ];
    match version {
        // Release 2.0.4 adopts terminalsAndIcons.
        FmiVersion::V2 => known.extend(["model.png", "licenses", "terminalsAndIcons"]),
        FmiVersion::V3 => known.push("terminalsAndIcons"),
    }
    let top = |file: &String| file.split('/').next().unwrap_or_default().to_owned();
    let found: BTreeSet<String> = files.iter().map(top).collect();
    (found.into_iter())
        .filter(|name| !known.contains(&name.as_str()))
        .map(|name| Finding::archive(Some(version), Rule::UnknownTop { name }))
        .collect()
}

/// The names of the folders under `binaries/`.
fn folders(files: &[String]) -> BTreeSet<&str> {
    platform::present(files.iter().map(String::as_str))
}

fn platforms(files: &[String], version: FmiVersion) -> Vec<Finding> {
    // Release 2.0.4 allows the tuples of FMI 3.0 too.
    let is_of_2 =
        |name: &str| version == FmiVersion::V2 && Platform::of_folder(name).next().is_some();
    let is_known = |name: &str| is_of_2(name) || is_tuple(name);
    let (number, expected) = match version {
        FmiVersion::V2 => (
            "2.0",
            "win64, linux64, darwin64 or a tuple as aarch64-linux",
        ),
        FmiVersion::V3 => ("3.0", "a tuple as x86_64-linux or aarch64-darwin"),
    };
    (folders(files).into_iter())
        .filter(|name| !is_known(name))
        .map(|name| {
            let rule = Rule::UnknownPlatform {
                name: name.to_owned(),
                version: number,
                expected,
            };
            Finding::file(Some(version), &format!("binaries/{name}/"), rule)
        })
        .collect()
}

/// Whether a name is `<architecture>-<system>` with an optional `-<abi>`.
fn is_tuple(name: &str) -> bool {
    let mut parts = name.split('-');
    parts.next().is_some_and(|a| processor(a).is_some())
        && parts.next().is_some_and(|s| SYSTEMS.contains(&s))
        && parts.next().is_none_or(|abi| !abi.is_empty())
        && parts.next().is_none()
}

/// File extension of a shared library in a folder of that name; `None` for an unknown system.
pub(super) fn extension(folder: &str) -> Option<&'static str> {
    if folder.starts_with("win") || folder.contains("-windows") {
        Some("dll")
    } else if folder.starts_with("linux") || folder.contains("-linux") {
        Some("so")
    } else if folder.starts_with("darwin") || folder.contains("-darwin") {
        Some("dylib")
    } else {
        None
    }
}

/// The names of the libraries according to the description, without duplicates.
pub(super) fn identifiers(description: &ModelDescription) -> BTreeSet<&str> {
    let cs = description.co_simulation.as_ref();
    let me = description.model_exchange.as_ref();
    let se = description.scheduled_execution.as_ref();
    cs.map(|e| e.model_identifier.as_str())
        .into_iter()
        .chain(me.map(|e| e.model_identifier.as_str()))
        .chain(se.map(|e| e.model_identifier.as_str()))
        .collect()
}

fn libraries(files: &[String], description: &ModelDescription) -> Vec<Finding> {
    let version = Some(description.fmi_version);
    let mut findings = Vec::new();
    for folder in folders(files) {
        let Some(extension) = extension(folder) else {
            continue;
        };
        let prefix = format!("binaries/{folder}/");
        let beside: Vec<&str> = (files.iter())
            .filter_map(|file| file.strip_prefix(&prefix))
            .collect();
        for identifier in identifiers(description) {
            let expected = format!("{identifier}.{extension}");
            if !beside.contains(&expected.as_str()) {
                let rule = Rule::NoLibrary {
                    identifier: identifier.to_owned(),
                    expected,
                    found: beside.join(", "),
                };
                findings.push(Finding::file(version, &prefix, rule));
            }
        }
    }
    let has_source = files.iter().any(|file| file.starts_with("sources/"));
    if folders(files).is_empty() && !has_source {
        findings.push(Finding::archive(version, Rule::NothingToRun));
    }
    findings
}

fn sources(files: &[String], description: &ModelDescription) -> Vec<Finding> {
    let version = Some(description.fmi_version);
    let has = |name: &str| files.iter().any(|file| file == name);
    let cs = description
        .co_simulation
        .iter()
        .flat_map(|e| &e.source_files);
    let me = description
        .model_exchange
        .iter()
        .flat_map(|e| &e.source_files);
    let named: BTreeSet<&String> = cs.chain(me).collect();
    let mut findings: Vec<Finding> = (named.into_iter())
        .filter(|name| !has(&format!("sources/{}", name.trim_start_matches("./"))))
        .map(|name| Finding::file(version, "sources/", Rule::NoSource { name: name.clone() }))
        .collect();
    let has_source = files.iter().any(|file| file.starts_with("sources/"));
    let build = "sources/buildDescription.xml";
    if description.fmi_version == FmiVersion::V3 && has_source && !has(build) {
        findings.push(Finding::file(version, "sources/", Rule::NoBuildDescription));
    }
    findings
}

fn extras(files: &[String], version: Option<FmiVersion>) -> Vec<Finding> {
    let name = |file: &String| Some(file.strip_prefix("extra/")?.split('/').next()?.to_owned());
    let names: BTreeSet<String> = files.iter().filter_map(name).collect();
    (names.into_iter())
        .filter(|name| !name.contains('.'))
        .map(|name| Finding::file(version, "extra/", Rule::ExtraName { name }))
        .collect()
}
