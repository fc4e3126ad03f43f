//! The log of a fit as JSON lines: one object for each iteration as it happens, one for each start and
//! one for the fit at the end. docs/json.md lists their keys.

use super::watch::Iterate;
use crate::cli::Failure;
use crate::cli::terminal::Stdout;
use pilotage_process::lock;
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::{self, ErrorKind, LineWriter, Write};
use std::path::{Path, PathBuf};

/// Keys of the object of `--json` that the last line repeats.
const CLOSING: [&str; 7] = [
    "status",
    "converged",
    "iterations",
    "objective",
    "kkt",
    "curvature",
    "skipped",
];

/// Destination of the lines. Write errors are reported at the end, since they are no reason to stop a fit.
pub struct Log {
    path: PathBuf,
    out: Box<dyn Write + Send>,
    failed: Option<io::Error>,
}

/// Whether the path stands for stdout.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

impl Log {
    /// Opens the file, which is written during the fit, or stdout for `-`.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let out: Box<dyn Write + Send> = match is_stdout(path) {
            true => Box::new(LineWriter::new(Stdout)),
            false => {
                let failed = |error: io::Error| Failure::cannot_write(path, &error);
                let mut options = OpenOptions::new();
                let options = options.write(true).create(true).truncate(false);
                let file = options.open(path).map_err(failed)?;
                // Devices and pipes are nobody's alone, and cannot be emptied.
                if file.metadata().map_err(failed)?.is_file() {
                    lock::take(&file).map_err(|error| {
                        failed(error).hint("wait for it, or give --log another file")
                    })?;
                    file.set_len(0).map_err(failed)?;
                }
                Box::new(file)
            }
        };
        Ok(Self {
            path: path.to_owned(),
            out,
            failed: None,
        })
    }

    /// Writes one iteration.
    pub fn iteration(&mut self, iterate: &Iterate) {
        let iteration = iterate.iteration;
        self.line(&json!({
            "event": "iteration",
            "start": iterate.start + 1,
            "refinement": iterate.refinement,
            "iteration": iteration.number,
            "objective": iterate.objective,
            "primal": iteration.kkt.primal,
            "dual": iteration.kkt.dual,
            "complementarity": iteration.kkt.complementarity,
            "step": iteration.step,
            "change": iteration.length,
            "damping": iteration.damping,
            "penalty": iteration.penalty,
            "active": iteration.active,
            "hessian": iteration.model.as_str(),
        }));
    }

    /// Writes the results of the starts and of the fit, from the object of `--json`.
    pub fn close(mut self, found: &Value) -> Result<(), Failure> {
        let starts = found["starts"].as_array();
        let mut starts: Vec<&Value> = starts.into_iter().flatten().collect();
        starts.sort_by_key(|start| start["start"].as_u64());
        for start in starts {
            let mut line = start.clone();
            line["event"] = json!("start");
            self.line(&line);
        }
        let mut line = json!({ "event": "fit" });
        for key in CLOSING {
            line[key] = found[key].clone();
        }
        line["seconds"] = found["seconds"]["total"].clone();
        self.line(&line);
        match self.failed {
            // A closed reader is no failure.
            Some(error) if error.kind() != ErrorKind::BrokenPipe => {
                Err(Failure::cannot_write(&self.path, &error))
            }
            _ => Ok(()),
        }
    }

    /// Writes a line in one piece, so that a reader sees whole lines, also after a crash.
    fn line(&mut self, object: &Value) {
        if self.failed.is_none() {
            let written = self.out.write_all(format!("{object}\n").as_bytes());
            self.failed = written.and_then(|()| self.out.flush()).err();
        }
    }
}
