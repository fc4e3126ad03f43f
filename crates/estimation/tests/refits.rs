//! Profiles against fits in which the problem file fixes the parameter, and bootstraps against covariances.

use pilotage_estimation::refits::study;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_inference::quantile;
use pilotage_refits::{End, Kind, Profile, Spread, Watch, spread};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;
use tempfile::TempDir;

const DECAY: &str = "[model]\nname = \"decay\"\n[parameters]\nrate = 0.5\nx0 = 2.0\n[states]\n\
                     x = { start = \"x0\", der = \"-rate * x\" }\n";

/// A folder with runs of a decay with rate 0.7 and `x0` = 3, with noise of an AR(1) process of such a correlation.
fn folder(runs: usize, samples: usize, correlation: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("decay.toml"), DECAY).unwrap();
    for j in 0..runs {
        let mut random = ChaCha8Rng::seed_from_u64(300 + j as u64);
        let (mut rows, mut e) = ("time,x\n".to_owned(), 0.0);
        for k in 0..samples {
            let t = 4.0 * k as f64 / samples as f64;
            let gauss: f64 = StandardNormal.sample(&mut random);
            let scale = if k == 0 {
                1.0
            } else {
                (1.0 - correlation.powi(2)).sqrt()
            };
            e = correlation * e + 0.1 * scale * gauss;
            writeln!(rows, "{t},{}", 3.0 * (-0.7 * t).exp() + e).unwrap();
        }
        std::fs::write(folder.path().join(format!("run{j}.csv")), rows).unwrap();
    }
    folder
}

fn problem(folder: &Path, runs: usize, rest: &str) -> ProblemFile {
    let mut text = format!("[system.m]\nmodel = \"decay.toml\"\n{rest}");
    (0..runs).for_each(|j| write!(text, "[[run]]\nfile = \"run{j}.csv\"\n").unwrap());
    ProblemFile::parse(&text, &folder.join("problem.toml")).unwrap()
}

fn solved(posed: &Posed<'_>) -> Fit {
    let found = fit(posed, &mut |_| ControlFlow::Continue(()));
    assert!(found.is_answer(), "{:?}", found.diagnostics);
    found
}

const MEASURED: &str = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n";

/// The fit and the profiles of a problem.
fn profiled(folder: &Path, runs: usize, rest: &str) -> (Fit, Vec<(String, Profile)>) {
    let file = problem(folder, runs, rest);
    let posed = Posed::new(&file, &part::open).unwrap();
    let found = solved(&posed);
    let study = study(&posed, &found).unwrap();
    let all: Vec<usize> = (0..study.unknowns.len()).collect();
    let profiles = study.profiles(&all, &Watch::default());
    let profiles = profiles.into_iter().map(|mut own| {
        own.points
            .iter_mut()
            .for_each(|point| point.objective /= study.factor);
        own
    });
    let names = study.unknowns.iter().map(|own| own.full_name());
    let all = names.zip(profiles).collect();
    drop(study);
    (found, all)
}

/// The objective of a fit of another problem.
fn objective(folder: &Path, runs: usize, rest: &str) -> f64 {
    let file = problem(folder, runs, rest);
    solved(&Posed::new(&file, &part::open).unwrap()).objective
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() < tolerance,
        "{found} is not {expected}"
    );
}

