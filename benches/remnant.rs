//! Effect of a human's remnant on the estimated parameters: bias, scatter and intervals, by the signals compared.
//!
//!     cargo bench --bench remnant              # 24 flights a row, docs/uncertainty.md
//!     cargo bench --bench remnant -- 8         # fewer
//!
//! Each flight follows a sum of sines for 60 s at 20 Hz: a pilot with known gain, lead and delay, whose hand adds
//! coloured noise to the stick, controls a vehicle like K/s². The pilot's delay is exact here, and a Padé approximation
//! in the fits.

use pilotage::estimation::{Fit, Posed, ProblemFile, fit, part};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

const DURATION: f64 = 60.0;
const SAMPLE: f64 = 0.05;
/// Simulation steps between two samples.
const PARTS: usize = 50;

/// The pilot: gain [stick per metre], times [s], and frequency [rad/s].
const GAIN: f64 = 0.125;
const LEAD: f64 = 1.0;
const DELAY: f64 = 0.2;
const OMEGA: f64 = 10.0;
const ZETA: f64 = 0.7;
/// Acceleration at full stick [m/s²].
const POWER: f64 = 10.0;
/// Correlation time of the remnant [s].
const COLOUR: f64 = 0.5;
/// Noise of the recordings of position [m] and stick.
const POSITION_SD: f64 = 0.01;
const STICK_SD: f64 = 0.002;

/// Signals compared, and the problem without its run.
const COMPARED: [(&str, &str); 4] = [
    ("response", RESPONSE),
    ("stick, driven by the recording", DIRECT),
    ("prediction error", BOTH),
    ("prediction error, response alone", ALONE),
];

const LOOP: &str = r#"
[system.pilot]
model = "extended_crossover"
set = { omega_nm = 10, zeta_nm = 0.7 }
[system.hand]
model = "hand.toml"
[system.vehicle]
model = "vehicle.toml"
[connect]
"pilot.stick" = "hand.stick"
"hand.moved" = "vehicle.stick"
"vehicle.z" = "pilot.position"
[inputs]
"pilot.target" = "target"
"#;

const SOUGHT: &str = r#"
[parameters]
"pilot.gain" = { start = 0.1, min = 0, max = 2 }
"pilot.lead" = { start = 0.7 }
"pilot.delay" = { start = 0.15 }
"#;

const RESPONSE: &str = r#"
[[measured]]
signal = "vehicle.z"
column = "position"
"#;

const DIRECT: &str = r#"
[system.pilot]
model = "extended_crossover"
set = { omega_nm = 10, zeta_nm = 0.7 }
[inputs]
"pilot.target" = "target"
"pilot.position" = "position"
[[measured]]
signal = "pilot.stick"
column = "stick"
"#;

const BOTH: &str = r#"
[[measured]]
signal = "vehicle.z"
column = "position"
sd = 0.01
[[measured]]
signal = "hand.moved"
column = "stick"
sd = 0.002
"#;

const ALONE: &str = r#"
[[measured]]
signal = "vehicle.z"
column = "position"
sd = 0.01
"#;

const NOISE: &str = r#"
[process_noise]
"hand.w" = { density = "q" }
"#;

const LEVELS: &str = r#"
q = { start = 1e-4, min = 1e-12, unit = "s" }
"hand.colour" = { start = 0.3, min = 0.05, max = 5 }
"#;

const HAND: &str = r#"
[model]
name = "hand"
[inputs]
stick = { unit = "1" }
w = { unit = "1" }
[parameters]
colour = { start = 0.5, unit = "s" }
[states]
n = { unit = "1", der = "(w - n) / colour" }
[outputs]
moved = { unit = "1", value = "stick + n" }
"#;

const VEHICLE: &str = r#"
[model]
name = "vehicle"
[inputs]
stick = { unit = "1" }
[parameters]
power = { start = 10, unit = "m/s2" }
[states]
z = { unit = "m", der = "v" }
v = { unit = "m/s", der = "power * stick" }
"#;

