//! Standard deviations and intervals of fits whose covariance has a formula: `x(t) = x0 e^(-rate t)`.

use nalgebra::{DMatrix, DVector};
use pilotage_estimation::uncertainty::{Uncertainty, Unsure};
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_inference::{Class, Interval, Method, Obstacle, quantile};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::ops::ControlFlow;

const DECAY: &str = "[model]\nname = \"decay\"\n[parameters]\nrate = 0.5\nx0 = 2.0\nidle = 1.0\n[states]\n\
                     x = { start = \"x0\", der = \"-rate * x\" }\n";
const SAMPLES: usize = 40;

fn time(k: usize) -> f64 {
    0.1 * k as f64
}

/// Recorded values: of run `j` with rate 0.7, x0 = 3 and normal noise of 0.05.
fn recorded(j: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(100 + j as u64);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let value = |k: usize| 3.0 * (-0.7 * time(k)).exp() + 0.05 * gauss();
    (0..SAMPLES).map(value).collect()
}

/// The fit of a problem with so many runs.
fn fitted(runs: usize, rest: &str) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("decay.toml", DECAY);
    let mut text = "[system.m]\nmodel = \"decay.toml\"\n".to_owned() + rest;
    for j in 0..runs {
        let values = recorded(j);
        let rows = values
            .iter()
            .enumerate()
            .map(|(k, x)| format!("{},{x}\n", time(k)));
        write(
            &format!("run{j}.csv"),
            &("time,x\n".to_owned() + &rows.collect::<String>()),
        );
        write!(text, "[[run]]\nfile = \"run{j}.csv\"\n").unwrap();
    }
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
    assert!(found.is_answer(), "{:?}", found.diagnostics);
    found
}

const MEASURED: &str = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n";

fn sure(fit: &Fit) -> &Uncertainty {
    fit.uncertainty.as_ref().unwrap()
}

fn interval(fit: &Fit, name: &str) -> Interval {
    let place = fit
        .parameters
        .iter()
        .position(|own| own.name == name)
        .unwrap();
    sure(fit).intervals[place][0]
}

fn value(fit: &Fit, name: &str) -> f64 {
    fit.parameters
        .iter()
        .find(|own| own.name == name)
        .unwrap()
        .values[0]
        .1
}

/// Derivatives of the samples by rate and x0.
fn jacobian(rate: f64, x0: f64) -> DMatrix<f64> {
    DMatrix::from_fn(SAMPLES, 2, |k, i| match i {
        0 => -time(k) * x0 * (-rate * time(k)).exp(),
        _ => (-rate * time(k)).exp(),
    })
}

fn residuals(j: usize, rate: f64, x0: f64) -> DVector<f64> {
    let recorded = recorded(j);
    DVector::from_fn(SAMPLES, |k, _| recorded[k] - x0 * (-rate * time(k)).exp())
}

#[track_caller]
fn assert_near(found: f64, expected: f64, relative: f64) {
    assert!(
        (found / expected - 1.0).abs() < relative,
        "{found} is not {expected}"
    );
}

const BOTH: &str = "[parameters]\n\"m.rate\" = {}\n\"m.x0\" = {}\n";

#[test]
fn the_plain_covariance_is_that_of_the_formula() {
    let fit = fitted(
        1,
        &format!("{MEASURED}{BOTH}[fit]\ncovariance = \"plain\"\n"),
    );
    let (rate, x0) = (value(&fit, "m.rate"), value(&fit, "m.x0"));
    let j = jacobian(rate, x0);
    let s2 = residuals(0, rate, x0).norm_squared() / (SAMPLES as f64 - 2.0);
    let expected = (j.tr_mul(&j)).try_inverse().unwrap() * s2;
    let found = &sure(&fit).covariance.matrix;
    assert!(
        (found - &expected).amax() < 1e-5 * expected.amax(),
        "{found} {expected}"
    );
    let own = interval(&fit, "m.rate");
    let half = quantile(0.95, SAMPLES as f64 - 2.0) * expected[(0, 0)].sqrt();
    assert_near(own.sd, expected[(0, 0)].sqrt(), 1e-4);
    assert_near(own.high - own.low, 2.0 * half, 1e-4);
    assert_eq!(own.class, Class::Finite);
    let bound = 200.0 * expected[(0, 0)].sqrt() / rate;
    assert_near(sure(&fit).cramer_rao[0], bound, 1e-4);
    assert_near(
        sure(&fit).insensitivity[1],
        100.0 * (s2 / j.column(1).norm_squared()).sqrt() / x0,
        1e-4,
    );
    // A simulation says the same as a mesh with an error of 1e-6.
    let errors = sure(&fit).mesh_errors.as_ref().unwrap();
    assert!(errors.iter().all(|error| *error < 1e-4), "{errors:?}");
}

