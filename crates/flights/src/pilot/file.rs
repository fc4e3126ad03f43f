//! The pilot file as a whole: the pilot, how sure it is, and what the fit said against it.

use super::{FittedPilot, PilotError, uncertainty};
use crate::vehicle::{self, ClosedLoop};
use pilotage_inference::Spread;
use pilotage_models::Quadcopter;
use pilotage_text::document::{self, Document, DocumentError, TomlTable};
use std::path::Path;

/// The result file `pilot.toml` of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotFile {
    /// θ, and the limit on |y_p| that the fit used.
    pub pilot: FittedPilot,
    /// False for the best iterate of a fit that did not converge.
    pub converged: bool,
    /// The vehicle of its closed loop; `None` if the vehicle is not known.
    pub vehicle: Option<Quadcopter>,
    /// Uncertainty of θ; `None` if the file does not contain it for all components.
    pub spread: Option<Spread>,
    /// Diagnostics of the fit.
    pub diagnostics: Vec<PilotDiagnostic>,
}

/// A diagnostic of the fit, as stored in a pilot file.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotDiagnostic {
    /// Code for scripts.
    pub code: String,
    /// Message.
    pub words: String,
    /// Whether it makes the result meaningless.
    pub fatal: bool,
}

/// Code of the diagnostic for a loop that was allowed to be unstable.
const UNSTABLE: &str = "unstable-loop";

impl PilotFile {
    /// Reads a pilot file.
    ///
    /// # Errors
    /// If the file cannot be read, or θ is missing or not numeric.
    pub fn read(path: &Path) -> Result<Self, PilotError> {
        Self::parse(&document::read(path)?, &path.display().to_string())
    }

    /// Parses the text of a pilot file; `file` is its name in messages. If `converged` or `stick_limit` is missing, as
    /// in a file written by hand, it defaults to `true` or 1.
    ///
    /// # Errors
    /// As [`PilotFile::read`].
    pub fn parse(text: &str, file: &str) -> Result<Self, PilotError> {
        let document = Document::parse(text, file)?;
        let root = document.root();
        let pilot = FittedPilot::of_table(root)?;
        let vehicle = match (root.table("closed_loop")?, root.table("vehicle")?) {
            (Some(_), Some(table)) => Some(vehicle::of_table(&table)?),
            _ => None,
        };
        Ok(Self {
            spread: match root.table("uncertainty")? {
                Some(table) => uncertainty::of_table(&table, pilot.theta.len())?,
                None => None,
            },
            pilot,
            converged: root.boolean("converged")?.unwrap_or(true),
            vehicle,
            diagnostics: (root.tables("doubt")?.iter())
                .map(PilotDiagnostic::read)
                .collect::<Result<_, _>>()?,
        })
    }

    /// Reads the file of a fitted linear pilot, a model file; `None` if the model is another one.
    ///
    /// # Errors
    /// If the file cannot be read, or its `[uncertainty]` is not that of its parameters.
    pub fn of_model(path: &Path) -> Result<Option<Self>, PilotError> {
        let (text, file) = (document::read(path)?, path.display().to_string());
        let document = Document::parse(&text, &file)?;
        let root = document.root();
        let Some(parameters) = root.table("parameters")? else {
            return Ok(None);
        };
        let value = |name: &str| match parameters.is_table(name) {
            true => parameters
                .table(name)?
                .map_or(Ok(None), |own| own.number("start")),
            false => parameters.number(name),
        };
        let mut theta = Vec::new();
        while let Some(value) = value(&format!("theta{}", theta.len() + 1))? {
            theta.push(value);
        }
        let is_linear = !theta.is_empty() && parameters.count() == theta.len() + 1;
        let Some(stick_limit) = value("stick_limit")?.filter(|_| is_linear) else {
            return Ok(None);
        };
        let sure = root.table("uncertainty")?;
        let spread = sure.map(|own| uncertainty::of_model(&own, theta.len()));
        Ok(Some(Self {
            pilot: FittedPilot { theta, stick_limit },
            converged: true,
            vehicle: None,
            spread: spread.transpose()?.flatten(),
            diagnostics: Vec::new(),
        }))
    }

    /// Why the pilot is not a valid result; `None` if it is.
    pub fn objection(&self) -> Option<String> {
        if !self.converged {
            return Some("did not converge".into());
        }
        if let Some(diagnostic) = self.diagnostics.iter().find(|diagnostic| diagnostic.fatal) {
            return Some(format!("is no answer: {}", diagnostic.words));
        }
        let is_reported = self
            .diagnostics
            .iter()
            .any(|diagnostic| diagnostic.code == UNSTABLE);
        let unstable = self.is_stable_loop() == Some(false);
        (unstable && !is_reported).then(|| {
            "is no answer: the closed loop of [theta] with [vehicle] is unstable, and the file does not say so; it \
             may have been edited"
                .into()
        })
    }

    /// The closed loop with the vehicle of the fit, computed from θ in the file; `None` if the file does not specify
    /// the vehicle.
    pub fn closed_loop(&self) -> Option<ClosedLoop> {
        let (pilot, theta) = (self.pilot.structure(), &self.pilot.theta);
        self.vehicle
            .map(|vehicle| ClosedLoop::of(vehicle, pilot, theta))
    }

    /// Whether [`Self::closed_loop`] is stable.
    pub fn is_stable_loop(&self) -> Option<bool> {
        self.closed_loop().map(|known| known.is_stable())
    }

    /// Warnings for users of the pilot; statements of the file about its loop are included only if they agree with θ.
    pub fn caveat(&self) -> Option<String> {
        let unconverged = "The fit did NOT converge: θ is its best iterate, not a solution.";
        let unconverged = (!self.converged).then(|| unconverged.to_owned());
        let is_true =
            |diagnostic: &&PilotDiagnostic| match (diagnostic.code.as_str(), self.is_stable_loop())
            {
                (UNSTABLE, Some(stable)) => !stable,
                ("loop-on-bound" | "slow-loop" | "leaves-target", Some(stable)) => stable,
                _ => true,
            };
        let diagnostics = (self.diagnostics.iter().filter(is_true))
            .map(|diagnostic| format!("Diagnostic: {}.", diagnostic.words));
        let all: Vec<String> = unconverged.into_iter().chain(diagnostics).collect();
        (!all.is_empty()).then(|| all.join(" "))
    }
}

impl PilotDiagnostic {
    fn read(table: &TomlTable) -> Result<Self, DocumentError> {
        Ok(Self {
            code: table.required("code", table.string("code")?)?.into(),
            words: table.required("words", table.string("words")?)?.into(),
            fatal: table.boolean("fatal")?.unwrap_or(false),
        })
    }
}
