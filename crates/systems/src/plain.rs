//! Systems without nesting: instances, wires of values as they are, start values. Those of OSP and of maestro.

use crate::package::unescaped;
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::{
    InstanceDescription, InstanceSource, Setting, Spanned, Transformation, Wire,
};
use pilotage_fmi::Fmu;
use pilotage_fmi::description::{Causality, ModelDescription};
use pilotage_text::document::Place;
use pilotage_text::error_chain::error_chain;
use pilotage_text::printable::excerpt;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A description that is being made.
#[derive(Default)]
pub(crate) struct Plain {
    pub(crate) description: SystemDescription,
    fmus: HashMap<PathBuf, Arc<ModelDescription>>,
}

impl Plain {
    /// The description of an FMU, read once; `name` is that of the file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn fmu(&mut self, file: &Path, name: &str) -> Result<Arc<ModelDescription>, String> {
        if let Some(known) = self.fmus.get(file) {
            return Ok(known.clone());
        }
        if !file.exists() {
            return Err(format!("there is no file `{}`", excerpt(name)));
        }
        let fmu = Fmu::open(file).map_err(|error| error_chain(&error))?;
        let description = fmu.description().clone();
        self.fmus.insert(file.to_owned(), description.clone());
        Ok(description)
    }

    pub(crate) fn instance(
        &mut self,
        name: &str,
        file: PathBuf,
        place: Option<Place>,
        at_once: bool,
    ) {
        self.description.instances.push(InstanceDescription {
            name: name.to_owned(),
            source: Spanned {
                value: InstanceSource::Model(file),
                place,
            },
            order: None,
            interface: None,
            at_once,
        });
    }

    /// A wire between two variables; these masters give values on as they are, without conversion of units.
    pub(crate) fn wire(&mut self, from: String, to: String, place: Option<Place>) {
        let end = |value| Spanned {
            value,
            place: place.clone(),
        };
        self.description.connections.push(Wire {
            from: end(from),
            to: end(to),
            transformation: Transformation {
                converts_units: false,
                ..Transformation::default()
            },
        });
    }

    pub(crate) fn set(&mut self, name: String, value: String, place: Option<Place>) {
        self.description.settings.push(Setting {
            name: Spanned { value: name, place },
            value,
        });
    }
}

/// Whether a variable of an FMU gives values.
///
/// # Errors
/// If there is none of that name.
pub(crate) fn gives(fmu: &ModelDescription, instance: &str, name: &str) -> Result<bool, String> {
    match fmu.variables.iter().find(|own| own.name == name) {
        Some(own) => Ok(!matches!(
            own.causality,
            Causality::Input | Causality::Parameter | Causality::StructuralParameter
        )),
        None => {
            let known = fmu.variables.iter().map(|own| own.name.as_str());
            let hint = did_you_mean(suggestion(name, known));
            let (instance, name) = (excerpt(instance), excerpt(name));
            Err(format!(
                "the FMU of `{instance}` has no variable `{name}`{hint}"
            ))
        }
    }
}

/// The file that a URI or a path names, from a folder.
///
/// # Errors
/// If it is no file's.
pub(crate) fn file_from(folder: &Path, uri: &str) -> Result<PathBuf, String> {
    let path = match uri.split_once(":/") {
        None if uri.starts_with("file:") => unescaped(uri.trim_start_matches("file:")),
        Some(("file", path)) => unescaped(&format!("/{}", path.trim_start_matches('/'))),
        Some((scheme, _)) if scheme.len() > 1 => {
            let scheme = excerpt(scheme);
            return Err(format!(
                "`{scheme}:` names no file; name the FMU itself, and run it apart with --isolate"
            ));
        }
        _ => unescaped(uri),
    };
    let path = path.ok_or_else(|| format!("`{}` has a % that escapes no byte", excerpt(uri)))?;
    Ok(folder.join(path.replace('\\', "/")))
}
