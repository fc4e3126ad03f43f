//! Opens the parts of a container and wires them.

use crate::inbox::Inbox;
use crate::unit::Container;
use pilotage_cosim::container::{FILE, Kind, Manifest, Part, TABLE};
use pilotage_cosim::{Component, Session, Source, System, fmu_component, native_component};
use pilotage_fmi::InterfaceType as Interface;
use pilotage_models::AnyModel;
use pilotage_sdk::instance::InterfaceType;
use pilotage_sdk::resources::{self, LoadError};
use pilotage_series::Series;
use pilotage_text::error_chain::error_chain;
use std::path::{Path, PathBuf};

/// Makes an instance of the container whose resources lie at the location.
pub fn load(kind: InterfaceType, location: Option<&str>) -> Result<Container, LoadError> {
    if kind != InterfaceType::CoSimulation {
        return Err("this FMU is for co-simulation alone".into());
    }
    let (file, text) = resources::read(location, FILE)?;
    let manifest = toml::from_str(&text).map_err(|why| format!("{}: {why}", file.display()))?;
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    Container::new(Opener { manifest, folder }, Inbox::new())
}

/// What opens the parts, once or again.
pub struct Opener {
    pub manifest: Manifest,
    /// The folder `resources`.
    folder: PathBuf,
}

impl Opener {
    /// A session of newly opened parts.
    pub fn open(&self) -> Result<Session, LoadError> {
        let system = self.system()?;
        let coupling = self.manifest.coupling()?;
        Session::new(system, coupling).map_err(|why| error_chain(&why).into())
    }

    /// The wired system.
    pub fn system(&self) -> Result<System, LoadError> {
        let mut system = System::new();
        let (tables, models): (Vec<&Part>, Vec<&Part>) =
            (self.manifest.parts.iter()).partition(|part| part.kind == Kind::Table);
        let failed = |part: &Part, why: LoadError| -> LoadError {
            format!("`{}`: {}", part.name, error_chain(why.as_ref())).into()
        };
        for part in models {
            let component = self.model(part).map_err(|why| failed(part, why))?;
            system.add(&part.name, component)?;
        }
        for part in tables {
            let component = self.table(part, &system).map_err(|why| failed(part, why))?;
            system.add(&part.name, component)?;
        }
        self.manifest.wire(&mut system)?;
        Ok(system)
    }

    fn folder_of(&self, part: &Part) -> PathBuf {
        self.folder.join("parts").join(&part.folder)
    }

    fn model(&self, part: &Part) -> Result<Box<dyn Component>, LoadError> {
        let folder = self.folder_of(part);
        let kind = match part.kind {
            Kind::ModelExchange => Interface::ModelExchange,
            Kind::CoSimulation => Interface::CoSimulation,
            Kind::Native | Kind::Table => {
                let location = folder.to_string_lossy();
                let model = AnyModel::from_resources(Some(&location))?;
                return Ok(native_component::of_model(model));
            }
        };
        Ok(fmu_component::open_in_folder(
            &folder,
            &part.name,
            Some(kind),
        )?)
    }

    /// A table whose columns are held between samples as the inputs ask for that they feed.
    fn table(&self, part: &Part, system: &System) -> Result<Box<dyn Component>, LoadError> {
        let mut series = Series::read_table(&self.folder_of(part).join(TABLE))?;
        let is_wired = |name: &str| {
            let from = format!("{}.{name}", part.name);
            self.manifest.wires.iter().any(|link| link.from == from)
        };
        // A column that feeds nothing may have no values.
        series.columns.retain(|own| is_wired(&own.name));
        let names: Vec<String> = series.columns.iter().map(|own| own.name.clone()).collect();
        let mut source = Source::new(series)?;
        for (column, name) in names.iter().enumerate() {
            let from = format!("{}.{name}", part.name);
            for link in self.manifest.wires.iter().filter(|link| link.from == from) {
                let input = system.find(&link.to)?;
                if input.is_discrete {
                    source.hold_as(column, input.kind)?;
                }
            }
        }
        Ok(Box::new(source))
    }
}
