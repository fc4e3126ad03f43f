//! Models as FMUs: FMI 2.0 and FMI 3.0, each with co-simulation and model exchange, ready for any tool.
//!
//! For our own models no compiler is needed: one library serves them all and is part of this crate
//! ([`binary`]); what differs between FMUs is text. A user's model is a library of its own ([`pack`]).
//!
//! | module | what it makes |
//! | --- | --- |
//! | [`binary`], [`platform`] | the library of our models; the folders that libraries go into |
//! | [`description`](mod@description) | modelDescription.xml, from the table of variables |
//! | [`interface`] | what a library says of its model |
//! | [`pack`] | FMUs of a user's models |
//! | `sdk` | where those crates find the SDK |
//! | `old_glibc` | libraries that run on old Linux systems |
//! | `documentation` | documentation/index.html and the licences |
//! | `pictures`, `terminals` | model.png; what FMI 3.0 has for it |
//! | [`date`] | when an FMU is made |
//! | [`mod@package`] | the archive: the same input gives the same bytes |

pub mod binary;
pub mod date;
pub mod description;
mod documentation;
mod error;
pub mod interface;
mod old_glibc;
pub mod pack;
pub mod package;
pub mod platform;
mod sdk;
mod terminals;

pub use description::description;
pub use error::ExportError;
pub use package::Contents;
pub use platform::Platform;

use crate::atomic_file;
use crate::fmi::description::FmiVersion;
use crate::models::model::MODEL_FILE;
use crate::models::{Model, ModelKind, TextModel};
use pilotage_sdk::Interface;
use std::collections::BTreeMap;
use std::path::Path;

const PILOT: &str = include_str!("pilot.html");
const QUADCOPTER: &str = include_str!("quadcopter.html");

/// The folder of our own files in an FMU (FMI 2.0.5, section 2.3: reverse domain name).
pub const EXTRA: &str = "extra/org.pilotage";

/// Where a model comes from and what must be known about it. It goes into the description, the
/// documentation and [`EXTRA`].
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Provenance {
    /// One sentence about the source of the numbers.
    pub origin: String,
    /// What a user must know before trusting the model; shown wherever the model is described.
    pub caveat: Option<String>,
    /// The file that the numbers were read from: its name in the FMU and its text, kept as it was.
    pub source: Option<(&'static str, String)>,
    /// Licence of the model, in SPDX's words.
    pub license: Option<String>,
    /// Who made the model.
    pub author: Option<String>,
    /// When the FMU is made, `YYYY-MM-DDThh:mm:ssZ`; without it, the same model gives the same bytes at any
    /// time.
    pub date: Option<String>,
}

/// Licence of our own models.
const LICENSE: &str = "MIT OR Apache-2.0";

impl Provenance {
    /// A pilot identified from flights; `file` is the text of the result file, `stable_loop` whether
    /// the closed loop with the vehicle of the fit is stable, `caveat` what the file says of the fit.
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

    /// The published pilot, with what we measured about it (docs/method.md).
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

    /// A model file; `file` is its name, `source` what it says of where its equations come from.
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

    /// A vehicle; `file` is the text of the vehicle file, none for the default vehicle.
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

/// Which FMU to make of a model.
#[derive(Debug, Clone, Default)]
pub struct ExportOptions {
    /// The version of the standard.
    pub version: FmiVersion,
    /// Libraries that were built elsewhere, besides that for this platform.
    pub binaries: Vec<(Platform, Vec<u8>)>,
}

/// A model that becomes an FMU: of FMI 2.0 and for this platform, unless it is told otherwise.
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

/// What is exported.
#[derive(Debug, Clone, Copy)]
enum Subject<'a> {
    Model(&'a Model),
    Text(&'a TextModel),
}

impl<'a> Export<'a> {
    /// Of this model.
    pub fn new(model: &'a Model, provenance: &'a Provenance) -> Self {
        Self::of(Subject::Model(model), provenance)
    }

    /// Of the model of a model file.
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

    /// For this version of the standard.
    pub fn version(mut self, version: FmiVersion) -> Self {
        self.options.version = version;
        self
    }

    /// With a library that was built elsewhere.
    pub fn binary(mut self, platform: Platform, library: Vec<u8>) -> Self {
        self.options.binaries.push((platform, library));
        self
    }

    /// With all of these options.
    pub fn options(mut self, options: ExportOptions) -> Self {
        self.options = options;
        self
    }

    /// The FMU's bytes.
    ///
    /// # Errors
    /// When a start value is not finite or out of range, or a library is not for its platform.
    pub fn bytes(self) -> Result<Vec<u8>, ExportError> {
        let own = Platform::host().map(|platform| (platform, binary::LIBRARY.to_vec()));
        let binaries = self.options.binaries.into_iter().chain(own).collect();
        let (provenance, version) = (self.provenance, self.options.version);
        match self.subject {
            Subject::Model(model) => {
                model.check()?;
                package::archive(&Contents {
                    name: model.kind().name(),
                    interface: &Interface::of(model),
                    provenance,
                    version,
                    binaries,
                    about: match model.kind() {
                        ModelKind::Pilot(_) => PILOT,
                        ModelKind::Quadcopter => QUADCOPTER,
                    },
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
                    name: &file.name,
                    interface: &interface,
                    provenance,
                    version,
                    binaries,
                    about: &documentation::equations(file),
                    picture: package::BLOCK,
                    resources: resources(model),
                })
            }
        }
    }

    /// Writes the FMU, completely or not at all.
    ///
    /// # Errors
    /// As [`Self::bytes`], or when the file cannot be written; nothing stands at `path` then that did not stand
    /// there before.
    pub fn write(self, path: &Path) -> Result<(), ExportError> {
        write(path, &self.bytes()?)
    }
}

/// The model file and its tables.
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

fn write(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    atomic_file::write(path, bytes).map_err(|source| ExportError::Write {
        path: path.to_owned(),
        source,
    })
}
