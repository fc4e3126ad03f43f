//! `pilotage fit`: the pilot from recorded flights.

mod summary;

use super::progress::Progress;
use super::{Failure, Outcome, terminal, vehicle};
use crate::identification::solve::MAX_ORDER;
use crate::identification::{
    Fit, InitialState, Mesh, Objective, Options, RunFit, Trial, TrialSet, fit, pilot_file,
};
use crate::models::Pilot;
use crate::output::Output;
use crate::report::{self, Report};
use crate::transcription::Scheme;
use crate::vehicle::PitchLoop;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};
use summary::{Flown, to_json, to_text};

/// Arguments of `pilotage fit`; the defaults are those of [`Options`].
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Trials (CSV) or manifests (TOML).
    #[arg(required = true)]
    trials: Vec<PathBuf>,
    /// The pilot file to write.
    #[arg(short, long, default_value = "pilot.toml")]
    output: PathBuf,
    /// Collocation scheme; `euler` is the paper's.
    #[arg(long, default_value_t = Options::default().scheme)]
    scheme: Scheme,
    /// Length of the mesh's intervals, about; the samples are the mesh where it is missing.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    mesh_step: Option<f64>,
    /// What is known of the states at the first sample; `free` is the paper's.
    #[arg(long, value_parser = named(InitialState::ALL, InitialState::as_str),
          default_value = Options::default().initial_state.as_str())]
    initial_state: InitialState,
    /// What is compared with the recording: the vehicle's response (the paper's), or the stick.
    #[arg(long, value_parser = named(Objective::ALL, Objective::as_str),
          default_value = Options::default().objective.as_str())]
    objective: Objective,
    /// Where θ starts, as θ1,θ2,...; estimated from the data where it is missing.
    #[arg(
        long,
        value_name = "t1,t2,...",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    start: Option<Vec<f64>>,
    /// The vehicle that was flown (TOML); the default vehicle where it is missing.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Order n of the pilot, which then has 2n parameters.
    #[arg(long, default_value_t = Options::default().pilot.order as u8,
          value_parser = clap::value_parser!(u8).range(1..=MAX_ORDER as i64))]
    order: u8,
    /// Limit on |y_p| at every sample.
    #[arg(long, default_value_t = Options::default().stick_limit, value_parser = positive)]
    stick_limit: f64,
    /// Iteration limit.
    #[arg(long, default_value_t = Options::default().max_iterations)]
    max_iterations: usize,
    /// Scaled KKT residual at which the solve has converged.
    #[arg(long, default_value_t = Options::default().tolerance, value_parser = positive)]
    tolerance: f64,
    /// Write a report page (HTML) too.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object instead of the summary.
    #[arg(long)]
    json: bool,
}

/// A parser for one of `all`, by its name.
fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(name)).try_map(move |given| {
        let found = all.into_iter().find(|&value| name(value) == given);
        found.ok_or_else(|| format!("{given} is not one of the names"))
    })
}

/// A finite number above zero.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number above 0".into()),
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let options = args.options()?;
    let set = TrialSet::read(&args.trials)?;
    let pilot_output = open(&args.output)?;
    let report_output = args.report.as_deref().map(open).transpose()?;

    let mut progress = Progress::new();
    let fitted = fit(&set.fit, &options, &mut |iteration| {
        progress.show(iteration)
    });
    progress.clear();
    let fitted = fitted?;

    save(
        pilot_output,
        &args.output,
        &pilot_file::to_toml(&fitted, &options, &set.fit),
    )?;
    let flown = Flown::all(&fitted, &options, &set)?;
    if let (Some(output), Some(path)) = (report_output, &args.report) {
        save(output, path, &page(&fitted, &options, &set.fit, &flown))?;
    }
    terminal::print(&match args.json {
        true => format!("{:#}\n", to_json(&fitted, &options, &flown)),
        false => to_text(&fitted, &options, &flown) + &args.next(&fitted, &options),
    })?;
    Ok(match fitted.converged {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

impl Args {
    fn options(&self) -> Result<Options, Failure> {
        let pilot = Pilot {
            order: self.order.into(),
        };
        let vehicle = vehicle::resolve(self.vehicle.as_deref())?;
        if !PitchLoop::of(&vehicle).is_stable() {
            terminal::note(
                "the vehicle's pitch loop is unstable, so nobody can have flown it; see `pilotage vehicle check`",
            );
        }
        Ok(Options {
            scheme: self.scheme,
            mesh: self.mesh_step.map_or(Mesh::Samples, Mesh::Step),
            initial_state: self.initial_state,
            objective: self.objective,
            pilot,
            vehicle,
            start: self.start.clone(),
            stick_limit: self.stick_limit,
            tolerance: self.tolerance,
            max_iterations: self.max_iterations,
        })
    }

    /// What was written, and what to type next.
    fn next(&self, fit: &Fit, options: &Options) -> String {
        let pilot = self.output.display();
        let mut text = format!("\nwrote {pilot}\n");
        if let Some(report) = &self.report {
            text += &format!("wrote {}\n", report.display());
        }
        text + &match fit.converged {
            true => format!("next: pilotage export pilot {pilot} -o pilot.fmu\n"),
            false => what_else(options),
        }
    }
}

/// What may help a solve that did not converge.
fn what_else(options: &Options) -> String {
    let mut text = String::from("next: this is the best iterate, not a result; try\n");
    if options.initial_state == InitialState::Free {
        text += "      --initial-state vehicle-at-rest, if the vehicle hovered before each run\n";
    }
    text += "      --start with other values of θ\n";
    text + &format!("      --max-iterations above {}\n", options.max_iterations)
}

/// The report page of a fit alone.
fn page(fit: &Fit, options: &Options, trials: &[Trial], flown: &[Flown]) -> String {
    let flown: Vec<RunFit> = flown.iter().map(|flown| flown.run.clone()).collect();
    let words = std::env::args_os().skip(1);
    let command: Vec<String> = words
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    report::page(&Report {
        fit,
        options,
        trials,
        flown: &flown,
        loops: &[],
        command: &format!("pilotage {}", command.join(" ")),
    })
}

/// Opens an output before the work.
fn open(path: &Path) -> Result<Output, Failure> {
    Output::create(path).map_err(|error| cannot_write(path, &error))
}

fn save(output: Output, path: &Path, content: &str) -> Result<(), Failure> {
    (output.save(content.as_bytes())).map_err(|error| cannot_write(path, &error))
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(format!("cannot write {}: {error}", path.display()))
}
