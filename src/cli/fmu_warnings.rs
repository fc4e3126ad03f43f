//! Warnings of FMUs, which leave the library as events of `tracing`.

use super::terminal;
use crate::fmi::Heard;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

/// Number of different warnings that are shown: a text with the time in it differs in each step.
const SHOWN: usize = 20;

/// Prints the warnings of FMUs to stderr from now on, each text once.
pub fn show() {
    // It fails where somebody listens already.
    let _ = tracing::subscriber::set_global_default(Warnings::default());
}

/// Texts shown so far, each with its instance.
#[derive(Debug, Default)]
struct Warnings(Mutex<BTreeSet<Heard>>);

impl Subscriber for Warnings {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "fmu" && *metadata.level() == Level::WARN
    }

    fn event(&self, event: &Event<'_>) {
        let warning = Heard::of(event);
        // The reason of a discarded step is part of what the command says of that step.
        if warning.status != "fmi2Warning" {
            return;
        }
        let mut shown = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if shown.len() >= SHOWN || shown.contains(&warning) {
            return;
        }
        terminal::say(
            "warning",
            &format!("`{}`: {}", warning.instance, warning.text),
        );
        shown.insert(warning);
        if shown.len() == SHOWN {
            terminal::note(&format!(
                "these were {SHOWN} different warnings of FMUs; further ones are not shown"
            ));
        }
    }

    // Messages of FMUs have no spans.
    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
