//! Reads the noise that drives the system.

use super::fields::at;
use super::{Read, Reader};
use crate::problem::error::ProblemError;
use crate::problem::file::{Measured, Noise, Objective, Options, ProcessNoise};
use pilotage_text::document::TomlTable;

impl Reader<'_> {
    pub(super) fn process_noise(&self, root: TomlTable<'_>) -> Read<Vec<ProcessNoise>> {
        let mut all = Vec::new();
        for (table, field, signal) in self.section(root, "process_noise")? {
            if !table.is_table(field) {
                let fault = format!(
                    "`{}` has a density; write {{ density = ... }}",
                    signal.value
                );
                return Err(at(table, field, fault));
            }
            let own = table.required(field, table.table(field)?)?;
            own.only(&["density"])?;
            let density = own.required("density", self.formula(own, "density")?)?;
            if let Some(number) = density.number().filter(|number| *number <= 0.0) {
                let fault = format!("the density is {number}; expected a number above 0");
                return Err(at(own, "density", fault));
            }
            all.push(ProcessNoise { signal, density });
        }
        Ok(all)
    }
}

/// Rejects process noise without the objective that accounts for it, that objective without process noise, and sensor
/// noise that a Kalman filter does not handle.
pub(super) fn check_objective(
    root: TomlTable<'_>,
    options: &Options,
    noise: &[ProcessNoise],
    measured: &[Measured],
) -> Read<()> {
    match (options.objective, noise.is_empty()) {
        (Objective::Response, true) => Ok(()),
        (Objective::Response, false) => {
            let fault = "a response is simulated without noise; write objective = \"prediction-error\" in [fit], or \
                         leave [process_noise] out";
            Err(at(root, "process_noise", fault))
        }
        (Objective::PredictionError, true) => {
            let fault = "nothing but the start says what comes next where no noise drives the system; add \
                         [process_noise] with \"instance.input\" = { density = ... }, or leave `objective` out";
            let fit = root.required("fit", root.table("fit")?)?;
            Err(at(fit, "objective", fault))
        }
        (Objective::PredictionError, false) => {
            let other = measured.iter().find(|own| own.noise != Noise::Normal);
            let fault = "objective = \"prediction-error\" takes normal noise of sensors alone; leave `noise` out";
            other.map_or(Ok(()), |own| Err(ProblemError::at(&own.place, fault)))
        }
    }
}
