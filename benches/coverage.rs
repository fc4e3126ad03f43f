//! How often 95 % intervals contain the true value: data of a known model, fitted many times.
//!
//!     cargo bench --bench coverage            # 300 sets a row, docs/uncertainty.md
//!     cargo bench --bench coverage -- 50      # fewer
//!     cargo bench --bench coverage -- "| 6 |" # rows whose first cells have this text
//!
//! Each row is a model, a number of runs and a kind of noise; each column is a method, the last one the default. A cell
//! counts over sets and parameters; its error is about 1 % at 300 sets. Sets with a negative variance estimate are left
//! out. The noise is added to the recorded signal, or is the human's: it then passes through the loop and colours the
//! recording as in flights.

use pilotage::estimation::refits::uncertainty_by;
use pilotage::estimation::uncertainty::Uncertainty;
use pilotage::estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage::inference::Method;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Bernoulli, Distribution, Exp1, StandardNormal};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;
use std::fmt::Write;
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A model and its data.
struct Case {
    name: &'static str,
    model: &'static str,
    /// The problem without its runs.
    problem: &'static str,
    /// The true values by name; the first one of a parameter with one value per run.
    truth: &'static [(&'static str, f64)],
    samples: usize,
    step: f64,
    /// The derivatives as a function of time, states, the human's noise and the run.
    rates: fn(f64, &[f64; 2], f64, usize) -> [f64; 2],
    initial: [f64; 2],
    /// Index of the measured state.
    place: usize,
    target: fn(f64, usize) -> f64,
    /// Gain and offset of the sensor.
    sensor: [f64; 2],
    level: f64,
    /// Whether the noise is the human's.
    is_remnant: bool,
    /// Fraction of the values whose noise is ten times as large.
    outliers: f64,
    /// Whether the noise has Laplace's distribution instead of the normal one.
    is_laplace: bool,
}

const DECAY: Case = Case {
    name: "decay",
    model: "[model]\nname = \"m\"\n[parameters]\nrate = 0.7\nx0 = 3\n[states]\nx = { start = \"x0\", der = \"-rate * x\" }\n",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.*\" = {}\n",
    truth: &[("m.rate", 0.7), ("m.x0", 3.0)],
    samples: 300,
    step: 0.02,
    rates: |_, x, _, _| [-0.7 * x[0], 0.0],
    initial: [3.0, 0.0],
    place: 0,
    target: |_, _| 0.0,
    sensor: [1.0, 0.0],
    level: 0.05,
    is_remnant: false,
    outliers: 0.0,
    is_laplace: false,
};

const SHORT: Case = Case {
    name: "decay, 20 samples",
    samples: 20,
    step: 0.3,
    ..DECAY
};

const FREE: Case = Case {
    name: "decay, start free",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.rate\" = {}\n[initial]\n\"m.x\" = \"free\"\n",
    truth: &[("m.rate", 0.7)],
    ..DECAY
};

/// A pilot with a lag controls an integrator; the target is a sum of three sines.
const LOOP: Case = Case {
    name: "tracking loop",
    model: "[model]\nname = \"m\"\n[inputs]\ntarget = {}\n[parameters]\ngain = { start = 1.5, min = 0 }\nlag = { start = 0.3, \
            min = 0.01 }\n[states]\narm.der = \"(gain * (target - x) - arm) / lag\"\nx.der = \"arm\"\n",
    problem: "[inputs]\n\"m.target\" = \"target\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.*\" = {}\n",
    truth: &[("m.gain", 1.5), ("m.lag", 0.3)],
    samples: 300,
    step: 0.1,
    rates: |t, x, noise, run| {
        let target = between_samples(sines, t, run);
        [(1.5 * (target - x[1]) + noise - x[0]) / 0.3, x[0]]
    },
    initial: [0.0, 0.0],
    place: 1,
    target: sines,
    level: 0.1,
    ..DECAY
};

/// The sensor and its noise level are estimated too.
const SENSOR: Case = Case {
    name: "tracking loop; gain, offset and noise level of the sensor",
    problem: "[inputs]\n\"m.target\" = \"target\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\ngain = \"free\"\n\
              offset = \"free\"\nsd = \"sigma\"\n[parameters]\nsigma = { start = 0.3, min = 1e-3 }\n\"m.*\" = {}\n",
    truth: &[
        ("m.gain", 1.5),
        ("m.lag", 0.3),
        ("gain(y)", 1.1),
        ("offset(y)", 0.2),
        ("sigma", 0.1),
    ],
    sensor: [1.1, 0.2],
    ..LOOP
};

const REMNANT: Case = Case {
    name: "tracking loop, human's noise",
    level: 0.4,
    is_remnant: true,
    ..LOOP
};

