//! The cases of a map: without and with the pilot, for each value of the helicopter's parameters and each delay.

use super::kept::Kept;
use super::numbers::Delay;
use super::{Args, Outlook};
use crate::cli::Failure;
use crate::control::hv::{Column, Grid, Helicopter, Landings, Map, Pilot, Settings, joined, map};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// A case.
pub struct Case {
    /// Its name in files.
    pub name: String,
    /// Whether the pilot is in the loop.
    pub has_pilot: bool,
    /// The helicopter's parameters that differ from the model's.
    pub set: Vec<(String, f64)>,
    /// When the pilot reacts.
    pub delay: Delay,
}

/// A pilot, and others that are as likely by the covariance of its fit.
pub struct Hands {
    pub pilot: Pilot,
    pub drawn: Vec<Pilot>,
}

/// All combinations of the values of parameters.
fn combinations(args: &Args) -> Vec<Vec<(String, f64)>> {
    let mut all = vec![Vec::new()];
    for own in &args.set {
        let with = |set: &Vec<(String, f64)>| {
            let one = |value: &f64| [&set[..], &[(own.name.clone(), *value)]].concat();
            own.values.iter().map(one).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    all
}

/// All cases, those with the pilot last.
pub fn all(args: &Args, has_pilot: bool) -> Vec<Case> {
    let families = combinations(args);
    let varied = |name: &str| {
        args.set
            .iter()
            .any(|own| own.name == name && own.values.len() > 1)
    };
    let mut cases = Vec::new();
    for has_pilot in if has_pilot {
        vec![false, true]
    } else {
        vec![false]
    } {
        for set in &families {
            for delay in &args.delay {
                let mut name = match has_pilot {
                    true => "with the pilot".to_owned(),
                    false => "without a pilot".to_owned(),
                };
                for (own, value) in set.iter().filter(|(name, _)| varied(name)) {
                    name += &format!("; {own} = {value}");
                }
                if args.delay.len() > 1 {
                    name += &format!("; {delay}");
                }
                cases.push(Case {
                    name,
                    has_pilot,
                    set: set.clone(),
                    delay: *delay,
                });
            }
        }
    }
    cases
}

/// The settings of all landings.
pub fn settings(args: &Args) -> Settings {
    Settings {
        touch_down: [args.sink, args.run_on],
        alpha: [args.tilt.to_radians(), Settings::default().alpha[1]],
        runs_down: args.runs_down,
        intervals: usize::from(args.intervals),
        ..Settings::default()
    }
}

/// Whether a helicopter is named like the built-in one, and there is no file of that name.
pub fn is_built_in(file: &Path) -> bool {
    file == Path::new("helicopter") && !file.exists()
}

/// The helicopter with these values of its parameters.
pub fn helicopter(args: &Args, set: &[(String, f64)]) -> Result<Helicopter, Failure> {
    let own = match &args.helicopter {
        Some(file) if !is_built_in(file) => Helicopter::read(file, set)?,
        _ => Helicopter::built_in(set)?,
    };
    if args.runs_down && !own.runs_down() {
        let message = "--runs-down: the helicopter's model has no state `engine` that fades";
        return Err(Failure::new(message).hint("`pilotage models show helicopter` has one"));
    }
    Ok(own)
}

/// The landings of a case.
pub fn landings(args: &Args, case: &Case, hands: Option<&Hands>) -> Result<Landings, Failure> {
    let hands = hands.filter(|_| case.has_pilot);
    let pilot = hands.map(|own| own.pilot.clone());
    let own = Landings::new(helicopter(args, &case.set)?, pilot, settings(args))?;
    Ok(match hands {
        Some(hands) => own.with_draws(hands.drawn.clone())?,
        None => own,
    })
}

/// The map of a case; None if it was stopped.
pub fn computed(
    case: &Case,
    landings: &Landings,
    grid: &Grid,
    kept: &mut Kept,
    outlook: &Outlook<'_>,
) -> Result<Option<Map>, Failure> {
    let [below, above] = match case.delay {
        Delay::Everywhere(delay) => {
            return of_delay(&case.name, delay, landings, grid, kept, outlook);
        }
        Delay::ByKnee(delays) => delays,
    };
    let Some(above) = of_delay(&case.name, above, landings, grid, kept, outlook)? else {
        return Ok(None);
    };
    // Where nothing begins above safe heights, no height parts the delays.
    let Some([_, height]) = above.knee else {
        return Ok(Some(above));
    };
    let mut heights = grid.heights.clone();
    heights.truncate(1 + heights.partition_point(|own| *own < height));
    let speeds = grid.speeds.clone();
    let low = Grid { heights, speeds };
    let below = of_delay(&case.name, below, landings, &low, kept, outlook)?;
    Ok(below.map(|below| joined(&below, &above, height)))
}

fn of_delay(
    name: &str,
    delay: f64,
    landings: &Landings,
    grid: &Grid,
    kept: &mut Kept,
    outlook: &Outlook<'_>,
) -> Result<Option<Map>, Failure> {
    let key = format!("{name}; {delay:?}");
    let known: Vec<Column> = kept.columns(&key);
    let written = Mutex::new((kept, None));
    let done = |column: &Column| {
        (outlook.done)();
        let mut written = written.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(failure) = written.0.add(&key, column) {
            written.1 = Some(failure);
        }
    };
    let found = map(landings, grid, delay, &known, &done, outlook.stop);
    match written.into_inner().unwrap_or_else(PoisonError::into_inner) {
        (_, Some(failure)) => Err(failure),
        (_, None) => Ok(found),
    }
}
