//! A system that is opened once and simulated any number of times.

use super::flags::Wiring;
use super::{Built, full_name, only};
use crate::cli::Failure;
use crate::cli::overwrite::Overwrite;
use crate::cosim::description::Setting;
use crate::cosim::{Component, Components, System, SystemDescription};

/// Opened components, and the system that arguments describe.
pub struct Opened {
    /// The components; [wired](Self::wire) before each run.
    pub built: Built,
    /// The system.
    pub description: SystemDescription,
}

impl Opened {
    /// Opens everything.
    pub fn new(wiring: &Wiring) -> Result<Self, Failure> {
        let mut built = wiring.build(&Overwrite::default(), &[], &[])?;
        // That was a check of the wires; values may still be replaced.
        built.system = joined(built.system.components())?;
        let description = built.description.clone();
        Ok(Self { built, description })
    }

    /// Wires the components and sets the values of the description, but for those that are replaced: names and values.
    pub fn wire(&mut self, settings: &[(String, String)]) -> Result<(), Failure> {
        let system = &mut self.built.system;
        let setting = |(name, value): &(String, String)| Setting {
            name: full_name(system, name, only(system)).into(),
            value: value.clone(),
        };
        let settings = settings.iter().map(setting).collect();
        self.built.description = self.description.clone();
        self.built.description.override_wiring(Vec::new(), settings);
        for (from, to) in self.built.tables.iter().flat_map(|table| &table.wires) {
            system.connect(from, to)?;
        }
        Ok(self.built.description.wire(system)?)
    }

    /// What was built, for a run.
    pub fn take(&mut self) -> Built {
        std::mem::take(&mut self.built)
    }

    /// The same for another run, from what is left of one. None if its components cannot be made new.
    pub fn renewed(self, built: Built, components: Components) -> Result<Option<Self>, Failure> {
        let Some(components) = components.renewed() else {
            return Ok(None);
        };
        let system = joined(components)?;
        let description = self.description;
        Ok(Some(Self {
            built: Built { system, ..built },
            description,
        }))
    }
}

/// A system of these components, not yet wired.
fn joined(components: Vec<(String, Box<dyn Component>)>) -> Result<System, Failure> {
    let mut system = System::new();
    for (name, component) in components {
        system.add(name, component)?;
    }
    Ok(system)
}
