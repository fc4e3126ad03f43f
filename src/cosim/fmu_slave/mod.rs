//! An FMU of FMI 2.0 or 3.0 as a slave. The only place here that knows of FMUs.

mod access;
mod linear;
mod model_exchange;
mod variables;

pub use model_exchange::ModelExchangeSlave;

use self::access::Access;
use self::linear::Knowns;
use self::variables::variables;
use super::slave::{Experiment, Kind, Progress, Slave, SlaveError, Value, Variable};
use crate::fmi::{self, Fmu, FmuError, Instance, Step, fmu};
use crate::linear::StateSpace;
use std::path::Path;

/// Opens and loads an FMU and makes a slave of it: of the wanted kind, if it has that one, else
/// co-simulation before model exchange.
///
/// # Errors
/// If anything about the FMU is wrong, or it is for scheduled execution alone.
pub fn open(
    path: &Path,
    name: &str,
    wanted: Option<fmi::Kind>,
) -> Result<Box<dyn Slave>, FmuError> {
    let mut fmu = Fmu::open(path)?;
    let kinds: Vec<fmi::Kind> = fmu.kinds().iter().map(|(kind, _)| *kind).collect();
    let has = |kind: &fmi::Kind| kinds.contains(kind);
    let first = wanted.filter(has);
    let library = fmu.load()?;
    let is_model_exchange = match first {
        Some(kind) => kind == fmi::Kind::ModelExchange,
        None => !has(&fmi::Kind::CoSimulation) && has(&fmi::Kind::ModelExchange),
    };
    Ok(match is_model_exchange {
        true => Box::new(ModelExchangeSlave::new(&library, name)?),
        false => Box::new(FmuSlave::new(&library, name)?),
    })
}

/// An instance of an FMU for co-simulation.
#[derive(Debug)]
pub struct FmuSlave {
    instance: Instance,
    access: Access,
    knowns: Knowns,
    variables: Vec<Variable>,
    /// Tolerance of the description's `DefaultExperiment`.
    tolerance: Option<f64>,
}

impl FmuSlave {
    /// Opens and loads an FMU and makes an instance of it.
    ///
    /// # Errors
    /// If anything about it is wrong.
    pub fn open(path: &Path, name: &str) -> Result<Self, FmuError> {
        Self::new(&Fmu::open(path)?.load()?, name)
    }

    /// Makes an instance of a loaded FMU.
    ///
    /// # Errors
    /// If the FMU refuses.
    pub fn new(library: &fmu::Library, name: &str) -> Result<Self, FmuError> {
        let description = library.description();
        Ok(Self {
            instance: library.instantiate(name, fmi::Kind::CoSimulation)?,
            access: Access::of(description),
            knowns: Knowns::of(description),
            variables: variables(description),
            tolerance: description.default_experiment.and_then(|e| e.tolerance),
        })
    }
}

impl Slave for FmuSlave {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), SlaveError> {
        let tolerance = experiment.tolerance.or(self.tolerance);
        let (start, stop) = (experiment.start, experiment.stop);
        Ok(self.instance.setup_experiment(tolerance, start, stop)?)
    }

    fn enter_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.enter_initialization_mode()?)
    }

    fn exit_initialization(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.exit_initialization_mode()?)
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError> {
        let instance = &mut self.instance;
        Ok(self.access.set_reals(instance, handles, values)?)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError> {
        let instance = &mut self.instance;
        Ok(self.access.get_reals(instance, handles, values)?)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError> {
        self.access.set(&mut self.instance, handle, value)
    }

    fn get(&mut self, handle: u32, kind: Kind) -> Result<Value, SlaveError> {
        self.access.get(&mut self.instance, handle, kind)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, SlaveError> {
        Ok(match self.instance.do_step(t, h)? {
            Step::Done => Progress::Done,
            Step::Discarded {
                last_successful,
                is_end_requested,
            } => {
                let reached = last_successful.unwrap_or(t);
                match is_end_requested {
                    true => Progress::EndRequested { reached },
                    false => Progress::Discarded { reached },
                }
            }
            Step::Stopped {
                reached,
                is_end_requested: true,
                ..
            } => Progress::EndRequested { reached },
            // Early return was not allowed: an FMU that does it all the same has not done the step.
            Step::Stopped { reached, .. } if reached < t + h => Progress::Discarded { reached },
            // Event mode was not asked for, so that there is nothing to handle.
            Step::Stopped { .. } => Progress::Done,
        })
    }

    fn terminate(&mut self) -> Result<(), SlaveError> {
        Ok(self.instance.terminate()?)
    }

    fn linearize(&mut self) -> Result<StateSpace, SlaveError> {
        self.knowns.by_derivatives(&mut self.instance)
    }
}
