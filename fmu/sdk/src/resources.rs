//! Finds files of the FMU's folder `resources` from the resource location.

use std::path::{Path, PathBuf};

/// Why a file of the resources cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ResourceError {
    /// No folder has the file.
    #[error(
        "{file} was not found{}; the resource location is {location}. Pass that of the folder \
         \"resources\" of the unzipped FMU, such as file:///tmp/fmu/resources (FMI 2.0) or \
         /tmp/fmu/resources/ (FMI 3.0)",
        places(tried)
    )]
    NotFound {
        /// Name of the file.
        file: String,
        /// Location passed.
        location: String,
        /// Folders searched.
        tried: Vec<PathBuf>,
    },
    /// The file cannot be read.
    #[error("{} cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
}

/// Why a model cannot be loaded.
pub type LoadError = Box<dyn std::error::Error + Send + Sync>;

fn places(paths: &[PathBuf]) -> String {
    paths
        .iter()
        .map(|p| format!(" in {}", p.display()))
        .collect::<Vec<_>>()
        .join(" or")
}

/// Path and text of a file of the resources. It is searched at the resource location (a URI or a path), then in the FMU
/// that contains this library (`binaries/<platform>/x.so`, `resources`).
///
/// # Errors
/// When there is no such file, or it cannot be read.
pub fn read(location: Option<&str>, file: &str) -> Result<(PathBuf, String), ResourceError> {
    let folders: Vec<_> = location
        .and_then(path_of_uri)
        .into_iter()
        .chain(own_resources())
        .collect();
    let path = folders
        .iter()
        .map(|folder| folder.join(file))
        .find(|path| path.is_file())
        .ok_or_else(|| ResourceError::NotFound {
            file: file.to_owned(),
            location: location.unwrap_or("NULL").to_owned(),
            tried: folders,
        })?;
    let text = std::fs::read_to_string(&path).map_err(|source| ResourceError::Unreadable {
        file: path.clone(),
        source,
    })?;
    Ok((path, text))
}

/// The path of a `file` URI (RFC 8089): `file:///a`, `file:/a`, `file://localhost/a`, `file:///C:/a`;
/// and, leniently, of a bare path. `None` for other schemes and hosts.
fn path_of_uri(uri: &str) -> Option<PathBuf> {
    let is_file = uri
        .get(..5)
        .is_some_and(|s| s.eq_ignore_ascii_case("file:"));
    if !is_file {
        return (!uri.is_empty() && !uri.contains("://")).then(|| PathBuf::from(uri));
    }
    let rest = &uri[5..];
    let path = match rest.strip_prefix("//") {
        None => rest,
        Some(rest) => {
            let (host, path) = rest.split_at(rest.find('/')?);
            (host.is_empty() || host.eq_ignore_ascii_case("localhost")).then_some(path)?
        }
    };
    let decoded = percent_decoded(path);
    // Where drives exist, `/C:/x` is a path on a drive, not in a folder named `C:`.
    let drive = cfg!(windows) && decoded.get(2) == Some(&b':');
    path_of_bytes(&decoded[usize::from(drive)..])
}

/// Replaces `%41` by `A`; a `%` without two digits stays.
fn percent_decoded(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).and_then(|b| char::from(*b).to_digit(16));
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                i += 1;
            }
        }
    }
    decoded
}

#[cfg(unix)]
fn path_of_bytes(bytes: &[u8]) -> Option<PathBuf> {
    use std::os::unix::ffi::OsStrExt;
    Some(Path::new(std::ffi::OsStr::from_bytes(bytes)).to_owned())
}

#[cfg(not(unix))]
fn path_of_bytes(bytes: &[u8]) -> Option<PathBuf> {
    std::str::from_utf8(bytes).ok().map(PathBuf::from)
}

/// `resources` of the FMU that contains this library.
#[cfg(unix)]
fn own_resources() -> Option<PathBuf> {
    use std::ffi::CStr;
    use std::os::unix::ffi::OsStrExt;
    let mut info = std::mem::MaybeUninit::<libc::Dl_info>::zeroed();
    // SAFETY: the address is one of this library's functions, and `info` is writable.
    let found = unsafe { libc::dladdr(own_resources as *const libc::c_void, info.as_mut_ptr()) };
    // SAFETY: all fields of the struct are pointers, for which zero is a valid value.
    let info = unsafe { info.assume_init() };
    if found == 0 || info.dli_fname.is_null() {
        return None;
    }
    // SAFETY: the name is a C string that lives as long as the library is loaded.
    let name = unsafe { CStr::from_ptr(info.dli_fname) };
    let library = Path::new(std::ffi::OsStr::from_bytes(name.to_bytes()));
    Some(library.ancestors().nth(3)?.join("resources"))
}

#[cfg(not(unix))]
fn own_resources() -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_of_all_kinds() {
        let path = |uri| path_of_uri(uri).map(|p| p.display().to_string());
        let expected = Some("/tmp/a b/resources".to_owned());
        assert_eq!(path("file:///tmp/a%20b/resources"), expected);
        assert_eq!(path("file:/tmp/a%20b/resources"), expected);
        assert_eq!(path("file://localhost/tmp/a%20b/resources"), expected);
        assert_eq!(path("FILE:///tmp/a b/resources"), expected);
        assert_eq!(path("/tmp/a b/resources"), expected);
        assert_eq!(path("file:///tmp/100%/%4"), Some("/tmp/100%/%4".into()));
        let drive = if cfg!(windows) { "C:/x" } else { "/C:/x" };
        assert_eq!(path("file:///C:/x"), Some(drive.into()));
        for uri in ["", "file://", "file://server/share", "https://localhost/x"] {
            assert_eq!(path(uri), None, "{uri}");
        }
    }

    /// FMI rule 19: every spelling of the location.
    #[test]
    fn files_are_read_with_and_without_a_slash_at_the_end() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("model.toml"), "text").expect("written");
        for slash in ["", "/"] {
            let uri = format!("file://{}{slash}", folder.path().display());
            let (_, text) = read(Some(&uri), "model.toml").expect("it is there");
            assert_eq!(text, "text");
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let message = |location| {
            let error = read(location, "model.toml").expect_err("nothing is there");
            error.to_string()
        };
        assert!(message(Some("file:///nowhere")).contains("/nowhere"));
        assert!(message(None).contains("location is NULL"));
    }
}