fn main() {
    let flights = std::env::args().filter_map(|own| own.parse().ok()).next();
    let flights: u64 = flights.unwrap_or(24);
    println!("found minus true, mean ± standard deviation over {flights} flights of {DURATION} s;");
    println!("in brackets how many of 100 95 % intervals hold the truth\n");
    println!(
        "| remnant (of the stick's power) | compared | crossover [rad/s] | gain [%] | lead [s] | delay [s] |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for share in [0.0, 0.05, 0.1] {
        for (name, problem) in COMPARED {
            let found: Vec<Option<Found>> = (0..flights)
                .into_par_iter()
                .map(|seed| found(problem, share, seed))
                .collect();
            row(share, name, &found);
        }
    }
}

/// Gain, lead, delay, whether their intervals contain the true values, and the resulting crossover.
struct Found {
    values: [f64; 3],
    held: [bool; 3],
    crossover: f64,
}

fn row(share: f64, name: &str, all: &[Option<Found>]) {
    let there: Vec<&Found> = all.iter().flatten().collect();
    let shown = |of: &dyn Fn(&Found) -> f64, digits: usize| {
        let n = there.len() as f64;
        let mean = there.iter().map(|own| of(own)).sum::<f64>() / n;
        let squares: f64 = there.iter().map(|own| (of(own) - mean).powi(2)).sum();
        format!(
            "{mean:+.digits$} ± {:.digits$}",
            (squares / (n - 1.0)).sqrt()
        )
    };
    let held = |k: usize| {
        let held = there.iter().filter(|own| own.held[k]).count();
        100.0 * held as f64 / there.len() as f64
    };
    let true_crossover = crossover([GAIN, LEAD, DELAY]);
    let lost = match all.len() - there.len() {
        0 => String::new(),
        lost => format!(", {lost} without an answer"),
    };
    println!(
        "| {} % | {name}{lost} | {} | {} ({:.0}) | {} ({:.0}) | {} ({:.0}) |",
        100.0 * share,
        shown(&|own| own.crossover - true_crossover, 4),
        shown(&|own| 100.0 * (own.values[0] / GAIN - 1.0), 2),
        held(0),
        shown(&|own| own.values[1] - LEAD, 4),
        held(1),
        shown(&|own| own.values[2] - DELAY, 4),
        held(2),
    );
}

fn found(problem: &str, share: f64, seed: u64) -> Option<Found> {
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("run.csv", &flight(share, seed));
    write("hand.toml", HAND);
    write("vehicle.toml", VEHICLE);
    let is_noisy = problem == BOTH || problem == ALONE;
    let mut text = if problem == DIRECT {
        String::new()
    } else {
        LOOP.to_owned()
    };
    text += problem;
    text += SOUGHT;
    if is_noisy {
        text += LEVELS;
        text += NOISE;
    }
    text += "[fit]\nstarts = 1\n";
    if is_noisy {
        text += "objective = \"prediction-error\"\n";
    }
    text += "[[run]]\nfile = \"run.csv\"\n";
    estimates(&solved(&text, &folder.path().join("problem.toml")))
}

