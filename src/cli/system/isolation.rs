//! FMUs in separate processes: which ones, and their limits.

use super::super::Failure;
use super::super::number::positive;
use crate::cosim::component::ComponentError;
use crate::cosim::description::InstanceDescription;
use crate::cosim::fmu_component::isolated::Gone;
use crate::cosim::{Component, Isolated, Limits, Program};
use crate::error_chain::error_chain;
use crate::fmi::InterfaceType;
use crate::suggestion::{did_you_mean, suggestion};
use pilotage_process::program;
use std::error::Error;
use std::path::Path;
use std::time::Duration;

/// The command that runs in such a process.
pub const COMMAND: &str = "__run-fmu";
/// Name that stands for all FMUs.
const ALL: &str = "all";

/// Maximum time of a call to an isolated FMU unless it is said \[s\].
const STEP_LIMIT: f64 = 60.0;

/// Whether an error is due to an isolated FMU that ended by itself or had to be killed.
pub fn is_gone(error: &(dyn Error + 'static)) -> bool {
    let mut next = Some(error);
    while let Some(error) = next {
        if error.is::<Gone>() {
            return true;
        }
        next = error.source();
    }
    false
}

/// Arguments that isolate FMUs.
#[derive(Debug, Default, clap::Args)]
pub struct Isolation {
    /// Run these FMUs in separate processes (`all` for all). An FMU that crashes, exits, hangs or uses too much
    /// memory ends the run with an error that names it, and the rows until then are kept. Each call takes some
    /// microseconds longer.
    #[arg(long, value_name = "INSTANCE", value_delimiter = ',')]
    isolate: Vec<String>,
    /// Maximum time of a call to an isolated FMU [s] [default: 60].
    #[arg(long, value_name = "SECONDS", value_parser = positive, requires = "isolate", allow_hyphen_values = true)]
    step_limit: Option<f64>,
    /// Maximum memory of the process of an isolated FMU [MB].
    #[arg(long, value_name = "MB", value_parser = positive, requires = "isolate", allow_hyphen_values = true)]
    memory_limit: Option<f64>,
}

impl Isolation {
    /// Isolates all FMUs, or none. A call of more than two seconds counts as a hang, since a person is flying.
    #[cfg(feature = "fly")]
    pub fn of_all(is_isolated: bool) -> Self {
        let all = is_isolated.then(|| ALL.to_owned());
        Self {
            isolate: all.into_iter().collect(),
            step_limit: Some(2.0),
            ..Self::default()
        }
    }

    /// Whether any is to be isolated.
    pub fn is_any(&self) -> bool {
        !self.isolate.is_empty()
    }

    /// Refuses names that are not instances of FMUs.
    pub fn check(&self, instances: &[InstanceDescription]) -> Result<(), Failure> {
        if self.memory_limit.is_some() && !cfg!(any(target_os = "linux", windows)) {
            let message =
                "--memory-limit: this system does not tell how much memory a process uses";
            return Err(Failure::new(message).hint("leave it out"));
        }
        for name in self.isolate.iter().filter(|name| *name != ALL) {
            let known = instances.iter().map(|own| own.name.as_str());
            let Some(own) = instances.iter().find(|own| own.name == *name) else {
                let near = did_you_mean(suggestion(name, known.clone()));
                let all: Vec<&str> = known.collect();
                let message = format!("--isolate: there is no instance `{name}`{near}");
                return Err(
                    Failure::new(message).hint(format!("there are {}, or all", all.join(", ")))
                );
            };
            let is_fmu = own
                .source
                .value
                .file()
                .is_some_and(super::recognise::is_fmu);
            if !is_fmu {
                let message = format!("--isolate: `{name}` is no FMU, and runs no code of others");
                return Err(Failure::new(message).hint("leave it out"));
            }
        }
        Ok(())
    }

    /// Whether all instances are isolated.
    pub fn is_all(&self) -> bool {
        self.isolate.iter().any(|own| own == ALL)
    }

    /// Whether an instance is isolated.
    pub fn is_of(&self, name: &str) -> bool {
        self.isolate.iter().any(|own| own == name || own == ALL)
    }

    /// Opens an FMU in a separate process.
    pub fn open(
        &self,
        file: &Path,
        name: &str,
        kind: Option<InterfaceType>,
    ) -> Result<Box<dyn Component>, Failure> {
        let failed = |error: ComponentError| {
            let words = error_chain(error.as_ref());
            match is_gone(error.as_ref()) {
                true => Failure::new(format!("`{name}` of {}: {words}", file.display())).ran(),
                false => Failure::new(words),
            }
        };
        let (path, mut arguments) = program::start().map_err(|error| failed(error.into()))?;
        arguments.push(COMMAND.into());
        let program = Program { path, arguments };
        let limits = Limits {
            // A time that is too long for the computer's clock is none.
            time: Duration::try_from_secs_f64(self.step_limit.unwrap_or(STEP_LIMIT)).ok(),
            memory: self.memory_limit.map(|megabytes| (1e6 * megabytes) as u64),
        };
        let isolated = Isolated::open(&program, limits, file, name, kind).map_err(failed)?;
        Ok(Box::new(isolated))
    }
}
