//! The `pilotage` command: parse, run, exit code.

fn main() -> std::process::ExitCode {
    pilotage::cli::main()
}
