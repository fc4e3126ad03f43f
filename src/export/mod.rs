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
//! | `kit` | where those crates find the kit |
//! | `old_glibc` | libraries that run on old Linux systems |
//! | `documentation` | documentation/index.html and the licences |
//! | `picture`, `terminals` | model.png; what FMI 3.0 has for it |
//! | [`date`] | when an FMU is made |
//! | [`mod@package`] | the archive: the same input gives the same bytes |

pub mod binary;
pub mod date;
pub mod description;
mod documentation;
mod error;
pub mod interface;
mod kit;
mod old_glibc;
pub mod pack;
pub mod package;
mod picture;
pub mod platform;
mod terminals;

pub use description::description;
pub use error::ExportError;
pub use package::Contents;
pub use platform::Platform;

use crate::fmi::description::FmiVersion;
use crate::models::model::MODEL_FILE;
use crate::models::pilot::PAPER_THETA;
use crate::models::{Kind, Model, Quadcopter};
use crate::output;
use pilotage_kit::Interface;
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

/// Writes the FMU of a pilot with that θ (twice as many entries as its order).
///
/// # Errors
/// When a value is not finite or out of range, or the file cannot be written; nothing stands at `path`
/// then that did not stand there before.
///
/// # Panics
/// When θ is not the parameters of a pilot: see [`Model::pilot`].
pub fn export_pilot(
    theta: &[f64],
    stick_limit: f64,
    provenance: &Provenance,
    path: &Path,
) -> Result<(), ExportError> {
    export(&Model::pilot(theta, stick_limit), provenance, path)
}

/// Writes the FMU of the published pilot, with its caveat.
///
/// # Errors
/// When the file cannot be written.
pub fn export_paper_pilot(path: &Path) -> Result<(), ExportError> {
    export_pilot(&PAPER_THETA, 1.0, &Provenance::paper(), path)
}

/// Writes the FMU of a quadcopter.
///
/// # Errors
/// When a coefficient is out of range, or the file cannot be written.
pub fn export_quadcopter(
    vehicle: &Quadcopter,
    provenance: &Provenance,
    path: &Path,
) -> Result<(), ExportError> {
    export(&Model::quadcopter(vehicle), provenance, path)
}

/// Which FMU to make of a model.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The version of the standard.
    pub version: FmiVersion,
    /// Libraries that were built elsewhere, besides that for this platform.
    pub binaries: Vec<(Platform, Vec<u8>)>,
}

/// Writes the FMU of a model (FMI 2.0), completely or not at all.
///
/// # Errors
/// When a start value is not finite or out of range, or the file cannot be written.
pub fn export(model: &Model, provenance: &Provenance, path: &Path) -> Result<(), ExportError> {
    export_as(model, provenance, &Options::default(), path)
}

/// As [`export()`], with options.
///
/// # Errors
/// When a start value is not finite or out of range, a library is not for its platform, or the file
/// cannot be written.
pub fn export_as(
    model: &Model,
    provenance: &Provenance,
    options: &Options,
    path: &Path,
) -> Result<(), ExportError> {
    let bytes = package_as(model, provenance, options)?;
    write(path, &bytes)
}

/// The bytes of a model's FMU (FMI 2.0).
///
/// # Errors
/// When a start value is not finite or out of range.
pub fn package(model: &Model, provenance: &Provenance) -> Result<Vec<u8>, ExportError> {
    package_as(model, provenance, &Options::default())
}

/// As [`package()`], with options.
///
/// # Errors
/// When a start value is not finite or out of range, or a library is not for its platform.
pub fn package_as(
    model: &Model,
    provenance: &Provenance,
    options: &Options,
) -> Result<Vec<u8>, ExportError> {
    model.check()?;
    let own = Platform::host().map(|platform| (platform, binary::LIBRARY.to_vec()));
    let given = options.binaries.iter().cloned();
    package::archive(&Contents {
        name: model.kind().name(),
        interface: &Interface::of(model),
        provenance,
        version: options.version,
        binaries: given.chain(own).collect(),
        about: match model.kind() {
            Kind::Pilot(_) => PILOT,
            Kind::Quadcopter => QUADCOPTER,
        },
        picture: picture::png(model),
        resources: BTreeMap::from([(MODEL_FILE.to_owned(), model.to_file().into_bytes())]),
    })
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    output::write(path, bytes).map_err(|source| ExportError::Write {
        path: path.to_owned(),
        source,
    })
}
