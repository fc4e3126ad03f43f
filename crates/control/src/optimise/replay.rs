//! The controls, integrated again with error control.

use super::theta;
use crate::pose::Posed;
use crate::pose::bare_run;
use crate::program::Program;
use pilotage_collocation::Differentiated;
use pilotage_collocation::Quality;

/// Relative error of the replay.
const REPLAY: f64 = 1e-10;

/// What the controls do when the equations are integrated with error control.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// The objective of that flight.
    pub objective: f64,
    /// Its largest violation of a limit, relative to the size of the limited quantity, with its name.
    pub violation: f64,
    /// Name of the limited quantity that is violated most; empty if none is.
    pub violated: String,
    /// Largest distance of its states from those of the optimiser at the nodes, relative to their sizes.
    pub distance: f64,
    /// Whether the equations could be integrated to the end.
    pub is_whole: bool,
}

/// `[x u]` at the start or the end of an interval, in their units; a control that jumps has there its value of the interval.
pub(super) fn ends(program: &Program, z: &[f64], k: usize) -> [Vec<f64>; 2] {
    let (n, m) = (program.n(), program.m());
    [0, 2].map(|at| {
        let node = program.node(k + at / 2);
        let mut x = z[node..node + n].to_vec();
        x.extend((0..m).map(|c| {
            let (first, second) = program.weights(c, at);
            first * z[program.node(k) + n + c] + second * z[program.node(k + 1) + n + c]
        }));
        let scales = &program.model.scales.states;
        x.iter().zip(scales).map(|(x, scale)| x * scale).collect()
    })
}

/// The states at the end of an interval from given ones at its start, with the controls of the program, and what `see` makes
/// of the steps, of which there are at least `parts`; none if they cannot be integrated.
pub(super) fn integrated(
    posed: &Posed,
    program: &Program,
    (z, theta): (&[f64], &[f64]),
    (k, parts): (usize, usize),
    x: &[f64],
    see: &mut dyn FnMut(f64, &[f64]),
) -> Option<Vec<f64>> {
    let n = program.n();
    let [mut first, last] = ends(program, z, k);
    first[..n].copy_from_slice(x);
    let h = program.h(k);
    let slopes: Vec<f64> = first[n..]
        .iter()
        .zip(&last[n..])
        .map(|(a, b)| (b - a) / h)
        .collect();
    let quality = Quality {
        tolerance: REPLAY,
        magnitudes: program.model.scales.states.clone(),
        most_steps: 4000,
    };
    for part in 0..parts {
        let at = |part: usize| program.mesh[k] + h * part as f64 / parts as f64;
        let to = if part + 1 == parts {
            program.mesh[k + 1]
        } else {
            at(part + 1)
        };
        let run = bare_run([at(part), to], slopes.clone(), first.len());
        let course = posed.equations[0].course(&run, theta, &first, &quality, &|| false);
        let finite = course.states.iter().flatten().all(|x| x.is_finite());
        for (time, x) in course.time.iter().zip(&course.states) {
            see(*time, x);
        }
        first.clone_from(course.states.last()?);
        if !(course.is_whole && finite) {
            return None;
        }
    }
    first.truncate(n);
    Some(first)
}

/// Evaluates outputs of equations at a point in physical variables.
pub(super) fn outputs(model: &Differentiated, tau: f64, x: &[f64], theta: &[f64]) -> Vec<f64> {
    let slopes = vec![0.0; model.n_inputs()];
    model
        .evaluate(tau, x, &slopes, theta)
        .split_off(model.n_states())
}

/// Integrates the equations with the controls of a solution, with at least `parts` steps in each interval: what is shorter than
/// these may not be seen.
pub fn replay(posed: &Posed, program: &Program, z: &[f64], parts: usize) -> Certificate {
    let n = program.n();
    let theta = theta(posed, program, z);
    let scales = &program.model.scales.states;
    let [path, start, end] = &posed.equations;
    let mut worst = (0.0_f64, String::new());
    let mut note = |values: &[f64], of: &[crate::pose::Limited]| {
        for (value, own) in values.iter().zip(of) {
            let (low, high) = (own.limits.0 / own.size, own.limits.1 / own.size);
            let outside = (low - value).max(value - high);
            if own.name != "the objective" && (outside > worst.0 || outside.is_nan()) {
                worst = (outside, own.name.clone());
            }
        }
    };
    let [first, _] = ends(program, z, 0);
    note(&outputs(start, 0.0, &first, &theta), &posed.limited[1]);
    let mut x = first[..n].to_vec();
    let mut distance = 0.0_f64;
    let mut is_whole = true;
    for k in 0..program.intervals() {
        let mut see = |tau: f64, x: &[f64]| {
            if !posed.limited[0].is_empty() {
                note(&outputs(path, tau, x, &theta), &posed.limited[0]);
            }
        };
        let Some(next) = integrated(posed, program, (z, &theta), (k, parts), &x, &mut see) else {
            is_whole = false;
            break;
        };
        x = next;
        let node = &z[program.node(k + 1)..];
        for i in 0..n {
            distance = distance.max((x[i] / scales[i] - node[i]).abs());
        }
    }
    let [_, mut last] = ends(program, z, program.intervals() - 1);
    last[..n].copy_from_slice(&x);
    let values = outputs(end, 1.0, &last, &theta);
    note(&values[1..], &posed.limited[2]);
    // Under a maximum, the objective is the largest piece rather than the bound that the optimiser found.
    let pieces = values[1..].iter().zip(&posed.limited[2]);
    let pieces = pieces.filter(|(_, own)| own.name == "the objective");
    let highest = pieces
        .map(|(value, own)| value * own.size)
        .fold(f64::NEG_INFINITY, f64::max);
    Certificate {
        objective: if highest.is_finite() {
            values[0] + highest
        } else {
            values[0]
        },
        violation: worst.0.max(0.0),
        violated: if worst.0 > 0.0 {
            worst.1
        } else {
            String::new()
        },
        distance,
        is_whole,
    }
}