#[test]
fn from_four_runs_on_it_is_the_jackknife() {
    let fit = fitted(5, &format!("{MEASURED}{BOTH}"));
    let own = sure(&fit);
    assert_eq!(own.method, Method::Cr3);
    let (rate, x0) = (value(&fit, "m.rate"), value(&fit, "m.x0"));
    let j = jacobian(rate, x0);
    let rest = (j.tr_mul(&j) * 4.0).try_inverse().unwrap();
    let mut sum = DMatrix::zeros(2, 2);
    for run in 0..5 {
        let moved = &rest * j.tr_mul(&residuals(run, rate, x0));
        sum += 0.8 * &moved * moved.transpose();
    }
    let found = &own.covariance.matrix;
    assert!((found - &sum).amax() < 1e-4 * sum.amax(), "{found} {sum}");
    assert_near(
        interval(&fit, "m.x0").high,
        x0 + 2.776_445 * sum[(1, 1)].sqrt(),
        1e-5,
    );
}

#[test]
fn values_for_each_run_have_intervals_of_their_own() {
    let rest = "[parameters]\n\"m.rate\" = { per = \"run\" }\n\"m.x0\" = { per = \"run\" }\n";
    let fit = fitted(
        2,
        &format!("{MEASURED}{rest}[fit]\ncovariance = \"plain\"\n"),
    );
    let values = |name: usize, run: usize| fit.parameters[name].values[run].1;
    let of_run = |run: usize| residuals(run, values(0, run), values(1, run)).norm_squared();
    let s2 = (of_run(0) + of_run(1)) / (2.0 * SAMPLES as f64 - 4.0);
    for run in 0..2 {
        let j = jacobian(values(0, run), values(1, run));
        let expected = (j.tr_mul(&j)).try_inverse().unwrap() * s2;
        for name in 0..2 {
            assert_near(
                sure(&fit).intervals[name][run].sd,
                expected[(name, name)].sqrt(),
                1e-4,
            );
        }
    }
}

#[test]
fn on_a_bound_one_end_is_the_bound() {
    let rest = "[parameters]\n\"m.rate\" = { max = 0.6 }\n\"m.x0\" = {}\n";
    let fit = fitted(
        1,
        &format!("{MEASURED}{rest}[fit]\ncovariance = \"plain\"\n"),
    );
    let own = interval(&fit, "m.rate");
    assert_eq!((own.class, own.high), (Class::OnBound, 0.6));
    let (rate, x0) = (value(&fit, "m.rate"), value(&fit, "m.x0"));
    let j = jacobian(rate, x0);
    let s2 = residuals(0, rate, x0).norm_squared();
    let all = (j.tr_mul(&j)).try_inverse().unwrap();
    assert_near(
        own.sd,
        (all[(0, 0)] * s2 / (SAMPLES as f64 - 2.0)).sqrt(),
        1e-3,
    );
    assert!(own.low < 0.6 && own.low.is_finite());
    // The other one is estimated as if the rate were known.
    let known = (s2 / (SAMPLES as f64 - 1.0) / j.column(1).norm_squared()).sqrt();
    assert_near(interval(&fit, "m.x0").sd, known, 1e-4);
    assert_eq!(sure(&fit).correlations, DMatrix::identity(2, 2));
}

#[test]
fn a_constraint_and_a_run_s_own_bound_are_bounds_too() {
    let rest = "[[constraint]]\nexpression = \"m.rate\"\nmin = 0.8\nat = \"parameters\"\n";
    let fit = fitted(1, &format!("{MEASURED}{BOTH}{rest}"));
    let own = interval(&fit, "m.rate");
    assert_eq!(own.class, Class::OnBound);
    assert!((own.low - 0.8).abs() < 1e-5 && own.high > 0.8, "{own:?}");
    let rest =
        "[parameters]\n\"m.rate\" = {}\n\"m.x0\" = { per = \"run\", start = 4, min = 3.2 }\n";
    let fit = fitted(
        2,
        &format!("{MEASURED}{rest}[fit]\ncovariance = \"plain\"\n"),
    );
    for own in &sure(&fit).intervals[1] {
        assert_eq!((own.class, own.low), (Class::OnBound, 3.2));
        assert!(own.high > 3.2 && own.high < 4.0, "{own:?}");
    }
}

