//! Covariances, Huber's loss and the test of Ljung and Box, against statsmodels and SciPy: a problem that is linear in its
//! parameters, `y = a + b t + c t²/2` over six runs of different length.

use super::python;
use crate::command::Folder;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StudentT};
use serde_json::Value;
use std::fmt::Write;

const LINE: &str = "[model]\nname = \"line\"\n[parameters]\na = 0.5\nb = 1\nc = 0\n[states]\n\
                    x = { start = \"a\", der = \"b + c * time\" }\n";
const RUNS: usize = 6;
const SD: f64 = 0.1;

/// Noise with outliers, and of each run an error that all of its values share.
fn fly(folder: &Folder) {
    folder.write("line.toml", LINE);
    let mut random = ChaCha8Rng::seed_from_u64(31);
    let tails = StudentT::new(2.0).unwrap();
    for g in 0..RUNS {
        let shared: f64 = StandardNormal.sample(&mut random);
        let mut text = "time,y\n".to_owned();
        for k in 0..20 + 2 * g {
            let t = 0.1 * k as f64;
            let noise = SD * (0.5 * shared + tails.sample(&mut random));
            writeln!(text, "{t},{}", 1.0 + 2.0 * t - 0.4 * t * t + noise).unwrap();
        }
        folder.write(&format!("run{g}.csv"), text);
    }
}

fn fit(folder: &Folder, noise: &str, covariance: &str) -> String {
    let mut problem = format!(
        "[system.m]\nmodel = \"line.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = {SD}\nnoise = \"{noise}\"\n\
         [parameters]\n\"m.*\" = {{}}\n[fit]\nstarts = 1\ntolerance = 1e-10\ncovariance = \"{covariance}\"\n"
    );
    (0..RUNS).for_each(|g| write!(problem, "[[run]]\nfile = \"run{g}.csv\"\n").unwrap());
    folder.write("problem.toml", problem);
    let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.stdout
}

#[test]
fn statistics_are_those_of_statsmodels() {
    let folder = Folder::new();
    fly(&folder);
    let mut names = Vec::new();
    for (noise, covariance) in [("normal", "plain"), ("normal", "cr3"), ("huber", "plain")] {
        let name = format!("{noise}-{covariance}.json");
        folder.write(&name, fit(&folder, noise, covariance));
        names.push(name);
    }
    names.extend((0..RUNS).map(|g| format!("run{g}.csv")));
    let errors = python::run("regression.py", names.iter().map(|name| folder.path(name)));
    let errors: Value = serde_json::from_str(&errors).unwrap();
    for (key, error) in errors.as_object().unwrap() {
        assert!(error.as_f64().unwrap() < 1e-6, "{key}: {error}");
    }
    assert_eq!(errors.as_object().unwrap().len(), 8);
}
