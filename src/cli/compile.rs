//! `pilotage compile`: compiles the sources of an FMU for this machine.

use super::made::{program, quoted};
use super::overwrite::{OutputKind, Overwrite};
use super::{Failure, Outcome, overwrite, recognise, terminal};
use crate::export::compile::{CompileError, Compiler, compile, plan};
use crate::fmi::Fmu;
use crate::fmi::sources::Build;
use std::path::PathBuf;

/// Arguments of `pilotage compile`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage compile pump.fmu -o here.fmu                    with $CC, or cc\n  \
    pilotage compile pump.fmu --cc 'zig cc'                  with zig\n\n\
    Nothing of the FMU runs: `pilotage validate` tries what was made. Compiler options in the FMU are left out.")]
pub struct Args {
    /// The FMU with sources.
    fmu: PathBuf,
    /// FMU to write, with all that the FMU has and the library in addition [default: NAME-compiled.fmu].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The C compiler, with arguments [default: $CC, else cc].
    #[arg(long, value_name = "COMMAND")]
    cc: Option<String>,
    /// Time that the compiler may take [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = seconds)]
    time_limit: f64,
    #[command(flatten)]
    overwrite: Overwrite,
}

fn seconds(text: &str) -> Result<f64, String> {
    let is_long = |own: &f64| *own > 0.0 && *own < 1e9;
    text.parse()
        .ok()
        .filter(is_long)
        .ok_or_else(|| "expected seconds, above 0".to_owned())
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let kinds = [recognise::FileKind::Fmu, recognise::FileKind::Archive];
    recognise::expect([&args.fmu], &kinds, "an FMU")?;
    let output = args.output.unwrap_or_else(|| {
        let name = args.fmu.file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{name}-compiled.fmu"))
    });
    args.overwrite.check(
        std::slice::from_ref(&args.fmu),
        &[(&output, OutputKind::Fmu)],
    )?;
    let variable = std::env::var("CC")
        .ok()
        .filter(|own| !own.trim().is_empty());
    let command = args.cc.or(variable).unwrap_or_else(|| "cc".to_owned());
    let compiler = Compiler {
        command: command.split_whitespace().map(str::to_owned).collect(),
        limit: args.time_limit,
    };
    if compiler.command.is_empty() {
        return Err(Failure::new("--cc names no compiler").hint("name one, such as --cc gcc"));
    }
    let mut fmu = Fmu::open(&args.fmu)?;
    let builds = plan(&mut fmu)?;
    terminal::note(&said(&fmu, &builds, &command));
    let bytes = compile(&mut fmu, &builds, &compiler).map_err(not_compiled)?;
    overwrite::save(&output, bytes)?;
    let (program, shown) = (program(), quoted(&output.to_string_lossy()));
    terminal::print(&format!(
        "wrote {}\nnext: {program} validate {shown}\n",
        terminal::shown(&output)
    ))?;
    Ok(Outcome::Done)
}

/// What is compiled, before it is.
fn said(fmu: &Fmu, builds: &[Build], command: &str) -> String {
    let sets = || builds.iter().flat_map(|own| &own.sets);
    let files: Vec<&str> = sets()
        .flat_map(|set| &set.files)
        .map(String::as_str)
        .collect();
    let shown = match files.len() {
        0..=5 => files.join(", "),
        n => format!("{}, ... ({n} files)", files[..4].join(", ")),
    };
    let tool = fmu
        .description()
        .generation_tool
        .as_deref()
        .unwrap_or("a tool that it does not name");
    let mut text = format!(
        "compiling {shown} of {} with `{command}`; this is code of whoever made the FMU (by {tool}), and is not run here",
        terminal::shown(fmu.path())
    );
    if let Some(options) = sets().find_map(|set| set.options.as_deref()) {
        text += &format!("; the options that it names for a compiler are left out: {options}");
    }
    text
}

fn not_compiled(error: CompileError) -> Failure {
    match error {
        CompileError::Refused { ref lines, .. } => Failure::new(error.to_string()).below(lines),
        CompileError::NoCompiler { .. } => {
            Failure::from(error).hint("install a C compiler, or name one: --cc gcc, --cc 'zig cc'")
        }
        CompileError::Late(_) => Failure::from(error).hint("give it more time: --time-limit 1000"),
        other => other.into(),
    }
}
