//! `pilotage linearize`: the linearised coupled system, its poles, and the margins of its loops.

pub mod files;
mod text;
mod verdict;

use super::cosim::{self, ending};
use super::made::{made, with_sums};
use super::number::{number, positive};
use super::overwrite::{self, OutputKind, Overwrite};
use super::system::flags::{Wiring, pair};
use super::system::{self, Built};
use super::{Failure, Outcome, terminal};
use crate::cosim::{Algorithm, Clock, Linearization, Loop, SeriesRecorder, Thinned, linearize};
use crate::linear::{Mode, StateSpace};
use crate::report::{LoopFigure, LoopPage, Stability, loop_page};
use std::path::{Path, PathBuf};
use verdict::Verdict;

const EXAMPLES: &str = "\
Examples:
  # The loop of pilot and quadcopter at rest: poles, and margins of the loop cut at the stick.
  pilotage linearize pilot.fmu quadcopter.fmu \\
    --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\
    --loop pilot.stick=quadcopter.stick

  # At 5 s of a flight to 10 m; also the loop of a co-simulation with steps of 0.05 s.
  pilotage linearize pilot.fmu quadcopter.fmu \\
    --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\
    --set pilot.target=10 --at 5 --step 0.01 \\
    --loop pilot.stick=quadcopter.stick --in-steps 0.05 --report loop.html --matlab loop.m

  # A system file with instances, wires and values (docs/systems.md).
  pilotage linearize system.toml --loop pilot.stick=quadcopter.stick

For each --loop, L is the negative transfer function around the loop cut at that connection, so that
1 + L = 0 for the closed loop. The effective delay is that of the crossover model
L = ω_c e^(-τ s)/s with the same crossover and phase.
FMUs are linearised by their directional derivatives. Without these, FMUs for model exchange are
linearised by differences, and FMUs for co-simulation by their responses to pulses of length --step, if
they can restore a saved state. Pilot and vehicle files are linearised exactly.
Exit codes: 0 done, 1 the coupled system is unstable (with --in-steps: the stepped one), or an FMU
failed or cannot be linearised, 2 bad use or input.";

/// Arguments of `pilotage linearize`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    wiring: Wiring,
    /// Start time [s].
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.0,
        value_parser = number,
        allow_hyphen_values = true
    )]
    start_time: f64,
    /// Time of the linearisation [s] [default: the start time].
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_hyphen_values = true)]
    at: Option<f64>,
    /// Communication step until then [s]; must divide the time. Also the step of the pulses with which FMUs without
    /// derivatives are linearised [default: 1].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    step: Option<f64>,
    /// Connection at which the loop is cut open; may be repeated.
    #[arg(long = "loop", value_name = "INSTANCE.OUTPUT=INSTANCE.INPUT", value_parser = pair)]
    loops: Vec<(String, String)>,
    /// Also report poles and loops of a co-simulation with Jacobi's scheme and steps of this length [s].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    in_steps: Option<f64>,
    /// Write the matrices as a script for Matlab and Octave.
    #[arg(long, value_name = "FILE")]
    matlab: Option<PathBuf>,
    /// Write the matrices [A B; C D] as a table with names.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Print the matrices A, B, C and D first.
    #[arg(long)]
    matrices: bool,
    /// Write a page with verdict, poles, and Bode and Nyquist plots of the loops.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object, with matrices and responses, instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Results of the linearised system, in continuous time or in steps.
pub struct View {
    /// Communication step \[s\]; `None` in continuous time.
    pub step: Option<f64>,
    /// Modes of the coupled system.
    pub modes: Vec<Mode>,
    /// Each requested loop with its connection.
    pub loops: Vec<(String, Loop)>,
    /// Whether some connections count as constant, so that the verdict is not that of the whole system.
    pub is_part: bool,
}

impl View {
    fn verdict(&self) -> Verdict {
        Verdict::of(&self.modes)
    }

    fn in_steps(&self) -> String {
        (self.step).map_or_else(String::new, |step| format!(", in steps of {step} s"))
    }

    /// The verdict as a sentence.
    fn words(&self) -> String {
        let part = match self.is_part {
            true => ", apart from the connections that count as constant",
            false => "",
        };
        self.verdict().words(&self.modes, &(self.in_steps() + part))
    }
}

