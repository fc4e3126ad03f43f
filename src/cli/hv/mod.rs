//! `pilotage hv`: the height–velocity map of a helicopter after power loss, with a pilot in the loop.

mod cases;
mod figure;
mod kept;
mod landing;
mod numbers;
mod overlay;
mod page;

use super::deadline::Deadline;
use super::progress::Counter;
use super::recognise::{self, FileKind};
use super::system::flags;
use super::{Failure, Outcome, folder, interrupt, number, overwrite, terminal};
use crate::control::hv::{Class, Grid, Landings, Map, Pilot};
use crate::flights;
use cases::Hands;
use kept::Kept;
use numbers::{Delay, Numbers, Setting};
use overlay::Curve;
use page::Shown;
use pilotage_text::counted;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  # The built-in helicopter, with power gone and a second until the pilot reacts.
  pilotage hv -o hv

  # With a pilot that was identified, over the map without one; half a second of recognition. With the band of what its fit
  # does not know, if the file has a covariance.
  pilotage hv --pilot pilot.toml --delay 0.5 -o hv

  # Families: three weights; five delays. Thinner air, a coarse grid, a flight manual's curve over it.
  pilotage hv --set mass=1200,1360,1500 --set density_altitude=1500 -o weights
  pilotage hv --delay 0,0.3,0.5,1,2 --speeds 0:24:3 --heights 2:150:12 --overlay manual.csv -o delays

  # The landing from 9 m/s at 15 m as a flight, and as FMUs that repeat it.
  pilotage hv --pilot pilot.toml --delay 0.5 --at 9:15 -o landing

A point is safe if a flight that lands within the limits was found and integrated again, unsafe if all starts
converged to landings beyond them, unknown otherwise: a local solver's failure proves nothing. The boundary is that
of optimal control with perfect knowledge. It lies inside any certified one, and is no flight limitation: docs/hv.md.
The folder has hv.html, hv.svg, hv.png, map.csv, boundary.csv and hv.json; a run that was stopped goes on from there.
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
    /// is in the pilot. Two with a slash: below the height of the knee, and above it. Several with commas: a map for each.
    #[arg(long, value_name = "SECONDS", default_value = "0.3/1", value_delimiter = ',', value_parser = numbers::delay, allow_hyphen_values = true)]
    delay: Vec<Delay>,
    /// Speeds [m/s]: first, last, and the step.
    #[arg(long, value_name = "FIRST:LAST:STEP", default_value = "0:30:1.5", value_parser = numbers::speeds)]
    speeds: Numbers,
    /// Heights [m]: lowest and highest, and how many, at equal ratios.
    #[arg(long, value_name = "LOW:HIGH[:COUNT]", default_value = "1:200:24", value_parser = numbers::heights)]
    heights: Numbers,
    /// Landings from these points [m/s, m] instead of a map: each as a flight, and as FMUs with a system file that repeats it.
    #[arg(long, value_name = "SPEED:HEIGHT", value_delimiter = ',', value_parser = numbers::point)]
    at: Vec<[f64; 2]>,
    /// Parameter of the helicopter: NAME=VALUE, or several values for a map of each.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = numbers::setting)]
    set: Vec<Setting>,
    /// Number of pilots that are drawn from the covariance of the fit, for the band of the boundary; 0 for none.
    #[arg(long, value_name = "COUNT", default_value_t = 20, value_parser = clap::value_parser!(u16).range(0..=1000))]
    draws: u16,
    /// A curve to draw over the map, such as a flight manual's: CSV with the columns `speed [kn]` and `height [ft]`, in any units.
    #[arg(long, value_name = "FILE")]
    overlay: Vec<PathBuf>,
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

/// Most cases of a map.
const MOST_CASES: usize = 24;

/// Who is told of columns that are done, and who may stop.
pub struct Outlook<'a> {
    done: &'a (dyn Fn() + Sync),
    stop: &'a (dyn Fn() -> bool + Sync),
}

