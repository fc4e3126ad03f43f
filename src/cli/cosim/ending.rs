//! How a run ended.

use crate::cosim::{Ending, Run, scenario};
use crate::error_chain::error_chain;

/// How a run ended, in words.
pub struct Words {
    /// Status for scripts.
    pub status: &'static str,
    /// `note` or `error`.
    pub severity: &'static str,
    /// Error or note, if any.
    pub message: Option<String>,
}

impl Words {
    /// Describes how `run` ended.
    pub fn of(run: &Run) -> Self {
        let (status, severity, message) = match &run.ending {
            Ending::Completed => ("completed", "note", None),
            Ending::Stopped { time } => {
                let message = format!("stopped at {time} s");
                ("stopped", "note", Some(message))
            }
            Ending::EndRequested { instance, time } => {
                let message = format!("`{instance}` asked for the end at {time} s");
                ("end-requested", "note", Some(message))
            }
            Ending::Discarded {
                instance,
                time,
                reached,
                words,
            } => {
                let words = match words {
                    Some(words) => format!(": {words}"),
                    None => "; a shorter --step may help: --algorithm strong with --tolerance shortens steps by \
                             itself, if the FMUs save their states"
                        .to_owned(),
                };
                let message = format!(
                    "`{instance}` discarded the step from {time} s, it came to {reached} s{words}"
                );
                ("discarded", "error", Some(message))
            }
            Ending::Failed {
                instance,
                time,
                stage,
                source,
            } => {
                let why = error_chain(source.as_ref());
                let message = format!("`{instance}` failed to {stage} at {time} s: {why}");
                ("failed", "error", Some(message))
            }
        };
        Self {
            status,
            severity,
            message,
        }
    }

    /// The same for a run whose rows are written to a file.
    pub fn with_rows(run: &Run) -> Self {
        let mut words = Self::of(run);
        if let Some(message) = &mut words.message
            && !matches!(run.ending, Ending::EndRequested { .. })
        {
            *message += &format!("; the rows until {} s are kept", run.time);
        }
        if let Some(message) = &mut words.message
            && let Ending::EndRequested { instance, .. } | Ending::Discarded { instance, .. } =
                &run.ending
            && run.ends_within_step
            // It has no values, and steps of the others are cut where it ends the run.
            && instance != scenario::NAME
            && run.order.len() > 1
        {
            *message += &format!(
                "; the last row lies within a step, and only values of `{instance}` are those of its time"
            );
        }
        words
    }
}
