//! `pilotage completions`: what a shell completes of a command line; and the manual pages, which a release has (`scripts/dist.py`).

use super::{Cli, Failure, Outcome, terminal};
use clap::CommandFactory;
use clap_complete::Shell;
use std::path::PathBuf;

/// Arguments of `pilotage completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage completions bash > ~/.local/share/bash-completion/completions/pilotage\n  \
    pilotage completions zsh > ~/.zfunc/_pilotage       with `fpath+=~/.zfunc` before `compinit` in ~/.zshrc\n  \
    pilotage completions fish > ~/.config/fish/completions/pilotage.fish")]
pub struct Args {
    /// The shell.
    shell: Shell,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    // The generators know nothing of hidden commands.
    let whole = Cli::command();
    let shown = whole.get_subcommands().filter(|own| !own.is_hide_set());
    let mut command = clap::Command::new("pilotage")
        .version(env!("CARGO_PKG_VERSION"))
        .subcommands(shown.cloned());
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "pilotage", &mut script);
    terminal::print(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Done)
}

/// Arguments of `pilotage man`.
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Where the pages are written, one for each command.
    folder: PathBuf,
}

/// Writes the manual pages.
pub fn man(args: &ManArgs) -> Result<Outcome, Failure> {
    let failed = |error| Failure::cannot_write(&args.folder, &error);
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    clap_mangen::generate_to(Cli::command(), &args.folder).map_err(failed)?;
    Ok(Outcome::Done)
}
