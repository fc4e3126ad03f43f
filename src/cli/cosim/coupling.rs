//! Command-line arguments for the coupling of components.

use super::super::Failure;
use super::super::number::{positive, within};
use super::super::system::flags::pair;
use crate::cosim::{Algorithm, Clock, Control, Coupling, System};
use clap::ValueEnum;

/// Algorithm, extrapolation and step-size control.
#[derive(Debug, clap::Args)]
pub struct CouplingArgs {
    /// Algorithm by which the FMUs exchange values.
    #[arg(long, value_enum, default_value_t)]
    algorithm: AlgorithmName,
    /// Degree of the polynomials that extrapolate inputs within a step [default: 0, inputs are held]. The first step has
    /// none to extrapolate, so that 2 is of no higher order than 1.
    #[arg(long, value_name = "0..2", value_parser = within(0..=2_u8), allow_hyphen_values = true)]
    extrapolation: Option<u8>,
    /// Adapt the communication step so that the error of each input stays below this, relative to its magnitude;
    /// every multiple of --step is reached. Steps are repeated only by FMUs that can restore a saved state
    /// (canGetAndSetFMUstate).
    #[arg(long, value_name = "NUMBER", value_parser = positive, allow_hyphen_values = true)]
    tolerance: Option<f64>,
    /// Minimum communication step with --tolerance [s] [default: a billionth of --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true, requires = "tolerance")]
    min_step: Option<f64>,
    /// Maximum communication step with --tolerance [s] [default: --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true, requires = "tolerance")]
    max_step: Option<f64>,
    /// Relative tolerance for FMUs that have error control [default: a tenth of --tolerance, else each FMU's own].
    #[arg(long, value_name = "NUMBER", value_parser = positive, allow_hyphen_values = true)]
    fmu_tolerance: Option<f64>,
    /// Divide each communication step of an FMU into N equal steps; may be repeated.
    #[arg(long, value_name = "INSTANCE=N", value_parser = pair)]
    parts: Vec<(String, String)>,
    /// Step all FMUs at the same time (jacobi with held inputs and fixed steps). It is faster if each step takes more
    /// than about 1 µs and processors are free. Instances of one FMU then run on several threads.
    #[arg(long, conflicts_with_all = ["extrapolation", "tolerance", "parts", "details"])]
    parallel: bool,
    /// Time each call, and report the lag and error of each connection and the time of all calls.
    #[arg(long)]
    pub details: bool,
}

/// [`Algorithm`] by name.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum AlgorithmName {
    /// All FMUs step with the outputs at the start of the step.
    #[default]
    Jacobi,
    /// FMUs step one after another, in the order of their dependencies, with the newest outputs.
    GaussSeidel,
    /// Steps are repeated from saved states until inputs and outputs agree: no lag, second order.
    Strong,
}

impl CouplingArgs {
    /// The coupling for the given clock.
    ///
    /// # Errors
    /// If `--parallel` is given with an algorithm other than Jacobi.
    pub fn coupling(&self, clock: &Clock) -> Result<Coupling, Failure> {
        let algorithm = match self.algorithm {
            AlgorithmName::Jacobi => Algorithm::Jacobi,
            AlgorithmName::GaussSeidel => Algorithm::GaussSeidel,
            AlgorithmName::Strong => Algorithm::Strong,
        };
        if self.parallel && algorithm != Algorithm::Jacobi {
            let message = format!("--parallel does not go with --algorithm {algorithm}");
            return Err(Failure::new(message).hint("only jacobi lets FMUs step independently"));
        }
        Ok(Coupling {
            parallel: self.parallel,
            extrapolation: self.extrapolation.map(usize::from),
            control: self.tolerance.map(|tolerance| {
                let control = Control::new(tolerance, clock);
                Control {
                    min_step: self.min_step.unwrap_or(control.min_step),
                    max_step: self.max_step.unwrap_or(control.max_step),
                    ..control
                }
            }),
            measure: self.details,
            ..algorithm.into()
        })
    }

    /// Relative tolerance for components with their own error control.
    pub fn component_tolerance(&self) -> Option<f64> {
        self.fmu_tolerance.or(self.tolerance.map(|t| 0.1 * t))
    }

    /// Instances that divide their steps, and into how many.
    pub fn parts(&self) -> &[(String, String)] {
        &self.parts
    }

    /// Sets which components divide their steps into parts.
    pub fn apply_parts(&self, system: &mut System) -> Result<(), Failure> {
        for (name, parts) in &self.parts {
            let parts = parts.parse().map_err(|_| {
                Failure::new(format!(
                    "--parts {name}={parts}: `{parts}` is no whole number"
                ))
            })?;
            system.set_parts(name, parts)?;
        }
        Ok(())
    }
}
