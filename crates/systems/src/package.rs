//! Archives and folders (section 3): variants, and files by their URI.

use crate::error::SspError;
use crate::xml::{Xml, text_of};
use pilotage_cosim::description::Kept;
use pilotage_fmi::archive::{Archive, ArchiveError, Limits};
use pilotage_text::file;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The file of the default variant.
const DEFAULT: &str = "SystemStructure.ssd";

fn has_extension(path: &Path, wanted: &str) -> bool {
    let extension = path.extension();
    extension.is_some_and(|own| own.eq_ignore_ascii_case(wanted))
}

/// Whether a path is a system of SSP, by its name or by what it contains.
pub fn is_ssp(path: &Path) -> bool {
    if path.is_dir() {
        return path.join(DEFAULT).is_file();
    }
    if has_extension(path, "ssp") || has_extension(path, "ssd") {
        return path.is_file();
    }
    let archive = || zip::ZipArchive::new(file::regular(path).ok()?).ok();
    has_extension(path, "zip")
        && archive().is_some_and(|archive| archive.index_for_name(DEFAULT).is_some())
}

/// A folder with the files of a system.
#[derive(Debug, Clone)]
pub(crate) struct Package {
    folder: PathBuf,
    /// The folder, as messages name it: the archive, where it was unpacked.
    shown: PathBuf,
}

impl Package {
    /// The folder of a file, and the file in it.
    pub(crate) fn beside(path: &Path) -> (Self, String) {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let shown = folder.clone();
        let name = path.file_name().unwrap_or_default();
        (Self { folder, shown }, name.to_string_lossy().into_owned())
    }

    /// Opens an archive, a folder or an `.ssd`; gives the file of the variant in it, and what is to be kept as long as files
    /// are read.
    pub(crate) fn open(
        path: &Path,
        variant: Option<&str>,
    ) -> Result<(Self, String, Kept), SspError> {
        let mut kept = Kept::default();
        if !path.is_dir() && has_extension(path, "ssd") {
            let (package, file) = Self::beside(path);
            return Ok((package, file, kept));
        }
        let folder = match path.is_dir() {
            true => path.to_owned(),
            false => {
                let unpacked = Archive::of_any(path, Limits::default())?.unpack()?;
                let folder = unpacked.path().to_owned();
                kept.push(unpacked);
                folder
            }
        };
        let shown = path.to_owned();
        let package = Self { folder, shown };
        let file = package.variant(variant)?;
        Ok((package, file, kept))
    }

    /// The file of a variant.
    fn variant(&self, name: Option<&str>) -> Result<String, SspError> {
        let Some(name) = name else {
            return match self.folder.join(DEFAULT).is_file() {
                true => Ok(DEFAULT.to_owned()),
                false => Err(SspError::Archive(ArchiveError::Missing {
                    path: self.shown.clone(),
                    entry: DEFAULT.to_owned(),
                })),
            };
        };
        let known = self.variants()?;
        let is_meant = |(file, own): &&(String, String)| {
            own == name || file == name || file.strip_suffix(".ssd") == Some(name)
        };
        match known.iter().find(is_meant) {
            Some((file, _)) => Ok(file.clone()),
            None => Err(SspError::NoVariant {
                file: self.shown.display().to_string(),
                name: name.to_owned(),
                known: known
                    .into_iter()
                    .map(|(_, own)| format!("`{own}`"))
                    .collect(),
            }),
        }
    }

    /// Files and names of the variants: all `.ssd` at the root (section 3).
    fn variants(&self) -> Result<Vec<(String, String)>, SspError> {
        let entries = fs::read_dir(&self.folder).map_err(|source| self.unread("", source))?;
        let names = entries.flatten().map(|entry| entry.file_name());
        let names = names.filter(|name| has_extension(Path::new(name), "ssd"));
        let mut files: Vec<String> = names.filter_map(|name| name.into_string().ok()).collect();
        files.sort();
        let named = files
            .into_iter()
            .map(|file| (file.clone(), self.name_of(&file)));
        Ok(named.collect())
    }

    /// The attribute `name` of an `.ssd`, or the file's name where there is none: only the variant that is meant must be
    /// right.
    fn name_of(&self, file: &str) -> String {
        let read = || {
            let (text, shown) = self.text(file).ok()?;
            let xml = Xml::parse(&text, &shown).ok()?;
            let root = xml.root("SystemStructureDescription").ok()?;
            root.attribute("name").map(str::to_owned)
        };
        read().unwrap_or_else(|| file.to_owned())
    }

    /// The name of a file in messages.
    pub(crate) fn shown(&self, file: &str) -> String {
        self.shown.join(file).display().to_string()
    }

