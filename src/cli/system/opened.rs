//! A system that is opened once and simulated any number of times.

use super::flags::Wiring;
use super::{Built, full_name, only};
use crate::cli::Failure;
use crate::cli::overwrite::Overwrite;
use crate::cosim::description::Setting;
use crate::cosim::{Component, Components, System, SystemDescription};
use crate::series::Series;

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

/// What a run gives with components that an earlier run has used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Renewal {
    /// What it gives with those that are opened, once they are made new.
    Works,
    /// Something else; what it gives with those that are opened is the same each time.
    Forgets,
    /// Something else each time.
    Remembers,
}

impl Renewal {
    /// What to say if a run cannot be repeated.
    pub fn doubt(self, wiring: &Wiring) -> Option<String> {
        let hint = match wiring.isolates_all() {
            true => "",
            false => "; with --isolate all each run has a process of its own",
        };
        (self == Self::Remembers).then(|| {
            format!(
                "the same values give other numbers each time, although everything is loaded anew: runs cannot be repeated{hint}"
            )
        })
    }
}

/// Runs with the components of a place, which an earlier run has used and which were made new since, and with opened ones. Gives
/// what the latter said; the place is empty if it is not the same.
pub fn checked<P, T>(
    place: &mut Option<P>,
    mut run: impl FnMut(&mut Option<P>) -> T,
    is_same: impl Fn(&T, &T) -> bool,
) -> (T, Renewal) {
    let renewed = run(place);
    // Some FMUs can be opened but once.
    *place = None;
    let opened = run(place);
    if is_same(&renewed, &opened) {
        return (opened, Renewal::Works);
    }
    *place = None;
    let again = run(place);
    *place = None;
    let renewal = match is_same(&again, &opened) {
        true => Renewal::Forgets,
        false => Renewal::Remembers,
    };
    (opened, renewal)
}

/// Whether these have the same numbers, to the last bit.
pub fn same_bits<'a>(
    a: impl IntoIterator<Item = &'a Series>,
    b: impl IntoIterator<Item = &'a Series>,
) -> bool {
    let columns = |own: &'a Series| own.columns.iter().flat_map(|own| &own.values);
    let bits = |own: &'a Series| own.time.iter().chain(columns(own)).map(|x| x.to_bits());
    a.into_iter()
        .flat_map(bits)
        .eq(b.into_iter().flat_map(bits))
}

/// A system of these components, not yet wired.
fn joined(components: Vec<(String, Box<dyn Component>)>) -> Result<System, Failure> {
    let mut system = System::new();
    for (name, component) in components {
        system.add(name, component)?;
    }
    Ok(system)
}
