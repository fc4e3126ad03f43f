//! The test of constant parameters: its size under coloured noise, and what it finds.

use nalgebra::{DMatrix, DVector};
use pilotage_inference::change::{Change, Course};
use pilotage_inference::{Data, Inference, Run};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const ROWS: usize = 200;
/// Correlation of the noise from row to row.
const COLOUR: f64 = 0.8;

/// Three runs of two regressors, with parameters by run and row, and noise whose size goes with the first regressor if asked.
fn found(seed: u64, is_modulated: bool, theta: impl Fn(usize, usize) -> [f64; 2]) -> Change {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let mut parts = Vec::new();
    for j in 0..3 {
        let phases = [gauss(), gauss(), gauss()].map(|own| 3.0 * own);
        let regressor = |t: usize, i: usize| {
            let t = t as f64;
            let [a, b, c] = phases;
            match i {
                0 => (0.11 * t + a).sin() + 0.5 * (0.37 * t + b).sin(),
                _ => (0.05 * t + c).cos(),
            }
        };
        let rows = DMatrix::from_fn(ROWS, 2, regressor);
        let mut noise = gauss();
        let observed = DVector::from_fn(ROWS, |t, _| {
            noise = COLOUR * noise + (1.0 - COLOUR * COLOUR).sqrt() * gauss();
            let size = if is_modulated {
                0.3 + rows[(t, 0)].abs()
            } else {
                1.0
            };
            let [first, second] = theta(j, t);
            rows[(t, 0)] * first + rows[(t, 1)] * second + 0.5 * size * noise
        });
        parts.push((rows, observed));
    }
    let information = parts.iter().map(|(rows, _)| rows.tr_mul(rows));
    let score = parts.iter().map(|(rows, observed)| rows.tr_mul(observed));
    let (zero, none) = (DMatrix::zeros(2, 2), DVector::zeros(2));
    let inverse = information
        .fold(zero, |sum, own| sum + own)
        .try_inverse()
        .unwrap();
    let estimate = inverse * score.fold(none, |sum, own| sum + own);
    let run = |(rows, observed): (DMatrix<f64>, DVector<f64>)| {
        let residuals = observed - &rows * &estimate;
        Run::of(rows, residuals)
    };
    let data = Data::of(parts.into_iter().map(run).collect());
    let change = Inference::new(&data).unwrap().change();
    change.expect("there are enough residuals")
}

/// Also where runs differ from each other, and where the noise grows with what is done.
#[test]
fn constant_parameters_are_rejected_as_rarely_as_the_level_says() {
    let sets = 200;
    for (what, is_modulated, spread) in [
        ("plain", false, 0.0),
        ("modulated", true, 0.0),
        ("apart", false, 1.0),
    ] {
        let p = (0..sets)
            .map(|seed| found(seed, is_modulated, |j, _| [1.0 + spread * j as f64, -2.0]).p);
        let p: Vec<f64> = p.collect();
        let share = |level: f64| p.iter().filter(|own| **own < level).count() as f64 / sets as f64;
        assert!(share(0.01) <= 0.04, "{what}: {}", share(0.01));
        assert!((0.0..0.1).contains(&share(0.05)), "{what}: {}", share(0.05));
        // The whole distribution is about uniform, or leans to larger p where two looks are counted as independent.
        assert!(share(0.5) < 0.62, "{what}: {}", share(0.5));
    }
}

#[test]
fn a_change_is_found_with_its_parameter_its_time_and_its_size() {
    let step = |t: usize| if t > 120 { 2.0 } else { 1.0 };
    let all = found(1, false, |_, t| [step(t), -2.0]);
    assert!(
        all.p < 1e-3 && all.run.is_none() && all.parameter == 0,
        "{all:?}"
    );
    let Course::Step(time) = all.course else {
        panic!("{all:?}")
    };
    assert!((time - 120.0).abs() < 10.0, "{all:?}");
    assert!((all.values[1] - all.values[0] - 1.0).abs() < 0.3, "{all:?}");
    assert!(all.values[0] < -0.2 && all.values[1] > 0.2, "{all:?}");
    // At times of their own, the largest change is that of one run.
    let one = found(2, false, |j, t| {
        [if j == 1 && t > 70 { 4.0 } else { 1.0 }, -2.0]
    });
    assert!(
        one.p < 1e-2 && one.run == Some(1) && one.parameter == 0,
        "{one:?}"
    );
    let drift = found(3, false, |_, t| [1.0 + t as f64 / 200.0, -2.0]);
    assert!(
        drift.p < 1e-3 && drift.parameter == 0 && drift.course == Course::Drift,
        "{drift:?}"
    );
}
