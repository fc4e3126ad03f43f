//! The command line: parse, resolve, act. The only place that knows clap, stdout and stderr.

use std::process::ExitCode;

/// How a command that could run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Done,
    /// It ran, but the answer is no (not converged, invalid): exit code 1.
    No,
}

/// Bad use or bad input: exit code 2.
#[derive(Debug, Clone)]
pub struct Failure {
    /// What is wrong and where.
    pub message: String,
    /// What to do next.
    pub hint: Option<String>,
}

/// Entry point of the command.
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
