//! Where starts begin.

use crate::pose::Posed;
use crate::pose::bare_run;
use crate::program::Program;
use pilotage_collocation::Quality;

/// Variables where start `k` begins: the earlier answer or the given guess, then controls at other levels and other durations, simulated.
pub fn start(posed: &Posed, program: &Program, k: usize) -> Vec<f64> {
    let k = match (&posed.earlier, k) {
        (Some(earlier), 0) => return earlier.variables(posed, program),
        (Some(_), k) => k - 1,
        (None, k) => k,
    };
    // Fractions of the ranges that fill it evenly: the plastic sequence.
    let fraction =
        |k: usize, c: usize| (0.5 + k as f64 * [0.754_877_666, 0.569_840_291][c % 2]).fract();
    let mut theta = posed.theta();
    if let (crate::program::Duration::Sought(d), true) = (posed.duration, k > 0) {
        let (low, high) = posed.parameters[d].limits;
        theta[d] = (theta[d] * [0.6, 1.6, 0.35, 2.5][(k - 1) % 4]).clamp(low, high);
    }
    let level = |c: usize| {
        let own = &posed.controls[c];
        let (low, high) = own.limits;
        match k > 0 && low.is_finite() && high.is_finite() {
            true => low + fraction(k, c) * (high - low),
            false => own.guess[0],
        }
    };
    let controls: Vec<f64> = (0..posed.controls.len()).map(level).collect();
    let linear = |tau: f64| -> Vec<f64> {
        let mix = |own: &crate::pose::Variable| own.guess[0] + tau * (own.guess[1] - own.guess[0]);
        posed.states.iter().map(mix).collect()
    };
    let simulated = (k > 0 || posed.is_simulated)
        .then(|| simulate(posed, program, &controls, &theta))
        .flatten();
    let states = |tau: f64| -> Vec<f64> {
        match &simulated {
            Some(course) => between(course, tau),
            None => linear(tau),
        }
    };
    posed.variables(program, &states, &|_| controls.clone(), &theta)
}

/// Times in τ, and states then.
type Course = (Vec<f64>, Vec<Vec<f64>>);

pub(super) fn between((times, states): &Course, tau: f64) -> Vec<f64> {
    let k = times
        .partition_point(|time| *time <= tau)
        .clamp(1, times.len() - 1);
    let part = (tau - times[k - 1]) / (times[k] - times[k - 1]);
    let pairs = states[k - 1].iter().zip(&states[k]);
    pairs.map(|(a, b)| a + part * (b - a)).collect()
}

/// The states with constant controls; none if they cannot be integrated to the end, or grow far beyond their sizes.
pub(super) fn simulate(
    posed: &Posed,
    program: &Program,
    controls: &[f64],
    theta: &[f64],
) -> Option<Course> {
    const FAR: f64 = 1e3;
    let model = &posed.equations[0];
    let mut x: Vec<f64> = posed.states.iter().map(|own| own.guess[0]).collect();
    x.extend_from_slice(controls);
    let run = bare_run([0.0, 1.0], vec![0.0; controls.len()], x.len());
    let quality = Quality {
        tolerance: 1e-6,
        magnitudes: program.model.scales.states.clone(),
        most_steps: 2000,
    };
    let course = model.course(&run, theta, &x, &quality, &|| false);
    let within = |x: &Vec<f64>| {
        let mut pairs = x.iter().zip(&program.model.scales.states);
        pairs.all(|(x, scale)| x.abs() <= FAR * scale)
    };
    let good = course.is_whole && course.time.len() > 1 && course.states.iter().all(within);
    let cut = |x: Vec<f64>| x[..posed.states.len()].to_vec();
    good.then(|| (course.time, course.states.into_iter().map(cut).collect()))
}