/// A standard deviation that is an expression of signals only is as wrong as the number that it is nearly.
#[test]
fn a_standard_deviation_of_signals_is_scaled_as_a_number() {
    let with = |sd: &str| {
        let measured = format!("[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = {sd}\n");
        let fit = fitted(
            1,
            &format!("{measured}{BOTH}[fit]\ncovariance = \"plain\"\n"),
        );
        let own = interval(&fit, "m.rate");
        (own.sd, own.high - own.low)
    };
    let (number, signal) = (with("0.01"), with("\"0.01 + 1e-12 * abs(m.x)\""));
    assert_near(signal.0, number.0, 1e-4);
    assert_near(signal.1, number.1, 1e-4);
}

#[test]
fn an_estimated_noise_level_has_its_fisher_information() {
    let measured = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = \"sigma\"\n";
    let rest =
        format!("{BOTH}sigma = {{ start = 0.1, min = 0.001 }}\n[fit]\ncovariance = \"plain\"\n");
    let fit = fitted(1, &format!("{measured}{rest}"));
    // The variance of the maximum likelihood estimate, made unbiased for the three unknowns.
    let sigma = value(&fit, "sigma") * (SAMPLES as f64 / (SAMPLES as f64 - 3.0)).sqrt();
    assert_near(
        interval(&fit, "sigma").sd,
        sigma / (2.0 * SAMPLES as f64).sqrt(),
        1e-4,
    );
    let j = jacobian(value(&fit, "m.rate"), value(&fit, "m.x0"));
    let expected = (j.tr_mul(&j)).try_inverse().unwrap() * sigma.powi(2);
    assert_near(interval(&fit, "m.rate").sd, expected[(0, 0)].sqrt(), 1e-4);
}

/// The slopes of Student's score `ψ = 5z/(4 + z²)` and of `zψ`, by differences, as means over the residuals.
#[test]
fn student_s_noise_has_its_observed_information() {
    let measured =
        "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = \"sigma\"\nnoise = \"student\"\n";
    let rest =
        format!("{BOTH}sigma = {{ start = 0.1, min = 0.001 }}\n[fit]\ncovariance = \"plain\"\n");
    let fit = fitted(1, &format!("{measured}{rest}"));
    let sigma = value(&fit, "sigma");
    let (rate, x0) = (value(&fit, "m.rate"), value(&fit, "m.x0"));
    let psi = |z: f64| 5.0 * z / (4.0 + z * z);
    let d = 1e-6;
    let [mut of_location, mut of_level] = [0.0; 2];
    for (k, x) in recorded(0).iter().enumerate() {
        let z = (x - x0 * (-rate * time(k)).exp()) / sigma;
        of_location += (psi(z + d) - psi(z - d)) / (2.0 * d * SAMPLES as f64);
        // ∂z/∂ ln sd is -z.
        let (above, below) = (z * (1.0 + d), z * (1.0 - d));
        of_level += (above * psi(above) - below * psi(below)) / (2.0 * d * SAMPLES as f64);
    }
    let j = jacobian(rate, x0);
    let sigma = sigma * (SAMPLES as f64 / (SAMPLES as f64 - 3.0)).sqrt();
    let expected = j.tr_mul(&j).try_inverse().unwrap() * sigma.powi(2) / of_location;
    assert_near(interval(&fit, "m.x0").sd, expected[(1, 1)].sqrt(), 1e-4);
    assert_near(
        interval(&fit, "sigma").sd,
        sigma / (of_level * SAMPLES as f64).sqrt(),
        1e-4,
    );
}

