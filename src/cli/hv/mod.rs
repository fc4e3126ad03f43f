//! `pilotage hv`: the height–velocity map of a helicopter after power loss, with a pilot in the loop.

mod kept;
mod page;

use super::deadline::Deadline;
use super::progress::Counter;
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, folder, interrupt, number, overwrite, terminal};
use crate::control::hv::{Class, Column, Grid, Helicopter, Landings, Map, Pilot, Settings, map};
use crate::cosim::SystemDescription;
use crate::flights;
use kept::Kept;
use page::Shown;
use pilotage_text::counted;
use std::path::PathBuf;
use std::sync::Mutex;

const EXAMPLES: &str = "\
Examples:
  # The built-in helicopter, with power gone and a second until the pilot reacts.
  pilotage hv -o hv

  # With a pilot that was identified, over the map without one; half a second of recognition.
  pilotage hv --pilot pilot.toml --delay 0.5 -o hv

  # Heavier, thinner air, a coarse grid.
  pilotage hv --set mass=1500 --set density=1.0 --speeds 0:24:3 --heights 2:150:12 -o hot

A point is safe if a flight that lands within the limits was found and integrated again, unsafe if all starts
converged to landings beyond them, unknown otherwise: a local solver's failure proves nothing. The boundary is that
of optimal control with perfect knowledge. It lies inside any certified one, and is no flight limitation: docs/hv.md.
The folder has hv.html, hv.svg, map.csv, boundary.csv and hv.json; a run that was stopped goes on from there.
Exit codes: 0 done, 1 stopped, 2 bad use or input.";

/// Arguments of `pilotage hv`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Model file of the helicopter, with the inputs and states of the built-in one (`pilotage models show helicopter`).
    #[arg(value_name = "HELICOPTER")]
    helicopter: Option<PathBuf>,
    /// Pilot between command and rotor: a pilot file, a model file, an FMU or the name of a built-in pilot, linearised and
    /// with its static gain divided out.
    #[arg(long, value_name = "PILOT")]
    pilot: Option<String>,
    /// Time until the pilot reacts, in which the controls stay as in trim [s]: recognition alone, since a pilot's own lag
    /// is in the pilot.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = delay, allow_hyphen_values = true)]
    delay: f64,
    /// Speeds [m/s]: first, last, and the step.
    #[arg(long, value_name = "FIRST:LAST:STEP", default_value = "0:30:1.5", value_parser = speeds)]
    speeds: Numbers,
    /// Heights [m]: lowest and highest, and how many, at equal ratios.
    #[arg(long, value_name = "LOW:HIGH[:COUNT]", default_value = "1:200:24", value_parser = heights)]
    heights: Numbers,
    /// Parameter of the helicopter: NAME=VALUE.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting)]
    set: Vec<(String, f64)>,
    /// Largest sink rate at touch-down [m/s].
    #[arg(long, value_name = "SPEED", default_value_t = 2.4, value_parser = number::positive, allow_hyphen_values = true)]
    sink: f64,
    /// Largest speed over the ground at touch-down [m/s].
    #[arg(long, value_name = "SPEED", default_value_t = 15.0, value_parser = number::positive, allow_hyphen_values = true)]
    run_on: f64,
    /// Largest tilt of the rotor [deg].
    #[arg(long, value_name = "ANGLE", default_value_t = 30.0, value_parser = number::positive, allow_hyphen_values = true)]
    tilt: f64,
    /// The engine runs down from trim's power with the helicopter's `fading`, instead of failing at once.
    #[arg(long)]
    runs_down: bool,
    /// Intervals of each landing.
    #[arg(long, value_name = "COUNT", default_value_t = 50, value_parser = clap::value_parser!(u16).range(10..=500))]
    intervals: u16,
    /// Axes in metres and metres per second, instead of feet and knots.
    #[arg(long)]
    si: bool,
    /// Folder to write.
    #[arg(long, short, value_name = "FOLDER", default_value = "hv")]
    output: PathBuf,
    /// Write into a folder that has other files.
    #[arg(long)]
    force: bool,
    /// Stop after this time [s]; the columns that are done are kept.
    #[arg(long, value_name = "SECONDS", value_parser = number::positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    /// Print hv.json, too.
    #[arg(long)]
    json: bool,
}

/// A list of numbers as one argument.
#[derive(Debug, Clone, PartialEq)]
struct Numbers(Vec<f64>);

fn parts(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        part.trim()
            .parse()
            .ok()
            .filter(|value: &f64| value.is_finite())
    };
    let all: Option<Vec<f64>> = text.split(':').map(number).collect();
    all.ok_or_else(|| "expected numbers with colons between them".to_owned())
}

/// Most speeds, and most heights.
const MOST: usize = 500;

fn speeds(text: &str) -> Result<Numbers, String> {
    match parts(text)?[..] {
        [first, last, step] if first >= 0.0 && last >= first && step > 0.0 => {
            let count = ((last - first) / step + 1e-9) as usize;
            match count < MOST {
                true => Ok(Numbers(
                    (0..=count).map(|k| first + step * k as f64).collect(),
                )),
                false => Err(format!("at most {MOST} speeds")),
            }
        }
        [only] if only >= 0.0 => Ok(Numbers(vec![only])),
        _ => Err("expected FIRST:LAST:STEP, from 0 up".to_owned()),
    }
}

