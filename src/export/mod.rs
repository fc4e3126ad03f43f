//! Exports models as FMUs: FMI 2.0 and FMI 3.0, each with co-simulation and model exchange.
//!
//! Built-in models and model files need no compiler: they share one library, which is embedded in this crate
//! ([`binary`]); their FMUs differ only in text files. A user's model in Rust has its own library ([`pack`]).
//!
//! | module | contents |
//! | --- | --- |
//! | [`binary`], [`platform`] | the libraries of built-in models; the folders of libraries |
//! | [`compile`](mod@compile) | compiles the sources of an FMU |
//! | [`description`](mod@description) | modelDescription.xml, from the table of variables |
//! | [`interface`] | reads the interface of a model from its library |
//! | [`pack`] | FMUs of user-written models |
//! | [`source`] | models as C99 |
//! | `sdk` | path of the SDK for those crates |
//! | `old_glibc` | libraries that run on old Linux systems |
//! | `documentation` | documentation/index.html and the licences |
//! | `pictures`, `terminals` | model.png; icon and terminals of FMI 3.0 |
//! | [`container`] | a system in one FMU |
//! | [`mod@package`] | the archive: the same input gives the same bytes |

pub mod binary;
pub mod compile;
pub mod container;
pub mod description;
mod documentation;
mod error;
pub mod interface;
mod old_glibc;
pub mod pack;
pub mod package;
pub mod platform;
mod sdk;
pub mod source;
mod terminals;

pub use description::description;
pub use error::ExportError;
pub use package::Contents;
pub use platform::Platform;

use crate::atomic_file;
use crate::fmi::description::FmiVersion;
use crate::models::expressions::AllExpressions;
use crate::models::model::MODEL_FILE;
use crate::models::{AnyModel, Model, ModelKind, TextModel};
use pilotage_sdk::{Equations, Interface};
use std::collections::BTreeMap;
use std::path::Path;

const PILOT: &str = include_str!("pilot.html");
const QUADCOPTER: &str = include_str!("quadcopter.html");

/// Folder of pilotage's own files in an FMU (FMI 2.0.5, section 2.3: reverse domain name).
pub const EXTRA: &str = "extra/org.pilotage";