/// Runs the command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    if let Some(k) = (1..args.set.len()).find(|k| {
        args.set[..*k]
            .iter()
            .any(|own| own.name == args.set[*k].name)
    }) {
        let name = &args.set[k].name;
        let message = format!("--set gives `{name}` twice");
        return Err(Failure::new(message).hint(format!(
            "several values for a map of each: --set {name}=1,2"
        )));
    }
    if let Some(file) = args
        .helicopter
        .as_ref()
        .filter(|file| !cases::is_built_in(file))
    {
        recognise::expect([file], &[FileKind::Model], "a model file of a helicopter")?;
    }
    let hands = args
        .pilot
        .as_deref()
        .map(|own| pilot(own, args.draws))
        .transpose()?;
    let cases = cases::all(args, hands.is_some());
    if cases.len() > MOST_CASES {
        let message = format!("{} maps in one figure; at most {MOST_CASES}", cases.len());
        return Err(Failure::new(message).hint("give --set and --delay fewer values"));
    }
    let overlays = overlay::read(&args.overlay)?;
    if !args.at.is_empty() {
        return landing::run(args, &cases, hands.as_ref());
    }
    let grid = Grid {
        heights: args.heights.0.clone(),
        speeds: args.speeds.0.clone(),
    };
    // All helicopters are read before anything is written.
    let landings = cases
        .iter()
        .map(|own| cases::landings(args, own, hands.as_ref()));
    let landings: Vec<Landings> = landings.collect::<Result<_, _>>()?;
    let mut kept = Kept::open(args, landings[0].helicopter(), hands.as_ref())?;
    if !kept.is_resumed() {
        let created = folder::create_new(&args.output, args.force);
        created.map_err(|failure| match kept.is_of_others() {
            true => failure.hint("a run with other settings was stopped in it; the same settings go on, --force begins anew"),
            false => failure,
        })?;
    }
    interrupt::listen("stopping; the columns that are done are kept")?;
    let deadline = Deadline::after(args.time_limit);
    let stop = || deadline.ask().is_break();
    let maps: usize = cases.iter().map(|own| own.delay.times().len()).sum();
    let left = (maps * grid.speeds.len()).saturating_sub(kept.count());
    let counter = Counter::new("speeds", left as u64);
    let done = || counter.count();
    let outlook = Outlook {
        done: &done,
        stop: &stop,
    };
    let mut shown = Vec::new();
    for (case, landings) in cases.into_iter().zip(&landings) {
        let Some(map) = cases::computed(&case, landings, &grid, &mut kept, &outlook)? else {
            counter.clear();
            terminal::note(&format!(
                "stopped: {} kept in {}; the same command goes on",
                counted(kept.count(), "column"),
                terminal::shown(&args.output)
            ));
            return Ok(Outcome::No);
        };
        let hands = hands.as_ref().filter(|_| case.has_pilot);
        shown.push(Shown {
            gain: hands.map(|own| own.pilot.axes.each_ref().map(|axis| axis.gain)),
            draws: hands.map_or(0, |own| own.drawn.len()),
            case,
            map,
        });
    }
    counter.clear();
    write(args, &shown, &overlays)?;
    kept.remove();
    Ok(Outcome::Done)
}

/// The pilot of a file or of a name, as a linear system, and those of draws.
fn pilot(source: &str, draws: u16) -> Result<Hands, Failure> {
    let described = flags::described("pilot".into(), flags::model_source(source.into()));
    let part = flights::open(&described)?;
    let pilot = Pilot::of(&part, source)?;
    let drawn = Pilot::drawn(&part, source, usize::from(draws))?;
    Ok(Hands {
        pilot,
        drawn: drawn.unwrap_or_default(),
    })
}

/// Writes all files of the folder, and the summary.
fn write(args: &Args, shown: &[Shown], overlays: &[Curve]) -> Result<(), Failure> {
    let save = |file: &str, content: String| overwrite::save(&args.output.join(file), content);
    let json = format!("{:#}\n", page::to_json(args, shown));
    save("map.csv", page::points(shown))?;
    save("boundary.csv", page::boundary(shown))?;
    save("hv.json", json.clone())?;
    let figure = figure::figure(args, shown, overlays);
    let svg = crate::report::svg::to_svg(&figure, WIDTH);
    match crate::report::png::to_png(&svg, DOTS) {
        Ok(png) => overwrite::save(&args.output.join("hv.png"), png)?,
        Err(error) => terminal::note(&format!("no hv.png: {error}")),
    }
    save("hv.svg", svg)?;
    save("hv.html", page::html(args, shown, &figure))?;
    terminal::print(&match args.json {
        true => json,
        false => page::to_text(args, shown),
    })
}

/// Width of the figure \[mm\], and dots per inch of its PNG.
const WIDTH: f64 = 170.0;
const DOTS: f32 = 200.0;

/// Numbers of safe, unsafe and unknown points.
fn counts(map: &Map) -> [usize; 3] {
    let classes = [Class::Safe, Class::Unsafe, Class::Unknown];
    let cells = || map.columns.iter().flat_map(|own| &own.cells);
    classes.map(|class| cells().filter(|own| own.class == class).count())
}
