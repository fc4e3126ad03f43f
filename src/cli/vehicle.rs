//! `pilotage vehicle`: shows or checks the coefficients of the vehicle.

use super::recognise::{self, FileKind};
use super::{Failure, Outcome, terminal};
use crate::models::{COEFFICIENTS, Quadcopter};
use crate::vehicle::{self, PitchLoop};
use clap::Subcommand;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Arguments of `pilotage vehicle`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the coefficients as a vehicle file (the default vehicle where no file is given).
    Show {
        /// A vehicle file (TOML).
        file: Option<PathBuf>,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Check a vehicle file: ranges, trim, and the poles of the pitch loop; exit code 1 when that loop
    /// is unstable.
    Check {
        /// The vehicle file (TOML).
        file: PathBuf,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    match args.command {
        Command::Show { file, json } => show(file.as_deref(), json),
        Command::Check { file, json } => check(&file, json),
    }
}

/// The vehicle of a `--vehicle FILE` option, or the default one.
pub fn resolve(file: Option<&Path>) -> Result<Quadcopter, Failure> {
    match file {
        Some(file) => read(file),
        None => Ok(Quadcopter::default()),
    }
}

/// Reads a vehicle file.
pub fn read(file: &Path) -> Result<Quadcopter, Failure> {
    recognise::expect(
        [&file.to_owned()],
        &[FileKind::Vehicle],
        "a vehicle file (TOML)",
    )?;
    Ok(vehicle::read(file)?)
}

fn show(file: Option<&Path>, json: bool) -> Result<Outcome, Failure> {
    let vehicle = resolve(file)?;
    match json {
        true => terminal::print(&format!("{:#}\n", Value::Object(coefficients(&vehicle))))?,
        false => terminal::print(&vehicle::to_toml(&vehicle))?,
    }
    Ok(Outcome::Done)
}

fn check(file: &Path, json: bool) -> Result<Outcome, Failure> {
    let vehicle = read(file)?;
    let pitch = PitchLoop::of(&vehicle);
    match json {
        true => terminal::print(&format!("{:#}\n", to_json(&vehicle, &pitch)))?,
        false => terminal::print(&to_text(file, &vehicle, &pitch))?,
    }
    Ok(match pitch.is_stable() {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

/// The coefficients by name.
fn coefficients(vehicle: &Quadcopter) -> Map<String, Value> {
    (COEFFICIENTS.iter())
        .map(|field| (field.name.to_owned(), json!((field.get)(vehicle))))
        .collect()
}

fn to_json(vehicle: &Quadcopter, pitch: &PitchLoop) -> Value {
    let modes: Vec<Value> = (pitch.modes.iter())
        .map(|mode| {
            json!({
                "pole": [mode.pole.re, mode.pole.im],
                "frequency_rad_per_s": mode.frequency,
                "damping": mode.damping,
            })
        })
        .collect();
    json!({
        "coefficients": coefficients(vehicle),
        "hover_thrust_per_motor_N": vehicle.thrust(0.0),
        "hover_throttle_us": hover_throttle(vehicle),
        "pitch_modes": modes,
        "stable": pitch.is_stable(),
    })
}

/// Steady throttle at hover speed, above standstill [µs]: `a ω_0 / b`.
fn hover_throttle(vehicle: &Quadcopter) -> f64 {
    vehicle.propeller_lag * vehicle.hover_speed / vehicle.propeller_gain
}

fn to_text(file: &Path, vehicle: &Quadcopter, pitch: &PitchLoop) -> String {
    let throttle = hover_throttle(vehicle);
    let full_stick = vehicle.gravity * vehicle.max_pitch.sin();
    let mut text = format!(
        "{}: every coefficient is within its range\n\n\
         Trim (hover at any position, all perturbations zero)\n  \
         thrust of each motor      {:.4} N\n  \
         rotor speed               {:.4} krad/s ({:.0} rpm)\n  \
         throttle above standstill {:.0} µs (pulse width {:.0} µs where the motors start at 1000 µs)\n  \
         full stick commands       {:.1}° of pitch, {:.2} m/s² at hover thrust\n\n\
         Pitch loop at hover: s³ + {:.3} s² + {:.3} s + {:.3}\n",
        terminal::shown(file),
        vehicle.thrust(0.0),
        vehicle.hover_speed,
        vehicle.hover_speed * 1e3 * 30.0 / std::f64::consts::PI,
        throttle,
        throttle + 1000.0,
        vehicle.max_pitch.to_degrees(),
        full_stick,
        vehicle.pitch_polynomial()[2],
        vehicle.pitch_polynomial()[1],
        vehicle.pitch_polynomial()[0],
    );
    text += "  pole [1/s]            frequency [rad/s]  damping\n";
    for mode in &pitch.modes {
        text += &super::format::mode(mode);
    }
    text + "\n" + &verdict(vehicle, pitch)
}

/// The last line: whether the vehicle can be flown.
fn verdict(vehicle: &Quadcopter, pitch: &PitchLoop) -> String {
    let (damping, stiffness) = pitch.routh;
    match pitch.is_stable() {
        true => format!(
            "STABLE: propeller_lag · rate_gain = {damping:.4} exceeds attitude_gain = {stiffness:.4}\n"
        ),
        false if stiffness <= 0.0 => {
            "UNSTABLE: attitude_gain is zero, so nothing brings the pitch angle back\n".into()
        }
        false => format!(
            "UNSTABLE: propeller_lag · rate_gain = {damping:.4} must exceed attitude_gain = {stiffness:.4}.\n\
             Nobody can fly this vehicle: raise rate_gain above {:.4}, or lower attitude_gain.\n",
            stiffness / vehicle.propeller_lag
        ),
    }
}
