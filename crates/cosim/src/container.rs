//! A system inside one FMU: what its resources say of it. The command writes it, the library inside the FMU reads it.
//!
//! ```text
//! resources/container.toml      this description
//! resources/parts/<folder>/     a part: an unpacked FMU, a model's own resources (model.toml), or table.csv
//! ```

use crate::algorithms::{Algorithm, Control, Coupling};
use crate::component::Conversion;
use crate::system::{System, SystemError, Transformation};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the description's file in `resources`.
pub const FILE: &str = "container.toml";

/// Name of a table's file in its part's folder.
pub const TABLE: &str = "table.csv";

/// Name of the variable with the time.
pub const TIME: &str = "time";

/// A system, its coupling and what the importer sees of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// GUID of the FMU.
    pub guid: String,
    /// Communication step between the parts \[s\].
    pub step: f64,
    /// Name of the [`Algorithm`].
    pub algorithm: String,
    /// Degree of extrapolation, if chosen.
    pub extrapolation: Option<usize>,
    /// Maximum error of a step, smallest and largest step \[s\], if steps are controlled.
    pub control: Option<[f64; 3]>,
    /// Tolerance for parts with error control; else the importer's.
    pub part_tolerance: Option<f64>,
    /// The variables `instance.variable` in the order of their value references, which begin at 1; the last is [`TIME`].
    pub variables: Vec<String>,
    /// Start values by variable, as text.
    pub set: BTreeMap<String, String>,
    /// The parts.
    pub parts: Vec<Part>,
    /// The wires, element by element.
    pub wires: Vec<Link>,
}

/// A part of the system.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Its name in the system.
    pub name: String,
    /// Its folder.
    pub folder: String,
    /// What it is.
    pub kind: Kind,
    /// Number of parts into which it divides each step.
    pub divides: u32,
    /// Whether its outputs follow its inputs at once.
    pub at_once: bool,
}

/// What a part is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// An FMU for co-simulation.
    CoSimulation,
    /// An FMU for model exchange, solved by the master.
    ModelExchange,
    /// A model of pilotage.
    Native,
    /// A table over time.
    Table,
}

/// A wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// The output.
    pub from: String,
    /// The input.
    pub to: String,
    /// `input = factor · output + offset`.
    pub factor: f64,
    /// See there.
    pub offset: f64,
    /// Values of the output with those for the input, where they are others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub map: Vec<(String, String)>,
}

impl Manifest {
    /// The coupling.
    ///
    /// # Errors
    /// If there is no algorithm of that name.
    pub fn coupling(&self) -> Result<Coupling, String> {
        let all = [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong];
        let algorithm = all
            .into_iter()
            .find(|own| own.to_string() == self.algorithm);
        let algorithm = algorithm.ok_or_else(|| format!("no algorithm `{}`", self.algorithm))?;
        Ok(Coupling {
            extrapolation: self.extrapolation,
            control: self.control.map(|[tolerance, min_step, max_step]| Control {
                tolerance,
                min_step,
                max_step,
            }),
            ..algorithm.into()
        })
    }

    /// Wires a system of the parts, and sets its start values.
    ///
    /// # Errors
    /// If it does not fit the parts.
    pub fn wire(&self, system: &mut System) -> Result<(), SystemError> {
        for link in &self.wires {
            let by = Transformation {
                linear: Conversion {
                    factor: link.factor,
                    offset: link.offset,
                },
                converts_units: false,
                map: link.map.clone(),
            };
            system.connect_by(&link.from, &link.to, by)?;
        }
        for part in &self.parts {
            system.set_parts(&part.name, part.divides)?;
            if part.at_once {
                system.set_at_once(&part.name);
            }
        }
        for (name, value) in &self.set {
            system.set(name, value)?;
        }
        for name in self.variables.iter().filter(|name| *name != TIME) {
            let port = system.resolve(name)?;
            if system.variable(port).role == crate::component::Role::Local {
                system.observe(port);
            }
        }
        Ok(())
    }
}
