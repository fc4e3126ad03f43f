//! Written files and the suggested next command, at the end of the summary.

use super::Args;
use crate::cli::made::{program, quoted};
use crate::cli::terminal;
use crate::identification::{Identification, InitialState};
use crate::sqp::Status;

const AT_REST: &str =
    "      --initial-state vehicle-at-rest, if the vehicle hovered before each run\n";

impl Args {
    /// The end of the summary.
    pub(super) fn next(&self, found: &Identification) -> String {
        let Identification { fit, options, .. } = found;
        let pilot = terminal::shown(self.output());
        let mut text = format!("\nwrote {pilot}\n");
        if let Some(report) = &self.report {
            text += &format!("wrote {}\n", terminal::shown(report));
        }
        text + &match (fit.is_answer(), fit.converged) {
            (true, _) => format!(
                "next: {} export pilot {} -o {}\n",
                program(),
                quoted(&self.output().to_string_lossy()),
                quoted(&self.output().with_extension("fmu").to_string_lossy())
            ),
            (false, true) => "next: mend what the first diagnostic says, and fit again\n".into(),
            (false, false) => {
                let start = numbers(&fit.theta);
                let first = match options.initial_state {
                    InitialState::Free => AT_REST,
                    InitialState::VehicleAtRest | InitialState::AtRest => "",
                };
                self.what_else(fit.status, first, &start, options.max_iterations)
            }
        }
    }

    /// Suggestions for a solve that did not converge: some of its own, then those of how it ended, with the values of
    /// `--start` at which it ended and its iteration limit.
    pub(super) fn what_else(&self, end: Status, first: &str, start: &str, limit: usize) -> String {
        let mut text = String::from("next: this is the best iterate, not a result; try\n");
        text += first;
        let ended_by = |status: Status| end == status;
        let was_cut_short = [
            Status::IterationLimit,
            Status::TimeLimit,
            Status::Interrupted,
        ]
        .into_iter()
        .any(ended_by);
        text += &match was_cut_short && !start.is_empty() {
            true => format!("      --start {start}, to go on from here\n"),
            false => "      --random-starts 20, or --start with other values\n".into(),
        };
        if let (true, Some(limit)) = (ended_by(Status::TimeLimit), self.time_limit) {
            text += &format!("      --time-limit above {limit}\n");
        }
        if ended_by(Status::IterationLimit) {
            text += &format!("      --max-iterations above {limit}\n");
        }
        text
    }
}

/// Numbers with all digits, separated by commas.
fn numbers(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(f64::to_string).collect();
    words.join(",")
}
