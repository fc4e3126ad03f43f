//! Command-line arguments for the coupling of components.

use super::super::Failure;
use super::super::number::{positive, within};
use super::super::system::flags::pair;
use crate::cosim::{Algorithm, Clock, Control, Coupling, System};
use clap::ValueEnum;

/// Algorithm, extrapolation and step-size control.
#[derive(Debug, clap::Args)]
pub struct CouplingArgs {
    /// How the FMUs exchange values.
    #[arg(long, value_enum, default_value_t)]
    algorithm: AlgorithmName,
    /// Degree of the polynomials that stand for outputs not known yet [default: 0, values are held].
    #[arg(long, value_name = "0..2", value_parser = within(0..=2_u8), allow_hyphen_values = true)]
    extrapolation: Option<u8>,
    /// Choose the communication steps so that no input is wrong by more than this, relative to its
    /// magnitude; every multiple of --step is hit. FMUs must be able to go back (canGetAndSetFMUstate)
    /// for a step to be repeated.
    #[arg(long, value_name = "NUMBER", value_parser = positive, allow_hyphen_values = true)]
    tolerance: Option<f64>,
    /// Shortest communication step with --tolerance [s] [default: a billionth of --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true, requires = "tolerance")]
    min_step: Option<f64>,
    /// Longest communication step with --tolerance [s] [default: --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true, requires = "tolerance")]
    max_step: Option<f64>,
    /// Relative tolerance for FMUs with error control of their own [default: a tenth of --tolerance,
    /// else each FMU's own].
    #[arg(long, value_name = "NUMBER", value_parser = positive, allow_hyphen_values = true)]
    fmu_tolerance: Option<f64>,
    /// Have an FMU take every communication step in that many equal parts; may be given many times.
    #[arg(long, value_name = "INSTANCE=N", value_parser = pair)]
    parts: Vec<(String, String)>,
    /// Let all FMUs step at the same time (jacobi with held inputs and fixed steps): pays where their steps
    /// take more than about 1 µs and processors are free. Instances of one FMU then run on several threads.
    #[arg(long, conflicts_with_all = ["extrapolation", "tolerance", "parts", "details", "report"])]
    parallel: bool,
    /// Time every call, and report each connection, its lag and error, and all calls.
    #[arg(long)]
    pub details: bool,
}

/// [`Algorithm`] by name.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum AlgorithmName {
    /// All FMUs get the others' outputs at the begin of the step, then all step.
    #[default]
    Jacobi,
    /// One FMU after another, in the order of their dependencies, each with the newest values.
    GaussSeidel,
    /// Steps are repeated from saved states until the outputs at their ends fit the inputs: no lag,
    /// second order.
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
