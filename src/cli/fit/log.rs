//! The log of a fit as JSON lines: one object for each iteration as it happens, one for each start and
//! one for the fit at the end.

use crate::cli::Failure;
use crate::cli::terminal::Stdout;
use crate::identification::result::StartReport;
use crate::identification::{Fit, solve::Iterate};
use pilotage_process::lock;
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::{self, ErrorKind, LineWriter, Write};
use std::path::{Path, PathBuf};

/// Destination of the lines. Write errors are reported at the end, since they are no reason to stop a fit.
pub struct Log {
    path: PathBuf,
    out: Box<dyn Write>,
    failed: Option<io::Error>,
}

/// Whether the path stands for stdout.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

impl Log {
    /// Opens the file, which is written during the fit, or stdout for `-`.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let out: Box<dyn Write> = match is_stdout(path) {
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
            "order": iterate.order,
            "start": iterate.start + 1,
            "iteration": iteration.number,
            "objective": iteration.objective,
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

    /// Writes the results of the starts and of the fit.
    pub fn close(mut self, fit: &Fit) -> Result<(), Failure> {
        let mut starts: Vec<&StartReport> = fit.starts.iter().collect();
        starts.sort_by_key(|start| start.number);
        for start in starts {
            self.line(&json!({
                "event": "start",
                "start": start.number,
                "status": start.status.as_str(),
                "iterations": start.iterations,
                "objective": start.objective,
                "feasible": start.feasible,
                "kkt": start.kkt,
                "curvature": start.curvature,
                "seconds": start.seconds,
            }));
        }
        self.line(&json!({
            "event": "fit",
            "status": fit.status.as_str(),
            "iterations": fit.iterations,
            "objective": fit.objective,
            "kkt": fit.kkt,
            "curvature": fit.curvature,
            "seconds": fit.seconds,
            "skipped": fit.skipped,
        }));
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
