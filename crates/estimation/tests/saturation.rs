//! A pilot whose stick is at its stops for a part of the flight: `[fit] limits`.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use std::fmt::Write;
use std::ops::ControlFlow;

const PILOT: &str = "[model]\nname = \"pilot\"\n[inputs]\ntarget = 0\nz = 0\nv = 0\n[parameters]\ngain = { start = 0.4, min = 0 }\n\
                     lead = { start = 1, min = 0 }\n[outputs]\n\
                     stick = { value = \"gain * (target - z - lead * v)\", limit = [-1, 1] }\n";
const VEHICLE: &str = "[model]\nname = \"vehicle\"\n[inputs]\nstick = 0\n[states]\nz = { der = \"v\" }\nv = { der = \"4 * stick\" }\n";
const PROBLEM: &str = "[system.pilot]\nmodel = \"pilot.toml\"\n[system.vehicle]\nmodel = \"vehicle.toml\"\n[connect]\n\
                       \"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.z\"\n\"vehicle.v\" = \"pilot.v\"\n[inputs]\n\
                       \"pilot.target\" = { column = \"target\", hold = \"zero-order\" }\n[[measured]]\nsignal = \"vehicle.z\"\n\
                       column = \"z\"\nsd = 0.01\n[parameters]\n\"pilot.gain\" = {}\n\"pilot.lead\" = {}\n[stability]\n\
                       closed_loop = true\n[[run]]\nfile = \"run.csv\"\n[fit]\n";
const TRUTH: [f64; 2] = [0.6, 0.8];
const STEP: f64 = 0.05;

/// A flight by Heun's method in small steps, whose stick is cut off at ±1; and the part of the time in which it is.
fn flown() -> (String, f64) {
    const PARTS: usize = 200;
    let h = STEP / PARTS as f64;
    let (mut text, mut x, mut stopped) = ("time,target,z\n".to_owned(), [0.0; 2], 0);
    let samples = 240;
    for k in 0..samples {
        let t = STEP * k as f64;
        let target = [4.0, -1.0, 1.0][k / 80];
        writeln!(text, "{t},{target},{}", x[0]).unwrap();
        let wished = |x: [f64; 2]| TRUTH[0] * (target - x[0] - TRUTH[1] * x[1]);
        for _ in 0..PARTS {
            stopped += usize::from(wished(x).abs() > 1.0);
            let rates = |x: [f64; 2]| [x[1], 4.0 * wished(x).clamp(-1.0, 1.0)];
            let a = rates(x);
            let b = rates([x[0] + h * a[0], x[1] + h * a[1]]);
            x = std::array::from_fn(|i| x[i] + 0.5 * h * (a[i] + b[i]));
        }
    }
    (text, stopped as f64 / (samples * PARTS) as f64)
}

fn fitted(flight: &str, limits: &str) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("pilot.toml", PILOT),
        ("vehicle.toml", VEHICLE),
        ("run.csv", flight),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let text = PROBLEM.to_owned() + limits;
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

fn is_held(fit: &Fit) -> bool {
    fit.diagnostics.iter().any(|own| own.code() == "on-limit")
}

/// As a constraint the limit makes another pilot of it, and says so; saturating, the truth is found.
#[test]
fn a_stick_at_its_stops_is_told_and_found_where_it_saturates() {
    let (flight, part) = flown();
    assert!((0.05..0.5).contains(&part), "{part}");
    let values = |fit: &Fit| [0, 1].map(|k| fit.parameters[k].values[0].1);
    let held = fitted(&flight, "limits = \"constrain\"\n");
    let [gain, _] = values(&held);
    assert!(is_held(&held), "{:?}", held.diagnostics);
    assert!((gain / TRUTH[0] - 1.0).abs() > 0.2, "{gain}");
    let found = fitted(&flight, "");
    assert_eq!(found.saturated[0].output, "pilot.stick");
    let share = found.saturated[0].samples as f64 / found.saturated[0].of as f64;
    assert!((share - part).abs() < 0.01, "{share} is not {part}");
    assert!(
        found.is_answer() && !is_held(&found),
        "{:?}",
        found.diagnostics
    );
    for (value, truth) in values(&found).into_iter().zip(TRUTH) {
        assert!((value / truth - 1.0).abs() < 0.01, "{value} is not {truth}");
    }
    // Margins are those of the loop within its limits: L = 4 k (lead s + 1)/s².
    let [gain, lead] = values(&found);
    let (a, b) = ((4.0 * gain * lead).powi(2), (4.0 * gain).powi(2));
    let crossover = (0.5 * (a + (a * a + 4.0 * b).sqrt())).sqrt();
    let named = found
        .derived
        .iter()
        .find(|own| own.name == "crossover_frequency");
    let own = named.unwrap().values[0].1;
    assert!(
        (own / crossover - 1.0).abs() < 1e-6,
        "{own} is not {crossover}"
    );
}