/// Origin and caveats of a model. They are written to the description, the documentation and [`EXTRA`].
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Provenance {
    /// One sentence about the source of the numbers.
    pub origin: String,
    /// What a user must know before relying on the model; shown wherever the model is described.
    pub caveat: Option<String>,
    /// The source file of the numbers: its name in the FMU, and its unchanged text.
    pub source: Option<(&'static str, String)>,
    /// Licence of the model as an SPDX expression.
    pub license: Option<String>,
    /// Author of the model.
    pub author: Option<String>,
    /// Date of generation, `YYYY-MM-DDThh:mm:ssZ`; without it, the same model always gives the same bytes.
    pub date: Option<String>,
}

/// Licence of pilotage's own models.
const LICENSE: &str = "MIT OR Apache-2.0";

impl Provenance {
    /// A pilot identified from flights; `file` is the text of the result file, `stable_loop` whether the closed loop
    /// with the vehicle of the fit is stable, `caveat` the caveat of the result file.
    pub fn fit(file: String, stable_loop: Option<bool>, caveat: Option<String>) -> Self {
        let closed_loop = match stable_loop {
            Some(true) => " The closed loop with the vehicle of the fit is stable.",
            Some(false) => " The closed loop with the vehicle of the fit is UNSTABLE.",
            None => "",
        };
        let origin = "θ was identified from recorded flights; the result file is in extra/.";
        Self {
            origin: format!("{origin}{closed_loop}"),
            caveat,
            source: Some(("pilot.toml", file)),
            license: Some(LICENSE.into()),
            ..Self::default()
        }
    }

    /// The published pilot, with our findings about it (docs/method.md).
    pub fn paper() -> Self {
        Self {
            origin: "θ as printed by Bonner & Kirchner, Human as an Actuator Dynamic Model \
                     Identification, IEEE Aerospace Conference 2026, with four decimals."
                .into(),
            caveat: Some(
                "From rest on an ideal attitude loop the printed digits go to about 5 m for a 10 m \
                 target and have a slowly growing mode (about +0.03 1/s); they do not reproduce \
                 the paper's figure."
                    .into(),
            ),
            license: Some(LICENSE.into()),
            ..Self::default()
        }
    }

    /// A model file; `file` is its name, `source` its statement about the origin of its equations.
    pub fn model_file(file: &str, source: &str) -> Self {
        let origin = format!("The model file {file}, which stands in resources/{MODEL_FILE}.");
        Self {
            origin: match source {
                "" => origin,
                source => format!("{origin} Its source: {source}."),
            },
            ..Self::default()
        }
    }

    /// A vehicle; `file` is the text of the vehicle file, `None` for the default vehicle.
    pub fn vehicle(file: Option<String>) -> Self {
        let origin = match file {
            Some(_) => "Coefficients of a vehicle file, kept in extra/.",
            None => {
                "The default vehicle of pilotage, of its own making: the paper does not publish its \
                 coefficients."
            }
        };
        Self {
            origin: origin.into(),
            source: file.map(|text| ("vehicle.toml", text)),
            license: Some(LICENSE.into()),
            ..Self::default()
        }
    }
}

/// Options of the FMU.
#[derive(Debug, Clone, Default)]
pub struct ExportOptions {
    /// Version of the standard.
    pub version: FmiVersion,
    /// Libraries built elsewhere, in addition to those that are embedded.
    pub binaries: Vec<(Platform, Vec<u8>)>,
    /// Platforms whose embedded libraries are taken; by default all.
    pub platforms: Option<Vec<Platform>>,
    /// Whether the FMU also has its model as C99 sources.
    pub has_sources: bool,
}

impl ExportOptions {
    /// A library for each platform, of those that are embedded.
    fn libraries(
        self,
        embedded: binary::Libraries,
    ) -> Result<Vec<(Platform, Vec<u8>)>, ExportError> {
        let mut libraries = self.binaries;
        let has = embedded.platforms()?;
        for platform in self.platforms.as_ref().unwrap_or(&has) {
            // One that was built elsewhere is taken instead, but nobody means to replace that for this machine.
            let is_given = libraries.iter().any(|(own, _)| own == platform);
            if is_given && Platform::host() != Some(*platform) {
                continue;
            }
            let library = embedded.of(platform)?;
            libraries.push((
                *platform,
                library.ok_or_else(|| ExportError::NotEmbedded {
                    platform: platform.tuple,
                    known: platform::names(&has),
                })?,
            ));
        }
        Ok(libraries)
    }
}

/// Builder of an FMU; by default for FMI 2.0 and all platforms that this program has a library for.
///
/// ```no_run
/// use pilotage::export::{Export, Provenance};
/// use pilotage::models::{Model, Quadcopter};
///
/// let vehicle = Model::quadcopter(&Quadcopter::default());
/// Export::new(&vehicle, &Provenance::vehicle(None)).write("quadcopter.fmu".as_ref())?;
/// # Ok::<(), pilotage::export::ExportError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Export<'a> {
    subject: Subject<'a>,
    provenance: &'a Provenance,
    options: ExportOptions,
}

