//! Sets of trials, from files and manifests.

use super::read::Read;
use super::{ColumnNames, Trial, TrialError};
use pilotage_text::document::{self, Document, TomlTable};
use pilotage_text::printable::one_line;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The trials of a fit, and those reserved for its validation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrialSet {
    /// Trials that the pilot is fitted to.
    pub fit: Vec<Trial>,
    /// Trials that the fitted pilot is validated on.
    pub validation: Vec<Trial>,
    /// Notes on possible mistakes for the user, one sentence each, with the file's name.
    pub notes: Vec<String>,
    /// All files that were read, including manifests.
    pub files: Vec<PathBuf>,
}

/// Files with their leading comments.
type Heads = Vec<(String, Vec<String>)>;

impl TrialSet {
    /// Reads files in the given order; a file `*.toml` is a manifest, any other file is one run.
    ///
    /// # Errors
    /// If one of them cannot be read, or two trials have the same name.
    pub fn read(paths: &[PathBuf]) -> Result<Self, TrialError> {
        Self::read_with(paths, &ColumnNames::default())
    }

    /// The same with other column names.
    ///
    /// # Errors
    /// As [`TrialSet::read`].
    pub fn read_with(paths: &[PathBuf], columns: &ColumnNames) -> Result<Self, TrialError> {
        let mut set = Self::default();
        let mut heads = Vec::new();
        for path in paths {
            match path
                .extension()
                .is_some_and(|extension| extension == "toml")
            {
                true => set.read_manifest(path, columns, &mut heads)?,
                false => {
                    let trial = set.read_trial(path, columns, &mut heads)?;
                    set.fit.push(trial);
                }
            }
        }
        set.distinguish();
        set.check_names()?;
        set.note_copies();
        let heads = heads
            .iter()
            .map(|(file, comments)| (file.as_str(), comments.as_slice()));
        set.notes.extend(pilotage_series::flown::mixed(heads));
        Ok(set)
    }

    /// All trials: those of the fit, then those for validation.
    pub fn all(&self) -> impl Iterator<Item = &Trial> {
        self.fit.iter().chain(&self.validation)
    }

    fn read_trial(
        &mut self,
        path: &Path,
        columns: &ColumnNames,
        heads: &mut Heads,
    ) -> Result<Trial, TrialError> {
        let Read {
            trial,
            notes,
            comments,
        } = Trial::read_with_notes(path, columns)?;
        self.notes.extend(notes);
        heads.push((path.display().to_string(), comments));
        self.files.push(path.to_owned());
        Ok(trial)
    }

    fn read_manifest(
        &mut self,
        path: &Path,
        columns: &ColumnNames,
        heads: &mut Heads,
    ) -> Result<(), TrialError> {
        let (text, file) = (document::read(path)?, path.display().to_string());
        let document = Document::parse(&text, &file)?;
        let root = document.root();
        root.only(&["run"])?;
        let runs = root.tables("run")?;
        if runs.is_empty() {
            return Err(TrialError::NoRuns { file });
        }
        self.files.push(path.to_owned());
        let folder = path.parent().unwrap_or(Path::new(""));
        runs.iter()
            .try_for_each(|run| self.read_run(run, folder, columns, heads))
    }

    fn read_run(
        &mut self,
        run: &TomlTable,
        folder: &Path,
        columns: &ColumnNames,
        heads: &mut Heads,
    ) -> Result<(), TrialError> {
        run.only(&["file", "weight", "use"])?;
        let file = run.required("file", run.string("file")?)?;
        let weight = weight(run)?;
        let is_fitted = match run.string("use")?.unwrap_or("fit") {
            "fit" => true,
            "validation" => false,
            found => {
                return Err(TrialError::Use {
                    file: run.file().into(),
                    line: run.line("use"),
                    found: found.into(),
                });
            }
        };
        let trial = self.read_trial(&folder.join(file), columns, heads);
        let trial = Trial {
            weight,
            ..trial.map_err(|error| listed(error, run))?
        };
        match is_fitted {
            true => self.fit.push(trial),
            false => self.validation.push(trial),
        }
        Ok(())
    }

    /// Prefixes the folder's name to the names of files with the same name.
    fn distinguish(&mut self) {
        let mut count = HashMap::new();
        (self.all()).for_each(|trial| *count.entry(trial.name.clone()).or_insert(0) += 1);
        for trial in self.fit.iter_mut().chain(&mut self.validation) {
            let folder = Path::new(&trial.origin).parent().and_then(Path::file_name);
            if let Some(folder) = folder.filter(|_| count[&trial.name] > 1) {
                trial.name = format!("{}/{}", one_line(&folder.to_string_lossy()), trial.name);
            }
        }
    }

    /// Adds a note if files contain the same recording.
    fn note_copies(&mut self) {
        let mut first: HashMap<&str, &Trial> = HashMap::new();
        let mut copies: Vec<(&Trial, &Trial)> = Vec::new();
        for trial in self.all().filter(|trial| !trial.sha256.is_empty()) {
            match first.get(trial.sha256.as_str()) {
                Some(first) => copies.push((trial, first)),
                None => _ = first.insert(&trial.sha256, trial),
            }
        }
        let Some((copy, of)) = copies.first() else {
            return;
        };
        let more = match copies.len() - 1 {
            0 => String::new(),
            1 => ", and another file is a copy".into(),
            more => format!(", and {more} more files are copies"),
        };
        let note = format!(
            "{} is the same recording as {}{more}",
            copy.origin, of.origin
        );
        self.notes.push(note);
    }

    fn check_names(&self) -> Result<(), TrialError> {
        let mut seen: Vec<&Trial> = Vec::new();
        for trial in self.all() {
            if let Some(first) = seen.iter().find(|other| other.name == trial.name) {
                return Err(TrialError::Duplicate {
                    name: trial.name.clone(),
                    first: first.origin.clone(),
                    second: trial.origin.clone(),
                });
            }
            seen.push(trial);
        }
        Ok(())
    }
}

/// Adds the line of the manifest to the error for an unreadable file.
fn listed(error: TrialError, run: &TomlTable) -> TrialError {
    match error {
        TrialError::Read { file, source } => TrialError::Listed {
            manifest: run.file().into(),
            line: run.line("file"),
            file,
            source,
        },
        error => error,
    }
}

/// The weight of a run, 1 where it is missing.
fn weight(run: &TomlTable) -> Result<f64, TrialError> {
    let value = run.number("weight")?.unwrap_or(1.0);
    match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(TrialError::Weight {
            file: run.file().into(),
            line: run.line("weight"),
            value,
        }),
    }
}