/// With steps as target instead of sines.
const STEPS: Case = Case {
    name: "tracking loop, steps, human's noise",
    rates: |t, x, noise, run| {
        let target = between_samples(steps, t, run);
        [(1.5 * (target - x[1]) + noise - x[0]) / 0.3, x[0]]
    },
    target: steps,
    ..REMNANT
};

/// The sensor is estimated; the noise is the human's.
const BOTH: Case = Case {
    name: "tracking loop; gain and offset of the sensor, human's noise",
    problem: "[inputs]\n\"m.target\" = \"target\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\ngain = \"free\"\n\
              offset = \"free\"\n[parameters]\n\"m.*\" = {}\n",
    truth: SENSOR.truth,
    sensor: SENSOR.sensor,
    ..REMNANT
};

const HUBER: Case = Case {
    name: "decay, 10 % outliers, Huber's loss",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = 0.05\nnoise = \"huber\"\n[parameters]\n\"m.*\" = {}\n",
    outliers: 0.1,
    ..DECAY
};

const LAPLACE: Case = Case {
    name: "decay, Laplace's noise",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = 0.05\nnoise = \"laplace\"\n[parameters]\n\"m.*\" = {}\n",
    is_laplace: true,
    ..DECAY
};

const SHORT_LAPLACE: Case = Case {
    name: "decay, 20 samples, Laplace's noise",
    samples: SHORT.samples,
    step: SHORT.step,
    ..LAPLACE
};

const LEVEL_OF_LAPLACE: Case = Case {
    name: "decay, 20 samples, Laplace's noise, its level sought",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = \"sigma\"\nnoise = \"laplace\"\n[parameters]\n\
              sigma = { start = 0.3, min = 1e-3 }\n\"m.*\" = {}\n",
    truth: &[("m.rate", 0.7), ("m.x0", 3.0), ("sigma", 0.05)],
    ..SHORT_LAPLACE
};

const OWN: Case = Case {
    name: "decay, x0 for each run",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.rate\" = {}\n\"m.x0\" = { per = \"run\" }\n",
    ..DECAY
};

/// Sum of three sines.
fn sines(t: f64, run: usize) -> f64 {
    let sines = [(0.4, 0.0), (0.9, 1.3), (1.7, 2.1)];
    let sines = sines
        .iter()
        .map(|(w, phase)| (w * t + phase + run as f64).sin());
    sines.sum()
}

/// A new level every five seconds.
fn steps(t: f64, run: usize) -> f64 {
    const LEVELS: [f64; 6] = [1.0, -1.0, 0.5, 2.0, -0.5, 0.0];
    LEVELS[(((t + 1e-9) / 5.0) as usize + run) % 6]
}

/// Linear between the samples, as in the fit.
fn between_samples(target: fn(f64, usize) -> f64, t: f64, run: usize) -> f64 {
    let sample = (t / LOOP.step + 1e-9).floor();
    let part = t / LOOP.step - sample;
    let at = |sample: f64| target(LOOP.step * sample, run);
    (1.0 - part) * at(sample) + part * at(sample + 1.0)
}

/// Numbers of unit variance, each correlated with the previous one.
fn noise(random: &mut ChaCha8Rng, count: usize, correlation: f64) -> Vec<f64> {
    let mut gauss = || -> f64 { StandardNormal.sample(random) };
    let mut last = gauss();
    let fresh = (1.0 - correlation * correlation).sqrt();
    let mut all = Vec::with_capacity(count);
    for _ in 0..count {
        all.push(last);
        last = correlation * last + fresh * gauss();
    }
    all
}

/// A run as a CSV file: Runge–Kutta method, four steps between samples.
fn recorded(case: &Case, run: usize, random: &mut ChaCha8Rng, correlation: f64) -> String {
    let mut noise = noise(random, case.samples, correlation);
    for own in &mut noise {
        let mut is_outlier =
            || -> bool { Bernoulli::new(case.outliers).is_ok_and(|own| own.sample(random)) };
        if case.outliers > 0.0 && is_outlier() {
            *own *= 10.0;
        }
        if case.is_laplace {
            let size: f64 = Exp1.sample(random);
            *own = own.signum() * size / SQRT_2;
        }
    }
    let (mut x, h) = (case.initial, case.step / 4.0);
    let mut text = "time,target,y\n".to_owned();
    for (k, own) in noise.iter().enumerate() {
        let t = case.step * k as f64;
        let (inside, outside) = match case.is_remnant {
            true => (case.level * own, 0.0),
            false => (0.0, case.level * own),
        };
        let seen = case.sensor[0] * x[case.place] + case.sensor[1] + outside;
        writeln!(text, "{t},{},{seen}", (case.target)(t, run)).expect("text");
        for j in 0..4 {
            let t = t + h * f64::from(j);
            let rates = |t: f64, x: [f64; 2]| (case.rates)(t, &x, inside, run);
            let along = |by: f64, k: [f64; 2]| [x[0] + by * k[0], x[1] + by * k[1]];
            let a = rates(t, x);
            let b = rates(t + 0.5 * h, along(0.5 * h, a));
            let c = rates(t + 0.5 * h, along(0.5 * h, b));
            let d = rates(t + h, along(h, c));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
    }
    text
}

/// For each method, and for the default: number of intervals of a set that contain the true value, and number of all
/// intervals.
fn held(case: &Case, runs: usize, correlation: f64, seed: u64) -> Vec<(usize, usize)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("m.toml", case.model);
    let mut text = format!("[system.m]\nmodel = \"m.toml\"\n{}", case.problem);
    for run in 0..runs {
        write(
            &format!("{run}.csv"),
            &recorded(case, run, &mut random, correlation),
        );
        write!(text, "[[run]]\nfile = \"{run}.csv\"\n").expect("text");
    }
    text += "[fit]\nstarts = 1\nmesh = \"samples\"\n";
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let named = Method::ALL.map(|method| uncertainty_by(&posed, &found, method).ok());
    let all = named.iter().map(Option::as_ref);
    let all = all.chain([found.uncertainty.as_ref().ok()]);
    all.map(|sure| sure.map_or((0, 0), |sure| counted(case, &found, sure)))
        .collect()
}