fn solved(text: &str, path: &Path) -> Fit {
    let file = ProblemFile::parse(text, path).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

fn estimates(fit: &Fit) -> Option<Found> {
    let sure = fit.uncertainty.as_ref().ok().filter(|_| fit.is_answer())?;
    let (mut values, mut held) = ([0.0; 3], [false; 3]);
    let truth = [
        ("pilot.gain", GAIN),
        ("pilot.lead", LEAD),
        ("pilot.delay", DELAY),
    ];
    for (k, (name, truth)) in truth.into_iter().enumerate() {
        let place = fit.parameters.iter().position(|own| own.name == name)?;
        let interval = &sure.intervals[place][0];
        values[k] = fit.parameters[place].values[0].1;
        held[k] = interval.low <= truth && truth <= interval.high;
    }
    Some(Found {
        values,
        held,
        crossover: crossover(values),
    })
}

/// Frequency at which the gain of the open loop is 1, by bisection: the gain decreases.
fn crossover([gain, lead, _]: [f64; 3]) -> f64 {
    let above = |w: f64| {
        let arm = (1.0 - (w / OMEGA).powi(2)).hypot(2.0 * ZETA * w / OMEGA);
        gain * POWER * 1f64.hypot(lead * w) / (w * w * arm) > 1.0
    };
    let (mut low, mut high) = (0.01, 30.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if above(middle) {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

/// Sines at prime multiples of the base frequency, smaller above the crossover.
fn target(t: f64, phases: &[f64]) -> f64 {
    let primes = [2.0, 3.0, 5.0, 7.0, 11.0, 17.0, 23.0, 31.0];
    let sine = |(n, phase): (&f64, &f64)| {
        let w: f64 = TAU * n / DURATION;
        let size = if w < 1.0 { 1.0 } else { w.powi(-2) };
        size * ((w * t + phase).sin() - phase.sin())
    };
    primes.iter().zip(phases).map(sine).sum()
}

/// A recorded flight. `share` is the power of the remnant relative to that of the stick without it.
fn flight(share: f64, seed: u64) -> String {
    let (_, calm) = flown(0.0, seed);
    let mean = calm.iter().map(|row| row[1]).sum::<f64>() / calm.len() as f64;
    let power = calm.iter().map(|row| (row[1] - mean).powi(2)).sum::<f64>() / calm.len() as f64;
    let (targets, rows) = flown((share * power).sqrt(), seed);
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let mut text = "time,target,position,stick\n".to_owned();
    for (k, ([z, stick], target)) in rows.iter().zip(targets).enumerate() {
        let (z, stick) = (z + POSITION_SD * gauss(), stick + STICK_SD * gauss());
        writeln!(text, "{},{target},{z},{stick}", SAMPLE * k as f64).expect("text");
    }
    text
}

/// Target, and position and stick, at the samples, for a remnant of this standard deviation.
fn flown(remnant: f64, seed: u64) -> (Vec<f64>, Vec<[f64; 2]>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let phases: Vec<f64> = (0..8).map(|_| TAU * 0.618 * gauss()).collect();
    let h = SAMPLE / PARTS as f64;
    let keeps = (-h / COLOUR).exp();
    let (mut n, mut x) = (0.0, [0.0; 4]);
    let (mut errors, mut targets, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..=(DURATION / h).round() as usize {
        // Linear between samples, as in the fits.
        let (sample, part) = (step / PARTS, (step % PARTS) as f64 / PARTS as f64);
        let at = |k: usize| target(SAMPLE * k as f64, &phases);
        let goal = (1.0 - part) * at(sample) + part * at(sample + 1);
        errors.push(goal - x[2]);
        if part == 0.0 {
            targets.push(goal);
            rows.push([x[2], x[0] + LEAD * x[1] + n]);
        }
        let late = step as i64 - (DELAY / h).round() as i64;
        let wish = |k: i64| usize::try_from(k).map_or(0.0, |k| GAIN * errors[k]);
        x = stepped(x, [wish(late), wish(late + 1)], n, h);
        n = keeps * n + remnant * (1.0 - keeps * keeps).sqrt() * gauss();
    }
    (targets, rows)
}

/// Arm, its speed, position and speed after a step of Heun's method.
fn stepped(x: [f64; 4], wish: [f64; 2], n: f64, h: f64) -> [f64; 4] {
    let rates = |x: [f64; 4], wish: f64| {
        let pull = OMEGA * OMEGA * (wish - x[0]) - 2.0 * ZETA * OMEGA * x[1];
        [x[1], pull, x[3], POWER * (x[0] + LEAD * x[1] + n)]
    };
    let a = rates(x, wish[0]);
    let b = rates(std::array::from_fn(|k| x[k] + h * a[k]), wish[1]);
    std::array::from_fn(|k| x[k] + 0.5 * h * (a[k] + b[k]))
}
