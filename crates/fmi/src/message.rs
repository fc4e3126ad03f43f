//! Messages of FMUs.

use pilotage_abi::fmi2::Status;
use pilotage_text::printable::one_line;
use std::fmt::{Debug, Write};
use tracing::Event;
use tracing::field::{Field, Visit};

/// A message of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Severity; FMI 3.0 uses the same numbers.
    pub status: Status,
    /// The name that the FMU uses for its instance (FMI 2.0 only), which should be the given one.
    pub instance_name: Option<String>,
    /// Category, one of the description's `LogCategories` if the FMU follows the standard.
    pub category: String,
    /// The text on one line: line ends are spaces, control characters and bidirectional marks are escaped.
    pub text: String,
}

impl Message {
    /// Builds a message, on one line: nothing that an FMU says looks like a line of somebody else.
    pub(crate) fn new(
        status: Status,
        instance_name: Option<String>,
        category: String,
        text: &str,
    ) -> Self {
        Self {
            status,
            instance_name,
            category,
            text: one_line(text.trim_end()).into_owned(),
        }
    }

    /// Passes the message to `tracing`, with the instance's name, category and status as fields.
    pub(crate) fn trace(&self, instance: &str) {
        macro_rules! event {
            ($level:ident) => {
                tracing::$level!(
                    target: "fmu",
                    instance,
                    category = self.category,
                    status = self.status.name().unwrap_or("undefined"),
                    "{}",
                    self.text
                )
            };
        }
        match self.status {
            Status::OK | Status::PENDING => event!(info),
            Status::WARNING | Status::DISCARD => event!(warn),
            _ => event!(error),
        }
    }
}

/// A message as who listens to `tracing` gets it.
#[derive(Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Heard {
    /// Name of the instance.
    pub instance: String,
    /// Name of the status in FMI 2.0.
    pub status: String,
    /// The text.
    pub text: String,
}

impl Heard {
    /// Reads the event of a message, whose target is `fmu`.
    pub fn of(event: &Event<'_>) -> Self {
        let mut heard = Self::default();
        event.record(&mut heard);
        heard
    }
}

impl Visit for Heard {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "instance" => value.clone_into(&mut self.instance),
            "status" => value.clone_into(&mut self.status),
            _ => {}
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            // A `String` takes everything.
            let _ = write!(self.text, "{value:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Message;
    use pilotage_abi::fmi2::Status;

    #[test]
    fn an_fmu_cannot_speak_in_lines_of_others() {
        let said = "slow\n\nerror: the disk is full\r\u{1b}[1A\u{202e}\u{2028}error: x\n";
        let message = Message::new(Status::WARNING, None, String::new(), said);
        assert_eq!(
            message.text,
            "slow error: the disk is full \\u001b[1A\\u202e error: x"
        );
    }
}
