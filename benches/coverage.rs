//! How often 95 % intervals hold the truth: data of a known truth, fitted many times.
//!
//!     cargo bench --bench coverage            # 200 sets a row, docs/uncertainty.md
//!     cargo bench --bench coverage -- 50      # fewer
//!
//! Each row is a model, a number of runs and a kind of noise; each column a method, and what is taken unless one is
//! named. A cell counts over sets and parameters; its error is some 1.5 % at 200 sets. Sets whose
//! variance came out negative are left out. The noise is recorded on top of the
//! signal, or is the human's own: then it goes through the loop, and colours what is recorded as flights are.

use pilotage::estimation::{Posed, ProblemFile, fit, part};
use pilotage::inference::Method;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is fitted.
struct Case {
    name: &'static str,
    model: &'static str,
    /// All of the problem but its runs.
    problem: &'static str,
    /// The truth by name; of one for each run the first.
    truth: &'static [(&'static str, f64)],
    samples: usize,
    step: f64,
    /// The derivatives, from time, states, the human's noise and the run.
    rates: fn(f64, &[f64; 2], f64, usize) -> [f64; 2],
    initial: [f64; 2],
    level: f64,
    /// The noise is the human's.
    is_remnant: bool,
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
    level: 0.05,
    is_remnant: false,
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

/// A pilot with a lag on an integrator, after three sines.
const LOOP: Case = Case {
    name: "tracking loop",
    model: "[model]\nname = \"m\"\n[inputs]\ntarget = {}\n[parameters]\ngain = { start = 1.5, min = 0 }\nlag = { start = 0.3, \
            min = 0.01 }\n[states]\narm.der = \"(gain * (target - x) - arm) / lag\"\nx.der = \"arm\"\n",
    problem: "[inputs]\n\"m.target\" = \"target\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.*\" = {}\n",
    truth: &[("m.gain", 1.5), ("m.lag", 0.3)],
    samples: 300,
    step: 0.1,
    rates: |t, x, noise, run| [(1.5 * (target(t, run) - x[1]) + noise - x[0]) / 0.3, x[0]],
    initial: [0.0, 0.0],
    level: 0.1,
    is_remnant: false,
};

const REMNANT: Case = Case {
    name: "tracking loop, human's noise",
    level: 0.4,
    is_remnant: true,
    ..LOOP
};

const OWN: Case = Case {
    name: "decay, x0 for each run",
    problem: "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\n[parameters]\n\"m.rate\" = {}\n\"m.x0\" = { per = \"run\" }\n",
    ..DECAY
};

/// Three sines, on straight lines between the samples, as the fit has them.
fn target(t: f64, run: usize) -> f64 {
    let at = |t: f64| -> f64 {
        let sines = [(0.4, 0.0), (0.9, 1.3), (1.7, 2.1)];
        let sines = sines
            .iter()
            .map(|(w, phase)| (w * t + phase + run as f64).sin());
        sines.sum()
    };
    let sample = (t / LOOP.step + 1e-9).floor();
    let part = t / LOOP.step - sample;
    (1.0 - part) * at(LOOP.step * sample) + part * at(LOOP.step * (sample + 1.0))
}

/// Numbers of unit variance, each correlated with the one before.
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

/// A run as a CSV file: Runge and Kutta's method, four steps between samples.
fn recorded(case: &Case, run: usize, random: &mut ChaCha8Rng, correlation: f64) -> String {
    let noise = noise(random, case.samples, correlation);
    let (mut x, h) = (case.initial, case.step / 4.0);
    let mut text = "time,target,y\n".to_owned();
    for (k, own) in noise.iter().enumerate() {
        let t = case.step * k as f64;
        let (inside, outside) = match case.is_remnant {
            true => (case.level * own, 0.0),
            false => (0.0, case.level * own),
        };
        let place = usize::from(case.name.contains("loop"));
        writeln!(text, "{t},{},{}", target(t, run), x[place] + outside).expect("text");
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

/// How many intervals of a set hold the truth, and how many there are.
fn held(
    case: &Case,
    runs: usize,
    correlation: f64,
    seed: u64,
    method: Option<Method>,
) -> (usize, usize) {
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
    let mut file =
        ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("a problem");
    file.options.covariance = method;
    let posed = Posed::new(&file, &part::open).expect("a problem");
    let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let Ok(sure) = &found.uncertainty else {
        return (0, 0);
    };
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
    let sets = std::env::args()
        .filter_map(|word| word.parse().ok())
        .next()
        .unwrap_or(200);
    println!("| model | noise | runs | plain | sidpac | ar | cr3 | default |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let rows: Vec<(&Case, f64, usize)> = [
        (&DECAY, &[0.0, 0.9, 0.98][..], &[1, 2, 4, 8][..]),
        (&SHORT, &[0.0, 0.9], &[1, 2, 4, 8]),
        (&FREE, &[0.98], &[1, 4, 8]),
        (&OWN, &[0.98], &[4]),
        (&LOOP, &[0.0, 0.98], &[1, 2, 4, 8]),
        (&REMNANT, &[0.0, 0.9], &[1, 2, 4, 8]),
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
        let mut cells = Vec::new();
        for method in Method::ALL.into_iter().map(Some).chain([None]) {
            let done = AtomicUsize::new(0);
            let counts = (0..sets).into_par_iter().map(|seed: u64| {
                let counts = held(case, *runs, *correlation, seed, method);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                let name = method.map_or("default", Method::as_str);
                eprint!(
                    "\rrow {} of {}, {name}: {done} of {sets} sets   ",
                    number + 1,
                    rows.len()
                );
                counts
            });
            let (held, all) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
            cells.push(match all {
                0 => "–".to_owned(),
                _ => format!("{:.1}", 100.0 * held as f64 / all as f64),
            });
        }
        let noise = match *correlation {
            0.0 => "white".to_owned(),
            own => format!("AR(1) {own}"),
        };
        eprint!("\r");
        println!(
            "| {} | {noise} | {runs} | {} |",
            case.name,
            cells.join(" | ")
        );
    }
    eprintln!();
}