/// Number of intervals that contain the true value, and number of all intervals.
fn counted(case: &Case, found: &Fit, sure: &Uncertainty) -> (usize, usize) {
    let mut counts = (0, 0);
    for (parameter, intervals) in found.parameters.iter().zip(&sure.intervals) {
        let truth = case.truth.iter().find(|(name, _)| *name == parameter.name);
        for own in intervals {
            let (_, truth) = truth.expect("a truth for each");
            counts.0 += usize::from((own.low..=own.high).contains(truth));
            counts.1 += 1;
        }
    }
    counts
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let sets = words.iter().find_map(|word| word.parse().ok());
    let sets = sets.unwrap_or(300);
    let only = words.iter().find(|word| word.contains('|'));
    println!("| model | noise | runs | plain | sidpac | ar | cr3 | default |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let rows: Vec<(&Case, f64, usize)> = [
        (&DECAY, &[0.0, 0.9, 0.98][..], &[1, 2, 4, 8][..]),
        (&SHORT, &[0.0, 0.9], &[1, 2, 4, 8]),
        (&FREE, &[0.98], &[1, 4, 8]),
        (&OWN, &[0.98], &[4]),
        (&LOOP, &[0.0, 0.98], &[1, 2, 4, 6, 12]),
        (&SENSOR, &[0.0, 0.9], &[1, 2, 4, 6, 12]),
        (&REMNANT, &[0.0, 0.9], &[1, 2, 4, 6, 12]),
        (&STEPS, &[0.0, 0.9], &[1, 2, 4, 6, 12]),
        (&BOTH, &[0.0, 0.9], &[1, 2, 4, 6, 12]),
        (&HUBER, &[0.0], &[1, 4, 8]),
        (&LAPLACE, &[0.0], &[1, 4, 8]),
        (&SHORT_LAPLACE, &[0.0], &[1, 4, 8]),
        (&LEVEL_OF_LAPLACE, &[0.0], &[1, 4, 8]),
    ]
    .into_iter()
    .flat_map(|(case, noises, runs)| {
        let pairs = noises
            .iter()
            .flat_map(move |own| runs.iter().map(move |runs| (*own, *runs)));
        pairs.map(move |(own, runs)| (case, own, runs))
    })
    .collect();
    for (number, (case, correlation, runs)) in rows.iter().enumerate() {
        let noise = match *correlation {
            0.0 => "white".to_owned(),
            own => format!("AR(1) {own}"),
        };
        let row = format!("| {} | {noise} | {runs} |", case.name);
        if only.is_some_and(|only| !row.contains(only)) {
            continue;
        }
        let done = AtomicUsize::new(0);
        let counts = (0..sets).into_par_iter().map(|seed: u64| {
            let counts = held(case, *runs, *correlation, seed);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let (number, all) = (number + 1, rows.len());
            if std::io::stderr().is_terminal() {
                eprint!("\rrow {number} of {all}: {done} of {sets} sets   ");
            }
            counts
        });
        let none = || vec![(0, 0); Method::ALL.len() + 1];
        let counts = counts.reduce(none, |a, b| {
            let pairs = a.into_iter().zip(b);
            pairs.map(|(a, b)| (a.0 + b.0, a.1 + b.1)).collect()
        });
        let cell = |(held, all): (usize, usize)| match all {
            0 => "–".to_owned(),
            _ => format!("{:.1}", 100.0 * held as f64 / all as f64),
        };
        let cells: Vec<String> = counts.into_iter().map(cell).collect();
        println!("{row} {} |", cells.join(" | "));
    }
}
