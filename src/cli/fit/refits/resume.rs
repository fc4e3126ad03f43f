//! The file of a bootstrap: a line for each completed refit, so that a killed command can be resumed.

use crate::cli::Failure;
use crate::file::Input;
use crate::flights::trials::sha256;
use crate::refits::{Kind, Replicate, Study};
use pilotage_process::lock;
use std::collections::HashSet;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Beginning of such a file.
pub const HEAD: &str = "# Bootstrap refits of pilotage";

/// The file to which refits are appended.
pub struct Kept {
    path: PathBuf,
    file: File,
}

impl Kept {
    /// Opens or creates the file of a bootstrap and returns the refits in it. An incomplete last line is truncated.
    ///
    /// # Errors
    /// If it cannot be read or written, is no such file, belongs to another fit, or is being written by another
    /// process.
    pub fn open(
        path: &Path,
        study: &Study<'_>,
        kind: Kind,
        seed: u64,
    ) -> Result<(Vec<Replicate>, Self), Failure> {
        let fail = |error: io::Error| Failure::cannot_write(path, &error);
        if std::fs::metadata(path).is_ok_and(|own| !own.is_file()) {
            let message = format!("{} is no file; --resume wants one", path.display());
            return Err(Failure::new(message));
        }
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(fail)?;
        lock::take(&file)
            .map_err(|error| fail(error).hint("wait for it, or give --resume another file"))?;
        let mut text = String::new();
        let all = Input::of(&mut file).read_to_string(&mut text);
        all.map_err(|error| Failure::new(format!("cannot read {}: {error}", path.display())))?;
        let head = head(study, kind, seed);
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let found = match text[..whole].strip_prefix(&head) {
            // Files of parts follow each other.
            Some(lines) => {
                let lines = lines.replace(&head, "");
                read(path, &lines, study.unknowns.len() + study.derived.len())?
            }
            // The process may have been killed before the first line was complete.
            None if text.is_empty() || whole == 0 && head.starts_with(&text) => Vec::new(),
            None => return Err(refused(path, &text)),
        };
        file.set_len(whole as u64).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        if whole == 0 {
            file.write_all(head.as_bytes()).map_err(fail)?;
        }
        let path = path.to_owned();
        Ok((found, Self { path, file }))
    }

    /// Appends a refit.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, replicate: &Replicate) -> Result<(), Failure> {
        let values = match &replicate.values {
            Some(values) => values.iter().map(|value| format!(",{value:?}")).collect(),
            None => ",-".to_owned(),
        };
        let line = format!("{}{values}", replicate.number);
        let line = format!("{line},{}\n", sum(&line));
        let written = self.file.write_all(line.as_bytes());
        written.map_err(|error| Failure::cannot_write(&self.path, &error))
    }
}

/// The first line, which identifies the fit and the resampling.
fn head(study: &Study<'_>, kind: Kind, seed: u64) -> String {
    let solved = study.solved.solution();
    let values = solved.z.iter().chain([&solved.objective]);
    let mut bytes: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
    study
        .unknowns
        .iter()
        .for_each(|own| bytes.extend(own.full_name().bytes()));
    study
        .derived
        .iter()
        .for_each(|own| bytes.extend(own.bytes()));
    let sum = sha256(&bytes);
    let fit = &sum[..16];
    format!("{HEAD}, kind {kind}, seed {seed}, of the fit {fit}\n")
}

/// Parses complete lines. A value is NaN if the replicate has none, such as a parameter of a subject that was not
/// drawn, or a margin that a loop does not have.
fn read(path: &Path, lines: &str, count: usize) -> Result<Vec<Replicate>, Failure> {
    let line = |(k, line): (usize, &str)| {
        let replicate = replicate(line).filter(|own| {
            let values = own.values.as_ref();
            values.is_none_or(|values| values.len() == count)
        });
        replicate.ok_or_else(|| {
            let message = format!(
                "{}:{}: `{line}` is no refit, or was changed since",
                path.display(),
                k + 2
            );
            Failure::new(message).hint("remove the line, or give --resume another file")
        })
    };
    let mut all: Vec<Replicate> =
        (lines.lines().enumerate().map(line)).collect::<Result<_, _>>()?;
    // Duplicate lines count once.
    let mut seen = HashSet::new();
    all.retain(|own| seen.insert(own.number));
    Ok(all)
}

/// Checksum that detects modified lines.
fn sum(line: &str) -> String {
    sha256(line.as_bytes())[..8].to_owned()
}

fn replicate(line: &str) -> Option<Replicate> {
    let (line, _) = line
        .rsplit_once(',')
        .filter(|(line, own)| sum(line) == **own)?;
    let (number, values) = line.split_once(',')?;
    Some(Replicate {
        number: number.parse().ok()?,
        values: match values {
            "-" => None,
            values => Some(
                values
                    .split(',')
                    .map(str::parse)
                    .collect::<Result<_, _>>()
                    .ok()?,
            ),
        },
    })
}

fn refused(path: &Path, text: &str) -> Failure {
    let what = match text.starts_with(HEAD) {
        true if text.contains('\r') => "was changed since: its lines end with CR LF",
        true => "holds refits of another fit, kind or seed",
        false => "is there, and no file of bootstrap refits",
    };
    let message = format!("{} {what}", path.display());
    Failure::new(message).hint("give --resume another file; it is made where it is not there")
}
