//! A finding about any part of an FMU.

use pilotage_fmi::InterfaceType;
use pilotage_fmi::archive::DESCRIPTION;
use pilotage_fmi::description::{self, FmiVersion, ModelDescription, Place, Severity};
use std::fmt;

/// A finding about an FMU.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// Name of the file in the archive; empty for the archive itself and for the behaviour of the binary.
    pub file: String,
    /// Place in the file.
    pub place: Option<Place>,
    /// Name of the variable concerned.
    pub variable: Option<String>,
    /// What is wrong, and what is expected.
    pub message: String,
    /// The standard and its section, such as `FMI 2.0, section 2.3`.
    pub section: String,
}

impl Finding {
    /// A finding about the archive of an FMU of that version, if known.
    pub(super) fn archive(version: Option<FmiVersion>, rule: Rule) -> Self {
        Self::file(version, "", rule)
    }

    /// A finding about a file in the archive.
    pub(super) fn file(version: Option<FmiVersion>, name: &str, rule: Rule) -> Self {
        Self {
            severity: rule.severity(),
            file: name.to_owned(),
            place: None,
            variable: None,
            section: rule.section(version).to_owned(),
            message: rule.to_string(),
        }
    }

    /// A finding about the behaviour of the binary as that kind.
    pub fn behaviour(
        description: &ModelDescription,
        kind: InterfaceType,
        severity: Severity,
        what: String,
    ) -> Self {
        let section = match (description.fmi_version, kind) {
            (FmiVersion::V2, InterfaceType::ModelExchange) => "FMI 2.0, sections 2.1 and 3.2",
            (FmiVersion::V2, _) => "FMI 2.0, sections 2.1 and 4.2",
            (FmiVersion::V3, InterfaceType::ModelExchange) => "FMI 3.0, sections 2.2 and 3.2",
            (FmiVersion::V3, _) => "FMI 3.0, sections 2.2 and 4.2",
        };
        Self {
            severity,
            file: String::new(),
            place: None,
            variable: None,
            message: format!("{kind}: {what}"),
            section: section.to_owned(),
        }
    }

    /// A finding about the description of an FMU of that version.
    pub(super) fn description(version: FmiVersion, finding: &description::Finding) -> Self {
        Self {
            severity: finding.severity(),
            file: DESCRIPTION.to_owned(),
            place: Some(finding.place),
            variable: finding.variable.clone(),
            message: finding.rule.to_string(),
            section: format!("FMI {version}, section {}", finding.section()),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.severity)?;
        if !self.file.is_empty() {
            write!(f, "{}", self.file)?;
            if let Some(place) = self.place {
                write!(f, ", {place}")?;
            }
            write!(f, ": ")?;
        }
        write!(f, "{} ({})", self.message, self.section)?;
        match &self.variable {
            Some(name) => write!(f, " (variable `{name}`)"),
            None => Ok(()),
        }
    }
}

