//! Results and errors of reading a modelDescription.xml.

use super::{Finding, ModelDescription, Place};
use thiserror::Error;

/// Why a modelDescription.xml cannot be read.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReadError {
    /// The file is too large for a description.
    #[error("modelDescription.xml has {bytes} bytes, more than the limit of {limit}")]
    TooLarge {
        /// Size of the file \[bytes\].
        bytes: usize,
        /// Maximum size \[bytes\].
        limit: usize,
    },
    /// The file is not UTF-8, although it declares UTF-8 or no encoding.
    #[error(
        "modelDescription.xml, line {line}: byte 0x{byte:02x} is not UTF-8; save the file as UTF-8"
    )]
    NotUtf8 {
        /// Line of the first invalid byte.
        line: u32,
        /// The byte.
        byte: u8,
    },
    /// It starts with a UTF-16 byte order mark, but is not UTF-16.
    #[error("modelDescription.xml has a UTF-16 byte order mark but is not UTF-16")]
    NotUtf16,
    /// Unsupported encoding.
    #[error(
        "modelDescription.xml is encoded in {encoding}; UTF-8, UTF-16 and ISO-8859-1 can be read"
    )]
    UnknownEncoding {
        /// The declared encoding.
        encoding: String,
    },
    /// The elements are nested too deeply.
    #[error("modelDescription.xml, line {line}: elements are nested deeper than {limit} levels")]
    TooDeep {
        /// Line of the first element that is too deep.
        line: u32,
        /// Maximum depth.
        limit: usize,
    },
    /// An element has too many attributes.
    #[error("modelDescription.xml, line {line}: an element has more than {limit} attributes")]
    TooManyAttributes {
        /// Its line.
        line: u32,
        /// Maximum number of attributes.
        limit: usize,
    },
    /// Too many namespaces are declared around an element.
    #[error(
        "modelDescription.xml, line {line}: more than {limit} namespaces are declared around an element"
    )]
    TooManyNamespaces {
        /// Line of the element.
        line: u32,
        /// Maximum number of namespaces.
        limit: usize,
    },
    /// Not well-formed XML.
    #[error("modelDescription.xml is not well-formed XML")]
    Malformed(#[from] roxmltree::Error),
    /// The root element is wrong.
    #[error(
        "modelDescription.xml, {place}: the root element is <{found}>, expected <fmiModelDescription>"
    )]
    WrongRoot {
        /// Its place.
        place: Place,
        /// Its name.
        found: String,
    },
    /// FMI 1.0, which is not supported.
    #[error("FMI 1.0 is not supported: export the model as FMI 2.0 or FMI 3.0")]
    Fmi1,
    /// Unsupported version of FMI.
    #[error("this is an FMU of FMI {found}; FMI 2.0 and FMI 3.0 can be used")]
    WrongVersion {
        /// The version as written.
        found: String,
    },
    /// A required value is missing or cannot be parsed.
    #[error("modelDescription.xml, {}: {}", .0.place, .0.rule)]
    Unusable(Box<Finding>),
}

/// The result of reading: values, their places, and findings.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The values; a default in place of an invalid one.
    pub description: ModelDescription,
    /// Places of the elements.
    pub places: Places,
    /// Violations of the schema. Further rules are checked by `pilotage_fmi_check::validate`.
    pub findings: Vec<Finding>,
}

/// Places of the elements; the lists are parallel to those of the description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Places {
    /// Root element.
    pub root: Place,
    /// `<ModelExchange>`, else the root.
    pub model_exchange: Place,
    /// `<CoSimulation>`, else the root.
    pub co_simulation: Place,
    /// `<ScheduledExecution>`, else the root.
    pub scheduled_execution: Place,
    /// `<DefaultExperiment>`, else the root.
    pub default_experiment: Place,
    /// `<ModelStructure>`, else the root.
    pub structure: Place,
    /// Each `<Unit>`.
    pub units: Vec<Place>,
    /// Each `<SimpleType>` or other type definition.
    pub types: Vec<Place>,
    /// Each log `<Category>`.
    pub log_categories: Vec<Place>,
    /// Each variable.
    pub variables: Vec<Place>,
    /// Each output in `<ModelStructure>`.
    pub outputs: Vec<Place>,
    /// Each state derivative in `<ModelStructure>`.
    pub derivatives: Vec<Place>,
    /// Each clocked state in `<ModelStructure>`.
    pub clocked_states: Vec<Place>,
    /// Each initial unknown in `<ModelStructure>`.
    pub initial_unknowns: Vec<Place>,
    /// Each event indicator in `<ModelStructure>`.
    pub event_indicators: Vec<Place>,
}

impl Places {
    pub(super) fn new(root: Place) -> Self {
        Self {
            root,
            model_exchange: root,
            co_simulation: root,
            scheduled_execution: root,
            default_experiment: root,
            structure: root,
            units: Vec::new(),
            types: Vec::new(),
            log_categories: Vec::new(),
            variables: Vec::new(),
            outputs: Vec::new(),
            derivatives: Vec::new(),
            clocked_states: Vec::new(),
            initial_unknowns: Vec::new(),
            event_indicators: Vec::new(),
        }
    }
}

impl Reading {
    /// The description, if every value could be parsed.
    ///
    /// # Errors
    /// The first value that is missing or cannot be parsed. Violations of the schema that leave no doubt about the
    /// values (an unknown attribute, a wrong order of elements) are accepted.
    pub fn into_usable(self) -> Result<ModelDescription, ReadError> {
        let blocking = |finding: &Finding| finding.rule.leaves_value_unknown();
        match self.findings.into_iter().find(blocking) {
            Some(finding) => Err(ReadError::Unusable(Box::new(finding))),
            None => Ok(self.description),
        }
    }
}
