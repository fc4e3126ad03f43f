//! The `pilotage` command: parses the arguments, runs, returns the exit code.

fn main() -> std::process::ExitCode {
    pilotage::cli::main()
}