/// The exported model.
#[derive(Debug, Clone, Copy)]
enum Subject<'a> {
    Model(&'a Model),
    Text(&'a TextModel),
}

impl<'a> Export<'a> {
    /// Exports a built-in model.
    pub fn new(model: &'a Model, provenance: &'a Provenance) -> Self {
        Self::of(Subject::Model(model), provenance)
    }

    /// Exports the model of a model file.
    pub fn text(model: &'a TextModel, provenance: &'a Provenance) -> Self {
        Self::of(Subject::Text(model), provenance)
    }

    fn of(subject: Subject<'a>, provenance: &'a Provenance) -> Self {
        Self {
            subject,
            provenance,
            options: ExportOptions::default(),
        }
    }

    /// Sets the version of the standard.
    pub fn version(mut self, version: FmiVersion) -> Self {
        self.options.version = version;
        self
    }

    /// Adds a library built elsewhere.
    pub fn binary(mut self, platform: Platform, library: Vec<u8>) -> Self {
        self.options.binaries.push((platform, library));
        self
    }

    /// Adds the model as C99 sources.
    pub fn sources(mut self) -> Self {
        self.options.has_sources = true;
        self
    }

    /// Sets all options.
    pub fn options(mut self, options: ExportOptions) -> Self {
        self.options = options;
        self
    }

    /// The content of the FMU.
    ///
    /// # Errors
    /// If a start value is not finite or out of range, or a library does not fit its platform.
    pub fn bytes(self) -> Result<Vec<u8>, ExportError> {
        let (provenance, version) = (self.provenance, self.options.version);
        let has_sources = self.options.has_sources;
        let binaries = self.options.libraries(binary::MODELS)?;
        match self.subject {
            Subject::Model(model) => {
                model.check()?;
                let interface = Interface::of(model);
                package::archive(&Contents {
                    sources: match has_sources {
                        true => sources_of_model(model, &interface, version)?,
                        false => BTreeMap::new(),
                    },
                    name: model.kind().name(),
                    interface: &interface,
                    provenance,
                    version,
                    binaries,
                    about: documentation::written(match model.kind() {
                        ModelKind::Pilot(_) => PILOT,
                        ModelKind::Quadcopter => QUADCOPTER,
                    }),
                    picture: match model.kind() {
                        ModelKind::Pilot(_) => include_bytes!("pictures/pilot.png"),
                        ModelKind::Quadcopter => include_bytes!("pictures/quadcopter.png"),
                    },
                    resources: BTreeMap::from([(
                        MODEL_FILE.to_owned(),
                        model.to_file().into_bytes(),
                    )]),
                })
            }
            Subject::Text(model) => {
                model.variables().check()?;
                let (interface, file) = (Interface::of(model), &model.compiled().file);
                package::archive(&Contents {
                    sources: match has_sources {
                        true => sources_of_text(model, &interface, version)?,
                        false => BTreeMap::new(),
                    },
                    name: &file.name,
                    interface: &interface,
                    provenance,
                    version,
                    binaries,
                    about: documentation::equations(file),
                    picture: package::BLOCK,
                    resources: resources(model),
                })
            }
        }
    }

    /// Writes the FMU, completely or not at all.
    ///
    /// # Errors
    /// See [`Self::bytes`]; or if the file cannot be written, in which case the previous file at `path` is kept.
    pub fn write(self, path: &Path) -> Result<(), ExportError> {
        write(path, &self.bytes()?)
    }
}

/// The files from which the library of FMUs reads a model.
///
/// # Errors
/// If a start value is not finite or out of range.
pub fn resources_of(model: &AnyModel) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    match model {
        AnyModel::Text(model) => {
            model.variables().check()?;
            Ok(resources(model))
        }
        AnyModel::BuiltIn(model) => {
            model.check()?;
            let file = model.to_file().into_bytes();
            Ok(BTreeMap::from([(MODEL_FILE.to_owned(), file)]))
        }
    }
}

/// The sources of a built-in model.
fn sources_of_model(
    model: &Model,
    interface: &Interface,
    version: FmiVersion,
) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    let equations = AllExpressions::of_model(model).map_err(|error| ExportError::NoSource {
        model: interface.name.clone(),
        reason: error.to_string(),
    })?;
    let subject = source::Subject {
        table: model.variable_table(),
        interface,
        equations: &equations,
        is_linear: model.is_linear(),
        is_text: false,
    };
    source::files(&subject, version)
}

/// The sources of a model file.
fn sources_of_text(
    model: &TextModel,
    interface: &Interface,
    version: FmiVersion,
) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    let subject = source::Subject {
        table: model.variables(),
        interface,
        equations: &AllExpressions::of_text(model),
        is_linear: model.is_linear(),
        is_text: true,
    };
    source::files(&subject, version)
}

/// The files in `resources`: the model file and its tables.
fn resources(model: &TextModel) -> BTreeMap<String, Vec<u8>> {
    let compiled = model.compiled();
    let tables = compiled.tables.iter();
    let tables = tables.map(|(name, table)| (name.clone(), table.text.clone().into_bytes()));
    let own = (
        MODEL_FILE.to_owned(),
        compiled.file.text.clone().into_bytes(),
    );
    tables.chain([own]).collect()
}

/// Writes an FMU, completely or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    atomic_file::write(path, bytes).map_err(|source| ExportError::Write {
        path: path.to_owned(),
        source,
    })
}