/// Notes on a linearization.
fn notes(linearization: &Linearization) -> Vec<String> {
    let constant = linearization.constant.iter();
    let constant = constant.map(|wire| {
        format!(
            "`{wire}` carries no continuous real and counts as constant: poles and verdict are those of the system \
             without what it does, for which there is `pilotage cosim`"
        )
    });
    constant
        .chain(linearization.notes.iter().cloned())
        .collect()
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let clock = args.clock()?;
    let Built {
        system,
        tables,
        description,
        files,
        notes: read,
    } = args.wiring.build(&args.overwrite, &[], &args.outputs())?;
    let of_tables = tables.iter().flat_map(|table| table.notes(&clock));
    for note in read.into_iter().chain(of_tables) {
        terminal::note(&note);
    }
    // Nothing is recorded: with this interval no row is ever due.
    let mut series = SeriesRecorder::default();
    let mut recorder = Thinned::new(&mut series, None, u64::MAX);
    let (run, linearization) = linearize(system, &clock, None, Algorithm::Jacobi, &mut recorder)
        .map_err(|error| system::explain(error, &description))?;
    // An FMU may have changed the working folder.
    crate::atomic_file::go_back();
    let Some(linearization) = linearization else {
        let ending = ending::Words::of(&run);
        let message = ending.message.unwrap_or_default();
        terminal::say(ending.severity, &message);
        return Ok(Outcome::No);
    };
    let coupled = linearization.coupled()?;
    let views = args.views(&linearization, &coupled)?;
    if let Some(path) = &args.report {
        overwrite::save(
            path,
            args.page(run.time, &views, &notes(&linearization), &files),
        )?;
    }
    args.write(&coupled)?;
    terminal::print(&match args.json {
        true => format!(
            "{:#}\n",
            files::json(run.time, &coupled, &views, &linearization)
        ),
        false => {
            let matrices = args.matrices.then_some(&coupled);
            text::summary(run.time, &coupled, matrices, &views, &linearization)
        }
    })?;
    let outcome = match views.iter().any(|view| view.verdict() == Verdict::Unstable) {
        true => Outcome::No,
        false => Outcome::Done,
    };
    cosim::end(run.components, outcome);
    Ok(outcome)
}

impl Args {
    fn clock(&self) -> Result<Clock, Failure> {
        let at = self.at.unwrap_or(self.start_time);
        match self.step {
            // The step then only tells FMUs which step may be requested.
            step if at == self.start_time => Ok(Clock::standing(at, step.unwrap_or(1.0))?),
            Some(step) => Ok(Clock::new(self.start_time, at, step)?),
            None => Err(Failure::new(format!(
                "--step is missing, to come to {at} s"
            ))),
        }
    }

    /// The output files.
    fn outputs(&self) -> Vec<(&Path, OutputKind)> {
        [
            (&self.matlab, OutputKind::Matlab),
            (&self.csv, OutputKind::Matrices),
            (&self.report, OutputKind::Page),
        ]
        .into_iter()
        .filter_map(|(path, kind)| Some((path.as_deref()?, kind)))
        .collect()
    }

    fn views(
        &self,
        linearization: &Linearization,
        coupled: &StateSpace,
    ) -> Result<Vec<View>, Failure> {
        let is_part = !linearization.constant.is_empty();
        let mut views = vec![View {
            is_part,
            step: None,
            modes: Mode::of_poles(&coupled.poles()),
            loops: self.loops(linearization, |wire| linearization.loop_at(wire))?,
        }];
        if let Some(step) = self.in_steps {
            views.push(View {
                is_part,
                step: Some(step),
                modes: Mode::of_poles(&linearization.poles_in_steps(step)?),
                loops: self.loops(linearization, |wire| {
                    linearization.loop_in_steps(wire, step)
                })?,
            });
        }
        Ok(views)
    }

    fn loops(
        &self,
        linearization: &Linearization,
        at: impl Fn(usize) -> Result<Loop, crate::cosim::LinearizeError>,
    ) -> Result<Vec<(String, Loop)>, Failure> {
        let one = |(from, to): &(String, String)| {
            let wire = linearization.wire(from, to)?;
            Ok((format!("{from}={to}"), at(wire)?))
        };
        self.loops.iter().map(one).collect()
    }

    /// Writes the matrices to the requested files.
    fn write(&self, coupled: &StateSpace) -> Result<(), Failure> {
        if let Some(path) = &self.matlab {
            overwrite::save(path, files::matlab(coupled))?;
        }
        if let Some(path) = &self.csv {
            overwrite::save(path, files::table(coupled))?;
        }
        Ok(())
    }

    fn page(&self, time: f64, views: &[View], notes: &[String], files: &[PathBuf]) -> String {
        let stability: Vec<Stability> = (views.iter())
            .map(|view| Stability {
                step: view.step,
                modes: &view.modes,
                word: view.verdict().word(),
                words: view.words(),
                class: view.verdict().class(),
            })
            .collect();
        let figures: Vec<LoopFigure> = (views.iter())
            .flat_map(|view| view.loops.iter().map(move |looped| (view, looped)))
            .map(|(view, (connection, looped))| LoopFigure {
                connection,
                step: view.step,
                response: &looped.response,
                margins: &looped.margins,
            })
            .collect();
        loop_page(&LoopPage {
            time,
            stability: &stability,
            loops: &figures,
            notes,
            files: &with_sums(files),
            made: &made(),
        })
    }
}