/// `sd² (Σ ψ²/(N - 2))/(mean ψ')² (JᵀJ)⁻¹` (Huber, *Robust Statistics*, 1981, section 7.6).
#[test]
fn huber_s_noise_has_his_covariance() {
    let measured = MEASURED.to_owned() + "sd = 0.05\nnoise = \"huber\"\n";
    let fit = fitted(
        1,
        &format!("{measured}{BOTH}[fit]\ncovariance = \"plain\"\n"),
    );
    let (rate, x0) = (value(&fit, "m.rate"), value(&fit, "m.x0"));
    let [mut squares, mut within] = [0.0; 2];
    for (k, x) in recorded(0).iter().enumerate() {
        let z = (x - x0 * (-rate * time(k)).exp()) / 0.05;
        squares += z.clamp(-1.345, 1.345).powi(2) / (SAMPLES as f64 - 2.0);
        within += f64::from(z.abs() < 1.345) / SAMPLES as f64;
    }
    assert!(within < 0.95, "some are beyond: {within}");
    let j = jacobian(rate, x0);
    let expected = j.tr_mul(&j).try_inverse().unwrap() * (0.05 / within).powi(2) * squares;
    assert_near(interval(&fit, "m.rate").sd, expected[(0, 0)].sqrt(), 1e-4);
    assert_near(interval(&fit, "m.x0").sd, expected[(1, 1)].sqrt(), 1e-4);
    assert!(sure(&fit).notes.is_empty(), "{:?}", sure(&fit).notes);
    // With a tenth of the level that the noise has, nearly all are outliers.
    let fit = fitted(1, &format!("{}{BOTH}", measured.replace("0.05", "0.005")));
    let note = &sure(&fit).notes[0];
    assert!(note.contains("% of `x` lie beyond the threshold"), "{note}");
}

#[test]
fn a_logarithm_has_a_symmetric_interval_and_what_is_tied_the_delta_method() {
    let rest = "[parameters]\n\"m.rate\" = { scale = \"log\" }\n\"m.x0\" = {}\nhalf_life = { value = \"ln(2) / m.rate\", \
                unit = \"s\" }\n[fit]\ncovariance = \"plain\"\n";
    let rest = rest.replace("ln(2)", "log(2)");
    let fit = fitted(1, &format!("{MEASURED}{rest}"));
    let (own, rate) = (interval(&fit, "m.rate"), value(&fit, "m.rate"));
    assert_near(own.low * own.high, rate * rate, 1e-9);
    let tied = interval(&fit, "half_life");
    assert_near(tied.sd, 2_f64.ln() / rate.powi(2) * own.sd, 1e-6);
    assert_eq!(sure(&fit).names, ["ln m.rate", "m.x0"]);
}

#[test]
fn priors_make_intervals_penalised() {
    let rest = "[parameters]\n\"m.rate\" = { prior = { normal = [0.7, 1e-3] } }\n\"m.x0\" = {}\n";
    let fit = fitted(
        1,
        &format!("{MEASURED}{rest}[fit]\ncovariance = \"plain\"\n"),
    );
    assert_near(interval(&fit, "m.rate").sd, 1e-3, 1e-2);
    assert!(sure(&fit).is_penalised);
    assert!(
        sure(&fit)
            .notes
            .iter()
            .any(|note| note.contains("penalised"))
    );
    // Of each run a value of its own, known beforehand.
    let rest = "[parameters]\n\"m.rate\" = { per = \"run\", prior = { normal = [0.7, 1e-3] } }\n\"m.x0\" = {}\n";
    let fit = fitted(2, &format!("{MEASURED}{rest}"));
    assert_near(sure(&fit).intervals[0][1].sd, 1e-3, 1e-2);
}

#[test]
fn what_cannot_be_told_apart_is_told_in_words() {
    let measured = "[[measured]]\nexpression = \"a * b * m.x\"\nunit = \"1\"\ncolumn = \"x\"\n";
    let rest = "[parameters]\na = { start = 1.0, min = 0.1, max = 10 }\nb = { start = 1.2, min = 0.1, max = 10 }\n\
                \"m.rate\" = {}\n[fit]\nstarts = 1\n";
    let fit = fitted(1, &format!("{measured}{rest}"));
    let (a, b) = (value(&fit, "a"), value(&fit, "b"));
    let note = &sure(&fit).notes[0];
    assert!(
        note.contains("cannot be told apart") && note.contains("`a`") && note.contains("`b`"),
        "{note}"
    );
    // Both have the same effect, so that either may come first.
    let expected = [a / b, b / a].map(|ratio| format!("{ratio:.2}"));
    let expected = expected.map(|ratio| ratio.trim_end_matches('0').to_owned());
    assert!(
        expected.iter().any(|ratio| note.contains(ratio)),
        "{note}: {a} {b}"
    );
    assert_eq!(interval(&fit, "a").class, Class::Flat);
    assert_eq!(interval(&fit, "m.rate").class, Class::Finite);
}

#[test]
fn what_cannot_be_is_refused_with_a_reason() {
    let rest = format!("{MEASURED}{BOTH}[fit]\ncovariance = \"cr3\"\n");
    let found = fitted(1, &rest).uncertainty.unwrap_err();
    assert_eq!(found, Unsure::Obstacle(Obstacle::FewRuns));
}
