//! Messages to the importer (FMI 2.0.5, section 2.1.5).

use crate::problem::Problem;
use pilotage_abi::fmi2::{CallbackFunctions, Function, Status};
use pilotage_models::model::LOG_CATEGORIES;
use std::ffi::{CStr, CString};

/// Sends messages through the importer's logger, under the name that the importer gave.
#[derive(Debug)]
pub struct Log {
    /// A copy: the importer's struct need only live during `fmi2Instantiate`.
    callbacks: Option<CallbackFunctions>,
    instance_name: CString,
    /// Which of [`LOG_CATEGORIES`] are on.
    enabled: [bool; LOG_CATEGORIES.len()],
}

impl Log {
    /// A log with all categories on or off.
    pub fn new(callbacks: Option<CallbackFunctions>, instance_name: &CStr, on: bool) -> Self {
        Self {
            callbacks,
            instance_name: instance_name.to_owned(),
            enabled: [on; LOG_CATEGORIES.len()],
        }
    }

    /// `fmi2SetDebugLogging`: switches all categories, or those named. Unknown ones are reported.
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

    /// Reports what went wrong in a call. Errors are reported even when logging is off: nobody should
    /// have to guess why a simulation stopped.
    pub fn report(&self, function: Function, problem: &Problem) {
        let status = problem.status();
        let category = match status {
            Status::WARNING => 0,
            Status::DISCARD => 1,
            Status::FATAL => 3,
            _ => 2,
        };
        if self.enabled[category] || status >= Status::ERROR {
            let message = format!("{}: {problem}", function.name());
            self.send(status, LOG_CATEGORIES[category].0, &message);
        }
    }

    fn send(&self, status: Status, category: &str, message: &str) {
        let Some(callbacks) = &self.callbacks else {
            return;
        };
        let Some(logger) = callbacks.logger else {
            return;
        };
        let (category, message) = (c_string(category), c_string(&escaped(message)));
        // SAFETY: the importer's logger takes these five arguments and the values that the format
        // asks for, which are none since every `%` is doubled; all strings live until it returns.
        unsafe {
            logger(
                callbacks.component_environment,
                self.instance_name.as_ptr(),
                status,
                category.as_ptr(),
                message.as_ptr(),
            );
        }
    }
}

/// The message is a printf format, in which `#` begins a reference to a variable.
fn escaped(message: &str) -> String {
    message.replace('%', "%%").replace('#', "##")
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}
