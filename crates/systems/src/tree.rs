//! A system as its files say it (section 5).

use crate::error::At;
use pilotage_cosim::description::{Experiment, Interface, Transformation};
use pilotage_fmi::description::ModelDescription;
use pilotage_units::Unit;
use std::path::PathBuf;
use std::sync::Arc;

/// An `.ssd`.
pub(crate) struct Root {
    /// That of the system.
    pub(crate) at: At,
    pub(crate) system: System,
    pub(crate) experiment: Experiment,
}

/// A system: the root, or one in another.
pub(crate) struct System {
    pub(crate) name: String,
    pub(crate) connectors: Vec<Connector>,
    pub(crate) elements: Vec<Element>,
    pub(crate) connections: Vec<Connection>,
    pub(crate) dictionaries: Vec<Dictionary>,
    /// In the order of application: later ones take precedence.
    pub(crate) parameters: Vec<Entry>,
}

/// What a system contains.
pub(crate) enum Element {
    Component(Component),
    System(System),
    Reference(Reference),
}

/// An FMU.
pub(crate) struct Component {
    pub(crate) at: At,
    pub(crate) name: String,
    pub(crate) file: PathBuf,
    pub(crate) fmu: Arc<ModelDescription>,
    pub(crate) interface: Option<Interface>,
    pub(crate) connectors: Vec<Connector>,
    pub(crate) parameters: Vec<Entry>,
}

/// A place through which a system sees a signal dictionary.
pub(crate) struct Reference {
    pub(crate) at: At,
    pub(crate) name: String,
    pub(crate) dictionary: String,
    pub(crate) connectors: Vec<Connector>,
}

/// Signals by name, with their units.
pub(crate) struct Dictionary {
    pub(crate) name: String,
    pub(crate) entries: Vec<(String, Option<Unit>)>,
}

/// Which way a connector goes, seen from outside its element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flow {
    In,
    Out,
    /// What the other end leaves.
    Any,
}

impl Flow {
    /// The flow as seen from inside the element.
    pub(crate) fn inside(self) -> Self {
        match self {
            Self::In => Self::Out,
            Self::Out => Self::In,
            Self::Any => Self::Any,
        }
    }
}

/// A connector of a component, a system or a reference.
pub(crate) struct Connector {
    pub(crate) at: At,
    pub(crate) name: String,
    pub(crate) flow: Flow,
    pub(crate) unit: Option<Unit>,
}

/// One end of a connection: element (this system if none) and connector, with the indices of an array's element.
pub(crate) struct End {
    pub(crate) element: Option<String>,
    pub(crate) connector: String,
    pub(crate) index: String,
}

/// A connection; data may flow either way.
pub(crate) struct Connection {
    pub(crate) at: At,
    pub(crate) ends: [End; 2],
    pub(crate) step: Transformation,
}

/// A value for a name, after prefix and mapping.
#[derive(Clone)]
pub(crate) struct Entry {
    pub(crate) at: At,
    pub(crate) name: String,
    /// One, or those of an array row by row.
    pub(crate) values: Vec<String>,
    pub(crate) unit: Option<Unit>,
    pub(crate) step: Transformation,
}