fn heights(text: &str) -> Result<Numbers, String> {
    let numbers = parts(text)?;
    let (low, high, count) = match numbers[..] {
        [low, high] => (low, high, 24.0),
        [low, high, count] => (low, high, count),
        _ => return Err("expected LOW:HIGH or LOW:HIGH:COUNT".to_owned()),
    };
    if !(low > 0.0 && high > low && count >= 2.0 && count <= MOST as f64 && count.fract() == 0.0) {
        return Err(format!(
            "expected 0 < LOW < HIGH, and a COUNT from 2 to {MOST}"
        ));
    }
    let ratio = |k: usize| (high / low).powf(k as f64 / (count - 1.0));
    Ok(Numbers(
        (0..count as usize).map(|k| low * ratio(k)).collect(),
    ))
}

fn delay(text: &str) -> Result<f64, String> {
    let value = number::number(text)?;
    match value >= 0.0 && value.is_finite() {
        true => Ok(value),
        false => Err("expected a finite number, 0 or more".to_owned()),
    }
}

fn setting(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    let value = value
        .trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite());
    let value = value.ok_or_else(|| format!("`{name}` needs a number"))?;
    Ok((name.trim().to_owned(), value))
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    if let Some(file) = &args.helicopter {
        recognise::expect([file], &[FileKind::Model], "a model file of a helicopter")?;
    }
    let helicopter = match &args.helicopter {
        Some(file) => Helicopter::read(file, &args.set)?,
        None => Helicopter::built_in(&args.set)?,
    };
    let pilot = args.pilot.as_deref().map(pilot).transpose()?;
    let settings = Settings {
        touch_down: [args.sink, args.run_on],
        alpha: [args.tilt.to_radians(), Settings::default().alpha[1]],
        runs_down: args.runs_down,
        intervals: usize::from(args.intervals),
        ..Settings::default()
    };
    let grid = Grid {
        heights: args.heights.0.clone(),
        speeds: args.speeds.0.clone(),
    };
    let mut kept = Kept::open(args, &helicopter, pilot.as_ref())?;
    if !kept.is_resumed() {
        folder::create_new(&args.output, args.force)?;
    }
    let mut cases = vec![("without a pilot", None)];
    cases.extend(pilot.map(|own| ("with the pilot", Some(own))));
    interrupt::listen("stopping; the columns that are done are kept")?;
    let deadline = Deadline::after(args.time_limit);
    let stop = || deadline.ask().is_break();
    let left = cases.len() * grid.speeds.len() - kept.count();
    let counter = Counter::new("speeds", left as u64);
    let mut shown = Vec::new();
    for (name, pilot) in cases {
        let gain = pilot
            .as_ref()
            .map(|own: &Pilot| own.axes.each_ref().map(|axis| axis.gain));
        let landings = Landings::new(helicopter.clone(), pilot, settings.clone())?;
        let known: Vec<Column> = kept.columns(name);
        let failed = Mutex::new(None);
        let written = Mutex::new(&mut kept);
        let done = |column: &Column| {
            counter.count();
            let mut kept = written
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            if let Err(failure) = kept.add(name, column) {
                *failed
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner) = Some(failure);
            }
        };
        let found = map(&landings, &grid, args.delay, &known, &done, &stop);
        if let Some(failure) = failed
            .into_inner()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
        {
            return Err(failure);
        }
        let Some(found) = found else {
            counter.clear();
            let count = kept.count();
            terminal::note(&format!(
                "stopped: {} kept in {}; the same command goes on",
                counted(count, "column"),
                terminal::shown(&args.output)
            ));
            return Ok(Outcome::No);
        };
        shown.push(Shown {
            name,
            gain,
            map: found,
        });
    }
    counter.clear();
    write(args, &shown)?;
    kept.remove();
    Ok(Outcome::Done)
}

/// The pilot of a file or of a name, as a linear system.
fn pilot(source: &str) -> Result<Pilot, Failure> {
    let text = format!("[system.pilot]\nmodel = {}\n", toml::Value::from(source));
    let system = SystemDescription::parse(&text, std::path::Path::new(""))?;
    let part = flights::open(&system.instances[0])?;
    Ok(Pilot::of(&part, source)?)
}

/// Writes all files of the folder, and the summary.
fn write(args: &Args, shown: &[Shown<'_>]) -> Result<(), Failure> {
    let save = |file: &str, content: String| overwrite::save(&args.output.join(file), content);
    let json = format!("{:#}\n", page::to_json(args, shown));
    save("map.csv", page::points(shown))?;
    save("boundary.csv", page::boundary(shown))?;
    save("hv.json", json.clone())?;
    let figure = page::figure(args, shown);
    save("hv.svg", crate::report::svg::to_svg(&figure, 170.0))?;
    save("hv.html", page::html(args, shown, &figure))?;
    terminal::print(&match args.json {
        true => json,
        false => page::to_text(args, shown),
    })
}

/// Numbers of safe, unsafe and unknown points.
fn counts(map: &Map) -> [usize; 3] {
    let classes = [Class::Safe, Class::Unsafe, Class::Unknown];
    let cells = || map.columns.iter().flat_map(|own| &own.cells);
    classes.map(|class| cells().filter(|own| own.class == class).count())
}
