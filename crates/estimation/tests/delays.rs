//! Delays without an order: exact where they take recorded inputs alone, and else of an order that is raised.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit_delays, part};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;

/// Time between samples \[s\], and their number.
const STEP: f64 = 0.05;
const COUNT: usize = 401;

/// A lag behind a delay.
fn model(delayed: &str) -> String {
    format!(
        "[model]\nname = \"m\"\n[inputs]\nu = {{}}\n[parameters]\ngain = {{ start = 1, min = 0.01 }}\n\
         lag = {{ start = 0.5, min = 0.01, unit = \"s\" }}\ntau = {{ start = 1, min = 0.01, max = 3, unit = \"s\" }}\n\
         [states]\nx.der = \"({delayed} - x) / lag\"\n"
    )
}

const PROBLEM: &str = "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n\
                       [parameters]\n\"m.gain\" = {}\n\"m.lag\" = {}\n\"m.tau\" = {}\n[initial]\n\"m.x\" = 0\n";

#[derive(Debug, Clone, Copy, PartialEq)]
enum Hold {
    Zero,
    Linear,
}

/// A signal by its samples.
type Shape = fn(usize) -> f64;

/// A square wave of period 4 s that begins at 0.
fn square(k: usize) -> f64 {
    match k {
        0..7 => 0.0,
        _ if ((k - 7) / 40).is_multiple_of(2) => 1.0,
        _ => -1.0,
    }
}

/// A square wave of another period with a rough signal on it, which does not begin at 0.
fn rough(k: usize) -> f64 {
    let t = k as f64;
    0.7 + (0.9 * t).sin() + (2.3 * t).cos() + square(k)
}

/// Solution at the samples of T ẋ = K u(t - τ) - x from 0, with u = 0 before the first sample: between the times at which its line
/// changes it is the particular solution K (u - T u̇) and an exponential.
fn response(u: &[f64], hold: Hold, [gain, lag, tau]: [f64; 3]) -> Vec<f64> {
    let at = |k: usize| STEP * k as f64;
    let line = |time: f64| -> [f64; 2] {
        let place = ((time - tau) / STEP + 1e-9).floor();
        if place < 0.0 {
            return [0.0; 2];
        }
        let k = (place as usize).min(COUNT - 1);
        let slope = match hold {
            Hold::Linear if k + 1 < COUNT => (u[k + 1] - u[k]) / STEP,
            _ => 0.0,
        };
        [u[k] + slope * (time - tau - at(k)), slope]
    };
    let mut times: Vec<f64> = (0..COUNT).flat_map(|k| [at(k), at(k) + tau]).collect();
    times.sort_by(f64::total_cmp);
    let (mut x, mut found) = (0.0, Vec::new());
    for pair in times.windows(2) {
        if found.len() < COUNT && pair[0] == at(found.len()) {
            found.push(x);
        }
        let [from, to] = [pair[0], pair[1]];
        let [middle, slope] = line(0.5 * (from + to));
        let particular = |t: f64| gain * (middle + slope * (t - 0.5 * (from + to)) - lag * slope);
        x = particular(to) + (x - particular(from)) * (-(to - from) / lag).exp();
    }
    found
}

fn fitted(model: &str, hold: Hold, data: [&[f64]; 2], options: &str) -> Fit {
    fitted_with(PROBLEM, model, hold, data, options)
}

fn fitted_with(problem: &str, model: &str, hold: Hold, [u, x]: [&[f64]; 2], options: &str) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), model).unwrap();
    let rows = (0..COUNT).map(|k| format!("{},{},{}\n", STEP * k as f64, u[k], x[k]));
    let rows = "time,u,x\n".to_owned() + &rows.collect::<String>();
    std::fs::write(folder.path().join("r.csv"), rows).unwrap();
    let hold = match hold {
        Hold::Zero => "zero-order",
        Hold::Linear => "linear",
    };
    let text = format!(
        "{problem}[inputs]\n\"m.u\" = {{ column = \"u\", hold = \"{hold}\" }}\n[[run]]\nfile = \"r.csv\"\n[fit]\n{options}"
    );
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    let (_, fit) = fit_delays(&posed, &mut |_| ControlFlow::Continue(()));
    assert!(fit.is_answer(), "{:?} {:?}", fit.status, fit.diagnostics);
    fit
}

fn values(fit: &Fit) -> [f64; 3] {
    ["m.gain", "m.lag", "m.tau"].map(|name| fit.value(name).unwrap())
}

