//! Messages of FMUs.

use pilotage_abi::fmi2::Status;

/// A message of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Severity; FMI 3.0 uses the same numbers.
    pub status: Status,
    /// The name that the FMU uses for its instance (FMI 2.0 only), which should be the given one.
    pub instance_name: Option<String>,
    /// Category, one of the description's `LogCategories` if the FMU follows the standard.
    pub category: String,
    /// The text, with control characters escaped.
    pub text: String,
}

impl Message {
    /// Builds a message: removes trailing white space and escapes control characters.
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
            text: printable(text),
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

/// Text for a terminal: no trailing newline, control characters escaped.
fn printable(text: &str) -> String {
    let escape = |c: char| match c {
        '\n' | '\t' => c.to_string(),
        c if c.is_control() => c.escape_default().to_string(),
        c => c.to_string(),
    };
    text.trim_end().chars().map(escape).collect()
}
