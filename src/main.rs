//! The `pilotage` command: parses the arguments, runs, returns the exit code.

/// Libraries leave this choice to the program.
#[global_allocator]
static HEAP: pilotage_process::memory::Heap = pilotage_process::memory::Heap;

fn main() -> std::process::ExitCode {
    std::process::ExitCode::from(pilotage::cli::main())
}