const TRUE: [f64; 3] = [2.0, 0.3, 1.3];

#[track_caller]
fn assert_near(found: [f64; 3], truth: [f64; 3], most: f64) {
    for (own, expected) in found.iter().zip(&truth) {
        assert!((own - expected).abs() < most, "{found:?} is not {truth:?}");
    }
}

fn noise(seed: u64, deviation: f64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let one = |_| deviation * Distribution::<f64>::sample(&StandardNormal, &mut random);
    (0..COUNT).map(one).collect()
}

/// Distance of each estimate from the truth, in standard deviations, and whether its interval of 95 % has it.
fn off(fit: &Fit, truth: [f64; 3]) -> [(f64, bool); 3] {
    let found = values(fit);
    let sure = fit.uncertainty.as_ref().unwrap();
    [0, 1, 2].map(|k| {
        let own = &sure.intervals[k][0];
        let is_within = own.low <= truth[k] && truth[k] <= own.high;
        ((found[k] - truth[k]) / own.sd, is_within)
    })
}

/// Whatever part of a sample the delay is, and whatever is between the samples.
#[test]
fn a_delay_of_a_recorded_input_is_exact() {
    for shape in [square as Shape, rough] {
        let u: Vec<f64> = (0..COUNT).map(shape).collect();
        for hold in [Hold::Zero, Hold::Linear] {
            for tau in [1.3, 1.317, 0.03] {
                let truth = [TRUE[0], TRUE[1], tau];
                let x = response(&u, hold, truth);
                let fit = fitted(&model("gain * delay(u, tau)"), hold, [&u, &x], "");
                assert_near(values(&fit), truth, 2e-6);
                assert_eq!(fit.delays, None);
            }
        }
    }
}

/// A known delay of 1.3 s under a square wave: its interval has it, as often as it says; that of an approximation has it not.
#[test]
fn intervals_of_a_delay_hold_it() {
    let u: Vec<f64> = (0..COUNT).map(square).collect();
    let pure = response(&u, Hold::Zero, TRUE);
    let noisy = |seed: u64| -> Vec<f64> {
        let noise = noise(seed, 0.02);
        pure.iter().zip(noise).map(|(x, e)| x + e).collect()
    };
    let runs = 20;
    let mut within = [0; 3];
    for seed in 0..runs {
        let fit = fitted(
            &model("gain * delay(u, tau)"),
            Hold::Zero,
            [&u, &noisy(seed)],
            "starts = 1\n",
        );
        for (count, (distance, is_within)) in within.iter_mut().zip(off(&fit, TRUE)) {
            *count += usize::from(is_within);
            assert!(distance.abs() < 4.0, "{seed}: {distance}");
        }
    }
    // Of 20 intervals of 95 % fewer than 16 hold the truth once in 400 times.
    assert!(within.iter().all(|own| *own >= 16), "{within:?}");
}

/// With gain and lag known an approximation of any order that can be given is off by more than the data allow; the recording is not.
#[test]
fn an_approximation_is_off() {
    let u: Vec<f64> = (0..COUNT).map(square).collect();
    let noise = noise(1, 0.02);
    let x: Vec<f64> = response(&u, Hold::Zero, TRUE)
        .iter()
        .zip(noise)
        .map(|(x, e)| x + e)
        .collect();
    let known = |delay: &str| {
        model(delay)
            .replace("start = 1,", "start = 2,")
            .replace("0.5", "0.3")
    };
    let tau = |delay: &str| {
        let model = known(&format!("gain * {delay}"));
        let problem = PROBLEM.replace("\"m.gain\" = {}\n\"m.lag\" = {}\n", "");
        let model = model.replace("tau = { start = 2,", "tau = { start = 1,");
        let fit = fitted_with(&problem, &model, Hold::Zero, [&u, &x], "starts = 1\n");
        let own = &fit.uncertainty.as_ref().unwrap().intervals[0][0];
        (fit.value("m.tau").unwrap(), *own)
    };
    let (value, own) = tau("delay(u, tau)");
    assert!(
        (value - 1.3).abs() < 3e-3 && own.low < 1.3 && 1.3 < own.high,
        "{value}"
    );
    // The highest order that can be given is still off by several deviations of the exact delay.
    for order in 1..=5 {
        let (value, approximate) = tau(&format!("delay(u, tau, {order})"));
        let off = (value - 1.3).abs();
        assert!(
            off > 4.0 * own.sd && approximate.sd > own.sd,
            "{order}: {value}"
        );
    }
}

