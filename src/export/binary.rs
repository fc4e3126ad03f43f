//! The shared libraries in FMUs of pilotage's own models.
//!
//! A command built from source embeds that of its own platform. `scripts/platforms.py` builds those of all, and what is built with
//! `PILOTAGE_FMU_PLATFORMS` embeds them (`build.rs`).

use super::{ExportError, Platform};
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// A library as it is embedded for one platform or more.
#[derive(Debug, Clone, Copy)]
pub struct Libraries {
    /// That for this crate's platform; empty where there is an archive.
    own: &'static [u8],
    /// Archive of those for all, each named as its platform in FMI 3.0; or empty.
    all: &'static [u8],
}

macro_rules! embedded {
    ($package:literal) => {
        Libraries {
            own: include_bytes!(concat!(env!("OUT_DIR"), "/", $package, ".library")),
            all: include_bytes!(concat!(env!("OUT_DIR"), "/", $package, ".zip")),
        }
    };
}

/// The library of models, built from `fmu/`.
pub const MODELS: Libraries = embedded!("pilotage-fmu");

/// The library of a system in one FMU, from `fmu/container/`.
pub const CONTAINER: Libraries = embedded!("pilotage-container");

impl Libraries {
    /// The platforms for which there is a library.
    ///
    /// # Errors
    /// If what is embedded is damaged.
    pub fn platforms(&self) -> Result<Vec<Platform>, ExportError> {
        if self.all.is_empty() {
            return Ok(Platform::host().into_iter().collect());
        }
        let archive = self.archive()?;
        let has = |platform: &Platform| archive.index_for_name(platform.tuple).is_some();
        Ok(Platform::ALL.into_iter().filter(has).collect())
    }

    /// The library for a platform, if there is one.
    ///
    /// # Errors
    /// If what is embedded is damaged.
    pub fn of(&self, platform: &Platform) -> Result<Option<Vec<u8>>, ExportError> {
        if self.all.is_empty() {
            return Ok((Platform::host() == Some(*platform)).then(|| self.own.to_vec()));
        }
        let mut archive = self.archive()?;
        let Some(at) = archive.index_for_name(platform.tuple) else {
            return Ok(None);
        };
        let mut bytes = Vec::new();
        let read = archive
            .by_index(at)
            .and_then(|mut file| Ok(file.read_to_end(&mut bytes)?));
        read.map_err(damaged)?;
        Ok(Some(bytes))
    }

    fn archive(&self) -> Result<ZipArchive<Cursor<&'static [u8]>>, ExportError> {
        ZipArchive::new(Cursor::new(self.all)).map_err(damaged)
    }
}

fn damaged(source: zip::result::ZipError) -> ExportError {
    ExportError::Archive {
        entry: "the libraries in this command".into(),
        source,
    }
}