    fn unread(&self, file: &str, source: io::Error) -> SspError {
        let file = self.shown(file);
        SspError::Read { file, source }
    }

    /// The text of a file, and its name in messages.
    pub(crate) fn text(&self, file: &str) -> Result<(String, String), SspError> {
        let mut bytes = Vec::new();
        let limit = Limits::default().read;
        file::regular(&self.path(file))
            .and_then(|file| file.take(limit).read_to_end(&mut bytes))
            .map_err(|source| self.unread(file, source))?;
        let shown = self.shown(file);
        Ok((text_of(&bytes, &shown)?, shown))
    }

    /// The path of a file.
    pub(crate) fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    /// The package of an archive or folder in this one, or of an `.ssd` in it: package, file, what is to be kept.
    pub(crate) fn inner(
        &self,
        file: &str,
        variant: Option<&str>,
    ) -> Result<(Self, String, Kept), SspError> {
        let (mut package, name, kept) = Self::open(&self.path(file), variant)?;
        package.shown = match has_extension(Path::new(file), "ssd") {
            true => self
                .shown
                .join(Path::new(file).parent().unwrap_or(Path::new(""))),
            false => self.shown.join(file),
        };
        Ok((package, name, kept))
    }
}

/// Names of the variants of an archive or folder; none of an `.ssd`.
///
/// # Errors
/// If it cannot be read.
pub fn variants(path: &Path) -> Result<Vec<String>, SspError> {
    if has_extension(path, "ssd") && !path.is_dir() {
        return Ok(Vec::new());
    }
    let (package, _, kept) = Package::open(path, None)?;
    let known = package.variants()?;
    drop(kept);
    Ok(known.into_iter().map(|(_, name)| name).collect())
}

/// The file that a relative URI names (RFC 3986), and its fragment. It never leaves the folder (section 5.4 asks for
/// nothing else).
pub(crate) fn file_of(uri: &str) -> Result<(String, Option<&str>), String> {
    let (path, fragment) = match uri.split_once('#') {
        Some((path, fragment)) => (path, Some(fragment)),
        None => (uri, None),
    };
    let path = path.replace('\\', "/");
    let begin = path.split('/').next().unwrap_or_default();
    if path.starts_with('/') || begin.contains(':') {
        return Err(format!(
            "`{uri}` is outside; files are named from the folder of the .ssd"
        ));
    }
    let path = unescaped(&path).ok_or_else(|| format!("`{uri}` has a % that escapes no byte"))?;
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                if parts.pop().is_none() {
                    return Err(format!("`{uri}` leaves the folder of the .ssd by `..`"));
                }
            }
            part if part.contains(['\\', '\0']) => {
                return Err(format!("`{uri}` names no file"));
            }
            part => parts.push(part),
        }
    }
    Ok((parts.join("/"), fragment))
}

/// Text with `%20` and the like decoded.
pub(crate) fn unescaped(text: &str) -> Option<String> {
    let mut parts = text.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        let code = part.get(..2)?;
        bytes.push(u8::from_str_radix(code, 16).ok()?);
        bytes.extend(&part.as_bytes()[2..]);
    }
    String::from_utf8(bytes).ok()
}

/// A path as a URI.
pub(crate) fn uri_of(path: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/+,=()".contains(&byte);
    let one = |byte: u8| match is_plain(byte) {
        true => char::from(byte).to_string(),
        false => format!("%{byte:02X}"),
    };
    path.bytes().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_stay_in_the_folder() {
        let file = |uri| file_of(uri).map(|(file, _)| file);
        for (uri, expected) in [
            ("resources/a.fmu", "resources/a.fmu"),
            ("./resources//a%20b.fmu", "resources/a b.fmu"),
            ("a\\b.fmu", "a/b.fmu"),
            ("a/../b.fmu", "b.fmu"),
            ("", ""),
        ] {
            assert_eq!(file(uri).as_deref(), Ok(expected), "{uri}");
        }
        for uri in [
            "../a",
            "a/../../b",
            "/etc/passwd",
            "file:///a",
            "http://a/b",
            "C:/a",
            "a%2",
            "a%zz",
            "%2e%2e/a",
            "a%00",
            "a%5cb",
            "%ff",
        ] {
            assert!(file(uri).is_err(), "{uri}");
        }
        assert_eq!(file_of("a.ssp#B.ssd"), Ok(("a.ssp".into(), Some("B.ssd"))));
        assert_eq!(
            file_of(&uri_of("größe 1%.fmu")),
            Ok(("größe 1%.fmu".into(), None))
        );
    }
}