/// Each point's objective is that of a fit in which the file fixes the parameter: with a plain noise level, with one that
/// is sought, along a logarithm, with a prior, and on the bound of another parameter.
#[test]
fn profiles_are_fits_with_the_parameter_fixed() {
    let folder = folder(2, 15, 0.0);
    let folder = folder.path();
    let sought = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = \"sigma\"\n";
    let cases = [
        (MEASURED, "", "m.x0", ""),
        (MEASURED, "scale = \"log\", ", "m.x0", ""),
        (MEASURED, "prior = { normal = [0.6, 0.1] }, ", "m.x0", ""),
        (MEASURED, "", "m.x0", "max, "),
        (sought, "", "sigma", "min = 1e-3, start = 0.1, "),
    ];
    let both = format!("{MEASURED}[parameters]\n\"m.rate\" = {{}}\n\"m.x0\" = {{}}\n");
    let (free, _) = profiled(folder, 2, &both);
    let max = format!("max = {}", free.parameters[1].values[0].1 + 0.02);
    for (measured, rate, other, range) in cases {
        let range = &range.replace("max", &max);
        let rest = |fixed: &str| {
            let more = if other == "sigma" {
                "\"m.x0\" = {}\n"
            } else {
                ""
            };
            let range = range.trim_end_matches(", ");
            format!(
                "{measured}[parameters]\n\"m.rate\" = {{ {fixed} }}\n\"{other}\" = {{ {range} }}\n{more}"
            )
        };
        let (fit, profiles) = profiled(folder, 2, &rest(rate.trim_end_matches(", ")));
        let (name, own) = &profiles[0];
        assert_eq!(name, "m.rate");
        for point in own.points.iter().step_by(3) {
            // A prior of what is fixed is no term of that fit.
            let prior = if rate.contains("prior") {
                ((point.value - 0.6) / 0.1).powi(2)
            } else {
                0.0
            };
            let fixed = format!("start = {}, fixed = true", point.value);
            let expected = objective(folder, 2, &rest(&fixed)) + prior;
            assert_near(point.objective, expected, 1e-6 * (1.0 + expected.abs()));
        }
        let is_bounded = own.points.iter().any(|point| !point.constraints.is_empty());
        assert_eq!(is_bounded, range.starts_with("max"), "{range}");
        // At the ends the objective is above the least one by the threshold: χ² where the level is sought or a prior counts
        // against the stated one, else s² t².
        let degrees = fit.samples as f64 - 2.0;
        let is_stated = other == "sigma" || rate.contains("prior");
        let excess = match is_stated {
            true => quantile(0.95, f64::INFINITY).powi(2),
            false => quantile(0.95, degrees).powi(2) * fit.chi2 / degrees,
        };
        for end in own.ends {
            let End::Crossed(at) = end else {
                panic!("{end:?}")
            };
            let fixed = format!("start = {at}, fixed = true");
            let prior = if rate.contains("prior") {
                ((at - 0.6) / 0.1).powi(2)
            } else {
                0.0
            };
            let found = objective(folder, 2, &rest(&fixed)) + prior - fit.objective;
            assert_near(found / excess, 1.0, 2e-3);
        }
    }
}

/// A value for each run is profiled run by run: it is the profile of that run alone.
#[test]
fn parameters_of_runs_have_the_profiles_of_their_runs() {
    let folder = folder(2, 15, 0.0);
    let rest = format!(
        "{MEASURED}[parameters]\n\"m.rate\" = {{ per = \"run\" }}\n\"m.x0\" = {{ per = \"run\", max = 3.4 }}\n"
    );
    let (fit, profiles) = profiled(folder.path(), 2, &rest);
    let names: Vec<&str> = profiles.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "m.rate (run0.csv)",
            "m.rate (run1.csv)",
            "m.x0 (run0.csv)",
            "m.x0 (run1.csv)"
        ]
    );
    let alone = |fixed: &str| {
        format!("{MEASURED}[parameters]\n\"m.rate\" = {{ {fixed} }}\n\"m.x0\" = {{ max = 3.4 }}\n")
    };
    let others = fit.objective - objective(folder.path(), 1, &alone(""));
    let own = &profiles[0].1;
    for point in own.points.iter().step_by(2) {
        let fixed = format!("start = {}, fixed = true", point.value);
        let expected = others + objective(folder.path(), 1, &alone(&fixed));
        assert_near(point.objective, expected, 1e-6);
    }
    assert!(matches!(own.ends, [End::Crossed(_), End::Crossed(_)]));
}

/// What the spread of so many replicates is of each parameter, and the standard deviation of the fit.
fn spreads(runs: usize, samples: usize, correlation: f64, kind: Kind) -> Vec<(Spread, f64)> {
    const REPLICATES: u64 = 400;
    let folder = folder(runs, samples, correlation);
    let rest = format!(
        "{MEASURED}[parameters]\n\"m.rate\" = {{}}\n\"m.x0\" = {{}}\n[derived]\nhalf_life = \"log(2) / m.rate\"\n"
    );
    let file = problem(folder.path(), runs, &rest);
    let posed = Posed::new(&file, &part::open).unwrap();
    let found = solved(&posed);
    let study = study(&posed, &found).unwrap();
    let numbers: Vec<u64> = (0..REPLICATES).collect();
    let replicates = study.bootstrap((kind, 5), &numbers, &|_| (), &Watch::default());
    assert_eq!(replicates.len() as u64, REPLICATES);
    let sure = found.uncertainty.as_ref().unwrap();
    let all = sure.intervals.iter().chain(&sure.derived);
    let of = |(k, intervals): (usize, &Vec<_>)| {
        let values = replicates.iter().map(|own| own.values.as_ref().unwrap()[k]);
        let interval: &pilotage_inference::Interval = &intervals[0];
        (spread(values, 0.95).unwrap(), interval.sd)
    };
    all.enumerate().map(of).collect()
}

