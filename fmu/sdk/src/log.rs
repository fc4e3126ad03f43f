//! Messages to the importer (FMI 2.0.5, section 2.1.5; FMI 3.0, section 2.3.1).

use crate::abi::{fmi2, fmi3};
use crate::problem::{Problem, Severity};
use std::ffi::{CStr, CString};

/// Categories of the messages of exported binaries, with their meaning.
pub const LOG_CATEGORIES: [(&str, &str); 4] = [
    ("logStatusWarning", "Calls that had no effect"),
    (
        "logStatusDiscard",
        "Steps that could not be done, and information that is not available",
    ),
    (
        "logStatusError",
        "Calls that were refused, and what to do about them",
    ),
    ("logStatusFatal", "Faults of the FMU itself"),
];

/// The importer's logger.
#[derive(Debug, Clone, Copy)]
pub enum Sink {
    /// A copy of the callbacks: the importer's struct need only live during `fmi2Instantiate`.
    Fmi2(Option<fmi2::CallbackFunctions>),
    /// The callback and its first argument.
    Fmi3(Option<fmi3::LogMessageCallback>, fmi3::InstanceEnvironment),
}

/// Sends messages through the importer's logger, with the instance name that the importer passed.
#[derive(Debug)]
pub struct Log {
    sink: Sink,
    instance_name: CString,
    /// Which of [`LOG_CATEGORIES`] are enabled.
    enabled: [bool; LOG_CATEGORIES.len()],
}

impl Log {
    /// A log with all categories on or off.
    pub fn new(sink: Sink, instance_name: &CStr, on: bool) -> Self {
        Self {
            sink,
            instance_name: instance_name.to_owned(),
            enabled: [on; LOG_CATEGORIES.len()],
        }
    }

    /// Switches all categories, or those listed. Unknown ones are reported.
    ///
    /// # Errors
    /// If a category is unknown; the others are switched nevertheless.
    pub fn switch(&mut self, on: bool, categories: &[&CStr]) -> Result<(), Problem> {
        if categories.is_empty() {
            self.enabled.fill(on);
            return Ok(());
        }
        let mut unknown = None;
        for category in categories {
            let name = category.to_string_lossy();
            match LOG_CATEGORIES.iter().position(|(known, _)| *known == name) {
                Some(i) => self.enabled[i] = on,
                None => unknown = Some(name.into_owned()),
            }
        }
        match unknown {
            Some(found) => Err(Problem::LogCategory { found }),
            None => Ok(()),
        }
    }

    /// Reports a problem of a call. Errors are reported even when logging is off, so that it is always known why a
    /// simulation stopped.
    pub fn report(&self, function: &str, problem: &Problem) {
        let severity = problem.severity();
        let category = match severity {
            Severity::Warning => 0,
            Severity::Discard => 1,
            Severity::Error => 2,
            Severity::Fatal => 3,
        };
        if self.enabled[category] || severity >= Severity::Error {
            let message = format!("{function}: {problem}");
            self.send(severity as i32, LOG_CATEGORIES[category].0, &message);
        }
    }

    /// Passes on what something inside has said, if its category is on; what has no severity, if all are.
    pub fn say(&self, severity: Option<Severity>, text: &str) {
        let (is_on, category) = match severity {
            Some(severity) => {
                let index = severity as usize - 1;
                (self.enabled[index], LOG_CATEGORIES[index].0)
            }
            None => (self.enabled.iter().all(|on| *on), LOG_CATEGORIES[0].0),
        };
        if is_on {
            self.send(severity.map_or(0, |own| own as i32), category, text);
        }
    }

    /// `status`: that of the message, 0 for an information.
    fn send(&self, status: i32, category: &str, message: &str) {
        let category = c_string(category);
        match self.sink {
            Sink::Fmi2(Some(callbacks)) => {
                let Some(logger) = callbacks.logger else {
                    return;
                };
                let message = c_string(&escaped(message));
                // SAFETY: the importer's logger takes these five arguments and the values that the
                // format asks for, which are none since every `%` is doubled; all strings live until it
                // returns.
                unsafe {
                    logger(
                        callbacks.component_environment,
                        self.instance_name.as_ptr(),
                        fmi2::Status(status),
                        category.as_ptr(),
                        message.as_ptr(),
                    );
                }
            }
            Sink::Fmi3(Some(logger), environment) => {
                let (status, message) = (fmi3::Status(status), c_string(message));
                // SAFETY: the importer's logger takes these arguments; the strings live until it returns.
                unsafe { logger(environment, status, category.as_ptr(), message.as_ptr()) };
            }
            Sink::Fmi2(None) | Sink::Fmi3(None, _) => {}
        }
    }
}

/// Escapes a message, which is a printf format in which `#` starts a reference to a variable (FMI 2.0).
fn escaped(message: &str) -> String {
    message.replace('%', "%%").replace('#', "##")
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}