/// What is not linear in the input, and what does not vanish with it, are shifted, too, and were 0 before the run.
#[test]
fn expressions_of_inputs_are_delayed() {
    let u: Vec<f64> = (0..COUNT).map(rough).collect();
    let bent: Vec<f64> = u.iter().map(|u| u.min(1.0) - 2.0).collect();
    for tau in [1.3, 1.317] {
        let truth = [2.0, 0.3, tau];
        let x = response(&bent, Hold::Zero, truth);
        let own = model("gain * delay(min(u, 1) - 2, tau)");
        let fit = fitted(&own, Hold::Zero, [&u, &x], "");
        assert_near(values(&fit), truth, 2e-6);
        // With what is sought within the delay.
        let shifted: Vec<f64> = u.iter().map(|u| u - 2.0).collect();
        let x = response(&shifted, Hold::Linear, truth);
        let own = model("delay(gain * (u - 2), tau)");
        let fit = fitted(&own, Hold::Linear, [&u, &x], "");
        assert_near(values(&fit), truth, 2e-6);
    }
}

/// Any scheme, and meshes that are not refined.
#[test]
fn delays_are_seen_on_any_mesh() {
    let u: Vec<f64> = (0..COUNT).map(square).collect();
    let truth = [2.0, 0.3, 1.317];
    let x = response(&u, Hold::Zero, truth);
    for (options, most) in [
        ("mesh = \"samples\"", 1e-3),
        ("scheme = \"gauss-2\"", 1e-4),
        ("scheme = \"radau-3\"", 1e-4),
        ("scheme = \"trapezoid\"", 1e-4),
        ("scheme = \"lgl-5\"", 1e-4),
        ("scheme = \"finite-difference-4\"", 1e-4),
    ] {
        let options = format!("starts = 1\n{options}\n");
        let fit = fitted(
            &model("gain * delay(u, tau)"),
            Hold::Zero,
            [&u, &x],
            &options,
        );
        assert_near(values(&fit), truth, most);
    }
}

/// A delay between two lags is that of the recorded input, which is exact: order by order the estimates come to those of the same
/// system with the delay in front, within what they are said to move.
#[test]
fn the_order_is_raised_until_the_estimates_stay() {
    const FIRST: f64 = 0.4;
    let [gain, lag, tau] = TRUE;
    let model = |first: &str, second: &str| {
        let rate = format!("({second} - x) / lag");
        let whole = model("").replace("( - x) / lag", &rate);
        whole + &format!("first.der = \"({first} - first) / {FIRST}\"\n")
    };
    let sine = |k: usize| (0.05 * k as f64).sin() + (0.13 * k as f64).sin();
    let signals: [(Shape, f64, usize, bool); 3] = [
        (sine, 0.03, 8, true),
        (square, 0.1, 18, true),
        (square, 0.001, 27, false),
    ];
    for (shape, deviation, order, is_enough) in signals {
        let u: Vec<f64> = (0..COUNT).map(shape).collect();
        // Partial fractions of two lags in series.
        let [one, two] = [FIRST, lag].map(|own| response(&u, Hold::Zero, [gain, own, tau]));
        let noise = noise(3, deviation);
        let pairs = one.iter().zip(&two).zip(noise);
        let pure = |one: &f64, two: &f64| (FIRST * one - lag * two) / (FIRST - lag);
        let x: Vec<f64> = pairs.map(|((one, two), e)| pure(one, two) + e).collect();
        let exact = model("delay(u, tau)", "gain * first");
        let exact = fitted(&exact, Hold::Zero, [&u, &x], "starts = 1\n");
        let raised = model("u", "gain * delay(first, tau)");
        let raised = fitted(&raised, Hold::Zero, [&u, &x], "starts = 1\n");
        let own = raised.delays.as_ref().unwrap();
        assert_eq!((own.order, own.is_enough), (order, is_enough), "{own:?}");
        assert_eq!(own.words().contains("a wider band"), !is_enough);
        if is_enough {
            let distances = off(&raised, values(&exact));
            assert!(
                distances.iter().all(|own| own.0.abs() < 0.2),
                "{distances:?}"
            );
            assert!(off(&raised, TRUE).iter().all(|own| own.1));
            assert!(
                raised.refinement.iterations < 70,
                "{}",
                raised.refinement.iterations
            );
        }
    }
}
