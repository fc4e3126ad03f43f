//! The problem file of a landing.

use super::helicopter::Helicopter;
use super::pilot::Pilot;
use super::point::Settings;
use pilotage_estimation::ProblemError;
use std::fmt::Write;

/// Weight of the squared steps of the controls (relative to their limits): S is flat in them.
const REGULARISE: f64 = 1e-3;

/// The problem of all points; their initial states and first controls differ.
pub(super) fn problem(
    helicopter: &Helicopter,
    pilot: Option<&Pilot>,
    settings: &Settings,
) -> Result<String, ProblemError> {
    let trim = helicopter.trim(1000.0, 0.0).ok_or_else(|| {
        ProblemError::Part("the helicopter cannot hover out of ground effect: it has no trim; check its mass and rotor".into())
    })?;
    let Settings {
        touch_down: [sink, fast],
        cz: [low, high, rate],
        alpha: [tilt, tilt_rate],
        rotor: [slowest, fastest],
        intervals,
        ..
    } = *settings;
    let omega = trim.states[helicopter.places()[3]];
    let set: Vec<String> = helicopter
        .set
        .iter()
        .map(|(name, value)| format!("{name} = {value:?}"))
        .collect();
    let mut text = format!(
        "[system.helicopter]\nmodel = \"helicopter\"\nset = {{ {} }}\n",
        set.join(", ")
    );
    // Rates are those of the rotor's controls: a pilot's command may jump, and what the pilot makes of it does not.
    let limited = |rate: f64, first: f64| match pilot {
        None => format!("rate = {rate:?}\nfirst = {first:?}\n"),
        Some(_) => String::new(),
    };
    let commands = match pilot {
        None => ["helicopter.cz", "helicopter.alpha"],
        Some(_) => {
            text += "[system.hand]\nmodel = \"hand\"\n[connect]\n\"hand.cz\" = \"helicopter.cz\"\n\
                     \"hand.alpha\" = \"helicopter.alpha\"\n";
            ["hand.cz_command", "hand.alpha_command"]
        }
    };
    let _ = write!(
        text,
        "[[control]]\nsignal = \"{}\"\nmin = {low:?}\nmax = {high:?}\n{}\
         [[control]]\nsignal = \"{}\"\nmin = {:?}\nmax = {tilt:?}\n{}\
         [objective]\nminimise = \"max(final(helicopter.w) / {sink:?}, abs(final(helicopter.u)) / {fast:?})\"\nregularise = {:?}\n\
         [horizon]\nduration = {{ start = 4, min = 0.02, max = 120 }}\nintervals = {intervals}\n\
         [final]\n\"helicopter.h\" = 0\n\
         [[constraint]]\nexpression = \"helicopter.h\"\nmin = 0\n\
         [[constraint]]\nexpression = \"helicopter.omega\"\nmin = {:?}\nmax = {:?}\n",
        commands[0],
        limited(rate, trim.cz.clamp(low, high)),
        commands[1],
        -tilt,
        limited(tilt_rate, 0.0),
        REGULARISE,
        slowest * omega,
        fastest * omega,
    );
    if pilot.is_some() {
        let _ = write!(
            text,
            "[[constraint]]\nexpression = \"helicopter.cz\"\nmin = {low:?}\nmax = {high:?}\n\
             [[constraint]]\nexpression = \"helicopter.alpha\"\nmin = {:?}\nmax = {tilt:?}\n",
            -tilt
        );
    }
    Ok(text)
}
