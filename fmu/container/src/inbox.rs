//! Messages of the parts, which leave their library as events of `tracing`.

use pilotage_fmi::Heard;
use pilotage_sdk::problem::Severity;
use pilotage_sdk::simulation_unit::Message;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tracing::span::{Attributes, Id, Record};
use tracing::{Dispatch, Event, Metadata, Subscriber};

/// Most messages that wait for the importer: a call with more has lost its way.
const MOST: usize = 1000;

/// What the parts of one instance have said since the importer last heard of it.
#[derive(Clone)]
pub struct Inbox {
    messages: Arc<Waiting>,
    dispatch: Dispatch,
}

#[derive(Default)]
struct Waiting {
    any: AtomicBool,
    messages: Mutex<Vec<Message>>,
}

impl Inbox {
    pub fn new() -> Self {
        let messages = Arc::<Waiting>::default();
        let dispatch = Dispatch::new(Listener(Arc::clone(&messages)));
        Self { messages, dispatch }
    }

    /// Makes a call and listens to the parts meanwhile.
    #[inline]
    pub fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        tracing::dispatcher::with_default(&self.dispatch, call)
    }

    /// What was said since the last call.
    #[inline]
    pub fn take(&self) -> Vec<Message> {
        match self.messages.any.swap(false, Ordering::Relaxed) {
            false => Vec::new(),
            true => {
                let mut waiting = lock(&self.messages);
                std::mem::take(&mut *waiting)
            }
        }
    }
}

fn lock(waiting: &Waiting) -> std::sync::MutexGuard<'_, Vec<Message>> {
    let messages = waiting.messages.lock();
    messages.unwrap_or_else(PoisonError::into_inner)
}

struct Listener(Arc<Waiting>);

impl Subscriber for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "fmu"
    }

    fn event(&self, event: &Event<'_>) {
        let heard = Heard::of(event);
        // Names of FMI 3.0 are those of FMI 2.0 here.
        let severity = match heard.status.trim_start_matches("fmi2") {
            "OK" | "Pending" => None,
            "Warning" => Some(Severity::Warning),
            "Discard" => Some(Severity::Discard),
            _ => Some(Severity::Error),
        };
        let mut messages = lock(&self.0);
        if messages.len() < MOST {
            messages.push((severity, format!("`{}`: {}", heard.instance, heard.text)));
        }
        self.0.any.store(true, Ordering::Relaxed);
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