/// The model of the noise is that of the covariance `ar`, and 400 replicates tell a standard deviation to 3.5 %.
#[test]
fn parametric_bootstraps_spread_as_the_covariance_of_coloured_noise_says() {
    for correlation in [0.0, 0.8] {
        for (spread, sd) in spreads(2, 100, correlation, Kind::Parametric) {
            assert_near(spread.sd / sd, 1.0, 0.13);
            assert_near((spread.high - spread.low) / (2.0 * 1.96 * sd), 1.0, 0.2);
        }
    }
}

/// Of twelve runs the jackknife (cr3) and whole runs that are drawn estimate the same variance, each from twelve values;
/// the bootstrap's is smaller by 11/12.
#[test]
fn bootstraps_of_runs_spread_as_the_jackknife_says() {
    for (spread, sd) in spreads(12, 30, 0.9, Kind::Runs) {
        assert_near(spread.sd / ((11.0 / 12.0_f64).sqrt() * sd), 1.0, 0.15);
    }
}

/// Levels that are sought, columns of levels, logarithms and heavy tails are drawn as they were said to be: replicates
/// spread as the covariance says.
#[test]
fn parametric_bootstraps_know_all_kinds_of_noise() {
    let folder = folder(2, 60, 0.0);
    for noise in [
        "sd = \"sigma\"",
        "sd = \"0.1 + 0 * y\"",
        "noise = \"log-normal\"\nsd = \"sigma\"",
        "noise = \"laplace\"\nsd = \"sigma\"",
        "noise = \"student\"\nsd = \"sigma\"",
        "noise = \"huber\"\nsd = \"sigma\"",
    ] {
        // Colour is drawn of normal noise alone.
        let method = if noise.starts_with("noise = \"log") || noise.starts_with("sd") {
            "ar"
        } else {
            "plain"
        };
        // Logarithms are of values above 0: those of the first part of each run.
        let level = if noise.contains("sigma") {
            "sigma = { start = 0.1, min = 1e-3 }\n"
        } else {
            ""
        };
        let path = folder.path();
        if noise.contains("log-normal") {
            for j in 0..2 {
                let name = path.join(format!("run{j}.csv"));
                let text = std::fs::read_to_string(&name).unwrap();
                let rows: Vec<&str> = text.lines().take(30).collect();
                std::fs::write(name, rows.join("\n") + "\n").unwrap();
            }
        }
        let rest = format!(
            "{MEASURED}{noise}\n[parameters]\n\"m.rate\" = {{}}\n\"m.x0\" = {{}}\n{level}[fit]\ncovariance = \"{method}\"\n"
        );
        let file = problem(path, 2, &rest);
        let posed = Posed::new(&file, &part::open).unwrap();
        let found = solved(&posed);
        let study = study(&posed, &found).unwrap();
        let numbers: Vec<u64> = (0..300).collect();
        let replicates =
            study.bootstrap((Kind::Parametric, 2), &numbers, &|_| (), &Watch::default());
        let converged = replicates.iter().filter_map(|own| own.values.as_ref());
        let converged: Vec<&Vec<f64>> = converged.collect();
        assert!(converged.len() > 290, "{noise}: {}", converged.len());
        let sure = found.uncertainty.as_ref().unwrap();
        for (k, intervals) in sure.intervals.iter().enumerate().take(2) {
            let own = spread(converged.iter().map(|values| values[k]), 0.95).unwrap();
            assert!(
                (own.sd / intervals[0].sd - 1.0).abs() < 0.25,
                "{noise}: {own:?} {intervals:?}"
            );
        }
    }
}

/// A prior is one more datum: with the data nearly silent, replicates spread as it does.
#[test]
fn priors_are_drawn_too() {
    let folder = folder(4, 15, 0.0);
    let rest = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = 50\n[parameters]\n\
                \"m.rate\" = { prior = { normal = [0.7, 0.05] } }\n";
    let file = problem(folder.path(), 4, rest);
    let posed = Posed::new(&file, &part::open).unwrap();
    let found = solved(&posed);
    let study = study(&posed, &found).unwrap();
    let numbers: Vec<u64> = (0..300).collect();
    for (kind, expected) in [(Kind::Parametric, 0.05), (Kind::Runs, 0.0)] {
        let replicates = study.bootstrap((kind, 2), &numbers, &|_| (), &Watch::default());
        let values = replicates
            .iter()
            .filter_map(|own| Some(own.values.as_ref()?[0]));
        assert_near(spread(values, 0.95).unwrap().sd, expected, 0.007);
    }
}
