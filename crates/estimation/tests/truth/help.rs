//! Problems in a folder of their own, and data of known parameters.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use std::fs;
use std::ops::ControlFlow;
use tempfile::TempDir;

/// A folder for a problem and its runs.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    /// Writes columns of equal length; NaN is an empty cell.
    pub fn write(&self, file: &str, columns: &[(&str, &[f64])]) {
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        let mut text = names.join(",") + "\n";
        for row in 0..columns[0].1.len() {
            let cell = |value: f64| match value.is_nan() {
                true => String::new(),
                false => value.to_string(),
            };
            let cells: Vec<String> = columns.iter().map(|(_, all)| cell(all[row])).collect();
            text += &(cells.join(",") + "\n");
        }
        self.text(file, &text);
    }

    /// Writes a model file.
    pub fn text(&self, file: &str, text: &str) {
        fs::write(self.0.path().join(file), text).expect("it is written");
    }

    /// Why a text says no problem.
    pub fn refused(&self, text: &str) -> String {
        let file = ProblemFile::parse(text, &self.0.path().join("problem.toml"));
        let posed = file.and_then(|file| Posed::new(&file, &part::open).map(|_| ()));
        posed.expect_err("no problem").to_string()
    }

    /// Fits the problem that a text says.
    pub fn fit(&self, text: &str) -> Fit {
        let file = ProblemFile::parse(text, &self.0.path().join("problem.toml"));
        let file = file.unwrap_or_else(|error| panic!("{error}"));
        let posed = Posed::new(&file, &part::open).unwrap_or_else(|error| panic!("{error}"));
        fit(&posed, &mut |_| ControlFlow::Continue(()))
    }
}

/// So many times, this far apart.
pub fn times(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| step * k as f64).collect()
}

/// A sum of sines at these multiples of a base frequency, with amplitudes that fall with it and random phases.
pub fn sines(seed: u64, time: &[f64], amplitude: f64) -> Vec<f64> {
    const HARMONICS: [u32; 8] = [2, 5, 8, 11, 17, 23, 31, 41];
    let base = std::f64::consts::TAU / (time[time.len() - 1] - time[0]);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let phases = Uniform::new(0.0, std::f64::consts::TAU).expect("not empty");
    let terms = HARMONICS.map(|k| (base * f64::from(k), phases.sample(&mut random)));
    let value = |t: &f64| {
        let term = |(omega, phase): &(f64, f64)| (omega * t + phase).sin() / (1.0 + omega * omega);
        amplitude * terms.iter().map(term).sum::<f64>()
    };
    time.iter().map(value).collect()
}

/// Independent numbers of Gauss's distribution.
pub fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| StandardNormal.sample(&mut random))
        .collect()
}

/// The value of a parameter, that of the given run or subject where each has one.
pub fn value(fit: &Fit, name: &str, place: usize) -> f64 {
    let found = fit.parameters.iter().find(|own| own.name == name);
    found.unwrap_or_else(|| panic!("no {name}")).values[place].1
}

/// What each sensor of a run should show at the rows of its file: of samples of one time the last, behind a jump.
pub fn at_rows(fit: &Fit, run: usize) -> Vec<Vec<f64>> {
    let run = &fit.runs[run];
    let is_last = |k: &usize| run.time.get(k + 1) != Some(&run.time[*k]);
    let rows: Vec<usize> = (0..run.time.len()).filter(is_last).collect();
    let own = |all: &Vec<f64>| rows.iter().map(|k| all[*k]).collect();
    run.predicted.iter().map(own).collect()
}

/// Asserts that two numbers agree to a relative tolerance.
pub fn near(found: f64, expected: f64, tolerance: f64) {
    let error = (found - expected).abs() / expected.abs().max(1e-12);
    assert!(error <= tolerance, "{found} instead of {expected}");
}