/// Rules for an archive and the files in it, except the description.
#[allow(missing_docs)] // The message of each variant is its documentation, the fields are in it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Rule {
    #[error("{why}")]
    Refused { why: String },
    #[error("entry `{entry}` leaves the archive's folder by `..`")]
    Traversal { entry: String },
    #[error("entry `{entry}` has an absolute path")]
    Absolute { entry: String },
    #[error("entry `{entry}` has a backslash in its path; the standard wants `/`")]
    Backslash { entry: String },
    #[error("entry `{}` is not a file name", entry.escape_debug())]
    BadName { entry: String },
    #[error("entry `{entry}` has a `.` in its path, which some tools refuse")]
    Dot { entry: String },
    #[error("entry `{entry}` is there twice")]
    Duplicate { entry: String },
    #[error(
        "entries `{first}` and `{second}` differ by case alone: on Windows and macOS they are one"
    )]
    CaseDuplicate { first: String, second: String },
    #[error("entry `{entry}` is a link")]
    Link { entry: String },
    #[error("entry `{entry}` is encrypted")]
    Encrypted { entry: String },
    #[error(
        "entry `{entry}` uses compression method {method}; only 0 (store) and 8 (deflate) are allowed"
    )]
    Method { entry: String, method: u16 },
    #[error("entry `{entry}` needs version {}.{} of zip, more than {}.{}", needed / 10, needed % 10, allowed / 10, allowed % 10)]
    Version {
        entry: String,
        needed: u16,
        allowed: u16,
    },
    #[error("the archive is split over several files")]
    Split,
    #[error("entry `{entry}` has another name in its local header: `{local}`")]
    LocalName { entry: String, local: String },
    #[error("entry `{entry}` has a name that is neither ASCII nor marked as UTF-8")]
    NotUtf8 { entry: String },
    #[error(
        "modelDescription.xml is in the folder `{folder}`; it must be at the top: zip the folder's content, not the folder"
    )]
    Nested { folder: String },
    #[error("it is named `{found}`, expected `modelDescription.xml`")]
    DescriptionCase { found: String },
    #[error("it has no modelDescription.xml")]
    NoDescription,

    #[error(
        "the standard knows no `{name}` at the top of an archive; put it under extra/ or resources/"
    )]
    UnknownTop { name: String },
    #[error("`{name}` is no platform of FMI {version}; expected {expected}")]
    UnknownPlatform {
        name: String,
        version: &'static str,
        expected: &'static str,
    },
    #[error(
        "modelIdentifier=\"{identifier}\" names `{expected}`, which is not there; beside it are {found}"
    )]
    NoLibrary {
        identifier: String,
        expected: String,
        found: String,
    },
    #[error("there is neither a binary nor source code: the FMU cannot be run")]
    NothingToRun,
    #[error("<SourceFiles> names `{name}`, which is not under sources/")]
    NoSource { name: String },
    #[error("there are sources/ but no buildDescription.xml, so that they cannot be compiled")]
    NoBuildDescription,
    #[error("it is no PNG image")]
    NotPng,
    #[error("documentation/ has no index.html, the page that tools open")]
    NoIndex,
    #[error("`extra/{name}` is not named by a reverse domain, such as extra/com.example")]
    ExtraName { name: String },
    #[error("it is not well-formed XML: {why}")]
    NotXml { why: String },

    #[error("{why}")]
    BadBinary { why: String },
    #[error(
        "it is a library in {found} format for {architecture}, which is not what the folder `{folder}` is for"
    )]
    WrongPlatform {
        found: String,
        architecture: String,
        folder: String,
    },
    #[error("it has no function `{function}`, {why}")]
    NoFunction {
        function: &'static str,
        why: &'static str,
    },
    #[error(
        "it needs `{library}`, which is not a part of every system and does not lie beside it; say so in documentation/externalDependencies.txt"
    )]
    Needs { library: String },
}

impl Rule {
    fn severity(&self) -> Severity {
        use Rule::*;
        match self {
            CaseDuplicate { .. }
            | Dot { .. }
            | NotUtf8 { .. }
            | UnknownTop { .. }
            | UnknownPlatform { .. }
            | NotPng
            | NoBuildDescription
            | NoIndex
            | ExtraName { .. }
            | Needs { .. } => Severity::Warning,
            NoFunction { why, .. } if *why == NOT_USED => Severity::Warning,
            _ => Severity::Error,
        }
    }

    fn section(&self, version: Option<FmiVersion>) -> &'static str {
        match (version, matches!(self, Self::NoFunction { .. })) {
            (Some(FmiVersion::V2), true) => "FMI 2.0, section 2.1",
            (Some(FmiVersion::V3), true) => "FMI 3.0, section 2.2",
            (Some(FmiVersion::V2), false) => "FMI 2.0, section 2.3",
            (Some(FmiVersion::V3), false) => "FMI 3.0, section 2.5",
            (None, _) => "FMI 2.0, section 2.3; FMI 3.0, section 2.5",
        }
    }
}

/// Why a missing function is only a warning: no declared capability requires it.
pub(super) const NOT_USED: &str =
    "which the standard wants in every binary, though this description does not offer its use";
