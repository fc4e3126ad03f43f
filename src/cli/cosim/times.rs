//! When a run begins and ends, and its communication step.

use super::super::Failure;
use super::super::number::{number, positive};
use crate::cosim::description::Experiment;
use crate::cosim::{Clock, System};

/// Communication steps of a run for which nobody says a step.
const STEPS: f64 = 500.0;

/// Start, stop and step of a run.
#[derive(Debug, clap::Args)]
pub struct Times {
    /// Start time [s] [default: that of the system file, or 0].
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_hyphen_values = true)]
    pub(crate) start_time: Option<f64>,
    /// Stop time [s] [default: that of the system file, or what the FMUs suggest, if they agree].
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_hyphen_values = true)]
    pub(crate) stop_time: Option<f64>,
    /// Communication step [s]; must divide the duration [default: that of the system file, or about the shortest that an FMU
    /// suggests, or 1/500 of the duration; the summary says it].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) step: Option<f64>,
}

impl Times {
    /// Refuses times that no system can have, without a system.
    pub fn check(&self) -> Result<(), Failure> {
        let start = self.start_time.unwrap_or(0.0);
        if let Some(stop) = self.stop_time {
            clock(start, stop, self.step)?;
        }
        Ok(())
    }

    /// The clock of a run of a system, and a note if nobody has said its step.
    pub fn clock(
        &self,
        system: &System,
        experiment: Experiment,
    ) -> Result<(Clock, Option<String>), Failure> {
        let start = self.start_time.or(experiment.start).unwrap_or(0.0);
        let stop = (self.stop_time.or(experiment.stop)).or_else(|| system.suggested_stop());
        let stop = stop.ok_or_else(|| {
            Failure::new("no --stop-time, and the FMUs suggest none, or different ones")
                .hint("say when the simulation ends, such as --stop-time 10")
        })?;
        if let Some(step) = self.step {
            return Ok((clock(start, stop, Some(step))?, None));
        }
        // The next shorter one that divides the duration.
        let parts = |step: f64| ((stop - start) / step * (1.0 - 1e-9)).ceil().max(1.0);
        let dividing = |step: f64| (stop - start) / parts(step);
        let (step, why) = match (experiment.step, system.suggested_step()) {
            (Some(own), _) if (own - dividing(own)).abs() <= 1e-9 * own => {
                return Ok((clock(start, stop, Some(own))?, None));
            }
            (Some(own), _) => (Some(dividing(own)), format!("the system says {own} s")),
            (None, Some(own)) if own < stop - start => {
                (Some(dividing(own)), format!("an FMU suggests {own} s"))
            }
            _ => (None, format!("1/{STEPS} of the run")),
        };
        let clock = clock(start, stop, step)?;
        let note = format!("--step {} is assumed: {why}", clock.step());
        Ok((clock, Some(note)))
    }
}

fn clock(start: f64, stop: f64, step: Option<f64>) -> Result<Clock, Failure> {
    // Of times in the wrong order the clock says so.
    let part = ((stop - start) / STEPS).max(f64::MIN_POSITIVE);
    Ok(Clock::new(start, stop, step.unwrap_or(part))?)
}
