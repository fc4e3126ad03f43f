//! How often `pilotage compare` selects a model that is too large or too small: data of a known model, with the
//! selection repeated many times.
//!
//!     cargo bench --bench choice              # 200 sets a row, docs/uncertainty.md
//!     cargo bench --bench choice -- 50        # fewer
//!
//! The true model has one lag or two; the candidates have one lag and two. The noise on the recorded signal is white,
//! or an AR(1) process as coloured as the residuals of flights.

use pilotage::estimation::comparison::compare;
use pilotage::estimation::{ProblemFile, part};
use pilotage::inference::choice::Contender;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

const MODELS: [&str; 2] = [
    "[model]\nname = \"m\"\n[inputs]\nu = {}\n[parameters]\na = { start = 1, min = 0.01, max = 100 }\n[states]\n\
     x = { der = \"a * (u - x)\" }\n[outputs]\ny = \"x\"\n",
    "[model]\nname = \"m\"\n[inputs]\nu = {}\n[parameters]\na = { start = 1, min = 0.01, max = 100 }\n\
     b = { start = 5, min = 0.01, max = 1000 }\n[states]\nx = { der = \"a * (u - x)\" }\nz = { der = \"b * (x - z)\" }\n\
     [outputs]\ny = \"z\"\n",
];

const SAMPLES: usize = 200;
const STEP: f64 = 0.05;
const LEVEL: f64 = 0.05;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sets = std::env::args().find_map(|word| word.parse().ok());
    let sets: u64 = sets.unwrap_or(200);
    println!("| truth | noise | runs | compare takes two lags | AICc | BIC |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (lags, colour) in [(1, 0.0), (1, 0.9), (1, 0.98), (2, 0.0), (2, 0.9), (2, 0.98)] {
        for runs in [4, 8] {
            let taken = (0..sets).into_par_iter();
            let taken = taken.map(|seed| chosen(lags, colour, runs, seed));
            let taken: Vec<[bool; 3]> = taken.collect::<Result<_, _>>()?;
            let share = |k: usize| {
                let count = taken.iter().filter(|own| own[k]).count();
                100.0 * count as f64 / sets as f64
            };
            let noise = match colour == 0.0 {
                true => "white".to_owned(),
                false => format!("AR(1) {colour}"),
            };
            let [compare, aicc, bic] = [share(0), share(1), share(2)];
            println!("| {lags} | {noise} | {runs} | {compare:.1} | {aicc:.1} | {bic:.1} |");
        }
    }
    Ok(())
}

/// Whether two lags are selected by leaving out runs, by AICc and by BIC.
fn chosen(lags: usize, colour: f64, runs: usize, seed: u64) -> Result<[bool; 3], String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    for k in 0..runs {
        let text = run(lags, colour, seed * 100 + k as u64);
        std::fs::write(folder.path().join(format!("run{k}.csv")), text)
            .map_err(|e| e.to_string())?;
    }
    let files = [0, 1].map(|k| problem(folder.path(), k, runs));
    let [one, two] = files;
    let compared = compare(
        &[one?, two?],
        &part::open,
        &|_, _| ControlFlow::Continue(()),
    );
    let compared = compared.map_err(|e| e.to_string())?;
    let all = &compared.candidates;
    let is_better = |of: fn(&Contender) -> f64| of(&all[1].figures) < of(&all[0].figures);
    let (taken, _) = compared.choice.ok_or("a fit did not converge")?;
    Ok([
        taken == 1,
        is_better(Contender::aicc),
        is_better(Contender::bic),
    ])
}

fn problem(folder: &Path, model: usize, runs: usize) -> Result<ProblemFile, String> {
    let path = folder.join(format!("model{model}.toml"));
    std::fs::write(path, MODELS[model]).map_err(|e| e.to_string())?;
    let mut text = format!(
        "[system.m]\nmodel = \"model{model}.toml\"\n[inputs]\n\"m.u\" = \"u\"\n[[measured]]\nsignal = \"m.y\"\n\
         column = \"y\"\nsd = \"noise\"\n[parameters]\n\"m.*\" = {{}}\nnoise = {{ start = {LEVEL}, min = 1e-4, max = 1, scale = \"log\" }}\n\
         [initial]\n\"m.*\" = 0\n[fit]\nstarts = 1\n"
    );
    for k in 0..runs {
        let _ = writeln!(text, "[[run]]\nfile = \"run{k}.csv\"");
    }
    ProblemFile::parse(&text, &folder.join("problem.toml")).map_err(|e| e.to_string())
}

/// Step response of one lag of 1.5 1/s, or of this lag followed by one of 10 1/s, with noise.
fn run(lags: usize, colour: f64, seed: u64) -> String {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = LEVEL * draw(&mut generator);
    let mut text = String::from("time,u,y\n");
    let (a, b) = (1.5, 10.0);
    for i in 0..=SAMPLES {
        let t = STEP * i as f64;
        let y = match lags {
            1 => 1.0 - (-a * t).exp(),
            _ => 1.0 - (b * (-a * t).exp() - a * (-b * t).exp()) / (b - a),
        };
        let _ = writeln!(text, "{t},1,{}", y + noise);
        noise = colour * noise + LEVEL * (1.0 - colour * colour).sqrt() * draw(&mut generator);
    }
    text
}

fn draw(generator: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(generator)
}
